#!/usr/bin/env python3
"""Proofs that exact solutions are near those of the solver, as a table. SPDX-License-Identifier: BSD-3-Clause

    python3 benchmarks/contact/proofs.py TETHER FOLDER... [--tolerances 1e-6,1e-9]     # .dat and .hdf5 of the folders"""
import argparse
import csv
import io
import pathlib
import subprocess
import time

MOST = 1000  # contacts


def proved(tether, file, tolerance):
    """The row of `tether contact`, and the seconds of its solve and proof together."""
    begin = time.perf_counter()
    run = subprocess.run([tether, "contact", file, "--law", "coulomb", "--tolerance", tolerance, "--prove", "--csv"],
                         capture_output=True, text=True)
    return next(csv.DictReader(io.StringIO(run.stdout)), None), time.perf_counter() - begin


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("tether")
    arguments.add_argument("folders", nargs="+", type=pathlib.Path)
    arguments.add_argument("--tolerances", default="1e-6,1e-9")
    given = arguments.parse_args()
    files = [f for folder in given.folders for f in sorted(folder.iterdir()) if f.suffix in (".dat", ".hdf5")]
    print("| problem | contacts | tolerance | solver | proof | radius | change of b | s |\n|---|---|---|---|---|---|---|---|")
    counts = []
    for tolerance in given.tolerances.split(","):
        found = []
        for file in files:
            row, seconds = proved(given.tether, file, tolerance)
            if row is None or int(row["contacts"]) > MOST:
                continue
            found.append(row["proof"])
            print(f"| {file.name} | {row['contacts']} | {tolerance} | {row['status']} | {row['proof']} | "
                  f"{float(row['relative_radius']):.0e} | {float(row['relative_change']):.0e} | {seconds:.2f} |")
        counts.append(f"{tolerance}: {found.count('proven')} proven, {found.count('proven_nearby')} proven nearby, "
                      f"of {len(found)}.")
    print("\nOf problems of up to", MOST, "contacts, at the tolerance", *counts)


if __name__ == "__main__":
    main()
