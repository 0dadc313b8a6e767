// main() of every test program: Catch2 v2 compiles it here once, v3 brings it in a library.
// SPDX-License-Identifier: BSD-3-Clause
#if !__has_include(<catch2/catch_all.hpp>)
#define CATCH_CONFIG_MAIN
#include <catch2/catch.hpp>
#endif
