#!/usr/bin/env python3
"""Judges the record of a run by the laws of mechanics, without Tether's code. SPDX-License-Identifier: BSD-3-Clause

    python3 scene/tools/verify.py SCENE.toml... [--tether PROGRAM] [--end SECONDS]     # runs it, records every step
    python3 scene/tools/verify.py SCENE.toml --csv RUN.csv      # judges a record made with forces = true

Laws at every record: forces push and lie in Coulomb's cone, act against slip, and only where a gap is closed;
points of joints coincide; orientations are unit; states move as their velocities say. Between records that are one
step apart: mass times change of velocity is the impulse of weight, contacts and joints. A step in which a contact
begins or ends has sub-steps, whose impulses the record lacks: it is counted, not judged.

Exit code: 0 every law that could be judged holds, 1 one does not, 2 nothing could be judged."""
import argparse
import collections
import csv
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import tomllib

CLOSES = 1e-6  # of the forces: what a balance of impulses may leave; problems are solved to 1e-9
WORLD = {"x": (0, 0, 0), "q": (1, 0, 0, 0), "v": (0, 0, 0), "w": (0, 0, 0)}
WINDOW = {"from", "to", "break_force", "break_moment"}  # of joints that do not hold always
OTHER_FORCES = ("spring", "load", "central_gravity", "coupling", "invariant")

Fault = collections.namedtuple("Fault", "time law what")


def add(a, b, factor=1.0):
    return [x + factor * y for x, y in zip(a, b)]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def norm(a):
    return math.sqrt(dot(a, a))


def turn(q, v):
    """v turned by the unit quaternion q = (w, x, y, z)."""
    w, u = q[0], q[1:]
    cross = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
    again = (u[1] * cross[2] - u[2] * cross[1], u[2] * cross[0] - u[0] * cross[2], u[0] * cross[1] - u[1] * cross[0])
    return [x + 2 * (w * c + a) for x, c, a in zip(v, cross, again)]


def turn_back(q, v):
    return turn((q[0], -q[1], -q[2], -q[3]), v)


class Scene:
    """What the laws need of a scene file."""

    def __init__(self, text):
        data = tomllib.loads(text)
        self.gravity = data.get("scene", {}).get("gravity", [0, 0, 0])
        self.step, self.end = data.get("stepping", {}).get("step"), data.get("scene", {}).get("end", math.inf)
        self.repeats = any("repeat" in each for kind in ("body", "joint") for each in data.get(kind, []))
        self.other = [kind for kind in OTHER_FORCES if kind in data]
        self.other += [key for key in ("wind", "gravity_gradient") if key in data.get("scene", {})]
        self.mass, self.material, self.fixed = {}, {}, set()
        for number, body in enumerate(data.get("body", []), 1):
            name = body.get("name", f"body {number}")
            self.mass[name], self.material[name] = mass_of(body), body.get("material")
            if body.get("fixed"):
                self.fixed.add(name)
            if "drag" in body:
                self.other.append("drag")
        self.friction = {frozenset(pair["between"]): None if "friction_across" in pair else pair.get("friction", 0)
                         for pair in data.get("pair", [])}
        self.joints = {joint.get("name", f"joint {n}"): joint for n, joint in enumerate(data.get("joint", []), 1)}

    def coefficient(self, first, second):
        return self.friction.get(frozenset((self.material.get(first), self.material.get(second))))


def mass_of(body):
    """kg; None where it takes more than these formulas."""
    if "mass" in body or "density" not in body:
        return body.get("mass")
    if body.get("shape") == "sphere":
        return body["density"] * 4 / 3 * math.pi * body["radius"] ** 3
    if body.get("shape") == "box":
        return body["density"] * math.prod(body["size"])
    return None


def read_records(table):
    """The records of a table and of the table of contacts beside it."""
    contacts = collections.defaultdict(list)
    beside = pathlib.Path(table).with_suffix(".contacts.csv")
    if beside.exists():
        for row in csv.DictReader(beside.open()):
            vector = lambda *names: [float(row[n]) for n in names]
            contacts[row["time_s"]].append({
                "first": row["first"], "second": row["second"], "normal": vector("normal_x", "normal_y", "normal_z"),
                "gap": float(row["gap_m"]), "force": vector("fx_N", "fy_N", "fz_N"),
                "slip": vector("slip_x_m_per_s", "slip_y_m_per_s", "slip_z_m_per_s")})
    records = []
    for row in csv.DictReader(pathlib.Path(table).open()):
        pick = lambda name, ends: [float(row[f"{name}.{end}"]) for end in ends]
        names = [key[:-4] for key in row if key.endswith(".x_m")]
        joints = [key[:-5] for key in row if key.endswith(".fx_N")]
        records.append({
            "t": float(row["time_s"]), "contacts": contacts[row["time_s"]], "penetration": float(row.get("penetration_m", 0)),
            "joints": {name: pick(name, ("fx_N", "fy_N", "fz_N")) for name in joints},
            "bodies": {name: {"x": pick(name, ("x_m", "y_m", "z_m")), "q": pick(name, ("qw", "qx", "qy", "qz")),
                              "v": pick(name, ("vx_m_per_s", "vy_m_per_s", "vz_m_per_s")),
                              "w": pick(name, ("wx_rad_per_s", "wy_rad_per_s", "wz_rad_per_s"))} for name in names}})
    return records


