#!/usr/bin/env python3
"""Judges the certificate of a run by the laws of mechanics, without Tether's code. SPDX-License-Identifier: BSD-3-Clause

    python3 scene/tools/verify.py FILE.cert...     # written by: tether run SCENE.toml --certificate FILE.cert

The lines of a certificate are explained in docs/certificate.md.
Exit code: 0 every law holds, 1 one is broken, 2 a file cannot be judged."""
import collections
import math
import sys

BALANCE = 1e-6  # of the impulses or forces on a body
LAW = 1e-6  # of the speeds at contacts
EQUATIONS = 1e-5  # of the forces at an instant
TIMES = 1e-15  # of times: their rounding
USEFUL = 1e-2  # residual of a problem whose solution a step may use
HOLDS = 1e-6  # of the arms of a joint, m; speeds the same

# Numbers of a line; "+": or more; "t": then a text.
LINES = {"body": "9t", "surface": "10", "pair": "7", "gravity": "3", "engine": "0t", "joint": "23t", "coupled": "2+", "step": "5",
         "part": "4", "trial": "4", "extrapolated": "1", "start": "1", "instant": "2", "arrives": "1", "strike": "1", "push": "7t", "contact": "22",
         "pull": "14", "law": "10+", "via": "7", "placed": "8", "to": "14", "rate": "7", "end": "1"}

LONGEST = 1 << 16  # of a line


class Damaged(Exception):
    pass


def add(a, b, factor=1.0):
    return [x + factor * y for x, y in zip(a, b)]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def norm(a):
    return math.sqrt(dot(a, a))


def scaled(a, factor):
    return [factor * x for x in a]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def times(p, q):
    return [p[0] * q[0] - dot(p[1:], q[1:]), *add(add(scaled(q[1:], p[0]), p[1:], q[0]), cross(p[1:], q[1:]))]


def back(q):
    return [q[0], -q[1], -q[2], -q[3]]


def turn(q, v):
    c = cross(q[1:], v)
    return add(v, add(scaled(c, q[0]), cross(q[1:], c)), 2)


def rotation(v):
    """Quaternion of a rotation vector."""
    a = norm(v)
    return [math.cos(a / 2), *scaled(v, math.sin(a / 2) / a if a > 0 else 0.5)]


def apart(p, q):
    return 2 * min(norm(add(p, q, -1)), norm(add(p, q)))


def across(n):
    e = [0.0, 0.0, 0.0]
    e[min(range(3), key=lambda k: abs(n[k]))] = 1.0
    t = add(e, n, -dot(e, n))
    return scaled(t, 1 / norm(t))


def solve3(m, b):
    """m x = b, by Cramer's rule."""
    det = dot(m[0], cross(m[1], m[2]))
    columns = list(zip(*m))
    return [dot(b, cross(columns[(k + 1) % 3], columns[(k + 2) % 3])) / det for k in range(3)]


class Body:
    def __init__(self, n, name):
        self.mass, self.material, self.name = n[1], n[8], name
        self.inertia = [[n[2], n[7], n[6]], [n[7], n[3], n[5]], [n[6], n[5], n[4]]]
        self.round = all(abs(self.inertia[i][j] - (n[2] if i == j else 0)) <= 1e-13 * n[2] for i in range(3) for j in range(3))
        self.state, self.time = None, None  # x 3, q 4, v 3, w 3
        self.belt, self.axis = [0.0] * 6, [0.0] * 3

    def spin(self, q, w):
        """Angular momentum, world axes."""
        u = turn(back(q), w)
        return turn(q, [dot(row, u) for row in self.inertia])

    def unspin(self, q, momentum):
        return turn(q, solve3(self.inertia, turn(back(q), momentum)))


def natural_residual(friction, n, y, w):
    """How far an impulse over the mass, y, and a velocity w are off Coulomb's law together, m/s."""
    along, sideways, axis, associated = friction
    t = add(axis, n, -dot(axis, n))
    t = scaled(t, 1 / norm(t)) if norm(t) > 0 else across(n)
    b = cross(n, t)
    v = [dot(n, w), along * dot(t, w), sideways * dot(b, w)]
    x = [dot(n, y), dot(t, y) / along if along > 0 else 0.0, dot(b, y) / sideways if sideways > 0 else 0.0]
    if not associated:
        v[0] += norm(v[1:])
    z = add(x, v, -1)
    size = norm(z[1:])
    p = z
    if size > z[0]:
        onto = max(0.0, (z[0] + size) / 2)
        p = [onto, *scaled(z[1:], onto / size if size > 0 else 0.0)]
    off = norm(add(y, n, -dot(y, n))) if along == sideways == 0 else 0.0
    return max(norm(add(x, p, -1)), off)


