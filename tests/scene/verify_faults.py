#!/usr/bin/env python3
"""Does scene/tools/verify.py pass records as they are, and find a hundred planted faults? SPDX-License-Identifier: BSD-3-Clause

    verify_faults.py TETHER SCENES"""
import argparse
import copy
import pathlib
import random
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scene" / "tools"))
import verify  # noqa: E402

SCENES = {"rolling_sphere": 0.1, "incline": 0.1, "icy_wedge": 0.05, "stack": 1.0, "cart": 0.05}


def choose(random_, records):
    """A record with contacts as the one before has, and one of its contacts that pushes."""
    settled = [k for k in range(2, len(records)) if len(records[k]["contacts"]) == len(records[k - 1]["contacts"]) > 0]
    record = records[random_.choice(settled)]
    return record, random_.choice([c for c in record["contacts"] if verify.dot(c["force"], c["normal"]) > 1e-3])


def off_the_cone(random_, scene, records):
    _, contact = choose(random_, records)
    push = verify.dot(contact["force"], contact["normal"])
    across = [1, 0, 0] if abs(contact["normal"][0]) < 0.5 else [0, 1, 0]
    across = verify.add(across, contact["normal"], -verify.dot(across, contact["normal"]))
    mu = scene.coefficient(contact["first"], contact["second"])
    size = (2 + random_.random()) * mu * push + 1e-3 * push
    contact["force"] = verify.add(contact["force"], across, size / verify.norm(across))


def swapped_sign(random_, scene, records):
    _, contact = choose(random_, records)
    contact["force"] = [-x for x in contact["force"]]


def drift(random_, scene, records):
    start = random_.randrange(2, len(records))
    name, axis = random_.choice(sorted(records[0]["bodies"])), random_.randrange(3)
    for record in records[start:]:
        record["bodies"][name]["x"][axis] += 1e-3


def lost_impulse(random_, scene, records):
    _, contact = choose(random_, records)
    contact["force"] = [0.99 * x for x in contact["force"]]


def broken_inputs(program, scenes):
    """Files that are no scene and no record are told so; what is accepted of them."""
    good, accepted = (pathlib.Path(scenes) / "incline.toml").read_text(), []
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "incline.toml").write_text(good)
        table = pathlib.Path(verify.record(folder / "incline.toml", good, program, 0.01, folder))
        (folder / "cut.csv").write_text(table.read_text()[:-30])
        (folder / "other.csv").write_text("a,b\n1,2\n")
        (folder / "cut.toml").write_text(good[:100])
        for scene, record in (("cut.toml", None), ("missing.toml", None), ("incline.toml", "cut.csv"), ("incline.toml", "other.csv"),
                              ("incline.toml", "missing.csv")):
            given = argparse.Namespace(csv=record and str(folder / record), tether=program, end=0.01)
            code, reason = verify.verify(folder / scene, given)
            if code != 2 or not isinstance(reason, str):
                accepted.append(f"{scene} with {record}")
    return accepted


def main(program, scenes):
    accepted = broken_inputs(program, scenes)
    if accepted:
        return f"accepted: {accepted}"
    random_, planted, found = random.Random(1), 0, 0
    recorded = []
    for name, end in SCENES.items():
        file = pathlib.Path(scenes) / f"{name}.toml"
        text = file.read_text()
        with tempfile.TemporaryDirectory() as folder:
            recorded.append((name, verify.Scene(text), verify.read_records(verify.record(file, text, program, end, folder))))
        judge = verify.Judge(*recorded[-1][1:]).run()
        if judge.faults or not judge.judged["balance of impulses"]:
            return f"{name}, as it was recorded:\n{judge.report()}"
    for kind in (off_the_cone, swapped_sign, drift, lost_impulse):
        for k in range(25):
            name, scene, records = recorded[k % len(recorded)]
            wrong = copy.deepcopy(records)
            kind(random_, scene, wrong)
            planted += 1
            if verify.Judge(scene, wrong).run().faults:
                found += 1
            else:
                print(f"not found: {kind.__name__} {k} in {name}")
    print(f"{found} of {planted} planted faults found")
    return 0 if found == planted == 100 else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
