#!/usr/bin/env python3
"""What each stage and mechanism of the contact solver is worth. SPDX-License-Identifier: BSD-3-Clause

    ablation.py [--seeds 1] [--work 3e7] [FOLDER ...]      # prints the table; results.py contact_ablation keeps it
    ablation.py --check                       # has every mechanism its place in the sources?

Builds a copy of the tree in build/ablation where each mechanism of mechanisms.txt has a switch, and solves all
problems of the folders and generated ones with each switched off. The table has the problems lost and won, and the
work over that of the whole solver by the library's own count. Each further seed adds as many problems again.
"""
import argparse
import concurrent.futures
import csv
import os
import re
import shutil
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(os.path.dirname(HERE)))
TREE = os.path.join(ROOT, "build", "ablation")
PROGRAM = os.path.join(TREE, "build", "release", "benchmarks", "contact", "ablation", "contact_ablation")
SWITCH = """#include <cstdlib>
#include <cstring>
#define TETHER_ABLATION_OFF(k) \\
  (std::getenv("TETHER_OFF") != nullptr && std::strstr(std::getenv("TETHER_OFF"), "," #k ",") != nullptr)
"""


def mechanisms():
    out = []
    for line in open(os.path.join(HERE, "mechanisms.txt"), encoding="utf-8"):
        word, _, rest = line.rstrip("\n").partition(" ")
        if word == "==":
            out.append({"name": rest})
        elif word in ("file", "-", "+"):
            out[-1][word] = rest.replace("\\n", "\n")
    return out


def text_of(words):
    """Any white space fits any other: a reformatted source keeps its switches."""
    return r"\s*".join(re.escape(token) for token in re.findall(r"\w+|[^\w\s]", words))


def misplaced(root):
    """Mechanisms whose text does not stand in its file exactly once."""
    for m in mechanisms():
        path = os.path.join(root, "contact", "src", "assembled", m["file"])
        found = len(re.findall(text_of(m["-"]), open(path, encoding="utf-8").read())) if os.path.isfile(path) else 0
        if found != 1:
            yield f"{m['name']}: its text is there {found} times in {m['file']}"


def build(all_mechanisms):
    for name in subprocess.check_output(["git", "ls-files"], cwd=ROOT, text=True).split("\n"):
        source, copy = os.path.join(ROOT, name), os.path.join(TREE, name)
        if os.path.isfile(source):
            os.makedirs(os.path.dirname(copy), exist_ok=True)
            shutil.copy2(source, copy)
    for k, m in enumerate(all_mechanisms, 1):
        path = os.path.join(TREE, "contact", "src", "assembled", m["file"])
        source = open(path, encoding="utf-8").read()
        new = m["+"].replace("OFF", f"TETHER_ABLATION_OFF({k})")
        source = re.sub(text_of(m["-"]), lambda _: new, source)
        open(path, "w", encoding="utf-8").write(source if source.startswith(SWITCH) else SWITCH + source)
    subprocess.check_call(["cmake", "--preset", "release", "-DTETHER_BUILD_TESTS=OFF"], cwd=TREE,
                          stdout=subprocess.DEVNULL)
    subprocess.check_call(["cmake", "--build", "--preset", "release", "--target", "contact_ablation"], cwd=TREE,
                          stdout=subprocess.DEVNULL)


def solve(k):
    """Status and work of each solve with mechanism k off; 0: none."""
    out = {}
    for seed in args.seeds.split(","):
        folders = args.folders if seed == args.seeds.split(",")[0] else []
        lines = subprocess.check_output([PROGRAM, "--seed", seed, "--work", args.work, *folders], text=True,
                                        env={**os.environ, "TETHER_OFF": f",{k},"}).splitlines()
        for r in csv.DictReader(lines):
            out[seed, r["group"], r["problem"], r["law"], r["tolerance"]] = r["status"], float(r["work"])
    return out


def row(name, base, off):
    lost = [k for k in base if base[k][0] == "solved" != off[k][0]]
    won = [k for k in base if off[k][0] == "solved" != base[k][0]]
    groups = sorted({f"{k[1]} {sum(q[1] == k[1] for q in lost)}" for k in lost})
    work = sum(off[k][1] for k in base) / sum(base[k][1] for k in base)
    both = [k for k in base if base[k][0] == off[k][0] == "solved"]
    solved = sum(off[k][1] for k in both) / sum(base[k][1] for k in both)
    wrong = sum(off[k][0] == "wrong" for k in off)
    if wrong:
        groups.append(f"**{wrong} wrong**")
    return f"| {name} | {len(lost)} | {len(won)} | {work:.3f} | {solved:.3f} | {', '.join(groups)} |"


parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
parser.add_argument("folders", nargs="*", help="folders of .dat and .hdf5 files")
parser.add_argument("--seeds", default="1", help="of generated problems, with commas between")
parser.add_argument("--work", default="3e7", help="most work of a solve, in estimated ns")
parser.add_argument("--check", action="store_true", help="only checks that every mechanism has its place")
args = parser.parse_args()

problems = list(misplaced(ROOT))
print("\n".join(problems), file=sys.stderr, end="\n" if problems else "")
if args.check or problems:
    sys.exit(1 if problems else 0)
listed = mechanisms()
build(listed)
with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
    base, *without = pool.map(solve, range(len(listed) + 1))
solved = sum(status == "solved" for status, _ in base.values())
print(f"{len(base)} solves, nearly all at 1e-3, 1e-6 and 1e-9, under both laws, strongly coupled ones also with `strict`; the whole solver solves {solved} of them with at most {args.work} of work "
      f"each, {sum(w for _, w in base.values()):.3g} together.\n\n"
      "| off | lost | won | work | work, solved by both | lost of |\n|---|---|---|---|---|---|")
for m, off in zip(listed, without):
    print(row(m["name"], base, off))
