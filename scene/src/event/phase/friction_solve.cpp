// Tether: impacts and modes of contacts as problems of the contact library, through the joints.
// SPDX-License-Identifier: BSD-3-Clause
#include "friction_solve.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::scene::event {

using contact::Regime;

namespace {

constexpr double kDependent = 1e-11;
constexpr double kLocked = 1e-12;  // A_nn of the largest
constexpr double kSame = 1e-7;     // of the answer's size: the exact one against the library's
constexpr double kSolve = 1e-12;
constexpr double kFarAbove = 1e5;

MatrixXd pseudo_solve(const MatrixXd& S, const MatrixXd& right) {
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> factor;
  factor.setThreshold(kDependent);
  factor.compute(S);
  return factor.solve(right);
}

/// The same regimes without the error of an iteration: stuck rows vanish, and where a contact
/// slides x_t = -mu x_n d, d the direction of w_t.
void sharpen(const MatrixXd& A, const VectorXd& b, const VectorXd& mu, int block,
             FrictionAnswer& answer) {
  const int n = static_cast<int>(mu.size());
  const auto slides = [&](int i) {
    return answer.regimes[static_cast<std::size_t>(i)] == Regime::sliding;
  };
  std::vector<int> rows;
  std::vector<VectorXd> directions(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    if (answer.regimes[static_cast<std::size_t>(i)] == Regime::separating) continue;
    rows.push_back(block * i);
    if (slides(i)) {
      const VectorXd wt = answer.w.segment(block * i + 1, block - 1);
      const VectorXd xt = answer.x.segment(block * i + 1, block - 1);
      VectorXd& d = directions[static_cast<std::size_t>(i)];
      if (wt.norm() > 0)
        d = wt.normalized();
      else if (xt.norm() > 0)
        d = -xt.normalized();
      else
        d = VectorXd::Zero(block - 1);
    } else {
      for (int k = 1; k < block; ++k) rows.push_back(block * i + k);
    }
  }
  if (rows.empty()) {
    answer.x.setZero();
    answer.w = -b;
    return;
  }
  const int m = static_cast<int>(rows.size());
  VectorXd x = answer.x, w = answer.w;
  for (int pass = 0; pass < 30; ++pass) {
    MatrixXd columns(A.rows(), m), S(m, m);
    VectorXd right(m);
    for (int c = 0; c < m; ++c) {
      const int row = rows[static_cast<std::size_t>(c)], i = row / block;
      columns.col(c) = A.col(row);
      if (row % block == 0 && slides(i))
        columns.col(c) -=
            mu[i] * A.middleCols(row + 1, block - 1) * directions[static_cast<std::size_t>(i)];
      right[c] = b[row];
    }
    for (int r = 0; r < m; ++r) S.row(r) = columns.row(rows[static_cast<std::size_t>(r)]);
    const VectorXd part = pseudo_solve(S, right);
    x.setZero();
    for (int c = 0; c < m; ++c) {
      const int row = rows[static_cast<std::size_t>(c)], i = row / block;
      x[row] = part[c];
      if (row % block == 0 && slides(i))
        x.segment(row + 1, block - 1) = -mu[i] * part[c] * directions[static_cast<std::size_t>(i)];
    }
    w = A * x - b;
    double turned = 0;
    for (int i = 0; i < n; ++i) {
      if (!slides(i)) continue;
      const VectorXd wt = w.segment(block * i + 1, block - 1);
      VectorXd& d = directions[static_cast<std::size_t>(i)];
      if (!(wt.norm() > 0)) continue;
      const VectorXd now = wt.normalized();
      turned = std::max(turned, (now - d).norm());
      d = now;
    }
    if (turned < 1e-15) break;
    if (turned > 1) return;  // it does not settle: the library's answer stands
  }
  // Still an answer of the law?
  const double force = answer.x.cwiseAbs().maxCoeff(), speed = b.cwiseAbs().maxCoeff();
  for (int i = 0; i < n; ++i) {
    const double xn = x[block * i], wn = w[block * i];
    if (xn < -kSame * force || wn < -kSame * speed) return;
    if (x.segment(block * i + 1, block - 1).norm() > mu[i] * xn + kSame * force) return;
  }
  if ((w - answer.w).cwiseAbs().maxCoeff() > kSame * (speed + 1e-300)) return;
  answer.x = x;
  answer.w = w;
}

}  // namespace

