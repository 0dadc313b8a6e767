#!/usr/bin/env python3
"""Writes benchmarks/results/*.md: what a command prints, with commit, machine and date. SPDX-License-Identifier: BSD-3-Clause

    python3 benchmarks/results.py [NAME...]      # all of them take an hour; --list names them, --index only lists what there is

Programs are those of build/release. Contact problems are looked for in TETHER_CONTACT_DATA, recorded
throws in TETHER_TOSSES, checkouts with robots in TETHER_ROBOTS. Comparisons of codes run with the SUNDIALS of TETHER_SUNDIALS or build/sundials, at -O3."""
import datetime
import os
import pathlib
import platform
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"
BUILT = "build/release/benchmarks"
TETHER = "build/release/scene/tether"
# SUNDIALS at -O3, which codes of one method are compared with: the distribution's is not optimised.
OPTIMISED = pathlib.Path(os.environ.get("TETHER_SUNDIALS") or ROOT / "build" / "sundials")
COMPARED = {"instructions", "accuracy_cost", "dae_set", "crossover", "stability", "chain_cost", "peers"}
# Name: title, how to read it, command from the root of the project.
COMMANDS = {
    "pendulum": ("The pendulum of Hanson and Krogh",
                 "End error, drift, steps and processor time of two pendulums in index 1 and index 0, with and without "
                 "constraints. \"never\": plain IDA fails, or does not become that accurate.",
                 "build/release/examples/pendulum/pendulum --quick"),
    "ablation": ("What each mechanism of the projection is worth", "python3 benchmarks/ablation/ablation.py"),
    "instructions": ("Instructions of a step", "python3 benchmarks/instructions/instructions.py"),
    "accuracy_cost": ("Error against processor time of every code",
                      "Columns: [how to read accuracy_cost](../README.md#how-to-read-accuracy_cost). Below 1 Tether is faster.",
                      f"{BUILT}/accuracy/accuracy_cost --count 5 --repeats 2 --seconds 0.1 --no-drift --no-reach "
                      "--skip four_bar,long,chain_of_100 | sed -n '/^CPU at equal error/,$p'"),
    "dae_set": ("The DAE problems of SciMLBenchmarks",
                "Fourteen problems, each first in the form of IDA there. GGL: index 2, stabilised (Gear, Gupta, Leimkuhler); w: "
                "accelerations are unknowns; suppressed: algebraic variables are out of the error test. The first table counts "
                "the tolerances at which a run ends, and in parentheses those with the digits asked less one. It compares Tether "
                "with the variant of IDA that has more digits: digits gained, evaluations of F and processor time over IDA's. A "
                "cell of the last tables: significant digits of the worst component, steps, evaluations of F, processor time in "
                "ms; \"limit\": beyond 30 s; more than 300000 steps fail. Digits are relative; absolute tolerances are in units "
                "of the reference. References: `examples/problems`.",
                f"{BUILT}/accuracy/dae_set --repeats 1 --seconds 30 --svg benchmarks/results/dae_set"),
    "crossover": ("Where RADAU5's advantage on small smooth problems ends",
                  "A cell: processor time of Tether over that of RADAU5 (both, ms; evaluations of F of both). Below 1 Tether is faster; "
                  "nan: one of them does not become that accurate.",
                  f"{BUILT}/accuracy/crossover --repeats 2"),
    "stability": ("Scatter of errors and steps over tolerances",
                  "The rms distance of log10 error and of log10 steps from a straight line over log10 tolerance.",
                  f"{BUILT}/accuracy/stability --count 30 --problem pendulum,car_axis,andrews --skip of_100,of_10,of_5,long"),
    "projection_cost": ("One projection step", f"{BUILT}/projection/projection_cost"),
    "chain_cost": ("Long chains beside plain IDA",
                   "Plain IDA in two forms: algebraic variables in its error test, and suppressed as the projection has them.",
                   f"{BUILT}/projection/chain_cost --links 100,1000 --tolerances 1e-4,1e-6 --end 0.1 --repeats 1"),
    "contact_ablation": ("What each stage and mechanism of the contact solver is worth",
                         "Each row: that mechanism alone is off. Problems are generated, from one seed. Work is counted by the library and "
                         "not timed; it is over that of the whole solver, of all solves and of those that both solve.",
                         "python3 benchmarks/contact/ablation/ablation.py"),
    "contact_collection": ("Contact problems in files",
                           "Problem, contacts, tolerance, measure of the residual; status, processor time, residual, sweeps/factorisations, "
                           "contacts replaced by others; the solver of Siconos that reaches the tolerance first, and our time over its. "
                           "Without one: none of Siconos reaches it within a second.",
                           f"{BUILT}/contact/contact_collection $TETHER_CONTACT_DATA --law coulomb --time-limit 1"
                           " | grep -E 'natural_map  |^tolerance|^unsolved'"),
    "contact_proofs": ("Exact solutions proven near those of the contact solver",
                       "Radius: largest distance of the exact solution, over the largest impulse. Change: of b, over its largest entry, so "
                       "that the solution is exact; 0: the problem itself. Seconds: program, solve and proof.",
                       f"python3 benchmarks/contact/proofs.py {TETHER} $TETHER_CONTACT_DATA tests/contact/collection"),
    "contact_scale": ("A sweep over many contacts", "Nanoseconds of a contact and sweep by size and threads.",
                      f"{BUILT}/contact/contact_scale --spheres 1 --threads 2 --most 100000"),
    "islands": ("Large islands: residual against time",
                "A cell is the residual by `evaluate` and the processor time in seconds; 1e-6 is wanted. \"Sweeps\" has no more than so "
                "many; \"Solver\" has the assembled problem and that work at most. A heap has settled, then the weight of one step acts "
                "on it (rest), one body in a hundred is hit, or all are shaken.",
                f"{BUILT}/contact/islands/islands --contacts 1000,10000 --mu 0.3,1 --sweeps 10000 --work 3e9"),
    "settling": ("Spheres that fall and settle, beside Bullet", "Residuals by `evaluate`, depth in parts of a radius.",
                 f"{BUILT}/contact/settling 3000 1 0"),
    "iftomm": ("The IFToMM mechanisms under `tether`",
               "Error at the times of the scene's reference, energy where it is kept, processor time of the whole program.",
               f"python3 benchmarks/mechanisms/iftomm.py {TETHER}"),
    "clearance": ("A slider-crank with clearance", "Work and error of the largest of three angles, rad, at the end.",
                  f"python3 benchmarks/clearance/clearance.py {TETHER}"),
    "peers": ("Joints, friction and impacts beside Bullet, ODE, MuJoCo, Siconos and Simbody",
              "Error: the largest distance of points of the bodies from the reference at ten equal times, m; sizes are near 1 m. "
              "References: `benchmarks/peers/references.py`. Times: processor time of the motion alone in ms, best of 3, at the "
              "errors that head the columns; \"-\": not within the limit of a run.",
              "cmake --build build/release --target peers >&2 && python3 benchmarks/peers/peers.py build/release/benchmarks/peers"),
    "tosses": ("Recorded throws of a cube",
               "470 throws by Pfrommer, Halm and Posa (DAIRLab/contact-nets), other than those that coefficients and settings are "
               "fitted to. Cells are medians, in parentheses upper quartiles. Distance: of the centre and two points of the cube, "
               "whose side is 104.8 mm, in the mean over the throw. What engines that agree with each other leave is not explained "
               "by a rigid cube with one coefficient each. The second row is what the measured start leaves open.",
               "cmake --build build/release --target peers >&2 && "
               "python3 benchmarks/tosses/tosses.py build/release/benchmarks/peers $TETHER_TOSSES"),
    "import": ("Robots of other programs as scenes",
               "All .urdf and .xml files of Daniella1/urdf_files_dataset, google-deepmind/dm_control and Farama-Foundation/Gymnasium, "
               "imported with the hulls of meshes and run for 0.02 s. A file that is imported only with an option is counted with it.",
               f"python3 benchmarks/import/survey.py {TETHER} $TETHER_ROBOTS/*"),
    "verify": ("Certificates of shipped scenes, judged by two checkers",
               "The certificate of each scene over its whole length, judged by `tether verify` and by `scene/tools/verify.py`, which shares no "
               "code with Tether. What they judge: [certificates](../../docs/certificate.md).",
               f"python3 benchmarks/certificates.py {TETHER} examples/scenes/*.toml"),
    "woodpecker": ("Glocker's woodpecker: events and steps at equal error",
                   "The largest distance (m) or angle (rad) of any body from a run with events at the least tolerance.",
                   f"{TETHER} cost examples/scenes/woodpecker.toml --tolerances 1e-3:1e-9 --accuracies 1e-3:1e-4"),
}


