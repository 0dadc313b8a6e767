#!/usr/bin/env python3
"""Are the tests able to fail? Applies small changes to the sources, one at a time, and runs the tests
that should notice. SPDX-License-Identifier: BSD-3-Clause

    python3 tests/mutations/run.py --check             every mutation still has its place
    python3 tests/mutations/run.py                     all, in build/mutations
    python3 tests/mutations/run.py contact Nesterov    of one file, or with a word in the title
    python3 tests/mutations/run.py --every 2           the first, the third, ... of each part
    python3 tests/mutations/run.py --log FILE          goes on: those with a verdict in FILE are done

Two at once need two trees: run.py contact --tree /tmp/a, run.py scene --tree /tmp/b.

A mutation in linalg.txt, ida_projection.txt, contact.txt or scene.txt:

    == what is wrong now
    file contact/src/law/coulomb.cpp
    near void f(              (optional) the text stands behind this one
    kill test_contact | stepping: incline*,spheres*    program | its tests, or its arguments
    kill tether | sh tests/x.sh {tether}               programs, libraries | a script
    equivalent ...            (instead of a kill that succeeds) why no test can notice
    - the text, found once; any white space fits any other; \\n is a new line
    + what replaces it

A mutation is killed if a program fails to build, fails, or takes ten times as long as before and more
than a minute, of the processor: a machine with other work judges alike. Killed by what does not compile
is said: such a mutation says nothing about the tests. Neither does one whose tests fail on the sources as
they are: NO VERDICT.
Exit code: 0 all killed or equivalent, 1 survivors, 2 a mutation without a place or a verdict or an
equivalent one that was killed after all.
"""
import argparse
import os
import re
import resource
import shutil
import subprocess
import sys
import time

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
BUILD = os.path.join("build", "release")  # as deep as that of the presets: one ccache serves both
PARTS = ["linalg", "ida_projection", "contact", "scene"]


class Mutation:
    def __init__(self, part, title):
        self.part, self.title = part, title
        self.file = self.near = self.equivalent = None
        self.kill, self.old, self.new = [], [], []


def read_list(part):
    mutations = []
    for line in open(os.path.join(HERE, part + ".txt"), encoding="utf-8"):
        line = line.rstrip("\n")
        if line.startswith("== "):
            mutations.append(Mutation(part, line[3:]))
            continue
        if not line or line.startswith("#"):
            continue
        word, _, rest = line.partition(" ")
        m = mutations[-1]
        if word == "file":
            m.file = rest
        elif word == "near":
            m.near = rest
        elif word == "equivalent":
            m.equivalent = rest
        elif word == "kill":
            program, _, tests = rest.partition("|")
            m.kill.append((tuple(program.split()), tests.strip()))
        elif word == "-":
            m.old.append(rest)
        elif word == "+":
            m.new.append(rest)
        else:
            sys.exit(f"{part}.txt: unknown line: {line}")
    return mutations


def pattern(lines):
    """Any white space fits any other, so that a reformatted source keeps its mutations."""
    text = "\n".join(lines).replace("\\n", "\n")
    tokens = re.findall(r"\w+|[^\w\s]", text)
    out = []
    for a, b in zip(tokens, tokens[1:] + [None]):
        out.append(re.escape(a))
        if b is not None:
            both_words = re.match(r"\w", a[-1]) and re.match(r"\w", b[0])
            out.append(r"\s+" if both_words else r"\s*")
    return "".join(out)


def mutated(m, source):
    """The mutated text, or None and the reason."""
    start = 0
    if m.near:
        start = source.find(m.near)
        if start < 0:
            return None, f"no \"{m.near}\""
    found = list(re.finditer(pattern(m.old), source[start:]))
    if not found:
        return None, "its text is not there"
    if len(found) > 1 and not m.near:
        return None, f"its text is there {len(found)} times"
    at = found[0]
    new = "\n".join(m.new).replace("\\n", "\n")
    return source[: start + at.start()] + new + source[start + at.end():], ""


def copy_tree(to):
    """Only what differs is written: the rest is not built again."""
    here = set()
    for folder, folders, files in os.walk(ROOT):
        inside = os.path.relpath(folder, ROOT)
        folders[:] = [f for f in folders if f != ".git" and not (inside == "." and f.startswith("build"))]
        os.makedirs(os.path.join(to, inside), exist_ok=True)
        for name in files:
            source, copy = os.path.join(folder, name), os.path.join(to, inside, name)
            here.add(os.path.normpath(copy))
            if not os.path.isfile(copy) or open(source, "rb").read() != open(copy, "rb").read():
                shutil.copy(source, copy)
    for folder, folders, files in os.walk(to):
        folders[:] = [f for f in folders if not (folder == to and f == "build")]
        for name in files:
            if os.path.normpath(os.path.join(folder, name)) not in here:
                os.remove(os.path.join(folder, name))


