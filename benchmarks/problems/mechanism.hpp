// Tether: forms of a constrained mechanism, M(q) a = f - s G^T lam. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <limits>
#include <problems/problem.hpp>
#include <problems/rows.hpp>
#include <string>
#include <vector>

namespace tether::problems {

/// Writes one mechanism in several forms. `System` is a small value (constants only) with
///
///   static constexpr int n, m;          positions q, position constraints g(t, q)
///   static constexpr double sign;       s in M a = f - s G^T lam
///   void mass(q, M)                     M, n x n, zero on entry
///   void force(t, q, v, f)
///   void position(t, q, r)              g
///   void gradient(t, q, G)              dg/dq, m x n row-major, zero on entry
///   void velocity(t, q, v, r)           dg/dt along the motion
///   void velocity_gradient(t, q, v, H)  its derivative to q, zero on entry (to v it is G)
///   void acceleration(t, q, v, a, r)    second derivative of g
///   void acceleration_gradient(t, q, v, a, K)  its derivative to q (to v it is 2 H, to a it is G)
///   void dynamics_gradient(t, q, v, a, lam, Dq, Dv)  derivatives of M a - f + s G^T lam to q and
///   v,
///                                       n x n row-major, zero on entry
///
/// and the forms are
///
///   "index 1"    (q, v, lam):    q' = v, M v' = f - s G^T lam, 0 = g'' with v' for a
///   "index 1 w"  (q, v, w, lam): q' = v, v' = w, M w = f - s G^T lam, 0 = g'' with w for a
///   "index 2"    (q, v, lam):    q' = v, M v' = f - s G^T lam, 0 = g'
///
/// Rows: "position", "velocity", "acceleration" (without w: with a from the equations of motion).
template <class System>
class Mechanism {
 public:
  static constexpr int n = System::n, m = System::m;
  using MatrixN = Eigen::Matrix<double, n, n, Eigen::RowMajor>;
  using MatrixG = Eigen::Matrix<double, m, n, Eigen::RowMajor>;
  using VectorN = Eigen::Matrix<double, n, 1>;
  using VectorM = Eigen::Matrix<double, m, 1>;

  static std::vector<std::string> forms() { return {"index 1", "index 1 w", "index 2"}; }

  /// Everything but name, times and reference. Accelerations and multipliers of the start are
  /// computed from q0 and v0; row_names has m entries.
  static Problem make(const System& system, const std::string& name, const std::string& form,
                      const std::vector<double>& q0, const std::vector<double>& v0,
                      const std::vector<std::string>& row_names) {
    const std::vector<std::string> known = forms();
    if (std::find(known.begin(), known.end(), form) == known.end()) unknown_form(name, form, known);
    const bool with_w = form == "index 1 w", index2 = form == "index 2";
    const int lam = with_w ? 3 * n : 2 * n;
    const int N = lam + m;

    Problem p;
    p.name = name;
    p.form = form;
    p.size = N;
    p.error_components = n;
    VectorN a;
    VectorM multipliers;
    solve_motion(system, 0.0, q0.data(), v0.data(), a.data(), multipliers.data());
    p.y0 =
        join(q0, v0, with_w ? std::vector<double>(a.data(), a.data() + n) : std::vector<double>{},
             std::vector<double>(multipliers.data(), multipliers.data() + m));
    p.yp0.assign(static_cast<std::size_t>(N), 0.0);
    std::copy(v0.begin(), v0.end(), p.yp0.begin());
    std::copy(a.data(), a.data() + n, p.yp0.begin() + n);
    p.id.assign(static_cast<std::size_t>(N), 0.0);
    std::fill(p.id.begin(), p.id.begin() + 2 * n, 1.0);

    if (with_w) {
      p.residual = [system](double t, const double* y, const double* yp, double* r) {
        kinematics(y, yp, r);
        for (int i = 0; i < n; ++i) r[n + i] = yp[n + i] - y[2 * n + i];
        dynamics(system, t, y, y + n, y + 2 * n, y + 3 * n, r + 2 * n);
        system.acceleration(t, y, y + n, y + 2 * n, r + 3 * n);
      };
      p.jacobian = [system](double t, double cj, const double* y, const double*, double* J) {
        jacobian_w(system, t, cj, y, J);
      };
    } else {
      p.residual = [system, index2](double t, const double* y, const double* yp, double* r) {
        kinematics(y, yp, r);
        dynamics(system, t, y, y + n, yp + n, y + 2 * n, r + n);
        if (index2)
          system.velocity(t, y, y + n, r + 2 * n);
        else
          system.acceleration(t, y, y + n, yp + n, r + 2 * n);
      };
      p.jacobian = [system, index2](double t, double cj, const double* y, const double* yp,
                                    double* J) { jacobian_lam(system, index2, t, cj, y, yp, J); };
    }
    add_rows(system, with_w, N, row_names, p);
    p.recommended = {"position", "velocity"};
    return p;
  }

