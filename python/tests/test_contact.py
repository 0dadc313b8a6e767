# SPDX-License-Identifier: BSD-3-Clause
import os
import sys
import threading
import unittest

import numpy as np
from tether import contact


def chain(n, mu, seed=0):
    """A random Delassus matrix of n contacts, singular where contacts are many."""
    rng = np.random.default_rng(seed)
    J = rng.standard_normal((3 * n, 2 * n + 4))
    return J @ J.T, rng.standard_normal(3 * n) + np.tile([1.0, 0, 0], n), np.full(n, mu)


class OneContact(unittest.TestCase):
    A = np.diag([2.0, 4.0, 4.0])

    def test_sticks_with_the_impulse_that_stops_it(self):
        s = contact.Problem(self.A, [1, 0.1, 0], [0.5]).solve("coulomb")
        self.assertEqual((s.status, s.regimes), ("solved", ["sticking"]))
        np.testing.assert_allclose(s.impulses, [0.5, 0.025, 0], atol=1e-15)
        np.testing.assert_allclose(s.velocities, 0, atol=1e-15)

    def test_slides_on_the_cone(self):
        s = contact.Problem(self.A, [1, 3, -4], [0.2]).solve("coulomb")
        self.assertEqual(s.regimes, ["sliding"])
        # x_t = mu x_n along b_t, x_n = 1/2
        np.testing.assert_allclose(s.impulses, [0.5, 0.06, -0.08], atol=1e-12)
        self.assertLess(s.error, 1e-12)

    def test_an_exact_solution_is_proven_within_the_error(self):
        p = contact.Problem(np.eye(3), [10, 6, 8], [0.5])
        proof = p.prove([10, 3, 4.5], allowed=0)
        self.assertEqual((proof["status"], proof["regimes"]), ("proven", ["sliding"]))
        self.assertAlmostEqual(proof["radius"], 0.5, 12)  # x = (10, 3, 4)
        self.assertEqual(p.prove([10, np.nan, 4])["status"], "not_proven")

    def test_a_proof_lets_other_threads_run(self):
        p = contact.Problem(np.eye(3), [10, 6, 8], [0.5])
        x, ran, may_run = np.array([10.0, 3.0, 4.0]), [], threading.Lock()
        may_run.acquire()
        other = threading.Thread(target=lambda: (may_run.acquire(), ran.append(True)))
        other.start()
        before = sys.getswitchinterval()
        sys.setswitchinterval(1000)  # s: only who waits without the lock lets others run
        try:
            may_run.release()
            for _ in range(100000):
                p.prove(x)
                if ran:
                    break
            self.assertTrue(ran)
        finally:
            sys.setswitchinterval(before)
            other.join()

    def test_in_the_plane(self):
        p = contact.Problem([[2.0, 0], [0, 4]], [1, 3], [0.2])
        self.assertEqual((p.dimension, p.contacts), (2, 1))
        np.testing.assert_allclose(p.solve().impulses, [0.5, 0.1], atol=1e-12)


class ManyContacts(unittest.TestCase):
    def test_every_law_is_solved_by_its_own_residuals(self):
        A, b, mu = chain(12, 0.4)
        for law in contact.laws():
            p = contact.Problem(A, b, mu)
            s = p.solve(law)
            self.assertTrue(s.solved, (law, s.status, s.advice))
            r = p.residuals(s.impulses, law)
            self.assertLess(r["fixed_point"], 2e-9)
            w = A @ s.impulses - b
            np.testing.assert_allclose(s.velocities, w, atol=1e-8)
            self.assertGreater(w[::3].min(), -1e-7)

    def test_sparse_is_dense(self):
        sparse = __import__("importlib").util.find_spec("scipy")
        if sparse is None:
            self.skipTest("no SciPy")
        from scipy.sparse import block_diag, csr_matrix

        blocks = [chain(2, 0.3, seed)[0] for seed in range(3)]
        A = block_diag(blocks).toarray()
        b = np.linspace(-1, 1, 18)
        dense = contact.Problem(A, b, np.full(6, 0.3))
        sparse = contact.Problem(csr_matrix(A), b, np.full(6, 0.3))
        np.testing.assert_array_equal(dense.A, sparse.A)
        np.testing.assert_allclose(
            dense.solve("coulomb").impulses, sparse.solve("coulomb").impulses, atol=1e-9
        )

    def test_a_start_that_is_the_solution_takes_less_work(self):
        A, b, mu = chain(20, 0.5, 3)
        p = contact.Problem(A, b, mu)
        first = p.solve(tolerance=1e-8)
        again = p.solve(tolerance=1e-8, start=first.impulses)
        self.assertTrue(again.solved)
        self.assertLess(again.work, first.work)

    def test_what_nothing_stops_is_infeasible(self):
        # Two walls that close on a body: their normals are opposite.
        A = np.array([[1.0, 0, -1, 0], [0, 1, 0, 1], [-1, 0, 1, 0], [0, 1, 0, 1]])
        s = contact.Problem(A, [1, 0, 1, 0], [0.0, 0.0]).solve()
        self.assertEqual(s.status, "infeasible")
        d = s.infeasible_direction
        np.testing.assert_allclose(A[:, ::2] @ d[::2], 0, atol=1e-12)
        self.assertFalse(s.solved)


