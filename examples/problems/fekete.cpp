// Tether: Fekete points of the test set for IVP solvers. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <problems/fekete.hpp>
#include <problems/mechanism.hpp>
#include <problems/rows.hpp>

namespace tether::problems {

namespace {

constexpr int kPoints = 20;
constexpr double kDamping = 0.5, kPi = 3.14159265358979323846;

struct Fekete {
  static constexpr int n = 3 * kPoints, m = kPoints;
  static constexpr double sign = -1.0;  // the published equations have + G^T lam

  void mass(const double*, double* M) const {
    for (int i = 0; i < n; ++i) M[(n + 1) * i] = 1.0;
  }

  void force(double, const double* q, const double* v, double* f) const {
    for (int k = 0; k < n; ++k) f[k] = -kDamping * v[k];
    for (int i = 0; i < n; i += 3) {
      for (int j = 0; j < i; j += 3) {
        const double d[3] = {q[i] - q[j], q[i + 1] - q[j + 1], q[i + 2] - q[j + 2]};
        const double square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        for (int k = 0; k < 3; ++k) {
          f[i + k] += d[k] / square;
          f[j + k] -= d[k] / square;
        }
      }
    }
  }

  void position(double, const double* q, double* r) const {
    for (int i = 0; i < m; ++i) r[i] = dot(q + 3 * i, q + 3 * i) - 1.0;
  }
  void gradient(double, const double* q, double* G) const { twice(q, G); }
  void velocity(double, const double* q, const double* v, double* r) const {
    for (int i = 0; i < m; ++i) r[i] = 2.0 * dot(q + 3 * i, v + 3 * i);
  }
  void velocity_gradient(double, const double*, const double* v, double* H) const { twice(v, H); }
  void acceleration(double, const double* q, const double* v, const double* a, double* r) const {
    for (int i = 0; i < 3 * m; i += 3) r[i / 3] = 2.0 * (dot(q + i, a + i) + dot(v + i, v + i));
  }
  void acceleration_gradient(double, const double*, const double*, const double* a,
                             double* K) const {
    twice(a, K);
  }

  void dynamics_gradient(double, const double* q, const double*, const double*, const double* lam,
                         double* Dq, double* Dv) const {
    for (int k = 0; k < n; ++k) {
      Dq[(n + 1) * k] = -2.0 * lam[k / 3];
      Dv[(n + 1) * k] = kDamping;
    }
    for (int i = 0; i < n; i += 3) {
      for (int j = 0; j < n; j += 3) {
        if (i == j) continue;
        const double d[3] = {q[i] - q[j], q[i + 1] - q[j + 1], q[i + 2] - q[j + 2]};
        const double square = dot(d, d);
        for (int k = 0; k < 3; ++k) {
          for (int l = 0; l < 3; ++l) {
            const double slope = ((k == l ? 1.0 : 0.0) - 2.0 * d[k] * d[l] / square) / square;
            Dq[n * (i + k) + i + l] -= slope;
            Dq[n * (i + k) + j + l] += slope;
          }
        }
      }
    }
  }

 private:
  static double dot(const double* a, const double* b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  }
  // Row i of 3 m columns: twice the three entries of point i.
  static void twice(const double* x, double* rows) {
    for (int k = 0; k < n; ++k) rows[n * (k / 3) + k] = 2.0 * x[k];
  }
};

using Form = Mechanism<Fekete>;

// f(k, a, b): entries a and b of positions and velocities turn about axis k.
template <class F>
void each_moment(F f) {
  for (int i = 0; i < Fekete::n; i += 3)
    for (int k = 0; k < 3; ++k) f(k, i + (k + 1) % 3, i + (k + 2) % 3);
}

// Four rings of latitude; angles as published.
std::vector<double> start() {
  struct Ring {
    int points, offset;
    double turn, latitude;
  };
  std::vector<double> q;
  for (const Ring& ring :
       {Ring{3, 1, kPi / 13.0, 3.0 * kPi / 8.0}, Ring{7, 1, kPi / 29.0, kPi / 8.0},
        Ring{6, 1, kPi / 7.0, -2.0 * kPi / 15.0}, Ring{4, 0, kPi / 17.0, -3.0 * kPi / 10.0}}) {
    for (int i = 0; i < ring.points; ++i) {
      const double longitude = 2.0 * kPi * (i + ring.offset) / ring.points + ring.turn;
      q.push_back(std::cos(longitude) * std::cos(ring.latitude));
      q.push_back(std::sin(longitude) * std::cos(ring.latitude));
      q.push_back(std::sin(ring.latitude));
    }
  }
  return q;
}

}  // namespace

std::vector<std::string> fekete_forms() { return Form::forms(); }

Problem fekete(const std::string& form) {
  std::vector<std::string> names;
  for (int i = 1; i <= kPoints; ++i) names.push_back("point " + std::to_string(i));
  Problem p =
      Form::make(Fekete{}, "fekete", form, start(), std::vector<double>(Fekete::n, 0.0), names);
  p.t_end = 1000.0;
  p.rows.push_back(make_rows(
      "angular momentum", {"about x", "about y", "about z"},
      [](double, const double* y, double* g) {
        std::fill(g, g + 3, 0.0);
        each_moment(
            [=, v = y + Fekete::n](int k, int a, int b) { g[k] += y[a] * v[b] - y[b] * v[a]; });
      },
      [size = p.size](double, const double* y, double* C) {
        each_moment([=, v = y + Fekete::n](int k, int a, int b) {
          double* const by_q = C + k * size;
          double* const by_v = by_q + Fekete::n;
          by_q[a] = v[b], by_q[b] = -v[a];
          by_v[b] = y[a], by_v[a] = -y[b];
        });
      }));
  p.recommended = {"position", "velocity", "angular momentum"};
  p.reference.assign(static_cast<std::size_t>(p.size), std::nan(""));
  const double at_rest[Fekete::n] = {
      -0.4070263380333202, 0.3463758772791802,  0.8451942450030429,  0.07752934752521549,
      -0.2628662719972299, 0.9617122871829146,  0.7100577833343567,  0.1212948055586120,
      0.6936177005172217,  0.2348267744557627,  0.7449277976923311,  0.6244509285956391,
      -0.4341114738782885, 0.8785430442262876,  0.1992720444237660,  -0.9515059600312596,
      0.2203508762787005,  0.2146669498274008,  -0.6385191643609878, -0.4310833259390688,
      0.6375425027722121,  -0.1464175087914336, -0.9380871635228862, 0.3139337298744690,
      0.5666974065069942,  -0.6739221885076542, 0.4740073135462156,  0.9843259538440293,
      -0.1696995357819996, -0.0480050429060909, 0.1464175087914331,  0.9380871635228875,
      -0.3139337298744656, -0.7092757549979014, 0.5264062637139616,  -0.4688542938854929,
      -0.8665731819284478, -0.4813878059756024, -0.1315929352982178, -0.2347897778700538,
      -0.8594340408013130, -0.4541441287957579, 0.5530976940074118,  -0.7674370265615124,
      -0.3242273140037833, 0.7711050969896927,  0.6357041816577034,  0.03573685519777001,
      0.7103951209379591,  0.2403570431280519,  -0.6614886725910596, -0.03038208738735660,
      0.4501923293640461,  -0.8924145871442046, -0.5772996158107093, -0.1766763414971813,
      -0.7971892020969544, 0.2414481766969039,  -0.3416456818373135, -0.9082846503446250};
  std::copy(at_rest, at_rest + Fekete::n, p.reference.begin());
  return p;
}

}  // namespace tether::problems
