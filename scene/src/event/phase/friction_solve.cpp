// Tether: impacts and modes of contacts as problems of the contact library, through the joints.
// SPDX-License-Identifier: BSD-3-Clause
#include "friction_solve.hpp"

#include <algorithm>
#include <cmath>
#include <tether/contact/cones.hpp>

namespace tether::scene::event {

using contact::Cone;
using contact::Regime;
using linalg::at;

namespace {

constexpr double kLocked = 1e-12;  // A_nn of the largest
constexpr double kSolve = 1e-12;
constexpr double kFarAbove = 1e5;
constexpr double kStiffest = 1e-6, kStiffer = 0.1, kCompliantWork = 3e7;
// Bounds relative to the forces that accelerations ask for, see BoundedLaws.
constexpr double kCutBound = 1e3, kMostBound = 1e12;
constexpr double kNoChange = 3e-9;  // of accelerations or velocities

constexpr double kNear = 1e-8;

template <class Solution>
bool is_solved(const Solution& answer) {
  return answer.status == contact::Status::solved || answer.status == contact::Status::round_off ||
         (answer.error < kNear && answer.status != contact::Status::infeasible);
}

/// Row and column 0 of a moment are nobody's, of one about the normal (whose second tangent no
/// other row moves) the last, too.
bool is_spin(const MatrixXd& A, int first) {
  return A.row(first + 2).cwiseAbs().sum() == A(first + 2, first + 2) &&
         A(first + 2, first + 2) > 0;
}

/// The cone of a contact with its moments, and where its rows are in blocks of three.
struct Held {
  Cone cone;
  std::vector<int> rows;
};

Held cone_of(const MatrixXd& A, const VectorXd& mu, const Holders& holders, int contact) {
  int spin = -1, rolling = -1;
  for (int k = contact + 1; k < static_cast<int>(holders.size()); ++k)
    if (holders[at(k)] == contact) (spin < 0 && is_spin(A, 3 * k) ? spin : rolling) = k;
  Held out;
  for (int k = 0; k < 3; ++k) out.rows.push_back(3 * contact + k);
  if (spin >= 0) out.rows.push_back(3 * spin + 1);
  if (rolling >= 0)
    for (int k = 1; k < 3; ++k) out.rows.push_back(3 * rolling + k);
  const double m = mu[contact], r = rolling >= 0 ? mu[rolling] : 0, s = spin >= 0 ? mu[spin] : 0;
  out.cone = rolling < 0 ? (spin < 0 ? Cone::friction(m) : Cone::with_torsional(m, s))
             : spin < 0  ? Cone::with_rolling(m, r)
                         : Cone::with_rolling(m, r, s);
  return out;
}

/// Sticking if the rest of the bound, as a velocity, is at least the slip.
Regime regime_of(double mobility, double left, double slip) {
  return mobility * left < slip ? Regime::sliding : Regime::sticking;
}

/// Solves w = A x - b for blocks (normal, tangents): friction cones, and where there are moments
/// the cones of rolling and torsional friction that these make with the contacts which hold them.
/// Starts where the last solve ended.
class ConeBlocks {
 public:
  ConeBlocks(const contact::Options& options, const Holders& holders)
      : contacts_(options), cones_(options), holders_(holders) {}
  FrictionAnswer solve(const MatrixXd& A, const VectorXd& b, const VectorXd& mu);

 private:
  FrictionAnswer solve_with_moments(const MatrixXd& A, const VectorXd& b, const VectorXd& mu);