  /// Reference from q, v and lam at t_end; accelerations are computed where they are unknowns.
  static void set_reference(const System& system, const std::vector<double>& q,
                            const std::vector<double>& v, const std::vector<double>& lam,
                            Problem& p) {
    std::vector<double> a;
    if (p.size == 3 * n + m) {
      a.resize(n);
      VectorM multipliers;
      solve_motion(system, p.t_end, q.data(), v.data(), a.data(), multipliers.data());
    }
    p.reference = join(q, v, a, lam);
  }

  /// a and lam of the motion through (q, v), in long double from the double values of M, f, G,
  /// gamma.
  static void solve_motion(const System& system, double t, const double* q, const double* v,
                           double* a, double* lam) {
    using Wide = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
    MatrixN M = MatrixN::Zero();
    MatrixG G = MatrixG::Zero();
    VectorN f;
    VectorM gamma;
    const VectorN none = VectorN::Zero();
    system.mass(q, M.data());
    system.force(t, q, v, f.data());
    system.gradient(t, q, G.data());
    system.acceleration(t, q, v, none.data(), gamma.data());
    Wide K = Wide::Zero(n + m, n + m), right(n + m, 1);
    K.topLeftCorner(n, n) = M.template cast<long double>();
    K.topRightCorner(n, m) = System::sign * G.transpose().template cast<long double>();
    K.bottomLeftCorner(m, n) = G.template cast<long double>();
    right.topRows(n) = f.template cast<long double>();
    right.bottomRows(m) = -gamma.template cast<long double>();
    const Wide solution = K.fullPivLu().solve(right);
    for (int i = 0; i < n; ++i) a[i] = static_cast<double>(solution(i));
    for (int i = 0; i < m; ++i) lam[i] = static_cast<double>(solution(n + i));
  }

  /// The nearest start with g = 0 and dg/dt = 0: least change of q, then of v.
  static void project_start(const System& system, double t, double* q, double* v) {
    VectorM r;
    for (int iteration = 0; iteration < 10; ++iteration) {
      system.position(t, q, r.data());
      move(system, t, q, r, q);
    }
    for (int iteration = 0; iteration < 3; ++iteration) {
      system.velocity(t, q, v, r.data());
      move(system, t, q, r, v);
    }
  }

 private:
  static std::vector<double> join(const std::vector<double>& a, const std::vector<double>& b,
                                  const std::vector<double>& c, const std::vector<double>& d) {
    std::vector<double> all = a;
    for (const auto* part : {&b, &c, &d}) all.insert(all.end(), part->begin(), part->end());
    return all;
  }

  static void move(const System& system, double t, const double* q, const VectorM& r, double* x) {
    MatrixG G = MatrixG::Zero();
    system.gradient(t, q, G.data());
    const Eigen::Matrix<long double, n, m> wide = G.transpose().template cast<long double>();
    const Eigen::Matrix<long double, m, m> normal = wide.transpose() * wide;
    const Eigen::Matrix<long double, n, 1> step =
        wide * normal.fullPivLu().solve(r.template cast<long double>());
    for (int i = 0; i < n; ++i) x[i] -= static_cast<double>(step(i));
  }

