// Tether: plain IDA and IDA with the projection. SPDX-License-Identifier: BSD-3-Clause
#include <sundials/sundials_version.h>

#include <algorithm>

#include "code.hpp"

namespace tether::bench {

namespace {

enum class Variant { tested, suppressed, projected, smooth };

class IdaCode : public Code {
 public:
  IdaCode(Variant variant, bool fast) : variant_(variant), fast_(fast) {}

  std::string name() const override {
    const std::string fast = fast_ ? " fast" : "";
    switch (variant_) {
      case Variant::tested:
        return "IDA" + fast;
      case Variant::suppressed:
        return "IDA" + fast + " suppressed";
      case Variant::projected:
        return "Tether" + fast;
      case Variant::smooth:
        break;
    }
    return "Tether" + fast + " smooth";
  }

  std::string version() const override {
    char text[32] = "";
    SUNDIALSGetVersion(text, sizeof text);
    return std::string("SUNDIALS ") + text;
  }

  std::string refuses(const problems::Problem& problem) const override {
    if (problem.index > 2) return "IDA is made for index 0, 1 and, with care, 2";
    const bool projects = variant_ == Variant::projected || variant_ == Variant::smooth;
    if (projects && !keeps_something(problem)) return kNothingKept;
    const bool algebraic = std::count(problem.id.begin(), problem.id.end(), 0.0) > 0;
    if (variant_ == Variant::suppressed && !algebraic) return "no algebraic variables";
    return {};
  }

  Run run(const problems::Problem& problem, double tolerance, const Limits& limits,
          const Watch& watch) const override {
    Settings settings;
    settings.fast = fast_;
    settings.limits = limits;
    settings.watch = watch;
    settings.suppress = variant_ == Variant::suppressed;
    if (variant_ == Variant::projected || variant_ == Variant::smooth) {
      settings.constraints = problem.recommended_constraints();
      settings.options.step_smoothing = variant_ == Variant::smooth;
      settings.options.print = false;
      // Derived from columns of dF/dy' it would cost an F for each unknown.
      settings.give_id = !problem.sparse.starts.empty();
    }
    return integrate(problem, tolerance, settings);
  }

 private:
  Variant variant_;
  bool fast_;
};

}  // namespace

void add_ida_codes(Codes& codes) {
  for (const Variant variant :
       {Variant::tested, Variant::suppressed, Variant::projected, Variant::smooth})
    codes.push_back(std::make_unique<IdaCode>(variant, false));
  for (const Variant variant : {Variant::tested, Variant::suppressed, Variant::projected})
    codes.push_back(std::make_unique<IdaCode>(variant, true));
}

}  // namespace tether::bench
