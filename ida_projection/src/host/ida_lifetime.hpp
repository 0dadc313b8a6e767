// Tether: whether the host's ida_mem is still there. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <sundials/sundials_nonlinearsolver.h>
#include <sundials/sundials_nvector.h>

namespace tether::ida_projection {

/// Notices the end of IDA, for which SUNDIALS has no callback. IDAFree destroys the vectors that
/// IDAInit made. The destroy operation in the table of one of them is therefore replaced, and put
/// back at the end. Where vectors share a table nothing is watched.
class IdaLifetime {
 public:
  IdaLifetime() = default;
  ~IdaLifetime();
  IdaLifetime(const IdaLifetime&) = delete;
  IdaLifetime& operator=(const IdaLifetime&) = delete;

  /// `one`, `other`: vectors that IDA owns. `at_end` is called when IDAFree begins to free them,
  /// with ida_mem still readable; it must not throw.
  void watch(N_Vector one, N_Vector other, std::function<void()> at_end);
  /// Whether ida_mem certainly exists.
  bool alive() const { return vector_ != nullptr; }
  /// Whether IDAFree was certainly called.
  bool over() const { return over_; }
  /// Frees `solver`, which IDA may still call, together with IDA; never if nothing is watched.
  void free_at_end(SUNNonlinearSolver solver) const noexcept;

 private:
  static void replace(N_Vector v);
  static void destroy(N_Vector v);
  template <N_Vector (*_generic_N_Vector_Ops::*Clone)(N_Vector)>
  static N_Vector clone_by(N_Vector v);

  N_Vector vector_ = nullptr;  // watched; null: nothing is, or it is gone
  bool over_ = false;
  std::function<void()> at_end_;
};

}  // namespace tether::ida_projection
