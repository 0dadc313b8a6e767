"""Motions of benchmarks/peers/scenes: closed forms, and extrapolated integrals of reduced coordinates, without Tether's
code. SPDX-License-Identifier: BSD-3-Clause

SCENES: file without .toml -> (what is compared: body and point in its axes, scale in m, function of the time in s that
gives the points)."""
import math

G = 9.81


def extrapolated(f, y, t, steps):
    """y(t) of y' = f(y): the modified midpoint rule, extrapolated to order 16 (Gragg, Bulirsch, Stoer)."""
    h = t / steps
    for _ in range(steps if t else 0):
        table = []
        for n in range(2, 18, 2):
            d = h / n
            a, b = y, [p + d * q for p, q in zip(y, f(y))]
            for _ in range(n - 1):
                a, b = b, [p + 2 * d * q for p, q in zip(a, f(b))]
            row = [[(p + q + d * r) / 2 for p, q, r in zip(a, b, f(b))]]
            for k, previous in enumerate(table[-1] if table else []):
                ratio = (n / (n - 2 * k - 2)) ** 2
                row.append([p + (p - q) / (ratio - 1) for p, q in zip(row[k], previous)])
            table.append(row)
        y = table[-1][-1]
    return y


def elliptic(u, k):
    """sn, cn, dn by descending Landen transformations (Abramowitz, Stegun 16.4), and K."""
    a, c = [1.0], [k]
    b = math.sqrt(1 - k * k)
    while abs(c[-1]) > 1e-17 and len(a) < 12:
        c.append((a[-1] - b) / 2)
        a.append((a[-1] + b) / 2)
        b = math.sqrt(a[-2] * b)
    phi = 2 ** (len(a) - 1) * a[-1] * u
    for n in range(len(a) - 1, 0, -1):
        phi = (phi + math.asin(c[n] / a[n] * math.sin(phi))) / 2
    return math.sin(phi), math.cos(phi), math.sqrt(1 - (k * math.sin(phi)) ** 2), math.pi / 2 / a[-1]


def released(t, amplitude, w):
    """Angle of a pendulum released at rest, from below; w^2 = m g l / I."""
    k = math.sin(amplitude / 2)
    _, cn, dn, _ = elliptic(w * t, k)
    return 2 * math.asin(k * cn / dn)


def pendulum(t):
    angle = released(t, math.pi / 2, math.sqrt(1.5 * G))
    return [(math.sin(angle), 0, -math.cos(angle))]


def wall(t, e=0.8):
    """From 60 degrees; each impact at the lowest point turns the speed to e of it."""
    w, k = math.sqrt(G / 1.004), 0.5
    angle, start = released(t, math.pi / 3, w), elliptic(0, k)[3] / w
    while t > start:
        k *= e
        sn, _, _, quarter = elliptic(w * (t - start), k)
        angle, start = 2 * math.asin(k * sn), start + 2 * quarter / w
    return [(math.sin(angle), 0, -math.cos(angle))]


def double_pendulum(t, steps=100):
    def f(y):
        a, b, u, v = y
        c, s = math.cos(a - b) / 2, math.sin(a - b) / 2
        p, q = -s * v * v - 1.5 * G * math.sin(a), s * u * u - G / 2 * math.sin(b)
        det = 4 / 9 - c * c
        return [u, v, (p / 3 - c * q) / det, (4 / 3 * q - c * p) / det]
    a, b, _, _ = extrapolated(f, [math.pi / 2, math.pi / 2, 0, 0], t, steps)
    return [(math.sin(a) + math.sin(b), 0, -math.cos(a) - math.cos(b))]


