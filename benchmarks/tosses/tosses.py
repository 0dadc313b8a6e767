#!/usr/bin/env python3
"""Recorded throws of a cube beside the motion that engines compute from how it was thrown. SPDX-License-Identifier: BSD-3-Clause

    git clone https://github.com/DAIRLab/contact-nets
    nice ninja -C build/release peers
    python3 benchmarks/tosses/tosses.py build/release/benchmarks/peers contact-nets/data [--fitted N] [--tested N] [--jobs N]

The throws are those of Pfrommer, Halm and Posa (CoRL 2020). Position, velocity and spin at the first frame are the best
fit to the frames in which the cube flies freely, the same for each engine. The coefficients of friction and restitution
and the setting of each engine are those of the least error over the fitted throws; the tables are of the others."""
import argparse
import collections
import concurrent.futures
import itertools
import json
import math
import os
import pathlib
import pickle
import statistics
import struct
import subprocess
import sys
import tempfile

import numpy

SAMPLES = 10  # as kSamples of peers/peer.hpp
HALF = 0.0524  # m; lengths of the data are in parts of it
GRAVITY = 9.81
FRICTION = (0.1, 0.14, 0.18, 0.22, 0.26)
RESTITUTION = (0, 0.06, 0.125, 0.2, 0.3)
TIPS = numpy.array([[0, 0, 0], [HALF, 0, 0], [0, HALF, 0]])
CORNERS = HALF * numpy.array(list(itertools.product((-1, 1), repeat=3)))
# Engine: (program, its settings; the value is a tolerance, or steps in each tenth of a throw).
ENGINES = {
    'Tether, events': ('tether_peer', [('event', 1e-6)]),
    'Tether, steps': ('tether_peer', [('steps', 10), ('steps', 40)]),
    'Bullet': ('bullet_peer', [(s, n) for s in ('defaults', '1000 iterations', 'Dantzig', 'Dantzig, no contact ahead') for n in (10, 40)]),
}


class Unpickler(pickle.Unpickler):
    """Reads a tensor that torch.save has written. Its storage is named; nothing in the file is called."""

    def find_class(self, module, name):
        if (module, name) == ('torch._utils', '_rebuild_tensor_v2'):
            return lambda *parts: parts
        if (module, name) == ('collections', 'OrderedDict'):
            return collections.OrderedDict
        if module == 'torch':
            return name
        raise pickle.UnpicklingError(f'{module}.{name} is not a part of a tensor')

    def persistent_load(self, name):
        return name


def frames(file):
    """Rows of a throw: position, quaternion (w, x, y, z), velocity, spin in body axes, control."""
    with open(file, 'rb') as stream:
        for _ in range(3):  # what marks the format
            Unpickler(stream).load()
        _, offset, (_, rows, columns), stride, *_ = Unpickler(stream).load()
        Unpickler(stream).load()  # keys of the storages: one
        count, = struct.unpack('<q', stream.read(8))
        data = stream.read(8 * count)
    if offset or stride[1:] != (columns, 1) or columns < 7 or len(data) != 8 * count or count < rows * columns:
        raise ValueError('must hold one tensor of rows of at least 7 numbers, in doubles')
    numbers = numpy.frombuffer(data)
    if not numpy.isfinite(numbers).all():
        raise ValueError('a number is not finite')
    return numbers[:rows * columns].reshape(rows, columns)


def matrix(q):
    w, x, y, z = q / numpy.linalg.norm(q)
    return numpy.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def turn(R):
    """The vector about which, and by whose length in radians, R turns."""
    angle = math.acos(max(-1, min(1, (numpy.trace(R) - 1) / 2)))
    axis = numpy.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return axis * (angle / (2 * math.sin(angle)) if angle > 1e-9 else 0.5)


class Toss:
    """x (m) and R by frame, and v, w (world axes) at the first one."""

    def __init__(self, file, step, every=1):
        self.file, rows = file, frames(file)
        self.x, self.R = HALF * rows[:, :3], [matrix(q) for q in rows[:, 3:7]]
        self.end = step * (len(rows) - 1)
        lowest = [min(x[2] + (R @ corner)[2] for corner in CORNERS) for x, R in zip(self.x, self.R)]
        clear = 0.1 * HALF
        flight = next((k for k, low in enumerate(lowest) if low < clear), len(rows))
        self.flies = numpy.arange(0, flight, every)
        if not self.is_usable():
            return
        t = step * self.flies
        drop = numpy.outer(t * t, [0, 0, -GRAVITY / 2])
        self.start, self.v = numpy.linalg.lstsq(numpy.stack([t ** 0, t], 1), self.x[self.flies] - drop, rcond=None)[0]
        self.w = sum(turn(self.R[b] @ self.R[a].T) for a, b in zip(self.flies, self.flies[1:])) / t[-1]

    def is_usable(self):
        return len(self.flies) >= 3

    def points(self):
        """Centre and tips at each sample, between two frames."""
        out = []
        for sample in range(1, SAMPLES + 1):
            at = sample * (len(self.R) - 1) / SAMPLES
            k = min(int(at), len(self.R) - 2)
            a, b = (self.x[i] + TIPS @ self.R[i].T for i in (k, k + 1))
            out.append(a + (at - k) * (b - a))
        return numpy.array(out)


