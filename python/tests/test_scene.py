# SPDX-License-Identifier: BSD-3-Clause
import os
import tempfile
import unittest

import numpy as np
from tether import scene

BALL = """
[scene]
end = 1.5
gravity = [0, 0, -9.81]
engine = "event"
[event]
tolerance = 1e-8
[[body]]
name = "ball"
shape = "sphere"
radius = 0.1
mass = 1
position = [0, 0, 1.1]
material = "rubber"
[[body]]
name = "floor"
fixed = true
shape = "plane"
material = "stone"
[[pair]]
between = ["rubber", "stone"]
friction = 0.3
restitution = 0.5
"""


def shipped(name):
    return os.path.join(os.environ["TETHER_SOURCE"], "examples", "scenes", name)


class Runs(unittest.TestCase):
    def test_a_ball_falls_and_bounces(self):
        s = scene.parse(BALL)
        self.assertEqual(s.bodies, ["ball", "floor"])
        r = s.run(every=0.01)
        self.assertEqual((r.failure, r.engine), ("", "event"))
        self.assertEqual(r.position.shape, (len(r.t), 2, 3))
        falling = r.t < 0.45
        np.testing.assert_allclose(
            r.position[falling, 0, 2], 1.1 - 9.81 / 2 * r.t[falling] ** 2, atol=1e-6
        )
        first = r.events[0]
        self.assertEqual((first["kind"], {first["first"], first["second"]}), ("impact", {"ball", "floor"}))
        self.assertAlmostEqual(first["time"], np.sqrt(2 / 9.81), delta=1e-7)
        self.assertAlmostEqual(first["after"], -first["before"] / 2, delta=1e-6)
        np.testing.assert_allclose(np.linalg.norm(r.orientation, axis=2), 1, atol=1e-12)

    def test_shipped_scenes_meet_their_expectations(self):
        for name in ("pendulum.toml", "incline.toml"):
            s = scene.read(shipped(name))
            r = s.run()
            self.assertTrue(r.met, name)
            self.assertEqual(r.t[-1], s.end)
            self.assertLess(r.drift.max(), 1e-6)

    def test_end_every_and_files(self):
        s = scene.read(shipped("pendulum.toml"))
        r = s.run(end=0.5, every=0.125)
        np.testing.assert_allclose(r.t, [0, 0.125, 0.25, 0.375, 0.5], atol=1e-12)
        with tempfile.TemporaryDirectory() as folder:
            before = os.getcwd()
            os.chdir(folder)
            try:
                s.run(end=0.1)
                self.assertEqual(os.listdir(folder), [])
            finally:
                os.chdir(before)

    def test_text_is_the_same_scene(self):
        s = scene.read(shipped("incline.toml"))
        again = scene.parse(s.text)
        self.assertEqual(again.text, s.text)
        np.testing.assert_array_equal(s.run(end=0.2).position, again.run(end=0.2).position)
        self.assertIn("stepping", s.plan)


class Refusals(unittest.TestCase):
    def test_faults_are_named(self):
        with self.assertRaisesRegex(ValueError, "gravty"):
            scene.parse(BALL.replace("gravity", "gravty"))
        with self.assertRaisesRegex(ValueError, "/no/such.toml"):
            scene.read("/no/such.toml")
        with self.assertRaisesRegex(ValueError, "end"):
            scene.parse(BALL).run(end=-1.0)
        with self.assertRaises(TypeError):
            scene.parse(BALL).run(end="late")
