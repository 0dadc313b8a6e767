#!/usr/bin/env python3
"""Judges the certificate of a run by the laws of mechanics, without Tether's code. SPDX-License-Identifier: BSD-3-Clause

    python3 scene/tools/verify.py FILE.cert...     # written by: tether run SCENE.toml --certificate FILE.cert

The lines of a certificate are explained in docs/certificate.md.
Exit code: 0 every law holds, 1 one is broken, 2 a file cannot be judged."""
import collections
import math
import operator
import sys

# How much laws may be off: the part of the times, places, speeds, impulses or forces that they are about.
LAWS = {law: part for part, laws in {
    0: "contact problems solved, fixed bodies rest, weight acts",
    1e-9: "unit length, time goes on, weight, reaction, restitution or gap that closes",
    1e-6: "motion goes on, balance of momentum, balance of angular momentum, places move as velocities, orientation moves as velocities, "
          "extrapolation, joints hold, joints' velocities, moment of reaction, reaction of the joint's kind, law of contact, "
          "contact pushes within its cone, moments of friction, work of what comes to rest",
    1e-5: "equations of motion, equations of rotation, places follow velocities, momentum leads on, angular momentum leads on, "
          "places lead on, orientation leads on",
    1e-4: "residual as claimed, joints' accelerations, law of a joint, contact closed, law of contact at an instant",
    1e-3: "comes to rest", 1e-2: "residual of contact problems", 1: "surface speed", 1 + 1e-6: "points of contact",
    10: "corrections close gaps"}.items() for law in laws.split(", ")}
# Numbers of a line; "+": or more; "t": then a text.
HEADS = {"body": "9t", "surface": "10", "pair": "7", "gravity": "3", "engine": "0t", "joint": "23t", "coupled": "2+", "step": "5", "end": "1"}
BLOCKS = {"part": "4", "trial": "4", "extrapolated": "1", "start": "1", "instant": "2", "arrives": "1"}
INSIDE = {"push": "7t", "contact": "22", "pull": "14", "law": "10+", "placed": "8", "rate": "7"}
LINES = {**HEADS, **BLOCKS, **INSIDE, "to": "14"}
LONGEST, ROUNDING, TIMES = 1 << 16, 1e-9, 1e-15  # of a line; of places and speeds; of the difference of two times


class Damaged(Exception):
    pass


class V(tuple):
    """A vector, or a quaternion w x y z."""
    __add__ = lambda a, b: V(map(operator.add, a, b))
    __sub__ = lambda a, b: V(map(operator.sub, a, b))
    __mul__ = lambda a, factor: V([x * factor for x in a])
    __matmul__ = lambda a, b: sum(map(operator.mul, a, b))
    __xor__ = lambda a, b: V((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))
    __abs__ = lambda a: math.hypot(*a)
    tail = property(lambda a: V(a[1:]))
    unit = property(lambda a: a * (1 / (abs(a) or 1)))
    back = property(lambda q: V((q[0], -q[1], -q[2], -q[3])))
    beside = lambda a, n: a - n * (a @ n)  # n: unit
    then = lambda q, p: V((p[0] * q[0] - p.tail @ q.tail, *q.tail * p[0] + p.tail * q[0] + (p.tail ^ q.tail)))  # turns by q, then by p
    turn = lambda q, v: v + (q.tail ^ v) * (2 * q[0]) + (q.tail ^ (q.tail ^ v)) * 2
    apart = lambda p, q: 2 * min(abs(p - q), abs(p + q))
    across = lambda n: min(X, Y, Z, key=lambda e: abs(e @ n)).beside(n).unit


X, Y, Z, NONE = V((1, 0, 0)), V((0, 1, 0)), V((0, 0, 1)), V((0, 0, 0))
State = collections.namedtuple("State", "x q v w")
STILL = State(NONE, V((1, 0, 0, 0)), NONE, NONE)


def rotation(v):
    a = min(abs(v), 1e300)
    return V((math.cos(a / 2), *v * (math.sin(a / 2) / a if a > 0 else 0.5)))


