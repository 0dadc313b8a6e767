// Tether: the factorised matrix of Newton steps, by contacts or by bodies.
// SPDX-License-Identifier: BSD-3-Clause

#include "assembled/stages/newton_matrix.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <vector>

namespace tether::contact::detail {
namespace {

typedef double v4 __attribute__((vector_size(32)));

constexpr double kClearly = 0.5;  // of the price by contacts: the digits cost refinements
constexpr double kOrderBodies = 500, kOrderContacts = 100;  // ns a contact, a block
constexpr double kStepSweeps = 3;                           // of a step besides its factors

// C += A B, and C = A B
TETHER_INLINE void add_product(const PackedBlock& A, const PackedBlock& B, PackedBlock& C) {
  const v4* a = reinterpret_cast<const v4*>(A.column);
  v4* c = reinterpret_cast<v4*>(C.column);
  for (int j = 0; j < 3; ++j) {
    const double* b = B.column + 4 * j;
    c[j] += a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  }
}
TETHER_INLINE void multiply(const PackedBlock& A, const PackedBlock& B, PackedBlock& C) {
  C = {};
  add_product(A, B, C);
}
TETHER_INLINE void apply(const PackedBlock& A, const double* x, double* y, double sign) {
  const v4* a = reinterpret_cast<const v4*>(A.column);
  *reinterpret_cast<v4*>(y) += sign * (a[0] * x[0] + a[1] * x[1] + a[2] * x[2]);
}

// values += H' X H for one contact, all pairs of its nodes.
TETHER_CLONES void add_contact(const PackedBlock* H, const PackedBlock* turned, int nodes,
                               const PackedBlock& X, const int* place, PackedBlock* values) {
  for (int s = 0; s < nodes; ++s) {
    PackedBlock right;
    multiply(X, H[s], right);
    for (int r = 0; r < nodes; ++r) add_product(turned[r], right, values[place[r * nodes + s]]);
  }
}

// out = L A R
TETHER_CLONES void enclose(const PackedBlock& L, const PackedBlock& A, const PackedBlock& R,
                           PackedBlock& out) {
  PackedBlock right;
  multiply(A, R, right);
  multiply(L, right, out);
}

}  // namespace

void BodyNewton::order(const BodyForm& form) {
  form_ = &form;
  std::vector<std::vector<int>> others(at(form.nodes));
  for (int k = 0; k < form.nodes; ++k) others[at(k)].push_back(k);
  for (int i = 0; i < form.contacts(); ++i)
    for (int r = form.start[at(i)]; r < form.start[at(i) + 1]; ++r)
      for (int s = form.start[at(i)]; s < form.start[at(i) + 1]; ++s)
        if (s != r) others[at(form.node[at(r)])].push_back(form.node[at(s)]);
  start_.assign(1, 0);
  columns_.clear();
  for (std::vector<int>& list : others) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    columns_.insert(columns_.end(), list.begin(), list.end());
    start_.push_back(static_cast<int>(columns_.size()));
  }
  const BlockPattern pattern{form.nodes, start_.data(), columns_.data()};
  lu_.order(pattern);
  lu_.analyse(pattern, nullptr);
  place_.clear();
  place_start_.assign(1, 0);
  for (int i = 0; i < form.contacts(); ++i) {
    for (int r = form.start[at(i)]; r < form.start[at(i) + 1]; ++r)
      for (int s = form.start[at(i)]; s < form.start[at(i) + 1]; ++s) {
        const int row = form.node[at(r)];
        const auto begin = columns_.begin() + start_[at(row)];
        const auto end = columns_.begin() + start_[at(row) + 1];
        place_.push_back(
            static_cast<int>(std::lower_bound(begin, end, form.node[at(s)]) - columns_.begin()));
      }
    place_start_.push_back(static_cast<int>(place_.size()));
  }
  values_.resize(columns_.size());
  inverse_.resize(at(form.contacts()));
  inverse_left_.resize(inverse_.size());
  right_inverse_.resize(inverse_.size());
  p_.resize(at(form.nodes));
}

void BodyNewton::begin() {
  std::fill(values_.begin(), values_.end(), PackedBlock());
  for (int row = 0; row < static_cast<int>(p_.size()); ++row)
    for (int k = start_[at(row)]; k < start_[at(row + 1)]; ++k)
      if (columns_[at(k)] == row)
        for (int c = 0; c < 3; ++c) values_[at(k)].column[5 * c] = 1;
}

void BodyNewton::add(int i, const PackedBlock& D, const PackedBlock& L, const PackedBlock& R) {
  as_matrix(inverse_[at(i)]) = as_matrix(D).partialPivLu().inverse();
  PackedBlock X;
  multiply(R, inverse_[at(i)], right_inverse_[at(i)]);
  multiply(inverse_[at(i)], L, inverse_left_[at(i)]);
  multiply(right_inverse_[at(i)], L, X);
  const int first = form_->start[at(i)];
  add_contact(form_->H.data() + first, form_->turned.data() + first,
              form_->start[at(i) + 1] - first, X, place_.data() + place_start_[at(i)],
              values_.data());
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
  const int n = form_->contacts();
  for (int i = 0; i < n; ++i) {
    alignas(32) double z[4] = {0, 0, 0, 0};
    apply(right_inverse_[at(i)], y[i].v, z, 1);
    for (int k = form_->start[at(i)]; k < form_->start[at(i) + 1]; ++k)
      apply(form_->turned[at(k)], z, p_[at(form_->node[at(k)])].v, 1);
  }
  lu_.solve(p_.data());
  for (int i = 0; i < n; ++i) {
    alignas(32) double z[4] = {0, 0, 0, 0}, out[4] = {0, 0, 0, 0};
    for (int k = form_->start[at(i)]; k < form_->start[at(i) + 1]; ++k)
      apply(form_->H[at(k)], p_[at(form_->node[at(k)])].v, z, 1);
    apply(inverse_[at(i)], y[i].v, out, 1);
    apply(inverse_left_[at(i)], z, out, -1);
    for (int c = 0; c < 3; ++c) y[i].v[c] = out[c];
  }
}

