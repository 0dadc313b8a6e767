"""Reads the certificate of a run: its lines as records, its bodies, rows of joints and law of contact.
SPDX-License-Identifier: BSD-3-Clause

    for line, told in read("run.cert"): print(line, type(told).__name__, told)

docs/certificate.md explains the lines."""
import collections
import itertools
import math
import operator

LONGEST = 1 << 16  # bytes of a line


class Damaged(Exception):
    """The file is no certificate, or not a whole one."""


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
    across = lambda n: min(X, Y, Z, key=lambda e: abs(e @ n)).beside(n).unit
    turn = lambda q, v: v + (q.tail ^ v) * (2 * q[0]) + (q.tail ^ (q.tail ^ v)) * 2
    then = lambda q, p: V((p[0] * q[0] - p.tail @ q.tail, *q.tail * p[0] + p.tail * q[0] + (p.tail ^ q.tail)))  # q, then p
    apart = lambda p, q: 2 * min(abs(p - q), abs(p + q))  # rad


X, Y, Z, NONE = V((1, 0, 0)), V((0, 1, 0)), V((0, 0, 1)), V((0, 0, 0))
State = collections.namedtuple("State", "x q v w time")  # of a body, world axes


def rotation(v):
    """The quaternion of a turn by |v| rad about v."""
    angle = min(abs(v), 1e300)
    return V((math.cos(angle / 2), *v * (math.sin(angle / 2) / angle if angle > 0 else 0.5)))


def read(file):
    """Number and record of each line. A certificate begins with the forms of its words, `name:n` for n numbers, and a text at the end."""
    word, forms = "", {}
    with open(file, encoding="utf-8", errors="replace") as lines:
        for number, line in enumerate(iter(lambda: lines.readline(LONGEST), ""), 1):
            last, (word, _, rest) = word, line[:-1].partition(" ")
            if not line.endswith("\n") or last == "end":
                raise Damaged(f"line {number} is cut, longer than any, or behind the end")
            if (number == 1) != (line == "tether certificate 1\n"):
                raise Damaged(f"line {number}: it is no certificate of format 1")
            if word == "form":
                name, *fields = rest.split(" ")
                names, _, sizes = zip(*(each.partition(":") for each in fields)) if fields else ((), (), ())
                forms[name] = collections.namedtuple(name, names), [int(n or 1) for each, n in zip(names, sizes) if each != "text"]
            elif number > 1:
                yield number, record(number, word, rest, forms)
    if word != "end":
        raise Damaged("its end is missing: it was cut")


def record(number, word, rest, forms):
    if word not in forms:
        raise Damaged(f"line {number}: {word[:20]!r} is no word of this certificate")
    make, sizes = forms[word]
    has_text = "text" in make._fields
    fields = rest.split(" ", sum(sizes) if has_text else -1) if rest else []
    text = [fields.pop()] if has_text and fields else []
    numbers = [float(each) for each in fields]
    if len(numbers) != sum(sizes) or not all(map(math.isfinite, numbers)):
        raise Damaged(f"line {number}: {word} has {sum(sizes)} finite numbers")
    if word == "end" and numbers != [number - 1]:
        raise Damaged(f"line {number}: {numbers[0]:g} lines should come before the end")
    given = iter(numbers)
    return make(*(V(itertools.islice(given, n)) if n > 1 else next(given) for n in sizes), *text)


class Body:
    """What a body is; mass 0: it is fixed, and nothing moves it."""

    def __init__(self, told):
        a, b, c = self.rows = told.ix, told.iy, told.iz
        self.told, self.name, self.mass = told, told.text, told.mass
        self.light, volume = (1 / told.mass, a @ (b ^ c)) if told.mass else (0.0, math.inf)
        if not self.mass >= 0 or not volume > 0:
            raise Damaged(f"{self.name} has no mass or inertia that moves")
        self.inverse = [each * (1 / volume) for each in (b ^ c, c ^ a, a ^ b)]
        self.radius = math.sqrt((a[0] + b[1] + c[2]) * self.light)

    def spin(self, q, w, rows=None):
        """Angular momentum, world axes; of it, with the inverse rows, the angular velocity."""
        u = q.back.turn(w)
        return q.turn(V([row @ u for row in rows or self.rows]))

    def struck(self, s, loads):
        impulse, moment, _, _ = total(loads)
        return s._replace(v=s.v + impulse * self.light, w=s.w + self.spin(s.q, moment, self.inverse))


def total(loads):
    """Impulse and moment about the centre, or force and torque, and the sums of their sizes."""
    forces, moments = zip(*loads)
    return sum(forces, NONE), sum(moments, NONE), sum(map(abs, forces)), sum(map(abs, moments))


def velocity(states, bodies, on):
    """Of the first body at a place against that of the second at its own."""
    (a, p), (b, r) = ((states[k], p - states[k].x) for k, p in zip(bodies, on))
    return a.v + (a.w ^ p) - b.v - (b.w ^ r)


def row_of(told, a, b, time):
    """How far a row of a joint is off, m or rad; the force, or the moment, on its first body for an impulse of 1, and where it acts."""
    kind, _, _ = told.text.partition(" ")
    axis, p = told.axis if kind == "point" else b.q.turn(told.axis), a.x + a.q.turn(told.on)
    rate, amplitude, frequency, phase = told.motion
    way = rate * time + amplitude * (math.sin(2 * math.pi * frequency * time + phase) - math.sin(phase))
    if kind == "angle":  # between a direction of the first body and one of the second, which a motion turns about the axis
        u, v = a.q.turn(told.on), b.q.turn(rotation(told.axis * way).turn(told.on_2))
        return u @ v, NONE, u ^ v, a.x
    if kind == "turn":  # free but for laws of the joint, as a way is
        return 0.0, NONE, axis, a.x
    d = p - b.x - b.q.turn(told.on_2)
    if kind == "distance":
        return abs(d) - told.length - way, d * (1 / told.length), NONE, p
    return 0.0 if kind == "way" else axis @ d - way, axis, NONE, p


def natural_residual(along, across, axis, associated, n, y, w):
    """|x - P(x - v)|, P the projection onto the friction cone: how far an impulse over the mass, y, and a velocity w are off
    Coulomb's law, m/s (De Saxce and Feng 1998). Tangents are along the axis and across it, in units of their coefficients."""
    t = (axis.beside(n) if abs(axis.beside(n)) > 0 else n.across()).unit
    b = n ^ t
    x = V((n @ y, t @ y / (along or math.inf), b @ y / (across or math.inf)))
    v = V((n @ w, along * (t @ w), across * (b @ w)))
    z = x - v - X * (0 if associated else abs(v.tail))
    size, onto = abs(z.tail), max(0.0, (z[0] + abs(z.tail)) / 2)
    p = V((onto, *z.tail * (onto / (size or 1)))) if size > z[0] else z
    return max(abs(x - p), 0 if along or across else abs(y.beside(n)))
