# SPDX-License-Identifier: BSD-3-Clause
import os
import unittest

import numpy as np
from tether import contact

Cone, ConeProblem = contact.Cone, contact.ConeProblem


class Triplets:
    """What a scipy.sparse matrix offers; entries at one place are summed."""

    def __init__(self, A):
        self.shape = A.shape
        self.row, self.col = np.nonzero(A)
        self.data = A[self.row, self.col] / 2
        self.row, self.col, self.data = (np.tile(x, 2) for x in (self.row, self.col, self.data))

    def tocoo(self):
        return self


def mixed(seed=0):
    """One cone of each kind, A of full rank."""
    cones = [
        Cone.friction(0.4),
        Cone.free(2),
        Cone.bounded(0.05),
        Cone.nonnegative(),
        Cone.planar(0.3),
        Cone.with_torsional(0.5, 0.02),
        Cone.with_rolling(0.5, 0.03),
        Cone.with_rolling(0.5, 0.03, 0.02),
    ]
    n = sum(c.rows for c in cones)
    rng = np.random.default_rng(seed)
    J = rng.standard_normal((n, n + 6))
    b = rng.standard_normal(n)
    for first, cone in zip(np.cumsum([0] + [c.rows for c in cones[:-1]]), cones):
        if cone.kind not in ("free", "bounded"):
            b[first] += 2  # approaches
    return J @ J.T, b, cones


class ConesAlone(unittest.TestCase):
    def test_closed_forms(self):
        cases = [
            (Cone.free(2), [[2, 1], [1, 3]], [3, 4], [1, 1]),
            (Cone.nonnegative(), [[2]], [3], [1.5]),
            (Cone.nonnegative(), [[2]], [-3], [0]),
            (Cone.bounded(0.5), [[2]], [3], [0.5]),
            (Cone.bounded(0.5), [[2]], [-0.5], [-0.25]),
            (Cone.planar(0.2), np.diag([2.0, 4]), [1, 3], [0.5, 0.1]),
            (Cone.friction(0.2), np.diag([2.0, 4, 4]), [1, 3, -4], [0.5, 0.06, -0.08]),
            (Cone.with_torsional(9, 0.1), np.eye(4), [1, 0.2, 0, 3], [1, 0.2, 0, 0.1]),
            (Cone.with_rolling(9, 0.1), np.eye(5), [1, 0.2, 0, 3, -4], [1, 0.2, 0, 0.06, -0.08]),
        ]
        for cone, A, b, x in cases:
            s = ConeProblem(A, b, [cone]).solve(tolerance=1e-12)
            self.assertTrue(s.solved, (cone, s.advice))
            np.testing.assert_allclose(s.impulses, x, atol=1e-10, err_msg=repr(cone))

    def test_compliance_yields_by_its_impulse(self):
        p = ConeProblem([[2.0]], [3], [Cone.nonnegative()], compliance=[1])
        np.testing.assert_allclose(p.A, [[3]])
        np.testing.assert_allclose(p.solve().impulses, [1], atol=1e-12)

    def test_what_a_cone_is_can_be_read(self):
        c = Cone.with_rolling(0.5, 0.03, 0.02)
        self.assertEqual((c.kind, c.rows), ("rolling_torsional", 6))
        self.assertEqual((c.mu, c.rolling, c.torsional), (0.5, 0.03, 0.02))
        self.assertEqual(Cone.bounded(3).bound, 3)


class Products(unittest.TestCase):
    def test_every_kind_at_once(self):
        A, b, cones = mixed()
        p = ConeProblem(A, b, cones)
        self.assertEqual((p.rows, p.first_rows), (24, [0, 3, 5, 6, 7, 9, 13, 18]))
        s = p.solve(tolerance=1e-11)
        self.assertTrue(s.solved, s.advice)
        np.testing.assert_allclose(s.velocities, A @ s.impulses - b, atol=1e-8)
        np.testing.assert_allclose(s.velocities[3:5], 0, atol=1e-8)
        self.assertLessEqual(abs(s.impulses[5]), 0.05 * (1 + 1e-9))
        x = s.impulses[:3]
        self.assertLessEqual(np.hypot(x[1], x[2]), 0.4 * x[0] + 1e-9)
        r = p.residuals(s.impulses)
        self.assertLess(r["error"], 1e-10)
        self.assertEqual(len(r["blocks"]), len(cones))
        wrong = s.impulses.copy()
        wrong[6] = -1
        self.assertEqual(p.residuals(wrong)["blocks"].argmax(), p.residuals(wrong)["worst"])
        again = p.solve(tolerance=1e-11, start=s.impulses)
        self.assertLess(again.work, s.work)

    def test_sparse_is_dense(self):
        A, b, cones = mixed(1)
        dense, sparse = ConeProblem(A, b, cones), ConeProblem(Triplets(A), b, cones)
        np.testing.assert_array_equal(dense.A, sparse.A)

    def test_masses_give_what_their_inverse_gives(self):
        rng = np.random.default_rng(2)
        M = rng.standard_normal((6, 6))
        M = M @ M.T + np.eye(6)
        J, f, bias = rng.standard_normal((4, 6)), rng.standard_normal(6), rng.standard_normal(4)
        cones = [Cone.free(), Cone.friction(0.5)]
        p = ConeProblem.saddle(M, J, f, bias, cones)
        np.testing.assert_allclose(p.A, J @ np.linalg.solve(M, J.T), atol=1e-12)
        np.testing.assert_allclose(p.b, -(J @ np.linalg.solve(M, f) + bias), atol=1e-12)
        half = ConeProblem.saddle(np.tril(M), J, f, bias, cones)
        np.testing.assert_allclose(half.A, p.A, atol=1e-14)

    def test_what_cannot_be_is_named(self):
        two = ConeProblem(np.ones((2, 2)), [1, 2], [Cone.free(2)]).solve()
        self.assertEqual((two.status, two.contradicting), ("infeasible", [0, 1]))
        held = ConeProblem(np.ones((2, 2)), [0, 1], [Cone.free(), Cone.nonnegative()]).solve()
        self.assertEqual((held.status, held.blocked), ("infeasible", [1]))
        self.assertTrue(held.advice)

    def test_files(self):
        folder = os.path.join(os.environ["TETHER_SOURCE"], "tests", "contact", "collection")
        name = sorted(n for n in os.listdir(folder) if n.endswith(".dat"))[0]
        plain, cones = (read(os.path.join(folder, name)) for read in (contact.read, contact.read_cones))
        np.testing.assert_allclose(cones.A, plain.A, atol=1e-15)
        self.assertEqual([c.mu for c in cones.cones], list(plain.mu))


