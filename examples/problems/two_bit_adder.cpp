// Tether: two-bit adding unit of the test set for IVP solvers. SPDX-License-Identifier:
// BSD-3-Clause
#include <Eigen/Dense>
#include <problems/circuit.hpp>
#include <problems/dual.hpp>
#include <problems/two_bit_adder.hpp>

namespace tether::problems {

namespace {

constexpr int kNodes = 175, kInputs = 5, kListed = kNodes + 2 + kInputs;
// Nodes count from 1 as published, indices from 0.
constexpr int kSum0 = 49 - 1, kSum1 = 130 - 1, kCarry = 148 - 1;
constexpr double kTime = 1e4, kStiff = 5.0, kOutputLoad = 2e-4 * kTime;

class Adder {
 public:
  Adder() {
    c.nodes = kNodes;
    c.resistance = 40.0 / (kTime * kStiff);
    c.bulk_resistance = 100.0 / (kTime * kStiff);
    c.gate_capacity = 0.6e-4 * kTime;
    c.junction_capacity = 2.4e-5 * kTime;
    c.leak = 1e-15 * kTime * kStiff;
    double length = 5.0, delay = 0.0;
    for (int k = 0; k < kInputs; ++k) {
      c.inputs.push_back({delay, 5.0, length, 5.0, 20.0 * (1 << k)});
      delay += length + 5.0;
      length = 2.0 * length + 5.0;
    }
    const int a0 = c.input(0), b0 = c.input(1), a1 = c.input(2), b1 = c.input(3), in = c.input(4);
    const int nor1 = nor(1, a0, b0), digit0 = or_of_and(14, nor1, b0, a0);
    const int nor2 = nor(32, digit0, in);
    or_of_and(45, nor2, in, digit0);
    const int carry0 = or_of_and(63, nor1, in, digit0), nor3 = nor(81, a1, b1);
    const int digit1 = or_of_and(94, nor3, b1, a1), nand1 = nand(112, carry0, digit1);
    and_of_or(126, nand1, carry0, digit1);
    or_of_and(144, nor3, nor1, digit1);
    transistor(3, 162, digit1, 166, 148);
    transistor(3, 167, digit0, 171, 166);
    transistor(3, 172, in, 0, 171);
  }

  Circuit c;