  contact::Solver contacts_;
  contact::ConeSolver cones_;
  Holders holders_;
  VectorXd last_;
};

FrictionAnswer ConeBlocks::solve(const MatrixXd& A, const VectorXd& b, const VectorXd& mu) {
  if (!holders_.empty()) return solve_with_moments(A, b, mu);
  if (last_.size() == 0) last_.setZero(b.size());
  const contact::Solution found = contacts_.solve(contact::Problem::dense(A, b, mu), last_);
  last_ = found.impulses;
  return {is_solved(found), found.impulses, found.velocities, found.regimes, found.error};
}

FrictionAnswer ConeBlocks::solve_with_moments(const MatrixXd& A, const VectorXd& b,
                                              const VectorXd& mu) {
  const int n = static_cast<int>(mu.size());
  std::vector<Cone> cones;
  std::vector<int> rows;
  for (int i = 0; i < n; ++i) {
    if (is_held(holders_, i)) continue;
    const Held each = cone_of(A, mu, holders_, i);
    cones.push_back(each.cone);
    rows.insert(rows.end(), each.rows.begin(), each.rows.end());
  }
  const SomeRows part(A, b, rows);
  const auto problem = contact::ConeProblem::dense(part.A, part.b, std::move(cones));
  const contact::ConeSolution found =
      last_.size() > 0 ? cones_.solve(problem, last_) : cones_.solve(problem);
  last_ = found.impulses;
  FrictionAnswer out;
  out.solved = is_solved(found);
  out.error = found.error;
  out.x.setZero(b.size());
  for (std::size_t r = 0; r < rows.size(); ++r)
    out.x[rows[r]] = found.impulses[static_cast<Eigen::Index>(r)];
  out.w = A * out.x - b;
  for (int i = 0; i < n; ++i) {
    const int row = 3 * i, normal = is_held(holders_, i) ? 3 * holders_[at(i)] : row;
    const double force = out.x[normal], slip = out.w.segment<2>(row + 1).norm();
    const double left = mu[i] * force - out.x.segment<2>(row + 1).norm();
    const bool open = !(A(normal, normal) * force > out.w[normal]);
    out.regimes.push_back(
        open ? Regime::separating
             : regime_of(0.5 * (A(row + 1, row + 1) + A(row + 2, row + 2)), left, slip));
  }
  return out;
}

/// All stay closed, and stick where they do not slide already.
Regimes all_held(const VectorXd& mu, int block, const std::vector<VectorXd>& slides,
                 const Holders& holders) {
  Regimes out;
  out.holders = holders;
  for (int i = 0; i < mu.size(); ++i) {
    const bool slides_on = slides[at(i)].size() > 0;
    out.of.push_back(slides_on || mu[i] == 0 ? Regime::sliding : Regime::sticking);
    out.directions.push_back(slides_on    ? slides[at(i)]
                             : mu[i] == 0 ? VectorXd::Zero(block - 1)
                                          : VectorXd());
    out.fixed.push_back(slides_on || mu[i] == 0);
  }
  return out;
}

std::vector<int> held_rows(const Regimes& regimes, int block) {
  std::vector<int> rows;
  for (int i = 0; i < static_cast<int>(regimes.of.size()); ++i)
    for (int k = is_held(regimes.holders, i) ? 1 : 0;
         k < (regimes.of[at(i)] == Regime::sticking ? block : 1); ++k)
      rows.push_back(block * i + k);
  return rows;
}

void take(const SharedForces& from, const Regimes& regimes, FrictionAnswer& to) {
  to.x = from.x;
  to.w = from.w;
  to.regimes = regimes.of;
  to.error = 0;
  to.solved = true;
}

/// The shortest forces with the regimes of an answer: what begins to slip goes against its force.
/// The answer stays where the law has none.
bool share_as(const std::vector<bool>& open, double no_slip, const MatrixXd& A, const VectorXd& b,
              const VectorXd& mu, Regimes held, FrictionAnswer& answer) {
  const int n = static_cast<int>(mu.size()), block = static_cast<int>(b.size()) / n;
  for (int k = 0; k < n; ++k) {
    const VectorXd slip = answer.w.segment(block * k + 1, block - 1);
    if (open[at(k)]) held.of[at(k)] = Regime::separating;
    if (held.of[at(k)] != Regime::sticking || slip.norm() <= no_slip) continue;
    const VectorXd force = answer.x.segment(block * k + 1, block - 1);
    held.of[at(k)] = Regime::sliding;
    held.directions[at(k)] = force.norm() > 0 ? VectorXd(-force.normalized()) : slip.normalized();
  }
  const SharedForces shared = share_forces(A, b, mu, held);
  if (shared.lawful) take(shared, held, answer);
  return shared.lawful;
}

/// Keeps contacts closed that are `closed` or do not open, where the law allows it.
bool settle(const std::vector<bool>& closed, double none, const MatrixXd& A, const VectorXd& b,
            const VectorXd& mu, const Regimes& held, FrictionAnswer& answer) {
  const int n = static_cast<int>(mu.size()), block = static_cast<int>(b.size()) / n;
  std::vector<bool> open(at(n));
  for (int k = 0; k < n; ++k)
    open[at(k)] = answer.regimes[at(k)] == Regime::separating &&
                  (closed.empty() ? answer.w[block * k] > none : !closed[at(k)]);
  for (int k = 0; k < n; ++k)
    if (is_held(held.holders, k)) open[at(k)] = open[at(held.holders[at(k)])];
  return share_as(open, none, A, b, mu, held, answer);
}

/// An iteration may end at any of several answers. Compliant contacts share their forces in one
/// way: from soft to stiff, the first answer whose regimes hold for rigid contacts, too.
bool solve_compliant(const std::vector<bool>& closed, double none, const MatrixXd& A,
                     const VectorXd& b, const VectorXd& all, const VectorXd& mu,
                     const Regimes& held, FrictionAnswer& out) {
  contact::Options options;
  options.law = contact::Law::coulomb;
  options.tolerance = kSolve;
  options.strict = true;
  options.max_work = kCompliantWork;
  ConeBlocks solver(options, held.holders);
  FrictionAnswer answer;
  for (double part = 1; part >= kStiffest; part *= kStiffer) {
    MatrixXd compliant = A;
    compliant.diagonal().array() += part * A.diagonal().mean();
    const FrictionAnswer found = solver.solve(compliant, b, mu);
    if (!found.solved) return false;
    if (found.regimes == answer.regimes) continue;
    answer = found;
    if (!settle(closed, none, A, all, mu, held, answer)) continue;
    out = answer;
    return true;
  }
  return false;
}

AccelerationAnswer solve_contacts(const MatrixXd& A, const VectorXd& free, const VectorXd& mu,
                                  const Holders& holders, const std::vector<VectorXd>& slides,
                                  double part, const std::vector<bool>& closed) {
  const int n = static_cast<int>(mu.size()), block = static_cast<int>(free.size()) / n;
  AccelerationAnswer out;
  out.scale = free.cwiseAbs().maxCoeff();
  out.far = kFarAbove * std::max(out.scale, 1e-12);
  Regimes regimes = all_held(mu, block, slides, holders);
  VectorXd b = without_contradictions(A, -free, held_rows(regimes, block), part * out.scale);
  SharedForces shared = share_forces(A, b, mu, regimes);
  if (shared.lawful) {
    take(shared, regimes, out.contacts);
    return out;
  }
  const VectorXd all = b;
  for (int k = 0; k < n; ++k)
    if (slides[at(k)].size() > 0) b.segment(block * k + 1, block - 1) -= out.far * slides[at(k)];
  const bool decides = shared.several && !closed.empty();
  const double none = kNoChange * out.scale;
  if (decides && solve_compliant(closed, none, A, b, all, mu, regimes, out.contacts)) return out;
  out.contacts = solve_friction(A, b, mu, holders);
  if (decides && out.contacts.solved) settle(closed, none, A, all, mu, regimes, out.contacts);
  return out;
}

/// Bounded laws among the contacts. One that slides is a force that is known; one that sticks is a
/// contact whose normal force x_n is given by its own row, a x_n = b_n with the b_n of the
/// accelerations, and mu x_n the bound. Bounds far above what accelerations ask for would be
/// another scale of forces: they count by `most` only, unless something slides there.
struct BoundedLaws {
  MatrixXd A;
  VectorXd free, mu;
  std::vector<VectorXd> slides;
  std::vector<int> cut;  // bounds that are not whole

