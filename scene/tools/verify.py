#!/usr/bin/env python3
"""Judges the certificate of a run by the laws of mechanics, without Tether's code. SPDX-License-Identifier: BSD-3-Clause

    python3 scene/tools/verify.py FILE.cert...     # written by: tether run SCENE.toml --certificate FILE.cert

docs/certificate.md explains the laws and the lines of a certificate.
Exit code: 0 every law holds, 1 one is broken, 2 a file cannot be judged."""
import collections
import itertools
import math
import operator
import sys

HEADS = "body", "pair", "engine", "row", "step", "reached", "part", "instant", "end"  # other lines belong to the last of these
ROUNDING, AT_REST = 1e-9, 1e-15  # of places and speeds; m/s, rad/s


class V(tuple):
    """A vector, or a quaternion w x y z."""
    __add__ = lambda a, b: V(map(operator.add, a, b))
    __sub__ = lambda a, b: V(map(operator.sub, a, b))
    __mul__ = lambda a, factor: V([x * factor for x in a])
    __matmul__ = lambda a, b: sum(map(operator.mul, a, b))
    __xor__ = lambda a, b: V((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))
    __abs__ = lambda a: math.hypot(*a)
    tail = property(lambda q: V(q[1:]))
    back = property(lambda q: V((q[0], -q[1], -q[2], -q[3])))
    unit = property(lambda a: a * (1 / (abs(a) or 1)))
    beside = lambda a, n: a - n * (a @ n)  # n: unit
    across = lambda n: min(map(V, ((1, 0, 0), (0, 1, 0), (0, 0, 1))), key=lambda e: abs(e @ n)).beside(n).unit
    turn = lambda q, v: v + (q.tail ^ v) * (2 * q[0]) + (q.tail ^ (q.tail ^ v)) * 2
    then = lambda q, p: V((p[0] * q[0] - p.tail @ q.tail, *q.tail * p[0] + p.tail * q[0] + (p.tail ^ q.tail)))  # q, then p
    apart = lambda p, q: 2 * min(abs(p - q), abs(p + q))  # rad


NONE = V((0, 0, 0))


class State(collections.namedtuple("State", "x q v w time a alpha", defaults=(0, NONE, NONE))):
    """Of a body, in world axes; a, alpha of an instant."""
    power = lambda s, load: load.force @ s.v + load.moment @ s.w  # of a force and a moment


def rotation(v):
    """The quaternion of a turn by |v| rad about v."""
    angle = min(abs(v), 1e300)
    return V((math.cos(angle / 2), *v * (math.sin(angle / 2) / angle if angle > 0 else 0.5)))


def read(file):
    """Heads, each with its word and the lines below it, by word. The form of a word names its numbers, `x:3` three of them."""
    forms, head = {}, ("", None, None)
    with open(file, encoding="utf-8", errors="replace") as lines:
        for number, line in enumerate(iter(lambda: lines.readline(1 << 16), ""), 1):
            word, _, rest = line[:-1].partition(" ")
            if not line.endswith("\n") or head[0] == "end" or (number == 1) != (line == "tether certificate 1\n"):
                raise ValueError(f"line {number} is cut, longer than any, behind the end, or no certificate of format 1")
            if word == "form":
                name, *fields = rest.split(" ")
                names, sizes = zip(*((each, int(n or each != "text")) for each, _, n in (field.partition(":") for field in fields)))
                forms[name] = collections.namedtuple(name, names), sizes
            elif number > 1:
                make, sizes = forms[word]
                *numbers, text = rest.split(" ", sum(sizes)) if 0 in sizes else (*rest.split(" "), "")
                numbers = list(map(float, numbers))
                if len(numbers) != sum(sizes) or not all(map(math.isfinite, numbers)) or word == "end" and numbers != [number - 1]:
                    raise ValueError(f"line {number}: {word} has {sum(sizes)} finite numbers; an end, that of the lines before it")
                given = iter(numbers)
                told = make(*(V(itertools.islice(given, n)) if n > 1 else next(given) if n else text for n in sizes))
                if word in HEADS:
                    if number > len(forms) + 2:
                        yield head
                    head = word, told, collections.defaultdict(list)
                else:
                    head[2][(word, told.law) if word == "on" else word].append(told)
    if head[0] != "end":
        raise ValueError("its end is missing: it was cut")
    yield head


