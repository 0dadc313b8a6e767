// Tether: the one-contact problem and its friction laws. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <tether/export.hpp>
#include <tether/linalg/eigen.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// The law that an impulse x = (x_n, x_t) and the relative velocity after it, w = A x - b, obey.
/// Derivations: docs/method/contact.md.
enum class Law : std::uint8_t {
  /// Preclik and Ruede's MPCC: min 1/2 x'Ax - b'x over x_n >= 0, |x_t| <= mu x_n with
  /// (Ax - b)_n >= 0 complementary to x_n and (Ax)_n >= 0. One solution for every A.
  maximum_dissipation,
  /// Classical law: friction opposes slip, -(w_n + mu |w_t|, w_t) in the normal cone of K at x.
  coulomb,
  /// x_t = 0, x_n >= 0 complementary to w_n >= 0.
  frictionless
};

/// Motion of a contact after its impulse: x = 0, or w = 0, or w_n = 0 with friction at its bound.
enum class Regime : std::uint8_t { separating, sticking, sliding };

/// Throws std::invalid_argument unless `law` is one of laws().
const char* name(Law law);
/// The enumerator as text.
const char* name(Regime regime);
/// Every law, in the order of its enumerators: what readers and command lines offer by name().
const std::vector<Law>& laws();

/// Factors of one symmetric 3x3 block A = [a c'; c T] and its friction coefficient (method, eq. 7).
/// In the frame V the matrix B = T - c c'/a is diag(beta). beta is kept >= 1e-12 trace(A), which
/// makes singular blocks solvable.
struct LocalBlock {
  double a, inv_a;      ///< A_nn and 1 / A_nn
  double mu;            ///< coefficient of friction
  double e;             ///< |g|, the eccentricity of the conic section
  double c[2];          ///< A_tn
  double g[2];          ///< V' mu c / a
  double beta[2];       ///< eigenvalues of B
  double cosine, sine;  ///< V = [cosine -sine; sine cosine]
  double T[3];          ///< T00, T01, T11, with the raised beta
  /// e < 1 and e <= 2 sqrt(q) / (1 + q), q = beta_min / beta_max: Coulomb's law has one solution
  /// (method, section 2.4).
  bool unique;
  bool null[2];   ///< beta was below 1e-12 trace(A)
  bool ordinary;  ///< trace(A) is so near to 1 that no product of a solve leaves the range

  LocalBlock() = default;
  /// Uses (A + A')/2. Throws std::invalid_argument unless A is finite, A_nn > 0, the matrix is
  /// positive semidefinite up to round-off (1e-8 trace) and 0 <= mu < infinity.
  LocalBlock(const Eigen::Matrix3d& A, double mu);
  Eigen::Matrix3d matrix() const;  ///< A, with the raised beta
};

/// An impulse that is being improved. In: x (start and, for `coulomb` at e > 0.8 where several
/// solutions may exist, the point whose nearest solution is wanted). Out: the solution.
struct LocalState {
  double x[3] = {0, 0, 0};  ///< impulse: normal, tangent, tangent
  double lambda = -1;       ///< |w_t| / |x_t| of the last sliding `coulomb` solve; < 0: none
  Regime regime = Regime::separating;  ///< of the solution
  int evaluations = 0;                 ///< of the scalar equation, in this solve
};

/// Exact solution of the one-contact problem with right-hand side b, warm-started from `state`.
void solve_local(Law law, const LocalBlock& block, const Eigen::Vector3d& b, LocalState& state);

/// Impulse (normal, tangent, tangent) of one contact, and its regime.
struct OneContact {
  Eigen::Vector3d impulse = Eigen::Vector3d::Zero();  ///< in the units of b / A
  Regime regime = Regime::separating;                 ///< of the impulse
  int evaluations = 0;                                ///< of the scalar equation
};

/// The same from zero, for A, b and mu. Throws as LocalBlock does, and unless b is finite.
OneContact solve_one(Law law, const Eigen::Matrix3d& A, const Eigen::Vector3d& b, double mu);

}  // namespace tether::contact
TETHER_EXPORT_END
