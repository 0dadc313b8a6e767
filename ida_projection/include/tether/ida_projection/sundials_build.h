/* Tether: which SUNDIALS the plugin and its host were compiled with, for C and C++.
 * SPDX-License-Identifier: BSD-3-Clause */
#ifndef TETHER_SUNDIALS_BUILD_H
#define TETHER_SUNDIALS_BUILD_H

#include <sundials/sundials_config.h>

#if !defined(SUNDIALS_DOUBLE_PRECISION)
#error "tether::ida_projection needs a SUNDIALS in double precision (SUNDIALS_PRECISION=double)"
#endif
#if defined(SUNDIALS_INT64_T)
#define TETHER_SUNDIALS_INDEX_BITS 64
#elif defined(SUNDIALS_INT32_T)
#define TETHER_SUNDIALS_INDEX_BITS 32
#else
#error "tether::ida_projection: sundials_config.h has neither SUNDIALS_INT64_T nor SUNDIALS_INT32_T"
#endif

#define TETHER_SUNDIALS_NAME_OF(major, bits) tether_built_for_sundials_##major##_double_index##bits
#define TETHER_SUNDIALS_NAME(major, bits) TETHER_SUNDIALS_NAME_OF(major, bits)
#define TETHER_SUNDIALS_BUILD \
  TETHER_SUNDIALS_NAME(SUNDIALS_VERSION_MAJOR, TETHER_SUNDIALS_INDEX_BITS)

#ifdef __cplusplus
extern "C" {
#endif
#if defined(__GNUC__)
#pragma GCC visibility push(default)
#endif

/** A version of SUNDIALS. */
typedef struct {
  int major, minor, patch, index_bits; /**< index_bits: 32 or 64 */
} tether_sundials_build;

/** The SUNDIALS whose headers the library was compiled with. The header of its host spells the name
 * with what the host sees; the layouts of SUNDIALS' structures change with all three parts, and a
 * host that sees others does not link: "undefined reference to
 * tether_built_for_sundials_7_double_index64" means that the library is for another SUNDIALS. */
extern const tether_sundials_build TETHER_SUNDIALS_BUILD;

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif
#ifdef __cplusplus
}
#endif
#endif