def slider_crank(t, steps=100, r=0.5, l=1.5):
    """The crank's angle by the energy, which never lets it turn back."""
    def rates(angle):
        sin, cos = math.sin(angle), math.cos(angle)
        phi = math.asin(r * sin / l)
        turn = r * cos / (l * math.cos(phi))
        middle, slider = -r * sin - l / 2 * math.sin(phi) * turn, -r * sin - l * math.sin(phi) * turn
        inertia = r * r / 3 + l * l / 12 * turn ** 2 + middle ** 2 + (r * cos / 2) ** 2 + slider ** 2
        return phi, inertia
    energy = rates(0)[1] * 12 ** 2 / 2
    angle = extrapolated(lambda y: [math.sqrt(2 * (energy - G * r * math.sin(y[0])) / rates(y[0])[1])], [0.0], t, steps)[0]
    x, phi = r * math.cos(angle), rates(angle)[0]
    return [(x + l / 2 * math.cos(phi), 0, r / 2 * math.sin(angle)), (x + l * math.cos(phi), 0, 0)]


def turned(q, v):
    w, x, y, z = q
    a = 2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])
    return (v[0] + w * a[0] + y * a[2] - z * a[1], v[1] + w * a[1] + z * a[0] - x * a[2], v[2] + w * a[2] + x * a[1] - y * a[0])


def about_a_point(q, spin, inertia, weight, points, t, steps):
    """A body about a fixed point of it: spin in body axes, `weight` m g l with the centre on its z axis."""
    def f(y):
        w, x, yy, z, a, b, c = y
        down = turned((w, -x, -yy, -z), (0, 0, -weight))
        i, j, k = inertia
        return [(-x * a - yy * b - z * c) / 2, (w * a + yy * c - z * b) / 2, (w * b + z * a - x * c) / 2, (w * c + x * b - yy * a) / 2,
                ((j - k) * b * c - down[1]) / i, ((k - i) * c * a + down[0]) / j, (i - j) * a * b / k]
    y = extrapolated(f, [*q, *spin], t, steps)
    return [turned(y[:4], p) for p in points]


def top(t, steps=300):
    half = math.radians(15)
    return about_a_point((math.cos(half), 0, math.sin(half), 0), (0, 0, 40), (0.35, 0.35, 0.05), G / 2, [(0.2, 0, 1)], t, steps)


def free_body(t, steps=100):
    return about_a_point((1, 0, 0, 0), (0.1, 2, 0.1), (1, 2, 3), 0, [(1, 0, 0), (0, 1, 0)], t, steps)


def blocks(t):
    def way(mu):
        up = G * (0.5 + mu * math.sqrt(0.75))
        rest = min(t, 3 / up)
        back = max(G * (0.5 - mu * math.sqrt(0.75)), 0) * (t - rest) ** 2 / 2
        return -3 * rest + up * rest ** 2 / 2 + back
    return [(way(0.8), 0.5, 0.05), (way(0.3), -0.5, 0.05)]


def rolling(t, v=7, mu=0.3, r=0.5):
    slides = min(t, 2 * v / (7 * mu * G))
    way = v * slides - mu * G * slides ** 2 / 2 + 5 / 7 * v * (t - slides)
    angle = 2.5 * mu * G / r * slides ** 2 / 2 + 5 / 7 * v / r * (t - slides)
    s = r * math.sin(angle)
    return [(0.6 * way, 0.8 * way, r), (0.6 * (way + s), 0.8 * (way + s), r + r * math.cos(angle))]


def bounces(t, e=0.5):
    fall = math.sqrt(2 / G)
    if t < fall:
        return [(0, 0, 1.1 - G * t * t / 2)]
    start, v = fall, e * G * fall
    while t > start + 2 * v / G and v > 1e-12:
        start, v = start + 2 * v / G, v * e
    return [(0, 0, 0.1 + max(v * (t - start) - G * (t - start) ** 2 / 2, 0))]


def spin(t, e=0.5, mu=0.2, r=0.1):
    """Impacts by Newton's law and Coulomb's: the impulse along the floor ends the slip, or is that of friction."""
    x, v, w, angle, z, u, now = -0.5, 1.0, -50.0, 0.0, 1.0, 0.0, 0.0
    while True:
        flight = (u + math.sqrt(u * u + 2 * G * (z - r))) / G
        d = min(flight, t - now)
        x, angle, now = x + v * d, angle + w * d, now + d
        z, u = z + u * d - G * d * d / 2, u - G * d
        if d < flight:
            return [(x, 0, z), (x + 0.1 * math.cos(angle), 0, z - 0.1 * math.sin(angle))]
        slip, bound = v - w * r, mu * (1 + e) * -u
        push = max(-bound, min(bound, -2 / 7 * slip))
        z, u, v, w = r, -e * u, v + push, w - push / (0.4 * r)


