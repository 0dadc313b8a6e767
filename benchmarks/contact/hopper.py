# Writes a scene: spheres of 10 cm, 1e5 by default, fall through the hopper of examples/scenes/hopper.toml, eight times
# as large, into its bin. SPDX-License-Identifier: BSD-3-Clause
#
#   python3 hopper.py [times = 8] [in a row = 40] [layers = 62] [seconds = 12] > hopper.toml
#   tether run hopper.toml
#
# Each ball stands a little beside the one below it, so that no column balances.
import sys

from spheres import ball, fixed, scene

times, row, layers, end = [float(a) for a in sys.argv[1:]] + [8, 40, 62, 12][len(sys.argv) - 1:]
row, layers = int(row), int(layers)


def box(name, size, position, turn=""):
    size, position = ([round(times * each, 7) for each in of] for of in (size, position))
    fixed(name, f'shape = "box"\nsize = {size}\nposition = {position}{turn}')


scene("hopper", end)
fixed("floor", 'shape = "plane"')
for name, x, y in [("east", 1, 0), ("west", -1, 0), ("north", 0, 1), ("south", 0, -1)]:
    plate, wall = ([1.3, 2, 0.1], [0.1, 1.4, 0.5]) if x else ([2, 1.3, 0.1], [1.2, 0.1, 0.5])
    turn = f"\norientation = {{ axis = {[abs(y), abs(x), 0]}, deg = {55 * (y - x)} }}"
    box("plate " + name, plate, [0.6637823 * x, 0.6637823 * y, 1.40377], turn)
    box("bin " + name, wall, [0.65 * x, 0.65 * y, 0.25])

start = 0.5 * 0.105 * (row - 1)
for k in range(layers):
    for j in range(row):
        for i in range(row):
            x = 0.105 * i - 0.002 * j + 0.001 * k - start
            y = 0.002 * i + 0.105 * j - 0.001 * k - start
            ball(f"ball {i}.{j}.{k}", [x, y, 1.45 * times + 0.1003 * k])