class Joint:
    # Directions of the second body's frame in which points, and turns, are held.
    HELD = {"ball": ("xyz", ""), "hinge": ("xyz", "xy"), "slider": ("xy", "xyz"), "fixed": ("xyz", "xyz"), "planar": ("z", "xy"),
            "universal": ("xyz", "u"), "distance": ("d", "")}

    def __init__(self, n, text):
        self.kind, self.name = (text.split(" ", 1) + [""])[:2]
        if self.kind not in self.HELD:
            raise Damaged(f"joint of a kind {self.kind!r}")
        self.bodies, self.p1, self.f1, self.p2, self.f2 = (int(n[1]), int(n[2])), n[3:6], n[6:10], n[10:13], n[13:17]
        self.length, self.driven, self.has_laws, self.motion = n[17], n[18] == 1, n[18] == 2, n[19:23]
        self.held, self.turns = self.HELD[self.kind]

    def way(self, t):
        rate, amplitude, frequency, phase = self.motion
        w = 2 * math.pi * frequency
        return (rate * t + amplitude * (math.sin(w * t + phase) - math.sin(phase)), rate + amplitude * w * math.cos(w * t + phase),
                -amplitude * w * w * math.sin(w * t + phase))

    def places(self, states):
        """Frames and points on both bodies, and arms."""
        a, b = states
        r1, r2 = turn(a[3:7], self.p1), turn(b[3:7], self.p2)
        return times(a[3:7], self.f1), times(b[3:7], self.f2), add(a[:3], r1), add(b[:3], r2), r1, r2

    def directions(self, states):
        """Held directions of points and of turns, and the free one that laws act along."""
        g1, g2, x1, x2, _, _ = self.places(states)
        axes = {k: turn(g2, e) for k, e in zip("xyz", ([1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]))}
        axes["d"] = scaled(add(x1, x2, -1), 1 / (norm(add(x1, x2, -1)) or 1))
        axes["u"] = cross(turn(g1, [0, 0, 1.0]), axes["x"])
        return [axes[k] for k in self.held], [axes[k] for k in self.turns], axes["z"]

    def errors(self, states, t):
        """Largest error of places, m or rad, and of speeds."""
        g1, g2, x1, x2, r1, r2 = self.places(states)
        s, rate, _ = self.way(t) if self.driven else (0, 0, 0)
        d, off, fast = add(x1, x2, -1), [], []
        a, b = states
        u = add(add(a[7:10], cross(a[10:13], r1)), add(b[7:10], cross(b[10:13], r2)), -1)
        w = add(a[10:13], b[10:13], -1)
        u = add(u, cross(b[10:13], d), -1)
        held, turns, z = self.directions(states)
        if self.kind == "distance":
            off, fast = [norm(d) - self.length - s], [dot(held[0], u) - rate]
        else:
            off += [dot(k, d) for k in held]
            fast += [dot(k, u) for k in held] + [dot(k, w) for k in turns]
            if self.kind == "universal":
                off.append(dot(turn(g1, [0, 0, 1.0]), turn(g2, [1.0, 0, 0])))
            elif self.kind != "ball":
                q = times(back(g2), g1)
                if self.kind == "hinge" and self.driven:
                    q = times(rotation([0, 0, -s]), q)
                    fast.append(dot(z, w) - rate)
                    off.append(2 * q[3] * (1 if q[0] > 0 else -1))
                off += [2 * q[1 + "xyz".index(k)] for k in self.turns]
                if self.kind in ("hinge", "planar"):
                    off[-2:] = turn(q, [0, 0, 1.0])[:2]
            if self.kind == "slider" and self.driven:
                off.append(dot(z, d) - s)
                fast.append(dot(z, u) - rate)
        return max(map(abs, off)), max(map(abs, fast))


def read(file):
    """Words, numbers and texts of its lines; Damaged where it is none, or not whole."""
    count, word = 0, None
    with open(file, encoding="utf-8", errors="replace") as lines:
        for line in iter(lambda: lines.readline(LONGEST), ""):
            if not line.endswith("\n"):
                raise Damaged(f"line {count + 1} is cut, or longer than any")
            if count == 0 and line != "tether certificate 1\n":
                raise Damaged("it is no certificate of this format")
            if word == "end":
                raise Damaged("it goes on behind its end")
            count += 1
            if count == 1:
                continue
            word, _, rest = line[:-1].partition(" ")
            form = LINES.get(word)
            if form is None:
                raise Damaged(f"line {count}: {word[:20]!r} is no word of a certificate")
            least, fields = int(form.strip("+t")), rest.split(" ")
            text = " ".join(fields[least:]) if "t" in form else ""
            fields = fields[:least] if "t" in form else fields
            try:
                numbers = [float(each) for each in fields if each] if fields != [""] else []
            except ValueError:
                raise Damaged(f"line {count}: not a number") from None
            if len(numbers) < least or len(numbers) > least and form[-1] != "+" or not all(map(math.isfinite, [
                    x for k, x in enumerate(numbers) if word != "law" or k != 5])):
                raise Damaged(f"line {count}: {word} has {form.strip('+t')} finite numbers")
            if word == "end" and numbers[0] != count - 1:
                raise Damaged(f"{count - 1} lines of {numbers[0]:g}: a part is missing")
            yield word, numbers, text
    if word != "end":
        raise Damaged("its end is missing: it was cut")