def build(tree, targets):
    return subprocess.run(["cmake", "--build", BUILD, "--parallel", str(args.jobs), "--target", *targets], cwd=tree,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def program_path(tree, target):
    for folder, folders, files in os.walk(os.path.join(tree, BUILD)):
        folders[:] = [f for f in folders if f != "CMakeFiles"]
        for name in (target, target + ".so", f"lib{target}.so"):
            if name in files and os.access(os.path.join(folder, name), os.X_OK):
                return os.path.join(folder, name)
    sys.exit(f"{target} is not built")


def run(tree, programs, tests, limit):
    """True: the tests passed, in `limit` seconds of the processor (a program that waits: twenty times that)."""
    path = program_path(tree, programs[0])
    if tests.startswith("sh "):
        places = {"{" + name + "}": program_path(tree, name) for name in programs}
        command = [places.get(word, word) for word in tests.split()]
        folder = tree
    else:
        command = [path]
        folder = os.path.dirname(path)
        if tests.startswith("--"):
            command += tests.split()
        elif tests:
            command += [tests, "--abort"]
        else:
            command += ["--abort"]
    def bound():
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit)))

    try:
        done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=20 * limit,
                              preexec_fn=bound)
    except subprocess.TimeoutExpired:
        return False
    if b"No test cases matched" in done.stdout or b"No tests ran" in done.stdout:
        sys.exit(f"{programs[0]}: no test is called {tests}")
    return done.returncode == 0


def seconds_of_children():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def targets_of(programs):
    return ["tether_program" if name == "tether" else name for name in programs]


parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
parser.add_argument("words", nargs="*", help="parts, or words of titles; none: all")
parser.add_argument("--check", action="store_true", help="only whether each has its place")
parser.add_argument("--tree", default=os.path.join(ROOT, "build", "mutations"), help="where the copy is")
parser.add_argument("--jobs", type=int, default=os.cpu_count())
parser.add_argument("--seconds", type=float, default=0, help="begin no other one after this time")
parser.add_argument("--every", type=int, default=1, help="this part of each list")
parser.add_argument("--log", default="", help="verdicts are added here; those with one are not run again")
parser.add_argument("--cmake", default="", help="further arguments of cmake")
args = parser.parse_args()

all_mutations = [m for part in PARTS for m in read_list(part)]
chosen = [m for m in all_mutations
          if not args.words or m.part in args.words or
          any(w not in PARTS and w.lower() in m.title.lower() for w in args.words)]
chosen = [m for part in PARTS for m in [m for m in chosen if m.part == part][::max(1, args.every)]]
misplaced = []
for m in all_mutations:
    name = os.path.join(ROOT, m.file or "-")
    text, why = mutated(m, open(name, encoding="utf-8").read()) if os.path.isfile(name) else (None, "no such file")
    if text is None:
        misplaced.append(m)
        print(f"NO PLACE  {m.part}: {m.title}: {m.file}: {why}")
print(f"{len(all_mutations)} mutations, {len(misplaced)} without a place", flush=True)
if args.check:
    sys.exit(2 if misplaced else 0)

copy_tree(args.tree)
known = set()
if args.log and os.path.isfile(args.log):
    known = {line.rstrip("\n").partition("\t")[2] for line in open(args.log, encoding="utf-8")}
generator = ["-G", "Ninja"] if shutil.which("ninja") else []
launcher = ["-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
subprocess.check_call(["cmake", "-S", ".", "-B", BUILD, *generator, *launcher, "-DCMAKE_BUILD_TYPE=Release",
                       "-DTETHER_BUILD_BENCHMARKS=OFF", "-DTETHER_BUILD_PYTHON=OFF", *args.cmake.split()],
                      cwd=args.tree, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

usual = {}  # seconds of tests on sources as they are; None: they fail
count = {"killed": 0, "does not compile": 0, "SURVIVED": 0, "equivalent": 0, "EQUIVALENT, KILLED": 0, "NO VERDICT": 0}
begin = time.time()
left_out = 0
for m in chosen:
    if m in misplaced or f"{m.part}: {m.title}" in known:
        continue
    if args.seconds and time.time() - begin > args.seconds:
        left_out += 1
        continue
    file = os.path.join(args.tree, m.file)
    source = open(file, encoding="utf-8").read()
    missing = [k for k in m.kill if k not in usual]
    if missing:
        done = build(args.tree, sorted({t for programs, _ in missing for t in targets_of(programs)}))
        if done.returncode != 0:
            sys.exit("the sources as they are do not build:\n" + done.stdout[-3000:])
        for each in missing:
            start = seconds_of_children()
            passes = run(args.tree, *each, 3600)
            usual[each] = seconds_of_children() - start if passes else None
            if not passes:
                print(f"{each[0][0]} | {each[1]}: fails on the sources as they are", flush=True)
    verdict, by = "SURVIVED", ""
    try:
        with open(file, "w", encoding="utf-8") as out:
            out.write(mutated(m, source)[0])
        for each in m.kill:
            if usual[each] is None:
                verdict = "NO VERDICT"
                continue
            if build(args.tree, targets_of(each[0])).returncode != 0:
                verdict = "does not compile"
                break
            if not run(args.tree, *each, max(60.0, 10 * usual[each])):
                verdict, by = "killed", f" by {each[0][0]}"
                break
    finally:
        with open(file, "w", encoding="utf-8") as out:
            out.write(source)
    if m.equivalent:
        verdict = "equivalent" if verdict == "SURVIVED" else "EQUIVALENT, KILLED" if verdict == "killed" else verdict
    count[verdict] += 1
    print(f"{verdict:18} {m.part}: {m.title}{by}", flush=True)
    if args.log and verdict != "NO VERDICT":
        with open(args.log, "a", encoding="utf-8") as out:
            out.write(f"{verdict}\t{m.part}: {m.title}\n")

print(", ".join(f"{n} {what}" for what, n in count.items() if n) + (f", {left_out} not begun" if left_out else ""))
if misplaced or count["EQUIVALENT, KILLED"] or count["NO VERDICT"]:
    sys.exit(2)
sys.exit(1 if count["SURVIVED"] or count["does not compile"] else 0)
