// Tether: minimum-norm solution of C dy = g for many sparse rows and a few full ones.
// SPDX-License-Identifier: BSD-3-Clause
#include "tether/linalg/sparse_minimum_norm.hpp"

#include <algorithm>
#include <cmath>

#include "bordered_gram.hpp"
#include "least_norm_steps.hpp"
#include "unit_rows.hpp"

namespace tether::linalg {

namespace {

constexpr double kSmallestEps = 1e-13;  // A A^T of unit rows carries some 1e-15 of rounding

/// The rows that depend on others, and how far their values contradict those of the others.
class DependentRows {
 public:
  void resize(std::size_t rows) {
    order_.assign(rows, 0);
    dropped_.clear();
    dropped_.reserve(rows);
    inconsistency_.reserve(rows);
    work_.assign(rows, 0.0);
  }
  /// Lists them after a factorisation that found `dependent` of them.
  void find(const BorderedGram& gram, int dependent);
  /// Measures the contradictions after a solve for the values g that left `left` = b - A du.
  void weigh(BorderedGram& gram, const UnitRows& rows, const std::vector<double>& left,
             const double* g);

  int count() const { return static_cast<int>(dropped_.size()); }
  int at(int k) const { return order_[static_cast<std::size_t>(k)]; }
  double inconsistency(std::size_t k) const { return inconsistency_[k]; }

 private:
  std::vector<int> dropped_, order_;  // order_: the independent ones first
  std::vector<double> inconsistency_, work_;
};

void DependentRows::find(const BorderedGram& gram, int dependent) {
  const int rows = static_cast<int>(order_.size());
  dropped_.clear();
  for (int i = 0; dependent > 0 && i < rows; ++i)
    if (gram.dependent(i)) dropped_.push_back(i);
  std::size_t kept = 0, next = 0;
  for (int i = 0; i < rows; ++i) {
    if (next < dropped_.size() && dropped_[next] == i)
      ++next;
    else
      order_[kept++] = i;
  }
  std::copy(dropped_.begin(), dropped_.end(), order_.begin() + static_cast<std::ptrdiff_t>(kept));
}

// Entry k of L^-1 (b - A du) is the difference of row k from the combination of the rows before it.
void DependentRows::weigh(BorderedGram& gram, const UnitRows& rows, const std::vector<double>& left,
                          const double* g) {
  inconsistency_.clear();
  if (dropped_.empty()) return;
  work_ = left;
  gram.forward(work_.data());
  for (const int i : dropped_) {
    const auto k = static_cast<std::size_t>(i);
    inconsistency_.push_back(std::abs(rows.norm(k) > 0.0 ? work_[k] : g[i]));
  }
}

}  // namespace

struct SparseMinimumNorm::Parts {
  UnitRows rows;
  BorderedGram gram;
  double eps = 0.0;  // of the factors
  DependentRows dependent;
  LeastNormSteps steps;
  LeastMultipliers multipliers;
};

SparseMinimumNorm::SparseMinimumNorm() : parts_(std::make_unique<Parts>()) {}
SparseMinimumNorm::~SparseMinimumNorm() = default;
SparseMinimumNorm::SparseMinimumNorm(SparseMinimumNorm&&) noexcept = default;
SparseMinimumNorm& SparseMinimumNorm::operator=(SparseMinimumNorm&&) noexcept = default;

void SparseMinimumNorm::resize(int columns, std::vector<int> starts, std::vector<int> column_of,
                               int full_rows) {
  Parts& p = *parts_;
  p.rows.resize(columns, std::move(starts), std::move(column_of), full_rows);
  p.dependent.resize(static_cast<std::size_t>(p.rows.rows()));
  p.steps.resize(p.rows);
  p.multipliers.resize(p.rows);
  p.gram = BorderedGram();
  p.rows.analyse(p.gram);
}

int SparseMinimumNorm::rows() const { return parts_->rows.rows(); }
int SparseMinimumNorm::columns() const { return parts_->rows.columns(); }
int SparseMinimumNorm::sparse_rows() const { return parts_->rows.sparse_rows(); }
double* SparseMinimumNorm::entries() { return parts_->rows.entries(); }
double* SparseMinimumNorm::full_row(int k) { return parts_->rows.full_row(k); }
double* SparseMinimumNorm::metric() { return parts_->rows.metric(); }
int SparseMinimumNorm::dropped() const { return parts_->dependent.count(); }
int SparseMinimumNorm::pivot(int k) const { return parts_->dependent.at(k); }
double SparseMinimumNorm::independent_part(int i) const { return parts_->gram.independent_part(i); }
double SparseMinimumNorm::row_norm(int i) const {
  return parts_->rows.norm(static_cast<std::size_t>(i));
}
double SparseMinimumNorm::residual() const { return parts_->steps.residual(); }
double SparseMinimumNorm::residual(int i) const {
  return parts_->steps.left()[static_cast<std::size_t>(i)];
}
int SparseMinimumNorm::iterations() const { return parts_->steps.iterations(); }
double SparseMinimumNorm::inconsistency(int k) const {
  return parts_->dependent.inconsistency(static_cast<std::size_t>(k - rank()));
}

bool SparseMinimumNorm::factor(double rank_tolerance, double thin) {
  Parts& p = *parts_;
  if (!p.rows.scale()) return false;
  p.eps = std::max(rank_tolerance * rank_tolerance, kSmallestEps);
  p.dependent.find(p.gram, p.rows.factor(p.gram, p.eps, thin));
  return true;
}

void SparseMinimumNorm::solve(const double* g, double* dy, double tolerance) {
  Parts& p = *parts_;
  p.steps.solve(p.rows, p.gram, g, tolerance);
  p.dependent.weigh(p.gram, p.rows, p.steps.left(), g);
  const double *du = p.steps.solution(), *D = p.rows.metric();
  for (std::size_t j = 0; j < p.rows.width(); ++j) dy[j] = du[j] * D[j];
}

void SparseMinimumNorm::one_step(const double* g, double* dy) {
  Parts& p = *parts_;
  const double *step = p.steps.one(p.rows, p.gram, g), *D = p.rows.metric();
  for (std::size_t j = 0; j < p.rows.width(); ++j) dy[j] = step[j] * D[j];
}

void SparseMinimumNorm::multipliers(const double* dy, double* x) {
  parts_->multipliers.find(parts_->rows, parts_->gram, parts_->eps, dy, x);
}

// The second of two rounds removes the error due to eps.
std::vector<double> SparseMinimumNorm::dependence(int k) const {
  Parts& p = *parts_;
  const int row = pivot(k);
  const auto m = static_cast<std::size_t>(rows());
  std::vector<double> rest, share(m, 0.0), z(m), part(p.rows.width());
  p.rows.spread(row, rest);
  for (int round = 0; round < 2; ++round) {
    p.rows.multiply(rest.data(), z.data());
    p.gram.depend(z.data(), row);
    p.rows.transposed(z.data(), part.data());
    for (std::size_t j = 0; j < part.size(); ++j) rest[j] -= part[j];
    for (std::size_t i = 0; i < z.size(); ++i) share[i] += z[i];
  }
  std::vector<double> kept;
  for (int i = 0; i < rank(); ++i) kept.push_back(share[static_cast<std::size_t>(pivot(i))]);
  return kept;
}

}  // namespace tether::linalg