PackedBlock own_block(const LocalBlock& L, double factor) {
  PackedBlock out;
  const double rows[3][3] = {
      {L.a, L.c[0], L.c[1]}, {L.c[0], L.T[0], L.T[1]}, {L.c[1], L.T[1], L.T[2]}};
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r < 3; ++r) out.column[4 * c + r] = factor * rows[r][c];
  return out;
}

double NewtonMatrix::cost_by_contacts(const Search& search, double operations) const {
  return 4 * operations + kStepSweeps * search.sweep_cost +
         25.0 * static_cast<double>(search.system.problem().blocks().size());
}

double NewtonMatrix::cost(const Search& search) const {
  if (by_bodies()) return bodies_.cost() + kStepSweeps * search.sweep_cost;
  const double blocks = static_cast<double>(search.system.problem().blocks().size());
  return cost_by_contacts(
      search, ordered() ? operations_ : blocks * blocks / std::max(1, search.system.size()));
}

bool NewtonMatrix::order_by_bodies(Search& search) {
  if (ordered()) return by_bodies();
  const BodyForm* given = search.system.body_form();
  if (given == nullptr || 2 * given->contacts() < kContactsOfBody * given->nodes) return false;
  bodies_.order(*given);
  if (!(bodies_.cost() + kStepSweeps * search.sweep_cost < kClearly * cost(search))) return false;
  search.counts.work += kOrderBodies * search.system.size();
  form_ = Form::bodies;
  return true;
}

void NewtonMatrix::order(Search& search) {
  // Four contacts a body cost a quarter in equations of bodies, 2.8 as much as in those of
  // contacts.
  constexpr int kSome = 3;  // contacts for two nodes
  if (ordered() || order_by_bodies(search)) return;
  const linalg::BlockPattern pattern = detail::pattern(search.system.problem());
  search.counts.work +=
      kOrderContacts * static_cast<double>(search.system.problem().blocks().size());
  lu_.order(pattern);
  lu_.analyse(pattern, nullptr);
  operations_ = lu_.operations();
  form_ = Form::contacts;
  const BodyForm* given = search.system.body_form();
  if (given == nullptr || 2 * given->contacts() < kSome * given->nodes) return;
  const double by_contacts = cost(search);
  search.counts.work += kOrderBodies * search.system.size();
  bodies_.order(*given);
  if (bodies_.cost() + kStepSweeps * search.sweep_cost < kClearly * by_contacts)
    form_ = Form::bodies;
}

bool NewtonMatrix::factor(Search& search, double u) {
  order(search);
  problem_ = &search.system.problem();
  const bool regular = by_bodies() ? factor_bodies(u) : factor_contacts(u);
  ++search.counts.factorisations;
  search.counts.work += by_bodies() ? cost(search) : cost_by_contacts(search, lu_.operations());
  return regular;
}

bool NewtonMatrix::factor_bodies(double u) {
  bodies_.begin();
  for (int i = 0; i < problem_->contacts(); ++i) {
    const ContactBlocks& c = blocks_[at(i)];
    PackedBlock D;
    enclose(c.L, c.a, c.R, D);
    for (int k = 0; k < 3; ++k) D.column[5 * k] += u;
    bodies_.add(i, D, c.L, c.R);
  }
  return bodies_.factor();
}

bool NewtonMatrix::factor_contacts(double u) {
  const Problem& p = *problem_;
  coupled_.clear();
  for (const ContactBlocks& c : blocks_) coupled_.push_back(!is_zero(c.L));
  lu_.analyse(pattern(p), coupled_.data());
  for (int row = 0; row < lu_.size(); ++row) {
    const int i = lu_.block_row(row);
    lu_.begin_row(row);
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      const int j = p.columns()[at(k)];
      if (!coupled_[at(j)]) continue;
      PackedBlock A = p.blocks()[at(k)], block;
      if (i == j)
        for (int e = 0; e < 12; ++e) A.column[e] += blocks_[at(i)].a.column[e];
      enclose(blocks_[at(i)].L, A, blocks_[at(j)].R, block);
      if (i == j)
        for (int c = 0; c < 3; ++c) block.column[5 * c] += u;
      lu_.add(j, block.column);
    }
    if (!lu_.end_row()) return false;
  }
  return true;
}

void NewtonMatrix::solve(PackedVector* x) {
  if (by_bodies()) return bodies_.solve(x);
  const Problem& p = *problem_;
  for (int row = 0; row < lu_.size() && lu_.size() < p.contacts(); ++row) {
    const int i = lu_.block_row(row);
    alignas(32) double known[4] = {0, 0, 0, 0};  // A R x of the others
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      const int j = p.columns()[at(k)];
      if (coupled_[at(j)]) continue;
      alignas(32) double Rx[4] = {0, 0, 0, 0};
      apply(blocks_[at(j)].R, x[j].v, Rx, 1);
      apply(p.blocks()[at(k)], Rx, known, 1);
    }
    apply(blocks_[at(i)].L, known, x[i].v, -1);
  }
  lu_.solve(x);
}

}  // namespace tether::contact::detail
