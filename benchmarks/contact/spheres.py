# Parts of scenes of 1e5 spheres, for pour.py and hopper.py. SPDX-License-Identifier: BSD-3-Clause
#
# At most 60 sweeps a step, and whatever they end with is taken: the next step goes on from there, and what comes to
# rest is solved to the tolerance. Spins decay by 6/s, since without rolling resistance a sphere on a floor rolls for
# ever.


def scene(name, end):
    print(f"""[scene]
name = "{name}"
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


# more: its shape and where it stands.
def fixed(name, more):
    print(f"""[[body]]
name = "{name}"
fixed = true
material = "steel"
{more}
""")


def ball(name, position):
    print(f"""[[body]]
name = "{name}"
shape = "sphere"
radius = 0.05
density = 2500
position = {[round(each, 6) for each in position]}
material = "glass"
drag = {{ rotational = 8e-3 }}
""")
