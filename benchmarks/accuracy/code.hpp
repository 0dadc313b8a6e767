// Tether: one interface for every integrator that is compared. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
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

/// A code that this machine does not have.
class Absent : public Code {
 public:
  Absent(std::string name, std::string why) : name_(std::move(name)), why_(std::move(why)) {}
  std::string name() const override { return name_; }
  std::string version() const override { return "absent"; }
  std::string missing() const override { return why_; }
  std::string refuses(const problems::Problem&) const override { return why_; }
  Run run(const problems::Problem&, double, const Limits&, const Watch&) const override {
    return {};
  }

 private:
  std::string name_, why_;
};

using Codes = std::vector<std::unique_ptr<Code>>;

/// Ours and plain IDA: "IDA" (algebraic variables in the error test), "IDA suppressed", "Tether",
/// "Tether smooth"; with fast vectors and factors "IDA fast", "IDA fast suppressed", "Tether fast".
void add_ida_codes(Codes& codes);

/// "RADAU5", "DASPK", "DASPK suppressed" from r-cran-desolve, opened at run time.
void add_desolve_codes(Codes& codes);

/// "CVODE+proj" (least move in the weights of the error test) and "CVODE+proj (length)" (in
/// length), for forms that are ordinary differential equations.
void add_cvode_code(Codes& codes);

/// "CPodes" of Simbody, where that was found when the benchmarks were built.
void add_cpodes_code(Codes& codes);

/// Every code, the missing ones too.
Codes all_codes();

/// The code without what is said about its variant: "IDA suppressed" is one way to run "IDA".
inline std::string base_name(const std::string& code) {
  const std::size_t end = std::min(code.find(" suppressed"), code.find(" ("));
  return end == std::string::npos ? code : code.substr(0, end);
}

/// For codes without sparse factors here.
inline bool dense_enough(const problems::Problem& problem) { return problem.sparse.starts.empty(); }
constexpr const char* kOnlyDense = "sparse problem, and its adapter has dense factors only";

/// For codes that project.
inline bool keeps_something(const problems::Problem& problem) {
  return !problem.recommended.empty() || problem.sparse_constraints;
}
constexpr const char* kNothingKept = "its solution keeps nothing that could be projected";

inline bool is_ours(const std::string& code) { return code.rfind("Tether", 0) == 0; }
/// Plain IDA in any variant, "IDA fast" too.
inline bool is_plain(const std::string& code) { return code.rfind("IDA", 0) == 0; }
/// The same steps and bits as the code without it: only times differ.
inline bool is_fast(const std::string& code) { return code.find(" fast") != std::string::npos; }

}  // namespace tether::bench
