// Tether: which variables are algebraic, and of which index. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "host/corrector.hpp"
#include "host/owned_vector.hpp"
#include "movers/rows_at.hpp"

namespace tether::ida_projection {

/// Up to this number of unknowns F is evaluated for each of them: two dense Jacobians of 2000
/// unknowns take seconds.
constexpr int kLargestProbed = 2000;
/// Beyond this number a Jacobian is made by differences only if IDA's own is, too.
constexpr int kLargestSize = 200;

/// The id vector of IDA (1 differential, 0 algebraic), the caller's or derived from F, and whether
/// F is of index 1 in its own variables. Candidates have their cj.
class AlgebraicVariables {
 public:
  explicit AlgebraicVariables(Statistics& statistics) : statistics_(statistics) {}

  void set(N_Vector id);
  /// Derives the id vector from F at the candidate, on contiguous vectors, unless it is known.
  /// Returns advice where that fails, else an empty text.
  std::string derive(const Candidate& candidate, Corrector& corrector);
  bool known() const { return id_; }
  bool any() const { return algebraic_ > 0; }
  bool all() const { return algebraic_ > 0 && algebraic_ == N_VGetLength(id_); }
  /// Null: none is algebraic, or it is not known.
  N_Vector id() const { return any() ? static_cast<N_Vector>(id_) : nullptr; }
  const double* mask() const { return any() ? N_VGetArrayPointer(id_) : nullptr; }
  /// The vector itself, also where all are differential.
  N_Vector vector() const { return id_; }

  void begin_run() { index_ = Index::unknown; }
  /// Finds the index of F at the first call; later runs reuse it. `usual`: evaluations of F that a
  /// Jacobian takes in this run, see exceeds_one().
  void find_index(const Candidate& candidate, Corrector& corrector, long usual);
  void note_index_as_low() { index_ = Index::presumed_low; }
  bool index_known() const { return index_ != Index::unknown; }
  /// F is not of index 1 in its own variables.
  bool high_index() const { return index_ == Index::high; }
  /// It is, as all of its derivatives have shown.
  bool low_index() const { return index_ == Index::low; }
  /// The index of F if it is 2 or more and could be found, else 0.
  int index() const { return index_known() ? found_.index : 0; }
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

  /// Names errors of the caller's id vector, after find_index(): variables that it calls algebraic
  /// although F contains their derivatives, or differential although F does not. Empty: none was
  /// found. Costs four evaluations of F at the first call, more if there are errors.
  const std::string& doubts(const Candidate& candidate, Corrector& corrector);

  /// The equations of F that no change of y' changes, bit for bit.
  std::vector<char> derivative_free_equations(const Candidate& candidate,
                                              Corrector& corrector) const;

 private:
  enum class Index { unknown, presumed_low, low, high };
  struct Found {
    Index is = Index::unknown;  // F could not be evaluated
    int index = 0;
    std::vector<int> undetermined, outputs;
    std::vector<int> without_derivative;  // differential ones whose y' is nowhere in F
  };

  bool differential(int j) const { return !any() || mask()[j] != 0.0; }
  std::vector<int> algebraic() const;
  bool noticed_by(const std::vector<int>& components, bool rates,
                  std::initializer_list<double> sizes, const Candidate& candidate,
                  Corrector& corrector, std::vector<char>& noticed) const;
  std::vector<int> with_derivative(const Candidate& candidate, Corrector& corrector) const;
  Index exceeds_one(const Candidate& candidate, Corrector& corrector, long usual);
  int index_above_one(const Candidate& candidate, Corrector& corrector, Eigen::MatrixXd slopes);
  bool has_rows_of_zeros(const Candidate& candidate, Corrector& corrector);
  void find_outputs(const Eigen::MatrixXd& slopes);

  Statistics& statistics_;
  OwnedVector id_;
  sunindextype algebraic_ = 0;    // of other than contiguous vectors: 1 stands for any number
  Index index_ = Index::unknown;  // in this run
  Found found_;
  std::optional<std::string> doubts_;
  OwnedVector tested_;  // null: as id
  std::vector<int> coupled_;
};

}  // namespace tether::ida_projection
