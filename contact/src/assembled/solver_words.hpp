// Tether: names and advice of the solver. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/solver.hpp>

namespace tether::contact::detail {

// Advice for an unsolved problem; empty if there is none.
const char* advice(Status status, const Options& options);

}  // namespace tether::contact::detail