class Derivatives(unittest.TestCase):
    def test_forward_is_what_differences_say(self):
        A, b, mu = chain(6, 0.4, 1)
        for law in ("coulomb", "maximum_dissipation"):
            p = contact.Problem(A, b, mu)
            s = p.solve(law, tolerance=1e-13)
            d = p.derivative(s, law)
            self.assertEqual((d.status, d.strictly_regular, d.kinks), ("unique", True, []))
            self.assertEqual(d.regimes, s.regimes)
            db, h = np.linspace(-1, 1, b.size), 1e-5
            dx, dw, residual = d.forward(b=db, mu=mu, A=0.1 * A)
            ends = [
                contact.Problem(A * (1 + 0.1 * e), b + e * db, mu * (1 + e)).solve(
                    law, tolerance=1e-13
                )
                for e in (h, -h)
            ]
            np.testing.assert_allclose(
                dx, (ends[0].impulses - ends[1].impulses) / (2 * h), atol=1e-6 * abs(dx).max()
            )
            np.testing.assert_allclose(
                dw, (ends[0].velocities - ends[1].velocities) / (2 * h), atol=1e-6 * abs(dw).max()
            )
            self.assertLess(residual, 1e-12)
            # The transpose: the same number from the gradient.
            row = np.cos(np.arange(b.size))
            g = d.adjoint(row, velocities=row)
            of_A = (g["values"] * 0.1 * A[g["rows"], g["columns"]]).sum()
            self.assertAlmostEqual(
                row @ dx + row @ dw, g["b"] @ db + g["mu"] @ mu + of_A, delta=1e-10
            )

    def test_equal_contacts_are_hyperstatic(self):
        A = np.kron(np.ones((2, 2)), np.diag([1.0, 1, 1]))
        p = contact.Problem(A, [1, 0.1, 0] * 2, [0.5, 0.5])
        # Half on each; sweeps from zero load the first one only, and the other is at a kink.
        d = p.derivative(p.solve("coulomb", start=[0.5, 0.05, 0] * 2), "coulomb")
        self.assertEqual(p.derivative(p.solve("coulomb"), "coulomb").kinks[0][0], 1)
        self.assertEqual((d.status, d.rank, d.unknowns), ("minimum_norm", 3, 6))
        self.assertEqual((d.not_unique, d.velocities_unique), ([0, 1], True))
        np.testing.assert_allclose(d.forward(b=[1, 0, 0] * 2)[0], [0.5, 0, 0] * 2, atol=1e-14)
        self.assertIn("not unique", d.advice)

    def test_kinks_and_refusals_are_named(self):
        p = contact.Problem(np.diag([2.0, 4, 4]), [0, 1, 0], [0.5])
        s = p.solve("coulomb")
        self.assertEqual(p.derivative(s, "coulomb").kinks[0][:3], (0, "separating", "sliding"))
        other = contact.Problem(np.diag([2.0, 4, 4]), [1, 1, 0], [0.5])
        with self.assertRaisesRegex(ValueError, "error of the impulses"):
            other.derivative(s, "coulomb")
        with self.assertRaisesRegex(ValueError, "b has 2"):
            p.derivative(s, "coulomb").forward(b=[1, 2])
        with self.assertRaisesRegex(ValueError, "3 x 3"):
            p.derivative(s, "coulomb").forward(A=np.eye(2))


class Files(unittest.TestCase):
    def test_a_shipped_problem_is_read(self):
        folder = os.path.join(os.environ["TETHER_SOURCE"], "tests", "contact", "collection")
        names = sorted(n for n in os.listdir(folder) if n.endswith(".dat"))
        self.assertTrue(names)
        p = contact.read(os.path.join(folder, names[0]))
        self.assertEqual(p.A.shape, (p.dimension * p.contacts,) * 2)
        self.assertTrue(p.solve(tolerance=1e-6).solved)

    def test_a_missing_file_is_named(self):
        with self.assertRaisesRegex(RuntimeError, "/no/such.dat"):
            contact.read("/no/such.dat")


class Refusals(unittest.TestCase):
    def test_arguments_are_named(self):
        A, b, mu = np.eye(3), np.ones(3), [0.5]
        cases = [
            (lambda: contact.Problem(np.eye(4), b, mu), "A"),
            (lambda: contact.Problem(A, np.ones(4), mu), "b has 4"),
            (lambda: contact.Problem(A, b, [-1]), "mu"),
            (lambda: contact.Problem(A, [np.nan, 0, 0], mu), "finite"),
            (lambda: contact.Problem(np.eye(3)[0], b, mu), "axes"),
            (lambda: contact.Problem(A, b, [[0.5]]), "mu has shape"),
            (lambda: contact.Problem("A", b, mu), "A has entries of type <U1"),
            (lambda: contact.Problem(object(), b, mu), "A has entries of type object"),
            (lambda: contact.Problem(A, b, mu).solve("columb"), "coulomb"),
            (lambda: contact.Problem(A, b, mu).solve(tolerance=-1), "tolerance"),
            (lambda: contact.Problem(A, b, mu).solve(start=[1, 2]), "start has 2"),
            (lambda: contact.Problem(A, b, mu).residuals([1, 2]), "impulses has 2"),
        ]
        for call, words in cases:
            with self.assertRaisesRegex(ValueError, words):
                call()
