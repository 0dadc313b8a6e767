// Tether: initial values on the constraints and consistent with F (method, section 11).
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/ida_projection/projection.hpp>
#include <vector>

#include "host/corrector.hpp"
#include "host/ida.hpp"
#include "start/algebraic.hpp"
#include "start/joined_rows.hpp"
#include "start/point.hpp"

namespace tether::ida_projection {

/// Fills in how far y and y' (null: it stayed) have moved.
void note_changes(ConsistencyReport& report, N_Vector weights, N_Vector from, N_Vector y,
                  N_Vector from_p, N_Vector yp);

/// Finds consistent initial values. IDA tells its error weights, and evaluates F, only within a
/// step: one is begun that goes nowhere, see answer().
class ConsistentStart {
 public:
  ConsistentStart(const Ida& ida, const Options& options, Corrector& corrector,
                  AlgebraicVariables& variables, JoinedRows& joined, PointProjection& point)
      : ida_(ida),
        options_(options),
        corrector_(corrector),
        variables_(variables),
        joined_(joined),
        point_(point) {}

  /// yy and yp change on success only; IDA starts again at them. `weights` is filled in. `reached`:
  /// time of IDA's last step; minus infinity: there was none.
  ConsistencyReport make(double t0, N_Vector yy, N_Vector yp, const Consistency& how,
                         N_Vector weights, double reached);
  /// Whether IDA's present step is such a one.
  bool asks() const { return inquiry_ != nullptr; }
  /// The decorated solver calls this in it, and makes no correction. Returns advice for the caller,
  /// or an empty text.
  std::string answer(Candidate& candidate);

 private:
  struct Inquiry;
  bool probe(double t0, N_Vector yy, N_Vector yp, Inquiry& inquiry);
  void find_derivative(double t0, N_Vector y, N_Vector ydot, const Consistency& how);
  ConsistencyReport project(double t0, N_Vector y, N_Vector ydot, const Consistency& how,
                            bool* jointly);
  bool move_algebraic_first(double t0, N_Vector start, N_Vector y, N_Vector ydot,
                            const Consistency& how, ConsistencyReport& report);
  void settle(double t0, N_Vector y, N_Vector ydot, const Consistency& how,
              ConsistencyReport& report);

  const Ida& ida_;
  const Options& options_;
  Corrector& corrector_;
  AlgebraicVariables& variables_;
  JoinedRows& joined_;
  PointProjection& point_;
  N_Vector weights_ = nullptr;  // the caller's
  double lead_ = 0.0;           // by which a probe starts before t0, see probe()
  Inquiry* inquiry_ = nullptr;
};

}  // namespace tether::ida_projection
