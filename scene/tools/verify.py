#!/usr/bin/env python3
"""Judges the certificate of a run by the laws of mechanics, without Tether's code. SPDX-License-Identifier: BSD-3-Clause

    python3 scene/tools/verify.py FILE.cert...     # written by: tether run SCENE.toml --certificate FILE.cert

docs/certificate.md explains the laws and the lines of a certificate.
Exit code: 0 every law holds, 1 one is broken, 2 a file cannot be judged."""
import collections
import math
import sys

from certificate import NONE, Body, Damaged, State, V, natural_residual, read, rotation, row_of, total, velocity

# How much a law may be off: the part of the times, places, speeds, impulses or forces that it is about.
LAWS = {law: part for part, laws in {
    1e-9: ("time goes on", "unit length", "restitution or gap that closes"),
    1e-6: ("motion goes on", "balance of momentum", "balance of angular momentum", "places move as velocities",
           "orientation moves as velocities", "joints hold", "joints' velocities", "law of contact",
           "contact pushes within its cone", "moments of friction", "work of what comes to rest"),
    2.5e-6: ("orientation leads on",),
    1e-5: ("equations of motion", "equations of rotation", "places follow velocities", "velocity leads on",
           "angular momentum leads on", "places lead on"),
    1e-4: ("residual as claimed", "joints' accelerations", "law of a joint", "contact closed", "law of contact at an instant"),
    1e-3: ("comes to rest",), 1e-2: ("contact problems solved",), 1: ("points of contact", "surface speed"),
    10: ("corrections close gaps",)}.items() for law in laws}
ROUNDING, AT_REST = 1e-9, 1e-15  # of places and speeds; m/s, rad/s


