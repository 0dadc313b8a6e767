// Tether: invalid operations, divisions by zero and overflow end the program while a Traps lives.
// Memory begins with numbers whose squares overflow, so that reading before writing does, too.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cfenv>
#if defined(__GLIBC__)
#include <malloc.h>
#endif

namespace tether::test {

#if defined(__GLIBC__) && (defined(__x86_64__) || defined(__i386__))
constexpr bool kHasTraps = true;
class Traps {
 public:
  Traps() {
    std::feclearexcept(FE_ALL_EXCEPT);
    feenableexcept(kThree);
    mallopt(M_PERTURB, 0x80);  // each byte is the complement
  }
  ~Traps() {
    fedisableexcept(kThree);
    mallopt(M_PERTURB, 0);
  }
  Traps(const Traps&) = delete;
  Traps& operator=(const Traps&) = delete;

 private:
  static constexpr int kThree = FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW;
};
#else
constexpr bool kHasTraps = false;
struct Traps {
  ~Traps() {}
};
#endif

}  // namespace tether::test
