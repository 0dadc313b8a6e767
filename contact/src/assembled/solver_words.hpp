// Tether: what the solver says in words. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/solver.hpp>

namespace tether::contact::detail {

// What to try next; empty if there is nothing to advise.
const char* advice(Status status, const Options& options);

}  // namespace tether::contact::detail
