// Tether: impacts and modes of contacts as problems of the contact library, through the joints.
// SPDX-License-Identifier: BSD-3-Clause
#include "friction_solve.hpp"
#include "bounds.hpp"

#include <algorithm>
#include <cmath>
#include <tether/contact/cones.hpp>

namespace tether::scene::event {

using contact::Cone;
using contact::Regime;
namespace {

constexpr double kSolve = 1e-12;   // tolerance of the contact library
constexpr double kFarAbove = 1e5;  // S over all accelerations

/// The cones of a problem, and their rows in it. Those without a bound, and those of contacts that
/// the joints lock, are left out.
struct Product {
  std::vector<Cone> cones;
  std::vector<int> rows;

  explicit Product(const FrictionProblem& problem) {
    double largest = 0;
    for (const ConePart& p : problem.parts)
      if (p.has_normal()) largest = std::max(largest, problem.A(p.first, p.first));
    for (const ConePart& p : problem.parts) {
      if (p.normal < 0 && p.bound > 0) {
        cones.push_back(Cone::bounded(p.bound));
        take(p);
      }
      // Less than 1e-12 of the largest mobility is rounding: joints lock it.
      if (!p.has_normal() || !(problem.A(p.first, p.first) > 1e-12 * largest)) continue;
      take(p);
      double length[2] = {0, 0};  // of the moments about the normal, across it
      for (int k = 0; k < 2; ++k)
        for (const ConePart& q : problem.parts)
          if (q.is_held() && q.normal == p.first && q.slips == k + 1) {
            take(q);
            length[k] = q.mu;
          }
      cones.push_back(cone_of(p, length));
    }
  }

 private:
  void take(const ConePart& p) {
    for (int k = 0; k < p.rows(); ++k) rows.push_back(p.first + k);
  }
  static Cone cone_of(const ConePart& p, const double length[2]) {
    if (p.slips == 0) return Cone::nonnegative();
    if (p.slips == 1) return Cone::planar(p.mu);
    if (length[0] == 0 && length[1] == 0) return Cone::friction(p.mu);
    if (length[1] == 0) return Cone::with_torsional(p.mu, length[0]);
    return length[0] == 0 ? Cone::with_rolling(p.mu, length[1])
                          : Cone::with_rolling(p.mu, length[1], length[0]);
  }
};

/// Sticking where the rest of the limit, as a velocity, is at least the slip.
Regime regime_of(const FrictionProblem& problem, const ConePart& p, const FrictionSolution& found) {
  if (p.normal >= 0 && !(problem.A(p.normal, p.normal) * found.x[p.normal] > found.w[p.normal]))
    return Regime::separating;
  if (p.slips == 0) return Regime::sliding;
  const double mobility = problem.A.diagonal().segment(p.slip(), p.slips).mean();
  const double left = p.limit(found.x) - p.slip_of(found.x).norm();
  return mobility * left < p.slip_of(found.w).norm() ? Regime::sliding : Regime::sticking;
}

/// Starts where the last solve ended.
class ProductSolver {
 public:
  explicit ProductSolver(double max_work = contact::Options().max_work)
      : solver_([&] {
          contact::Options options;
          options.law = contact::Law::coulomb;
          options.tolerance = kSolve;
          options.strict = true;
          options.max_work = max_work;
          return options;
        }()) {}

  FrictionSolution solve(const FrictionProblem& problem) {
    FrictionSolution out;
    out.x.setZero(problem.b.size());
    out.w = -problem.b;
    out.regimes.assign(problem.parts.size(), Regime::separating);
    if (!problem.A.allFinite() || !problem.b.allFinite()) {  // the motion has left the numbers
      out.error = kInfinity;
      return out;
    }
    const Product product(problem);
    out.solved = product.rows.empty();
    if (out.solved) return out;
    const auto cones = contact::ConeProblem::dense(problem.A(product.rows, product.rows),
                                                   problem.b(product.rows), product.cones);
    const contact::ConeSolution found =
        last_.size() > 0 ? solver_.solve(cones, last_) : solver_.solve(cones);
    last_ = found.impulses;
    out.error = found.error;
    // An error of 1e-8 is enough for the regimes, by which sharpen() finds the answer.
    out.solved = found.status == contact::Status::solved ||
                 found.status == contact::Status::round_off ||
                 (found.error < 1e-8 && found.status != contact::Status::infeasible);
    out.x(product.rows) = found.impulses;
    out.w = problem.A * out.x - problem.b;
    for (std::size_t i = 0; i < problem.parts.size(); ++i)
      out.regimes[i] = regime_of(problem, problem.parts[i], out);
    return out;
  }

