#!/usr/bin/env python3
"""Rigid motion with joints, friction and impacts: error against processor time of Tether's engines and of other engines, on
scenes with references. SPDX-License-Identifier: BSD-3-Clause

    nice ninja -C build/release peers
    python3 benchmarks/peers/peers.py build/release/benchmarks/peers [--scene A,B] [--limit S] [--repeats N] [--runs]

Each program runs each scene over a ladder of steps or tolerances, which ends with the first run that takes longer than
the limit. --runs adds a table of every run."""
import argparse
import functools
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys

import references

HERE = pathlib.Path(__file__).resolve().parent
SAMPLES = 10  # as kSamples of peer.hpp
LEVELS = (1e-2, 1e-3, 1e-4, 1e-6)
STEPS = [2 ** k for k in range(0, 21)]
TOLERANCES = [10.0 ** -k for k in range(2, 13)]
ACCURACIES = [10.0 ** -k for k in range(1, 9)]
# Settings for scenes without contacts, and those that differ from others with contacts only.
WITHOUT_CONTACT = {'smooth', 'smooth, energy kept', 'RungeKuttaMerson', 'CPodes'}
OF_CONTACT = {'1000 iterations, no contact ahead', 'RK4, 2 h', 'RK4, 4 h', 'Euler, 1 h', 'SemiExplicitEuler, PGS', 'SemiExplicitEuler, no projection'}
# Engine: (program, package, setting -> (its ladder, what it is)).
ENGINES = {
    'Tether': ('tether_peer', 'this project', {
        'smooth': (TOLERANCES, 'IDA with projection onto the joints; without contacts'),
        'smooth, energy kept': (TOLERANCES, 'as before, with `[[invariant]]` energy'),
        'event': (TOLERANCES, 'each impact and slip at its time'),
        'steps': (STEPS, 'steps of one length, cut at impacts'),
        'sub-steps by accuracy': (ACCURACIES, 'sub-steps with an error estimate, up to a quarter of a sample')}),
    'Bullet': ('bullet_peer', 'libbullet-dev', {
        'defaults': (STEPS, 'sequential impulses, 10 iterations; as in all settings, no threshold of restitution'),
        '1000 iterations': (STEPS, 'or fewer, to round-off; split impulse at every depth'),
        '1000 iterations, no contact ahead': (STEPS, 'gaps are no contacts, by `gContactBreakingThreshold`; else a bounce loses the speed '
                                              'that closes the gap'),
        'Dantzig': (STEPS, '`btMLCPSolver` with the direct solver; split impulse at every depth')}),
    'ODE': ('ode_peer', 'libode-dev', {
        'world step': (STEPS, 'direct solver, ERP 0.2; as in all settings, friction along the slip, `dContactApprox1`'),
        'world step, ERP 0.8': (STEPS, 'corrects positions sooner'),
        'quick step': (STEPS, '200 iterations')}),
    'MuJoCo': ('mujoco_peer', 'libmujoco-dev', {
        'defaults': (STEPS, 'semi-implicit Euler, pyramids, soft contacts of 0.02 s'),
        'RK4, 1 h': (STEPS, 'Newton to round-off, elliptic cones, `impratio` 100; contacts and loops are springs of the time 1 step, '
                     'with the damping that gives the restitution'),
        'RK4, 2 h': (STEPS, 'of 2 steps'), 'RK4, 4 h': (STEPS, 'of 4 steps'),
        'Euler, 1 h': (STEPS, 'semi-implicit Euler, else as RK4'), 'Euler, 4 h': (STEPS, 'of 4 steps'),
        'implicit, 4 h': (STEPS, 'Euler, implicit in the velocity')}),
    'Simbody': ('simbody_peer', 'libsimbody-dev', {
        'RungeKuttaMerson': (TOLERANCES, 'joint coordinates, accuracy; not with contacts, whose restitution would depend on the speed'),
        'CPodes': (TOLERANCES, 'as before, BDF'),
        'SemiExplicitEuler': (STEPS, 'rigid contacts, the impulse solver PLUS; thresholds of speeds 1e-6 m/s'),
        'SemiExplicitEuler, PGS': (STEPS, 'the impulse solver PGS'),
        'SemiExplicitEuler, no projection': (STEPS, 'positions stay as the velocities move them')}),
    'Siconos': ('siconos_peer', 'libsiconos-mechanics-dev', {
        'Moreau-Jean': (STEPS, 'theta 1/2, Gauss-Seidel and Newton to 1e-12, contacts at exact points'),
        'Moreau-Jean, projection': (STEPS, 'as before, positions projected onto the constraints')}),
}


def timed(program, scene, setting, value, arguments):
    """Processor time and the points at the samples; or what the program says."""
    watched, scale, _ = references.SCENES[scene]
    words = [word for body, point in watched for word in (body, *map(str, point))]
    try:
        done = subprocess.run([program, HERE / 'scenes' / f'{scene}.toml', setting, repr(value), str(arguments.repeats), *words],
                              capture_output=True, text=True, timeout=20 * arguments.limit * arguments.repeats + 5)
    except subprocess.TimeoutExpired:
        return None, 'no end'
    if done.returncode:
        return None, (done.stderr.strip().splitlines() or [f'exit code {done.returncode}'])[-1]
    time, *numbers = map(float, done.stdout.splitlines()[-1].split())
    wanted = reference(scene)
    error = max(math.dist(numbers[i:i + 3], wanted[i:i + 3]) for i in range(0, len(wanted), 3)) / scale
    return time, error