def natural_residual(friction, n, y, w):
    """|x - P(x - v)|, P the projection onto the cone: how far an impulse over the mass, y, and a velocity w are off Coulomb's law, m/s."""
    along, sideways, axis, associated = friction
    t = axis.beside(n).unit if abs(axis.beside(n)) > 0 else n.across()
    b = n ^ t
    v, x = V((n @ w, along * (t @ w), sideways * (b @ w))), V((n @ y, t @ y / (along or math.inf), b @ y / (sideways or math.inf)))
    z = x - v - X * (0 if associated else abs(v.tail))
    size = abs(z.tail)
    onto = max(0.0, (z[0] + size) / 2)
    p = V((onto, *z.tail * (onto / (size or 1)))) if size > z[0] else z
    return max(abs(x - p), 0 if along or sideways else abs(y.beside(n)))


def read(file):
    """Words, numbers and texts of its lines; Damaged where it is none, or not whole."""
    number, word = 0, ""
    with open(file, encoding="utf-8", errors="replace") as lines:
        for number, line in enumerate(iter(lambda: lines.readline(LONGEST), ""), 1):
            last, (word, _, rest) = word, line[:-1].partition(" ")
            if not line.endswith("\n") or last == "end":
                raise Damaged(f"line {number} is cut, longer than any, or behind the end")
            if number == 1 and line == "tether certificate 1\n":
                continue
            if number == 1 or word not in LINES:
                raise Damaged(f"line {number}: {word[:20]!r} is no word of a certificate of this format")
            least, has_text = int(LINES[word].rstrip("+t")), "t" in LINES[word]
            n = rest.split(" ", least if has_text else -1)
            text = n.pop() if has_text and len(n) > least else ""
            n = [float(each) for each in n]
            finite = all(math.isfinite(x) or k == 5 and x == math.inf and word == "law" for k, x in enumerate(n))
            if not finite or len(n) < least or len(n) > least and "+" not in LINES[word] or word == "end" and n != [number - 1]:
                raise Damaged(f"line {number}: {word} has {LINES[word].rstrip('+t')} finite numbers; that of the end is of the lines before")
            yield number, word, n, text
    if word != "end":
        raise Damaged("its end is missing: it was cut")


class Body:
    def __init__(self, n, name):
        self.mass, self.material, self.name, self.trace = n[1], n[8], name, sum(n[2:5])
        self.rows = a, b, c = V((n[2], n[7], n[6])), V((n[7], n[3], n[5])), V((n[6], n[5], n[4]))  # of the inertia
        self.round = max(abs(row - e * n[2]) for row, e in zip(self.rows, (X, Y, Z))) <= 1e-13 * n[2]
        self.inverse = [e * (1 / (a @ (b ^ c))) for e in (b ^ c, c ^ a, a ^ b)] if self.mass else None
        self.state, self.time, self.surface = None, 0.0, (NONE, NONE, NONE)
        if self.mass < 0:
            raise Damaged(f"the mass of {name} is negative")

    def spin(self, q, w, rows=None):
        """Angular momentum, world axes; of it, with the inverse rows, the angular velocity."""
        u = q.back.turn(w)
        return q.turn(V([row @ u for row in rows or self.rows]))

    def struck(self, loads):
        s = self.state
        return State(s.x, s.q, s.v + total(loads)[0] * (1 / self.mass), s.w + self.spin(s.q, total(loads)[1], self.inverse))


def total(loads):
    """Impulse and moment about the centre, or force and torque, and the sums of their sizes."""
    return sum((f for f, _ in loads), NONE), sum((m for _, m in loads), NONE), sum(abs(f) for f, _ in loads), sum(abs(m) for _, m in loads)


