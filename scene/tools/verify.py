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
    0: "contact problems solved, fixed bodies rest",
    1e-9: "unit length, time goes on, weight, reaction, restitution or gap that closes",
    1e-6: "motion goes on, balance of momentum, balance of angular momentum, places move as velocities, orientation moves as velocities, "
          "extrapolation, joints hold, joints' velocities, moment of reaction, reaction of the joint's kind, law of contact, "
          "contact pushes within its cone, moments of friction, work of what comes to rest",
    1e-5: "equations of motion, equations of rotation, places follow velocities, momentum leads on, angular momentum leads on, "
          "places lead on, orientation leads on",
    1e-4: "residual as claimed, joints' accelerations, law of a joint, contact closed, law of contact at an instant",
    1e-3: "comes to rest", 1e-2: "residual of contact problems", 1: "surface speed", 1 + 1e-6: "points of contact",
    10: "corrections close gaps"}.items() for law in laws.split(", ")}
# The words of lines, and the names of their numbers with how many there are; `text` is the rest of a line, `more` its further numbers.
HEADS, INSIDE, BLOCKS = ({word: (collections.namedtuple(word, [each.partition(":")[0] for each in names]), [int(each.partition(":")[2] or 1)
                                for each in names if each not in ("text", "more")], names[-1])
                          for word, *names in map(str.split, lines.splitlines())} for lines in (
    "body k mass inertia:6 material text\nsurface k velocity:3 spin:3 axis:3\npair first second rules:5\ngravity g:3\nengine text\n"
    "joint k bodies:2 point:3 frame:4 point_2:3 frame_2:4 length role motion:4 text\ncoupled k joint more\nstep k start end residual solved\nend lines",
    "to k x:3 q:4 v:3 w:3\npush k force:3 moment:3 text\npull joint late force:3 moment:3 force_2:3 moment_2:3\nplaced k x:3 q:4\nrate k a:3 alpha:3\n"
    "contact bodies:2 on:3 on_2:3 n:3 gap bias slip:3 x:3 moment:3\nlaw joint kind gap restitution rate bound stretch stiffness damping x more",
    "part start dt composed residual\ntrial start dt composed residual\nextrapolated start\nstart start\ninstant start events\narrives start"))
LINES = {**HEADS, **INSIDE, **BLOCKS}
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
    size, onto = abs(z.tail), max(0.0, (z[0] + abs(z.tail)) / 2)
    p = V((onto, *z.tail * (onto / (size or 1)))) if size > z[0] else z
    return max(abs(x - p), 0 if along or sideways else abs(y.beside(n)))


def read(file):
    """Its lines as records, with their numbers; Damaged where it is none, or not whole."""
    word = ""
    with open(file, encoding="utf-8", errors="replace") as lines:
        for number, line in enumerate(iter(lambda: lines.readline(LONGEST), ""), 1):
            last, (word, _, rest) = word, line[:-1].partition(" ")
            if not line.endswith("\n") or last == "end":
                raise Damaged(f"line {number} is cut, longer than any, or behind the end")
            if number == 1 and line == "tether certificate 1\n":
                continue
            if number == 1 or word not in LINES:
                raise Damaged(f"line {number}: {word[:20]!r} is no word of a certificate of this format")
            make, sizes, last_name = LINES[word]
            least, fields = sum(sizes), rest.split(" ", sum(sizes) if last_name == "text" else -1)
            text = [fields.pop() if len(fields) > least else ""] if last_name == "text" else []
            n = [float(each) for each in fields]
            finite = all(math.isfinite(x) or k == 5 and x == math.inf and word == "law" for k, x in enumerate(n))
            if not finite or len(n) < least or len(n) > least and last_name != "more" or word == "end" and n != [number - 1]:
                raise Damaged(f"line {number}: {word} has {least} finite numbers; that of the end is of the lines before")
            given = iter(n)
            values = [next(given) if size == 1 else V(next(given) for _ in range(size)) for size in sizes]
            yield number, make(*values, *([list(given)] if last_name == "more" else text))
    if word != "end":
        raise Damaged("its end is missing: it was cut")