def collisions(t, r=0.1):
    """Frictionless balls: the next pair to touch exchanges momentum along the line of centres."""
    m, x, v, now = (1, 2, 3), [(0, 0), (1, 0.1), (1.85, 0.5)], [(2, 0), (0, 0), (0, 0)], 0.0
    while True:
        first = (t - now, None)
        for i, j in ((0, 1), (0, 2), (1, 2)):
            p, q = (complex(*x[j]) - complex(*x[i])), (complex(*v[j]) - complex(*v[i]))
            b, a = (p * q.conjugate()).real, abs(q) ** 2
            root = b * b - a * (abs(p) ** 2 - 4 * r * r)
            if b < 0 < root:
                first = min(first, (abs(p) ** 2 - 4 * r * r) / (-b + math.sqrt(root)) and
                            ((abs(p) ** 2 - 4 * r * r) / (-b + math.sqrt(root)), (i, j)))
        d, pair = first
        x, now = [(p[0] + d * q[0], p[1] + d * q[1]) for p, q in zip(x, v)], now + d
        if pair is None:
            return [(*p, 0) for p in x]
        i, j = pair
        n = [(b - a) / (2 * r) for a, b in zip(x[i], x[j])]
        push = 2 / (1 / m[i] + 1 / m[j]) * sum((a - b) * c for a, b, c in zip(v[i], v[j], n))
        v[i] = tuple(a - push / m[i] * c for a, c in zip(v[i], n))
        v[j] = tuple(a + push / m[j] * c for a, c in zip(v[j], n))


def ladder(t, steps=100):
    """Angle from the floor, from rest at 70 degrees. It leaves the wall where sin is 2/3 of that at the start; from there
    on the centre keeps its speed along the floor."""
    on_wall = lambda y: [y[1], -1.5 * G * math.cos(y[0])]
    start = math.radians(70)
    leaves = math.asin(2 / 3 * math.sin(start))
    time = 0.5
    for _ in range(30):
        y = extrapolated(on_wall, [start, 0], time, steps)
        time -= (y[0] - leaves) / y[1]
    y, x = extrapolated(on_wall, [start, 0], min(t, time), steps), None
    x = 0.05 + math.cos(y[0]) / 2
    if t > time:
        x += -math.sin(y[0]) / 2 * y[1] * (t - time)
        y = extrapolated(lambda y: [y[1], (math.sin(y[0]) * y[1] ** 2 / 4 - G / 2) * math.cos(y[0]) /
                                    (1 / 12 + math.cos(y[0]) ** 2 / 4)], y, t - time, steps)
    return [(x, 0, 0.05 + math.sin(y[0]) / 2)]


CENTRE = (0, 0, 0)
SCENES = {
    'pendulum': ([('rod', (0.5, 0, 0))], 1, pendulum),
    'double_pendulum': ([('lower', (0.5, 0, 0))], 1, double_pendulum),
    'slider_crank': ([('coupler', CENTRE), ('slider', CENTRE)], 1, slider_crank),
    'top': ([('top', (0.2, 0, 0.5))], 1, top),
    'free_body': ([('body', (1, 0, 0)), ('body', (0, 1, 0))], 1, free_body),
    'wall': ([('bob', CENTRE)], 1, wall),
    'blocks': ([('stops', CENTRE), ('slides back', CENTRE)], 1, blocks),
    'rolling': ([('ball', CENTRE), ('ball', (0, 0, 0.5))], 1, rolling),
    'bounces': ([('ball', CENTRE)], 1, bounces),
    'spin': ([('ball', CENTRE), ('ball', (0.1, 0, 0))], 1, spin),
    'collisions': ([('ball 1', CENTRE), ('ball 2', CENTRE), ('ball 3', CENTRE)], 1, collisions),
    'ladder': ([('ladder', CENTRE)], 1, ladder),
}
