// Options as programs in C give them. SPDX-License-Identifier: BSD-3-Clause
#include <cstring>
#include <stdexcept>
#include <string>
#include <tether/ida_projection/c_options.hpp>

#include "c/guarded.hpp"

namespace tether::ida_projection {

namespace {

/// each(field for C, the same for C++): those that differ in nothing but their type.
template <class ForC, class ForCpp, class Each>
void for_fields(ForC& c, ForCpp& cpp, Each&& each) {
  each(c.metric, cpp.advanced.metric);
  each(c.tolerance, cpp.advanced.tolerance);
  each(c.maximum_iterations, cpp.advanced.maximum_iterations);
  each(c.largest_move, cpp.advanced.largest_move);
  each(c.long_move, cpp.advanced.long_move);
  each(c.id, cpp.id);
  each(c.suppress_algebraic, cpp.suppress_algebraic);
  each(c.polish, cpp.advanced.polish);
  each(c.step_smoothing, cpp.step_smoothing);
  each(c.smooth_where_needed, cpp.advanced.smooth_where_needed);
  each(c.maximum_step, cpp.advanced.maximum_step);
  each(c.maximum_order, cpp.advanced.maximum_order);
  each(c.limit_order, cpp.advanced.limit_order);
  each(c.hold_vector, cpp.advanced.hold_vector);
  each(c.nonlinear_solver, cpp.nonlinear_solver);
  each(c.print, cpp.print);
}

}  // namespace

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
  if ((o.hold != nullptr || o.group != nullptr) && unknowns <= 0)
    throw std::invalid_argument("unknowns = " + std::to_string(unknowns) +
                                ", must be the length of options->hold and group");
  Options options;
  for_fields(o, options,
             [](const auto& c, auto& cpp) { cpp = static_cast<std::decay_t<decltype(cpp)>>(c); });
  if (o.hold != nullptr)
    for (long i = 0; i < unknowns; ++i) options.hold.push_back(o.hold[i] != 0);
  if (o.group != nullptr) options.group.assign(o.group, o.group + unknowns);
  if (o.progress != nullptr)
    options.progress = [call = o.progress, data = o.progress_data](const Progress& p) {
      call(p.t, p.step, p.order, p.drift, p.move, p.steps, data);
    };
  return options;
}

}  // namespace tether::ida_projection

int tether_options_init(tether_options* options, size_t size) {
  return tether::ida_projection::c::guarded("tether_options_init", [&](const auto& arguments) {
    arguments.require(options, "options");
    tether_options o{};
    arguments.check(size >= sizeof(size_t) && size <= sizeof o, "size", size,
                    "sizeof(tether_options)");
    const tether::ida_projection::Options defaults;
    tether::ida_projection::for_fields(o, defaults, [](auto& c, const auto& cpp) {
      c = static_cast<std::decay_t<decltype(c)>>(cpp);
    });
    o.size = size;
    std::memcpy(options, &o, size);
  });
}
