// Tether: networks of MOS transistors, for circuits of the test set for IVP solvers.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace tether::problems {

/// A transistor after Shichman and Hodges.
struct MosDevice {
  double threshold, body, phi, gain;
  double reverse_gain;  ///< where the drain is below the source
};

/// Current from drain to source, by the voltages between its terminals.
template <class S>
S drain_current(const MosDevice& device, S drain_source, S gate_source, S bulk_source, S gate_drain,
                S bulk_drain) {
  using std::sqrt;
  constexpr double kLength = 0.02;  // by which the voltage shortens the channel
  const bool reverse = drain_source < S(0.0);
  const S along = reverse ? -drain_source : drain_source;
  const S depth = device.phi - (reverse ? bulk_drain : bulk_source);
  const S threshold = device.threshold +
                      device.body * (sqrt(depth > S(0.0) ? depth : S(0.0)) - std::sqrt(device.phi));
  const S over = (reverse ? gate_drain : gate_source) - threshold;
  if (over <= S(0.0)) return S(0.0);
  const S square = over <= along ? over * over : along * (2.0 * over - along);
  return (reverse ? -device.reverse_gain : device.gain) * square * (1.0 + kLength * along);
}

/// Transistors whose terminals are connected to nodes by resistances, with capacitances of constant
/// size at the gate and of junctions at the bulk. Voltages are listed as nodes, ground, supply,
/// inputs; a terminal is an index into that list.
struct Circuit {
  struct Transistor {
    MosDevice device;
    int inner;  ///< the first of its four own nodes: source, drain, bulk at source, bulk at drain
    int gate, source, drain;
  };
  /// From low to high and back, periodic.
  struct Pulse {
    double delay, rise, top, fall, period;
  };

  int nodes = 0;
  std::vector<Transistor> transistors;
  std::vector<Pulse> inputs;
  double resistance = 0.0, bulk_resistance = 0.0;       ///< at source and drain; at the bulk
  double gate_capacity = 0.0, junction_capacity = 0.0;  ///< the latter without voltage
  double leak = 0.0;                                    ///< of a junction

  static constexpr double kSupply = 5.0, kBulk = -2.5, kHigh = 5.0;

  int ground() const { return nodes; }
  int supply() const { return nodes + 1; }
  int input(int k) const { return nodes + 2 + k; }
  std::size_t listed() const { return static_cast<std::size_t>(nodes) + 2 + inputs.size(); }

  /// Fills ground, supply and inputs of the list, or their rates.
  template <class S>
  void outside(double t, bool rate, S* voltages) const {
    voltages[ground()] = S(0.0);
    voltages[supply()] = S(rate ? 0.0 : kSupply);
    for (std::size_t k = 0; k < inputs.size(); ++k)
      voltages[input(static_cast<int>(k))] = S(pulse(inputs[k], t, rate));
  }

  /// Currents into every node through resistances, channels and junctions, and from the inputs
  /// through gates (`rates`: of the list). `flows` has the size of the list.
  template <class S>
  void currents(const S* v, const S* rates, S* flows) const {
    std::fill(flows, flows + listed(), S(0.0));
    for (const Transistor& one : transistors) {
      const int s = one.inner, d = s + 1, bs = s + 2, bd = s + 3;
      const S channel =
          drain_current(one.device, v[d] - v[s], v[one.gate] - v[s], v[bs] - v[one.source],
                        v[one.gate] - v[d], v[bd] - v[one.drain]);
      flows[s] += channel + (v[one.source] - v[s]) / resistance;
      flows[d] += (v[one.drain] - v[d]) / resistance - channel;
      flows[one.source] += (v[s] - v[one.source]) / resistance;
      flows[one.drain] += (v[d] - v[one.drain]) / resistance;
      for (const auto& [bulk, other] : {std::pair(bs, one.source), std::pair(bd, one.drain)}) {
        const S through = junction_current(v[bulk] - v[other]);
        flows[bulk] += (kBulk - v[bulk]) / bulk_resistance + through;
        flows[other] -= through;
      }
      if (one.gate > supply()) {
        flows[s] += gate_capacity * rates[one.gate];
        flows[d] += gate_capacity * rates[one.gate];
      }
    }
  }

  /// Charges of every node, from its voltages, or currents out of it, from their rates `v`.
  /// junction(bulk, other) gives that of a junction.
  template <class S, class Junction>
  void capacitors(const S* v, Junction junction, S* out) const {
    std::fill(out, out + listed(), S(0.0));
    for (const Transistor& one : transistors) {
      for (const int inner : {one.inner, one.inner + 1}) {
        // An input's share stands among the currents.
        const S across = one.gate > supply() ? v[inner] : v[inner] - v[one.gate];
        out[inner] += gate_capacity * across;
        out[one.gate] -= gate_capacity * across;
      }
      for (const auto& [bulk, other] :
           {std::pair(one.inner + 2, one.source), std::pair(one.inner + 3, one.drain)}) {
        const S charge = junction(bulk, other);
        out[bulk] += charge;
        out[other] -= charge;
      }
    }
  }

  /// Capacity of a junction at a voltage, and its integral from 0.
  template <class S>
  S capacity(S voltage) const {
    using std::sqrt;
    if (voltage <= S(0.0)) return junction_capacity / sqrt(1.0 - voltage / kBarrier);
    return junction_capacity * (1.0 + voltage / (2.0 * kBarrier));
  }
  template <class S>
  S charge(S voltage) const {
    using std::sqrt;
    if (voltage <= S(0.0))
      return 2.0 * kBarrier * junction_capacity * (1.0 - sqrt(1.0 - voltage / kBarrier));
    return junction_capacity * voltage * (1.0 + voltage / (4.0 * kBarrier));
  }

 private:
  static constexpr double kBarrier = 0.87, kThermal = 25.85;

  template <class S>
  S junction_current(S voltage) const {
    using std::exp;
    return voltage <= S(0.0) ? leak * (1.0 - exp(voltage / kThermal)) : S(0.0);
  }

  static double pulse(const Pulse& of, double t, bool rate) {
    const double phase = std::fmod(t, of.period) - of.delay, fall = phase - of.rise - of.top;
    if (phase <= 0.0 || fall > of.fall) return 0.0;
    if (fall > 0.0) return rate ? -kHigh / of.fall : kHigh * (1.0 - fall / of.fall);
    if (phase <= of.rise) return rate ? kHigh / of.rise : kHigh * phase / of.rise;
    return rate ? 0.0 : kHigh;
  }
};

}  // namespace tether::problems
