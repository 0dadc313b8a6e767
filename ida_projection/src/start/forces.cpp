// Tether: does F move unknowns as forces move bodies? SPDX-License-Identifier: BSD-3-Clause
#include "start/forces.hpp"

#include <algorithm>
#include <cmath>

#include "host/owned_vector.hpp"

namespace tether::ida_projection {

namespace {

// F with some y or y' changed by sizes that vary irregularly, as in AlgebraicVariables::derive():
// ypred + ycor is the same to the last bit wherever only y' changes.
class Answers {
 public:
  Answers(const Candidate& candidate, Corrector& corrector, double cj, Statistics& statistics)
      : candidate_(candidate),
        corrector_(corrector),
        statistics_(statistics),
        n_(static_cast<std::size_t>(N_VGetLength(candidate.base))),
        ycor_(candidate.base),
        f_(candidate.base),
        saved_(candidate.base) {
    N_VScale(1.0, candidate.base, saved_);
    N_VConst(0.0, ycor_);
    const double* y = N_VGetArrayPointer(saved_);
    for (std::size_t j = 0; j < n_; ++j) {
      const double w = candidate.weight_entries[j];
      changes_.push_back((1.5 + 0.5 * std::sin(1.0 + 2.3 * static_cast<double>(j))) *
                         std::max(w > 0.0 ? 1.0 / w : 1.0, 1e-3 / std::abs(cj)));
      low_.push_back(y[j] - changes_[j]);
      candidate.base_entries[j] = low_[j] + changes_[j];
    }
    before_ = std::vector<double>(n_);
    evaluate();
    const double* f = N_VGetArrayPointer(f_);
    std::copy(f, f + n_, before_.begin());
  }
  ~Answers() { N_VScale(1.0, saved_, candidate_.base); }
  Answers(const Answers&) = delete;
  Answers& operator=(const Answers&) = delete;

  /// Could F be evaluated every time?
  bool known() const { return known_; }
  /// 1 for each equation that notices these y'.
  std::vector<char> to_rates(const std::vector<int>& unknowns) {
    double *e = N_VGetArrayPointer(ycor_), *base = candidate_.base_entries;
    for (const int i : unknowns) {
      e[i] = changes_[static_cast<std::size_t>(i)];
      base[i] = low_[static_cast<std::size_t>(i)];
    }
    return answers(unknowns);
  }
  /// The same for y.
  std::vector<char> to_values(const std::vector<int>& unknowns) {
    for (const int i : unknowns)
      candidate_.base_entries[i] += changes_[static_cast<std::size_t>(i)];
    return answers(unknowns);
  }

 private:
  void evaluate() {
    ++statistics_.residual_evaluations;
    known_ = known_ && corrector_.residual(ycor_, f_) == 0;
  }
  std::vector<char> answers(const std::vector<int>& unknowns) {
    evaluate();
    for (const int i : unknowns) {
      const auto j = static_cast<std::size_t>(i);
      N_VGetArrayPointer(ycor_)[i] = 0.0;
      candidate_.base_entries[i] = low_[j] + changes_[j];
    }
    std::vector<char> out(n_, 0);
    const double* f = N_VGetArrayPointer(f_);
    for (std::size_t i = 0; i < n_; ++i) out[i] = f[i] == before_[i] ? 0 : 1;
    return out;
  }

  const Candidate& candidate_;
  Corrector& corrector_;
  Statistics& statistics_;
  std::size_t n_;
  OwnedVector ycor_, f_, saved_;
  std::vector<double> changes_, low_, before_;
  bool known_ = true;
};

bool meet(const std::vector<char>& a, const std::vector<char>& b) {
  for (std::size_t i = 0; i < a.size(); ++i)
    if (a[i] != 0 && b[i] != 0) return true;
  return false;
}

}  // namespace

bool are_forces(const RowChain& chain, const Candidate& candidate, Corrector& corrector, double cj,
                Statistics& statistics) {
  if (candidate.base_entries == nullptr || !(std::abs(cj) > 0.0)) return false;
  Answers answers(candidate, corrector, cj, statistics);
  const std::vector<char> own = answers.to_rates(chain.forces);
  const auto equations_for = [&](const std::vector<int>& unknowns) {
    std::vector<char> equations = answers.to_rates(unknowns);
    for (std::size_t i = 0; i < own.size(); ++i) equations[i] = own[i] != 0 ? 0 : equations[i];
    return equations;
  };
  const std::vector<char> positions = equations_for(chain.positions);
  for (const std::vector<int>& group : chain.velocities_of_rows)
    if (!meet(answers.to_values(group), positions)) return false;
  if (meet(answers.to_values(chain.forces), positions)) return false;
  const std::vector<char> velocities = equations_for(chain.velocities);
  for (const std::vector<int>& group : chain.forces_of_rows)
    if (!meet(answers.to_values(group), velocities)) return false;
  return answers.known();
}

}  // namespace tether::ida_projection
