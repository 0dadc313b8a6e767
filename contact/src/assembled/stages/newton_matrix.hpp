// Tether: the factorised matrix of Newton steps, by contacts or by bodies (method, eq. 18).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/linalg/block_lu.hpp>

#include "assembled/search/search.hpp"
#include "assembled/stages/body_newton.hpp"

namespace tether::contact::detail {

/// Chooses between equations of contacts and equations of bodies, orders them, and knows what a
/// step costs. The steps write the values: by_bodies() says where.
class NewtonMatrix {
 public:
  /// Costs of a step besides its factorisation: sweeps, and ns for each contact.
  NewtonMatrix(double sweeps, double per_contact) : sweeps_(sweeps), per_contact_(per_contact) {}

  void reset() { ordered_ = by_bodies_ = false; }
  bool ordered() const { return ordered_; }
  bool by_bodies() const { return by_bodies_; }
  /// Estimated ns of a step; by a guess of the fill before the matrix is ordered.
  double cost(const Search& search) const;

  /// True, and ordered, where bodies have so many contacts that a guess of the fill by contacts
  /// decides for equations of bodies.
  bool order_by_bodies(Search& search);
  /// By what costs less, with the fill of both known.
  void order(Search& search);
  /// By bodies where the guess says so, else by contacts, which are analysed for each step.
  void order_for_parts(Search& search);

  linalg::BlockLu& contacts() { return lu_; }
  BodyNewton& bodies() { return bodies_; }
  /// Sign of the matrix's determinant, or of one with the same sign where its blocks D have a
  /// positive determinant.
  int determinant_sign() const {
    return by_bodies_ ? bodies_.determinant_sign() : lu_.determinant_sign();
  }
  void solve(PackedVector* x) { by_bodies_ ? bodies_.solve(x) : lu_.solve(x); }

 private:
  void take_bodies_if_cheaper(Search& search);

  double sweeps_, per_contact_;
  bool ordered_ = false, by_bodies_ = false;
  linalg::BlockLu lu_;
  BodyNewton bodies_;
};

}  // namespace tether::contact::detail
