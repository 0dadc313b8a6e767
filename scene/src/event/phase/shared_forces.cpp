// Tether: forces of contacts that share them in more than one way. SPDX-License-Identifier:
// BSD-3-Clause
#include "friction_solve.hpp"

#include <tether/linalg/pivoted_qr.hpp>

namespace tether::scene::event {

using contact::Regime;
namespace {

constexpr double kContradicts = 1e-10;  // of b
constexpr double kSame = 1e-7;          // of the answer's size: the exact one against the library's

/// The unknowns of what is closed: normal forces, and forces of slips that stick.
class HeldRows {
  const ConePart& part(int i) const { return problem_.parts[at(i)]; }
  /// Those of a part that sticks, among the unknowns.
  template <class Vector>
  auto slip_force(int i, Vector& x) const {
    const ConePart& p = part(i);
    return x.segment(p.slips > 0 ? place_[at(p.slip())] : 0, p.slips);
  }

 public:
  HeldRows(const FrictionProblem& problem, const Regimes& regimes)
      : problem_(problem),
        regimes_(regimes),
        place_(at(static_cast<int>(problem.b.size())), -1),
        known_(VectorXd::Zero(problem.b.size())) {
    for (int i = 0; i < static_cast<int>(problem.parts.size()); ++i) {
      const ConePart& p = part(i);
      const bool open = p.is_held() && place_[at(p.normal)] < 0;
      if (open || regimes.of[at(i)] == Regime::separating) continue;
      closed_.push_back(i);
      if (p.has_normal()) take(p.first);
      for (int k = 0; k < p.slips && !slides(i); ++k) take(p.slip() + k);
      if (slides(i) && p.normal < 0) p.slip_of(known_) = -p.bound * regimes.directions[at(i)];
    }
    const VectorXd right = problem.b - problem.A * known_;
    right_ = right(rows_);
    S_ = problem.A(rows_, rows_);
    for (const int i : closed_) {
      const ConePart& p = part(i);
      if (!slides(i) || p.normal < 0) continue;
      const VectorXd column = problem.A.middleCols(p.slip(), p.slips) * regimes.directions[at(i)];
      S_.col(place_[at(p.normal)]) -= p.mu * column(rows_);
    }
  }

  bool empty() const { return rows_.empty(); }
  bool several() const { return free_.cols() > 0; }

  /// False: nothing holds all rows.
  bool solve() {
    if (empty()) return false;
    linalg::LeastSquares factor(kDependent);
    factor.factor(S_);
    x_ = factor.solve(right_);
    const double largest = problem_.b.cwiseAbs().maxCoeff();
    return (S_ * x_ - right_).cwiseAbs().maxCoeff() <= kContradicts * largest;
  }

  /// Whether other forces hold the rows as well.
  void find_other_forces() {
    if (empty()) return;
    linalg::PivotedQr of_rows(kDependent);
    of_rows.factor(S_.transpose());
    free_ = of_rows.left_null_space();
  }

  /// They act against what closes the contacts: else contacts that could open as well press
  /// themselves together (Painleve). What no other row moves and that moves none says nothing of
  /// them.
  bool resists() const {
    double sum = 0;
    for (Eigen::Index r = 0; r < x_.size(); ++r)
      if ((S_.row(r).array() != 0).count() > 1 || (S_.col(r).array() != 0).count() > 1)
        sum += x_[r] * right_[r];
    return sum >= 0;
  }

  bool is_lawful(const VectorXd& x) const {
    const double least = -kNoForce * x.cwiseAbs().maxCoeff();
    for (const int i : closed_) {
      if (part(i).has_normal() && x[place_[at(part(i).first)]] < least) return false;
      if (!slides(i) && limit(i, x) - slip_force(i, x).norm() < least) return false;
    }
    return true;
  }

