// Tether: the vectors of IDAS' staggered corrector. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <sundials/sundials_config.h>
#include <sundials/sundials_nvector.h>

namespace tether::ida_projection {

/// The content of an N_VectorSensWrapper, the Ns vectors that IDAS corrects together. SUNDIALS
/// declares it in sundials_nvector_senswrapper.h, which Debian does not ship; it is the same from
/// 5.8 to 7.5. See why_not_wrapped().
struct WrappedVectors {
  N_Vector* vectors;
  int count;
#if SUNDIALS_VERSION_MAJOR >= 7
  sunbooleantype owns;
#else
  booleantype owns;
#endif
};

inline N_Vector* vectors_of(N_Vector wrapper) {
  return static_cast<WrappedVectors*>(wrapper->content)->vectors;
}

/// Empty, or why `wrapper` is not what IDAS' prediction of `count` sensitivities looks like.
/// `expected`: its vectors, from IDAS' own getter.
inline std::string why_not_wrapped(N_Vector wrapper, N_Vector* expected, int count) {
  const auto* content = static_cast<const WrappedVectors*>(wrapper->content);
  if (content == nullptr || expected == nullptr) return "IDAS has no sensitivities";
  // A type of its own in the newest versions, custom in others; never one of whole vectors.
  if (wrapper->ops->nvgetarraypointer != nullptr) {
    // The table of operations of the vectors inside is copied in part only: without data access.
    return "this SUNDIALS stores sensitivities in another way than versions 5.8 to 7.5";
  }
  if (content->count != count)
    return "Sensitivities::count = " + std::to_string(count) + ", but IDASensInit was given " +
           std::to_string(content->count);
  for (int k = 0; k < count; ++k)
    if (content->vectors == nullptr || content->vectors[k] != expected[k])
      return "this SUNDIALS stores sensitivities in another way than versions 5.8 to 7.5";
  return "";
}

}  // namespace tether::ida_projection