 private:
  contact::ConeSolver solver_;
  VectorXd last_;  // impulses by row of the product
};

/// All stay closed, and stick where they do not slide already.
Regimes all_held(const FrictionProblem& problem, const std::vector<VectorXd>& slides) {
  Regimes out;
  for (std::size_t i = 0; i < problem.parts.size(); ++i) {
    const ConePart& p = problem.parts[i];
    const bool slides_on = !slides.empty() && slides[i].size() > 0;
    const bool free = p.slips == 0 || (p.mu == 0 && p.bound == 0);
    out.of.push_back(slides_on || free ? Regime::sliding : Regime::sticking);
    out.directions.push_back(slides_on ? VectorXd(slides[i].head(p.slips))
                             : free    ? VectorXd::Zero(p.slips)
                                       : VectorXd());
    out.fixed.push_back(slides_on || free);
  }
  return out;
}

std::vector<int> held_rows(const FrictionProblem& problem, const Regimes& regimes) {
  std::vector<int> rows;
  for (std::size_t i = 0; i < problem.parts.size(); ++i) {
    const ConePart& p = problem.parts[i];
    const int end = regimes.of[i] == Regime::sticking ? p.first + p.rows() : p.slip();
    for (int row = p.first; row < end; ++row) rows.push_back(row);
  }
  return rows;
}

/// The shortest forces with the regimes of an answer: what begins to slip goes against its force.
/// Keeps contacts closed that are `closed` or do not open. The answer stays where the law has none.
bool settle(const std::vector<bool>& closed, double none, const FrictionProblem& problem,
            Regimes held, FrictionSolution& answer) {
  for (std::size_t k = 0; k < problem.parts.size(); ++k) {
    const ConePart& p = problem.parts[k];
    if (p.has_normal() && answer.regimes[k] == Regime::separating &&
        (closed.empty() ? answer.w[p.first] > none : !closed[k]))
      held.of[k] = Regime::separating;
    const VectorXd slip = p.slip_of(answer.w), force = p.slip_of(answer.x);
    if (held.of[k] != Regime::sticking || slip.norm() <= none) continue;
    held.of[k] = Regime::sliding;
    held.directions[k] = force.norm() > 0 ? VectorXd(-force.normalized()) : slip.normalized();
  }
  FrictionSolution shared = share_forces(problem, held);
  if (!shared.solved) return false;
  answer = std::move(shared);
  return true;
}

/// An iteration may end at any of several answers. Compliant contacts share their forces in one
/// way: from soft to stiff, the first answer whose regimes hold for rigid contacts, too.
/// `with_slips`: the problem with S.
bool solve_compliant(const std::vector<bool>& closed, double none, FrictionProblem with_slips,
                     const FrictionProblem& problem, const Regimes& held, FrictionSolution& out) {
  ProductSolver solver(3e7);  // operations, of each of some problems
  FrictionSolution answer;
  for (double part = 1; part >= 1e-6; part *= 0.1) {
    with_slips.A = problem.A;
    with_slips.A.diagonal().array() += part * problem.A.diagonal().mean();
    const FrictionSolution found = solver.solve(with_slips);
    if (!found.solved) return false;
    if (found.regimes == answer.regimes) continue;
    answer = found;
    if (!settle(closed, none, problem, held, answer)) continue;
    out = answer;
    return true;
  }
  return false;
}

/// Whether parts that should hold slip, which have the other coefficient from here on.
bool let_slip(const ContactRows& rows, double none, const FrictionSolution& answer,
              FrictionProblem& problem) {
  bool any = false;
  for (std::size_t k = 0; k < problem.parts.size(); ++k) {
    ConePart& p = problem.parts[k];
    const double slips = rows.parts()[k].mu;
    if (!(p.mu > slips) || answer.regimes[k] != Regime::sliding ||
        p.slip_of(answer.w).norm() <= none)
      continue;
    p.mu = slips;
    any = true;
  }
  return any;
}

/// All held if the law has any forces for that, else by an iteration, whose answer is settled where
/// `decides` and forces are shared in several ways.
FrictionSolution solve_shared(FrictionProblem& problem, const std::vector<VectorXd>& slides,
                              double band, double far, const std::vector<bool>& closed,
                              bool decides) {
  Regimes held = all_held(problem, slides);
  problem.b = without_contradictions(problem.A, problem.b, held_rows(problem, held), band);
  FrictionSolution out = share_forces(problem, held);
  if (out.solved) return out;
  decides = decides && out.shared;
  FrictionProblem with_slips = problem;
  for (std::size_t k = 0; k < slides.size(); ++k)
    if (slides[k].size() > 0) {
      const ConePart& p = problem.parts[k];
      p.slip_of(with_slips.b) -= far * slides[k].head(p.slips);
    }
  const double none = kNoChange * problem.b.cwiseAbs().maxCoeff();
  if (decides && solve_compliant(closed, none, with_slips, problem, held, out)) return out;
  out = solve_friction(with_slips);
  if (decides && out.solved) settle(closed, none, problem, held, out);
  return out;
}

AccelerationSolution solve_with_bounds(ContactRows& rows, const std::vector<VectorXd>& slides,
                                       double part, const std::vector<bool>& closed) {
  FrictionProblem problem = rows.problem(-rows.free_accelerations());
  std::vector<VectorXd> turning = slides;
  VectorXd known = VectorXd::Zero(problem.b.size());
  for (std::size_t k = 0; k < slides.size(); ++k) {
    ConePart& p = problem.parts[k];
    if (p.normal >= 0 || slides[k].size() == 0) continue;
    p.slip_of(known) = -p.bound * slides[k].head(p.slips);
    p.bound = 0;
    turning[k] = VectorXd();
  }
  problem.b -= problem.A * known;
  AccelerationSolution out;
  out.scale = problem.b.cwiseAbs().maxCoeff();
  for (std::size_t k = 0; k < slides.size(); ++k)
    if (slides[k].size() == 0) problem.parts[k].mu = problem.parts[k].holding;
  const VectorXd b = problem.b;
  do {
    problem.b = b;
    out.contacts = solve_shared(problem, turning, part * out.scale,
                                kFarAbove * std::max(out.scale, 1e-12), closed, !closed.empty());
    if (!out.contacts.solved) return out;
  } while (let_slip(rows, kNoChange * out.scale, out.contacts, problem));
  out.contacts.x += known;
  for (std::size_t k = 0; k < slides.size(); ++k)
    if (turning[k].size() < slides[k].size()) out.contacts.regimes[k] = Regime::sliding;
  return out;
}

}  // namespace

AccelerationSolution solve_accelerations(ContactRows& rows, const std::vector<VectorXd>& slides,
                                         double part, const std::vector<bool>& closed) {
  for (int round = 0;; ++round) {
    AccelerationSolution out = solve_with_bounds(rows, slides, part, closed);
    // Bounds that follow forces contract.
    if (!out.contacts.solved || round == 100 || !rows.share_bounds(out.contacts, slides))
      return out;
  }
}

FrictionSolution solve_impact(FrictionProblem problem, double band) {
  if (!problem.A.allFinite() || !problem.b.allFinite()) return solve_friction(problem);
  return solve_shared(problem, {}, band, 0, {}, true);
}

FrictionSolution solve_friction(const FrictionProblem& problem) {
  FrictionSolution out = ProductSolver().solve(problem);
  if (out.solved) sharpen(problem, out);
  return out;
}

ContactRows::ContactRows(Model& model, std::vector<int> contacts)
    : model_(model), contacts_(std::move(contacts)), factor_(kDependent) {
  take_rows();
  PL_ = L_.transpose();
  model.divide_by_mass(PL_);
  if (model.joint_rows() > 0) {
    VectorXd rate;
    model.joints(G_, rate, joint_rest_);
    MG_ = G_.transpose();
    model.divide_by_mass(MG_);
    factor_joints();
    // With the forces of the joints: A = F' M^-1 F is never indefinite, and light bodies, whose
    // parts cancel in L P L', leave no rounding in it.
    const MatrixXd F = L_.transpose() - G_.transpose() * joint_solve(G_ * PL_);
    PL_ = F;
    model.divide_by_mass(PL_);
    A_ = F.transpose() * PL_;
  } else {
    A_ = L_ * PL_;
  }
  A_ = (0.5 * (A_ + A_.transpose())).eval();
  if (G_.rows() > 0) free_held();
}

// A limit has no slip, a bounded law and a moment have no normal of their own.
void ContactRows::take_rows() {
  std::vector<ContactKinematics> kinematics(contacts_.size());
  int rows = 0;
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    const ContactLaw law = model_.law(contacts_[k]);
    model_.evaluate_contact(contacts_[k], kinematics[k]);
    ConePart p;
    p.first = rows;
    p.slips = law.is_line() ? 1 : kinematics[k].tangents.isZero(0) ? 0 : kTangents;
    p.mu = law.is_bounded() ? 0 : law.friction;
    p.holding = law.is_bounded() ? 0 : model_.holding(contacts_[k]);
    p.bound = std::max(0.0, law.bound);
    if (law.has_normal()) p.normal = rows;
    if (law.is_moment())
      p.normal =
          parts_[at(static_cast<int>(std::find(contacts_.begin(), contacts_.end(), law.held_by) -
                                     contacts_.begin()))]
              .first;
    parts_.push_back(p);
    rows += p.rows();
  }
  L_.resize(rows, model_.velocities());
  rate_.resize(rows);
  rest_.resize(rows);
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    const ConePart& p = parts_[k];
    if (p.has_normal()) {
      L_.row(p.first) = kinematics[k].normal;
      rate_[p.first] = kinematics[k].normal_rate;
      rest_[p.first] = kinematics[k].normal_rest;
    }
    L_.middleRows(p.slip(), p.slips) = kinematics[k].tangents.topRows(p.slips);
    p.slip_of(rate_) = kinematics[k].slip_rate.head(p.slips);
    p.slip_of(rest_) = kinematics[k].slip_rest.head(p.slips);
  }
}