def scene(toss, cube, friction, restitution):
    R, row = toss.R[0], lambda v: '[' + ', '.join(f'{x:.17g}' for x in v) + ']'
    about = turn(R)
    angle = numpy.linalg.norm(about)
    if angle > math.pi - 1e-6:  # the axis is that of the largest diagonal entry
        about = (R + numpy.eye(3))[:, numpy.argmax(numpy.diag(R))]
    return f'''[scene]
name = "toss"
end = {toss.end:.17g}
gravity = [0, 0, {-GRAVITY}]

[[body]]
name = "floor"
fixed = true
shape = "plane"
material = "floor"

[[body]]
name = "cube"
shape = "box"
size = {row([2 * HALF] * 3)}
mass = {cube['mass']:.17g}
inertia = {row([cube['inertia'] * HALF ** 2] * 3)}
position = {row(toss.start)}
velocity = {row(toss.v)}
angular_velocity = {row(toss.w)}
orientation = {{ axis = {row(about if angle > 0 else (0, 0, 1))}, deg = {math.degrees(angle):.17g} }}
material = "cube"

[[pair]]
between = ["floor", "cube"]
friction = {friction}
restitution = {restitution}
'''


def run(program, setting, value, toss, cube, friction, restitution):
    """Centre and tips at each sample, m."""
    words = [word for tip in TIPS for word in ('cube', *map(str, tip))]
    with tempfile.NamedTemporaryFile('w', suffix='.toml') as file:
        file.write(scene(toss, cube, friction, restitution))
        file.flush()
        done = subprocess.run([program, file.name, setting, repr(value), '1', *words], capture_output=True, text=True, timeout=60)
    if done.returncode:
        raise RuntimeError(done.stderr.strip() or f'{program}: exit code {done.returncode}')
    return numpy.array([float(x) for x in done.stdout.split()[1:]]).reshape(SAMPLES, 3, 3)


def errors(found, wanted):
    """Mean distance of the points over the samples (mm); at the end the distance of the centre (mm) and the angle (degrees)."""
    def axes(points):
        a, b = (points[1:] - points[0]) / HALF
        return numpy.stack([a, b, numpy.cross(a, b)], 1)
    angle = numpy.linalg.norm(turn(axes(found[-1]) @ axes(wanted[-1]).T))
    return (1e3 * numpy.linalg.norm(found - wanted, axis=2).mean(), 1e3 * numpy.linalg.norm(found[-1][0] - wanted[-1][0]),
            math.degrees(angle))


def motions(pool, tosses, program, setting, value, cube, friction, restitution):
    return list(pool.map(lambda toss: run(program, setting, value, toss, cube, friction, restitution), tosses))


def fit(pool, program, settings, tosses, cube):
    """The setting and the coefficients of the least mean distance over the tosses."""
    def cost(choice):
        (setting, value), mu, e = choice
        found = motions(pool, tosses, program, setting, value, cube, mu, e)
        return statistics.mean(errors(motion, toss.points())[0] for motion, toss in zip(found, tosses))
    (setting, value), mu, e = min(itertools.product(settings, FRICTION, RESTITUTION), key=cost)
    return setting, value, mu, e


def line(name, found, wanted):
    cells = [f'{statistics.median(c):.3g} ({statistics.quantiles(c, n=4)[2]:.3g})'
             for c in zip(*(errors(*pair) for pair in zip(found, wanted)))]
    print(f'| {name} | ' + ' | '.join(cells) + ' |', flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('programs', type=pathlib.Path)
    parser.add_argument('data', type=pathlib.Path, help='with params_processed and tosses_processed')
    parser.add_argument('--fitted', type=int, default=100)
    parser.add_argument('--tested', type=int, default=None)
    parser.add_argument('--jobs', type=int, default=os.cpu_count())
    arguments = parser.parse_args()
    file = arguments.data / 'params_processed' / 'experiment.json'
    try:
        cube = json.loads(file.read_text())
        cube = {key: float(cube[key]) for key in ('dt', 'mass', 'inertia')}
        files = sorted((arguments.data / 'tosses_processed').glob('*.pt'), key=lambda file: int(file.stem))
        tosses = []
        for file in files:
            tosses.append(Toss(file, cube['dt']))
    except (OSError, EOFError, KeyError, TypeError, ValueError, struct.error, pickle.UnpicklingError) as error:
        return f'tosses.py: {file}: {type(error).__name__}: {error}'
    tosses = [toss for toss in tosses if toss.is_usable()]
    fitted, tested = tosses[:arguments.fitted], tosses[arguments.fitted:][:arguments.tested]
    if len(tested) < 2:
        return f'tosses.py: {len(tosses)} throws begin in free flight; two more than {arguments.fitted} are needed'
    print(f'{len(files)} throws, of which {len(tosses)} begin with three frames in free flight; {len(fitted)} fitted, {len(tested)} tested.'
          '\n\n| engine | setting | friction | restitution | distance, mm | position at the end, mm | angle at the end, degrees |\n'
          '|---|---|---|---|---|---|---|')
    recorded = [toss.points() for toss in tested]
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        for engine, (name, settings) in ENGINES.items():
            program = arguments.programs.resolve() / name
            if not program.exists():
                print(f'| {engine} | no {name} | - | - | - | - | - |')
                continue
            setting, value, mu, e = fit(pool, program, settings, fitted, cube)
            found = motions(pool, tested, program, setting, value, cube, mu, e)
            chosen = f'{engine} | {setting}, {value:g} | {mu} | {e}'
            line(chosen, found, recorded)
            if setting == 'event':
                pairs = [(thin, motion) for thin, motion in zip((Toss(toss.file, cube['dt'], 2) for toss in tested), found)
                         if thin.is_usable()]
                again = motions(pool, [thin for thin, _ in pairs], program, setting, value, cube, mu, e)
                line(chosen.replace(engine, 'The same beside itself, started from every other frame'), again, [motion for _, motion in pairs])
    return os.EX_OK


if __name__ == '__main__':
    sys.exit(main())
