// Tether: intervals of doubles, rounded to nearest. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::contact::detail {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Unit roundoff u: a rounded operation errs by at most u times its result.
constexpr double kUnit = std::numeric_limits<double>::epsilon() / 2;
/// More than underflow takes from a term of a sum.
constexpr double kTiny = std::numeric_limits<double>::min();

/// At least the exact sum of `terms` products of numbers >= 0 that was computed as `sum`, in any
/// order. It is at most sum / (1 - gamma), gamma = terms u / (1 - terms u) (Higham, Accuracy and
/// Stability of Numerical Algorithms, 3.1); the factor two and the added terms leave room for the
/// rounding of the terms themselves.
inline double above(double sum, double terms) {
  return sum * (1 + 2 * (terms + 4) * kUnit) + (terms + 4) * kTiny;
}

/// The real numbers from lo to hi. An operation rounds to nearest and then moves the bounds outward
/// by at least a unit in the last place, so that it contains the results of all numbers from its
/// operands. Bounds that are not numbers become infinite.
struct Interval {
  double lo = 0, hi = 0;

  Interval() = default;
  Interval(double x) : lo(x), hi(x) {}  // NOLINT: numbers are intervals
  Interval(double low, double high) : lo(low), hi(high) {}
  static Interval around(double middle, double radius) {
    return outward(middle - radius, middle + radius);
  }
  static Interval outward(double low, double high) {
    if (std::isnan(low) || std::isnan(high)) return {-kInfinity, kInfinity};
    return {std::nextafter(low, -kInfinity) - kTiny, std::nextafter(high, kInfinity) + kTiny};
  }

  double middle() const { return lo + (hi - lo) / 2; }
  /// At least |x| of every x.
  double magnitude() const { return std::max(-lo, hi); }
  /// At least |x - middle()|.
  double radius() const {
    const double m = middle();
    return Interval::outward(0, std::max(m - lo, hi - m)).hi;
  }
};

inline Interval operator-(Interval a) { return {-a.hi, -a.lo}; }
inline Interval operator+(Interval a, Interval b) {
  return Interval::outward(a.lo + b.lo, a.hi + b.hi);
}
inline Interval operator-(Interval a, Interval b) { return a + -b; }
inline Interval operator*(Interval a, Interval b) {
  const double p[] = {a.lo * b.lo, a.lo * b.hi, a.hi * b.lo, a.hi * b.hi};
  for (double each : p)
    if (std::isnan(each)) return {-kInfinity, kInfinity};
  return Interval::outward(*std::min_element(p, p + 4), *std::max_element(p, p + 4));
}
/// x^2 >= 0.
inline Interval square(Interval a) {
  const Interval p = a * a;
  return {std::max(0.0, a.lo <= 0 && a.hi >= 0 ? 0.0 : p.lo), p.hi};
}
/// Square roots of the numbers >= 0 in a.
inline Interval root(Interval a) {
  const Interval r = Interval::outward(std::sqrt(std::max(0.0, a.lo)), std::sqrt(a.hi));
  return {std::max(0.0, r.lo), r.hi};
}
/// a / b, b > 0; the whole line where that is not sure.
inline Interval operator/(Interval a, Interval b) {
  if (!(b.lo > 0)) return {-kInfinity, kInfinity};
  return Interval::outward(std::min(a.lo / b.lo, a.lo / b.hi), std::max(a.hi / b.lo, a.hi / b.hi));
}

/// Sum of a_k x_k in twice the precision (Ogita, Rump and Oishi, SIAM J. Sci. Comput. 26 (2005)
/// 1955, algorithm 5.3 with fused products), with a bound of its error (there, proposition 5.5).
class LongSum {
 public:
  void add(double a, double x) {
    const double product = a * x, sum = high_ + product, part = sum - high_;
    low_ += ((high_ - (sum - part)) + (product - part)) + std::fma(a, x, -product);
    high_ = sum;
    size_ += std::abs(product);
    ++terms_;
  }
  /// The exact sum lies in it.
  Interval value() const {
    const double sum = high_ + low_, gamma = 4 * terms_ * kUnit;
    return Interval::around(sum, above(2 * kUnit * std::abs(sum) + gamma * gamma * size(), terms_));
  }
  /// At least the sum of |a_k x_k|.
  double size() const { return above(size_, terms_); }
  double terms() const { return terms_; }

 private:
  double high_ = 0, low_ = 0, size_ = 0, terms_ = 0;
};

}  // namespace tether::contact::detail