bool ContactRows::share_bounds(const FrictionSolution& answer,
                               const std::vector<VectorXd>& slides) {
  std::vector<std::size_t> sharing;
  for (std::size_t k = 0; k < contacts_.size(); ++k)
    if (model_.shares_bound(contacts_[k])) sharing.push_back(k);
  if (sharing.empty()) return false;
  std::vector<LawForce> forces(at(model_.contacts()));
  for (const std::size_t k : sharing) {
    const double x = answer.x[parts_[k].first];
    LawForce& force = forces[at(contacts_[k])];
    if (slides[k].size() > 0)
      force.slides = -slides[k][0];
    else if (answer.regimes[k] == Regime::sliding && x != 0)
      force.slides = x > 0 ? 1 : -1;
    else
      force.held = x;
  }
  std::vector<double> bounds;
  model_.share_bounds(1, forces, bounds);
  double change = 0, largest = 0;
  for (const std::size_t k : sharing) {
    const double bound = std::max(0.0, bounds[at(contacts_[k])]);
    change = std::max(change, std::abs(bound - std::exchange(parts_[k].bound, bound)));
    largest = std::max(largest, bound);
  }
  return change > kSolve * largest;
}

// Bounded laws and moments about axes that joints hold do nothing: what is left of their mobility
// is rounding.
void ContactRows::free_held() {
  for (const ConePart& p : parts_) {
    if (p.has_normal()) continue;
    MatrixXd alone = L_.middleRows(p.first, p.slips).transpose();
    model_.divide_by_mass(alone);
    const double most =
        L_.middleRows(p.first, p.slips).cwiseProduct(alone.transpose()).rowwise().sum().maxCoeff();
    for (int i = p.first; i < p.first + p.slips; ++i) {
      if (A_(i, i) > kHeldByJoints * most) continue;
      A_.row(i).setZero();
      A_.col(i).setZero();
      PL_.col(i).setZero();
      A_(i, i) = most;
    }
  }
}

}  // namespace tether::scene::event
