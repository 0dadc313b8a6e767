#!/usr/bin/env python3
"""The IFToMM benchmark's mechanisms (A01 to A05) and a rope ladder: error, energy and processor time over tolerances,
as a table of benchmarks/results/iftomm.md. SPDX-License-Identifier: BSD-3-Clause

    python3 benchmarks/mechanisms/iftomm.py TETHER [--tolerances 1e-4,1e-6,1e-8] [--rods 1,10,100] [--repeats 3]

TETHER: the program. Scenes are those of examples/scenes, with the benchmark's ends and without their [[expect]];
errors are those of the values below at their times: closed forms and quadratures (scene files tell which), an
absolute error of positions in m, of angular velocities relative to the value. Time is that of the program, reading and
output included, the least of the repeats. --rods: the row of four-bars of that many loops to t = 1 instead, behind the
point where all of them are in line.
"""
import argparse
import csv
import math
import os
import re
import resource
import subprocess
import sys
import tempfile

SCENES = os.path.join(os.path.dirname(os.path.abspath(__file__)), '../../examples/scenes')


def four_bars(loops, theta):
    """Centre of the last level rod, whose left end is B_(loops-1), at the angle theta = (x, y) of B_0."""
    return 'position', f'level {loops}', [loops - 0.5 + theta[0], 0, theta[1]], 1.0


# name, file, end, [(time, quantity, body, value, scale)]; a motor drives A03, dampers slow A05 down: no energy is kept.
DRIVEN = ('andrews', 'governor')
MECHANISMS = [
    ('A01 pendulum, 10 s', 'pendulum', 10, [(10, 'position', 'bob', [0.275087462576117, 0, -0.961419205099125], 1.0)]),
    ('A02 two four-bars, 10 s', 'n_four_bars:2', 10,
     [(1, *four_bars(2, (-0.195020301949435, -0.980799205662174))),
      (10, *four_bars(2, (0.328458111540815, 0.944518538178601)))]),
    ('A02 forty four-bars, 20 s', 'n_four_bars:40', 20,
     [(1, *four_bars(40, (-0.115356880632110, -0.993324111300450))),
      (20, *four_bars(40, (0.410901153762945, 0.911679900971981)))]),
    ('A03 Andrews, 0.05 s', 'andrews', 0.05,
     [(0.05, 'angular_velocity', 'crank', [0, 0, 1144.535502653847], 1144.5)]),
    ('A04 Bricard, 10 s', 'bricard', 10, [(1, 'kinetic_energy', None, [4.1455439080], 29.43),
                                          (10, 'kinetic_energy', None, [0.0026383048], 29.43)]),
    ('A05 governor, 10 s', 'governor', 10,
     [(5, 'position', 'slider', [0, 0, 0.535563103722], 1.0), (10, 'position', 'slider', [0, 0, 0.619622917061], 1.0),
      (10, 'angular_velocity', 'slider', [0, 0, 5.548203622655], 5.548)]),
    ('rope ladder, 0.1 s', 'ladder', 0.1, [(0.1, 'position', 'rung 100', [9.995776966326, 0.15, -0.04905], 1.0)]),
]


def scene(name, end, tolerance, values):
    """The text of a scene with another end and tolerance, and with our expectations, all of them met."""
    name, _, loops = name.partition(':')
    text = open(os.path.join(SCENES, name + '.toml')).read().split('[[expect]]')[0]
    text = re.sub(r'(?m)^end = .*$', f'end = {end}', text)
    text = re.sub(r'(?m)^tolerance = .*$', f'tolerance = {tolerance}', text)
    text = re.sub(r'(?m)^(every|csv|svg|vtk) = .*$', '', text)
    if loops:
        text = text.replace('count = 41', f'count = {int(loops) + 1}').replace('count = 40', f'count = {loops}')
    for time, quantity, body, value, _ in values:
        shown = value if len(value) > 1 else value[0]
        text += f'\n[[expect]]\ntime = {time}\nquantity = "{quantity}"\nvalue = {shown}\nwithin = 1e300\n'
        text += f'body = "{body}"\n' if body else ''
    return text


def run(tether, text, values):
    """Largest error, change of energy, steps, processor time of one run; None where it ends early."""
    with tempfile.TemporaryDirectory() as folder:
        toml, table = os.path.join(folder, 'scene.toml'), os.path.join(folder, 'table.csv')
        with open(toml, 'w') as file:
            file.write(text)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        told = subprocess.run([tether, 'sweep', toml, '--vary', 'smooth.max_step=0', '--jobs', '1', '--quiet',
                               '--out', table], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if told.returncode > 1:
            print(told.stdout, file=sys.stderr)
            return None
        with open(table) as file:
            row = next(csv.DictReader(file))
    if row['failure']:
        print(row['failure'], file=sys.stderr)
        return None
    error = 0.0
    for time, quantity, body, value, scale in values:
        stem = (f'{body}.' if body else '') + quantity
        names = [f'{stem}[{i + 1}]@{time}' for i in range(len(value))] if len(value) > 1 else [f'{stem}@{time}']
        error = max(error, *(abs(float(row[n]) - v) / scale for n, v in zip(names, value)))
    change = max(abs(float(row['lowest_change_J'])), abs(float(row['largest_change_J'])))
    return error, change, int(row['steps']), after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def measure(tether, file, end, tolerance, values, repeats):
    runs = [run(tether, scene(file, end, tolerance, values), values) for _ in range(repeats)]
    if None in runs:
        return None
    return (*runs[0][:3], min(r[3] for r in runs))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('tether')
    parser.add_argument('--tolerances', default='1e-4,1e-6,1e-8')
    parser.add_argument('--rods', default='')
    parser.add_argument('--repeats', type=int, default=3)
    args = parser.parse_args()
    jobs = MECHANISMS
    if args.rods:
        jobs = []
        for loops in map(int, args.rods.split(',')):
            jobs.append((f'{loops} four-bars, 1 s', f'n_four_bars:{loops}', 1,
                         [(1, *four_bars(loops, swing(loops)))]))
    print('| mechanism | tolerance | steps | error | energy, J | processor, s |\n|---|---|---|---|---|---|')
    for name, file, end, values in jobs:
        for tolerance in args.tolerances.split(','):
            got = measure(args.tether, file, end, tolerance, values, args.repeats)
            if got is None:
                print(f'| {name} | {tolerance} | ended early | | | |', flush=True)
                continue
            energy = '' if file in DRIVEN else '%.1e' % got[1]
            told = '%d | %.1e | %s | %.3g' % (got[2], got[0], energy, got[3])
            print(f'| {name} | {tolerance} | {told} |', flush=True)


def swing(loops, steps=20000):
    """(sin th, cos th) at t = 1: (4N+1)/3 th'' = g (3N+1)/2 sin th, th(0) = 0, th'(0) = 1, by RK4."""
    factor = 9.81 * (3 * loops + 1) / 2 / ((4 * loops + 1) / 3)
    h, theta, rate = 1.0 / steps, 0.0, 1.0
    for _ in range(steps):
        a1, v1 = factor * math.sin(theta), rate
        a2, v2 = factor * math.sin(theta + h / 2 * v1), rate + h / 2 * a1
        a3, v3 = factor * math.sin(theta + h / 2 * v2), rate + h / 2 * a2
        a4, v4 = factor * math.sin(theta + h * v3), rate + h * a3
        theta += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
        rate += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return math.sin(theta), math.cos(theta)


if __name__ == '__main__':
    main()
