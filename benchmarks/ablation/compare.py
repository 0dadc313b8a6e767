#!/usr/bin/env python3
"""Compares tables of ablation: after / before, geometric means. SPDX-License-Identifier: BSD-3-Clause

compare.py before.csv after.csv; ends with 1 where a mean of steps or errors exceeds 1.03 or a run fails newly."""
import csv
import math
import sys

BOUND = 1.03
NOISE = 1e-13  # of an error
GROUPS = ("small", "mid", "big", "others", "rods")


def table(lines):
    return {(r["problem"], r["form"], r["tolerance"]): r for r in csv.DictReader(lines)}


def ratio(after, before, column):
    floor = NOISE if column == "error" else 1.0
    a, b = (max(float(r[column]), floor) for r in (after, before))
    return a / b if math.isfinite(a) and math.isfinite(b) else math.nan


def mean(values):
    logs = [math.log(v) for v in values if v == v]
    return math.exp(sum(logs) / len(logs)) if logs else math.nan


def means(before, after, group=None):
    """Runs that both have ended; after / before of steps, F and error over these."""
    whole = [k for k in before if k in after and group in (None, before[k]["class"])
             and before[k]["failed"] == after[k]["failed"] == "0"]
    return len(whole), {c: mean([ratio(after[k], before[k], c) for k in whole]) for c in ("steps", "F", "error")}


def new_failures(before, after):
    return [k for k in before if k in after and before[k]["failed"] < after[k]["failed"]]


def main(paths):
    tables = []
    for path in paths:
        with open(path, newline="") as lines:
            tables.append(table(lines))
    before, after = tables
    bad = any(k not in after for k in before)
    print(f"{'class':8}{'runs':>6}{'steps':>9}{'F':>9}{'error':>9}")
    for group in (*GROUPS, None):
        runs, of = means(before, after, group)
        print(f"{group or 'all':8}{runs:6}" + "".join(f"{value:9.4f}" for value in of.values()))
        bad |= of["steps"] > BOUND or of["error"] > BOUND
    for k in new_failures(before, after):
        print("FAILS: " + ", ".join(k))
        bad = True
    for k in new_failures(after, before):
        print("no longer fails: " + ", ".join(k))
    both = [k for k in before if k in after and before[k]["steps"] != after[k]["steps"]]
    for k in sorted(both, key=lambda k: -abs(math.log(ratio(after[k], before[k], "steps"))))[:8]:
        print(f"  {', '.join(k):50} steps {before[k]['steps']} -> {after[k]['steps']}, "
              f"F {before[k]['F']} -> {after[k]['F']}, error {before[k]['error']} -> {after[k]['error']}")
    return bad


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:3]))
