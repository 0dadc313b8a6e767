// Tether: which variables are algebraic. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "host/corrector.hpp"
#include "host/owned_vector.hpp"
#include "movers/mover.hpp"

namespace tether::ida_projection {

/// Up to this number of unknowns F is evaluated for each of them.
constexpr int kLargestProbed = 2000;

/// The id vector of IDA (1 differential, 0 algebraic), the caller's or derived from F, and whether
/// F is of index 1 in its own variables.
class AlgebraicVariables {
 public:
  explicit AlgebraicVariables(Statistics& statistics) : statistics_(statistics) {}

  void set(N_Vector id);
  /// Derives the id vector from F at the candidate, on contiguous vectors. Returns the reason of a
  /// failure, else an empty text.
  std::string derive(const Candidate& candidate, Corrector& corrector, double cj);
  bool known() const { return id_; }
  bool any() const { return any_; }
  bool all() const { return all_; }
  /// Null: none is algebraic, or it is not known.
  N_Vector id() const { return any_ ? static_cast<N_Vector>(id_) : nullptr; }
  const double* mask() const { return any_ ? N_VGetArrayPointer(id_) : nullptr; }
  /// The vector itself, also where all are differential.
  N_Vector vector() const { return id_; }

  /// Finds the index of F at the first call; later runs reuse it. `usual`: evaluations of F that a
  /// Jacobian takes in this run, see index.cpp.
  void find_index(const Candidate& candidate, Corrector& corrector, double cj, long usual);
  void note_index_as_low() { index_known_ = true; }
  bool index_known() const { return index_known_; }
  /// F is not of index 1 in its own variables.
  bool high_index() const { return index_known_ && found_.high; }
  /// The index of F if it is 2 or more and could be found, else 0.
  int index() const { return index_known_ ? found_.index : 0; }
  /// Algebraic variables of index 2 or more.
  const std::vector<int>& undetermined() const { return found_.undetermined; }
  /// Keeps in IDA's error test the outputs, on which no differential variable depends, and, if
  /// `coupled` is true, the other variables of index 1. Returns false if none is algebraic or F
  /// could not be evaluated.
  bool choose_tested(bool coupled);
  /// 1 for variables that IDA's error test sees: differential ones and those chosen. Null: none is
  /// algebraic.
  N_Vector tested() const { return tested_ ? static_cast<N_Vector>(tested_) : id(); }
  /// The tested ones that are not outputs.
  const std::vector<int>& coupled() const { return coupled_; }
  void begin_run() { index_known_ = false; }

  /// Names errors of the caller's id vector, after find_index(): variables that it calls algebraic
  /// although F contains their derivatives, or differential although F does not. Empty: none was
  /// found. Costs four evaluations of F at the first call, more if there are errors.
  const std::string& doubts(const Candidate& candidate, Corrector& corrector, double cj);

  /// The equations of F that no change of y' changes, bit for bit.
  std::vector<char> derivative_free_equations(const Candidate& candidate, Corrector& corrector,
                                              double cj) const;

 private:
  // given_id.cpp
  std::vector<int> with_derivative(const Candidate& candidate, Corrector& corrector,
                                   double cj) const;

  // index.cpp
  bool exceeds_one(const Candidate& candidate, Corrector& corrector, double cj, long usual);
  int index_above_one(const Candidate& candidate, Corrector& corrector, double cj,
                      Eigen::MatrixXd slopes);
  bool has_rows_of_zeros(const Candidate& candidate, Corrector& corrector, double cj);
  void find_outputs(const Eigen::MatrixXd& slopes);

  struct Found {
    bool known = false, high = false;
    int index = 0;
    std::vector<int> undetermined, outputs;
    std::vector<int> without_derivative;  // differential ones whose y' is nowhere in F
    bool judged_id = false;
    std::string doubts;
  };

  Statistics& statistics_;
  OwnedVector id_;
  bool any_ = false, all_ = false;
  bool index_known_ = false;  // in this run
  Found found_;
  OwnedVector tested_;  // null: as id
  std::vector<int> coupled_;
};

}  // namespace tether::ida_projection