  static void kinematics(const double* y, const double* yp, double* r) {
    for (int i = 0; i < n; ++i) r[i] = yp[i] - y[n + i];
  }

  // r = M a - f + s G^T lam
  static void dynamics(const System& system, double t, const double* q, const double* v,
                       const double* a, const double* lam, double* r) {
    MatrixN M = MatrixN::Zero();
    MatrixG G = MatrixG::Zero();
    VectorN f;
    system.mass(q, M.data());
    system.gradient(t, q, G.data());
    system.force(t, q, v, f.data());
    Eigen::Map<VectorN> out(r);
    out.noalias() = M * Eigen::Map<const VectorN>(a) - f;
    out.noalias() += System::sign * G.transpose() * Eigen::Map<const VectorM>(lam);
  }

  // The blocks that all forms share.
  struct Blocks {
    MatrixN M = MatrixN::Zero(), Dq = MatrixN::Zero(), Dv = MatrixN::Zero();
    MatrixG G = MatrixG::Zero(), H = MatrixG::Zero(), K = MatrixG::Zero();

    Blocks(const System& system, double t, const double* q, const double* v, const double* a,
           const double* lam) {
      system.mass(q, M.data());
      system.gradient(t, q, G.data());
      system.velocity_gradient(t, q, v, H.data());
      system.acceleration_gradient(t, q, v, a, K.data());
      system.dynamics_gradient(t, q, v, a, lam, Dq.data(), Dv.data());
    }
  };

  static void jacobian_lam(const System& system, bool index2, double t, double cj, const double* y,
                           const double* yp, double* J) {
    const Blocks b(system, t, y, y + n, yp + n, y + 2 * n);
    constexpr int N = 2 * n + m;
    Eigen::Map<Eigen::Matrix<double, N, N>> out(J);
    out.setZero();
    out.template block<n, n>(0, 0).diagonal().setConstant(cj);
    out.template block<n, n>(0, n).diagonal().setConstant(-1.0);
    out.template block<n, n>(n, 0) = b.Dq;
    out.template block<n, n>(n, n) = b.Dv + cj * b.M;
    out.template block<n, m>(n, 2 * n) = System::sign * b.G.transpose();
    if (index2) {
      out.template block<m, n>(2 * n, 0) = b.H;
      out.template block<m, n>(2 * n, n) = b.G;
    } else {
      out.template block<m, n>(2 * n, 0) = b.K;
      out.template block<m, n>(2 * n, n) = 2.0 * b.H + cj * b.G;
    }
  }

  static void jacobian_w(const System& system, double t, double cj, const double* y, double* J) {
    const Blocks b(system, t, y, y + n, y + 2 * n, y + 3 * n);
    constexpr int N = 3 * n + m;
    Eigen::Map<Eigen::Matrix<double, N, N>> out(J);
    out.setZero();
    out.template block<2 * n, 2 * n>(0, 0).diagonal().setConstant(cj);
    out.template block<2 * n, 2 * n>(0, n).diagonal().setConstant(-1.0);
    out.template block<n, n>(2 * n, 0) = b.Dq;
    out.template block<n, n>(2 * n, n) = b.Dv;
    out.template block<n, n>(2 * n, 2 * n) = b.M;
    out.template block<n, m>(2 * n, 3 * n) = System::sign * b.G.transpose();
    out.template block<m, n>(3 * n, 0) = b.K;
    out.template block<m, n>(3 * n, n) = 2.0 * b.H;
    out.template block<m, n>(3 * n, 2 * n) = b.G;
  }

  static std::vector<std::string> labels(const std::vector<std::string>& row_names,
                                         const std::string& suffix) {
    std::vector<std::string> out = row_names;
    for (std::string& label : out) label += suffix;
    return out;
  }

