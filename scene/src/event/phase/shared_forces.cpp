// Tether: forces of contacts that share them in more than one way. SPDX-License-Identifier:
// BSD-3-Clause
#include "shared_forces.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/least_squares.hpp>
#include <tether/linalg/pivoted_qr.hpp>

namespace tether::scene::event {

using contact::Regime;
using linalg::at;

namespace {

constexpr double kSameForces = 1e-11;
constexpr double kContradicts = 1e-10;  // of b
constexpr double kOutOfCone = 1e-9;     // of the largest force
constexpr double kNoSlip = 3e-9;        // of b: no velocity or acceleration
constexpr double kFollow = 0.99;
constexpr int kConeSteps = 1000;
constexpr int kTurns = 50;
constexpr double kSettles = 0.9;
constexpr int kSharpenings = 30;
constexpr double kTurnedByRounding = 1e-15;
constexpr double kSame = 1e-7;  // of the answer's size: the exact one against the library's

/// The closed contacts' unknowns: x_n where it is their own, and x_t where it sticks.
class HeldRows {
 public:
  HeldRows(const MatrixXd& A, const VectorXd& b, const VectorXd& mu, const Regimes& regimes)
      : A_(A), b_(b), mu_(mu), block_(static_cast<int>(b.size() / mu.size())), regimes_(regimes) {
    for (int i = 0; i < mu.size(); ++i) {
      if (regimes.of[at(i)] == Regime::separating) continue;
      const bool held = is_held(regimes.holders, i);
      const int by = held ? place_of(regimes.holders[at(i)]) : -1;
      if (held && by < 0) continue;
      const int first = static_cast<int>(rows_.size());
      contacts_.push_back(i);
      normal_.push_back(held ? normal_[at(by)] : first);
      tangents_.push_back(held ? first : first + 1);
      for (int k = held ? 1 : 0; k < (regimes.of[at(i)] == Regime::sticking ? block_ : 1); ++k)
        rows_.push_back(block_ * i + k);
    }
    const int m = static_cast<int>(rows_.size());
    right_.resize(m);
    S_.resize(m, m);
    VectorXd column;
    for (int c = 0; c < m; ++c) {
      const int row = rows_[at(c)], i = row / block_;
      right_[c] = b[row];
      column = A.col(row);
      if (row % block_ == 0)
        for (const int k : with_normal_of(i))
          if (slides(k))
            column -= mu[k] * A.middleCols(block_ * k + 1, block_ - 1) * regimes.directions[at(k)];
      for (int r = 0; r < m; ++r) S_(r, c) = column[rows_[at(r)]];
    }
  }

  bool empty() const { return rows_.empty(); }
  bool several() const { return free_.cols() > 0; }

  /// False: nothing holds all rows.
  bool solve() {
    if (empty()) return false;
    linalg::LeastSquares factor(kSameForces);
    factor.factor(S_);
    x_ = factor.solve(right_);
    return (S_ * x_ - right_).cwiseAbs().maxCoeff() <= kContradicts * b_.cwiseAbs().maxCoeff();
  }

  /// Whether other forces hold the rows as well.
  void look_for_others() {
    if (empty()) return;
    linalg::PivotedQr of_rows(kSameForces);
    of_rows.factor(S_.transpose());
    free_ = of_rows.left_null_space();
  }

  /// They act against what closes the contacts: else contacts that could open as well press
  /// themselves together (Painleve). What no other row moves and that moves none, such as the
  /// normal of a bounded law, says nothing of them.
  bool resists() const {
    double sum = 0;
    for (Eigen::Index r = 0; r < x_.size(); ++r)
      if ((S_.row(r).array() != 0).count() > 1 || (S_.col(r).array() != 0).count() > 1)
        sum += x_[r] * right_[r];
    return sum >= 0;
  }

  bool is_lawful(const VectorXd& x) const {
    const double least = -kOutOfCone * x.cwiseAbs().maxCoeff();
    for (std::size_t k = 0; k < contacts_.size(); ++k) {
      const int i = contacts_[k];
      const double normal = x[normal_[k]];
      if (normal < least) return false;
      if (!slides(i) && mu_[i] * normal - x.segment(tangents_[k], block_ - 1).norm() < least)
        return false;
    }
    return true;
  }

