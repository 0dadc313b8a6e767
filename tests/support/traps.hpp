// Tether: invalid operations, divisions by zero and overflow end the program while a Traps lives.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cfenv>

namespace tether::test {

#if defined(__GLIBC__) && (defined(__x86_64__) || defined(__i386__))
constexpr bool kHasTraps = true;
class Traps {
 public:
  Traps() {
    std::feclearexcept(FE_ALL_EXCEPT);
    feenableexcept(kThree);
  }
  ~Traps() { fedisableexcept(kThree); }
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