class Joint:
    # Directions of the second body's frame in which points, and turns, are held. d: from point to point; u: across both axes.
    HELD = {"ball": ("xyz", ""), "hinge": ("xyz", "xy"), "slider": ("xy", "xyz"), "fixed": ("xyz", "xyz"), "planar": ("z", "xy"),
            "universal": ("xyz", "u"), "distance": ("d", "")}

    def __init__(self, n, text):
        self.kind, _, self.name = text.partition(" ")
        self.bodies, self.points, self.frames = n[1:3], (V(n[3:6]), V(n[10:13])), (V(n[6:10]), V(n[13:17]))
        self.length, self.driven, self.has_laws, self.motion, self.arms = n[17], n[18] == 1, n[18] == 2, n[19:23], sum(map(abs, self.points))
        held, turns = self.HELD[self.kind]
        self.held, self.turns = held + "z" * (self.driven and self.kind == "slider"), turns + "z" * (self.driven and self.kind == "hinge")

    def place(self, states):
        """The point on the first body, its way from that on the second, the turn, the directions held of points and of turns, the axis."""
        (a, b), (one, two) = states, (f.then(s.q) for s, f in zip(states, self.frames))
        p = a.x + a.q.turn(self.points[0])
        d = p - b.x - b.q.turn(self.points[1])
        axes = {"x": two.turn(X), "y": two.turn(Y), "z": two.turn(Z), "d": d.unit, "u": one.turn(Z) ^ two.turn(X)}
        return p, d, one.then(two.back), [axes[k] for k in self.held], [axes[k] for k in self.turns], axes["z"]

    def errors(self, states, t):
        """How far places (m, rad) are off, and speeds of points and of turns."""
        (a, b), (p, d, q, held, turns, _) = states, self.place(states)
        u = a.v + (a.w ^ (p - a.x)) - b.v - (b.w ^ (p - b.x))
        off, slips, spins = [k @ d for k in held], [k @ u for k in held], [k @ (a.w - b.w) for k in turns]
        if self.kind == "distance":
            off[0] -= self.length
        if self.driven:
            (rate, amplitude, frequency, phase), w = self.motion, 2 * math.pi * self.motion[2]
            s, fast = rate * t + amplitude * (math.sin(w * t + phase) - math.sin(phase)), rate + amplitude * w * math.cos(w * t + phase)
            if self.kind == "hinge":
                q, spins[-1] = q.then(rotation(Z * -s)), spins[-1] - fast
            else:
                off[-1], slips[-1] = off[-1] - s, slips[-1] - fast
        tilt = q.turn(Z)
        return off + {"": [], "u": [tilt[0]], "xy": list(tilt[:2]), "xyz": list(q.tail * 2)}[self.turns], slips, spins

    def accelerations(self, states, rates, t):
        """How fast the errors of speeds grow, of points and of turns: by differences over a short time."""
        h = 1e-3 / (1 + max(abs(s.w) for s in states) + 2 * math.pi * abs(self.motion[2]))
        ahead, behind = (self.errors([State(s.x + s.v * k, s.q.then(rotation(s.w * k)), s.v + a * k, s.w + alpha * k)
                                      for s, (a, alpha) in zip(states, rates)], t + k)[1:] for k in (h, -h))
        return [[(x - y) / (2 * h) for x, y in zip(*each)] for each in zip(ahead, behind)]


