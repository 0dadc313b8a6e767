# Writes a scene: spheres of 10 cm in layers 20 cm apart, 1e5 by default, that fall into a bin as wide as they are.
# SPDX-License-Identifier: BSD-3-Clause
#
#   python3 pour.py [along x = 130] [along y = 130] [layers = 6] [seconds = 6] > pour.toml
#   tether run pour.toml
#
# Places are off a lattice by up to 3.5 mm at random, the same ones each time. At most 60 sweeps a step, and whatever
# they end with is taken: the next step goes on from there, and what comes to rest is solved to the tolerance. Spins
# decay by 6/s, since without rolling resistance a sphere on a floor rolls for ever.
import random
import sys

x, y, layers, end = [float(a) for a in sys.argv[1:]] + [130, 130, 6, 6][len(sys.argv) - 1:]
x, y, layers = int(x), int(y), int(layers)
PITCH, UP, OFF = 0.107, 0.2, 0.0035  # m

print(f"""[scene]
name = "pour"
end = {end:g}
gravity = [0, 0, -9.81]

[stepping]
step = 5e-3
tolerance = 1e-6
max_sweeps = 60
max_halvings = 0
on_failure = "warn"

[output]
every = 0.05

[[pair]]
between = ["glass", "steel"]
friction = 0.3

[[pair]]
between = ["glass", "glass"]
friction = 0.4
""")

for name, normal, position in [
    ("floor", [0, 0, 1], [0, 0, 0]),
    ("west", [1, 0, 0], [0, 0, 0]),
    ("east", [-1, 0, 0], [x * PITCH, 0, 0]),
    ("south", [0, 1, 0], [0, 0, 0]),
    ("north", [0, -1, 0], [0, y * PITCH, 0]),
]:
    print(f"""[[body]]
name = "{name}"
shape = "plane"
fixed = true
normal = {normal}
position = {position}
material = "steel"
""")

random.seed(16)
for k in range(layers):
    for j in range(y):
        for i in range(x):
            lattice = [(i + 0.5) * PITCH, (j + 0.5) * PITCH, 0.06 + k * UP]
            position = [round(each + random.uniform(-OFF, OFF), 6) for each in lattice]
            print(f"""[[body]]
name = "ball {i}.{j}.{k}"
shape = "sphere"
radius = 0.05
density = 2500
position = {position}
material = "glass"
drag = {{ rotational = 8e-3 }}
""")
