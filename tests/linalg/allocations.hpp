// Tether: counts memory allocations of the whole process. SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace tether::test {

/// Calls of malloc, calloc, realloc and the aligned forms so far, whoever made them, SUNDIALS
/// included. Where a sanitizer owns malloc, or without glibc: calls of operator new only.
long allocations();

}  // namespace tether::test
