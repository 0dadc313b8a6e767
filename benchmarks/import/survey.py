#!/usr/bin/env python3
"""Imports all robots below folders, and runs what is imported. SPDX-License-Identifier: BSD-3-Clause

    python3 benchmarks/import/survey.py TETHER FOLDER...

TETHER: the program. FOLDER: a checkout of a repository with .urdf and .xml files, which its meshes and included files lie
below. A file is imported as it is, else with the options that its refusal names. Prints tables: how many files of each folder are
imported and run for END seconds, why others are not, and what is left out or changed.
"""
import collections
import concurrent.futures
import os
import pathlib
import re
import subprocess
import sys
import tempfile

END, LIMIT = "0.02", 120  # s: of a run, of any program
# Options by the words that name them.
OPTIONS = {"--mend takes": ["--mend"], "--base free lets": ["--base", "free"], "--density": ["--density", "1000"]}
# Refusals of what is a part of other models, of no robot, or to be expanded first.
NO_MODEL = {"worldbody: is missing": "no bodies: for <include>", "nothing moves while": "nothing moves: for <attach> or <include>",
            "must be <robot> (URDF)": "another dialect", "is xacro": "xacro, to be expanded first", "has no link": "no links"}


def call(*command):
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=LIMIT)
        return done.returncode, done.stderr
    except subprocess.TimeoutExpired:
        return -1, f"takes more than {LIMIT} s"


def kind(message, file):
    """What is wrong or changed, without the names and numbers of one file."""
    message = message.replace("tether: ", "").replace("left out or changed: ", "").removeprefix(f"{file}:")
    message = re.sub(r'^\d+: |( \(\d+ times\))|( ?= ?("[^"]*"|\[[^]]*\]))|"[^"]*"', "", message)
    return re.sub(r"-?\d+(\.\d+)?(e-?\d+)?", "N", message).strip()


def survey(tether, folder, file, scene):
    """Outcome, options, and kinds of what is left out or wrong."""
    options = []
    for _ in range(len(OPTIONS) + 1):
        code, told = call(tether, "import", str(file), "--out", scene, "--force", "--hulls", "--files", str(folder), *options)
        more = [o for words, o in OPTIONS.items() if words in told and o[0] not in options]
        if code == 0 or not more:
            break
        options += sum(more, [])
    lines = [line for line in told.splitlines() if line.strip()]
    if code != 0:
        for words, why in NO_MODEL.items():
            if words in told:
                return "no model", "", [why]
        return "refused", "", [kind(lines[0], file)]
    # The names behind the last colon are those of one file.
    remarks = {kind(line, file).rsplit(": ", 1)[0] for line in lines}
    outcome = "imported"
    for command in (["check", scene], ["run", scene, "--quiet", "--end", END]):
        code, told = call(tether, *command)
        if code != 0:
            outcome = "does not run"
            break
    return outcome, " ".join(options), remarks


def table(title, counts):
    print(f"\n| {title} | files |\n|---|---|")
    for what, count in sorted(counts.items(), key=lambda each: (-each[1], each[0])):
        print(f"| {what.replace('|', ' ').replace('<', '&lt;')} | {count} |")


def main(tether, *folders):
    refusals, parts, remarks, all_options, totals = (collections.Counter() for _ in range(5))
    print("| folder | files | no whole model | imported and run | imported, does not run | refused |\n|---|---|---|---|---|---|")
    for folder in map(pathlib.Path, folders):
        files = sorted(f for f in folder.rglob("*") if f.suffix in (".urdf", ".xml") and f.is_file())
        with tempfile.TemporaryDirectory() as scenes, concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            jobs = [pool.submit(survey, tether, folder, f, f"{scenes}/{k}.toml") for k, f in enumerate(files)]
            found = [job.result() for job in jobs]
        counts = collections.Counter(outcome for outcome, _, _ in found)
        totals.update(counts)
        print(f"| {folder.name} | {len(files)} | {counts['no model']} | {counts['imported']} | {counts['does not run']} | "
              f"{counts['refused']} |")
        for outcome, options, kinds in found:
            {"refused": refusals, "no model": parts}.get(outcome, remarks).update(kinds)
            if outcome in ("imported", "does not run"):
                all_options[options or "none"] += 1
    print(f"| all | {sum(totals.values())} | {totals['no model']} | {totals['imported']} | {totals['does not run']} | "
          f"{totals['refused']} |")
    table("options of imports", all_options)
    table("no whole model, since it has", parts)
    table("refused, since", refusals)
    table("left out or changed, in the words of the scene", remarks)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