 private:
  // `series`: how many of the kind stand in series, by which their gain makes up; 0: depletion.
  void transistor(int series, int inner, int gate, int source, int drain) {
    const double gain = kTime * kStiff * (series == 0 ? 53.5e-6 : 4.0 * series * 43.7e-6);
    const MosDevice device = series == 0 ? MosDevice{-2.43, 0.2, 1.28, gain, gain}
                                         : MosDevice{0.2, 0.035, 1.01, gain, gain};
    c.transistors.push_back({device, inner - 1, gate, source > 0 ? source - 1 : c.ground(),
                             drain > 0 ? drain - 1 : c.supply()});
  }
  // The depletion transistor above a gate's output; returns the output as a voltage's index.
  int output(int first) {
    transistor(0, first, first + 3, first + 4, 0);
    return first + 3;
  }
  int nor(int first, int u1, int u2) {
    transistor(1, first + 5, u1, 0, first + 4);
    transistor(1, first + 9, u2, 0, first + 4);
    return output(first);
  }
  int or_of_and(int first, int u1, int u2, int u3) {
    transistor(1, first + 5, u1, 0, first + 4);
    transistor(2, first + 9, u2, first + 13, first + 4);
    transistor(2, first + 14, u3, 0, first + 13);
    return output(first);
  }
  int nand(int first, int u1, int u2) {
    transistor(2, first + 5, u1, first + 9, first + 4);
    transistor(2, first + 10, u2, 0, first + 9);
    return output(first);
  }
  void and_of_or(int first, int u1, int u2, int u3) {
    nand(first, u1, u2);
    transistor(2, first + 14, u3, 0, first + 9);
  }
};

template <class S>
void currents(const Circuit& c, double t, const S* v, S* flows) {
  S at[kListed], rates[kListed];
  std::copy(v, v + kNodes, at);
  c.outside(t, false, at);
  c.outside(t, true, rates);
  S all[kListed];
  c.currents(at, rates, all);
  std::copy(all, all + kNodes, flows);
}

// Charges as published: capacity times voltage, at the supply times the node's own.
template <class S>
void charges(const Circuit& c, const S* v, S* q) {
  S at[kListed], out[kListed];
  std::copy(v, v + kNodes, at);
  c.outside(0.0, false, at);
  c.capacitors(
      at,
      [&](int bulk, int other) -> S {
        const S across = at[bulk] - at[other];
        return c.capacity(across) * (other == c.supply() ? at[bulk] : across);
      },
      out);
  for (const int node : {kSum0, kSum1, kCarry}) out[node] += kOutputLoad * at[node];
  std::copy(out, out + kNodes, q);
}

// The published start: at rest but for the nodes between transistors that do not conduct, which
// keep what they had. Implicit Euler with growing steps, from values of logic at the outputs and
// of the published start at these nodes; too short for junctions to leak.
Eigen::VectorXd rest(const Circuit& c) {
  constexpr double kLow = 0.2;
  Eigen::VectorXd v = Eigen::VectorXd::Constant(kListed, kLow);
  c.outside(0.0, false, v.data());
  for (const int high : {5, 36, 85, 116, 130}) v[high - 1] = Circuit::kSupply;
  const std::pair<int, double> between[] = {
      {27, -0.228160951881241}, {58, -0.026041071738434},  {76, -0.026041071737963},
      {107, 4.734672533390062}, {121, -0.025968303070040}, {135, 4.744923533081098},
      {157, 0.204040693096037}, {166, -0.026017361873568}, {171, -0.026017590106918}};
  for (const auto& [node, potential] : between) v[node - 1] = potential;
  for (const Circuit::Transistor& one : c.transistors) {
    v[one.inner] = v[one.source];
    v[one.inner + 1] = v[one.drain];
    v[one.inner + 2] = v[one.inner + 3] = Circuit::kBulk;
  }
  Eigen::MatrixXd J(kNodes, kNodes);
  Eigen::VectorXd f(kNodes);
  double step = 1e-3;
  const auto flows_of = [&c](const auto* at, auto* flows) { currents(c, 0.0, at, flows); };
  const Dependence flows(kNodes, kNodes, flows_of);
  for (int iteration = 0; iteration < 10; ++iteration) {
    J.setZero();
    flows.derivatives(v.data(), flows_of, [&](std::size_t i, int e, double slope) {
      J(static_cast<int>(i), flows.columns[static_cast<std::size_t>(e)]) = slope;
    });
    currents(c, 0.0, v.data(), f.data());
    J.diagonal().array() -= c.gate_capacity / step;
    const Eigen::VectorXd change = J.partialPivLu().solve(f);
    v.head(kNodes) -= change;
    step *= 3.0;
  }
  return v.head(kNodes);
}

}  // namespace

Problem two_bit_adder() {
  const Circuit c = Adder().c;
  const Eigen::VectorXd v = rest(c);
  std::vector<double> y0(2 * kNodes), yp0(2 * kNodes, 0.0), id(2 * kNodes, 1.0);
  charges(c, v.data(), y0.data());
  std::copy(v.data(), v.data() + kNodes, y0.begin() + kNodes);
  currents(c, 0.0, v.data(), yp0.data());
  std::fill(id.begin() + kNodes, id.end(), 0.0);
  Problem p = start_problem("two-bit adder", "index 1", 1, 320.0, y0, yp0, id);
  p.residual = [c](double t, const double* y, const double* yp, double* r) {
    currents(c, t, y + kNodes, r);
    charges(c, y + kNodes, r + kNodes);
    for (int i = 0; i < kNodes; ++i) {
      r[i] = yp[i] - r[i];
      r[kNodes + i] -= y[i];
    }
  };
  std::vector<std::string> names;
  for (int i = 1; i <= kNodes; ++i) names.push_back("charge of node " + std::to_string(i));
  p.rows.push_back(rows_of_values("charges", names, p.size, [c](double, const auto* y, auto* g) {
    charges(c, y + kNodes, g);
    for (int i = 0; i < kNodes; ++i) g[i] -= y[i];
  }));
  p.recommended = {"charges"};
  // RADAU5 at 1e-8; the published end, of 1e-5, is off by 7e-7.
  p.reference.assign(2 * kNodes, std::nan(""));
  p.reference[kNodes + kSum0] = 0.204041912845;
  p.reference[kNodes + kSum1] = 4.9972424175;
  p.reference[kNodes + kCarry] = 0.203898575928;
  return p;
}

}  // namespace tether::problems
