#!/usr/bin/env python3
"""Do both judges pass certificates as they are, and find a hundred planted faults? SPDX-License-Identifier: BSD-3-Clause

    verify_faults.py TETHER SCENES"""
import contextlib
import math
import os
import pathlib
import random
import resource
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scene" / "tools"))
import verify  # noqa: E402
from verify import V, rotation  # noqa: E402

SCENES = {"rolling_sphere": 0.02, "icy_wedge": 0.01, "stack": 0.02, "cart": 0.002, "gripper": 0.004, "pulled_block": 0.04, "bricard": 0.1,
          "clearance": 0.0004, "hanging_frame": 0.5, "rocking_block": 2.0, "capstan": 0.02, "stick_slip": 0.3,
          "../../tests/scene/joined_turn": 0.02}
PART = 1e-3  # of a number: what a small fault changes


def pick(random_, lines, word, where=lambda n: True):
    """Index and numbers of a line of this word."""
    found = [k for k, line in enumerate(lines) if line.split(" ", 1)[0] == word and where(numbers(line))]
    k = random_.choice(found)
    return k, numbers(lines[k])


def numbers(line):
    out = []
    for field in line.split(" ")[1:]:
        try:
            out.append(float(field))
        except ValueError:
            break
    return out


def put(lines, k, n):
    fields = lines[k].rstrip("\n").split(" ")
    lines[k] = " ".join([fields[0], *(repr(x) for x in n), *fields[1 + len(n):]]) + "\n"


def pressed(n):
    return abs(V(n[16:19])) > 0.1 * PRESS


PRESS = 0.0  # the largest impulse or force of a contact of the certificate


def off_the_cone(random_, lines):
    k, n = pick(random_, lines, "contact", pressed)
    x = V(n[16:19])
    n[16:19] = x + V(n[8:11]).across() * (3 * abs(x))
    put(lines, k, n)


def swapped_sign(random_, lines):
    k, n = pick(random_, lines, "contact", pressed)
    n[16:19] = V(n[16:19]) * -1
    put(lines, k, n)


def turned_friction(random_, lines):
    k, n = pick(random_, lines, "contact", lambda n: abs(V(n[16:19]).beside(V(n[8:11]))) > 1e-2 * PRESS)
    x, normal = V(n[16:19]), V(n[8:11])
    n[16:19] = x - x.beside(normal) + (normal ^ x)
    put(lines, k, n)


def weaker_contact(random_, lines):
    k, n = pick(random_, lines, "contact", pressed)
    n[16:19] = V(n[16:19]) * (1 - PART)
    put(lines, k, n)


def lost_contact(random_, lines):
    k, n = pick(random_, lines, "contact", pressed)
    n[16:19] = [0.0] * 3
    put(lines, k, n)


def other_mass(random_, lines):
    k, n = pick(random_, lines, "body", lambda n: n[1] > 0)
    n[1] *= 1 + PART
    put(lines, k, n)


def shifted(random_, lines):
    k, n = pick(random_, lines, "to")
    n[1 + random_.randrange(3)] += PART * (1 + random_.random())
    put(lines, k, n)


def faster(random_, lines):
    k, n = pick(random_, lines, "to")
    n[8 + random_.randrange(3)] += 10 * PART * (1 + random_.random())
    put(lines, k, n)


def joints_pull(random_, lines):
    k, n = pick(random_, lines, "pull", lambda n: abs(n[1]) > 0.1 * PULL)
    n[1] *= 1 + PART
    put(lines, k, n)


PULL = 0.0  # the largest of a joint


def residual_claimed(random_, lines):
    k, n = pick(random_, lines, "part")
    n[3] += 1e-3
    put(lines, k, n)


def lost_push(random_, lines):
    k, _ = pick(random_, lines, "push", lambda n: abs(V(n[1:4])) > 1e-6)
    del lines[k]
    lines[-1] = f"end {len(lines) - 1}\n"


def turned_body(random_, lines):
    k, n = pick(random_, lines, "to")
    n[4:8] = V(n[4:8]).then(rotation(V((0.01, 0.0, 0.0))))
    put(lines, k, n)


def beyond_numbers(random_, lines):
    """Bounds that are parts of the speeds must not grow with them beyond all numbers."""
    k, n = pick(random_, lines, "to")
    n[8 + random_.randrange(3)] = 10.0 ** random_.choice((153, 160, 200, 308))
    put(lines, k, n)


