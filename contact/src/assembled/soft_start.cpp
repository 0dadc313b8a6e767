// Tether: a start from problems with softer contacts. SPDX-License-Identifier: BSD-3-Clause
#include "assembled/soft_start.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "assembled/automatic.hpp"

namespace tether::contact::detail {
namespace {

constexpr double kSoftBlock = 20;  // ns that it takes to soften a block of the problem

}  // namespace

struct SoftStart::Soft {
  Search search;
  Automatic automatic;
};

SoftStart::SoftStart() = default;
SoftStart::~SoftStart() = default;

bool SoftStart::find(Search& search, double budget, Packed& x) {
  const System& system = search.system;
  const double tolerance = search.options.tolerance;
  if (!soft_) soft_ = std::make_unique<Soft>();
  all_.resize(x.size());
  std::iota(all_.begin(), all_.end(), 0);
  std::fill(x.begin(), x.end(), PackedVector());
  for (double tau : {std::sqrt(tolerance), tolerance}) {
    const Problem problem = system.problem().softened(tau);
    search.counts.work += kSoftBlock * static_cast<double>(problem.blocks().size());
    Options options = search.options;
    options.history = false;
    options.tolerance = tau;
    options.max_work = std::min(budget, search.work_end - search.counts.work);
    if (!(options.max_work > 0)) return false;
    Search& soft = soft_->search;
    soft.reset(problem, options, search.measure);
    soft.system.belong_to(system, all_.data());
    soft.system.share_as(system, all_.data());
    soft.system.to_own_units(x.data());
    soft_->automatic.reset(problem.contacts(), options, false);
    soft_->automatic.run_part(soft, x);
    search.counts.add(soft.counts);
    soft.system.to_given_units(soft.best.data());
    x = soft.best;
    if (system.rounding(x.data()) > tolerance) return false;
  }
  return true;
}

}  // namespace tether::contact::detail