  // a = M^-1 (f - s G^T lam)
  static void accelerations(const System& system, double t, const double* y,
                            Eigen::LLT<MatrixN>* factor, VectorN* a) {
    MatrixN M = MatrixN::Zero();
    MatrixG G = MatrixG::Zero();
    system.mass(y, M.data());
    system.gradient(t, y, G.data());
    system.force(t, y, y + n, a->data());
    a->noalias() -= System::sign * G.transpose() * Eigen::Map<const VectorM>(y + 2 * n);
    factor->compute(M);
    factor->solveInPlace(*a);
  }

  static void add_rows(const System& system, bool with_w, int N,
                       const std::vector<std::string>& row_names, Problem& p) {
    using Map = Eigen::Map<MatrixG, 0, Eigen::OuterStride<>>;
    p.rows.push_back(make_rows(
        "position", row_names,
        [system](double t, const double* y, double* r) { system.position(t, y, r); },
        [system, N](double t, const double* y, double* C) {
          MatrixG G = MatrixG::Zero();
          system.gradient(t, y, G.data());
          Map(C, Eigen::OuterStride<>(N)) = G;
        }));
    p.rows.push_back(make_rows(
        "velocity", labels(row_names, " rate"),
        [system](double t, const double* y, double* r) { system.velocity(t, y, y + n, r); },
        [system, N](double t, const double* y, double* C) {
          MatrixG G = MatrixG::Zero(), H = MatrixG::Zero();
          system.gradient(t, y, G.data());
          system.velocity_gradient(t, y, y + n, H.data());
          Map(C, Eigen::OuterStride<>(N)) = H;
          Map(C + n, Eigen::OuterStride<>(N)) = G;
        }));
    if (with_w) {
      p.rows.push_back(make_rows(
          "acceleration", labels(row_names, " second rate"),
          [system](double t, const double* y, double* r) {
            system.acceleration(t, y, y + n, y + 2 * n, r);
          },
          [system, N](double t, const double* y, double* C) {
            MatrixG G = MatrixG::Zero(), H = MatrixG::Zero(), K = MatrixG::Zero();
            system.gradient(t, y, G.data());
            system.velocity_gradient(t, y, y + n, H.data());
            system.acceleration_gradient(t, y, y + n, y + 2 * n, K.data());
            Map(C, Eigen::OuterStride<>(N)) = K;
            Map(C + n, Eigen::OuterStride<>(N)) = 2.0 * H;
            Map(C + 2 * n, Eigen::OuterStride<>(N)) = G;
          }));
      return;
    }
    p.rows.push_back(make_rows(
        "acceleration", labels(row_names, " second rate"),
        [system](double t, const double* y, double* r) {
          Eigen::LLT<MatrixN> factor;
          VectorN a;
          accelerations(system, t, y, &factor, &a);
          system.acceleration(t, y, y + n, a.data(), r);
        },
        // M da = -Dq dq - Dv dv - s G^T dlam
        [system, N](double t, const double* y, double* C) {
          Eigen::LLT<MatrixN> factor;
          VectorN a;
          accelerations(system, t, y, &factor, &a);
          const Blocks b(system, t, y, y + n, a.data(), y + 2 * n);
          const Eigen::Matrix<double, n, m> left = factor.solve(b.G.transpose());
          Map(C, Eigen::OuterStride<>(N)) = b.K - left.transpose() * b.Dq;
          Map(C + n, Eigen::OuterStride<>(N)) = 2.0 * b.H - left.transpose() * b.Dv;
          Eigen::Map<Eigen::Matrix<double, m, m, Eigen::RowMajor>, 0, Eigen::OuterStride<>>(
              C + 2 * n, Eigen::OuterStride<>(N)) =
              -System::sign * left.transpose() * b.G.transpose();
        }));
  }
};

}  // namespace tether::problems