class Judge:
    def __init__(self, scene, records):
        self.scene, self.records = scene, records
        self.faults, self.judged, self.left = [], collections.Counter(), collections.Counter()

    def run(self):
        for number, now in enumerate(self.records):
            self.contacts(now)
            self.joints(now)
            before = self.records[number - 1] if number else None
            for name, body in now["bodies"].items():
                self.expect(now, "unit orientation", abs(norm(body["q"]) - 1) < 1e-9, name)
                if before:
                    self.balance(before, now, name)
        return self

    def expect(self, now, law, holds, what):
        self.judged[law] += 1
        if not holds:
            self.faults.append(Fault(now["t"], law, what))

    def weight(self, now):
        """A force that counts, N."""
        masses = [self.scene.mass.get(name) or 0 for name in now["bodies"]]
        return CLOSES * max(masses + [1e-9]) * (norm(self.scene.gravity) or 1)

    def contacts(self, now):
        small = self.weight(now)
        for contact in now["contacts"]:
            what = f"{contact['first']} on {contact['second']}"
            push = dot(contact["force"], contact["normal"])
            along = add(contact["force"], contact["normal"], -push)
            self.expect(now, "contacts push", push >= -small, what)
            mu = self.scene.coefficient(contact["first"], contact["second"])
            if mu is None:
                self.left["cone: friction of the pair not found"] += 1
                continue
            most = mu * push
            self.expect(now, "Coulomb's cone", norm(along) <= most + CLOSES * abs(push) + small, what)
            # The slip is that of the end of a step, forces are those of arms at its start.
            speed, turned = self.speed(now, contact), 2 * (self.scene.step or 0) * self.speed(now, contact, 0)
            slip = norm(contact["slip"])
            if slip > (1e-6 + turned) * (1 + speed) and push > 1e3 * small:
                full = add(along, contact["slip"], most / slip)
                self.expect(now, "friction against slip", norm(full) <= (1e-4 + turned) * (push + small), what)
            reach = 1e-6 + 2 * (self.scene.step or 0) * speed
            if push > 1e3 * small:
                self.expect(now, "forces only at closed gaps", contact["gap"] <= reach, what)

    def speed(self, now, contact, path=1):
        return max(path * norm(now["bodies"].get(name, WORLD)["v"]) + norm(now["bodies"].get(name, WORLD)["w"])
                   for name in (contact["first"], contact["second"]))

    def joints(self, now):
        """Points that both bodies carried at the start are still one."""
        start = self.records[0]
        for name, joint in self.scene.joints.items():
            kind = joint.get("kind")
            if WINDOW & set(joint):
                continue
            if kind not in ("ball", "hinge", "fixed", "distance") or kind == "distance" and ("motion" in joint or "length" in joint):
                self.left[f"drift of {kind}"] += 1
                continue
            points, ends = joint["at"] if kind == "distance" else [joint["at"], joint["at"]], []
            for body, point in zip(joint["bodies"], points):
                then, here = start["bodies"].get(body), now["bodies"].get(body)
                if then is not None:  # else fixed, or the world
                    point = add(here["x"], turn(here["q"], turn_back(then["q"], add(point, then["x"], -1))))
                ends.append(point)
            off = abs(norm(add(*ends, -1)) - norm(add(*points, -1)))
            self.expect(now, "joints hold", off < 1e-7 * (1 + norm(points[0])), name)

    def balance(self, before, now, name):
        scene, dt = self.scene, now["t"] - before["t"]
        if not scene.step or abs(dt - scene.step) > 1e-6 * scene.step:
            self.left["balance: records are not one step apart"] += 1
            return
        then, here = before["bodies"][name], now["bodies"][name]
        change = add(here["v"], then["v"], -1)
        moved = add(add(here["x"], then["x"], -1), here["v"], -dt)
        allowed = dt * norm(change) + 0.3 * max(now["penetration"], before["penetration"]) + 1e-9 * (1 + norm(here["x"]))
        self.expect(now, "states move as velocities", norm(moved) <= allowed, name)
        mass = scene.mass.get(name)
        if scene.other or mass is None:
            self.left["balance: " + (", ".join(sorted(set(scene.other))) or "mass by more than a formula")] += 1
            return
        # A contact that began or ended may have cut the step, of which the record has the last part.
        if self.touching(before) != self.touching(now):
            self.left["balance: a contact begins or ends within the step"] += 1
            return
        total, scale = [mass * g for g in scene.gravity], mass * (norm(scene.gravity) + norm(change) / dt)
        for contact in now["contacts"]:
            for body, sign in ((contact["first"], 1), (contact["second"], -1)):
                if body == name:
                    total = add(total, contact["force"], sign)
                    scale += norm(contact["force"])
        for joint, data in scene.joints.items():
            force = now["joints"].get(joint)
            for body, sign in zip(data["bodies"], (1, -1)):
                if body == name and force is None:
                    self.left["balance: forces of joints are not recorded"] += 1
                    return
                if body == name:
                    total = add(total, force, sign)
                    scale += norm(force)
        self.expect(now, "balance of impulses", norm(add(total, change, -mass / dt)) <= CLOSES * scale, name)

    def touching(self, record):
        small = 1e3 * self.weight(record)
        pairs = collections.Counter()
        for contact in record["contacts"]:
            if norm(contact["force"]) > small:
                pairs[contact["first"], contact["second"]] += 1
        return pairs

    def report(self):
        lines = [f"{count} judgements: {law}" for law, count in sorted(self.judged.items())]
        lines += [f"{count} not judged: {why}" for why, count in sorted(self.left.items())]
        for fault in self.faults[:10]:
            lines.append(f"FAULT at {fault.time} s: {fault.law}, {fault.what}")
        if len(self.faults) > 10:
            lines.append(f"and {len(self.faults) - 10} more")
        return "\n".join(lines)

    def mechanics(self):
        """Judgements that say something about forces or joints."""
        return sum(count for law, count in self.judged.items() if law not in ("unit orientation", "states move as velocities"))


