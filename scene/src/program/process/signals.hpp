// Tether: Ctrl-C and its kind. SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace tether::scene {

/// From now on the first SIGINT, SIGTERM or SIGHUP is only noted; one that comes a second later or
/// more ends the program. SIGHUP stays ignored where it is (nohup).
void catch_signals();

/// 0: none yet.
int caught_signal();

}  // namespace tether::scene
