// Tether: the factorised matrix of Newton steps, by contacts or by bodies (method, eq. 18, 20).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/linalg/block_lu.hpp>
#include <vector>

#include "assembled/search/search.hpp"
#include "problem/body_form.hpp"

namespace tether::contact::detail {

/// Solves (D + L A R) y = r, all but A = H H' block-diagonal, by
///
///     (1 + H' R D^-1 L H) p = H' R D^-1 r,   y = D^-1 (r - L H p)
///
/// with six rows a body in place of three a contact, or the rank of A. Where bodies touch at many
/// points, a wall of bricks, that is a tenth of the work and less; digits that D^-1 L H p cancels
/// come back by refinement.
class BodyNewton {
 public:
  /// Orders the nodes of a form, which lives as long as it is used.
  void order(const BodyForm& form);
  /// Estimated ns of a factorisation.
  double cost() const {
    return 4 * lu_.operations() + 200.0 * static_cast<double>(inverse_.size()) +
           37.5 * static_cast<double>(place_.size());
  }

  void begin();
  /// Blocks of contact i, three columns of four.
  void add(int i, const PackedBlock& D, const PackedBlock& L, const PackedBlock& R);
  bool factor();  // false: singular
  // Sign of det(1 + H' R D^-1 L H). It is that of det(D + L A R) where det D is positive.
  int determinant_sign() const { return lu_.determinant_sign(); }
  void solve(PackedVector* y);

 private:
  const BodyForm* form_ = nullptr;
  BlockLu lu_;
  std::vector<int> start_, columns_;
  std::vector<int> place_, place_start_;  // in values_, of all pairs of nodes of a contact
  std::vector<PackedBlock> values_;
  std::vector<PackedBlock> inverse_, inverse_left_, right_inverse_;  // D^-1, D^-1 L, R D^-1
  Packed p_;
};

inline double mean_diagonal(const LocalBlock& L) { return (L.a + L.T[0] + L.T[2]) / 3; }

/// factor times the symmetric part of a contact's own block of A.
PackedBlock own_block(const LocalBlock& L, double factor);

/// The blocks of u + L (A + a) R at one contact.
struct ContactBlocks {
  PackedBlock a, L, R;
};

/// u + L (A + a) R, u = 0 or 1, by equations of contacts, without those that have L = 0, or of
/// bodies; knows what a step with it costs.
class NewtonMatrix {
 public:
  void reset(int contacts) {
    form_ = Form::none;
    blocks_.resize(at(contacts));
  }
  bool ordered() const { return form_ != Form::none; }
  bool by_bodies() const { return form_ == Form::bodies; }
  /// Estimated ns of a factorisation of all contacts and a few solutions; by a guess of the fill
  /// before the matrix is ordered.
  double cost(const Search& search) const;

  /// True, and ordered, where bodies have so many contacts that a guess of the fill by contacts
  /// decides for equations of bodies.
  bool order_by_bodies(Search& search);
  /// By what costs less, with the fill of both known.
  void order(Search& search);

  ContactBlocks& operator[](int contact) { return blocks_[at(contact)]; }
  /// Counts its work, too. False: singular.
  bool factor(Search& search, double u = 1);
  /// Sign of the matrix's determinant, or of one with the same sign where its blocks D have a
  /// positive determinant.
  int determinant_sign() const {
    return by_bodies() ? bodies_.determinant_sign() : lu_.determinant_sign();
  }
  void solve(PackedVector* x);

 private:
  bool factor_bodies(double u);
  bool factor_contacts(double u);
  double cost_by_contacts(const Search& search, double operations) const;

  double operations_ = 0;  // by contacts, with all of them
  enum class Form { none, contacts, bodies } form_ = Form::none;
  const Problem* problem_ = nullptr;  // of the factors
  std::vector<ContactBlocks> blocks_;
  std::vector<char> coupled_;  // contacts with L != 0
  BlockLu lu_;
  BodyNewton bodies_;
};

}  // namespace tether::contact::detail
