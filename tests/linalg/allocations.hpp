// Tether: counts memory allocations of the whole process, and lets one fail.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace tether::test {

/// Calls of malloc, calloc, realloc and the aligned forms so far, whoever made them, SUNDIALS
/// included. Where a sanitizer owns malloc, or without glibc: calls of operator new only.
long allocations();

/// Blocks that were allocated, by the calls counted above, and not freed.
long blocks_alive();

/// The n-th allocation from now on (n = 0: the next one) fails; n < 0: none.
void fail_allocation(long n);
/// Has the one that was to fail done so?
bool allocation_failed();

}  // namespace tether::test
