#!/usr/bin/env python3
"""Runs all problems without each mechanism of the projection and prints a table. SPDX-License-Identifier: BSD-3-Clause

ablation.py [BUILD]: configures and builds the ablation in BUILD (default build/projection_ablation); see benchmarks/results.py."""
import concurrent.futures
import os
import pathlib
import subprocess
import sys

import compare

ROOT = pathlib.Path(__file__).resolve().parents[2]


def runs(program, *options):
    return compare.table(subprocess.run([program, *options], check=True, capture_output=True, text=True).stdout.splitlines())


def worst_family(on, off):
    """The form of a problem whose steps times errors grow most."""
    families = {}
    for k in on:
        if k in off and on[k]["failed"] == off[k]["failed"] == "0":
            families.setdefault(k[:2], []).append(compare.ratio(off[k], on[k], "steps") *
                                                  compare.ratio(off[k], on[k], "error"))
    value, name = max((compare.mean(v), ", ".join(k)) for k, v in families.items())
    return f"{name}: {value:.2f}" if value > 1.05 else ""


def main(build):
    flags = ["-DTETHER_ABLATION=ON", "-DTETHER_BUILD_CONTACT=OFF", "-DTETHER_BUILD_SCENE=OFF", "-DTETHER_BUILD_TESTS=OFF",
             "-DTETHER_BUILD_PYTHON=OFF", "-DCMAKE_BUILD_TYPE=Release"]
    quiet = {"check": True, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    subprocess.run(["cmake", "-S", ROOT, "-B", build, *flags], **quiet)
    subprocess.run(["cmake", "--build", build, "--parallel", str(os.cpu_count()), "--target", "ablation"], **quiet)
    program = pathlib.Path(build) / "benchmarks" / "ablation" / "ablation"
    mechanisms = subprocess.run([program, "--mechanisms"], check=True, capture_output=True, text=True).stdout.splitlines()
    on = runs(program)
    print(f"Off / on over {len(on)} runs, geometric means; above 1 the mechanism pays. \"Failures\" are those that only "
          f"runs without it have.\n")
    groups = compare.GROUPS
    print(f"| without | changed | steps {' / '.join(groups)} | F | error | failures | most in steps times error |")
    print("|---|---|---|---|---|---|---|")
    pool = concurrent.futures.ThreadPoolExecutor(os.cpu_count())
    for name, off in zip(mechanisms, pool.map(lambda name: runs(program, "--without", name), mechanisms)):
        changed = sum(any(on[k][c] != off[k][c] for c in ("steps", "F", "error")) for k in on)
        columns = [compare.means(on, off, group)[1] for group in groups]
        cells = [" / ".join(f"{column[c]:.3f}" for column in columns) for c in ("steps", "F", "error")]
        print(f"| {name} | {changed} | {' | '.join(cells)} | {len(compare.new_failures(on, off))} | {worst_family(on, off)} |",
              flush=True)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else ROOT / "build" / "projection_ablation")