class Body:
    """What a body is; mass 0: it is fixed, and nothing moves it."""

    def __init__(self, told):
        vars(self).update(told._asdict())
        a, b, c = self.rows = told.ix, told.iy, told.iz
        self.light, volume = (1 / told.mass, a @ (b ^ c)) if told.mass else (0.0, math.inf)
        if not told.mass >= 0 or not volume > 0:
            raise ValueError(f"{told.text} has no mass or inertia that moves")
        self.inverse = [each * (1 / volume) for each in (b ^ c, c ^ a, a ^ b)]
        self.radius = math.sqrt((a[0] + b[1] + c[2]) * self.light)

    def spin(self, q, w, rows=None):
        """Angular momentum, world axes; of it, with the inverse rows, the angular velocity."""
        u = q.back.turn(w)
        return q.turn(V([row @ u for row in rows or self.rows]))

    def struck(self, s, load):
        return s._replace(v=s.v + load[0] * self.light, w=s.w + self.spin(s.q, load[1], self.inverse))


def row_of(told, a, b, time):
    """How far a row of a joint is off, m or rad; the force, or the moment, on its first body for an impulse of 1, and where it acts."""
    kind = told.text.partition(" ")[0]
    rate, amplitude, frequency, phase = told.motion
    way = rate * time + amplitude * (math.sin(2 * math.pi * frequency * time + phase) - math.sin(phase))
    u, axis = a.q.turn(told.on), told.axis if kind == "point" else b.q.turn(told.axis)
    if kind == "angle":  # between a direction of the first body and one of the second, which a motion turns about the axis
        v = b.q.turn(rotation(told.axis * way).turn(told.on_2))
        return u @ v, NONE, u ^ v, a.x
    d = a.x + u - b.x - b.q.turn(told.on_2)
    if kind == "distance":
        return abs(d) - told.length - way, d * (1 / told.length), NONE, a.x + u
    if kind in ("way", "turn"):  # free but for laws of the joint
        return 0.0, *((axis, NONE) if kind == "way" else (NONE, axis)), a.x + u
    return axis @ d - way, axis, NONE, a.x + u


def natural_residual(along, across, axis, associated, n, y, w):
    """|x - P(x - v)|, P the projection onto the friction cone: how far an impulse over the mass, y, and a velocity w are off
    Coulomb's law, m/s (De Saxce and Feng 1998). Tangents are along the axis and across it, in units of their coefficients."""
    t = (axis.beside(n) if abs(axis.beside(n)) > 0 else n.across()).unit
    b = n ^ t
    x = V((n @ y, t @ y / (along or math.inf), b @ y / (across or math.inf)))
    v = V((n @ w, along * (t @ w), across * (b @ w)))
    z = x - v - V((0 if associated else abs(v.tail), 0, 0))
    size = abs(z.tail)
    onto = max(0.0, (z[0] + size) / 2)
    p = V((onto, *z.tail * (onto / (size or 1)))) if size > z[0] else z
    return max(abs(x - p), 0 if along or across else abs(y.beside(n)))


