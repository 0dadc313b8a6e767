// Tether: one interface for every integrator that is compared. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <memory>
#include <problems/problem.hpp>
#include <string>
#include <vector>

#include "projection/run.hpp"

namespace tether::bench {

/// An integrator. All use rtol = atol = tolerance (times the problem's scales), dense LU and
/// difference Jacobians, so that times compare methods and not callbacks.
class Code {
 public:
  virtual ~Code() = default;
  virtual std::string name() const = 0;     ///< "RADAU5"
  virtual std::string version() const = 0;  ///< of the library it comes from
  /// Why it cannot run on this machine and what to install; empty when it can.
  virtual std::string missing() const { return {}; }
  /// Why it cannot integrate this form; empty when it can.
  virtual std::string refuses(const problems::Problem& problem) const = 0;
  virtual Run run(const problems::Problem& problem, double tolerance, const Limits& limits,
                  const Watch& watch = {}) const = 0;
};

using Codes = std::vector<std::unique_ptr<Code>>;

/// Ours and plain IDA: "IDA" (algebraic variables in the error test), "IDA suppressed", "Tether",
/// "Tether smooth".
void add_ida_codes(Codes& codes);

/// "RADAU5", "DASPK", "DASPK suppressed" from r-cran-desolve, opened at run time.
void add_desolve_codes(Codes& codes);

/// "CVODE+proj", for forms that are ordinary differential equations.
void add_cvode_code(Codes& codes);

/// "CPodes" of Simbody, where that was found when the benchmarks were built.
void add_cpodes_code(Codes& codes);

/// Every code, the missing ones too.
Codes all_codes();

/// The code without what is said about its error test: "IDA suppressed" is one way to run "IDA".
inline std::string base_name(const std::string& code) {
  const std::size_t end = code.find(" suppressed");
  return end == std::string::npos ? code : code.substr(0, end);
}

inline bool is_ours(const std::string& code) { return code == "Tether" || code == "Tether smooth"; }

}  // namespace tether::bench