class Judge:
    def __init__(self):
        self.bodies, self.pairs, self.joints, self.reacts, self.gravity = {-1: Body([-1, 0, 0, 0, 0, 0, 0, 0, -1], "the world")}, {}, {}, {}, NONE
        self.bodies[-1].state = STILL
        self.faults, self.judged, self.step, self.when, self.line, self.claimed = [], collections.Counter(), 0, 0.0, 0, 0.0
        self.until, self.block, self.before, self.trial, self.moved = None, None, None, None, False
        self.told, self.past = collections.defaultdict(list), collections.deque(maxlen=4)

    def run(self, file):
        for line, word, n, text in read(file):
            if word not in HEADS and word not in BLOCKS:
                if word != "to" and not self.block or word not in ("pull", "law") and n[0] not in self.bodies:
                    raise Damaged(f"line {line}: {word} is of no part or of no body")
                self.told[word].append((n, text))
                continue
            self.finish()
            self.line = line
            if word in BLOCKS:
                self.block, self.when = (word, n), n[0]
            else:
                self.head(word, n, text)
        if not self.moved:
            raise Damaged("nothing moves in it")
        return self

    def expect(self, law, off, size=1.0, what="step", slack=0.0):
        bound = LAWS[law] * size + slack
        self.judged[law] += 1
        if not off <= bound < math.inf:
            self.faults.append(f"step {self.step:g}, t = {self.when:g} s: {what}: {law}: {off:.3g}, at most {bound:.3g}")

    def head(self, word, n, text):
        if word == "body":
            if n[0] in self.bodies:
                raise Damaged(f"body {n[0]:g} is told twice")
            self.bodies[n[0]] = Body(n, text)
        elif word == "surface":
            self.bodies[n[0]].surface = V(n[1:4]), V(n[4:7]), V(n[7:10])
        elif word == "pair":
            self.pairs[n[0], n[1]] = n[2:]
        elif word == "gravity":
            self.gravity = V(n)
        elif word == "engine":
            self.rules, self.joints, self.reacts = (text + "  ").split(" ")[1:3], {}, {}
            self.past.clear()
        elif word == "joint":
            self.joints[n[0]] = self.reacts[n[0]] = Joint(n, text)
        elif word == "coupled":
            self.reacts[len(self.reacts)] = self.joints[n[1]]
            self.joints[n[1]].has_laws = True
        if word in ("step", "end") and self.until is not None:  # all bodies have reached the end of the step, where the next one begins
            starts = [b.time for b in self.bodies.values() if b.mass > 0] + n[1:2]
            self.expect("time goes on", max(abs(t - self.until) for t in starts), 1 + abs(self.until))
        if word == "step":
            self.step, self.until, self.claimed = n[0], n[2], n[3]
            self.expect("contact problems solved", abs(n[4] - 1))
            self.expect("residual of contact problems", abs(n[3]))

    def finish(self):
        """Judges the block that has been read; outside of blocks places of fixed bodies are told."""
        word, n = self.block or ("", [0.0])
        self.to = to = {m[0]: State(V(m[1:4]), V(m[4:8]), V(m[8:11]), V(m[11:14])) for m, _ in self.told["to"]}
        if any((self.bodies[k].mass > 0) != bool(word) for k in to):
            raise Damaged("a fixed body moves, or one that moves is told outside of parts")
        if word == "trial" and self.before is None:
            self.before = {k: (b.state, b.time) for k, b in self.bodies.items()}
        if word == "part" and self.before is not None:
            self.trial = {k: b.state for k, b in self.bodies.items()}
            for k, b in self.bodies.items():
                b.state, b.time = self.before[k]
            self.before = None
        {"part": self.part, "trial": self.part, "extrapolated": self.extrapolated, "instant": self.instant, "arrives": self.follows,
         "start": lambda t: None, "": lambda t: None}[word](*n)
        for k, s in to.items():
            b = self.bodies[k]
            self.expect("fixed bodies rest", 0 if word else abs(s.v) + abs(s.w), 1, b.name)
            self.expect("motion goes on", max(abs(x - y) for x, y in zip(s, b.state)) if word == "start" and b.state else 0, 1, b.name)
            self.expect("unit length", abs(abs(s.q) - 1), 1, b.name)
            b.state, b.time = s, n[0] + (n[1] if word in ("part", "trial") else 0)
        for joint in self.joints.values():
            if to.keys() & set(joint.bodies):
                states = [self.bodies[k].state for k in joint.bodies]
                arm = 1 + joint.arms + max(abs(s.x) for s in states)
                off, slips, spins = joint.errors(states, max(self.bodies[k].time for k in joint.bodies))
                self.expect("joints hold", max(map(abs, off)), arm, joint.name)
                self.expect("joints' velocities", max(map(abs, slips + spins)), (1 + max(abs(s.v) + abs(s.w) * arm for s in states)) * arm, joint.name)
        self.moved, self.block = self.moved or bool(word and to), None
        self.told.clear()

    def loads(self, dt):
        """What acts on bodies but for contacts: impulses, of an instant (dt 1) forces; and what joints do along rows of the end."""
        now, late, weights, power, size = {k: [] for k in self.to}, {k: [] for k in self.to}, collections.Counter(), 0.0, 0.0
        for n, effect in self.told["push"]:
            b, s, force, moment = self.bodies[n[0]], self.to[n[0]], V(n[1:4]), V(n[4:7])
            now[n[0]].append((force, moment))
            if dt == 0:  # an impact has no forces: these stop what moves too slowly to count, and do no work on what is left
                stopped = abs(force) / b.mass + abs(b.spin(s.q, moment, b.inverse)) * math.sqrt(b.trace / b.mass)
                self.expect("comes to rest", stopped, 1, b.name)
                power, size = power + force @ s.v + moment @ s.w, size + abs(force) * (abs(s.v) + abs(b.state.v)) + abs(moment) * (abs(s.w) + abs(b.state.w))
            if effect == "gravity":
                weights[n[0]] += 1
                weight = self.gravity * self.bodies[n[0]].mass
                self.expect("weight", abs(V(n[1:4]) - weight * dt), abs(weight) * dt, self.bodies[n[0]].name, TIMES * (1 + abs(self.when)) * abs(weight))
        self.expect("work of what comes to rest", 0 if any(any(sum(b.surface[:2], ())) for b in self.bodies.values()) else abs(power), size, "impact")
        for k in now:
            self.expect("weight acts", abs(1 - weights[k]) if dt > 0 and any(self.gravity) else 0, 1, self.bodies[k].name)
        for n, _ in self.told["pull"]:
            joint, at_end, wrenches = self.reacts[n[0]], n[1] != 0, ((V(n[2:5]), V(n[5:8])), (V(n[8:11]), V(n[11:14])))
            for k, wrench in zip(joint.bodies, wrenches):
                (late if at_end else now).get(k, []).append(wrench)
            self.reaction(joint, n[0] not in self.joints, [self.to.get(k, self.bodies[k].state) if at_end else self.bodies[k].state
                                                           for k in joint.bodies], wrenches)
        for n, _ in self.told["law"]:
            for i in range(10, len(n), 7):
                now.get(n[i], []).append((V(n[i + 1:i + 4]) * n[9], V(n[i + 4:i + 7]) * n[9]))
        return now, late

    def reaction(self, joint, couples, states, wrenches):
        """It is opposite on both bodies, and along directions that the joint holds, drives or has laws of."""
        p, _, _, held, turns, z = joint.place(states)
        if couples:
            held, turns = [], []
        if couples or joint.has_laws and (self.block[0] == "instant" or self.block[1][1] == 0):
            held, turns = (held + [z], turns) if joint.kind == "slider" else (held, [X, Y, Z] if joint.kind == "ball" else turns + [z])
        about = [moment + ((s.x - p) ^ force) for s, (force, moment) in zip(states, wrenches)]
        _, _, size, sized = total(wrenches)
        sized += size * (sum(abs(s.x - p) for s in states) + 1e-3)
        self.expect("reaction", abs(wrenches[0][0] + wrenches[1][0]), size, joint.name)
        self.expect("moment of reaction", abs(about[0] + about[1]), sized, joint.name)
        for rest, along in ((wrenches[0][0], held), (about[0], turns)):
            for u in along:
                rest = rest.beside(u.unit)
            self.expect("reaction of the joint's kind", abs(rest), sized, joint.name, 1e-12)

    def part(self, start, dt, composed, claimed):
        """A sub-step, or an impact (dt 0): momenta change by the impulses, and contacts and joints obey their laws."""
        for k in self.to:
            self.expect("time goes on", abs(self.bodies[k].time - start), 1 + abs(start), self.bodies[k].name)
        came = {k: b.state for k, b in self.bodies.items()}
        loads, late = self.loads(dt)
        free = {**came, **{k: self.bodies[k].struck(loads[k]) for k in loads}}
        self.push_by_contacts(loads)
        mid = {**came, **{k: self.bodies[k].struck(loads[k]) for k in loads}}
        found = [self.contact(n, came, free, mid, dt, composed) for n, _ in self.told["contact"]] or [(0.0, 0.0, "contacts")]
        worst, _, what = max(found, key=lambda each: each[0])
        speed = max(each[1] for each in found)
        self.expect("residual as claimed", abs(claimed - worst), worst, what, ROUNDING * speed)
        self.expect("law of contact", 0 if composed else worst, max(1, 1e8 * self.claimed) * speed, what)
        for n, _ in self.told["law"]:
            self.joint_law(n, came, mid, dt, composed)
        placed = {n[0]: (V(n[1:4]), V(n[4:8])) for n, _ in self.told["placed"]}
        for k in self.to:
            self.moves(self.bodies[k], dt, loads[k], late[k], *placed.get(k, self.bodies[k].state[:2]), self.to[k])

    def push_by_contacts(self, loads):
        self.near = collections.defaultdict(list)  # points of two bodies
        for n, _ in self.told["contact"]:
            self.near[n[0], n[1]].append(V(n[2:5]))
            for k, p, x in ((n[0], V(n[2:5]), V(n[16:22])), (n[1], V(n[5:8]), V(n[16:22]) * -1)):
                loads.get(k, []).append((V(x[:3]), V(x[3:]) + ((p - self.bodies[k].state.x) ^ x)))

    def friction(self, first, second):
        for a, b in ((first, second), (second, first)):
            if (a.material, b.material) in self.pairs:
                along, sideways, *others = self.pairs[a.material, b.material]
                along, sideways = (0, 0) if self.rules[1] == "frictionless" else (along, sideways)
                axis = a.state.q.turn(a.surface[2]) if along != sideways else NONE
                return (along, sideways, axis, self.rules[1] == "maximum_dissipation"), *others
        raise Damaged(f"{first.name} and {second.name} have no pair")

    def contact(self, n, came, free, mid, dt, composed):
        """Its natural residual, m/s, the speeds that it is a part of, and its name; at an instant all motions are one."""
        both, on, normal, gap, bias = n[:2], (V(n[2:5]), V(n[5:8])), V(n[8:11]), n[11], n[12]
        slip, x, moment = V(n[13:16]), V(n[16:19]), V(n[19:22])
        bodies = [self.bodies[k] for k in both]
        what, arms = " on ".join(b.name for b in bodies), [p - b.state.x for p, b in zip(on, bodies)]
        friction, restitution, rolling, torsional = self.friction(*bodies)
        came_w, comes_w, w = ((s[both[0]].v + (s[both[0]].w ^ arms[0])) - (s[both[1]].v + (s[both[1]].w ^ arms[1])) for s in (came, free, mid))
        push, spin, moving = x @ normal, moment @ normal, [(b, r) for b, r in zip(bodies, arms) if b.mass > 0]
        inverse, most = sum(1 / b.mass for b, _ in moving), max(abs(came_w), abs(comes_w))
        self.expect("points of contact", abs(on[0] - on[1]), abs(gap), what, ROUNDING * (1 + abs(on[0])))
        self.expect("unit length", abs(abs(normal) - 1), 1, what)
        self.expect("moments of friction", max(abs(spin) - torsional * push, abs(moment.beside(normal)) - rolling * push), push, what, ROUNDING)
        # A sub-step obeys its laws in its middle, which is this far from its start: bodies turn, their normal does along an edge,
        # and points move in their face, or along a curve: an ellipsoid's radius is at most a^2 / height.
        fast = sum(abs(came[k].v) + abs(mid[k].v) + abs(free[k].v) + abs(mid[k].w) * abs(r) for k, r in zip(both, arms))
        spins, patch = abs(free[both[0]].w - free[both[1]].w), max(abs(p - on[0]) for p in self.near[tuple(both)])
        flat = max((5 * b.trace / b.mass / max(abs(r @ normal), 1e-300) for b, r in moving), default=0.0)
        bends = most * most / max(min((abs(r) for _, r in moving), default=math.inf), 1e-300)
        middle = dt * (sum(abs(came[k].w) + abs(mid[k].w) for k in both) * fast + spins * spins * flat + bends) + spins * patch
        belts = [b.state.q.turn(b.surface[0] + (b.surface[1] ^ b.state.q.back.turn(r))) for b, r in zip(bodies, arms)]
        self.expect("surface speed", abs(slip - (belts[0] - belts[1]).beside(normal)), middle, what, ROUNDING * (1 + fast))
        off = natural_residual(friction, normal, x * inverse, w + slip + normal * bias)
        if self.block[0] == "instant":
            self.expect("contact closed", abs(gap), 1, what)
            return self.expect("law of contact at an instant", off, 1 + fast, what, 1e-6 * abs(x) * inverse)
        self.expect("contact pushes within its cone", max(-push, abs(x.beside(normal)) - max(friction[:2]) * push), abs(x), what,
                    ROUNDING * most / (inverse or math.inf))
        wrong = max(abs(bias - (max(gap, 0.0) / dt if dt > 0 else 0.0)) - middle, 0.0)
        if -(comes_w @ normal) * dt > gap or dt == 0:
            wrong = min(wrong, max(abs(bias) - middle, 0.0), abs(bias - restitution * max(came_w @ normal, comes_w @ normal)))
        self.expect("restitution or gap that closes", 0 if composed else wrong, 1 + fast, what)
        return off, abs(came_w) + abs(comes_w) + abs(slip) + abs(bias) + abs(x) * inverse + abs(self.gravity) * dt, what

    def joint_law(self, n, came, mid, dt, composed):
        """A limit (0), or what is bounded (1) or sprung (2) of a joint: its impulse is in bounds, and there where its speed is not as wanted."""
        law, gap, restitution, rate, bound, stretch, stiffness, damping, x = n[1:10]
        rows = {n[i]: (V(n[i + 1:i + 4]), V(n[i + 4:i + 7])) for i in range(10, len(n), 7)}
        before, speed = (sum(f @ s[k].v + m @ s[k].w for k, (f, m) in rows.items()) for s in (came, mid))
        inverse = sum(f @ f / b.mass + m @ b.spin(b.state.q, m, b.inverse) for b, (f, m) in ((self.bodies[k], row) for k, row in rows.items()) if b.mass)
        low, high = (0.0, math.inf) if law == 0 else (-bound * dt, bound * dt)
        wanted = [min(-gap / dt, 0.0), 0.0, -restitution * before] if law == 0 else [rate]
        there = [x] if composed else [x - (speed - each) / (inverse or 1) for each in wanted]
        if law == 2 and not composed:
            there = [-dt * (stiffness * (stretch + dt * (speed - rate)) + damping * (speed - rate))]
        off = min(abs(x - max(low, min(high, each))) for each in there) * inverse
        self.expect("law of a joint", off, abs(x) * inverse + abs(speed) + abs(before) + abs(rate) + abs(gap) / dt, self.joints[n[0]].name)

    def moves(self, b, dt, loads, lates, x, q, end):
        """Balances of a body over a sub-step; from x and q, where corrections have placed it, to its end."""
        s, (impulse, moment, size, sized), (late, late_moment, late_size, late_sized) = b.state, total(loads), total(lates)
        change, v = end.v - s.v, end.v - late * (1 / b.mass)
        self.expect("balance of momentum", abs(change * b.mass - impulse - late),
                    size + late_size + b.mass * (abs(change) + ROUNDING * (abs(end.v) + abs(s.v))), b.name)
        keeps, corrected, before = self.rules[0] == "momentum" and not b.round, s.q.back.then(q), b.spin(s.q, s.w)
        middle, after = corrected.turn(before + moment), b.spin(end.q if keeps else q, end.w)
        self.expect("balance of angular momentum", abs(after - middle - late_moment), sized + late_sized + abs(after - before) + 1e-8
                    * (abs(after) + abs(before)) + 1e-6 * size * (1 + abs(end.x)), b.name, corrected.apart(STILL.q) * abs(middle) if late_sized else 0)
        # Places: by the velocity that the sub-step ends with, or along the parabola of free fall.
        left = min(end.x - x - v * dt, end.x - x - v * dt + self.gravity * (dt * dt / 2), key=abs)
        self.expect("places move as velocities", abs(left), dt * abs(v), b.name, ROUNDING * (abs(end.x) + dt * abs(v)))
        if keeps:
            there = rotation(sum((each.back.turn(b.spin(each, middle, b.inverse)) for each in (q, end.q)), NONE) * (dt / 2)).then(q)
        else:
            there = q.then(rotation((end.w - b.spin(end.q, late_moment, b.inverse)) * dt))
        self.expect("orientation moves as velocities", there.apart(end.q), dt * abs(end.w), b.name, ROUNDING)
        self.expect("corrections close gaps", abs(x - s.x), sum(abs(n[11]) for n, _ in self.told["contact"]), b.name, 1e-8 * (1 + abs(end.x)))

    def extrapolated(self, _):
        """Twice the two halves less the whole sub-step; a body that no moment acts on keeps the turn of its halves."""
        for k, s in self.to.items():
            half, whole = self.bodies[k].state, self.trial[k]
            x, _, v, w = (a * 2 - b for a, b in zip(half, whole))
            size = abs(half.x - whole.x) + half.q.apart(whole.q) + abs(half.v - whole.v) + abs(half.w - whole.w)
            off = (abs(s.x - x), abs(s.v - v), min(abs(s.w - w), abs(s.w - half.w)),
                   min(half.q.then(whole.q.back).then(half.q).apart(s.q), half.q.apart(s.q)))
            self.expect("extrapolation", max(off), size, self.bodies[k].name, ROUNDING * (1 + abs(half.x)))

    def follows(self, when):
        """Places by the mean of the velocities, over whatever time has passed."""
        for k, s in self.to.items():
            b, h = self.bodies[k], when - self.bodies[k].time
            if b.state:
                self.expect("time goes on", -h, 1 + abs(when), b.name)
                self.expect("places follow velocities", abs(s.x - b.state.x - (s.v + b.state.v) * (h / 2)), abs(s.x) + 0.1, b.name,
                            abs(h) / 4 * abs(s.v - b.state.v))

    def instant(self, when, events):
        """Equations of motion: accelerations by the forces, as the joints allow them, and as the next instants tell."""
        self.follows(when)
        for k, s in self.to.items():
            self.bodies[k].state = s
        loads, _ = self.loads(1)
        self.push_by_contacts(loads)
        states = {k: b.state for k, b in self.bodies.items()}
        for n, _ in self.told["contact"]:
            self.contact(n, states, states, states, 0, False)
        rates, now = {n[0]: (V(n[1:4]), V(n[4:7])) for n, _ in self.told["rate"]}, {}
        for k, s in self.to.items():
            b, (a, alpha), (force, torque, size, sized) = self.bodies[k], rates[k], total(loads[k])
            momentum, spun = b.spin(s.q, s.w), b.spin(s.q, alpha)
            self.expect("equations of motion", abs(force - a * b.mass), size + b.mass * abs(a), b.name)
            self.expect("equations of rotation", abs(spun + (s.w ^ momentum) - torque), sized + abs(s.w ^ momentum) + abs(spun), b.name,
                        ROUNDING * (sum(map(abs, b.rows)) + size))
            now[k] = {"momentum leads on": (s.v, a, 0.1), "angular momentum leads on": (momentum, torque, 0.1 * b.trace),
                      "places lead on": (s.x, s.v, 0.1), "orientation leads on": (s.q, s.w, 0)}
        for joint in self.joints.values():
            joined, of = [rates.get(k, (NONE, NONE)) for k in joint.bodies], [states[k] for k in joint.bodies]
            spins = sum(abs(alpha) + s.w @ s.w for s, (_, alpha) in zip(of, joined))
            for off, size in zip(joint.accelerations(of, joined, when), (sum(abs(a) for a, _ in joined) + spins * joint.arms, spins)):
                self.expect("joints' accelerations", max(map(abs, off), default=0), size, joint.name, 1e-6)
        if self.past and self.past[-1][1] != events:
            self.past.clear()
        self.past.append((when, events, now))
        if len(self.past) == 4:
            self.leads(*(each[0] for each in self.past))

    def leads(self, t0, t1, t2, t3):
        """From the second to the third of four instants, by fourth order; its error is judged by the second."""
        h = t2 - t1
        for k in self.to:
            for law, (y1, f1, tiny) in self.past[1][2][k].items():
                (_, f0, _), _, (y2, f2, _), (_, f3, _) = (each[2][k][law] for each in self.past)
                g1, g2 = (f2 - f0) * (1 / (t2 - t0)), (f3 - f1) * (1 / (t3 - t1))
                way, turns = (f1 + f2) * (h / 2) + (g1 - g2) * (h * h / 12), law == "orientation leads on"
                off = y1.then(rotation(way)).apart(y2) if turns else abs(y2 - y1 - way)
                self.expect(law, off, abs(y1) + abs(y2) + tiny, self.bodies[k].name, h * h / 20 * (abs(g1) + abs(g2)) + h / 5 * abs(f3 - f0 + (f1 - f2) * 3)
                            + (h * h / 6 * abs(f1 ^ f2) if turns else 0))


def main(files):
    worst = 0 if files else print(__doc__) or 2
    for file in files:
        judge = Judge()
        try:
            judge.run(file)
        except (Damaged, OSError, ArithmeticError, LookupError, ValueError, AttributeError, TypeError) as why:
            what = {KeyError: "what it names is not told: ", AttributeError: "a state is missing: ", TypeError: "a state is missing: "}.get(
                type(why), "numbers that are none, or beyond bounds: ")
            print(f"{file}: cannot be judged: {why if isinstance(why, (Damaged, OSError)) else f'block of line {judge.line}: {what}{why}'}")
            worst = 2
            continue
        for fault in judge.faults[:10]:
            print(f"{file}: {fault}")
        print(f"{file}: {f'{len(judge.faults)} laws broken' if judge.faults else 'holds'}, {sum(judge.judged.values())} judgements")
        worst = max(worst, 1 if judge.faults else 0)
    return worst


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