  /// x + N z onto the cones: alternating directions for the shortest z. A few digits of it do: w
  /// is that of any z.
  bool move_into_cones() {
    if (!find_in_cones()) return false;
    for (const int normal : normal_) x_[normal] = std::max(0.0, x_[normal]);
    return true;
  }
  VectorXd forces() const {
    VectorXd x = VectorXd::Zero(b_.size());
    for (std::size_t k = 0; k < contacts_.size(); ++k) {
      const int i = contacts_[k];
      const double normal = x_[normal_[k]];
      if (!is_held(regimes_.holders, i)) x[block_ * i] = normal;
      if (slides(i))
        x.segment(block_ * i + 1, block_ - 1) = -mu_[i] * normal * regimes_.directions[at(i)];
      else
        x.segment(block_ * i + 1, block_ - 1) = x_.segment(tangents_[k], block_ - 1);
    }
    return x;
  }

 private:
  bool find_in_cones() {
    if (is_lawful(x_)) return true;
    if (!several()) return false;
    VectorXd moved = x_, inside, off = VectorXd::Zero(x_.size());
    for (int k = 0; k < kConeSteps; ++k) {
      inside = moved + off;
      project(inside);
      off += moved - inside;
      moved = x_ + kFollow * free_ * (free_.transpose() * (inside - off - x_));
      if (is_lawful(moved)) {
        x_ = moved;
        return true;
      }
    }
    return false;
  }

  /// The nearest point of the cones: those of one normal that its tangents are out of raise it.
  void project(VectorXd& x) const {
    for (std::size_t k = 0; k < contacts_.size(); ++k) {
      if (is_held(regimes_.holders, contacts_[k])) continue;
      double& normal = x[normal_[k]];
      std::vector<std::size_t> out;
      for (const int i : with_normal_of(contacts_[k]))
        if (const int place = place_of(i); place >= 0 && !slides(i)) out.push_back(at(place));
      const auto length = [&](std::size_t j) { return x.segment(tangents_[j], block_ - 1).norm(); };
      double on = normal;
      for (std::size_t count = out.size() + 1; out.size() < count;) {
        count = out.size();
        out.erase(
            std::remove_if(out.begin(), out.end(),
                           [&](std::size_t j) { return length(j) <= mu_[contacts_[j]] * on; }),
            out.end());
        double sum = normal, weight = 1;
        for (const std::size_t j : out) {
          const double mu = mu_[contacts_[j]];
          sum += mu * length(j);
          weight += mu * mu;
        }
        on = std::max(0.0, sum / weight);
      }
      normal = on;
      for (const std::size_t j : out) {
        const double all = length(j);
        x.segment(tangents_[j], block_ - 1) *= all > 0 ? mu_[contacts_[j]] * on / all : 0;
      }
    }
  }
  bool slides(int i) const { return regimes_.of[at(i)] == Regime::sliding; }
  /// Place of a contact among the closed ones; -1: it is open.
  int place_of(int i) const {
    const auto found = std::lower_bound(contacts_.begin(), contacts_.end(), i);
    return found != contacts_.end() && *found == i ? static_cast<int>(found - contacts_.begin())
                                                   : -1;
  }
  /// The contact and those that it holds.
  std::vector<int> with_normal_of(int i) const {
    std::vector<int> out = {i};
    for (int k = 0; k < static_cast<int>(regimes_.holders.size()); ++k)
      if (regimes_.holders[at(k)] == i) out.push_back(k);
    return out;
  }