def record(scene_file, text, program, end, folder):
    """Runs the scene with every step and every force in a table."""
    lines, kept, inside = text.splitlines(), [], False
    for line in lines:
        if line.startswith("["):
            inside = line.strip() == "[output]"
        if not inside:
            kept.append(line)
    step, last = Scene(text).step, Scene(text).end
    table = os.path.join(folder, "run.csv")
    program = os.path.abspath(program) if os.sep in program else program
    command = [program, "run", "-", "--csv", table, "--quiet"]
    command += ["--every", str(step)] if step else []
    command += ["--end", str(min(end, last))] if end else []
    done = subprocess.run(command, input="\n".join(kept) + "\n[output]\nforces = true\n", text=True, capture_output=True,
                          cwd=pathlib.Path(scene_file).resolve().parent)
    if done.returncode not in (0, 1):
        raise RuntimeError(done.stderr.strip() or done.stdout.strip())
    return table


def verify(file, given):
    """Exit code, and the Judge or the reason why there is none."""
    try:
        text = pathlib.Path(file).read_text()
        scene = Scene(text)
        if scene.repeats:
            return 2, "the scene repeats bodies or joints"
        with tempfile.TemporaryDirectory() as folder:
            judge = Judge(scene, read_records(given.csv or record(file, text, given.tether, given.end, folder))).run()
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:  # of files, the program, cells, columns
        return 2, f"{given.csv or file}: {error}"
    return 1 if judge.faults else 0 if judge.mechanics() else 2, judge


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("scene", nargs="+", help="several: a table")
    parser.add_argument("--csv", help="a record of it, made with forces = true in [output]")
    parser.add_argument("--tether", default="tether", help="the program that makes one")
    parser.add_argument("--end", type=float, help="end of the run at the latest, s")
    given = parser.parse_args()
    if len(given.scene) == 1:
        code, judge = verify(given.scene[0], given)
        print(judge.report() if isinstance(judge, Judge) else f"not judged: {judge}")
        return code
    worst = 0
    print("| scene | verdict | judgements | not judged |\n|---|---|---|---|")
    for file in given.scene:
        code, judge = verify(file, given)
        left, count = ("; ".join(sorted(judge.left)), judge.mechanics()) if isinstance(judge, Judge) else (judge, 0)
        print(f"| {pathlib.Path(file).stem} | {('holds', 'FAULT', 'not judged')[code]} | {count} | {left} |")
        worst = max(worst, code % 2)
    return worst


if __name__ == "__main__":
    sys.exit(main())
