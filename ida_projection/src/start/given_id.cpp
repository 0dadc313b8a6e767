// Tether: does the caller's id vector agree with F? SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "start/algebraic.hpp"

namespace tether::ida_projection {

namespace {

constexpr std::size_t kNamed = 6;  // the others are counted

std::string list(const std::vector<int>& variables) {
  std::string out;
  const std::size_t shown = std::min(variables.size(), kNamed);
  for (std::size_t k = 0; k < shown; ++k)
    out += (k == 0                     ? "y["
            : k + 1 < variables.size() ? ", y["
                                       : " and y[") +
           std::to_string(variables[k]) + "]";
  if (shown < variables.size()) out += " and " + std::to_string(variables.size() - shown) + " more";
  return out;
}

}  // namespace

const std::string& AlgebraicVariables::doubts(const Candidate& candidate, Corrector& corrector,
                                              double cj) {
  if (found_.judged_id || candidate.base_entries == nullptr) return found_.doubts;
  found_.judged_id = true;
  std::string& text = found_.doubts;
  std::vector<int> moving = with_derivative(candidate, corrector, cj);
  if (!moving.empty())
    text = "the id vector calls " + list(moving) +
           " algebraic, but F contains the derivative: 1 stands for differential variables, 0 for "
           "algebraic ones (Options::id)";
  if (!found_.without_derivative.empty())
    text += (text.empty() ? "the id vector calls " : "; it calls ") +
            list(found_.without_derivative) +
            " differential, but F does not contain the derivative: 0 stands for algebraic "
            "variables (Options::id)";
  return text;
}

// Those called algebraic whose y' F notices. All of them are changed at once first, in two sizes
// that vary irregularly, as in derive(), so that those of one equation do not cancel.
std::vector<int> AlgebraicVariables::with_derivative(const Candidate& candidate,
                                                     Corrector& corrector, double cj) const {
  if (mask() == nullptr) return {};
  const auto size = static_cast<std::size_t>(N_VGetLength(candidate.base));
  OwnedVector ycor(candidate.base), before(candidate.base), after(candidate.base),
      saved(candidate.base);
  N_VScale(1.0, candidate.base, saved);
  N_VConst(0.0, ycor);
  const double* original = N_VGetArrayPointer(saved);
  double* e = N_VGetArrayPointer(ycor);
  bool noticed = false;
  for (const double sign : {1.0, -0.37}) {
    std::vector<double> low(size);
    for (std::size_t j = 0; j < size; ++j) {
      const double w = candidate.weight_entries[j];
      const double change = sign * (1.5 + 0.5 * std::sin(1.0 + 2.3 * static_cast<double>(j))) *
                            std::max(w > 0.0 ? 1.0 / w : 1.0, 1e-3 / std::abs(cj));
      e[j] = mask()[j] == 0.0 ? change : 0.0;
      low[j] = original[j] - e[j];
      candidate.base_entries[j] = low[j] + e[j];  // the argument of F in both evaluations
    }
    OwnedVector none(candidate.base);
    N_VConst(0.0, none);
    bool known = corrector.residual(none, before) == 0;
    std::copy(low.begin(), low.end(), candidate.base_entries);
    known = corrector.residual(ycor, after) == 0 && known;
    statistics_.residual_evaluations += 2;
    N_VScale(1.0, saved, candidate.base);
    const double *a = N_VGetArrayPointer(before), *b = N_VGetArrayPointer(after);
    for (std::size_t i = 0; known && i < size; ++i) noticed |= !(a[i] == b[i]);
  }
  if (!noticed) return {};
  AlgebraicVariables derived(options_, statistics_);
  std::vector<int> moving;
  const bool found = derived.derive(candidate, corrector, cj).empty();
  for (std::size_t j = 0; found && j < size; ++j)
    if (mask()[j] == 0.0 && (derived.mask() == nullptr || derived.mask()[j] != 0.0))
      moving.push_back(static_cast<int>(j));
  return moving;
}

}  // namespace tether::ida_projection
