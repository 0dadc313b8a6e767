// Tether: A A^T + eps I for many sparse rows and a few full ones. SPDX-License-Identifier:
// BSD-3-Clause
#include "bordered_gram.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/block3.hpp>

namespace tether::linalg {

namespace {

constexpr double kDependentBorder = 10.0;  // eps, as in GramFactor

}  // namespace

void BorderedGram::analyse(int n, const std::vector<int>& starts, const std::vector<int>& columns,
                           int full) {
  sparse_.analyse(n, starts, columns);
  m_ = sparse_.rows();
  full_ = full;
  B_.assign(at(full) * at(m_), 0.0);
  Y_.assign(B_.size(), 0.0);
  S_.assign(at(full) * at(full), 0.0);
  d_.assign(at(full), 1.0);
  dependent_.assign(at(full), 0);
}

int BorderedGram::factor(const double* A, const double* norm, double eps, double thin) {
  eps_ = eps;
  int count = sparse_.factor(A, norm, eps, thin);
  for (int f = 0; f < full_; ++f) {
    std::copy(coupling(f), coupling(f) + m_, solved(f));
    sparse_.solve(solved(f));
    for (int e = 0; e <= f; ++e) product(f, e) -= dot(solved(f), coupling(e));
  }
  for (int f = 0; f < full_; ++f) {
    double d = product(f, f) + eps;
    for (int e = 0; e < f; ++e) {
      double y = product(f, e);
      for (int k = 0; k < e; ++k) y -= product(e, k) * product(f, k) * d_[at(k)];
      product(f, e) = y / d_[at(e)];
      d -= y * product(f, e);
    }
    const bool vanished = !(norm[m_ + f] > 0.0);
    d_[at(f)] = vanished ? 1.0 : std::max(d, eps);
    dependent_[at(f)] = vanished || !(d > kDependentBorder * eps);
    count += dependent_[at(f)];
  }
  return count;
}

double BorderedGram::independent_part(int i) const {
  return i < m_ ? sparse_.independent_part(i) : std::sqrt(std::max(0.0, d_[at(i - m_)] - eps_));
}

double BorderedGram::dot(const double* y, const double* z) const {
  double sum = 0.0;
  for (int i = 0; i < m_; ++i) sum += y[i] * z[i];
  return sum;
}

void BorderedGram::subtract(const double* y, double share, double* z) const {
  for (int i = 0; i < m_; ++i) z[i] -= share * y[i];
}

// Computes the entries of L^-1 z that belong to the first `count` full rows.
void BorderedGram::forward_border(double* z, int count) {
  double* border = z + m_;
  for (int f = 0; f < count; ++f) {
    border[f] -= dot(solved(f), z);
    for (int e = 0; e < f; ++e) border[f] -= product(f, e) * border[e];
  }
}

void BorderedGram::forward(double* z) {
  forward_border(z, full_);
  sparse_.forward(z);
}

double BorderedGram::solve(double* z) {
  double* border = z + m_;
  forward_border(z, full_);
  sparse_.solve(z);
  const double before = full_ > 0 ? dot(z, z) : 0.0;
  for (int f = full_ - 1; f >= 0; --f) {
    border[f] /= d_[at(f)];
    for (int e = f + 1; e < full_; ++e) border[f] -= product(e, f) * border[e];
    subtract(solved(f), border[f], z);
  }
  return std::sqrt(before);
}

void BorderedGram::depend(double* z, int last) {
  double* border = z + m_;
  const int count = last < 0 ? full_ : std::max(0, last - m_);
  forward_border(z, count);
  std::fill(border + count, border + full_, 0.0);
  for (int f = count - 1; f >= 0; --f) {
    border[f] /= d_[at(f)];
    for (int e = f + 1; e < count; ++e) border[f] -= product(e, f) * border[e];
    if (dependent_[at(f)]) border[f] = 0.0;
    subtract(coupling(f), border[f], z);
  }
  sparse_.depend(z, last < m_ ? last : -1);
}

}  // namespace tether::linalg
