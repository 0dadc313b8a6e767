// Tether: which variables are algebraic. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "host/corrector.hpp"
#include "host/owned_vector.hpp"
#include "movers/mover.hpp"

namespace tether::ida_projection {

/// The id vector of IDA (1 differential, 0 algebraic), the caller's or derived from F, and whether
/// F is of index 1 in its own variables.
class AlgebraicVariables {
 public:
  AlgebraicVariables(const Options& options, Statistics& statistics)
      : options_(options), statistics_(statistics) {}

  void set(N_Vector id);
  /// From F itself at the candidate, on contiguous vectors; empty, or why it cannot be had.
  std::string derive(const Candidate& candidate, Corrector& corrector, double cj);
  bool known() const { return id_; }
  bool any() const { return any_; }
  bool all() const { return all_; }
  /// Null: none is algebraic, or it is not known.
  N_Vector id() const { return any_ ? static_cast<N_Vector>(id_) : nullptr; }
  const double* mask() const { return any_ ? N_VGetArrayPointer(id_) : nullptr; }
  /// The vector itself, also where all are differential.
  N_Vector vector() const { return id_; }

  /// Looks at F once in a run.
  /// `usual`: evaluations of F that a Jacobian takes in this run, see index.cpp.
  void look_at_index(const Candidate& candidate, Corrector& corrector, double cj, long usual);
  void note_index_as_low() { index_known_ = true; }
  bool index_known() const { return index_known_; }
  bool high_index() const { return high_index_; }  ///< F is not of index 1 in its own variables
  /// Algebraic variables of index 2 or more.
  const std::vector<int>& undetermined() const { return undetermined_; }
  void forget_index();  ///< a new run starts

  /// Of an id vector that the caller gave, after look_at_index(): variables that it calls algebraic
  /// although F contains their derivatives, or differential although F does not. Empty: none is
  /// known. Four evaluations of F, more where there are some.
  std::string doubts(const Candidate& candidate, Corrector& corrector, double cj) const;

  /// The equations of F that notice no change of y', bit for bit.
  std::vector<char> derivative_free_equations(const Candidate& candidate, Corrector& corrector,
                                              double cj) const;

 private:
  // given_id.cpp
  std::vector<int> with_derivative(const Candidate& candidate, Corrector& corrector,
                                   double cj) const;

  // index.cpp
  bool exceeds_one(const Candidate& candidate, Corrector& corrector, double cj, long usual);
  bool has_rows_of_zeros(const Candidate& candidate, Corrector& corrector, double cj);

  const Options& options_;
  Statistics& statistics_;
  OwnedVector id_;
  bool any_ = false, all_ = false;
  bool high_index_ = false, index_known_ = false;
  std::vector<int> undetermined_;
  std::vector<int> without_derivative_;  // differential ones whose y' look_at_index() found nowhere
};

}  // namespace tether::ida_projection
