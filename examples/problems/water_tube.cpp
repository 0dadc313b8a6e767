// Tether: water tubes of the test set for IVP solvers. SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <cmath>
#include <problems/dual.hpp>
#include <problems/water_tube.hpp>

namespace tether::problems {

namespace {

constexpr int kPipes = 18, kNodes = 13, kBuffers = 2, kSize = 2 * kPipes + kNodes;
constexpr double kViscosity = 1.31e-6, kGravity = 9.8, kDensity = 1e3, kLaminar = 2300.0,
                 kLength = 1e3, kRoughness = 2e-4, kDiameter = 1.0, kBuffer = 200.0;
constexpr double kArea = 3.14159265358979323846 * kDiameter * kDiameter / 4.0;
constexpr double kInertia = kDensity * kLength / kArea, kStore = kBuffer / (kDensity * kGravity);

struct Pipe {
  int from, to;
};
constexpr std::array<Pipe, kPipes> kPipeEnds = {{{1, 2},
                                                 {2, 3},
                                                 {2, 6},
                                                 {3, 4},
                                                 {3, 5},
                                                 {4, 5},
                                                 {5, 10},
                                                 {6, 5},
                                                 {7, 4},
                                                 {7, 8},
                                                 {8, 5},
                                                 {8, 10},
                                                 {9, 8},
                                                 {11, 9},
                                                 {11, 12},
                                                 {12, 7},
                                                 {12, 8},
                                                 {13, 11}}};
// The order of the pressures among the unknowns.
constexpr std::array<int, kNodes> kOrder = {5, 8, 1, 2, 3, 4, 6, 7, 9, 10, 11, 12, 13};

int place(int node) {
  int k = 0;
  while (kOrder[static_cast<std::size_t>(k)] != node) ++k;
  return k;
}

// Flow into a node from outside; `rate`: its derivative, per second.
double supply(int node, double t, bool rate) {
  const double hours = t / 3600.0, u = std::exp(-hours) - 1.0;
  const double wave = rate ? -std::sin(u) * std::exp(-hours) / 3600.0 : 1.0 - std::cos(u);
  if (node == 1) return wave / 200.0;
  if (node == 13) return wave / 80.0;
  if (node != 10) return 0.0;
  return rate ? -hours * (hours * (12.0 * hours - 276.0) + 1440.0) / 3.6e9
              : -hours * hours * (hours * (3.0 * hours - 92.0) + 720.0) / 1e6;
}

template <class S>
S reynolds(S flow) {
  using std::abs;
  return abs(flow) * (kDiameter / (kViscosity * kArea));
}

// kInertia times the rate of a flow.
template <class S>
S pull(int k, const S* y) {
  const Pipe pipe = kPipeEnds[static_cast<std::size_t>(k)];
  const S *pressures = y + 2 * kPipes, flow = y[k], resistance = y[kPipes + k];
  const S drop = pressures[place(pipe.from)] - pressures[place(pipe.to)];
  if (reynolds(flow) > S(kLaminar))
    return drop - resistance * flow * flow * (kDensity * kLength / (kArea * kArea * kDiameter));
  return drop - flow * (32.0 * kViscosity * kDensity * kLength / (kArea * kDiameter * kDiameter));
}

// Colebrook's law, with the critical Reynolds number where the flow is laminar.
template <class S>
S resistance_law(int k, const S* y) {
  using std::log10;
  using std::sqrt;
  const S root = sqrt(y[kPipes + k]), of = reynolds(y[k]);
  const S number = of > S(kLaminar) ? of : S(kLaminar);
  return 1.0 / root - 1.74 + 2.0 * log10(2.0 * kRoughness / kDiameter + 18.7 / (number * root));
}

// Sum over the pipes and the outside of the flow into each node.
template <class S, class Values>
void balance(double t, bool rate, Values values, S* g) {
  for (int n = 0; n < kNodes; ++n) g[n] = supply(kOrder[static_cast<std::size_t>(n)], t, rate);
  for (int k = 0; k < kPipes; ++k) {
    const Pipe pipe = kPipeEnds[static_cast<std::size_t>(k)];
    const S value = values(k);
    g[place(pipe.to)] += value;
    g[place(pipe.from)] -= value;
  }
}

std::vector<std::string> names_of_nodes(const char* what) {
  std::vector<std::string> names;
  for (int n = kBuffers; n < kNodes; ++n)
    names.push_back(what + std::to_string(kOrder[static_cast<std::size_t>(n)]));
  return names;
}

template <class S>
void without_buffers(const S* all, S* g) {
  for (int n = kBuffers; n < kNodes; ++n) g[n - kBuffers] = all[n];
}

}  // namespace

Problem water_tube() {
  constexpr double kStartResistance = 0.47519404529185289807e-1, kStartPressure = 109800.0;
  std::vector<double> y0(kSize, 0.0), id(kSize, 0.0);
  std::fill(y0.begin() + kPipes, y0.begin() + 2 * kPipes, kStartResistance);
  std::fill(y0.begin() + 2 * kPipes, y0.end(), kStartPressure);
  std::fill(id.begin(), id.begin() + kPipes, 1.0);
  std::fill(id.begin() + 2 * kPipes, id.begin() + 2 * kPipes + kBuffers, 1.0);
  Problem p = start_problem("water tube", "index 2", 2, 17.0 * 3600.0, y0,
                            std::vector<double>(kSize, 0.0), id);
  p.atol_scale.assign(kSize, 1e-3);
  p.variable_index.assign(kSize, 1);
  std::fill(p.variable_index.begin() + 2 * kPipes + kBuffers, p.variable_index.end(), 2);
  p.residual = [](double t, const double* y, const double* yp, double* r) {
    for (int k = 0; k < kPipes; ++k) {
      r[k] = kInertia * yp[k] - pull(k, y);
      r[kPipes + k] = resistance_law(k, y);
    }
    double* nodes = r + 2 * kPipes;
    balance(
        t, false, [y](int k) { return y[k]; }, nodes);
    for (int n = 0; n < kBuffers; ++n) nodes[n] = kStore * yp[2 * kPipes + n] - nodes[n];
  };
  std::vector<std::string> pipes;
  for (const Pipe& pipe : kPipeEnds)
    pipes.push_back("pipe " + std::to_string(pipe.from) + "-" + std::to_string(pipe.to));
  p.rows.push_back(rows_of_values("resistance", pipes, kSize, [](double, const auto* y, auto* g) {
    for (int k = 0; k < kPipes; ++k) g[k] = resistance_law(k, y);
  }));
  p.rows.push_back(rows_of_values("flow", names_of_nodes("flow at node "), kSize,
                                  [](double t, const auto* y, auto* g) {
                                    std::decay_t<decltype(*g)> all[kNodes];
                                    balance(
                                        t, false, [y](int k) { return y[k]; }, all);
                                    without_buffers(all, g);
                                  }));
  p.rows.push_back(rows_of_values("acceleration", names_of_nodes("acceleration at node "), kSize,
                                  [](double t, const auto* y, auto* g) {
                                    std::decay_t<decltype(*g)> all[kNodes];
                                    balance(
                                        t, true, [y](int k) { return pull(k, y) / kInertia; }, all);
                                    without_buffers(all, g);
                                  }));
  p.recommended = {"resistance", "flow"};
  p.reference = {
      0.2298488296477430e-2, 0.1188984650746585e-2, 0.1109503645730845e-2, 0.1589620100314825e-3,
      0.1030022640715102e-2, 0.8710606306836165e-3, 0.3243571480903489e-2, 0.1109503645730845e-2,
      0.7120986206521341e-3, 0.6414613963833099e-3, 0.9416978549524347e-3, 0.3403428519096511e-2,
      0.2397639310739395e-2, 0.2397639310739395e-2, 0.3348581430454180e-2, 0.1353560017035444e-2,
      0.1995021413418736e-2, 0.5746220741193575e-2, 0.4751940452918529e-1, 0.4751940452918529e-1,
      0.4751940452918529e-1, 0.4751940452918529e-1, 0.4751940452918529e-1, 0.4751940452918529e-1,
      0.4311196778792902e-1, 0.4751940452918529e-1, 0.4751940452918529e-1, 0.4751940452918529e-1,
      0.4751940452918529e-1, 0.4249217433601160e-1, 0.4732336439609648e-1, 0.4732336439609648e-1,
      0.4270002118868241e-1, 0.4751940452918529e-1, 0.4751940452918529e-1, 0.3651427026675656e-1,
      0.1111268591478108e6,  0.1111270045592387e6,  0.1111271078730254e6,  0.1111269851929858e6,
      0.1111269255355337e6,  0.1111269322658045e6,  0.1111269221703983e6,  0.1111270121140691e6,
      0.1111274419515807e6,  0.1111255158881087e6,  0.1111278793439227e6,  0.1111270995171642e6,
      0.1111298338971779e6};
  return p;
}

}  // namespace tether::problems
