#!/usr/bin/env python3
"""Slider-crank with clearance: cost at equal error of events, steps and sub-steps with an accuracy, and of Siconos
where its example is built. SPDX-License-Identifier: BSD-3-Clause

    python3 benchmarks/clearance/clearance.py TETHER [--siconos FOLDER]

TETHER: the program. FOLDER: holds `slider_crank`, the example SliderCrankMoreauJeanOSI.cpp of
siconos-tutorials with its time step and end as arguments. Prints a table of work and
of the largest error of the three angles at the end, rad, against events at 1e-12.
"""
import argparse
import csv
import math
import os
import re
import subprocess
import tempfile

END = 0.02
BODIES = ('crank', 'rod', 'slider')
SCENE = os.path.join(os.path.dirname(os.path.abspath(__file__)), '../../examples/scenes/clearance.toml')


def scene(engine, settings):
    text = open(SCENE).read().split('[[expect]]')[0]
    text = re.sub(r'\[event\]\ntolerance = \S+', f'[{engine}]\n{settings}', text)
    return text.replace('engine = "event"', f'engine = "{engine}"')


def run(tether, engine, settings):
    """Angles at the end, and the work that the program tells."""
    with tempfile.TemporaryDirectory() as folder:
        toml, rows = os.path.join(folder, 'run.toml'), os.path.join(folder, 'run.csv')
        with open(toml, 'w') as file:
            file.write(scene(engine, settings))
        told = subprocess.run([tether, 'run', toml, '--csv', rows], check=True, text=True,
                              stdout=subprocess.PIPE).stdout
        with open(rows) as file:
            last = list(csv.DictReader(file))[-1]
    angles = [-2 * math.atan2(float(last[f'{b}.qy']), float(last[f'{b}.qw'])) for b in BODIES]
    number = lambda pattern: int(re.search(pattern, told).group(1))
    if engine == 'event':
        return angles, (f'{number("([0-9]+) residuals")} evaluations, '
                        f'{number("([0-9]+) contact problems")} problems')
    return angles, f'{number("([0-9]+) contact problems")} problems'


def siconos(folder, step):
    subprocess.run(['./slider_crank', str(step), str(END)], cwd=folder, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL)
    with open(os.path.join(folder, 'result.dat')) as file:
        rows = [line.split() for line in file.readlines()[1:] if line.strip()]
    last = [float(x) for x in min(rows, key=lambda row: abs(float(row[0]) - END))]
    newton = sum(int(float(row[25])) for row in rows)
    return [2 * math.pi * last[1], last[2], last[3]], f'{newton} problems'


def error(angles, reference):
    return max(abs(math.remainder(a - b, 2 * math.pi)) for a, b in zip(angles, reference))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('tether')
    parser.add_argument('--siconos', metavar='FOLDER')
    arguments = parser.parse_args()
    reference, _ = run(arguments.tether, 'event', 'tolerance = 1e-12')

    def show(name, angles, work, of=reference):
        print(f'| {name} | {work} | {error(angles, of):.1e} |', flush=True)

    print('| | work | error / rad |\n|---|---|---|')
    for tolerance in (1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10):
        show(f'events, {tolerance:g}', *run(arguments.tether, 'event', f'tolerance = {tolerance}'))
    for accuracy in (1e-2, 1e-4, 1e-6):
        show(f'accuracy {accuracy:g}',
             *run(arguments.tether, 'stepping', f'step = 1e-4\naccuracy = {accuracy}'))
    for step in (1e-4, 1e-5, 1e-6):
        show(f'steps of {step:g} s', *run(arguments.tether, 'stepping', f'step = {step}'))
    if not arguments.siconos:
        return
    found = {step: siconos(arguments.siconos, step) for step in (1e-4, 1e-5, 1e-6, 2e-7)}
    # Order 1: from its two smallest steps.
    small, large = found[2e-7][0], found[1e-6][0]
    limit = [s + (s - l) / 4 for s, l in zip(small, large)]
    for step, (angles, work) in found.items():
        show(f'Siconos, steps of {step:g} s', angles, work)
        if step > 2e-7:
            show('  the same, against where its steps lead', angles, work, limit)


if __name__ == '__main__':
    main()