class Judge:
    def __init__(self):
        self.bodies, self.states, self.pairs, self.rows, self.past = {}, {}, {}, {}, collections.deque(maxlen=4)
        self.faults, self.judged, self.line, self.engine, self.step, self.when, self.length = [], 0, 0, None, None, 0.0, 0.0
        self.block, self.to, self.told = None, {}, collections.defaultdict(list)  # lines of the block, by word
        self.judges = {"part": self.part, "reached": self.reached, "instant": self.instant}

    def run(self, file):
        for line, told in read(file):
            word = type(told).__name__
            if word in ("to", "push", "pull", "law", "on", "contact", "placed", "rate"):
                self.told[(word, told.law) if word == "on" else word].append(told)
                continue
            if self.block:
                self.finish()
            self.line = line
            if word in self.judges:
                self.block, self.when = told, told.start
            else:
                self.head(word, told)
        if not self.to:
            raise Damaged("nothing moves in it")

    def expect(self, law, off, size=1.0, what="step", slack=0.0):
        bound = LAWS[law] * size + slack
        self.judged += 1
        if not off <= bound < math.inf:
            step = f"step {self.step.k:g}, " if self.step else ""
            self.faults.append(f"{step}t = {self.when:g} s: {what}: {law}: {off:.3g}, at most {bound:.3g}")

    def head(self, word, told):
        if word in ("step", "engine", "end") and self.step:  # the one before is over: all bodies have come to its end
            for k, b in self.bodies.items():
                self.expect("time goes on", abs(self.states[k].time - self.step.end) if b.mass else 0.0, 1 + abs(self.step.end), b.name)
            self.joints_hold(self.step.end)
        if word == "body":
            self.bodies[told.k] = Body(told)
            if told.mass == 0:
                self.states[told.k] = State(told.x, told.q, NONE, NONE, 0.0)
        elif word == "pair":
            self.pairs[told.first, told.second] = self.pairs[told.second, told.first] = told
        elif word == "engine":
            self.engine, self.rows, self.step = told, {}, None
            self.past.clear()
        elif word == "row":
            self.rows[told.k] = told
        elif word == "step":
            self.step = told
            self.expect("contact problems solved", max(abs(told.residual), abs(told.solved - 1)))

    def finish(self):
        """Judges the block that has been read."""
        self.length = getattr(self.block, "dt", self.length)
        self.to = {s.k: State(*s[1:], self.when + getattr(self.block, "dt", 0)) for s in self.told["to"]}
        for k, s in self.to.items():
            self.expect("unit length", abs(abs(s.q) - 1), 1, self.bodies[k].name)
            if not self.bodies[k].mass:
                raise Damaged(f"{self.bodies[k].name} is fixed and moves")
        self.judges[type(self.block).__name__](self.block)
        self.states.update(self.to)
        self.block, self.told = None, collections.defaultdict(list)

    def joints_hold(self, time, rates=None):
        """In places, in speeds and, of an instant, in accelerations: by differences over a short time."""
        for row in self.rows.values():
            states = [self.states[k] for k in (row.first, row.second)]
            of = [(rates or {}).get(k, (NONE, NONE)) for k in (row.first, row.second)]
            fast = max(abs(s.w) + math.sqrt(abs(a) + abs(alpha)) for s, (a, alpha) in zip(states, of))
            h = 2e-4 / (1 + fast + 2 * math.pi * abs(row.motion[2]))
            moved = ([s._replace(x=s.x + (s.v + a * (t / 2)) * t, q=s.q.then(rotation((s.w + alpha * (t / 2)) * t)))
                      for s, (a, alpha) in zip(states, of)] for t in (-h, 0.0, h))
            before, now, after = (row_of(row, *pair, time + t)[0] for pair, t in zip(moved, (-h, 0.0, h)))
            reach = 1 + abs(row.on) + abs(row.on_2)
            arm = reach + max(abs(s.x) for s in states)
            speed = max(abs(s.v) + abs(s.w) * arm for s in states)
            self.expect("joints hold", abs(now), arm, row.text)
            self.expect("joints' velocities", abs(after - before) / (2 * h), (1 + speed) * arm, row.text)
            size = sum(abs(a) + (abs(alpha) + s.w @ s.w) * reach for s, (a, alpha) in zip(states, of))
            self.expect("joints' accelerations", abs(after - 2 * now + before) / (h * h) if rates else 0.0, size, row.text, 1e-6 + AT_REST * arm / (h * h))

    def loads(self, dt, contacts):
        """What acts on bodies, with or without contacts: impulses and moments, of an instant (dt 1) forces."""
        out = collections.defaultdict(list, {k: [(self.engine.gravity * (self.bodies[k].mass * dt), NONE)] for k in self.to})
        for p in self.told["push"]:
            out[p.k].append((p.force, p.moment))
        for p in self.told["pull"]:
            row = self.rows[p.row]
            _, force, moment, at = row_of(row, self.states[row.first], self.states[row.second], self.when)
            for k, x in zip((row.first, row.second), (p.x, -p.x)):
                out[k].append((force * x, (moment + ((at - self.states[k].x) ^ force)) * x))
        for law in self.told["law"]:
            for on in self.told["on", law.k]:
                out[on.k].append((on.force * law.x, on.moment * law.x))
        for c in self.told["contact"] if contacts else ():
            for k, p, sign in zip(c[:2], (c.on, c.on_2), (1, -1)):
                out[k].append((c.x * sign, (c.moment + ((p - self.states[k].x) ^ c.x)) * sign))
        return out

    def part(self, part):
        """A sub-step, or an impact (dt 0): momenta change by the impulses, and contacts and joints obey their laws."""
        for k in self.to:
            self.expect("time goes on", abs(self.states[k].time - part.start), 1 + abs(part.start), self.bodies[k].name)
        if part.dt == 0:
            self.rests()
        loads = self.loads(part.dt, True)
        free, mid = ({**self.states, **{k: self.bodies[k].struck(self.states[k], each[k]) for k in self.to}}
                     for each in (self.loads(part.dt, False), loads))
        found = [self.contact(c, free, mid, part) for c in self.told["contact"]] or [(0.0, "contacts", 0.0)]
        (worst, name, _), speed = max(found), max(each for _, _, each in found)
        self.expect("residual as claimed", abs(part.residual - worst), worst, name, ROUNDING * speed)
        if not part.composed:
            self.expect("law of contact", worst, max(1, 1e8 * self.step.residual if self.step else 1) * speed, name)
            for law in self.told["law"]:
                self.joint_law(law, mid, part.dt)
        placed = {s.k: s for s in self.told["placed"]}
        for k in self.to:
            self.moves(k, part.dt, total(loads[k]), placed.get(k, self.states[k]))

    def rests(self):
        """An impact has no pushes but those that stop what moves too slowly to count; they do no work on what still moves."""
        power = size = 0.0
        for p in self.told["push"]:
            b, begin, end = self.bodies[p.k], self.states[p.k], self.to[p.k]
            self.expect("comes to rest", abs(p.force) * b.light + abs(b.spin(end.q, p.moment, b.inverse)) * b.radius, 1, b.name)
            power += p.force @ end.v + p.moment @ end.w
            size += abs(p.force) * (abs(end.v) + abs(begin.v)) + abs(p.moment) * (abs(end.w) + abs(begin.w))
        belts = any(any(b.told.surface + b.told.surface_spin) for b in self.bodies.values())
        self.expect("work of what comes to rest", 0 if belts else abs(power), size, "impact")

    def contact(self, c, free, mid, part=None):
        """Judges a contact of a part or an instant by the states before contacts push and behind. Its natural residual, name and speeds."""
        both, n, speed_of = c[:2], c.n, lambda states: velocity(states, c[:2], (c.on, c.on_2))
        bodies, states, dt = [self.bodies[k] for k in both], [self.states[k] for k in both], part.dt if part else 0
        name, light = f"{bodies[0].name} on {bodies[1].name}", sum(b.light for b in bodies)
        pair, push, spin = self.pairs[tuple(b.told.material for b in bodies)], c.x @ n, c.moment @ n
        before, comes, w = speed_of(self.states), speed_of(free), speed_of(mid) + c.slip + n * c.bias
        self.expect("unit length", abs(abs(n) - 1), 1, name)
        self.expect("points of contact", abs(c.on - c.on_2), abs(c.gap), name, ROUNDING * (1 + abs(c.on)))
        turned = max(abs(spin) - pair.torsional * push, abs(c.moment.beside(n)) - pair.rolling * push)
        self.expect("moments of friction", turned, push, name, ROUNDING)
        # A sub-step obeys its laws in its middle: bodies turn until then, and points move along faces and curves of radius a^2 / height.
        now, arms = [each[k] for each in (self.states, free, mid) for k in both], [p - s.x for s, p in zip(states, (c.on, c.on_2))]
        speeds, spins = sum(abs(s.v) for s in now), sum(abs(s.w) for s in now)
        reach = max(5 * b.radius ** 2 / max(abs(r @ n), 1e-300) for b, r in zip(bodies, arms))
        bends = max(before @ before, comes @ comes) / max(min(abs(r) for b, r in zip(bodies, arms) if b.mass), 1e-300)
        patch = max(abs(other.on - c.on) for other in self.told["contact"] if other[:2] == both)
        middle = dt * (spins * (speeds + spins * reach) + bends) + abs(free[both[0]].w - free[both[1]].w) * patch
        belts = [s.q.turn(b.told.surface + (b.told.surface_spin ^ s.q.back.turn(r))) for s, b, r in zip(states, bodies, arms)]
        self.expect("surface speed", abs(c.slip - (belts[0] - belts[1]).beside(n)), middle, name, ROUNDING * (1 + speeds + spins))
        owner, rule = bodies[0].told.material != pair.first, self.engine.text.split(" ")[2]
        along, across, holds = (0.0, 0.0, 0.0) if rule == "frictionless" else (pair.along, pair.across, pair.static)
        axis = states[owner].q.turn(bodies[owner].told.axis) if along != across else NONE
        off = natural_residual(along, across, axis, rule == "maximum_dissipation", n, c.x * light, w)
        more = max(holds / along, 1) if along else 1
        if more > 1:
            held = natural_residual(more * along, more * across, axis, rule == "maximum_dissipation", n, c.x * light, w)
            off = min(off, max(held, abs(w.beside(n))))  # it holds
        if not part:
            self.expect("contact closed", abs(c.gap), 1, name)
            self.expect("law of contact at an instant", off, 1 + speeds + spins, name, 1e-6 * abs(c.x) * light)
            return
        self.expect("contact pushes within its cone", max(-push, abs(c.x.beside(n)) - more * max(along, across) * push), abs(c.x), name,
                    ROUNDING * max(abs(before), abs(comes)) / (light or math.inf))
        wrong = abs(c.bias - (max(c.gap, 0.0) / dt if dt > 0 else 0.0)) - middle
        if -(comes @ n) * dt > c.gap or dt == 0:
            wrong = min(wrong, abs(c.bias) - middle, abs(c.bias - pair.restitution * max(before @ n, comes @ n)))
        self.expect("restitution or gap that closes", 0.0 if part.composed else wrong, 1 + speeds + spins, name)
        return off, name, abs(before) + abs(comes) + abs(c.slip) + abs(c.bias) + abs(c.x) * light + abs(self.engine.gravity) * dt

    def joint_law(self, law, mid, dt):
        """The impulse of a limit (low 0), motor, friction or spring is within its bounds, and at one where the speed is not as wanted."""
        ons = self.told["on", law.k]
        before, speed = (sum(on.force @ s[on.k].v + on.moment @ s[on.k].w for on in ons) for s in (self.states, mid))
        gives = law.compliance
        for on in ons:
            b = self.bodies[on.k]
            gives += on.force @ on.force * b.light + on.moment @ b.spin(self.states[on.k].q, on.moment, b.inverse)
        opens = law.gap / dt if dt > 0 else 0.0
        wanted = [law.wanted] if law.low < 0 else [min(-opens, 0.0), 0.0, -law.restitution * before]
        there = [law.x - (speed + law.compliance * law.x - each) / (gives or 1) for each in wanted]
        off = min(abs(law.x - max(law.low, min(law.high, each))) for each in there) * gives
        self.expect("law of a joint", off, abs(law.x) * gives + abs(speed) + abs(before) + abs(law.wanted) + abs(opens), law.text, AT_REST)

    def moves(self, k, dt, load, placed):
        """Balances of a body over a sub-step, from where corrections have placed it: one of the orientation turns its momentum, too."""
        b, begin, end, (impulse, moment, size, sized) = self.bodies[k], self.states[k], self.to[k], load
        change, left = end.v - begin.v, end.x - placed.x - end.v * dt
        self.expect("balance of momentum", abs(change * b.mass - impulse),
                    size + b.mass * (abs(change) + ROUNDING * (abs(end.v) + abs(begin.v))), b.name, b.mass * AT_REST)
        left = min(abs(left), abs(left + self.engine.gravity * (dt * dt / 2)))  # or along the parabola of free fall
        self.expect("places move as velocities", left, dt * abs(end.v), b.name, ROUNDING * (abs(end.x) + dt * abs(end.v)))
        gaps = sum(abs(c.gap) for c in self.told["contact"])
        self.expect("corrections close gaps", abs(placed.x - begin.x), gaps, b.name, 1e-8 * (1 + abs(end.x)))
        keeps, before = self.engine.text.split(" ")[1] == "momentum", b.spin(begin.q, begin.w)
        middle, after = begin.q.back.then(placed.q).turn(before + moment), b.spin(end.q if keeps else placed.q, end.w)
        self.expect("balance of angular momentum", abs(after - middle),
                    sized + abs(after - before) + 1e-8 * (abs(after) + abs(before)) + 1e-6 * size * (1 + abs(end.x)), b.name)
        there = placed.q.then(rotation(end.w * dt))
        if keeps:  # by the mean of the velocities in body axes
            there = rotation(sum((q.back.turn(b.spin(q, middle, b.inverse)) for q in (placed.q, end.q)), NONE) * (dt / 2)).then(placed.q)
        self.expect("orientation moves as velocities", there.apart(end.q), dt * abs(end.w), b.name, ROUNDING)

    def reached(self, block):
        """Places by the mean of the velocities, over whatever time has passed; an error control moves them by its accuracy."""
        for k in self.to.keys() & self.states.keys():
            b, was, s = self.bodies[k], self.states[k], self.to[k]
            h, free = block.start - was.time, 10 * self.engine.accuracy
            self.expect("time goes on", -h, 1 + abs(block.start), b.name)
            self.expect("places follow velocities", abs(s.x - was.x - (s.v + was.v) * (h / 2)), abs(s.x) + 0.1, b.name,
                        abs(h) / 4 * abs(s.v - was.v) + free * b.radius)
            if abs(h) <= 1e-12 and type(block).__name__ == "reached":  # joints that attach may strike before an instant
                span, per_metre = (self.length, 1 / b.radius) if free else (1, 1)
                off = max(s.q.apart(was.q), span * abs(s.w - was.w), span * per_metre * abs(s.v - was.v))
                self.expect("motion goes on", off, 1, b.name, free)

    def instant(self, block):
        """Equations of motion: accelerations by the forces, as the joints allow them, and as the next instants tell."""
        self.reached(block)
        self.states.update(self.to)
        loads, rates, now = self.loads(1, True), {r.k: (r.a, r.alpha) for r in self.told["rate"]}, {}
        for c in self.told["contact"]:
            self.contact(c, self.states, self.states)
        for k, s in self.to.items():
            b, (a, alpha), (force, torque, size, sized) = self.bodies[k], rates[k], total(loads[k])
            momentum, spun = b.spin(s.q, s.w), b.spin(s.q, alpha)
            self.expect("equations of motion", abs(force - a * b.mass), size + b.mass * abs(a), b.name)
            self.expect("equations of rotation", abs(spun + (s.w ^ momentum) - torque), sized + abs(s.w ^ momentum) + abs(spun), b.name,
                        ROUNDING * (sum(map(abs, b.rows)) + size))
            q = s.q * math.copysign(1, s.q @ self.past[-1][2][k]["orientation leads on"][0]) if self.past else s.q
            now[k] = {"velocity leads on": (s.v, a, 0.1), "angular momentum leads on": (momentum, torque, 0.1 * b.mass * b.radius ** 2),
                      "places lead on": (s.x, s.v, 0.1), "orientation leads on": (q, q.then(V((0, *s.w))) * 0.5, 0)}
        self.joints_hold(block.start, rates)
        if self.past and self.past[-1][1] != block.events:
            self.past.clear()
        self.past.append((block.start, block.events, now))
        if len(self.past) == 4:
            self.leads(*(each[0] for each in self.past))

    def leads(self, t0, t1, t2, t3):
        """From the second to the third of four instants, by fourth order; its error is judged by the second."""
        h = t2 - t1
        for k in self.to:
            for law in self.past[0][2][k]:
                (_, f0, _), (y1, f1, tiny), (y2, f2, _), (_, f3, _) = (each[2][k][law] for each in self.past)
                g1, g2 = (f2 - f0) * (1 / (t2 - t0)), (f3 - f1) * (1 / (t3 - t1))
                off = abs(y2 - y1 - (f1 + f2) * (h / 2) - (g1 - g2) * (h * h / 12))
                self.expect(law, off, abs(y1) + abs(y2) + tiny, self.bodies[k].name,
                            h * h / 20 * (abs(g1) + abs(g2)) + h / 5 * abs(f3 - f0 + (f1 - f2) * 3))


def main(files):
    worst = 0 if files else 2
    for file in files:
        judge = Judge()
        try:
            judge.run(file)
        except (Damaged, OSError, ArithmeticError, LookupError, ValueError, AttributeError, TypeError) as why:
            missing = "" if isinstance(why, (Damaged, OSError)) else f"block of line {judge.line}: a part is missing, or beyond numbers: "
            print(f"{file}: cannot be judged: {missing}{why}")
            worst = 2
            continue
        for fault in judge.faults[:10]:
            print(f"{file}: {fault}")
        print(f"{file}: {f'{len(judge.faults)} laws broken' if judge.faults else 'holds'}, {judge.judged} judgements")
        worst = max(worst, 1 if judge.faults else 0)
    return worst


if __name__ == "__main__":
    if not sys.argv[1:]:
        print(__doc__)
    sys.exit(main(sys.argv[1:]))
