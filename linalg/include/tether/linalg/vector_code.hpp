// Tether: how inner loops are compiled. SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Inner loops are built twice where the compiler can choose at run time (GCC, x86-64): once for
// the base architecture and once with AVX2 and FMA. No global -march flag is needed. Sanitizers
// cannot run the resolvers, so they get the base version. A level or a feature is asked for, not a
// processor: "arch=haswell" is chosen on Intel's Haswell line only, never on AMD's.
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__) && \
    !defined(TETHER_NO_CLONES)
#if __GNUC__ >= 12
#define TETHER_CLONES __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define TETHER_CLONES __attribute__((target_clones("fma", "default")))
#endif
#else
#define TETHER_CLONES
#endif

#if defined(__GNUC__)
#define TETHER_INLINE inline __attribute__((always_inline))
#else
#define TETHER_INLINE inline
#endif

// A loop whose arrays are the same or apart: no element depends on another one.
#if defined(__clang__)
#define TETHER_ELEMENTWISE _Pragma("clang loop vectorize(assume_safety)")
#elif defined(__GNUC__)
#define TETHER_ELEMENTWISE _Pragma("GCC ivdep")
#else
#define TETHER_ELEMENTWISE
#endif
