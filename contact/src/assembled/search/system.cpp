// Tether: sweeps, block solutions and tests of a problem under a law. SPDX-License-Identifier:
// BSD-3-Clause
#include "assembled/search/search.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "law/kernels/exact_error.hpp"
#include "problem/criterion.hpp"

namespace tether::contact::detail {
namespace {

TETHER_CLONES void multiply(const View& s, const PackedVector* x, PackedVector* w) {
  for (int i = 0; i < s.n; ++i) row(s, x, i, w[i].v);
}

View view(const Problem& p, const char* rule, double* lambda, const double* weight,
          const Proximal& proximal = {}) {
  return {p.contacts(),
          p.row_start().data(),
          p.columns().data(),
          p.blocks().data(),
          p.locals().data(),
          p.packed_b().data(),
          rule,
          lambda,
          weight,
          proximal.tau,
          proximal.anchor,
          nullptr,
          nullptr};
}

double relative(const Norms& n, double norm_b) {
  const double size = std::max({norm_b, n.x, n.w});
  return size > 0 ? n.map / size : n.map;
}

}  // namespace

// Chooses units (powers of two) in which the largest trace of a block and the largest component of
// b are near 1, if they are extreme in some island. One unit for the whole problem is preferred to
// one for each island. Sums and products then round as in ordinary units.
void System::choose_units(const Problem& given) {
  problem_ = &given;
  mass_.clear();
  speed_.clear();
  largest_.clear();
  for (int i = 0; i < given.contacts(); ++i) {
    const std::size_t k = at(given.islands()[at(i)]);
    if (k == largest_.size()) largest_.push_back({0, 0});
    auto& [trace, most] = largest_[k];
    trace = std::max(trace, given.local(i).a + given.local(i).T[0] + given.local(i).T[2]);
    for (double v : given.packed_b()[at(i)].v) most = std::max(most, std::abs(v));
  }
  double all[2] = {0, 0};
  for (const auto& each : largest_)
    for (int c = 0; c < 2; ++c) all[c] = std::max(all[c], each[at(c)]);
  const auto serve = [&](double of_A, double of_b) {
    const auto ordinary = [](double v) { return v > kLeastOrdinary && v < kMostOrdinary; };
    for (const auto& [trace, most] : largest_)
      if (!ordinary(trace * of_A) || !(most == 0 || ordinary(most * of_b))) return false;
    return true;
  };
  if (serve(1, 1)) return;
  // Even, so that roots of A, the weights of the contacts, scale exactly.
  const auto exponent = [](double v) { return v > 0 ? -2 * (std::ilogb(v) / 2) : 0; };
  const int mass = exponent(all[0]), speed = exponent(all[1]);
  const bool together = serve(1 / all[0], all[1] > 0 ? 1 / all[1] : 1);
  for (const auto& [trace, most] : largest_) {
    mass_.push_back(together ? mass : exponent(trace));
    speed_.push_back(together ? speed : exponent(most));
  }
  rescaled_ = given.rescaled(mass_, speed_);
  problem_ = &rescaled_;
}

void System::change_units(PackedVector* x, int sign) const {
  for (int i = 0; in_other_units() && i < n_; ++i)
    for (double& v : x[i].v) v = std::ldexp(v, sign * impulse_unit(i));
}

double System::price_of_bodies() const {
  constexpr double kBlock = 12, kContact = 1500;  // ns
  return kBlock * static_cast<double>(problem_->blocks().size()) + kContact * n_;
}

void System::reset(const Problem& given, Law law) {
  choose_units(given);
  found_.reset();
  const Problem& problem = *problem_;
  law_ = &detail::kernels(law);
  n_ = problem.contacts();
  rule_.clear();
  weight_.resize(at(n_));
  lambda_.assign(at(n_), -1);
  share_.resize(at(n_));
  inverse_scale_.resize(at(n_));
  needed_.clear();
  norm2_.clear();
  double sum = 0;
  for (int i = 0; i < n_; ++i) {
    const LocalBlock& L = problem.local(i);
    const double* b = problem.packed_b()[at(i)].v;
    weight_[at(i)] = std::sqrt((L.a + L.T[0] + L.T[2]) / 3);
    share_[at(i)] = 1.0 / (problem.row_start()[at(i + 1)] - problem.row_start()[at(i)]);
    const int island = problem.islands()[at(i)];
    if (island == static_cast<int>(needed_.size())) {
      needed_.push_back(0);
      norm2_.push_back(0);
    }
    const double bt2 = b[1] * b[1] + b[2] * b[2], bb = b[0] * b[0] + bt2;
    const double needed =
        needed_change(b[0], std::sqrt(bt2), friction(i), 0.5 * (L.T[0] + L.T[2]) * L.inv_a);
    needed_[at(island)] = std::max(needed_[at(island)], needed);
    norm2_[at(island)] += bb;
    sum += bb;
  }
  for (int i = 0; i < n_; ++i) {
    const int island = problem.islands()[at(i)];
    inverse_scale_[at(i)] = detail::inverse_scale(needed_[at(island)], norm2_[at(island)]);
  }
  norm_b_ = std::sqrt(sum);
}

void System::belong_to(const System& whole, const std::vector<int>& contacts) {
  for (int i = 0; i < n_; ++i) {
    const int in_whole = contacts[at(i)];
    if (whole.replaced(in_whole)) replace(i);
    inverse_scale_[at(i)] = std::ldexp(whole.inverse_scale(in_whole), velocity_unit(i));
    share_[at(i)] = whole.share_[at(in_whole)];
  }
}

void System::replace(int i) {
  rule_.resize(at(n_), 0);
  rule_[at(i)] = 1;
}

void System::sweep(PackedVector* x, const Proximal& proximal) {
  const View s = view(*problem_, rule_.data(), lambda_.data(), weight_.data(), proximal);
  kernels().sweep(s, x);
}

double System::blocks(const PackedVector* x, PackedVector* out, const Proximal& proximal,
                      Regime* regimes, LocalDerivative* derivatives) {
  const View s = view(*problem_, rule_.data(), lambda_.data(), weight_.data(), proximal);
  return kernels().blocks(s, x, out, regimes, derivatives);
}

void System::changes(const PackedVector* x, PackedVector* z, double* change) {
  blocks(x, z);
  for (int i = 0; i < n_; ++i) {
    double d2 = 0;
    for (int c = 0; c < 3; ++c) {
      const double d = z[i].v[c] - x[i].v[c];
      d2 += d * d;
    }
    const double weight = weight_[at(i)];
    change[i] = weight * weight * std::sqrt(d2) * inverse_scale_[at(i)];
  }
}

void velocities(const Problem& problem, bool long_sums, const PackedVector* x, PackedVector* w) {
  const View s = view(problem, nullptr, nullptr, nullptr);
  if (!long_sums) return multiply(s, x, w);
  for (int i = 0; i < s.n; ++i) {
    Wide sum[3];
    wide_row(s, x, i, sum);
    for (int c = 0; c < 3; ++c) w[i].v[c] = static_cast<double>(sum[c]);
  }
}
void System::velocities(const PackedVector* x, const PackedVector* b, PackedVector* w) const {
  View s = view(*problem_, nullptr, nullptr, nullptr);
  s.b = b;
  multiply(s, x, w);
}

double System::natural_map(const PackedVector* x, PackedVector* scratch) const {
  if (!mass_.empty()) return natural_map_given(x, scratch);
  const View s = view(*problem_, any_replaced() ? rule_.data() : nullptr, nullptr, nullptr);
  const Norms n = kernels().natural_map(s, x, scratch);
  return relative(n, norm_b_);
}

Test System::fixed_point(const PackedVector* x) { return kernels().error(error_view(), x); }
double System::judged_fixed_point(const PackedVector* x) {
  const double round_off = rounding(x), fast = fixed_point(x).least;
  const double hidden = kSumUnits * round_off;  // bound on the difference from long sums
  // On the brink of sliding a change of the last bit of b leads a strongly coupled contact to a
  // second solution, far away (method, section 3.3): hence the minimum.
  const double error = fast <= hidden ? std::min(exact_fixed_point(x), fast + hidden) : fast;
  return std::max(error, round_off);
}
double System::exact_fixed_point(const PackedVector* x, double* each) {
  return kernels().exact_error(error_view(), x, each);
}
View System::error_view() {
  View s = view(*problem_, rule_.data(), lambda_.data(), nullptr);
  s.share = share_.data();
  s.inverse_scale = inverse_scale_.data();
  return s;
}

// The natural map depends on units and is evaluated in the given ones. It is homogeneous in x and w
// together: both are divided by the power of two that makes the largest entry about 1.
double System::natural_map_given(const PackedVector* x, PackedVector* scratch) const {
  const View s = view(*problem_, any_replaced() ? rule_.data() : nullptr, nullptr, nullptr);
  multiply(s, x, scratch);
  int most = std::numeric_limits<int>::min();
  const auto exponents = [&](int i) {
    const std::size_t k = at(problem_->islands()[at(i)]);
    return std::pair(mass_[k] - speed_[k], -speed_[k]);  // of x and of w
  };
  for (int i = 0; i < n_; ++i)
    for (int c = 0; c < 3; ++c) {
      if (x[i].v[c] != 0) most = std::max(most, exponents(i).first + std::ilogb(x[i].v[c]));
      for (double v : {scratch[i].v[c], problem_->packed_b()[at(i)].v[c]})
        if (v != 0) most = std::max(most, exponents(i).second + std::ilogb(v));
    }
  double map = 0, xx = 0, ww = 0, bb = 0;
  for (int i = 0; i < n_; ++i) {
    double xi[3], wi[3], v[3];
    for (int c = 0; c < 3; ++c) {
      xi[c] = std::ldexp(x[i].v[c], exponents(i).first - most);
      wi[c] = std::ldexp(scratch[i].v[c], exponents(i).second - most);
      const double b = std::ldexp(problem_->packed_b()[at(i)].v[c], exponents(i).second - most);
      bb += b * b;
    }
    law_of(i).natural_point(s.local[i], xi, wi, v);
    for (int c = 0; c < 3; ++c) {
      map += (xi[c] - v[c]) * (xi[c] - v[c]);
      xx += xi[c] * xi[c];
      ww += wi[c] * wi[c];
    }
  }
  return relative({std::sqrt(map), std::sqrt(xx), std::sqrt(ww)}, std::sqrt(bb));
}

double System::rounding(const PackedVector* x) const {
  const Problem& p = *problem_;
  double most = 0;
  for (int i = 0; i < n_; ++i) {
    double sum[3] = {0, 0, 0};
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      const double* A = p.blocks()[at(k)].column;
      const double* v = x[p.columns()[at(k)]].v;
      for (int c = 0; c < 3; ++c)
        for (int r = 0; r < 3; ++r) sum[r] += std::abs(A[4 * c + r] * v[c]);
    }
    most = std::max(most, std::max({sum[0], sum[1], sum[2]}) * inverse_scale_[at(i)]);
  }
  return kRoundOff * most;
}

}  // namespace tether::contact::detail
