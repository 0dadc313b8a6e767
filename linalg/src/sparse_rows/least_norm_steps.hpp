// Tether: minimum-norm solutions and multipliers by repeated steps with regularised factors
// (method, eq. 20). SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "bordered_gram.hpp"
#include "unit_rows.hpp"

namespace tether::linalg {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kHalving = 0.5;  // a step that leaves more of the residual is the last one
constexpr int kProximalSteps = 8;
constexpr int kGradientSteps = 10;
constexpr int kFilters = 3;
constexpr double kRounding = 64.0 * kEpsilon;  // of M z, of the length of z
constexpr double kShort = 1e-14;               // of the multipliers: such a step is the last one

/// Finds du of least norm with A du = b by proximal steps du <- du + A^T M^-1 (b - A du),
/// M = A A^T + eps I, and by conjugate gradients where these become slow; see SparseMinimumNorm.
class LeastNormSteps {
 public:
  void resize(const UnitRows& rows) {
    const auto m = static_cast<std::size_t>(rows.rows());
    for (std::vector<double>* v : {&du_, &step_, &p_}) v->assign(rows.width(), 0.0);
    for (std::vector<double>* v : {&b_, &left_, &z_, &Ap_, &MAp_}) v->assign(m, 0.0);
  }
  /// Takes b_i = g_i / |row_i(C D)| and stops at |b - A du| <= tolerance |b| + 4e-16 |du|.
  void solve(const UnitRows& rows, BorderedGram& gram, const double* g, double tolerance) {
    for (std::size_t i = 0; i < b_.size(); ++i) left_[i] = b_[i] = g[i] * rows.inverse_norm(i);
    iterations_ = 0;
    tolerance_ = tolerance;
    size_ = std::sqrt(dot(b_.data(), b_.data(), b_.size()));
    double left = size_;
    const System system{rows, gram};
    if (!(size_ > 0.0))
      std::fill(du_.begin(), du_.end(), 0.0);
    else if (!proximal_steps(system, &left))
      gradient_steps(system, &left);
    residual_ = size_ > 0.0 ? left / size_ : 0.0;
  }

  /// Returns A^T M^-1 b, valid until the next call.
  const double* one(const UnitRows& rows, BorderedGram& gram, const double* g) {
    for (std::size_t i = 0; i < z_.size(); ++i) z_[i] = g[i] * rows.inverse_norm(i);
    gram.solve(z_.data());
    rows.transposed(z_.data(), step_.data());
    return step_.data();
  }

  const double* solution() const { return du_.data(); }
  /// The residual b - A du of the last solve().
  const std::vector<double>& left() const { return left_; }
  double residual() const { return residual_; }  ///< |b - A du| / |b|
  int iterations() const { return iterations_; }

 private:
  struct System {
    const UnitRows& rows;
    BorderedGram& gram;
  };
  // Computes left_ = b - A du and returns its length.
  double find_left(const System& system) {
    system.rows.multiply(du_.data(), left_.data());
    for (std::size_t i = 0; i < left_.size(); ++i) left_[i] = b_[i] - left_[i];
    return std::sqrt(dot(left_.data(), left_.data(), left_.size()));
  }
  // Computes z_ = M^-1 left_ and step_ = A^T z_, and returns |step_|.
  double find_step(const System& system) {
    z_ = left_;
    system.gram.solve(z_.data());
    ++iterations_;
    system.rows.transposed(z_.data(), step_.data());
    return std::sqrt(dot(step_.data(), step_.data(), step_.size()));
  }
  // Takes the step from du = 0, z = M^-1 b. Its residual is b - A A^T z = eps z, up to the rounding
  // of M z = b. Returns true if their sum is below the tolerance: then no product with A is
  // needed, and left_ becomes eps z.
  bool first_step(const System& system, double* left) {
    z_ = b_;
    const double before = system.gram.solve(z_.data()), eps = system.gram.eps();
    ++iterations_;
    system.rows.transposed(z_.data(), du_.data());
    const double length = std::sqrt(dot(z_.data(), z_.data(), z_.size()));
    if (!(eps * length + kRounding * (before + length) <= tolerance_ * size_)) return false;
    *left = eps * length;
    for (std::size_t i = 0; i < left_.size(); ++i) left_[i] = eps * z_[i];
    return true;
  }
  void remove_rest_with_kept_factors(const System& system, double share,
                                     const std::vector<double>& step, double* left) {
    for (std::size_t j = 0; j < du_.size(); ++j) du_[j] -= share * step[j];
    *left = find_left(system);
  }
  // Returns whether the residual is small enough, or du no longer changes.
  bool done(double step, double left) const {
    const double length = std::sqrt(dot(du_.data(), du_.data(), du_.size()));
    return left <= tolerance_ * size_ + 2.0 * kEpsilon * length || step <= tolerance_ * length;
  }
  // Takes proximal steps from du = 0. Returns false if more of them would reduce the residual too
  // slowly.
  bool proximal_steps(const System& system, double* left) {
    for (int k = 0; k < kProximalSteps; ++k) {
      const double before = *left;
      double step = 0.0;
      if (k > 0) {
        step = find_step(system);
        for (std::size_t j = 0; j < du_.size(); ++j) du_[j] += step_[j];
      } else {
        if (first_step(system, left)) return true;
        step_ = du_;
        step = std::sqrt(dot(du_.data(), du_.data(), du_.size()));
      }
      *left = find_left(system);
      if (*left > before) {  // rounding prevails: the rows give no more of b
        remove_rest_with_kept_factors(system, 1.0, step_, left);
        return true;
      }
      if (done(step, *left)) return true;
      if (k > 0 && *left > kHalving * before) return false;
    }
    return false;
  }
  // Minimises |b - A du| in the norm of M^-1 by conjugate gradients for least squares (Golub and
  // Van Loan, section 11.3.9). A proximal step goes along the same direction with the factor 1;
  // here each direction takes its best factor.
  void gradient_steps(const System& system, double* left) {
    double square = std::pow(find_step(system), 2);
    p_ = step_;
    for (int k = 0; k < kGradientSteps; ++k) {
      system.rows.multiply(p_.data(), Ap_.data());
      MAp_ = Ap_;
      system.gram.solve(MAp_.data());
      ++iterations_;
      const double curvature = dot(Ap_.data(), MAp_.data(), Ap_.size());
      if (!(curvature > 0.0)) return;
      const double share = square / curvature, before = *left;
      for (std::size_t j = 0; j < du_.size(); ++j) du_[j] += share * p_[j];
      for (std::size_t i = 0; i < z_.size(); ++i) z_[i] -= share * MAp_[i];
      *left = find_left(system);
      if (*left > before)
        return remove_rest_with_kept_factors(system, share, p_, left);  // rounding prevails
      system.rows.transposed(z_.data(), step_.data());
      const double next = dot(step_.data(), step_.data(), step_.size());
      if (done(std::sqrt(next), *left)) return;
      for (std::size_t j = 0; j < du_.size(); ++j) p_[j] = step_[j] + next / square * p_[j];
      square = next;
    }
  }