class Body:
    def __init__(self, told):
        (xx, yy, zz, yz, xz, xy), self.mass, self.material, self.name = told.inertia, told.mass, told.material, told.text
        self.rows, self.trace = (V((xx, xy, xz)), V((xy, yy, yz)), V((xz, yz, zz))), xx + yy + zz
        a, b, c = self.rows
        self.round = max(abs(row - e * xx) for row, e in zip(self.rows, (X, Y, Z))) <= 1e-13 * xx
        self.inverse = [e * (1 / (a @ (b ^ c))) for e in (b ^ c, c ^ a, a ^ b)] if self.mass else None
        self.state, self.time, self.surface, self.surface_spin, self.axis = None, 0.0, NONE, NONE, NONE
        if self.mass < 0:
            raise Damaged(f"the mass of {self.name} is negative")

    def spin(self, q, w, rows=None):
        """Angular momentum, world axes; of it, with the inverse rows, the angular velocity."""
        u = q.back.turn(w)
        return q.turn(V([row @ u for row in rows or self.rows]))

    def struck(self, loads):
        impulse, moment, _, _ = total(loads)
        return self.state._replace(v=self.state.v + impulse * (1 / self.mass), w=self.state.w + self.spin(self.state.q, moment, self.inverse))


def total(loads):
    """Impulse and moment about the centre, or force and torque, and the sums of their sizes."""
    return sum((f for f, _ in loads), NONE), sum((m for _, m in loads), NONE), sum(abs(f) for f, _ in loads), sum(abs(m) for _, m in loads)


class Joint:
    # Directions of the second body's frame in which points, and turns, are held. d: from point to point; u: across both axes.
    HELD = {"ball": ("xyz", ""), "hinge": ("xyz", "xy"), "slider": ("xy", "xyz"), "fixed": ("xyz", "xyz"), "planar": ("z", "xy"),
            "universal": ("xyz", "u"), "distance": ("d", "")}

    def __init__(self, told):
        self.kind, _, self.name = told.text.partition(" ")
        self.told, self.bodies, self.arms, self.driven, self.has_laws = told, told.bodies, abs(told.point) + abs(told.point_2), told.role == 1, told.role == 2
        held, turns = self.HELD[self.kind]
        self.held, self.turns = held + "z" * (self.driven and self.kind == "slider"), turns + "z" * (self.driven and self.kind == "hinge")

    def place(self, a, b):
        """The point on the first body, its way from that on the second, the turn, the directions held of points and of turns, the axis."""
        one, two, p = self.told.frame.then(a.q), self.told.frame_2.then(b.q), a.x + a.q.turn(self.told.point)
        d = p - b.x - b.q.turn(self.told.point_2)
        axes = {"x": two.turn(X), "y": two.turn(Y), "z": two.turn(Z), "d": d.unit, "u": one.turn(Z) ^ two.turn(X)}
        return p, d, one.then(two.back), [axes[k] for k in self.held], [axes[k] for k in self.turns], axes["z"]

    def errors(self, a, b, t):
        """How far places (m, rad) are off, and speeds of points and of turns."""
        p, d, q, held, turns, _ = self.place(a, b)
        u = a.v + (a.w ^ (p - a.x)) - b.v - (b.w ^ (p - b.x))
        off, slips, spins = [k @ d for k in held], [k @ u for k in held], [k @ (a.w - b.w) for k in turns]
        if self.kind == "distance":
            off[0] -= self.told.length
        if self.driven:
            rate, amplitude, frequency, phase = self.told.motion
            w = 2 * math.pi * frequency
            s, fast = rate * t + amplitude * (math.sin(w * t + phase) - math.sin(phase)), rate + amplitude * w * math.cos(w * t + phase)
            if self.kind == "hinge":
                q, spins[-1] = q.then(rotation(Z * -s)), spins[-1] - fast
            else:
                off[-1], slips[-1] = off[-1] - s, slips[-1] - fast
        tilt = q.turn(Z)
        return off + {"": [], "u": [tilt[0]], "xy": list(tilt[:2]), "xyz": list(q.tail * 2)}[self.turns], slips, spins

    def accelerations(self, states, rates, t):
        """How fast the errors of speeds grow, of points and of turns: by differences over a short time."""
        h = 1e-3 / (1 + max(abs(s.w) for s in states) + 2 * math.pi * abs(self.told.motion[2]))
        after = lambda k: self.errors(*(s._replace(x=s.x + s.v * k, q=s.q.then(rotation(s.w * k)), v=s.v + a * k, w=s.w + alpha * k)
                                        for s, (a, alpha) in zip(states, rates)), t + k)[1:]
        return [max((abs(x - y) / (2 * h) for x, y in zip(*each)), default=0) for each in zip(after(h), after(-h))]