  /// x + N z onto the cones: alternating directions for the shortest z. A few digits of it do: w
  /// is that of any z.
  bool move_into_cones() {
    if (!find_in_cones()) return false;
    for (const int i : closed_)
      if (part(i).has_normal()) {
        double& normal = x_[place_[at(part(i).first)]];
        normal = std::max(0.0, normal);
      }
    return true;
  }
  VectorXd forces() const {
    VectorXd x = known_;
    x(rows_) = x_;
    for (const int i : closed_)
      if (slides(i) && part(i).normal >= 0)
        part(i).slip_of(x) = -part(i).mu * x[part(i).normal] * regimes_.directions[at(i)];
    return x;
  }

 private:
  bool find_in_cones() {
    if (is_lawful(x_)) return true;
    if (!several()) return false;
    VectorXd moved = x_, inside, off = VectorXd::Zero(x_.size());
    // 0.99 = 1 / (1 + c): the term c |z|^2 / 2 that makes z short.
    for (int k = 0; k < 1000; ++k) {
      inside = moved + off;
      project(inside);
      off += moved - inside;
      moved = x_ + 0.99 * free_ * (free_.transpose() * (inside - off - x_));
      if (is_lawful(moved)) {
        x_ = moved;
        return true;
      }
    }
    return false;
  }

  /// The nearest point of the cones: those of one normal that its slips are out of raise it.
  void project(VectorXd& x) const {
    for (const int i : closed_) {
      const ConePart& p = part(i);
      if (p.is_held()) continue;
      std::vector<int> out;
      for (const int k : closed_)
        if (!slides(k) && (k == i || (p.has_normal() && part(k).normal == p.normal)))
          out.push_back(k);
      double on = p.has_normal() ? x[place_[at(p.first)]] : p.bound;
      if (p.has_normal()) x[place_[at(p.first)]] = on = raised(x, on, out);
      for (const int k : out) {
        auto force = slip_force(k, x);
        const double length = force.norm(), most = p.has_normal() ? part(k).mu * on : on;
        if (length > most) force *= most / length;
      }
    }
  }
  /// A normal force that those of `out` raise which exceed their share of it.
  double raised(const VectorXd& x, double normal, std::vector<int> out) const {
    double on = normal;
    for (std::size_t count = out.size() + 1; out.size() < count;) {
      count = out.size();
      out.erase(std::remove_if(out.begin(), out.end(),
                               [&](int k) { return slip_force(k, x).norm() <= part(k).mu * on; }),
                out.end());
      double sum = normal, weight = 1;
      for (const int k : out) {
        sum += part(k).mu * slip_force(k, x).norm();
        weight += part(k).mu * part(k).mu;
      }
      on = std::max(0.0, sum / weight);
    }
    return on;
  }

  bool slides(int i) const { return regimes_.of[at(i)] == Regime::sliding; }
  void take(int row) {
    place_[at(row)] = static_cast<int>(rows_.size());
    rows_.push_back(row);
  }
  double limit(int i, const VectorXd& x) const {
    const ConePart& p = part(i);
    return p.normal < 0 ? p.bound : p.mu * x[place_[at(p.normal)]];
  }

