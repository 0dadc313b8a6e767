// Tether: rows that are moved together with equations of F. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "host/corrector.hpp"
#include "host/owned_vector.hpp"
#include "movers/rows_at.hpp"
#include "start/algebraic.hpp"

namespace tether::ida_projection {

/// Moves rows that contain algebraic variables of index 1 together with the equations of F that
/// determine these variables (method, section 6).
class JoinedRows {
 public:
  JoinedRows(const Constraints& constraints, const Options& options, Statistics& statistics,
             Corrector& corrector, const AlgebraicVariables& variables)
      : constraints_(constraints),
        options_(options),
        statistics_(statistics),
        corrector_(corrector),
        variables_(variables) {}

  /// F is evaluated and weighed as in the attempt at this candidate.
  void begin(const Candidate& present) { present_ = present; }
  /// Looks for such equations at the candidate.
  void join(const Candidate& candidate);
  void forget();
  /// Evaluates F at the present candidate, so that IDA's y and y' are those of the attempt again:
  /// the joined equations evaluate F elsewhere.
  void restore_ida() { (void)corrector_.residual(present_.correction, f_); }
  /// Moves the rows and the equations; null: the caller's rows move alone.
  RowsAt* rows() const { return rows_.get(); }
  /// The unknowns that it moves.
  const Constraints& constraints() const { return joined_; }
  /// 1 where a variable moves with the rest, 0 where it follows; null: all move.
  N_Vector moved_id() const { return moved_id_ ? moved_id_ : variables_.id(); }
  /// For each row that is moved: it is an equation of F; empty: none is.
  const std::vector<char>& repeats() const { return repeats_; }

 private:
  bool residual_at(const double* y, double* f);

  const Constraints& constraints_;
  const Options& options_;
  Statistics& statistics_;
  Corrector& corrector_;
  const AlgebraicVariables& variables_;
  Candidate present_{};
  Constraints joined_;    // the caller's rows and equations of F
  OwnedVector moved_id_;  // id, with 1 where an algebraic variable moves with the rest
  std::vector<char> repeats_;
  OwnedVector none_, f_;  // of residual_at(): ycor = 0, F
  std::unique_ptr<RowsAt> rows_;
};

}  // namespace tether::ida_projection