  std::vector<double> du_, b_, left_;  // left_ = b - A du
  std::vector<double> z_, step_;       // M^-1 (b - A du), and A^T of it
  std::vector<double> p_, Ap_, MAp_;   // conjugate gradients: direction, A p, M^-1 A p
  double size_ = 0.0, tolerance_ = 0.0, residual_ = 0.0;  // size_ = |b|
  int iterations_ = 0;
};

/// Finds x of least norm with A^T x = u.
class LeastMultipliers {
 public:
  void resize(const UnitRows& rows) {
    step_.assign(rows.width(), 0.0);
    rest_.assign(rows.width(), 0.0);
    z_.assign(static_cast<std::size_t>(rows.rows()), 0.0);
  }
  /// Takes u = D^-1 dy; `eps` is that of the factors. Writes x for the rows of C, rows() entries.
  // Solves A A^T x = A u by proximal steps. They leave the rounding of A (u - A^T x), divided by
  // eps, in the null space of A^T. The filter x <- x - eps M^-1 x removes most of that. It also
  // removes the share eps / s^2 of the component at a singular value s, which the steps after it
  // restore: they start from so small a residual that their own rounding is negligible.
  void find(const UnitRows& rows, BorderedGram& gram, double eps, const double* dy, double* x) {
    const std::size_t m = z_.size();
    std::fill(x, x + m, 0.0);
    add(rows, gram, dy, x);
    for (int k = 0; k < kFilters; ++k) {
      std::copy(x, x + m, z_.begin());
      gram.solve(z_.data());
      for (std::size_t i = 0; i < m; ++i) x[i] -= eps * z_[i];
    }
    add(rows, gram, dy, x);
    for (std::size_t i = 0; i < m; ++i) x[i] *= rows.inverse_norm(i);
  }

 private:
  // Repeats x <- x + M^-1 A (u - A^T x), with D u = dy, as long as the steps halve.
  void add(const UnitRows& rows, BorderedGram& gram, const double* dy, double* x) {
    const double* metric = rows.metric();
    const std::size_t m = z_.size();
    double before = std::numeric_limits<double>::infinity();
    for (int k = 0; k < kProximalSteps; ++k) {
      rows.transposed(x, step_.data());
      for (std::size_t j = 0; j < rest_.size(); ++j)
        rest_[j] = (metric[j] > 0.0 ? dy[j] / metric[j] : 0.0) - step_[j];
      rows.multiply(rest_.data(), z_.data());
      gram.solve(z_.data());
      const double step = std::sqrt(dot(z_.data(), z_.data(), m));
      if (!(step < kHalving * before)) return;
      before = step;
      for (std::size_t i = 0; i < m; ++i) x[i] += z_[i];
      if (step <= kShort * std::sqrt(dot(x, x, m))) return;
    }
  }

  std::vector<double> step_, rest_, z_;  // A^T x, u - A^T x, M^-1 of A of it
};

}  // namespace tether::linalg
