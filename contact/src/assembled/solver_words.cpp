// Tether: names and advice of the solver. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/solver_words.hpp"

#include "law/interface/law.hpp"

namespace tether::contact {

const char* name(Measure measure) {
  switch (measure) {
    case Measure::automatic:
      return "automatic";
    case Measure::natural_map:
      return "natural_map";
    case Measure::natural_map_data:
      return "natural_map_data";
    case Measure::fixed_point:
      return "fixed_point";
  }
  return "?";
}

const char* name(Method method) {
  switch (method) {
    case Method::automatic:
      return "automatic";
    case Method::gauss_seidel:
      return "gauss_seidel";
    case Method::anderson:
      return "anderson";
    case Method::proximal_newton:
      return "proximal_newton";
    case Method::interior_point:
      return "interior_point";
    case Method::convex_relaxation:
      return "convex_relaxation";
  }
  return "?";
}

const char* name(Status status) {
  switch (status) {
    case Status::unsolved:
      return "unsolved";
    case Status::solved:
      return "solved";
    case Status::stalled:
      return "stalled";
    case Status::cycling:
      return "cycling";
    case Status::work_limit:
      return "work_limit";
    case Status::relaxed:
      return "relaxed";
    case Status::round_off:
      return "round_off";
    case Status::infeasible:
      return "infeasible";
  }
  return "?";
}

namespace detail {

const char* advice(Status status, const Options& options) {
  switch (status) {
    case Status::solved:
      return "";
    case Status::cycling:
      return kernels(options.law).replacement != nullptr && options.strict
                 ? "no fixed point was found; try strict = false, or Law::coulomb"
                 : "no fixed point was found; try another start, a shorter time step or "
                   "Method::convex_relaxation";
    case Status::stalled:
      return "no further progress: round-off or ill-conditioned data, or no solution of the law is "
             "near; error is what was reached; try a larger tolerance or Method::automatic";
    case Status::round_off:
      return "error is what rounding leaves of A x - b at impulses of this size: the tolerance "
             "cannot "
             "be reached; use a larger one, or smaller ratios of mass";
    case Status::work_limit:
      return "error is what was reached; raise max_work or max_sweeps, or use Method::automatic";
    case Status::relaxed:
      return "the convex relaxation is solved; error is the residual of the law";
    case Status::infeasible:
      return "bodies are pressed between contacts that close and cannot yield "
             "(infeasible_direction): "
             "lower the closing velocities, or let one of the contacts go";
    case Status::unsolved:
      return "the impulses lie outside of the range of doubles: use other units";
  }
  return "";
}

}  // namespace detail
}  // namespace tether::contact