class Judge:
    def __init__(self):
        self.bodies, self.states, self.pairs, self.rows, self.past = {}, {}, {}, {}, collections.deque(maxlen=4)
        self.faults, self.judged, self.engine, self.step, self.when, self.dt = [], 0, None, None, 0.0, 0.0
        self.to, self.told = {}, {}  # states that the block leads to, and its lines by word

    def run(self, file):
        for word, head, self.told in read(file):
            if word in ("step", "engine", "end") and self.step:  # the one before is over: all bodies have come to its end
                for k, s in self.states.items():
                    self.expect("time goes on", 1e-9, abs(s.time - self.step.end) if self.bodies[k].mass else 0.0, 1 + abs(s.time))
                self.joints_hold(self.step.end)
            if word == "body":
                self.bodies[head.k] = Body(head)
                if head.mass == 0:
                    self.states[head.k] = State(head.x, head.q, NONE, NONE)
            elif word == "pair":
                self.pairs[head.first, head.second] = self.pairs[head.second, head.first] = head
            elif word == "engine":
                self.engine, self.rows, self.step = head, {}, None
                self.past.clear()
            elif word == "row":
                self.rows[head.k] = head
            elif word == "step":
                self.step = head
                self.expect("contact problems solved", 1e-2, max(abs(head.residual), abs(head.solved - 1)))
            elif word != "end":
                self.block(word, head)
        if not self.to:
            raise ValueError("nothing moves in it")

    def expect(self, law, part, off, size=1.0, what="step", slack=0.0):
        """A law may be off by this part of the times, places, speeds, impulses or forces that it is about, and by round-off."""
        self.judged += 1
        if not off <= part * size + slack < math.inf:
            step = f"step {self.step.k:g}, " if self.step else ""
            self.faults.append(f"{step}t = {self.when:g} s: {what}: {law}: {off:.3g}, at most {part * size + slack:.3g}")

    def block(self, word, head):
        """A sub-step, an instant, or where bodies have come without either."""
        self.when, dt, is_part = head.start, getattr(head, "dt", 0), word == "part"
        rates = {r.k: (r.a, r.alpha) for r in self.told["rate"]}
        self.to = {s.k: State(*s[1:], self.when + dt, *rates.get(s.k, ())) for s in self.told["to"]}
        for k, s in self.to.items():
            b, since = self.bodies[k], head.start - self.states[k].time if is_part or k in self.states else 0.0
            self.expect("unit length", 1e-9, abs(abs(s.q) - 1), 1, b.text)
            self.expect("time goes on", 1e-9, abs(since) if is_part else -since, 1 + abs(head.start), b.text)
            if not b.mass or not dt >= 0:
                raise ValueError(f"{b.text} is fixed and moves, or time goes back")
        if is_part:
            self.dt = dt
            self.part(head)
        else:
            self.reached(word == "instant")
        self.states.update(self.to)
        if word == "instant":
            self.instant(head)

    def joints_hold(self, time):
        """In places, in speeds and, of an instant, in accelerations: by differences over a short time."""
        for row in self.rows.values():
            states = self.states[row.first], self.states[row.second]
            h = 2e-4 / (1 + max(abs(s.w) + math.sqrt(abs(s.a) + abs(s.alpha)) for s in states) + 2 * math.pi * abs(row.motion[2]))
            before, now, after = (row_of(row, *(s._replace(x=s.x + (s.v + s.a * (t / 2)) * t,
                                                           q=s.q.then(rotation((s.w + s.alpha * (t / 2)) * t))) for s in states), time + t)[0]
                                  for t in (-h, 0.0, h))
            reach = 1 + abs(row.on) + abs(row.on_2)
            arm = reach + max(abs(s.x) for s in states)
            speed = max(abs(s.v) + abs(s.w) * arm for s in states)
            size = sum(abs(s.a) + (abs(s.alpha) + s.w @ s.w) * reach for s in states)
            self.expect("joints hold", 1e-6, abs(now), arm, row.text)
            self.expect("joints' velocities", 1e-6, abs(after - before) / (2 * h), (1 + speed) * arm, row.text)
            if self.told["rate"]:
                self.expect("joints' accelerations", 1e-4, abs(after - 2 * now + before) / h ** 2, size, row.text, 1e-6 + AT_REST * arm / h ** 2)

    def loads(self, dt, contacts=True):
        """Of each body the sums of impulses, of their moments about its centre, and of their sizes; of an instant (dt 1) forces."""
        acts = [(k, self.engine.gravity, NONE, None, self.bodies[k].mass * dt) for k in self.to]
        acts += [(p.k, p.force, p.moment, None, 1) for p in self.told["push"]]
        acts += [(on.k, on.force, on.moment, None, law.x) for law in self.told["law"] for on in self.told["on", law.k]]
        for p in self.told["pull"]:
            row = self.rows[p.row]
            _, *unit = row_of(row, self.states[row.first], self.states[row.second], self.when)
            acts += [(row.first, *unit, p.x), (row.second, *unit, -p.x)]
        for c in self.told["contact"] if contacts else ():
            acts += [(c.first, c.x, c.moment, c.on, 1), (c.second, c.x, c.moment, c.on_2, -1)]
        out = collections.defaultdict(lambda: (NONE, NONE, 0.0, 0.0))
        for k, force, moment, at, x in acts:
            force, moment = force * x, (moment + ((at - self.states[k].x) ^ force) if at else moment) * x
            out[k] = tuple(map(operator.add, out[k], (force, moment, abs(force), abs(moment))))
        return out

    def part(self, part):
        """A sub-step, or an impact (dt 0): momenta change by the impulses, and contacts and joints obey their laws."""
        if part.dt == 0:
            self.rests()
        loads = self.loads(part.dt)
        free, mid = ({**self.states, **{k: self.bodies[k].struck(self.states[k], each[k]) for k in self.to}}
                     for each in (self.loads(part.dt, False), loads))
        found = [self.contact(c, free, mid, part) for c in self.told["contact"]] or [(0.0, "contacts", 0.0)]
        (worst, name, _), speed = max(found), max(each for _, _, each in found)
        self.expect("residual as claimed", 1e-4, abs(part.residual - worst), worst, name, ROUNDING * speed)
        if not part.composed:
            self.expect("law of contact", 1e-6, worst, max(1, 1e8 * self.step.residual if self.step else 1) * speed, name)
            for law in self.told["law"]:
                self.joint_law(law, mid, part.dt)
        placed = {s.k: s for s in self.told["placed"]}
        for k in self.to:
            self.moves(k, part.dt, loads[k], placed.get(k, self.states[k]))

    def rests(self):
        """An impact has no pushes but those that stop what moves too slowly to count; they do no work on what still moves."""
        power = size = 0.0
        for p in self.told["push"]:
            b, begin, end = self.bodies[p.k], self.states[p.k], self.to[p.k]
            self.expect("comes to rest", 1e-3, abs(p.force) * b.light + abs(b.spin(end.q, p.moment, b.inverse)) * b.radius, 1, b.text)
            power += end.power(p)
            size += abs(p.force) * (abs(end.v) + abs(begin.v)) + abs(p.moment) * (abs(end.w) + abs(begin.w))
        belts = any(any(b.surface + b.surface_spin) for b in self.bodies.values())
        self.expect("work of what comes to rest", 1e-6, 0 if belts else abs(power), size, "impact")

    def contact(self, c, free, mid, part=None):
        """Judges a contact of a part or an instant by the states before contacts push and behind. Its natural residual, name and speeds."""
        both, n, dt = (c.first, c.second), c.n, part.dt if part else 0
        bodies, states = [self.bodies[k] for k in both], [self.states[k] for k in both]
        arms = [p - s.x for s, p in zip(states, (c.on, c.on_2))]
        name, light = f"{bodies[0].text} on {bodies[1].text}", sum(b.light for b in bodies)
        pair, push, spin = self.pairs[tuple(b.material for b in bodies)], c.x @ n, c.moment @ n
        now = [[each[k] for k in both] for each in (self.states, free, mid)]
        before, comes, behind = (operator.sub(*(s.v + (s.w ^ r) for s, r in zip(each, arms))) for each in now)
        speeds, spins = (sum(abs(getattr(s, of)) for each in now for s in each) for of in "vw")
        self.expect("unit length", 1e-9, abs(abs(n) - 1), 1, name)
        self.expect("points of contact", 1, abs(c.on - c.on_2), abs(c.gap), name, ROUNDING * (1 + abs(c.on)))
        turned = max(abs(spin) - pair.torsional * push, abs(c.moment.beside(n)) - pair.rolling * push)
        self.expect("moments of friction", 1e-6, turned, push, name, ROUNDING)
        # A sub-step obeys its laws in its middle: bodies turn until then, and points move along faces and curves of radius a^2 / height.
        reach = max(5 * b.radius ** 2 / max(abs(r @ n), 1e-300) for b, r in zip(bodies, arms))
        bends = max(before @ before, comes @ comes) / max(min(abs(r) for b, r in zip(bodies, arms) if b.mass), 1e-300)
        patch = max(abs(other.on - c.on) for other in self.told["contact"] if other[:2] == both)
        middle = dt * (spins * (speeds + spins * reach) + bends) + abs(free[c.first].w - free[c.second].w) * patch
        belt = operator.sub(*(s.q.turn(b.surface + (b.surface_spin ^ s.q.back.turn(r))) for s, b, r in zip(states, bodies, arms)))
        self.expect("surface speed", 1, abs(c.slip - belt.beside(n)), middle, name, ROUNDING * (1 + speeds + spins))
        owner, rule = bodies[0].material != pair.first, self.engine.text.split(" ")[2]
        along, across, holds = (0.0, 0.0, 0.0) if rule == "frictionless" else (pair.along, pair.across, pair.static)
        axis = states[owner].q.turn(bodies[owner].axis) if along != across else NONE
        more, w = max(holds / along, 1) if along else 1, behind + c.slip + n * c.bias
        residual = lambda k: natural_residual(k * along, k * across, axis, rule == "maximum_dissipation", n, c.x * light, w)
        off = min(residual(1), max(residual(more), abs(w.beside(n)))) if more > 1 else residual(1)
        if not part:
            self.expect("contact closed", 1e-4, abs(c.gap), 1, name)
            self.expect("law of contact at an instant", 1e-4, off, 1 + speeds + spins, name, 1e-6 * abs(c.x) * light)
            return
        self.expect("contact pushes within its cone", 1e-6, max(-push, abs(c.x.beside(n)) - more * max(along, across) * push), abs(c.x), name,
                    ROUNDING * max(abs(before), abs(comes)) / (light or math.inf))
        wrong = abs(c.bias - (max(c.gap, 0.0) / dt if dt > 0 else 0.0)) - middle
        if -(comes @ n) * dt > c.gap or dt == 0:
            wrong = min(wrong, abs(c.bias) - middle, abs(c.bias - pair.restitution * max(before @ n, comes @ n)))
        self.expect("restitution or gap that closes", 1e-9, 0.0 if part.composed else wrong, 1 + speeds + spins, name)
        return off, name, abs(before) + abs(comes) + abs(c.slip) + abs(c.bias) + abs(c.x) * light + abs(self.engine.gravity) * dt

    def joint_law(self, law, mid, dt):
        """The impulse of a limit (low 0), motor, friction or spring is within its bounds, and at one where the speed is not as wanted."""
        acts, opens = self.told["on", law.k], law.gap / dt if dt > 0 else 0.0
        before, speed = (sum(states[on.k].power(on) for on in acts) for states in (self.states, mid))
        gives = law.compliance + sum(self.bodies[on.k].struck(self.states[on.k]._replace(v=NONE, w=NONE), (on.force, on.moment)).power(on)
                                     for on in acts)
        wanted = [law.wanted] if law.low < 0 else [min(-opens, 0.0), 0.0, -law.restitution * before]
        there = [law.x - (speed + law.compliance * law.x - each) / (gives or 1) for each in wanted]
        off = min(abs(law.x - max(law.low, min(law.high, each))) for each in there) * gives
        size = abs(law.x) * gives + abs(speed) + abs(before) + abs(law.wanted) + abs(opens)
        self.expect("law of a joint", 1e-4, off, size, law.text, AT_REST)

    def moves(self, k, dt, load, placed):
        """Balances of a body over a sub-step, from where corrections have placed it: one of the orientation turns its momentum, too."""
        b, begin, end, (impulse, moment, size, sized) = self.bodies[k], self.states[k], self.to[k], load
        change, left = end.v - begin.v, end.x - placed.x - end.v * dt
        self.expect("balance of momentum", 1e-6, abs(change * b.mass - impulse),
                    size + b.mass * (abs(change) + ROUNDING * (abs(end.v) + abs(begin.v))), b.text, b.mass * AT_REST)
        left = min(abs(left), abs(left + self.engine.gravity * (dt * dt / 2)))  # or along the parabola of free fall
        self.expect("places move as velocities", 1e-6, left, dt * abs(end.v), b.text, ROUNDING * (abs(end.x) + dt * abs(end.v)))
        gaps = sum(abs(c.gap) for c in self.told["contact"])
        self.expect("corrections close gaps", 10, abs(placed.x - begin.x), gaps, b.text, 1e-8 * (1 + abs(end.x)))
        keeps, before = self.engine.text.split(" ")[1] == "momentum", b.spin(begin.q, begin.w)
        middle, after = begin.q.back.then(placed.q).turn(before + moment), b.spin(end.q if keeps else placed.q, end.w)
        self.expect("balance of angular momentum", 1e-6, abs(after - middle),
                    sized + abs(after - before) + 1e-8 * (abs(after) + abs(before)) + 1e-6 * size * (1 + abs(end.x)), b.text)
        there = placed.q.then(rotation(end.w * dt))
        if keeps:  # by the mean of the velocities in body axes
            there = rotation(sum((q.back.turn(b.spin(q, middle, b.inverse)) for q in (placed.q, end.q)), NONE) * (dt / 2)).then(placed.q)
        self.expect("orientation moves as velocities", 1e-6, there.apart(end.q), dt * abs(end.w), b.text, ROUNDING)

    def reached(self, instant):
        """Places by the mean of the velocities, over whatever time has passed; an error control moves them by its accuracy."""
        for k in self.to.keys() & self.states.keys():
            b, was, s = self.bodies[k], self.states[k], self.to[k]
            h, free = s.time - was.time, 10 * self.engine.accuracy
            self.expect("places follow velocities", 1e-5, abs(s.x - was.x - (s.v + was.v) * (h / 2)), abs(s.x) + 0.1, b.text,
                        abs(h) / 4 * abs(s.v - was.v) + free * b.radius)
            if abs(h) <= 1e-12 and not instant:  # joints that attach may strike before an instant
                span, per_metre = (self.dt, 1 / b.radius) if free else (1, 1)
                off = max(s.q.apart(was.q), span * abs(s.w - was.w), span * per_metre * abs(s.v - was.v))
                self.expect("motion goes on", 1e-6, off, 1, b.text, free)

    def instant(self, head):
        """Equations of motion: accelerations by the forces, as the joints allow them, and as the next instants tell."""
        loads, now = self.loads(1), {}
        for c in self.told["contact"]:
            self.contact(c, self.states, self.states)
        for k, s in self.to.items():
            b, (force, torque, size, sized) = self.bodies[k], loads[k]
            momentum, spun = b.spin(s.q, s.w), b.spin(s.q, s.alpha)
            gyroscopic = s.w ^ momentum
            self.expect("equations of motion", 1e-5, abs(force - s.a * b.mass), size + b.mass * abs(s.a), b.text)
            self.expect("equations of rotation", 1e-5, abs(spun + gyroscopic - torque), sized + abs(gyroscopic) + abs(spun), b.text,
                        ROUNDING * (sum(map(abs, b.rows)) + size))
            q = s.q * math.copysign(1, s.q @ self.past[-1][2][k][3][1]) if self.past else s.q
            tiny = 0.1 * b.mass * b.radius ** 2
            now[k] = (("velocity leads on", s.v, s.a, 0.1), ("angular momentum leads on", momentum, torque, tiny),
                      ("places lead on", s.x, s.v, 0.1), ("orientation leads on", q, q.then(V((0, *s.w))) * 0.5, 0))
        self.joints_hold(head.start)
        if self.past and self.past[-1][1] != head.events:
            self.past.clear()
        self.past.append((head.start, head.events, now))
        if len(self.past) == 4:
            self.leads(*self.past)

    def leads(self, *past):
        """From the second to the third of four instants, by fourth order; its error is judged by the second."""
        t0, t1, t2, t3 = (each[0] for each in past)
        h = t2 - t1
        for k in self.to:
            for (_, _, f0, _), (law, y1, f1, tiny), (_, y2, f2, _), (_, _, f3, _) in zip(*(each[2][k] for each in past)):
                g1, g2 = (f2 - f0) * (1 / (t2 - t0)), (f3 - f1) * (1 / (t3 - t1))
                off = abs(y2 - y1 - (f1 + f2) * (h / 2) - (g1 - g2) * (h * h / 12))
                self.expect(law, 1e-5 if tiny else 2.5e-6, off, abs(y1) + abs(y2) + tiny, self.bodies[k].text,
                            h * h / 20 * (abs(g1) + abs(g2)) + h / 5 * abs(f3 - f0 + (f1 - f2) * 3))


def main(files):
    worst = 0
    for file in files:
        judge = Judge()
        try:
            judge.run(file)
            broken = len(judge.faults)
            code, verdict = min(broken, 1), f"{broken} laws broken" if broken else "holds"
            said = [*judge.faults[:10], f"{verdict}, {judge.judged} judgements"]
        except (OSError, ArithmeticError, LookupError, ValueError, AttributeError, TypeError) as error:
            code, said = 2, [f"cannot be judged, from t = {judge.when:g} s: {type(error).__name__}: {error}"]
        print("".join(f"{file}: {each}\n" for each in said), end="")
        worst = max(worst, code)
    return worst


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]) if sys.argv[1:] else print(__doc__) or 2)
