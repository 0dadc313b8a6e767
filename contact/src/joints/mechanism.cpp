// Tether: bodies that joints connect. SPDX-License-Identifier: BSD-3-Clause
#include "joints/mechanism.hpp"

#include <algorithm>
#include <tether/linalg/index.hpp>
#include <utility>

namespace tether::contact::detail {

namespace {
using linalg::at;
}  // namespace

Mechanism::Mechanism(std::vector<int> bodies, std::vector<int> rows, const JointRows& joints,
                     const std::vector<int>& place, const std::vector<char>& moves)
    : bodies_(std::move(bodies)),
      rows_(std::move(rows)),
      entries_(6 * static_cast<int>(bodies_.size())) {
  starts_.push_back(0);
  std::vector<int> places;
  for (const int row : rows_) {
    const int begin = starts_.back();
    places.clear();
    for (const JointRows::Term* t = joints.begin(row); t != joints.end(row); ++t)
      if (moves[at(t->body)]) places.push_back(place[at(t->body)]);
    std::vector<int> once = places;
    std::sort(once.begin(), once.end());
    once.erase(std::unique(once.begin(), once.end()), once.end());
    for (const int p : once)
      for (int k = 0; k < 6; ++k) columns_.push_back(6 * p + k);
    for (const int p : places) {
      const auto found = std::lower_bound(once.begin(), once.end(), p);
      first_.push_back(begin + 6 * static_cast<int>(found - once.begin()));
    }
    starts_.push_back(static_cast<int>(columns_.size()));
  }
  values_.resize(columns_.size());
  b_.resize(rows_.size());
  step_.resize(at(entries_));
  factor_.resize(entries_, starts_, columns_, 0);
}

bool Mechanism::factor(const JointRows& joints, const std::vector<Matrix6d>& C) {
  std::fill(values_.begin(), values_.end(), 0.0);
  std::size_t term = 0;
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    const int row = rows_[k];
    for (const JointRows::Term* t = joints.begin(row); t != joints.end(row); ++t) {
      const Matrix6d& root = C[at(t->body)];
      if (root.isZero(0)) continue;
      double* to = values_.data() + first_[term++];
      for (int c = 0; c < 6; ++c) to[c] += t->G.dot(root.col(c));
    }
  }
  std::copy(values_.begin(), values_.end(), factor_.entries());
  std::fill_n(factor_.metric(), entries_, 1.0);
  return factor_.factor();
}

void Mechanism::multiply(const double* u, double* x) const {
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    double sum = 0;
    for (int e = starts_[k]; e < starts_[k + 1]; ++e) sum += values_[at(e)] * u[columns_[at(e)]];
    x[k] = sum;
  }
}

void Mechanism::project(double* u) {
  multiply(u, b_.data());
  factor_.solve(b_.data(), step_.data());
  for (int k = 0; k < entries_; ++k) u[k] -= step_[at(k)];
}

}  // namespace tether::contact::detail
