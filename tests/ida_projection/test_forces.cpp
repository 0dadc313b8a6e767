// Tether: which unknowns of rows are forces. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <nvector/nvector_serial.h>
#include <vector>

#include "host.hpp"
#include "rows/row_levels.hpp"
#include "start/forces.hpp"
#include "support/catch.hpp"

using namespace tether::ida_projection;

namespace {

using Blocks = std::vector<int>;

/// Unknowns in blocks, rows that contain whole blocks, and F: y'_b of each block less sums of sines
/// of some blocks, or of all y and y' where it is the equation of a force.
struct Model {
  std::vector<int> first = {0};
  std::vector<Blocks> rates;  // of each block: what it hangs on
  std::vector<char> anything;
  RowPattern rows;
  bool refuses = false;
  mutable int evaluations = 0;

  int block(int size, bool of_force = false) {
    first.push_back(first.back() + size);
    rates.emplace_back();
    anything.push_back(of_force ? 1 : 0);
    return static_cast<int>(rates.size()) - 1;
  }
  int size() const { return first.back(); }
  void row(Blocks blocks, int count = 1) {
    std::sort(blocks.begin(), blocks.end());
    for (int k = 0; k < count; ++k) {
      for (const int b : blocks)
        for (int j = first[b]; j < first[b + 1]; ++j) rows.columns.push_back(j);
      rows.starts.push_back(static_cast<int>(rows.columns.size()));
    }
  }
  void residual(const double* y, const double* yp, double* r) const {
    double all = 0.0;
    for (int j = 0; j < size(); ++j) all += std::sin(y[j] + 0.1 * j) * (1.0 + yp[j]);
    for (std::size_t b = 0; b < rates.size(); ++b)
      for (int i = first[b]; i < first[b + 1]; ++i) {
        r[i] = yp[i] - (anything[b] != 0 ? all : 0.0);
        for (const int on : rates[b])
          for (int j = first[static_cast<std::size_t>(on)];
               j < first[static_cast<std::size_t>(on) + 1]; ++j)
            r[i] -= std::sin(y[j] + 0.3 * i);
      }
  }
};

struct Asked {
  bool chain = false, forces = false;
  int evaluations = 0;
};

struct Host {
  const Model* model;
  N_Vector base, rate;
  double cj;
};

int system(N_Vector ycor, N_Vector f, void* mem) {
  const Host& host = *static_cast<Host*>(mem);
  const int n = host.model->size();
  if (host.model->refuses && host.model->evaluations++ > 3) return 1;
  ++host.model->evaluations;
  std::vector<double> y, yp;
  for (int j = 0; j < n; ++j) {
    y.push_back(NV_Ith_S(host.base, j) + NV_Ith_S(ycor, j));
    yp.push_back(NV_Ith_S(host.rate, j) + host.cj * NV_Ith_S(ycor, j));
  }
  host.model->residual(y.data(), yp.data(), NV_DATA_S(f));
  return 0;
}

/// Asks about the unknowns of this level and above.
Asked ask(Model& model, int level) {
  model.rows.n = model.size();
  Asked asked;
  RowChain chain;
  const std::vector<int> levels =
      levels_of_columns(model.rows.starts, model.rows.columns, model.size());
  asked.chain = find_chain(model.rows, levels, level, &chain);
  if (!asked.chain) return asked;

  const tether::test::Context context;
  N_Vector base = N_VNew_Serial(model.size(), context), rate = N_VClone(base),
           correction = N_VClone(base), weights = N_VClone(base);
  for (int j = 0; j < model.size(); ++j) {
    NV_Ith_S(base, j) = std::cos(1.0 + j);
    NV_Ith_S(rate, j) = std::sin(2.0 + j);
  }
  N_VConst(0.0, correction);
  N_VConst(1e6, weights);
  Host host{&model, base, rate, 1e3};
  Candidate candidate{0.0, base, correction, weights};
  candidate.with_entries();
  Statistics statistics;
  {
    Corrector corrector(nullptr, base);
    corrector.set_system(system);
    corrector.begin(&host);
    model.evaluations = 0;
    asked.forces = are_forces(chain, candidate, corrector, host.cj, statistics);
    asked.evaluations = static_cast<int>(statistics.residual_evaluations);
  }
  for (int j = 0; j < model.size(); ++j) {
    CHECK(NV_Ith_S(base, j) == std::cos(1.0 + j));
    CHECK(NV_Ith_S(correction, j) == 0.0);
  }
  for (N_Vector used : {base, rate, correction, weights}) N_VDestroy(used);
  return asked;
}

/// Highest level of the rows' unknowns.
int highest(const Model& model) {
  const std::vector<int> levels =
      levels_of_columns(model.rows.starts, model.rows.columns, model.size());
  return *std::max_element(levels.begin(), levels.end());
}

/// Points in a row, each bound to the one before, with the forces that bind them.
Model points(int count, bool with_work) {
  Model m;
  Blocks x, v, p, all;
  for (int i = 0; i < count; ++i) {
    x.push_back(m.block(3));
    v.push_back(m.block(3));
    p.push_back(m.block(1, true));
    m.rates[x[i]] = {v[i]};
    m.rates[v[i]] = {x[i], v[i], p[i]};
    if (i == 0) continue;
    for (const int other : {x[i - 1], v[i - 1]}) m.rates[v[i]].push_back(other);
    for (const int other : {x[i], v[i], p[i]}) m.rates[v[i - 1]].push_back(other);
  }
  for (int i = 0; i < count; ++i) {
    Blocks at = {x[i]}, rates = {v[i]}, near = {p[i]};
    if (i > 0) at.push_back(x[i - 1]), rates.push_back(v[i - 1]), near.push_back(p[i - 1]);
    if (i + 1 < count) near.insert(near.end(), {x[i + 1], v[i + 1], p[i + 1]});
    m.row(at);
    rates.insert(rates.end(), at.begin(), at.end());
    m.row(rates);
    near.insert(near.end(), rates.begin(), rates.end());
    m.row(near);
    all.insert(all.end(), {x[i], v[i]});
  }
  if (with_work) {
    const int work = m.block(1);
    m.rates[work] = all;
    all.push_back(work);
    m.row(all);
  }
  return m;
}

/// Bodies in quaternions in a row, joints between each and the one before it, or the ground.
Model bodies(int count, bool hinges, bool with_forces) {
  Model m;
  Blocks x, q, v, w, p;
  for (int i = 0; i < count; ++i) {
    x.push_back(m.block(3));
    q.push_back(m.block(4));
    v.push_back(m.block(3));
    w.push_back(m.block(3));
    m.rates[x[i]] = {v[i]};
    m.rates[q[i]] = {q[i], w[i]};
    if (with_forces) p.push_back(m.block(hinges ? 5 : 3, true));
  }
  for (int i = 0; i < count; ++i) {
    Blocks near = {x[i], q[i], v[i], w[i]};
    for (const int k : {i - 1, i + 1})
      if (k >= 0 && k < count) near.insert(near.end(), {x[k], q[k], v[k], w[k]});
    if (with_forces) near.push_back(p[i]);
    if (with_forces && i + 1 < count) near.push_back(p[i + 1]);
    m.rates[v[i]] = m.rates[w[i]] = near;

    m.row({q[i]});
    Blocks turned = {q[i]}, turning = {w[i]}, place = {x[i]}, speed = {v[i]};
    if (i > 0) {
      turned.push_back(q[i - 1]);
      turning.push_back(w[i - 1]);
      place.push_back(x[i - 1]);
      speed.push_back(v[i - 1]);
    }
    turning.insert(turning.end(), turned.begin(), turned.end());
    place.insert(place.end(), turned.begin(), turned.end());
    speed.insert(speed.end(), place.begin(), place.end());
    speed.insert(speed.end(), turning.begin(), turning.begin() + (i > 0 ? 2 : 1));
    if (hinges) {
      m.row(turned, 2);
      m.row(turning, 2);
    }
    m.row(place, 3);
    m.row(speed, 3);
    if (with_forces) {
      Blocks push = near;
      if (i > 0) push.push_back(p[i - 1]);
      m.row(push, hinges ? 5 : 3);
    }
  }
  return m;
}

}  // namespace