def text(scene):
    return (HERE / 'scenes' / f'{scene}.toml').read_text()


@functools.lru_cache
def reference(scene):
    end = float(re.search(r'^end = (.*)', text(scene), re.M).group(1))
    return [x for k in range(1, SAMPLES + 1) for point in references.SCENES[scene][2](end * k / SAMPLES) for x in point]


def ladder(program, scene, setting, values, arguments):
    """(value, time, error) of each run, and the last reason of a failure."""
    runs, reason = [], ''
    for value in values:
        time, error = timed(program, scene, setting, value, arguments)
        if time is None:
            reason = error
            if not runs and value != values[0] or error == 'no end':
                break
            continue
        runs.append((value, time, error if error == error else math.inf))
        if time > arguments.limit:
            break
    return runs, reason


def cell(runs, level):
    good = [time for _, time, error in runs if error <= level]
    return f'{1e3 * min(good):.3g}' if good else '-'


def table(scene, folder, arguments):
    """The tables of a scene, and engine -> level -> least time."""
    title = re.search(r'^name = "(.*)"', text(scene), re.M).group(1)
    out = [f'\n## {title[0].upper() + title[1:]}\n', '| engine | setting | least error, m | its time, ms |'
           + ''.join(f' {level:.0e} m |' for level in LEVELS), '|---|---|---|---|' + '---|' * len(LEVELS)]
    best, lines, reasons = {}, [], []
    for engine, (name, _, settings) in ENGINES.items():
        if not (folder / name).exists():
            continue
        for setting, (values, _) in settings.items():
            if setting in (WITHOUT_CONTACT if '[[pair]]' in text(scene) else OF_CONTACT):
                continue
            runs, reason = ladder(folder / name, scene, setting, values, arguments)
            if reason:
                reasons.append(f"\n{'Not all runs' if runs else 'No run'} of {engine}, {setting}: {reason}")
            if not runs:
                continue
            value, time, error = min(runs, key=lambda run: run[2])
            out.append(f'| {engine} | {setting} | {error:.1e} | {1e3 * time:.3g} | '
                       + ' | '.join(cell(runs, level) for level in LEVELS) + ' |')
            lines += [f'| {engine} | {setting} | {v:.3g} | {e:.2e} | {1e3 * t:.3g} |' for v, t, e in runs]
            for level in LEVELS:
                times = [t for _, t, e in runs if e <= level]
                best.setdefault(engine, {})[level] = min(times + [best.get(engine, {}).get(level, math.inf)])
    out += reasons
    if arguments.runs:
        out += ['\n| engine | setting | steps a sample, or tolerance | error, m | ms |\n|---|---|---|---|---|', *lines]
    return '\n'.join(out), best


def summary(bests):
    """Who reaches each error, and how soon; bold: the soonest."""
    print('\n## All scenes\n\nLeast time of each engine over all its settings, ms; bold: the least of all; -: not within the limit.\n\n'
          '| scene | error, m |' + ''.join(f' {engine} |' for engine in ENGINES) + '\n|---|---|' + '---|' * len(ENGINES))
    sooner = []
    for scene, best in bests.items():
        for level in LEVELS:
            times = [best.get(engine, {}).get(level, math.inf) for engine in ENGINES]
            shown = ['-' if t == math.inf else f'**{1e3 * t:.3g}**' if t == min(times) else f'{1e3 * t:.3g}' for t in times]
            print(f'| {scene} | {level:.0e} | ' + ' | '.join(shown) + ' |')
            first = list(ENGINES)[times.index(min(times))]
            if min(times) < math.inf and first != 'Tether':
                sooner.append(f'- {scene}, {level:.0e}: {first}, {times[0] / min(times):.2g} times as fast as Tether')
    print('\nWhere another engine is sooner than Tether:\n\n' + ('\n'.join(sooner) or '- nowhere'))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('folder', type=pathlib.Path)
    parser.add_argument('--scene', default=','.join(references.SCENES))
    parser.add_argument('--limit', type=float, default=0.05, help='s of a run')
    parser.add_argument('--repeats', type=int, default=3)
    parser.add_argument('--runs', action='store_true')
    arguments = parser.parse_args()
    arguments.folder = arguments.folder.resolve()
    unknown = [scene for scene in arguments.scene.split(',') if scene not in references.SCENES]
    if unknown:
        return f'peers.py: no scene is called {unknown[0]}; there are {", ".join(references.SCENES)}'
    for engine, (name, package, _) in ENGINES.items():
        if not (arguments.folder / name).exists():
            print(f'- {engine} is left out: no {name} ({package})')
        elif shutil.which('dpkg-query') and package.startswith('lib'):
            found = subprocess.run(['dpkg-query', '-W', package], capture_output=True, text=True).stdout
            print(f'- {engine}: Debian package', ' '.join(found.split()))
    tables = {scene: table(scene, arguments.folder, arguments) for scene in arguments.scene.split(',')}
    summary({scene: best for scene, (_, best) in tables.items()})
    print('\n## Settings\n\n| engine | setting | meaning |\n|---|---|---|')
    for engine, (_, _, settings) in ENGINES.items():
        for setting, (_, meaning) in settings.items():
            print(f'| {engine} | {setting} | {meaning} |')
    for shown, _ in tables.values():
        print(shown)
    return os.EX_OK


if __name__ == '__main__':
    sys.exit(main())