ContactRows::ContactRows(Model& model, std::vector<int> contacts)
    : model_(model), contacts_(std::move(contacts)), block_(1 + model.tangents()) {
  const int n = block_ * static_cast<int>(contacts_.size());
  L_.resize(n, model.velocities());
  rate_.resize(n);
  rest_.resize(n);
  ContactLook look;
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    const int row = block_ * static_cast<int>(k);
    model.look(contacts_[k], look);
    L_.row(row) = look.normal;
    rate_[row] = look.normal_rate;
    rest_[row] = look.normal_rest;
    L_.middleRows(row + 1, block_ - 1) = look.tangents;
    rate_.segment(row + 1, block_ - 1) = look.slip_rate;
    rest_.segment(row + 1, block_ - 1) = look.slip_rest;
  }
  PL_ = L_.transpose();
  model.divide_by_mass(PL_);
  if (model.joint_rows() > 0) {
    VectorXd g, rate;
    model.joints(g, G_, rate, joint_rest_);
    MG_ = G_.transpose();
    model.divide_by_mass(MG_);
    GMG_ = G_ * MG_;
    PL_ -= MG_ * pseudo_solve(GMG_, G_ * PL_);
  }
  A_ = L_ * PL_;
  A_ = (0.5 * (A_ + A_.transpose())).eval();
}

VectorXd ContactRows::free_accelerations() {
  VectorXd a;
  model_.forces(a);
  model_.divide_by_mass(a);
  if (G_.rows() > 0) a -= MG_ * pseudo_solve(GMG_, G_ * a + joint_rest_);
  return L_ * a + rest_;
}

AccelerationAnswer solve_accelerations(const Model& model, ContactRows& rows,
                                       const std::vector<VectorXd>& slides) {
  const int block = rows.size(), n = static_cast<int>(rows.contacts().size());
  AccelerationAnswer out;
  const VectorXd free = rows.free_accelerations();
  out.scale = free.cwiseAbs().maxCoeff();
  out.far = kFarAbove * std::max(out.scale, 1e-12);
  VectorXd b = -free, mu(n);
  for (int k = 0; k < n; ++k) {
    const std::size_t place = static_cast<std::size_t>(k);
    mu[k] = model.law(rows.contacts()[place]).friction;
    if (slides[place].size() > 0) b.segment(block * k + 1, block - 1) -= out.far * slides[place];
  }
  out.contacts = solve_friction(rows.A(), b, mu);
  return out;
}

FrictionAnswer solve_friction(const MatrixXd& A, const VectorXd& b, const VectorXd& mu) {
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
  for (int i = 0; i < n; ++i) largest = std::max(largest, A(block * i, block * i));
  std::vector<int> free;
  for (int i = 0; i < n; ++i)
    if (A(block * i, block * i) > kLocked * largest) free.push_back(i);
  if (free.empty()) {
    out.solved = true;
    return out;
  }
  const int m = static_cast<int>(free.size());
  MatrixXd part(block * m, block * m);
  VectorXd right(block * m), friction(m);
  for (int i = 0; i < m; ++i) {
    const int from = block * free[static_cast<std::size_t>(i)];
    friction[i] = mu[free[static_cast<std::size_t>(i)]];
    right.segment(block * i, block) = b.segment(from, block);
    for (int j = 0; j < m; ++j)
      part.block(block * i, block * j, block, block) =
          A.block(from, block * free[static_cast<std::size_t>(j)], block, block);
  }
  contact::Options options;
  options.law = contact::Law::coulomb;
  options.tolerance = kSolve;
  options.strict = true;
  contact::Solver solver(options);
  const contact::Solution answer = solver.solve(contact::Problem::dense(part, right, friction));
  FrictionAnswer inner;
  inner.x = answer.impulses;
  inner.w = answer.velocities;
  inner.regimes = answer.regimes;
  inner.error = answer.error;
  inner.solved = answer.status == contact::Status::solved ||
                 answer.status == contact::Status::round_off ||
                 (answer.error < 1e-8 && answer.status != contact::Status::infeasible);
  if (inner.solved) sharpen(part, right, friction, block, inner);
  out.solved = inner.solved;
  out.error = inner.error;
  for (int i = 0; i < m; ++i) {
    const int to = block * free[static_cast<std::size_t>(i)];
    out.x.segment(to, block) = inner.x.segment(block * i, block);
    out.regimes[static_cast<std::size_t>(free[static_cast<std::size_t>(i)])] =
        inner.regimes[static_cast<std::size_t>(i)];
  }
  out.w = A * out.x - b;
  return out;
}

}  // namespace tether::scene::event
