// Tether: Newton matrices of many contacts between few bodies. SPDX-License-Identifier:
// BSD-3-Clause
#include "assembled/stages/body_newton.hpp"

#include <Eigen/LU>
#include <algorithm>

namespace tether::contact::detail {
namespace {

typedef double v4 __attribute__((vector_size(32)));

// C = A B, and C += A B
TETHER_INLINE void multiply(const PackedBlock& A, const PackedBlock& B, PackedBlock& C) {
  const v4* a = reinterpret_cast<const v4*>(A.column);
  v4* c = reinterpret_cast<v4*>(C.column);
  for (int j = 0; j < 3; ++j) {
    const double* b = B.column + 4 * j;
    c[j] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  }
}
TETHER_INLINE void add_product(const PackedBlock& A, const PackedBlock& B, PackedBlock& C) {
  const v4* a = reinterpret_cast<const v4*>(A.column);
  v4* c = reinterpret_cast<v4*>(C.column);
  for (int j = 0; j < 3; ++j) {
    const double* b = B.column + 4 * j;
    c[j] += a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  }
}
TETHER_INLINE void apply(const PackedBlock& A, const double* x, double* y, double sign) {
  const v4* a = reinterpret_cast<const v4*>(A.column);
  *reinterpret_cast<v4*>(y) += sign * (a[0] * x[0] + a[1] * x[1] + a[2] * x[2]);
}

TETHER_CLONES void add_contact(const BodyForm::Contact& c, const PackedBlock& X,
                               const int (*at)[2][2], PackedBlock* values) {
  for (int s = 0; s < 2; ++s) {
    if (c.body[s] < 0) continue;
    PackedBlock right[2];
    for (int h = 0; h < 2; ++h) multiply(X, c.H[s][h], right[h]);
    for (int r = 0; r < 2; ++r) {
      if (c.body[r] < 0) continue;
      for (int node = 0; node < 2; ++node)
        for (int h = 0; h < 2; ++h)
          add_product(c.turned[r][node], right[h], values[at[r][node][s] + h]);
    }
  }
}

}  // namespace

bool BodyNewton::order(const Problem& problem) {
  form_ = problem.body_form();
  if (form_ == nullptr) return false;
  const std::size_t nodes = 2 * at(form_->bodies);
  std::vector<std::vector<int>> others(at(form_->bodies));
  for (int k = 0; k < form_->bodies; ++k) others[at(k)].push_back(k);
  for (const BodyForm::Contact& c : form_->contacts) {
    if (c.body[0] < 0 || c.body[1] < 0) continue;
    others[at(c.body[0])].push_back(c.body[1]);
    others[at(c.body[1])].push_back(c.body[0]);
  }
  start_.assign(1, 0);
  columns_.clear();
  for (std::vector<int>& list : others) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    for (int node = 0; node < 2; ++node) {
      for (const int k : list) columns_.insert(columns_.end(), {2 * k, 2 * k + 1});
      start_.push_back(static_cast<int>(columns_.size()));
    }
  }
  const BlockPattern pattern{static_cast<int>(start_.size()) - 1, start_.data(), columns_.data()};
  lu_.order(pattern);
  lu_.analyse(pattern, nullptr);
  place_.resize(form_->contacts.size());
  for (std::size_t i = 0; i < place_.size(); ++i) {
    const int* body = form_->contacts[i].body;
    for (int r = 0; r < 2; ++r)
      for (int s = 0; s < 2; ++s) {
        if (body[r] < 0 || body[s] < 0) continue;
        const std::vector<int>& list = others[at(body[r])];
        const auto found = std::lower_bound(list.begin(), list.end(), body[s]) - list.begin();
        for (int node = 0; node < 2; ++node)
          place_[i].at[r][node][s] = start_[at(2 * body[r] + node)] + 2 * static_cast<int>(found);
      }
  }
  values_.resize(columns_.size());
  inverse_.resize(place_.size());
  inverse_left_.resize(place_.size());
  right_inverse_.resize(place_.size());
  p_.resize(nodes);
  return true;
}

void BodyNewton::begin() {
  std::fill(values_.begin(), values_.end(), PackedBlock());
  for (int row = 0; row < static_cast<int>(p_.size()); ++row)
    for (int k = start_[at(row)]; k < start_[at(row + 1)]; ++k)
      if (columns_[at(k)] == row)
        for (int c = 0; c < 3; ++c) values_[at(k)].column[5 * c] = 1;
}

void BodyNewton::add(int i, const PackedBlock& D, const PackedBlock& L, const PackedBlock& R) {
  using Map = Eigen::Map<const Eigen::Matrix3d, 0, Eigen::OuterStride<4>>;
  Eigen::Map<Eigen::Matrix3d, 0, Eigen::OuterStride<4>>(inverse_[at(i)].column) =
      Map(D.column).partialPivLu().inverse();
  PackedBlock X;
  multiply(R, inverse_[at(i)], right_inverse_[at(i)]);
  multiply(inverse_[at(i)], L, inverse_left_[at(i)]);
  multiply(right_inverse_[at(i)], L, X);
  add_contact(form_->contacts[at(i)], X, place_[at(i)].at, values_.data());
}

bool BodyNewton::factor() {
  for (int row = 0; row < lu_.size(); ++row) {
    const int node = lu_.block_row(row);
    lu_.begin_row(row);
    for (int k = start_[at(node)]; k < start_[at(node + 1)]; ++k)
      lu_.add(columns_[at(k)], values_[at(k)].column);
    if (!lu_.end_row()) return false;
  }
  return true;
}

void BodyNewton::solve(PackedVector* y) {
  std::fill(p_.begin(), p_.end(), PackedVector());
  const std::size_t n = place_.size();
  for (std::size_t i = 0; i < n; ++i) {
    const BodyForm::Contact& c = form_->contacts[i];
    alignas(32) double z[4] = {0, 0, 0, 0};
    apply(right_inverse_[i], y[i].v, z, 1);
    for (int s = 0; s < 2; ++s)
      for (int h = 0; h < 2 && c.body[s] >= 0; ++h)
        apply(c.turned[s][h], z, p_[at(2 * c.body[s] + h)].v, 1);
  }
  lu_.solve(p_.data());
  for (std::size_t i = 0; i < n; ++i) {
    const BodyForm::Contact& c = form_->contacts[i];
    alignas(32) double z[4] = {0, 0, 0, 0}, out[4] = {0, 0, 0, 0};
    for (int s = 0; s < 2; ++s)
      for (int h = 0; h < 2 && c.body[s] >= 0; ++h)
        apply(c.H[s][h], p_[at(2 * c.body[s] + h)].v, z, 1);
    apply(inverse_[i], y[i].v, out, 1);
    apply(inverse_left_[i], z, out, -1);
    for (int k = 0; k < 3; ++k) y[i].v[k] = out[k];
  }
}

}  // namespace tether::contact::detail