def printed(*command, shell=False, environment=None):
    return subprocess.run(command[0] if shell else command, shell=shell, cwd=ROOT, check=True, capture_output=True, text=True,
                          env=environment).stdout.strip("\n")


def processor():
    found = re.search(r"model name\s*: (.*)", pathlib.Path("/proc/cpuinfo").read_text()) if os.path.exists("/proc/cpuinfo") else None
    return f"{found.group(1) if found else platform.processor()}, {os.cpu_count()} cores"


def sundials(name):
    if name in COMPARED:
        return f"{OPTIMISED.relative_to(ROOT) if OPTIMISED.is_relative_to(ROOT) else OPTIMISED}, at -O3"
    cache = ROOT / "build" / "release" / "CMakeCache.txt"
    found = re.search(r"^SUNDIALS_DIR:PATH=(.*)", cache.read_text(), re.M) if cache.exists() else None
    return f"of the distribution, {found.group(1)}" if found else "as found"


def commit():
    changed = printed("git", "status", "--porcelain", "--untracked-files=no", "--", ".", ":!benchmarks/results", ":!*.md")
    return printed("git", "rev-parse", "--short", "HEAD") + (" with local changes" if changed else "")


def write(name):
    title, *reading, command = COMMANDS[name]
    for folder in re.findall(r"\$(TETHER_\w+)", command):
        if not os.environ.get(folder):
            return print(f"{name}: skipped, {folder} names no folder")
    how = "".join(" " + each for each in reading)
    environment = dict(os.environ)
    if name in COMPARED:
        if not (OPTIMISED / "lib").is_dir():
            return print(f"{name}: skipped, no SUNDIALS at -O3; sh benchmarks/optimised_sundials.sh build/sundials makes it")
        environment["LD_LIBRARY_PATH"] = f"{OPTIMISED}/lib:" + environment.get("LD_LIBRARY_PATH", "")
    print(f"{name}: {command}", flush=True)
    load, revision = os.getloadavg()[0], commit()
    text = printed(command, shell=True, environment=environment)
    if "\n|---" not in text:
        text = "```\n" + text + "\n```"
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"{name}.md").write_text(
        f"# {title}\n\nWritten by `python3 benchmarks/results.py {name}`.{how}\n\n"
        f"- Command: `{command}`\n- Commit: {revision}\n"
        f"- Machine: {processor()}; {printed('c++', '--version').splitlines()[0]}; SUNDIALS {sundials(name)}; load {load:.1f}\n"
        f"- Date: {datetime.date.today().isoformat()}\n\n{text}\n")