  const MatrixXd& A_;
  const VectorXd& b_;
  const VectorXd& mu_;
  int block_;
  const Regimes& regimes_;
  std::vector<int> contacts_, normal_, tangents_, rows_;  // places of unknowns
  MatrixXd S_, free_;
  VectorXd right_, x_;
};

/// Directions of slip turn towards those of w: where they hardly slip, w turns by what the friction
/// moves. Returns how far w is from them.
double turn(const MatrixXd& A, const SharedForces& now, Regimes& regimes) {
  const int n = static_cast<int>(regimes.of.size()), block = static_cast<int>(now.x.size()) / n;
  std::vector<int> turning;
  for (int i = 0; i < n; ++i)
    if (regimes.of[at(i)] == Regime::sliding && !regimes.fixed[at(i)]) turning.push_back(i);
  double largest = 0;
  for (const int i : turning) {
    VectorXd& d = regimes.directions[at(i)];
    const VectorXd slip = now.w.segment(block * i + 1, block - 1);
    const double along = slip.dot(d);
    const VectorXd across = slip - along * d;
    largest = std::max({largest, across.norm(), -along});
    double moves = std::abs(along);
    for (const int k : turning)
      moves += A.block(block * i + 1, block * k + 1, block - 1, block - 1).norm() *
               now.x.segment(block * k + 1, block - 1).norm();
    if (moves > 0) d = (d + across / moves).normalized();
  }
  return largest;
}

}  // namespace

SomeRows::SomeRows(const MatrixXd& whole, const VectorXd& right, const std::vector<int>& rows)
    : A(rows.size(), rows.size()), b(rows.size()) {
  const int m = static_cast<int>(rows.size());
  for (int r = 0; r < m; ++r) {
    b[r] = right[rows[at(r)]];
    for (int c = 0; c < m; ++c) A(r, c) = whole(rows[at(r)], rows[at(c)]);
  }
}

VectorXd without_contradictions(const MatrixXd& A, const VectorXd& b, const std::vector<int>& rows,
                                double band) {
  const int m = static_cast<int>(rows.size());
  const SomeRows part(A, b, rows);
  linalg::PivotedQr factor(kSameForces);
  factor.factor(part.A);
  const MatrixXd none = factor.left_null_space();
  const VectorXd against = none * (none.transpose() * part.b);
  VectorXd out = b;
  if (m > 0 && against.cwiseAbs().maxCoeff() <= band)
    for (int r = 0; r < m; ++r) out[rows[at(r)]] -= against[r];
  return out;
}

SharedForces share_forces(const MatrixXd& A, const VectorXd& b, const VectorXd& mu,
                          Regimes& regimes) {
  const int n = static_cast<int>(mu.size()), block = static_cast<int>(b.size()) / n;
  const double none = kNoSlip * b.cwiseAbs().maxCoeff();
  SharedForces out;
  double off = 0, before = 0;
  for (int pass = 0; pass < kTurns; ++pass) {
    HeldRows rows(A, b, mu, regimes);
    const bool held = rows.solve();
    rows.look_for_others();
    out.several = rows.several();
    if (!held || !out.several || !rows.resists() || !rows.move_into_cones()) return out;
    out.x = rows.forces();
    out.w = A * out.x - b;
    const Regimes now = regimes;
    before = off;
    off = turn(A, out, regimes);
    if (off == 0 || (pass > 0 && off <= none && off >= kSettles * before)) {
      regimes = now;
      break;
    }
  }
  out.lawful = off <= none;
  for (int i = 0; i < n; ++i) out.lawful = out.lawful && out.w[block * i] >= -none;
  return out;
}

void sharpen(const MatrixXd& A, const VectorXd& b, const VectorXd& mu, const Holders& holders,
             FrictionAnswer& answer) {
  const int n = static_cast<int>(mu.size()), block = static_cast<int>(b.size()) / n;
  Regimes regimes{answer.regimes, std::vector<VectorXd>(at(n)), {}, holders};
  const auto slides = [&](int i) { return regimes.of[at(i)] == Regime::sliding; };
  for (int i = 0; i < n; ++i) {
    if (!slides(i)) continue;
    const VectorXd wt = answer.w.segment(block * i + 1, block - 1);
    regimes.directions[at(i)] = wt.norm() > 0
                                    ? wt.normalized()
                                    : (-answer.x.segment(block * i + 1, block - 1)).normalized();
  }
  VectorXd x, w;
  for (int pass = 0; pass < kSharpenings; ++pass) {
    HeldRows rows(A, b, mu, regimes);
    rows.solve();
    x = rows.empty() ? VectorXd::Zero(b.size()) : rows.forces();
    w = A * x - b;
    double turned = 0;
    for (int i = 0; i < n; ++i) {
      const VectorXd wt = w.segment(block * i + 1, block - 1);
      if (!slides(i) || !(wt.norm() > 0)) continue;
      turned = std::max(turned, (wt.normalized() - regimes.directions[at(i)]).norm());
      regimes.directions[at(i)] = wt.normalized();
    }
    if (turned < kTurnedByRounding) break;
    if (turned > 1) return;  // it does not settle: the library's answer stands
  }
  // Still an answer of the law?
  const double force = answer.x.cwiseAbs().maxCoeff(), speed = b.cwiseAbs().maxCoeff();
  for (int i = 0; i < n; ++i) {
    const double xn = x[block * (is_held(holders, i) ? holders[at(i)] : i)], wn = w[block * i];
    if (xn < -kSame * force || wn < -kSame * speed) return;
    if (x.segment(block * i + 1, block - 1).norm() > mu[i] * xn + kSame * force) return;
  }
  if ((w - answer.w).cwiseAbs().maxCoeff() > kSame * (speed + 1e-300)) return;
  answer.x = x;
  answer.w = w;
}

}  // namespace tether::scene::event
