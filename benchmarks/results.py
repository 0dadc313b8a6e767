#!/usr/bin/env python3
"""Writes benchmarks/results/*.md: what a command prints, with commit, machine and date. SPDX-License-Identifier: BSD-3-Clause

    python3 benchmarks/results.py [NAME...]      # all of them take an hour; --list names them

Programs are those of build/release. Contact problems are looked for in TETHER_CONTACT_DATA."""
import datetime
import os
import pathlib
import platform
import re
import shlex
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"
BUILT = "build/release/benchmarks"
TETHER = "build/release/scene/tether"
# Name: title, command from the root of the project.
COMMANDS = {
    "pendulum": ("The pendulum of Hanson and Krogh", "build/release/examples/pendulum/pendulum"),
    "ablation": ("What each mechanism of the projection is worth", "python3 benchmarks/ablation/ablation.py"),
    "accuracy_cost": ("Error against processor time of every code",
                      f"{BUILT}/accuracy/accuracy_cost --count 5 --repeats 2 --no-drift --no-reach --skip four_bar,long,chain_of_100"),
    "crossover": ("Where RADAU5's advantage on small smooth problems ends", f"{BUILT}/accuracy/crossover --repeats 3"),
    "projection_cost": ("One projection step", f"{BUILT}/projection/projection_cost"),
    "chain_cost": ("Long chains", f"{BUILT}/projection/chain_cost"),
    "contact_collection": ("Contact problems in files", f"{BUILT}/contact/contact_collection $TETHER_CONTACT_DATA"),
    "contact_scale": ("A sweep over many contacts", f"{BUILT}/contact/contact_scale --spheres 1 --threads 2"),
    "iftomm": ("The IFToMM mechanisms under `tether`", f"python3 benchmarks/mechanisms/iftomm.py {TETHER}"),
    "clearance": ("A slider-crank with clearance", f"python3 benchmarks/clearance/clearance.py {TETHER}"),
}


def printed(*command):
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def processor():
    found = re.search(r"model name\s*: (.*)", pathlib.Path("/proc/cpuinfo").read_text()) if os.path.exists("/proc/cpuinfo") else None
    return f"{found.group(1) if found else platform.processor()}, {os.cpu_count()} cores"


def sundials():
    cache = ROOT / "build" / "release" / "CMakeCache.txt"
    found = re.search(r"^SUNDIALS_DIR:PATH=(.*)", cache.read_text(), re.M) if cache.exists() else None
    return found.group(1) if found else "as found"


def write(name):
    title, command = COMMANDS[name]
    if "$TETHER_CONTACT_DATA" in command and not os.environ.get("TETHER_CONTACT_DATA"):
        return print(f"{name}: skipped, TETHER_CONTACT_DATA names no folder")
    words = [os.path.expandvars(word) for word in shlex.split(command)]
    print(f"{name}: {command}", flush=True)
    text = printed(*words)
    lines = text.splitlines()
    if not any(line.startswith("|") for line in lines):
        text = "```\n" + text + "\n```"
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"{name}.md").write_text(
        f"# {title}\n\nWritten by `python3 benchmarks/results.py {name}`.\n\n"
        f"- Command: `{command}`\n- Commit: {printed('git', 'describe', '--always', '--dirty')}\n"
        f"- Machine: {processor()}; {printed('c++', '--version').splitlines()[0]}; SUNDIALS: {sundials()}\n"
        f"- Date: {datetime.date.today().isoformat()}\n\n{text}\n")


def main(names):
    if names == ["--list"]:
        return print("\n".join(f"{name:20} {command}" for name, (_, command) in COMMANDS.items()))
    unknown = [name for name in names if name not in COMMANDS]
    if unknown:
        return f"results.py: no result is called {unknown[0]}; there are {', '.join(COMMANDS)}"
    for name in names or COMMANDS:
        write(name)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
