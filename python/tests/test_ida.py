# SPDX-License-Identifier: BSD-3-Clause
import unittest

import numpy as np
from tether import ida

PERIOD = 7.4162987092054876737354013887173  # 4 K(1/2)


def pendulum(t, y, yp):
    """x, y, vx, vy and the tension; L = g = m = 1, index 1."""
    return [
        yp[0] - y[2],
        yp[1] - y[3],
        yp[2] + y[0] * y[4],
        yp[3] + y[1] * y[4] + 1,
        y[2] ** 2 + y[3] ** 2 - y[1] - y[4],
    ]


def invariants(t, y):
    return [
        (y[0] ** 2 + y[1] ** 2 - 1) / 2,
        y[0] * y[2] + y[1] * y[3],
        (y[2] ** 2 + y[3] ** 2) / 2 + y[1],
    ]


def gradients(t, y):
    return [[y[0], y[1], 0, 0, 0], [y[2], y[3], y[0], y[1], 0], [0, 1, y[2], y[3], 0]]


Y0, YP0 = [1.0, 0, 0, 0, 0], [0.0, 0, 0, -1, 0]


class Pendulum(unittest.TestCase):
    def test_stays_on_its_constraints_where_plain_ida_drifts(self):
        times = np.linspace(0, 10 * PERIOD, 101)
        plain = ida.solve(pendulum, times, Y0, YP0)
        self.assertEqual((plain.status, plain.message), ("plain", ""))
        for C in (None, gradients):
            kept = ida.solve(
                pendulum, times, Y0, YP0, constraints=invariants, constraint_jacobian=C
            )
            self.assertEqual((kept.status, kept.message), ("success", ""))
            self.assertEqual(kept.y.shape, (101, 5))
            drift = max(np.abs(invariants(0, y)).max() for y in kept.y)
            self.assertLess(drift, 1e-9)
            self.assertGreater(np.abs(invariants(0, plain.y[-1])).max(), 1e-3)
            error = [np.abs(r.y[-1, :4] - Y0[:4]).max() for r in (plain, kept)]
            self.assertLess(error[1], 1e-4)
            self.assertGreater(error[0], 100 * error[1])
            self.assertIn("projections", kept.statistics)

    def test_its_own_jacobian(self):
        def jacobian(t, y, yp, cj):
            J = cj * np.diag([1.0, 1, 1, 1, 0])
            J[0, 2] = J[1, 3] = -1
            J[2, 0], J[2, 4] = y[4], y[0]
            J[3, 1], J[3, 4] = y[4], y[1]
            J[4] = [0, -1, 2 * y[2], 2 * y[3], -1]
            return J

        given = ida.solve(pendulum, [0, PERIOD], Y0, YP0, constraints=invariants, jacobian=jacobian)
        differences = ida.solve(pendulum, [0, PERIOD], Y0, YP0, constraints=invariants)
        np.testing.assert_allclose(given.y[-1], differences.y[-1], atol=1e-5)
        self.assertEqual(given.status, "success")

    def test_a_start_off_the_constraints_is_made_consistent(self):
        off = [1.01, 0, 0, 0, 0]
        r = ida.solve(
            pendulum, [0, 1], off, YP0, constraints=invariants, make_consistent=True,
            algebraic=[0, 0, 0, 0, 1],
        )
        self.assertEqual(r.status, "success")
        self.assertLess(np.abs(invariants(0, r.y[0])).max(), 1e-12)
        kept = ida.solve(pendulum, [0, 1], off, YP0, constraints=invariants)
        self.assertNotEqual(kept.message, "")
        self.assertIn("make_consistent", kept.message)
        self.assertEqual(len(kept.t), 1)


class Functions(unittest.TestCase):
    def test_what_they_raise_is_raised(self):
        def fails(t, y, yp):
            if t > 0.5:
                raise KeyError("enough")
            return yp + y

        with self.assertRaisesRegex(KeyError, "enough"):
            ida.solve(fails, [0, 1], [1.0], [-1.0])

        def g(t, y):
            if t > 0.5:
                raise ZeroDivisionError("in g")
            return [y[0] - y[1]]

        with self.assertRaisesRegex(ZeroDivisionError, "in g"):
            ida.solve(lambda t, y, yp: yp + y, [0, 1], [1.0, 1], [-1.0, -1], constraints=g)

    def test_wrong_shapes_are_named(self):
        cases = [
            (lambda: ida.solve(lambda t, y, yp: yp[:1], [0, 1], [1, 2], [0, 0]), "residual returned"),
            (lambda: ida.solve(pendulum, [0, 0], Y0, YP0), "times"),
            (lambda: ida.solve(pendulum, [0, np.inf], Y0, YP0), "times"),
            (lambda: ida.solve(pendulum, [0, 1], Y0, [0]), "yp0"),
            (lambda: ida.solve(pendulum, [0, 1], [np.nan] * 5, YP0), "y0"),
            (lambda: ida.solve(pendulum, [0, 1], "y", YP0), "y0 has entries of type <U1"),
            (lambda: ida.solve(pendulum, [0, 1], Y0, YP0 * np.array(1j)), "yp0 has entries of type complex"),
            (lambda: ida.solve(lambda t, y, yp: "f", [0, 1], Y0, YP0), "residual has entries of type <U1"),
            (lambda: ida.solve(pendulum, [0, 1], Y0, YP0, constraints=lambda t, y: "g"), "constraints has entries"),
            (lambda: ida.solve(pendulum, [0, 1], Y0, YP0, rtol=-1), "rtol"),
            (lambda: ida.solve(pendulum, [0, 1], Y0, YP0, atol=[1e-6]), "atol"),
            (lambda: ida.solve(pendulum, [0, 1], Y0, YP0, make_consistent=True), "constraints"),
            (lambda: ida.solve(pendulum, [0, 1], Y0, YP0, constraints=lambda t, y: []), "no values"),
            (
                lambda: ida.solve(
                    pendulum, [0, 1], Y0, YP0, constraints=invariants,
                    constraint_jacobian=lambda t, y: np.eye(5),
                ),
                "constraint_jacobian returned",
            ),
        ]
        for call, words in cases:
            with self.assertRaisesRegex(ValueError, words):
                call()

    def test_a_run_that_ida_gives_up_keeps_what_it_has(self):
        r = ida.solve(lambda t, y, yp: yp - y**2, np.linspace(0, 2, 21), [1.0], [1.0], max_steps=2000)
        self.assertNotEqual(r.message, "")
        self.assertLess(r.t[-1], 1.0)
        np.testing.assert_allclose(r.y[5, 0], 1 / (1 - 0.5), rtol=1e-4)