  BoundedLaws(const Model& model, ContactRows& rows, const std::vector<VectorXd>& given,
              double most)
      : A(rows.A()), free(rows.free_accelerations()), slides(given) {
    const int block = rows.size(), n = static_cast<int>(given.size());
    mu.resize(n);
    const auto is_known = [&](int k) { return rows.is_bounded(k) && given[at(k)].size() > 0; };
    for (int k = 0; k < n; ++k) {
      const ContactLaw law = model.law(rows.contacts()[at(k)]);
      mu[k] = law.friction;
      if (is_known(k))
        free -= law.bound * rows.A().middleCols(block * k + 1, block - 1) * given[at(k)];
    }
    for (int k = 0; k < n; ++k) {
      if (!is_known(k)) continue;
      const int row = block * k + 1;
      const double own = A(row, row);
      A.row(row).setZero();
      A.col(row).setZero();
      A(row, row) = own;
      free.segment(block * k, block).setZero();
      slides[at(k)] = VectorXd();
      mu[k] = 0;
    }
    const double scale = free.cwiseAbs().maxCoeff();
    for (int k = 0; k < n; ++k) {
      if (!rows.is_bounded(k) || is_known(k)) continue;
      const double bound = model.law(rows.contacts()[at(k)]).bound;
      const double own = A(block * k, block * k), asked = scale > 0 ? scale : bound * own;
      free[block * k] = -asked;
      mu[k] = asked > 0 ? bound * own / asked : 1;
      if (mu[k] <= most) continue;
      mu[k] = most;
      cut.push_back(k);
    }
  }
};

}  // namespace

AccelerationAnswer solve_accelerations(const Model& model, ContactRows& rows,
                                       const std::vector<VectorXd>& slides, double part,
                                       const std::vector<bool>& closed) {
  const int block = rows.size(), n = static_cast<int>(rows.contacts().size());
  AccelerationAnswer out;
  const auto any = [&](const auto& is) {
    for (int k = 0; k < n; ++k)
      if (is(k)) return true;
    return false;
  };
  if (!any([&](int k) { return rows.is_bounded(k); })) {
    VectorXd mu(n);
    for (int k = 0; k < n; ++k) mu[k] = model.law(rows.contacts()[at(k)]).friction;
    return solve_contacts(rows.A(), rows.free_accelerations(), mu, rows.holders(), slides, part,
                          closed);
  }
  for (double most = kCutBound; most <= kMostBound; most *= kCutBound) {
    const BoundedLaws laws(model, rows, slides, most);
    out = solve_contacts(laws.A, laws.free, laws.mu, rows.holders(), laws.slides, part, closed);
    const auto slides_there = [&](int k) {
      return out.contacts.solved && out.contacts.regimes[at(k)] != Regime::sticking;
    };
    if (std::none_of(laws.cut.begin(), laws.cut.end(), slides_there)) break;
  }
  if (!out.contacts.solved) return out;
  // Their own normals are nobody's, and what slides has its force and acceleration.
  VectorXd& x = out.contacts.x;
  for (int k = 0; k < n; ++k) {
    if (!rows.is_bounded(k)) continue;
    const bool slid = slides[at(k)].size() > 0;
    if (slid) {
      x.segment(block * k + 1, block - 1) =
          -model.law(rows.contacts()[at(k)]).bound * slides[at(k)];
      out.contacts.regimes[at(k)] = Regime::sliding;
    }
    x[block * k] = 0;
  }
  const VectorXd w = rows.A() * x + rows.free_accelerations();
  for (int k = 0; k < n; ++k)
    if (rows.is_bounded(k)) out.contacts.w.segment(block * k, block) = w.segment(block * k, block);
  return out;
}

FrictionAnswer solve_impact(const MatrixXd& A, const VectorXd& given, const VectorXd& mu,
                            double band, const Holders& holders) {
  const int n = static_cast<int>(mu.size()), block = static_cast<int>(given.size()) / n;
  if (!A.allFinite() || !given.allFinite()) return solve_friction(A, given, mu, holders);
  Regimes regimes = all_held(mu, block, std::vector<VectorXd>(at(n)), holders);
  const VectorXd b = without_contradictions(A, given, held_rows(regimes, block), band);
  FrictionAnswer out;
  const SharedForces shared = share_forces(A, b, mu, regimes);
  if (shared.lawful) {
    take(shared, regimes, out);
    return out;
  }
  const double none = kNoChange * b.cwiseAbs().maxCoeff();
  if (shared.several && solve_compliant({}, none, A, b, b, mu, regimes, out)) return out;
  out = solve_friction(A, b, mu, holders);
  if (shared.several && out.solved) settle({}, none, A, b, mu, regimes, out);
  return out;
}

FrictionAnswer solve_friction(const MatrixXd& A, const VectorXd& b, const VectorXd& mu,
                              const Holders& holders) {
  const int n = static_cast<int>(mu.size());
  const int block = static_cast<int>(b.size()) / n;
  FrictionAnswer out;
  out.x.setZero(b.size());
  out.w = -b;
  out.regimes.assign(static_cast<std::size_t>(n), Regime::separating);
  if (!A.allFinite() || !b.allFinite()) {  // the motion has left the range of numbers
    out.error = std::numeric_limits<double>::infinity();
    return out;
  }
  double largest = 0;
  for (int i = 0; i < n; ++i)
    if (!is_held(holders, i)) largest = std::max(largest, A(block * i, block * i));
  std::vector<int> free, place(at(n), -1);
  Holders held;
  for (int i = 0; i < n; ++i) {
    const int by = is_held(holders, i) ? place[at(holders[at(i)])] : -1;
    const int of = is_held(holders, i) ? holders[at(i)] : i;
    if (!(A(block * of, block * of) > kLocked * largest)) continue;
    place[at(i)] = static_cast<int>(free.size());
    free.push_back(i);
    held.push_back(by);
  }
  if (holders.empty()) held.clear();
  if (free.empty()) {
    out.solved = true;
    return out;
  }
  std::vector<int> rows;
  VectorXd friction(free.size());
  for (std::size_t i = 0; i < free.size(); ++i) {
    friction[static_cast<Eigen::Index>(i)] = mu[free[i]];
    for (int k = 0; k < block; ++k) rows.push_back(block * free[i] + k);
  }
  const SomeRows part(A, b, rows);
  contact::Options options;
  options.law = contact::Law::coulomb;
  options.tolerance = kSolve;
  options.strict = true;
  FrictionAnswer inner = ConeBlocks(options, held).solve(part.A, part.b, friction);
  if (inner.solved) sharpen(part.A, part.b, friction, held, inner);
  out.solved = inner.solved;
  out.error = inner.error;
  for (std::size_t r = 0; r < rows.size(); ++r)
    out.x[rows[r]] = inner.x[static_cast<Eigen::Index>(r)];
  for (std::size_t i = 0; i < free.size(); ++i) out.regimes[at(free[i])] = inner.regimes[i];
  out.w = A * out.x - b;
  return out;
}

}  // namespace tether::scene::event
