#!/usr/bin/env python3
"""Counts the instructions of a step, with the projection and without, and prints a table. SPDX-License-Identifier: BSD-3-Clause

instructions.py [PROGRAM]: by valgrind over PROGRAM (default build/release/benchmarks/instructions/one_run), with the SUNDIALS of
build/sundials where benchmarks/optimised_sundials.sh has built it."""
import concurrent.futures
import os
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROBLEMS = (("lotka volterra", "index 0"), ("rigid body", "index 0"), ("pendulum", "index 0"), ("pendulum", "index 1"), ("car axis", "index 1"),
            ("car axis", "index 2"), ("akzo nobel", "index 1"))
TOLERANCE = "1e-6"


def optimised():
    libraries = ROOT / "build" / "sundials" / "lib"
    return {"LD_LIBRARY_PATH": str(libraries)} if libraries.is_dir() else {}


def count(program, problem, form, *settings):
    """Instructions within IDASolve, steps."""
    with tempfile.NamedTemporaryFile() as out:
        done = subprocess.run(["valgrind", "--tool=callgrind", f"--callgrind-out-file={out.name}", "--toggle-collect=IDASolve",
                               program, problem, form, TOLERANCE, *settings],
                              capture_output=True, text=True, check=True, env={**os.environ, **optimised()})
    return int(re.search(r"Collected : (\d+)", done.stderr).group(1)), int(done.stdout.split()[0])


def main(program):
    library = "-O3" if optimised() else "the distribution's"
    print(f"Instructions of a step at {TOLERANCE}; SUNDIALS: {library}. \"Fast\": with `fast_vector` and `fast_dense_solver`.\n")
    print("| problem | steps, plain | projected | plain | projected | plain, fast | projected, fast |")
    print("|---|---|---|---|---|---|---|")
    pool = concurrent.futures.ThreadPoolExecutor(os.cpu_count())
    settings = [(*plain, *fast) for fast in ((), ("fast",)) for plain in (("plain",), ())]
    for problem, form in PROBLEMS:
        runs = list(pool.map(lambda how: count(program, problem, form, *how), settings))
        cells = [str(runs[0][1]), str(runs[1][1])] + [f"{total / steps:.0f}" for total, steps in runs]
        print(f"| {problem}, {form} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else ROOT / "build" / "release" / "benchmarks" / "instructions" / "one_run")
