// Options as programs in C give them. SPDX-License-Identifier: BSD-3-Clause
#include <cstring>
#include <stdexcept>
#include <string>
#include <tether/ida_projection.h>
#include <tether/ida_projection/c_options.hpp>

namespace tether::ida_projection {

// A structure of an older header lacks the last fields.
Options options_of(const tether_options* given, long unknowns) {
  tether_options o;
  tether_options_init(&o, sizeof o);
  if (given != nullptr) {
    if (given->size < sizeof(size_t) || given->size > sizeof o)
      throw std::invalid_argument("options->size = " + std::to_string(given->size) +
                                  ": call tether_options_init(options, sizeof *options) first");
    std::memcpy(&o, given, given->size);
  }
  const auto check = [](bool right, const char* name, long value, const char* allowed) {
    if (!right)
      throw std::invalid_argument(std::string(name) + " = " + std::to_string(value) + ", must be " +
                                  allowed);
  };
  check(o.metric >= TETHER_METRIC_LOCAL_CORRECTION && o.metric <= TETHER_METRIC_AUTOMATIC,
        "options->metric", o.metric, "TETHER_METRIC_...");
  check(o.long_move == TETHER_LONG_MOVE_REJECT || o.long_move == TETHER_LONG_MOVE_CAP,
        "options->long_move", o.long_move, "TETHER_LONG_MOVE_...");
  check(o.polish >= TETHER_POLISH_ALL && o.polish <= TETHER_POLISH_NONE, "options->polish",
        o.polish, "TETHER_POLISH_...");
  check((o.hold == nullptr && o.group == nullptr) || unknowns > 0, "unknowns", unknowns,
        "the length of options->hold and group");
  Options options;
  options.advanced.metric = static_cast<Metric>(o.metric);
  options.advanced.tolerance = o.tolerance;
  options.advanced.maximum_iterations = o.maximum_iterations;
  options.advanced.largest_move = o.largest_move;
  options.advanced.long_move = static_cast<LongMove>(o.long_move);
  options.id = o.id;
  options.suppress_algebraic = o.suppress_algebraic != 0;
  options.advanced.polish = static_cast<Polished>(o.polish);
  options.step_smoothing = o.step_smoothing != 0;
  options.advanced.smooth_where_needed = o.smooth_where_needed != 0;
  options.advanced.maximum_step = o.maximum_step;
  options.advanced.maximum_order = o.maximum_order;
  options.advanced.limit_order = o.limit_order != 0;
  if (o.hold != nullptr)
    for (long i = 0; i < unknowns; ++i) options.hold.push_back(o.hold[i] != 0);
  options.advanced.hold_vector = o.hold_vector;
  if (o.group != nullptr) options.group.assign(o.group, o.group + unknowns);
  options.nonlinear_solver = o.nonlinear_solver;
  options.print = o.print != 0;
  if (o.progress != nullptr)
    options.progress = [call = o.progress, data = o.progress_data](const Progress& p) {
      call(p.t, p.step, p.order, p.drift, p.move, p.steps, data);
    };
  return options;
}

}  // namespace tether::ida_projection