def index():
    """results/index.md: every kept result with its command, and their pictures."""
    lines = ["# Results", "", "Written by `python3 benchmarks/results.py --index`. [How to read them](../README.md).", "",
             "| result | command | commit | date |", "|---|---|---|---|"]
    for file in sorted(RESULTS.glob("*.md")):
        if file.name != "index.md":
            text = file.read_text()
            title, (revision, day) = text.split("\n", 1)[0].lstrip("# "), re.findall(r"^- (?:Commit|Date): (.*)", text, re.M)
            lines.append(f"| [{title}]({file.name}) | `python3 benchmarks/results.py {file.stem}` | {revision} | {day} |")
    lines += ["", "Pictures of [dae_set](dae_set.md): colours are codes, dashes are forms of the problem."]
    for file in sorted(RESULTS.glob("*/*.svg")):
        place = file.relative_to(RESULTS)
        lines += ["", f"![{file.stem.replace('_', ' ')}: error against time]({place})"]
    (RESULTS / "index.md").write_text("\n".join(lines) + "\n")


def main(names):
    if names == ["--index"]:
        return index()
    if names == ["--list"]:
        return print("\n".join(f"{name:20} {command}" for name, (*_, command) in COMMANDS.items()))
    unknown = [name for name in names if name not in COMMANDS]
    if unknown:
        return f"results.py: no result is called {unknown[0]}; there are {', '.join(COMMANDS)}"
    for name in names or COMMANDS:
        write(name)
    index()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
