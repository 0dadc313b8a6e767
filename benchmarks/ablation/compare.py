#!/usr/bin/env python3
"""Compares two tables of ablation: after / before, geometric means. SPDX-License-Identifier: BSD-3-Clause

compare.py before.csv after.csv; ends with 1 where a mean of steps or errors exceeds 1.03 or a run fails newly."""
import csv
import math
import sys

BOUND = 1.03
NOISE = 1e-13  # of an error


def table(path):
    with open(path, newline="") as lines:
        return {(r["problem"], r["form"], r["tolerance"]): r for r in csv.DictReader(lines)}


def ratio(after, before, column):
    floor = NOISE if column == "error" else 1.0
    a, b = (max(float(r[column]), floor) for r in (after, before))
    return a / b if math.isfinite(a) and math.isfinite(b) else math.nan


def mean(values):
    logs = [math.log(v) for v in values if v == v]
    return math.exp(sum(logs) / len(logs)) if logs else math.nan


before, after = (table(path) for path in sys.argv[1:3])
keys = [k for k in before if k in after]
bad = len(keys) < len(before)
print(f"{len(keys)} runs; after / before")
print(f"{'class':8}{'runs':>6}{'steps':>9}{'F':>9}{'error':>9}")
for group in ("small", "mid", "big", "all"):
    those = [k for k in keys if group in ("all", before[k]["class"])]
    whole = [k for k in those if before[k]["failed"] == after[k]["failed"] == "0"]
    means = {c: mean([ratio(after[k], before[k], c) for k in whole]) for c in ("steps", "F", "error")}
    print(f"{group:8}{len(whole):6}" + "".join(f"{means[c]:9.4f}" for c in means))
    bad |= means["steps"] > BOUND or means["error"] > BOUND
for k in keys:
    if before[k]["failed"] != after[k]["failed"]:
        worse = after[k]["failed"] == "1"
        print(("FAILS: " if worse else "no longer fails: ") + ", ".join(k))
        bad |= worse
moved = sorted(keys, key=lambda k: -abs(math.log(ratio(after[k], before[k], "steps"))))
for k in moved[:8]:
    if before[k]["steps"] != after[k]["steps"]:
        print(f"  {', '.join(k):50} steps {before[k]['steps']} -> {after[k]['steps']}, "
              f"F {before[k]['F']} -> {after[k]['F']}, error {before[k]['error']} -> {after[k]['error']}")
sys.exit(bad)
