// Tether: what the inner loops are compiled with. SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Inner loops are built twice where the compiler can choose at run time (GCC, x86-64): once for
// the base architecture and once with AVX2 and FMA. No global -march flag is needed. Sanitizers
// cannot run the resolvers, so they get the base version.
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__) && \
    !defined(TETHER_CONTACT_NO_CLONES)
#define TETHER_CLONES __attribute__((target_clones("arch=haswell", "default")))
#else
#define TETHER_CLONES
#endif

#if defined(__GNUC__)
#define TETHER_INLINE inline __attribute__((always_inline))
#else
#define TETHER_INLINE inline
#endif
