// Tether: charge pump of the test set for IVP solvers. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <problems/charge_pump.hpp>
#include <problems/dual.hpp>

namespace tether::problems {

namespace {

constexpr double kThreshold = 0.2, kBody = 0.035, kPhi = 1.01, kOxide = 4e-12;
const double kFlat = kThreshold - kBody * std::sqrt(kPhi) - kPhi;  // flat-band voltage
constexpr double kSourceCapacity = 1.6e-12, kDrainCapacity = 0.4e-12;
constexpr double kHigh = 20.0, kPeriod = 120e-9, kUp = 50e-9, kTop = 60e-9, kDown = 110e-9;

double input(double t) {
  const double phase = std::fmod(t, kPeriod);
  if (phase < kUp) return 0.0;
  if (phase < kTop) return kHigh * (phase - kUp) / (kTop - kUp);
  if (phase < kDown) return kHigh;
  return kHigh * (kPeriod - phase) / (kPeriod - kDown);
}

template <class S>
struct Charges {
  S gate, channel;  // `channel`: of source and of drain each
};

// Charges of the transistor by the voltages from the gate to bulk, source and drain.
template <class S>
Charges<S> transistor(S bulk, S source, S drain) {
  using std::sqrt;
  if (source <= drain) std::swap(source, drain);
  if (bulk <= kFlat) return {kOxide * (bulk - kFlat), 0.0};
  const S depth = kPhi - (source - bulk);
  const S root = sqrt(depth > S(0.0) ? depth : S(0.0));
  const S threshold = kThreshold + kBody * (root - std::sqrt(kPhi));
  if (source <= threshold)
    return {kOxide * kBody * (sqrt(kBody * kBody / 4.0 + bulk - kFlat) - kBody / 2.0), 0.0};
  const S over = source - threshold;
  const S beyond = drain > threshold ? drain - threshold : S(0.0);
  const S third = (beyond + over - beyond * over / (beyond + over)) / 3.0;
  return {kOxide * (2.0 * third + kBody * root), -kOxide * third};
}

template <class S>
void charge_rows(double, const S* y, S* g) {
  const Charges<S> of = transistor<S>(y[5], y[5] - y[6], y[5] - y[7]);
  g[0] = of.gate - y[0];
  g[1] = kSourceCapacity * y[6] - y[1];
  g[2] = of.channel - y[2];
  g[3] = kDrainCapacity * y[7] - y[3];
  g[4] = of.channel - y[4];
}

}  // namespace

Problem charge_pump() {
  std::vector<double> y0(9, 0.0);
  y0[0] = transistor(0.0, 0.0, 0.0).gate;
  Problem p = start_problem("charge pump", "index 2", 2, 1.2e-6, y0, std::vector<double>(9, 0.0),
                            {1, 1, 1, 1, 1, 0, 0, 0, 0});
  p.atol_scale = {1e-12, 1e-12, 1e-12, 1e-12, 1e-12, 1.0, 1.0, 1.0, 1e-3};
  p.variable_index = {1, 1, 1, 1, 1, 1, 1, 1, 2};
  p.residual = [](double t, const double* y, const double* yp, double* r) {
    r[0] = yp[0] + y[8];
    r[1] = yp[1] + yp[2];
    r[2] = yp[3] + yp[4];
    r[3] = y[5] - input(t);
    charge_rows(t, y, r + 4);
  };
  p.rows.push_back(
      rows_of_values("charges", {"gate", "source capacitor", "source", "drain capacitor", "drain"},
                     9, [](double t, const auto* y, auto* g) { charge_rows(t, y, g); }));
  p.rows.push_back(
      rows_of_values("source", {"source of voltage"}, 9,
                     [](double t, const auto* y, auto* g) { g[0] = y[5] - input(t); }));
  p.rows.push_back(rows_of_values("kept", {"charge at the source", "charge at the drain"}, 9,
                                  [](double, const auto* y, auto* g) {
                                    g[0] = y[1] + y[2];
                                    g[1] = y[3] + y[4];
                                  }));
  p.recommended = {"charges", "source", "kept"};
  // Exact: the transistor is as at the start, and the current is that of the falling voltage. The
  // current published with the problem differs by 6e-6 of it.
  const double root = std::sqrt(kBody * kBody / 4.0 - kFlat);
  p.reference.assign(9, 0.0);
  p.reference[0] = kOxide * kBody * (root - kBody / 2.0);
  p.reference[8] = kOxide * kBody / (2.0 * root) * kHigh / (kPeriod - kDown);
  return p;
}

}  // namespace tether::problems