  const FrictionProblem& problem_;
  const Regimes& regimes_;
  std::vector<int> closed_, rows_, place_;  // parts; rows of the unknowns; place of each row
  MatrixXd S_, free_;
  VectorXd known_, right_, x_;
};

/// Directions of slip turn towards those of w: where they hardly slip, w turns by what the friction
/// moves. Returns how far w is from them.
double turn(const FrictionProblem& problem, const FrictionSolution& now, Regimes& regimes) {
  std::vector<std::size_t> turning;
  for (std::size_t i = 0; i < regimes.of.size(); ++i)
    if (regimes.of[i] == Regime::sliding && !regimes.fixed[i]) turning.push_back(i);
  double largest = 0;
  for (const std::size_t i : turning) {
    const ConePart& p = problem.parts[i];
    VectorXd& d = regimes.directions[i];
    const VectorXd slip = p.slip_of(now.w);
    const double along = slip.dot(d);
    const VectorXd across = slip - along * d;
    largest = std::max({largest, across.norm(), -along});
    double moves = std::abs(along);
    for (const std::size_t k : turning) {
      const ConePart& q = problem.parts[k];
      moves +=
          problem.A.block(p.slip(), q.slip(), p.slips, q.slips).norm() * q.slip_of(now.x).norm();
    }
    if (moves > 0) d = (d + across / moves).normalized();
  }
  return largest;
}

}  // namespace

VectorXd without_contradictions(const MatrixXd& A, const VectorXd& b, const std::vector<int>& rows,
                                double band) {
  if (rows.empty()) return b;
  linalg::PivotedQr factor(kDependent);
  factor.factor(A(rows, rows));
  const MatrixXd none = factor.left_null_space();
  const VectorXd against = none * (none.transpose() * b(rows));
  VectorXd out = b;
  if (against.cwiseAbs().maxCoeff() <= band) out(rows) -= against;
  return out;
}

FrictionSolution share_forces(const FrictionProblem& problem, Regimes& regimes) {
  const double none = kNoChange * problem.b.cwiseAbs().maxCoeff();
  FrictionSolution out;
  double off = 0, before = 0;
  for (int pass = 0; pass < 50; ++pass) {
    HeldRows rows(problem, regimes);
    const bool held = rows.solve();
    rows.find_other_forces();
    out.shared = rows.several();
    if (!held || !out.shared || !rows.resists() || !rows.move_into_cones()) return out;
    out.x = rows.forces();
    out.w = problem.A * out.x - problem.b;
    const Regimes now = regimes;
    before = off;
    off = turn(problem, out, regimes);
    // Directions no longer come nearer to those of w.
    if (off == 0 || (pass > 0 && off <= none && off >= 0.9 * before)) {
      regimes = now;
      break;
    }
  }
  out.regimes = regimes.of;
  out.solved = off <= none;
  for (const ConePart& p : problem.parts)
    if (p.has_normal()) out.solved = out.solved && out.w[p.first] >= -none;
  return out;
}

void sharpen(const FrictionProblem& problem, FrictionSolution& answer) {
  const std::size_t n = problem.parts.size();
  Regimes regimes{answer.regimes, std::vector<VectorXd>(n), {}};
  const auto slides = [&](std::size_t i) { return regimes.of[i] == Regime::sliding; };
  for (std::size_t i = 0; i < n; ++i) {
    if (!slides(i)) continue;
    const VectorXd slip = problem.parts[i].slip_of(answer.w);
    regimes.directions[i] = slip.norm() > 0
                                ? slip.normalized()
                                : VectorXd(-problem.parts[i].slip_of(answer.x)).normalized();
  }
  VectorXd x, w;
  for (int pass = 0; pass < 30; ++pass) {
    HeldRows rows(problem, regimes);
    rows.solve();
    x = rows.forces();
    w = problem.A * x - problem.b;
    double turned = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const VectorXd slip = problem.parts[i].slip_of(w);
      if (!slides(i) || !(slip.norm() > 0)) continue;
      turned = std::max(turned, (slip.normalized() - regimes.directions[i]).norm());
      regimes.directions[i] = slip.normalized();
    }
    if (turned < 1e-15) break;  // rad, rounding
    if (turned > 1) return;     // rad: it does not settle, the library's answer stands
  }
  // Still an answer of the law?
  const double force = answer.x.cwiseAbs().maxCoeff(), speed = problem.b.cwiseAbs().maxCoeff();
  for (const ConePart& p : problem.parts) {
    if (p.has_normal() && x[p.first] < -kSame * force) return;
    if (p.slip_of(x).norm() > p.limit(x) + kSame * force) return;
  }
  if ((w - answer.w).cwiseAbs().maxCoeff() > kSame * (speed + 1e-300)) return;
  answer.x = x;
  answer.w = w;
}

}  // namespace tether::scene::event