def other_gravity(random_, lines):
    k, n = pick(random_, lines, "engine", lambda n: abs(V(n[0:3])) > 0)
    n[0:3] = V(n[0:3]) * 0.5
    put(lines, k, n)


def unsolved(random_, lines):
    k, n = pick(random_, lines, "step")
    n[3:5] = random_.choice(([n[3], 0.0], [1e9, 1.0]))
    put(lines, k, n)


FAULTS = (off_the_cone, swapped_sign, turned_friction, weaker_contact, lost_contact, other_mass, shifted, faster, joints_pull,
          residual_claimed, lost_push, turned_body, beyond_numbers, other_gravity, unsolved)


def judged(program, file, lines):
    """Exit codes of both judges; the second one's imports take longer than a certificate."""
    file.write_text("".join(lines))
    first = subprocess.run([program, "verify", str(file)], capture_output=True).returncode
    with contextlib.redirect_stdout(None):
        return first, verify.main([str(file)])


def damaged(random_, program, file, lines):
    """What is cut, or of wild bytes, is no certificate; what is accepted of it, or crashes."""
    text, bad = "".join(lines), []
    for wrong in ("", text[:-5], text[: len(text) // 2], "tether certificate 1\n", text.replace("engine", "motor", 1), text + "to 0\n",
                  text.replace("to 1 ", "to 77 "), text.replace("\npart", "\nlaw"), text.replace("\nto 1 ", "\nplaced 91 1 ", 1)):
        if judged(program, file, [wrong]) != (2, 2):
            bad.append(wrong[:40])
    missing = subprocess.run([program, "verify", f"{file}.missing"], capture_output=True, text=True)
    if missing.returncode != 2 or "no such file" not in missing.stdout + missing.stderr:
        bad.append("a file that is not there")
    file.write_text(lines[0])
    os.truncate(file, 1 << 34)  # a line that takes all memory
    for command in ([program, "verify"], [sys.executable, verify.__file__]):
        run = subprocess.run([*command, str(file)], capture_output=True, text=True, timeout=60,
                             preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30)))
        if run.returncode != 2 or "longer than any" not in run.stdout + run.stderr:
            bad.append(f"16 GiB without an end of line: {run.returncode}")
    for k in range(200):
        at, wild = random_.randrange(len(text)), random_.choice(["\0", "e999", "-", "nan", " ", "\n", "1e308", "\xff"])
        wrong = text[:at] + wild + text[at + 1:]
        if k % 2:  # a number, not a byte
            fields = text.split(" ")
            fields[random_.randrange(len(fields))] = random_.choice(["0", "-1", "1e308", "-1e200", "1e-320", "3.5"])
            wrong = " ".join(fields)
        codes = judged(program, file, [wrong])
        if not {0, 1, 2}.issuperset(codes):
            bad.append(f"exit codes {codes}")
    return bad


def main(program, scenes):
    global PRESS, PULL
    random_, found, planted, whole = random.Random(1), [0, 0], 0, {}
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "run.cert"
        for name, end in SCENES.items():
            subprocess.run([program, "run", f"{name}.toml", "--end", str(end), "--certificate", str(file), "--quiet"], cwd=scenes,
                           capture_output=True)
            whole[name] = file.read_text().splitlines(keepends=True)
            alone = subprocess.run([sys.executable, verify.__file__, str(file)], capture_output=True).returncode
            if (alone, *judged(program, file, whole[name])) != (0, 0, 0):
                verify.main([file])
                return f"{name}, as it was written, does not hold"
        bad = damaged(random_, program, file, whole["cart"])
        if bad:
            return f"damaged and not told so: {bad}"
        while planted < 100:
            fault, name = FAULTS[planted % len(FAULTS)], random_.choice(sorted(whole))
            lines = list(whole[name])
            PRESS = max((abs(V(numbers(each)[16:19])) for each in lines if each.startswith("contact ")), default=math.inf)
            PULL = max((abs(numbers(each)[1]) for each in lines if each.startswith("pull ")), default=math.inf)
            try:
                fault(random_, lines)
            except IndexError:  # nothing of the kind in it
                continue
            planted += 1
            codes = judged(program, file, lines)
            found = [n + (code == 1) for n, code in zip(found, codes)]
            if codes != (1, 1):
                print(f"{fault.__name__} in {name}: exit codes {codes}")
    print(f"{found[0]} and {found[1]} of {planted} planted faults found")
    return 0 if found == [100, 100] else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
