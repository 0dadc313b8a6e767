// Tether: the decorator of IDAS' staggered corrector (method, eq. 22). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <tether/ida_projection/sensitivities.hpp>
#include <type_traits>
#include <vector>

#include "attach/impl.hpp"
#include "movers/vector/vector_metric.hpp"

namespace tether::ida_projection {

/// After IDAS has corrected the sensitivities s_k = spred_k + e_k of a step whose state is
/// projected already: e_k <- e_k - ds_k with C (s_k - ds_k) + dg/dp_k = 0, C at that state. As for
/// the state, a polish follows, and is moved back onto the rows: it removes the noise that IDAS'
/// convergence test leaves and lets algebraic variables respond. Each sensitivity has a metric of
/// its own, from the size of its corrections, which makes its errors smaller than the metric of the
/// state does.
class SensitivityCorrector final : public Companion {
 public:
  /// `state`: the half of the plugin that moves the state. Throws std::invalid_argument.
  SensitivityCorrector(Projection::Impl& state, Sensitivities given);
  ~SensitivityCorrector() override;
  SensitivityCorrector(const SensitivityCorrector&) = delete;
  SensitivityCorrector& operator=(const SensitivityCorrector&) = delete;

  /// A new run of the state begins.
  void forget_run() override;
  int count() const { return given_.count; }
  /// Onto the rows at (t, y), then sp; starts.cpp.
  void make_consistent(double t, N_Vector y, N_Vector yp, N_Vector weights, N_Vector* s,
                       N_Vector* sp, ConsistencyReport& report);

  // IDAS calls these, see host/operations.hpp.
  int initialize() { return corrector_->initialize(); }
  int solve(N_Vector predicted, N_Vector correction, N_Vector weights, double tolerance,
            bool call_setup, void* mem);
  Corrector& corrector() { return *corrector_; }
  long iterations_after_correction() const { return polish_ ? polish_->iterations() : 0; }
  int caught(Status outcome, const char* text) noexcept {
    return state_.report_.caught(outcome, text);
  }

 private:
  std::string set_up(N_Vector predicted);
  void use_rows_of_state();
  void note_setups(double cj);
  Status evaluate(const StepData& step);
  Status factor(const Candidate& candidate, int k, bool first);
  const std::string& text() const { return message_.empty() ? rows_->report.text : message_; }
  void accept();
  Status move_and_polish(const Candidate& candidate, const StepData& step, double tolerance,
                         Fix& fix);
  Status find_moves(const Candidate& candidate, double t, bool first, double* longest);
  Status too_long(const Candidate& candidate, int k, double length);
  void apply(const Candidate& candidate);
  Status derivative(int k, double t, N_Vector y);
  Status differences(int parameter, double t, N_Vector y, std::vector<double>& g_p);
  void add_terms(int k);
  void leave_out_of_error_test(N_Vector weights);
  void restore_weights(N_Vector weights);
  int finish(Status status);

  Projection::Impl& state_;
  Sensitivities given_;
  Owned<SUNNonlinearSolver, SUNNonlinSolFree> own_;
  std::unique_ptr<Corrector> corrector_;
  Owned<SUNNonlinearSolver, SUNNonlinSolFreeEmpty> solver_;  // IDAS sees it

  const Constraints* moved_ = nullptr;  // the caller's rows, or joined with equations of F
  std::unique_ptr<RowsAt> rows_;
  OwnedVector weights_, s_, work_, spare_;
  N_Vector y_ = nullptr;                        // the accepted candidate
  std::vector<VectorMetric> metrics_;           // of each parameter
  std::vector<OwnedVector> ds_;                 // of each parameter
  std::vector<std::vector<double>> row_terms_;  // dg/dp_k
  std::vector<double> r_, shifted_;
  std::string message_;  // of a failure that is not in rows_

  // In the shape of IDAS' wrapped vectors, made in the first solve.
  Statistics uncounted_;
  std::unique_ptr<AlgebraicVariables> variables_;
  std::unique_ptr<Polish> polish_;
  OwnedVector id_;
  bool engaged_ = false;
  long setups_ = 0, steps_ = -1;
  std::vector<double> saved_weights_;  // of coupled variables, in the last attempt
  long saved_steps_ = -1;              // accepted before it
};

}  // namespace tether::ida_projection
