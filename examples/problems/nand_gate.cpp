// Tether: NAND gate of the test set for IVP solvers. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <problems/circuit.hpp>
#include <problems/dual.hpp>
#include <problems/nand_gate.hpp>

namespace tether::problems {

namespace {

constexpr int kNodes = 14, kOutput = 4, kMiddle = 9;
constexpr double kLoad = 0.5e-4;  // capacity of the two nodes between transistors, to ground

Circuit gate() {
  const MosDevice depletion{-2.43, 0.2, 1.28, 5.35e-4, 5.35e-4};
  // The published code has a tenth of the gain for reverse voltages, and so has the reference.
  const MosDevice enhancement{0.2, 0.035, 1.01, 1.748e-3, 1.748e-4};
  Circuit c;
  c.nodes = kNodes;
  c.inputs = {{5.0, 5.0, 5.0, 5.0, 20.0}, {15.0, 5.0, 15.0, 5.0, 40.0}};
  c.resistance = 4.0;
  c.bulk_resistance = 10.0;
  c.gate_capacity = 0.6e-4;
  c.junction_capacity = 2.4e-5;
  c.leak = 1e-14;
  c.transistors = {{depletion, 0, kOutput, kOutput, c.supply()},
                   {enhancement, 5, c.input(0), kMiddle, kOutput},
                   {enhancement, 10, c.input(1), c.ground(), kMiddle}};
  return c;
}

using List = std::array<double, kNodes + 4>;

List voltages(const Circuit& c, double t, const double* v, bool rate) {
  List list;
  std::copy(v, v + kNodes, list.begin());
  c.outside(t, rate, list.data());
  return list;
}

// f(t, V); the first entries of the list are nodes.
List currents(const Circuit& c, double t, const double* v) {
  const List at = voltages(c, t, v, false), rates = voltages(c, t, v, true);
  List flows;
  c.currents(at.data(), rates.data(), flows.data());
  return flows;
}

// C(V) V'
List displaced(const Circuit& c, double t, const double* v, const double* vp) {
  const List at = voltages(c, t, v, false);
  List rates = voltages(c, t, vp, true), out;
  rates[static_cast<std::size_t>(c.supply())] = 0.0;
  c.capacitors(
      rates.data(),
      [&](int bulk, int other) {
        const auto i = static_cast<std::size_t>(bulk), j = static_cast<std::size_t>(other);
        return c.capacity(at[i] - at[j]) * (rates[i] - rates[j]);
      },
      out.data());
  for (const std::size_t node : {kOutput, kMiddle}) out[node] += kLoad * rates[node];
  return out;
}

template <class S>
void charges(const Circuit& c, const S* v, S* q) {
  S at[kNodes + 4], out[kNodes + 4];
  std::copy(v, v + kNodes, at);
  c.outside(0.0, false, at);
  c.capacitors(
      at, [&](int bulk, int other) { return c.charge(at[bulk] - at[other]); }, out);
  for (const int node : {kOutput, kMiddle}) out[node] += kLoad * at[node];
  std::copy(out, out + kNodes, q);
}

}  // namespace

std::vector<std::string> nand_gate_forms() { return {"index 0", "index 1"}; }

Problem nand_gate(const std::string& form) {
  const bool index1 = form == "index 1";
  if (!index1 && form != "index 0") unknown_form("nand gate", form, nand_gate_forms());
  const Circuit c = gate();
  const double high = Circuit::kSupply, bulk = Circuit::kBulk, middle = 3.62385;
  std::vector<double> v0 = {high, high, bulk,   bulk, high,   middle, high,
                            bulk, bulk, middle, 0.0,  middle, bulk,   bulk};
  const List flows = currents(c, 0.0, v0.data());
  Eigen::MatrixXd capacity(kNodes, kNodes);
  for (int j = 0; j < kNodes; ++j) {
    const Eigen::VectorXd unit = Eigen::VectorXd::Unit(kNodes, j);
    const List column = displaced(c, 0.0, v0.data(), unit.data());
    capacity.col(j) = Eigen::Map<const Eigen::VectorXd>(column.data(), kNodes);
  }
  const Eigen::VectorXd rates =
      capacity.partialPivLu().solve(Eigen::Map<const Eigen::VectorXd>(flows.data(), kNodes));
  std::vector<double> yp0(rates.data(), rates.data() + kNodes), id(kNodes, index1 ? 0.0 : 1.0);
  if (index1) {
    double q0[kNodes];
    charges(c, v0.data(), q0);
    v0.insert(v0.end(), q0, q0 + kNodes);
    yp0.insert(yp0.end(), flows.begin(), flows.begin() + kNodes);
    id.resize(2 * kNodes, 1.0);
  }
  Problem p = start_problem("nand gate", form, index1 ? 1 : 0, 80.0, v0, yp0, id);
  p.error_components = kNodes;
  if (index1) {
    p.residual = [c](double t, const double* y, const double* yp, double* r) {
      const List f = currents(c, t, y);
      charges(c, y, r + kNodes);
      for (int i = 0; i < kNodes; ++i) {
        r[i] = yp[kNodes + i] - f[static_cast<std::size_t>(i)];
        r[kNodes + i] -= y[kNodes + i];
      }
    };
    std::vector<std::string> names;
    for (int i = 1; i <= kNodes; ++i) names.push_back("charge of node " + std::to_string(i));
    p.rows.push_back(rows_of_values("charges", names, p.size, [c](double, const auto* y, auto* g) {
      charges(c, y, g);
      for (int i = 0; i < kNodes; ++i) g[i] -= y[kNodes + i];
    }));
    p.recommended = {"charges"};
  } else {
    p.residual = [c](double t, const double* y, const double* yp, double* r) {
      const List f = currents(c, t, y), out = displaced(c, t, y, yp);
      for (std::size_t i = 0; i < kNodes; ++i) r[i] = out[i] - f[i];
    };
  }
  // PSIDE at 1e-16.
  p.reference = {4.971088699385777,   4.999752103929311,      -2.499998781491227,
                 -2.499999999999975,  4.970837023296724,      -0.2091214032073855,
                 4.970593243278363,   -2.500077409198803,     -2.499998781491227,
                 -0.2090289583878100, -0.2399999999966269e-3, -0.2091214032073855,
                 -2.499999999999991,  -2.500077409198803};
  // One node is below a millivolt; a charge is as small as its voltage, times a capacity.
  for (const double volts : p.reference)
    p.atol_scale.push_back(std::clamp(std::abs(volts), 1e-4, 1.0));
  for (int i = 0; index1 && i < kNodes; ++i)
    p.atol_scale.push_back(c.gate_capacity * p.atol_scale[static_cast<std::size_t>(i)]);
  p.reference.resize(static_cast<std::size_t>(p.size), std::nan(""));
  return p;
}

}  // namespace tether::problems