TEST_CASE("forces: those that bind points and bodies are found") {
  Model chain = points(30, false);
  const Asked found = ask(chain, 2);
  CHECK(found.chain);
  CHECK(found.forces);
  CHECK(found.evaluations <= 24);

  Model balls = bodies(8, false, true);
  CHECK_FALSE(ask(balls, 2).chain);  // with velocities, which are of level 2 here
  const Asked in_quaternions = ask(balls, 3);
  CHECK(in_quaternions.chain);
  CHECK(in_quaternions.forces);
}

TEST_CASE("forces: velocities that look like them beside norms of quaternions are none") {
  // A body's velocity has three rows of its own, which all others precede.
  Model hinges = bodies(8, true, false);
  REQUIRE(highest(hinges) == 3);
  const Asked velocities = ask(hinges, 3);
  CHECK(velocities.chain);
  CHECK_FALSE(velocities.forces);
  CHECK(velocities.evaluations <= 24);
}

TEST_CASE("forces: an energy's work is none") {
  Model chain = points(30, true);
  const Asked asked = ask(chain, 2);
  CHECK(asked.chain);
  CHECK_FALSE(asked.forces);
}

TEST_CASE("forces: an F that cannot be evaluated says nothing") {
  Model chain = points(10, false);
  chain.refuses = true;
  const Asked asked = ask(chain, 2);
  CHECK(asked.chain);
  CHECK_FALSE(asked.forces);
}
