#!/usr/bin/env python3
"""Do programs print what a document shows? SPDX-License-Identifier: BSD-3-Clause

    python3 docs/shown.py DOCUMENT NAME=PROGRAM...

A block ```text NAME ARGUMENTS is what a program prints: its lines must occur there in this order. Numbers in exponent
form, errors and rounding, agree to a factor of ten, or are smaller where the document shows rounding. Whole numbers from
1000 on, counts of work, agree to a factor of 1.5. All else is the same. Programs run in the root of the project; blocks of
programs that are not named are left out. A block ```python FILE.py is a program for the interpreter named `python`.
"""
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
SCRIPT = re.compile(r"^```python (\S+)\n(.*?)^```", re.M | re.S)
BLOCK = re.compile(r"^```text (\S[^\n]*)\n(.*?)^```", re.M | re.S)
ERROR = re.compile(r"[-+]?\d\.\d+e[-+]\d+")
ROUNDING = 1e-9


def agree(shown, printed):
    if shown == printed:
        return True
    if ERROR.fullmatch(shown) and ERROR.fullmatch(printed):
        a, b = abs(float(shown)), abs(float(printed))
        return b <= 10 * a and (b >= a / 10 or b <= ROUNDING)
    if shown.isdigit() and printed.isdigit():
        a, b = int(shown), int(printed)
        return a >= 1000 and a / 1.5 <= b <= a * 1.5
    return False


def is_line(shown, printed):
    a, b = shown.split(), printed.split()
    return len(a) == len(b) and all(agree(x, y) for x, y in zip(a, b))


def main(document, *named):
    programs = {name: [path] for name, path in (each.split("=", 1) for each in named)}
    text = pathlib.Path(document).read_text()
    folder = tempfile.TemporaryDirectory()
    for name, script in SCRIPT.findall(text) if "python" in programs else ():
        file = pathlib.Path(folder.name) / name
        file.write_text(script)
        programs[name] = [*programs["python"], str(file)]
    failed = count = 0
    for command, block in BLOCK.findall(text):
        name, *arguments = shlex.split(command)
        if name not in programs:
            continue
        count += 1
        run = subprocess.run([*programs[name], *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
        printed = iter(run.stdout.splitlines())
        for line in block.splitlines():
            if not any(is_line(line, other) for other in printed):
                print(f"{document}: {command} does not print: {line}\n{run.stdout}{run.stderr}")
                failed += 1
                break
    print(f"{document}: {count} blocks, {failed} wrong")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
