// Tether: proof that an exact solution lies near given impulses. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <tether/contact/problem.hpp>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// How much prove() has shown.
enum class ProofStatus : std::uint8_t {
  not_proven,     ///< nothing: there may or may not be a solution
  proven_nearby,  ///< a problem with another b, see Proof::change, has a solution within the radius
  proven          ///< the problem, its doubles taken as exact, has a solution within the radius
};
/// The enumerator as text.
const char* name(ProofStatus status);

/// A solution x* is meant that meets Coulomb's law exactly, as real numbers. All bounds include the
/// rounding of their own computation. Without a proof they are infinite.
struct Proof {
  ProofStatus status = ProofStatus::not_proven;  ///< the weakest of all islands
  double radius = 0;           ///< every contact's |x*_i - x_i| is at most this, N s
  double relative_radius = 0;  ///< over the largest |x_i|
  /// proven_nearby: x* solves (A, b', mu) with |b'_r - b_r| <= change in every row r, m/s; else 0.
  double change = 0;
  /// The largest over the largest |b_r| of its island, both divided by about sqrt(A_nn).
  double relative_change = 0;
  std::vector<Regime> regimes;  ///< of x*, by contact; without a proof empty
  int contact = -1;             ///< the first contact that prevents a stronger status, else -1
  std::string reason;           ///< why it does
};

/// Proves, in interval arithmetic, that an exact solution under Law::coulomb lies near `impulses`
/// (dimension * contacts entries, of whatever origin), island by island:
///
/// 1. Newton steps find a better point and the regime of each contact (separating, sticking,
///    sliding), if need be after a Solver from `impulses`.
/// 2. In fixed regimes the law is a square system of quadratic equations and closed inequalities.
///    Krawczyk's operator proves a root in a box, and that the inequalities hold in the whole box.
/// 3. The system is singular if contacts are more than the bodies have freedoms, and inequalities
///    are not sure at the brink of another regime. Then b' is computed for which a point next to
///    the better one is a solution. It is accepted up to the relative change `allowed`.
///
/// The default of `allowed` is the default tolerance of a Solver, which is relative to velocities,
/// too; 0 accepts proofs of the problem itself alone. A is dense over an island; work grows with
/// the third power of its touching contacts. Nothing is proven in a program that does not round to
/// nearest or flushes subnormal numbers to zero, as -ffast-math may make it. Throws
/// std::invalid_argument on sizes that do not match, allowed < 0 or infinite. Rump, Acta Numerica
/// 19 (2010) 287; Acary, Bremond and Huber (2018) for the law.
Proof prove(const Problem& problem, const linalg::VectorView& impulses, double allowed = 1e-9);

}  // namespace tether::contact
TETHER_EXPORT_END