class Judge:
    def __init__(self):
        self.bodies, self.pairs, self.joints, self.coupled, self.gravity = {}, {}, {}, [], [0.0] * 3
        self.faults, self.judged, self.step, self.when = [], collections.Counter(), 0, 0.0
        self.keeps_momentum, self.associated, self.frictionless, self.claimed = True, False, False, 0.0
        self.block, self.lines, self.trial, self.past = None, [], None, []

    def run(self, file):
        for word, n, text in read(file):
            if word in ("push", "contact", "pull", "law", "via", "placed", "rate"):
                if self.block is None:
                    raise Damaged(f"{word} is of no part")
                self.lines.append((word, n, text))
            elif word == "to":
                self.index(n[0])
                self.lines.append((word, n, text))
            else:
                self.finish()
                self.head(word, n, text)
        if not self.moved:
            raise Damaged("nothing moves in it")
        return self

    def index(self, number):
        if number not in self.bodies:
            raise Damaged(f"body {number:g} is not told")
        return self.bodies[number]

    def head(self, word, n, text):
        if word == "body":
            self.bodies[n[0]] = Body(n, text)
        elif word == "surface":
            self.index(n[0]).belt, self.bodies[n[0]].axis = n[1:7], n[7:10]
        elif word == "pair":
            self.pairs[n[0], n[1]] = n[2:]
        elif word == "gravity":
            self.gravity = n
        elif word == "engine":
            self.past = []
            words = (text + "  ").split(" ")
            self.joints, self.coupled = {}, []
            self.keeps_momentum, self.associated = words[1] == "momentum", words[2] == "maximum_dissipation"
            self.frictionless = words[2] == "frictionless"
        elif word == "joint":
            self.joints[n[0]] = Joint(n, text)
        elif word == "coupled":
            if n[1] not in self.joints:
                raise Damaged(f"a coupling of joint {n[1]:g}, which is not told")
            self.coupled.append((n[0], n[1], n[2:]))
        elif word == "step":
            self.end_of_step(n[1])
            self.step, self.claimed = n[0], n[3]
            self.expect("contact problems solved", abs(n[4] - 1), 0, "step")
            self.expect("residual of contact problems", abs(n[3]), USEFUL, "step")
            self.until = n[2]
        elif word == "end":
            self.end_of_step(None)
        elif word in ("part", "trial", "instant", "arrives", "extrapolated", "start"):
            self.block, self.when = (word, n), n[0]

    until, moved = None, False

    def end_of_step(self, start):
        """All bodies have reached the end of the step before, where the next one begins."""
        if self.until is None:
            return
        for body in self.bodies.values():
            if body.mass > 0:
                self.expect("time goes on", abs(body.time - self.until), 1e-9 * (1 + abs(self.until)), body.name)
        if start is not None:
            self.expect("time goes on", abs(start - self.until), 1e-9 * (1 + abs(self.until)), "step")

    def expect(self, law, amount, bound, what):
        self.judged[law] += 1
        if not (amount <= bound < math.inf):
            self.faults.append(f"step {self.step:g}, t = {self.when:g} s: {what}: {law}: {amount:.3g}, at most {bound:.3g}")

    def finish(self):
        """Judges the block that has been read."""
        if self.block is None:
            for _, n, _ in self.lines:
                self.bodies[n[0]].state, name = n[1:], self.bodies[n[0]].name
                self.expect("unit orientation", abs(norm(n[4:8]) - 1), 1e-9, name)
                self.expect("fixed bodies rest", norm(n[8:11]) + norm(n[11:14]), 0, name)
        else:
            (word, n), bodies = self.block, self.bodies
            to = {line[0]: line[1:] for kind, line, _ in self.lines if kind == "to"}
            if word == "trial" and self.trial is None:
                self.trial = {k: (b.state, b.time) for k, b in bodies.items()}
            if word == "part" and isinstance(self.trial, dict):
                ends = {k: b.state for k, b in bodies.items()}
                for k, b in bodies.items():
                    b.state, b.time = self.trial[k]
                self.trial = [ends]
            if word in ("part", "trial"):
                self.part(n, to)
            elif word == "extrapolated":
                self.extrapolated(to)
            if word in ("instant", "arrives"):
                self.follows(n[0], to)
            if word == "instant":
                self.instant(n, to)
            elif word == "start" and any(bodies[k].state for k in to):
                self.judged["motion goes on"] += 1
                self.expect("motion goes on", max(norm(add(bodies[k].state, s, -1)) for k, s in to.items()), 1e-6, "all bodies")
            self.moved = self.moved or bool(to)
            for k, state in to.items():
                bodies[k].state, bodies[k].time = state, n[0] + (n[1] if word in ("part", "trial") else 0)
                self.expect("unit orientation", abs(norm(state[3:7]) - 1), 1e-9, bodies[k].name)
            if to:
                self.hold(to)
        self.block, self.lines = None, []

    def hold(self, moved):
        """Joints of these bodies hold."""
        for joint in self.joints.values():
            if not moved.keys() & set(joint.bodies):
                continue
            states = [self.state(k) for k in joint.bodies]
            if not all(states):
                raise Damaged(f"joint {joint.name}: a body has no state")
            arm = 1 + norm(joint.p1) + norm(joint.p2) + max(norm(s[:3]) for s in states)
            fast = 1 + max(norm(s[7:10]) + norm(s[10:13]) * arm for s in states)
            off, slip = joint.errors(states, max(self.bodies[k].time or 0 for k in joint.bodies if k >= 0))
            self.expect("joints hold", off, HOLDS * arm, joint.name)
            self.expect("joints' velocities", slip, HOLDS * fast * arm, joint.name)

    def state(self, k):
        return self.bodies[k].state if k >= 0 else [0.0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0]

    def part(self, n, to):
        start, dt, composed, claimed = n
        bodies = self.bodies
        for k in to:
            if bodies[k].state is None:
                raise Damaged(f"body {bodies[k].name} has no state at {start:g} s")
            self.expect("time goes on", abs(bodies[k].time - start), 1e-9 * (1 + abs(start)), bodies[k].name)
        loads = {k: [[0.0] * 3, [0.0] * 3, 0.0, 0.0] for k in to}  # P, L about the centre, scales
        late = {k: [[0.0] * 3, [0.0] * 3] for k in to}

        def load(k, force, torque, on=loads):
            if k in on:
                on[k][0], on[k][1] = add(on[k][0], force), add(on[k][1], torque)
                loads[k][2] += norm(force)
                loads[k][3] += norm(torque)

        pushed = collections.Counter()
        for kind, m, text in self.lines:
            if kind == "push":
                load(m[0], m[1:4], m[4:7])
                if text == "gravity":
                    pushed[m[0]] += 1
                    self.expect("weight", norm(add(m[1:4], self.gravity, -dt * self.index(m[0]).mass)),
                                (1e-9 * dt + TIMES * (1 + abs(start))) * bodies[m[0]].mass * norm(self.gravity), bodies[m[0]].name)
        if norm(self.gravity) > 0 and dt > 0:
            for k in to:
                self.expect("weight acts", 1 - pushed[k], 0, bodies[k].name)
        self.pulls(load, late, to)
        for kind, m, _ in self.lines:
            if kind == "law":
                for i in range(10, len(m) - 6, 7):
                    load(m[i], scaled(m[i + 1:i + 4], m[9]), scaled(m[i + 4:i + 7], m[9]))
        free = {k: (b.state[7:10], b.state[10:13]) for k, b in bodies.items() if b.state}
        for k in to:
            b = bodies[k]
            free[k] = (add(b.state[7:10], loads[k][0], 1 / b.mass), add(b.state[10:13], b.unspin(b.state[3:7], loads[k][1])))
        for kind, m, _ in self.lines:
            if kind == "contact":
                for k, p, sign in ((m[0], m[2:5], 1), (m[1], m[5:8], -1)):
                    if self.index(k).mass > 0:
                        arm = add(p, bodies[k].state[:3], -1)
                        load(k, scaled(m[16:19], sign), scaled(add(m[19:22], cross(arm, m[16:19])), sign))
        mid = {k: (b.state[7:10], b.state[10:13]) for k, b in bodies.items() if b.state}
        for k in to:
            b = bodies[k]
            mid[k] = (add(b.state[7:10], loads[k][0], 1 / b.mass), add(b.state[10:13], b.unspin(b.state[3:7], loads[k][1])))
        via = {m[0]: (m[1:4], m[4:7]) for kind, m, _ in self.lines if kind == "via" and self.index(m[0])}
        self.contacts(dt, composed, claimed, free, {**mid, **via})
        self.laws(dt, composed, {**mid, **via})
        placed = {m[0]: m[1:] for kind, m, _ in self.lines if kind == "placed" and self.index(m[0])}
        reach = sum(abs(m[11]) for kind, m, _ in self.lines if kind == "contact")
        for k in to:
            self.moves(bodies[k], dt, loads[k], late[k], placed.get(k, bodies[k].state[:7]), to[k], reach)

    def pulls(self, load, late, to):
        """What joints do, with its reaction, along the directions that they hold."""
        numbers = sorted(self.joints)
        for kind, m, _ in self.lines:
            if kind != "pull":
                continue
            couples = int(m[0]) - len(numbers)
            if not -len(numbers) <= couples < len(self.coupled) or m[0] != int(m[0]):
                raise Damaged(f"a pull of joint {m[0]:g}, which is not told")
            joint = self.joints[self.coupled[couples][1] if couples >= 0 else m[0]]
            states = [to.get(k, self.state(k)) if m[1] else self.state(k) for k in joint.bodies]
            f1, m1, f2, m2 = m[2:5], m[5:8], m[8:11], m[11:14]
            for k, force, torque in ((joint.bodies[0], f1, m1), (joint.bodies[1], f2, m2)):
                if m[1]:
                    load(k, force, torque, late)
                else:
                    load(k, force, torque)
            held, turns, z = joint.directions(states)
            if couples >= 0:
                held, turns = ([z], []) if joint.kind == "slider" else ([], [z])
            elif (self.block[0] == "instant" or self.block[1][1] == 0) and (joint.has_laws or any(m[0] == c[1] for c in self.coupled)) or joint.driven:
                (held if joint.kind == "slider" else turns).append(z)
                if joint.kind == "ball":
                    turns += [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]]
            point = joint.places(states)[2]
            about = [add(torque, cross(add(s[:3], point, -1), force))
                     for s, force, torque in zip(states, (f1, f2), (m1, m2))]
            size, sized = norm(f1) + norm(f2), norm(m1) + norm(m2)
            arm = sum(norm(add(s[:3], point, -1)) for s in states)
            self.expect("reaction", norm(add(f1, f2)), 1e-9 * size, joint.name)
            self.expect("reaction", norm(add(*about)), HOLDS * (sized + size * (arm + 1e-3)), joint.name)
            for what, total, along in (("force", f1, held), ("moment", about[0], turns)):
                rest = total
                for u in along:
                    rest = add(rest, u, -dot(rest, u) / (dot(u, u) or 1))
                self.expect(f"{what} of the joint's kind", norm(rest), HOLDS * (sized + size * (arm + 1e-3)) + 1e-12, joint.name)

    def friction(self, first, second, states):
        for a, b in ((first, second), (second, first)):
            pair = self.pairs.get((self.index(a).material, self.index(b).material))
            if pair:
                along, sideways = (0.0, 0.0) if self.frictionless else pair[:2]
                axis = turn(states[a][3:7], self.bodies[a].axis) if along != sideways else [0.0] * 3
                return (along, sideways, axis, self.associated), pair[2:]
        raise Damaged(f"bodies {self.bodies[first].name} and {self.bodies[second].name} have no pair")

    def contacts(self, dt, composed, claimed, free, mid):
        states, lines = {k: b.state for k, b in self.bodies.items()}, [m for kind, m, _ in self.lines if kind == "contact"]
        worst, speed, name, near = 0.0, 0.0, "", collections.defaultdict(list)
        for m in lines:
            near[m[0], m[1]].append(m[2:5])
        for m in lines:
            first, second, n, gap, bias, slip, x, moment = m[0], m[1], m[8:11], m[11], m[12], m[13:16], m[16:19], m[19:22]
            points = {first: m[2:5], second: m[5:8]}
            what = f"{self.index(first).name} on {self.index(second).name}"
            if first not in mid or second not in mid:
                raise Damaged(f"contact of {what}: a body has no state")
            friction, (restitution, rolling, torsional) = self.friction(first, second, states)
            relative = lambda v: add(*[add(v[k][0], cross(v[k][1], add(points[k], states[k][:3], -1))) for k in (first, second)], -1)
            came, comes, after = (relative(v) for v in ({k: (s[7:10], s[10:13]) for k, s in states.items()}, free, mid))
            push, tangent = dot(x, n), add(x, n, -dot(x, n))
            self.expect("points of contact", norm(add(m[5:8], m[2:5], -1)), abs(gap) * (1 + 1e-6) + 1e-9 * (1 + norm(m[2:5])), what)
            self.expect("unit normal", abs(norm(n) - 1), 1e-9, what)
            spin = dot(moment, n)
            self.expect("moments of friction", max(abs(spin) - torsional * push, norm(add(moment, n, -spin)) - rolling * push),
                        BALANCE * push, what)
            inverse = sum(1 / self.bodies[k].mass for k in (first, second) if self.bodies[k].mass > 0)
            most = max(norm(came), norm(comes))
            tiny = BALANCE * norm(x) + (1e-9 * most / inverse if inverse > 0 else 0)
            self.expect("contacts push", -push, tiny, what)
            self.expect("Coulomb's cone", norm(tangent), max(friction[:2]) * push + tiny, what)
            w = add(add(after, slip), n, bias)
            off = natural_residual(friction, n, scaled(x, inverse), w)
            turning = sum(norm(states[k][10:13]) + norm(mid[k][1]) for k in (first, second))
            fast = sum(norm(states[k][7:10]) + norm(mid[k][0]) + norm(free[k][0]) + norm(mid[k][1]) * norm(add(points[k], states[k][:3], -1)) for k in (first, second))
            speed = max(speed, norm(came) + norm(comes) + norm(slip) + abs(bias) + norm(x) * inverse + norm(self.gravity) * dt)
            if off > worst:
                worst, name = off, what
            # The middle of the sub-step is this far from the start: bodies turn, their normal does along an edge,
            # and points move in their face, or along a curve: an ellipsoid's radius is at most a^2 / height.
            moving = [k for k in (first, second) if self.bodies[k].mass > 0]
            arms = [max(norm(add(points[k], states[k][:3], -1)), 1e-300) for k in moving]
            heights = [max(abs(dot(n, add(points[k], states[k][:3], -1))), 1e-300) for k in moving]
            flat = max((5 * sum(self.bodies[k].inertia[i][i] for i in range(3)) / self.bodies[k].mass / height
                        for k, height in zip(moving, heights)), default=0.0)
            patch = max(norm(add(other, m[2:5], -1)) for other in near[first, second])
            spins = norm(add(free[first][1], free[second][1], -1))
            middle = dt * turning * fast + spins * patch + dt * spins * spins * flat + 1e-9 * (1 + fast)
            middle += dt * most * most / min(arms, default=math.inf)
            approach, comes_n = -dot(came, n), -dot(comes, n)
            allowed = [max(gap, 0.0) / dt if dt > 0 else 0.0]
            if comes_n * dt > gap or dt == 0:
                allowed.append(0.0)
                allowed.append(-restitution * min(approach, comes_n))
            if not composed:
                self.expect("restitution, or gap that closes", min(abs(bias - b) for b in allowed), middle, what)
            belts = add(*[turn(states[k][3:7], add(self.bodies[k].belt[:3], cross(
                self.bodies[k].belt[3:], turn(back(states[k][3:7]), add(points[k], states[k][:3], -1))))) for k in (first, second)], -1)
            self.expect("surface speed", norm(add(slip, add(belts, n, -dot(belts, n)), -1)), middle, what)
        if lines:
            self.expect("residual as claimed", abs(claimed - worst), 1e-4 * worst + 1e-9 * speed, "contacts")
            if not composed:
                self.expect("law of contact", worst, max(LAW, 1e2 * self.claimed) * speed, name)
        else:
            self.expect("residual as claimed", abs(claimed), 0.0, "contacts")

    def laws(self, dt, composed, mid):
        for kind, m, _ in self.lines:
            if kind != "law":
                continue
            if m[0] not in self.joints:
                raise Damaged(f"a law of joint {m[0]:g}, which is not told")
            law, gap, restitution, rate, bound, stretch, stiffness, damping, x = m[1:10]
            speed, scale, inverse, came = 0.0, 1e-9, 0.0, 0.0
            for i in range(10, len(m) - 6, 7):
                v = mid[self.index(m[i]) and m[i]]
                speed += dot(m[i + 1:i + 4], v[0]) + dot(m[i + 4:i + 7], v[1])
                came += dot(m[i + 1:i + 4], self.bodies[m[i]].state[7:10]) + dot(m[i + 4:i + 7], self.bodies[m[i]].state[10:13])
                b = self.bodies[m[i]]
                inverse += dot(m[i + 1:i + 4], m[i + 1:i + 4]) / b.mass + dot(m[i + 4:i + 7], b.unspin(b.state[3:7], m[i + 4:i + 7]))
            what = self.joints[m[0]].name
            scale = abs(x) * inverse + abs(speed) + abs(came) + abs(rate) + abs(gap) / dt
            if law == 0:
                open_at = -gap / dt if gap > 0 else 0.0
                floors = [open_at, 0.0, -restitution * came]
                self.expect("limit", max(-x * inverse, min(open_at, 0) - speed), 1e-4 * scale, what)
                if not composed:
                    self.expect("limit", min(abs(min(x * inverse, speed - f)) for f in floors), 1e-4 * scale, what)
            else:
                if bound < math.inf:
                    self.expect("bound", abs(x), bound * dt * (1 + 1e-6), what)
                wanted = speed - rate
                y = -dt * (stiffness * (stretch + dt * wanted) + damping * wanted) if law == 2 else x - wanted / (inverse or 1)
                if not composed:
                    self.expect("motor, friction or spring", abs(x - max(-bound * dt, min(bound * dt, y))) * inverse, 1e-4 * scale, what)

    def moves(self, b, dt, load, late, placed, end, reach):
        """Balances of a body over a sub-step; from where corrections have placed it to its end."""
        q0, x1, q1, v1, w1 = b.state[3:7], end[:3], end[3:7], end[7:10], end[10:13]
        change = add(v1, b.state[7:10], -1)
        scale = load[2] + b.mass * (norm(change) + 1e-9 * (norm(v1) + norm(b.state[7:10])))
        self.expect("balance of momentum", norm(add(add(scaled(change, b.mass), load[0], -1), late[0], -1)), BALANCE * scale, b.name)
        corrected = times(placed[3:7], back(q0))
        before = b.spin(q0, b.state[10:13])
        middle = turn(corrected, add(before, load[1]))
        momentum = self.keeps_momentum and not b.round
        inside = b.unspin(placed[3:7], middle)
        after = b.spin(q1 if momentum else placed[3:7], w1)
        scale = load[3] + norm(add(after, before, -1)) + 1e-8 * (norm(after) + norm(before)) + 1e-6 * load[2] * (1 + norm(x1))
        shifted = apart(corrected, [1.0, 0, 0, 0])
        off = norm(add(add(after, middle, -1), late[1], -1))
        self.expect("balance of angular momentum", off, BALANCE * scale + shifted * norm(middle) * (1 if norm(late[1]) else 0), b.name)
        # Positions: by the velocity that the sub-step ends with, or along the parabola of free fall.
        v = add(v1, late[0], -1 / b.mass)
        moved = add(add(x1, placed[:3], -1), v, -dt)
        if norm(moved) > 1e-9 * (norm(x1) + dt * norm(v)):
            moved = add(moved, self.gravity, dt * dt / 2)
        self.expect("places move as velocities", norm(moved), 1e-9 * (norm(x1) + dt * norm(v)) + 1e-6 * dt * norm(v), b.name)
        if momentum:
            ends = b.unspin(q1, middle)
            way = scaled(add(turn(back(placed[3:7]), inside), turn(back(q1), ends)), dt / 2)
            there = times(placed[3:7], rotation(way))
        else:
            there = times(rotation(scaled(add(w1, b.unspin(q1, late[1]), -1), dt)), placed[3:7])
        self.expect("orientation moves as velocities", apart(there, q1), 1e-9 + 1e-6 * dt * norm(w1), b.name)
        allowed = 10 * reach + HOLDS * (1 + norm(x1)) * 1e-2
        self.expect("corrections close gaps", norm(add(placed[:3], b.state[:3], -1)), allowed, b.name)

    def instant(self, n, to):
        """Equations of motion: accelerations that the joints allow, and that lead from one instant to the next."""
        bodies, loads = self.bodies, {k: [[0.0] * 3, [0.0] * 3, 0.0, 0.0] for k in to}
        for k, state in to.items():
            bodies[k].state = state

        def load(k, force, torque):
            if k in loads:
                sizes = loads[k][2] + norm(force), loads[k][3] + norm(torque)
                loads[k] = [add(loads[k][0], force), add(loads[k][1], torque), *sizes]

        weights = collections.Counter()
        for kind, m, text in self.lines:
            if kind == "push":
                load(m[0], m[1:4], m[4:7])
                if text == "gravity":
                    weights[m[0]] += 1
                    mass = self.index(m[0]).mass
                    self.expect("weight", norm(add(m[1:4], self.gravity, -mass)), 1e-9 * mass * norm(self.gravity), bodies[m[0]].name)
            elif kind == "contact":
                self.touch(m, load)
        if norm(self.gravity) > 0:
            for k in to:
                self.expect("weight acts", 1 - weights[k], 0, bodies[k].name)
        self.pulls(load, None, to)
        now = {"t": n[0], "events": n[1], "bodies": {}}
        rates = {m[0]: (m[1:4], m[4:7]) for kind, m, _ in self.lines if kind == "rate"}
        if rates.keys() != to.keys():
            raise Damaged("an acceleration is missing")
        for k, (force, torque, forces, torques) in loads.items():
            b, (a, alpha) = bodies[k], rates[k]
            q, w = b.state[3:7], b.state[10:13]
            gyroscopic, spun = cross(w, b.spin(q, w)), b.spin(q, alpha)
            self.expect("equations of motion", norm(add(force, a, -b.mass)), EQUATIONS * (forces + b.mass * norm(a)), b.name)
            self.expect("equations of rotation", norm(add(add(spun, gyroscopic), torque, -1)),
                        EQUATIONS * (torques + norm(gyroscopic) + norm(spun)) + 1e-9 * (sum(map(norm, b.inertia)) + forces), b.name)
            now["bodies"][k] = (b.state, a, alpha, torque, b.spin(q, w))
        for joint in self.joints.values():
            self.accelerates(joint, now)
        self.past = (self.past if self.past and self.past[-1]["events"] == n[1] else [])[-3:] + [now]
        if len(self.past) == 4:
            self.leads()

    def follows(self, time, to):
        """Places by the mean of the velocities, over whatever time has passed."""
        for k, s in to.items():
            b = self.bodies[k]
            if b.state:
                h = time - b.time
                off = norm(add(add(s[:3], b.state[:3], -1), add(s[7:10], b.state[7:10]), -h / 2))
                self.expect("time goes on", -h, 1e-9 * (1 + abs(time)), b.name)
                self.expect("places follow velocities", off,
                            1e-5 * (norm(s[:3]) + 0.1) + abs(h) / 4 * norm(add(s[7:10], b.state[7:10], -1)), b.name)

    def touch(self, m, load):
        """A contact that holds or slides at an instant."""
        first, second, p, n, slip, force, moment = m[0], m[1], m[2:5], m[8:11], m[13:16], m[16:19], m[19:22]
        what = f"{self.index(first).name} on {self.index(second).name}"
        states = {k: self.state(k) for k in (first, second)}
        friction, (_, rolling, torsional) = self.friction(first, second, states)
        v = {k: add(s[7:10], cross(s[10:13], add(p, s[:3], -1))) for k, s in states.items()}
        w = add(add(v[first], v[second], -1), slip)
        inverse = sum(1 / self.bodies[k].mass for k in (first, second) if self.bodies[k].mass > 0)
        fast = 1e-4 * (1 + norm(v[first]) + norm(v[second]))
        self.expect("law of contact", natural_residual(friction, n, scaled(force, inverse), w), fast + BALANCE * norm(force) * inverse, what)
        self.expect("contact closed", max(abs(m[11]), norm(add(p, m[5:8], -1))), 1e-4, what)
        push, spin = dot(force, n), dot(moment, n)
        self.expect("moments of friction", max(abs(spin) - torsional * push, norm(add(moment, n, -spin)) - rolling * push), 1e-6 * push + 1e-9, what)
        for k, sign in ((first, 1), (second, -1)):
            load(k, scaled(force, sign), scaled(add(moment, cross(add(p, states[k][:3], -1), force)), sign))

    def accelerates(self, joint, now):
        """The second derivatives of what a joint holds vanish."""
        still = ([0.0] * 3, [0.0] * 3)
        states = [self.state(k) for k in joint.bodies]
        (a1, al1), (a2, al2) = (now["bodies"][k][1:3] if k in now["bodies"] else still for k in joint.bodies)
        g1, g2, x1, x2, r1, r2 = joint.places(states)
        w1, w2 = states[0][10:13], states[1][10:13]
        rate = lambda v, w, r: add(v, cross(w, r))
        grow = lambda a, al, w, r: add(add(a, cross(al, r)), cross(w, cross(w, r)))
        d = add(x1, x2, -1)
        d1 = add(rate(states[0][7:10], w1, r1), rate(states[1][7:10], w2, r2), -1)
        d2 = add(grow(a1, al1, w1, r1), grow(a2, al2, w2, r2), -1)
        scale = norm(a1) + norm(a2) + (norm(al1) + norm(w1) ** 2) * norm(r1) + (norm(al2) + norm(w2) ** 2) * norm(r2)
        spin = norm(al1) + norm(al2) + norm(w1) ** 2 + norm(w2) ** 2
        held, turns, z = joint.directions(states)
        s2 = joint.way(now["t"])[2] if joint.driven else 0.0
        if joint.kind == "distance":
            u = held[0]
            off = [dot(u, d2) + (dot(d1, d1) - dot(u, d1) ** 2) / (norm(d) or 1) - s2]
            bad = []
        else:
            second = lambda k: dot(k, d2) + 2 * dot(cross(w2, k), d1) + dot(grow([0.0] * 3, al2, w2, k), d)
            off = [second(k) for k in held]
            if joint.kind == "slider" and joint.driven:
                off.append(second(z) - s2)
            w, al = add(w1, w2, -1), add(al1, al2, -1)
            bad = [dot(k, al) + dot(cross(w2, k), w) for k in turns]
            if joint.kind == "universal":
                a, b = turn(g1, [0, 0, 1.0]), turn(g2, [1.0, 0, 0])
                bad = [dot(turns[0], al) + dot(add(cross(cross(w1, a), b), cross(a, cross(w2, b))), w)]
            if joint.kind == "hinge" and joint.driven:
                bad.append(dot(z, al) + dot(cross(w2, z), w) - s2)
        self.expect("joint's acceleration", max(map(abs, off)), 1e-4 * (scale + abs(s2)) + 1e-6, joint.name)
        if bad:
            self.expect("joint's angular acceleration", max(map(abs, bad)), 1e-4 * (spin + abs(s2)) + 1e-6, joint.name)

    def leads(self):
        """From the second to the third of four instants, by fourth order; its error is judged by the second."""
        p = self.past
        h = p[2]["t"] - p[1]["t"]
        for k, (s0, a0, al0, t0, l0) in p[1]["bodies"].items():
            if not all(k in each["bodies"] for each in p):
                continue
            s1, a1, al1, t1, l1 = p[2]["bodies"][k]
            four = [each["bodies"][k] for each in p]
            size = 0.1 * sum(self.bodies[k].inertia[i][i] for i in range(3))
            for law, value, rate, tiny in (("momentum", lambda b: b[0][7:10], lambda b: b[1], 0.1), ("angular momentum", lambda b: b[4], lambda b: b[3], size),
                                           ("places", lambda b: b[0][:3], lambda b: b[0][7:10], 0.1)):
                f = [rate(b) for b in four]
                second = [scaled(add(f[i + 1], f[i - 1], -1), 1 / (p[i + 1]["t"] - p[i - 1]["t"])) for i in (1, 2)]
                before, after = value(four[1]), value(four[2])
                lead = add(scaled(add(f[1], f[2]), h / 2), scaled(add(*second, -1), h * h / 12))
                third = add(add(f[3], f[2], -3), add(f[0], f[1], -3), -1)
                bound = 1e-5 * (norm(before) + norm(after) + tiny) + h * h / 20 * (norm(second[0]) + norm(second[1])) + h / 5 * norm(third)
                self.expect(f"{law} between instants", norm(add(add(after, before, -1), lead, -1)), bound, self.bodies[k].name)
            way = add(scaled(add(s0[10:13], s1[10:13]), h / 2), scaled(add(al0, al1, -1), h * h / 12))
            bent = h * h / 6 * norm(cross(s0[10:13], s1[10:13])) + 0.2 * h * h / 12 * norm(add(al0, al1, -1))
            self.expect("orientation between instants", apart(times(rotation(way), s0[3:7]), s1[3:7]), 1e-5 + bent, self.bodies[k].name)

    def extrapolated(self, to):
        if not isinstance(self.trial, list):
            raise Damaged("an extrapolation without its trial")
        for k, state in to.items():
            b, half, whole = self.bodies[k], self.bodies[k].state, self.trial[0].get(k)
            best = [2 * h - w for h, w in zip(half, whole)]
            size = 1e-9 * (1 + norm(half)) + 1e-6 * norm(add(half, whole, -1))
            self.expect("extrapolation", norm(add(state[:3], best[:3], -1)) + norm(add(state[7:10], best[7:10], -1)), size, b.name)
            turned = times(half[3:7], back(whole[3:7]))
            self.expect("extrapolation", min(norm(add(state[10:], best[10:], -1)), norm(add(state[10:], half[10:], -1))), size, b.name)
            self.expect("extrapolation", min(apart(times(turned, half[3:7]), state[3:7]), apart(half[3:7], state[3:7])), size, b.name)
        self.trial = None


def main():
    worst = 0
    for file in sys.argv[1:]:
        try:
            judge = Judge().run(file)
        except (Damaged, OSError, IndexError, KeyError, ValueError, ZeroDivisionError, OverflowError, TypeError) as why:
            print(f"{file}: cannot be judged: {why}")
            worst = max(worst, 2)
            continue
        for fault in judge.faults[:10]:
            print(f"{file}: {fault}")
        print(f"{file}: {'holds' if not judge.faults else f'{len(judge.faults)} laws broken'}, {sum(judge.judged.values())} judgements")
        worst = max(worst, 1 if judge.faults else 0)
    return worst if len(sys.argv) > 1 else print(__doc__) or 2


if __name__ == "__main__":
    sys.exit(main())