class Derivatives(unittest.TestCase):
    def test_forward_is_what_differences_say(self):
        A, b, cones = mixed(3)
        p = ConeProblem(A, b, cones)
        d = p.derivative(p.solve(tolerance=1e-13).impulses)
        self.assertEqual(d.kinks, [])
        h, db, n = 1e-6, np.cos(np.arange(b.size)), len(cones)
        of = {w: np.array([getattr(c, w) for c in cones]) for w in ("mu", "rolling", "torsional", "bound")}
        dx, dw, residual = d.forward(b=db, A=0.1 * A, **of)
        make = {
            "free": lambda c, e: Cone.free(c.rows),
            "nonnegative": lambda c, e: Cone.nonnegative(),
            "bounded": lambda c, e: Cone.bounded(c.bound * e),
            "planar": lambda c, e: Cone.planar(c.mu * e),
            "friction": lambda c, e: Cone.friction(c.mu * e),
            "torsional": lambda c, e: Cone.with_torsional(c.mu * e, c.torsional * e),
            "rolling": lambda c, e: Cone.with_rolling(c.mu * e, c.rolling * e),
            "rolling_torsional": lambda c, e: Cone.with_rolling(c.mu * e, c.rolling * e, c.torsional * e),
        }
        ends = []
        for e in (h, -h):
            moved = [make[c.kind](c, 1 + e) for c in cones]
            s = ConeProblem(A * (1 + 0.1 * e), b + e * db, moved).solve(tolerance=1e-13)
            ends.append((s.impulses, s.velocities))
        for found, k in ((dx, 0), (dw, 1)):
            np.testing.assert_allclose(
                found, (ends[0][k] - ends[1][k]) / (2 * h), atol=1e-5 * abs(found).max()
            )
        self.assertLess(residual, 1e-10)
        row = np.sin(np.arange(b.size))
        g = d.adjoint(row, velocities=row)
        total = g["b"] @ db + (g["values"] * 0.1 * A[g["rows"], g["columns"]]).sum()
        total += sum(g[word] @ of[word] for word in of)
        self.assertAlmostEqual(row @ dx + row @ dw, total, delta=1e-9 * abs(total))


class Refusals(unittest.TestCase):
    def test_arguments_are_named(self):
        p = ConeProblem(np.eye(3), np.ones(3), [Cone.friction(0.5)])
        d = p.derivative(p.solve(tolerance=1e-12).impulses)
        cases = [
            (lambda: ConeProblem(np.eye(4), np.ones(3), [Cone.friction(0.5)]), "A is 4 x 4"),
            (lambda: ConeProblem(Triplets(np.eye(4)), np.ones(3), [Cone.friction(0.5)]), "A is 4 x 4"),
            (lambda: ConeProblem(np.ones(3), np.ones(3), [Cone.friction(0.5)]), "axes"),
            (lambda: ConeProblem([[1, "a"], [0, 1]], [1, 1], [Cone.free(2)]), "A has entries of type <U"),
            (lambda: ConeProblem(1j * np.eye(3), np.ones(3), [Cone.friction(0.5)]), "A has entries of type complex"),
            (lambda: ConeProblem(np.eye(3), np.ones(3), [Cone.planar(0.5)]), "cones"),
            (lambda: ConeProblem(np.eye(3), np.ones(3), [Cone.friction(-1)]), "mu"),
            (lambda: ConeProblem([[np.nan]], [1], [Cone.free()]), "finite"),
            (lambda: ConeProblem([[1.0]], [[1]], [Cone.free()]), "b has shape"),
            (lambda: ConeProblem([[1.0]], [1], [Cone.free()], [-1]), "compliance"),
            (lambda: ConeProblem.saddle(np.eye(2), np.eye(3), [0, 0], [0], [Cone.free()]), "J is 3 x 3"),
            (lambda: p.solve("maximum"), "coulomb"),
            (lambda: p.solve(tolerance=-1), "tolerance"),
            (lambda: p.solve(start=[1, 2]), "start has 2"),
            (lambda: p.residuals([1, 2]), "impulses has 2"),
            (lambda: p.derivative([5, 0, 0]), "error of the impulses"),
            (lambda: d.forward(A=np.eye(2)), "A is 2 x 2"),
            (lambda: d.forward(mu=[1, 2]), "mu"),
        ]
        for call, words in cases:
            with self.assertRaisesRegex(ValueError, words):
                call()
        with self.assertRaisesRegex(RuntimeError, "/no/such.dat"):
            contact.read_cones("/no/such.dat")