class Judge:
    def __init__(self):
        self.bodies, self.pairs, self.joints, self.reacts, self.gravity = {-1: Body(HEADS["body"][0](-1, 0, V([0] * 6), -1, "the world"))}, {}, {}, {}, NONE
        self.bodies[-1].state = INSIDE["to"][0](-1, NONE, V((1, 0, 0, 0)), NONE, NONE)
        self.faults, self.judged, self.step, self.when, self.line, self.claimed = [], 0, 0, 0.0, 0, 0.0
        self.until = self.block = self.before = self.trial = None
        self.told, self.past, self.moved = collections.defaultdict(list), collections.deque(maxlen=4), False

    def run(self, file):
        for line, told in read(file):
            word = type(told).__name__
            if word in INSIDE:
                if word != "to" and not self.block or hasattr(told, "k") and told.k not in self.bodies:
                    raise Damaged(f"line {line}: {word} is of no part or of no body")
                self.told[word].append(told)
                continue
            self.finish()
            self.line = line
            if word in BLOCKS:
                self.block, self.when = told, told.start
            else:
                self.head(word, told)
        if not self.moved:
            raise Damaged("nothing moves in it")
        return self

    def expect(self, law, off, size=1.0, what="step", slack=0.0):
        bound = LAWS[law] * size + slack
        self.judged += 1
        if not off <= bound < math.inf:
            self.faults.append(f"step {self.step:g}, t = {self.when:g} s: {what}: {law}: {off:.3g}, at most {bound:.3g}")

    def head(self, word, told):
        if word == "body":
            if told.k in self.bodies:
                raise Damaged(f"body {told.k:g} is told twice")
            self.bodies[told.k] = Body(told)
        elif word == "surface":
            b = self.bodies[told.k]
            b.surface, b.surface_spin, b.axis = told[1:]
        elif word == "pair":
            self.pairs[told.first, told.second] = told.rules
        elif word == "gravity":
            self.gravity = told.g
        elif word == "engine":
            self.rules, self.joints, self.reacts = (told.text + "  ").split(" ")[1:3], {}, {}
            self.past.clear()
        elif word == "joint":
            self.joints[told.k] = self.reacts[told.k] = Joint(told)
        elif word == "coupled":
            self.reacts[len(self.reacts)] = self.joints[told.joint]
            self.joints[told.joint].has_laws = True
        if word in ("step", "end") and self.until is not None:  # all bodies have reached the end of the step, where the next one begins
            starts = [b.time for b in self.bodies.values() if b.mass > 0] + ([told.start] if word == "step" else [])
            self.expect("time goes on", max(abs(t - self.until) for t in starts), 1 + abs(self.until))
        if word == "step":
            self.step, self.until, self.claimed = told.k, told.end, told.residual
            self.expect("contact problems solved", abs(told.solved - 1))
            self.expect("residual of contact problems", abs(told.residual))

    def finish(self):
        """Judges the block that has been read; outside of blocks places of fixed bodies are told."""
        block, word, self.to = self.block, type(self.block).__name__, {s.k: s for s in self.told["to"]}
        if any((self.bodies[k].mass > 0) != bool(block) for k in self.to):
            raise Damaged("a fixed body moves, or one that moves is told outside of parts")
        if word == "trial" and self.before is None:
            self.before = {k: (b.state, b.time) for k, b in self.bodies.items()}
        if word == "part" and self.before is not None:
            self.trial = {k: b.state for k, b in self.bodies.items()}
            for k, b in self.bodies.items():
                b.state, b.time = self.before[k]
            self.before = None
        judge = {"part": self.part, "trial": self.part, "extrapolated": self.extrapolated, "instant": self.instant, "arrives": self.follows}.get(word)
        if judge:
            judge(block)
        for k, s in self.to.items():
            b = self.bodies[k]
            self.expect("fixed bodies rest", 0 if block else abs(s.v) + abs(s.w), 1, b.name)
            self.expect("motion goes on", max(abs(x - y) for x, y in zip(s[1:], b.state[1:])) if word == "start" and b.state else 0, 1, b.name)
            self.expect("unit length", abs(abs(s.q) - 1), 1, b.name)
            b.state, b.time = s, block.start + getattr(block, "dt", 0) if block else 0.0
        for joint in self.joints.values():
            if self.to.keys() & set(joint.bodies):
                states = [self.bodies[k].state for k in joint.bodies]
                arm = 1 + joint.arms + max(abs(s.x) for s in states)
                off, slips, spins = joint.errors(*states, max(self.bodies[k].time for k in joint.bodies))
                self.expect("joints hold", max(map(abs, off)), arm, joint.name)
                self.expect("joints' velocities", max(map(abs, slips + spins)), (1 + max(abs(s.v) + abs(s.w) * arm for s in states)) * arm, joint.name)
        self.moved, self.block = self.moved or bool(block and self.to), None
        self.told.clear()

    def loads(self, dt):
        """What acts on bodies but for contacts: impulses, of an instant (dt 1) forces; and what joints do along rows of the end."""
        now, late, weights, power, size = {k: [] for k in self.to}, {k: [] for k in self.to}, collections.defaultdict(lambda: NONE), 0.0, 0.0
        for p in self.told["push"]:
            b, s = self.bodies[p.k], self.to[p.k]
            now[p.k].append((p.force, p.moment))
            if dt == 0:  # an impact has no forces: these stop what moves too slowly to count, and do no work on what is left
                stopped = abs(p.force) / b.mass + abs(b.spin(s.q, p.moment, b.inverse)) * math.sqrt(b.trace / b.mass)
                self.expect("comes to rest", stopped, 1, b.name)
                power += p.force @ s.v + p.moment @ s.w
                size += abs(p.force) * (abs(s.v) + abs(b.state.v)) + abs(p.moment) * (abs(s.w) + abs(b.state.w))
            if p.text == "gravity":
                weights[p.k] += p.force
        belts = any(any(b.surface + b.surface_spin) for b in self.bodies.values())
        self.expect("work of what comes to rest", 0 if belts else abs(power), size, "impact")
        for k in self.to:
            weight = self.gravity * self.bodies[k].mass
            self.expect("weight", abs(weights[k] - weight * dt), abs(weight) * dt, self.bodies[k].name, TIMES * (1 + abs(self.when)) * abs(weight))
        for p in self.told["pull"]:
            joint, wrenches = self.reacts[p.joint], ((p.force, p.moment), (p.force_2, p.moment_2))
            states = [self.to.get(k, self.bodies[k].state) if p.late else self.bodies[k].state for k in joint.bodies]
            for k, wrench in zip(joint.bodies, wrenches):
                (late if p.late else now).get(k, []).append(wrench)
            self.reaction(joint, p.joint not in self.joints, states, wrenches)
        for law in self.told["law"]:
            for k, (force, moment) in rows_of(law).items():
                now.get(k, []).append((force * law.x, moment * law.x))
        return now, late

    def reaction(self, joint, couples, states, wrenches):
        """It is opposite on both bodies, and along directions that the joint holds, drives or has laws of."""
        p, _, _, held, turns, z = joint.place(*states)
        if couples:
            held, turns = [], []
        if couples or joint.has_laws and not getattr(self.block, "dt", 0):
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

    def part(self, part):
        """A sub-step, or an impact (dt 0): momenta change by the impulses, and contacts and joints obey their laws."""
        for k in self.to:
            self.expect("time goes on", abs(self.bodies[k].time - part.start), 1 + abs(part.start), self.bodies[k].name)
        came = {k: b.state for k, b in self.bodies.items()}
        loads, late = self.loads(part.dt)
        free = {**came, **{k: self.bodies[k].struck(loads[k]) for k in loads}}
        self.push_by_contacts(loads)
        mid = {**came, **{k: self.bodies[k].struck(loads[k]) for k in loads}}
        found = [self.contact(c, came, free, mid, part.dt, part.composed) for c in self.told["contact"]] or [(0.0, 0.0, "contacts")]
        (worst, _, what), speed = max(found, key=lambda each: each[0]), max(each[1] for each in found)
        self.expect("residual as claimed", abs(part.residual - worst), worst, what, ROUNDING * speed)
        self.expect("law of contact", 0 if part.composed else worst, max(1, 1e8 * self.claimed) * speed, what)
        for law in self.told["law"]:
            self.joint_law(law, came, mid, part)
        placed = {s.k: s for s in self.told["placed"]}
        for k in self.to:
            self.moves(self.bodies[k], part.dt, loads[k], late[k], placed.get(k, self.bodies[k].state), self.to[k])

    def push_by_contacts(self, loads):
        self.near = collections.defaultdict(list)  # points of two bodies
        for c in self.told["contact"]:
            self.near[c.bodies].append(c.on)
            for k, p, sign in zip(c.bodies, (c.on, c.on_2), (1, -1)):
                loads.get(k, []).append((c.x * sign, (c.moment + ((p - self.bodies[k].state.x) ^ c.x)) * sign))

    def friction(self, first, second):
        for a, b in ((first, second), (second, first)):
            if (a.material, b.material) in self.pairs:
                along, sideways, *others = self.pairs[a.material, b.material]
                along, sideways = (0, 0) if self.rules[1] == "frictionless" else (along, sideways)
                axis = a.state.q.turn(a.axis) if along != sideways else NONE
                return (along, sideways, axis, self.rules[1] == "maximum_dissipation"), *others
        raise Damaged(f"{first.name} and {second.name} have no pair")

    def contact(self, c, came, free, mid, dt, composed):
        """Its natural residual, m/s, the speeds that it is a part of, and its name; at an instant all motions are one."""
        both, n, x = c.bodies, c.n, c.x
        bodies = [self.bodies[k] for k in both]
        what, arms = " on ".join(b.name for b in bodies), [p - b.state.x for p, b in zip((c.on, c.on_2), bodies)]
        friction, restitution, rolling, torsional = self.friction(*bodies)
        came_w, comes_w, w = ((s[both[0]].v + (s[both[0]].w ^ arms[0])) - (s[both[1]].v + (s[both[1]].w ^ arms[1])) for s in (came, free, mid))
        push, spin, moving = x @ n, c.moment @ n, [(b, r) for b, r in zip(bodies, arms) if b.mass > 0]
        inverse, most = sum(1 / b.mass for b, _ in moving), max(abs(came_w), abs(comes_w))
        self.expect("points of contact", abs(c.on - c.on_2), abs(c.gap), what, ROUNDING * (1 + abs(c.on)))
        self.expect("unit length", abs(abs(n) - 1), 1, what)
        self.expect("moments of friction", max(abs(spin) - torsional * push, abs(c.moment.beside(n)) - rolling * push), push, what, ROUNDING)
        # A sub-step obeys its laws in its middle, which is this far from its start: bodies turn, their normal does along an edge,
        # and points move in their face, or along a curve: an ellipsoid's radius is at most a^2 / height.
        fast = sum(abs(came[k].v) + abs(mid[k].v) + abs(free[k].v) + abs(mid[k].w) * abs(r) for k, r in zip(both, arms))
        spins, patch = abs(free[both[0]].w - free[both[1]].w), max(abs(p - c.on) for p in self.near[both])
        flat = max((5 * b.trace / b.mass / max(abs(r @ n), 1e-300) for b, r in moving), default=0.0)
        bends = most * most / max(min((abs(r) for _, r in moving), default=math.inf), 1e-300)
        middle = dt * (sum(abs(came[k].w) + abs(mid[k].w) for k in both) * fast + spins * spins * flat + bends) + spins * patch
        belts = [b.state.q.turn(b.surface + (b.surface_spin ^ b.state.q.back.turn(r))) for b, r in zip(bodies, arms)]
        self.expect("surface speed", abs(c.slip - (belts[0] - belts[1]).beside(n)), middle, what, ROUNDING * (1 + fast))
        off = natural_residual(friction, n, x * inverse, w + c.slip + n * c.bias)
        if type(self.block).__name__ == "instant":
            self.expect("contact closed", abs(c.gap), 1, what)
            return self.expect("law of contact at an instant", off, 1 + fast, what, 1e-6 * abs(x) * inverse)
        self.expect("contact pushes within its cone", max(-push, abs(x.beside(n)) - max(friction[:2]) * push), abs(x), what,
                    ROUNDING * most / (inverse or math.inf))
        wrong = max(abs(c.bias - (max(c.gap, 0.0) / dt if dt > 0 else 0.0)) - middle, 0.0)
        if -(comes_w @ n) * dt > c.gap or dt == 0:
            wrong = min(wrong, max(abs(c.bias) - middle, 0.0), abs(c.bias - restitution * max(came_w @ n, comes_w @ n)))
        self.expect("restitution or gap that closes", 0 if composed else wrong, 1 + fast, what)
        return off, abs(came_w) + abs(comes_w) + abs(c.slip) + abs(c.bias) + abs(x) * inverse + abs(self.gravity) * dt, what

    def joint_law(self, law, came, mid, part):
        """A limit (0), or what is bounded (1) or sprung (2) of a joint: its impulse is in bounds, and there where its speed is not as wanted."""
        rows, dt, x, rate = rows_of(law), part.dt, law.x, law.rate
        before, speed = (sum(f @ s[k].v + m @ s[k].w for k, (f, m) in rows.items()) for s in (came, mid))
        inverse = sum(f @ f / b.mass + m @ b.spin(b.state.q, m, b.inverse) for b, (f, m) in ((self.bodies[k], row) for k, row in rows.items()) if b.mass)
        low, high = (0.0, math.inf) if law.kind == 0 else (-law.bound * dt, law.bound * dt)
        wanted = [min(-law.gap / dt, 0.0), 0.0, -law.restitution * before] if law.kind == 0 else [rate]
        there = [x] if part.composed else [x - (speed - each) / (inverse or 1) for each in wanted]
        if law.kind == 2 and not part.composed:
            there = [-dt * (law.stiffness * (law.stretch + dt * (speed - rate)) + law.damping * (speed - rate))]
        off = min(abs(x - max(low, min(high, each))) for each in there) * inverse
        self.expect("law of a joint", off, abs(x) * inverse + abs(speed) + abs(before) + abs(rate) + abs(law.gap) / dt, self.joints[law.joint].name)

    def moves(self, b, dt, loads, lates, placed, end):
        """Balances of a body over a sub-step, from where corrections have placed it."""
        s, (impulse, moment, size, sized), (late, late_moment, late_size, late_sized) = b.state, total(loads), total(lates)
        change, v, q = end.v - s.v, end.v - late * (1 / b.mass), placed.q
        self.expect("balance of momentum", abs(change * b.mass - impulse - late),
                    size + late_size + b.mass * (abs(change) + ROUNDING * (abs(end.v) + abs(s.v))), b.name)
        keeps, corrected, before = self.rules[0] == "momentum" and not b.round, s.q.back.then(q), b.spin(s.q, s.w)
        middle, after = corrected.turn(before + moment), b.spin(end.q if keeps else q, end.w)
        turned = corrected.apart(self.bodies[-1].state.q) * abs(middle) if late_sized else 0
        self.expect("balance of angular momentum", abs(after - middle - late_moment), sized + late_sized + abs(after - before)
                    + 1e-8 * (abs(after) + abs(before)) + 1e-6 * size * (1 + abs(end.x)), b.name, turned)
        # Places: by the velocity that the sub-step ends with, or along the parabola of free fall.
        left = end.x - placed.x - v * dt
        left = min(left, left + self.gravity * (dt * dt / 2), key=abs)
        self.expect("places move as velocities", abs(left), dt * abs(v), b.name, ROUNDING * (abs(end.x) + dt * abs(v)))
        if keeps:
            there = rotation(sum((each.back.turn(b.spin(each, middle, b.inverse)) for each in (q, end.q)), NONE) * (dt / 2)).then(q)
        else:
            there = q.then(rotation((end.w - b.spin(end.q, late_moment, b.inverse)) * dt))
        self.expect("orientation moves as velocities", there.apart(end.q), dt * abs(end.w), b.name, ROUNDING)
        self.expect("corrections close gaps", abs(placed.x - s.x), sum(abs(c.gap) for c in self.told["contact"]), b.name, 1e-8 * (1 + abs(end.x)))

    def extrapolated(self, _):
        """Twice the two halves less the whole sub-step; a body that no moment acts on keeps the turn of its halves."""
        for k, s in self.to.items():
            half, whole = self.bodies[k].state, self.trial[k]
            size = abs(half.x - whole.x) + half.q.apart(whole.q) + abs(half.v - whole.v) + abs(half.w - whole.w)
            off = (abs(s.x - half.x * 2 + whole.x), abs(s.v - half.v * 2 + whole.v), min(abs(s.w - half.w * 2 + whole.w), abs(s.w - half.w)),
                   min(half.q.then(whole.q.back).then(half.q).apart(s.q), half.q.apart(s.q)))
            self.expect("extrapolation", max(off), size, self.bodies[k].name, ROUNDING * (1 + abs(half.x)))

    def follows(self, block):
        """Places by the mean of the velocities, over whatever time has passed."""
        for k, s in self.to.items():
            b, h = self.bodies[k], block.start - self.bodies[k].time
            if b.state:
                self.expect("time goes on", -h, 1 + abs(block.start), b.name)
                self.expect("places follow velocities", abs(s.x - b.state.x - (s.v + b.state.v) * (h / 2)), abs(s.x) + 0.1, b.name,
                            abs(h) / 4 * abs(s.v - b.state.v))

    def instant(self, block):
        """Equations of motion: accelerations by the forces, as the joints allow them, and as the next instants tell."""
        self.follows(block)
        for k, s in self.to.items():
            self.bodies[k].state = s
        loads, _ = self.loads(1)
        self.push_by_contacts(loads)
        states = {k: b.state for k, b in self.bodies.items()}
        for c in self.told["contact"]:
            self.contact(c, states, states, states, 0, False)
        rates, now = {r.k: r[1:] for r in self.told["rate"]}, {}
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
            for off, size in zip(joint.accelerations(of, joined, block.start), (sum(abs(a) for a, _ in joined) + spins * joint.arms, spins)):
                self.expect("joints' accelerations", off, size, joint.name, 1e-6)
        if self.past and self.past[-1][1] != block.events:
            self.past.clear()
        self.past.append((block.start, block.events, now))
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


def rows_of(law):
    """Force and moment on each body for an impulse of 1."""
    return {law.more[i]: (V(law.more[i + 1:i + 4]), V(law.more[i + 4:i + 7])) for i in range(0, len(law.more), 7)}


def main(files):
    worst = 0 if files else print(__doc__) or 2
    for file in files:
        judge = Judge()
        try:
            judge.run(file)
        except (Damaged, OSError, ArithmeticError, LookupError, ValueError, AttributeError, TypeError) as why:
            told = why if isinstance(why, (Damaged, OSError)) else f"block of line {judge.line}: a part is missing, or beyond numbers: {why}"
            print(f"{file}: cannot be judged: {told}")
            worst = 2
            continue
        print(*(f"{file}: {each}" for each in judge.faults[:10]), sep="\n", end="\n" if judge.faults else "")
        print(f"{file}: {f'{len(judge.faults)} laws broken' if judge.faults else 'holds'}, {judge.judged} judgements")
        worst = max(worst, 1 if judge.faults else 0)
    return worst


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
