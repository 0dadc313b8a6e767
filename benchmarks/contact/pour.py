# Writes a scene: spheres of 10 cm in layers 20 cm apart, 1e5 by default, that fall into a bin as wide as they are.
# SPDX-License-Identifier: BSD-3-Clause
#
#   python3 pour.py [along x = 130] [along y = 130] [layers = 6] [seconds = 13] > pour.toml
#   tether run pour.toml
#
# Places are off a lattice by up to 3.5 mm at random, the same ones each time.
import random
import sys

from spheres import ball, fixed, scene

x, y, layers, end = [float(a) for a in sys.argv[1:]] + [130, 130, 6, 13][len(sys.argv) - 1:]
x, y, layers = int(x), int(y), int(layers)
PITCH, UP, OFF = 0.107, 0.2, 0.0035  # m

scene("pour", end)
for name, normal, position in [
    ("floor", [0, 0, 1], [0, 0, 0]),
    ("west", [1, 0, 0], [0, 0, 0]),
    ("east", [-1, 0, 0], [x * PITCH, 0, 0]),
    ("south", [0, 1, 0], [0, 0, 0]),
    ("north", [0, -1, 0], [0, y * PITCH, 0]),
]:
    fixed(name, f'shape = "plane"\nnormal = {normal}\nposition = {position}')

random.seed(16)
for k in range(layers):
    for j in range(y):
        for i in range(x):
            lattice = [(i + 0.5) * PITCH, (j + 0.5) * PITCH, 0.06 + k * UP]
            ball(f"ball {i}.{j}.{k}", [each + random.uniform(-OFF, OFF) for each in lattice])
