// Tether: forms of a constrained mechanism, M(q) a = f - s G^T lam. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <limits>
#include <problems/problem.hpp>
#include <problems/rows.hpp>
#include <problems/wide_solves.hpp>
#include <string>
#include <type_traits>
#include <vector>

namespace tether::problems {

/// Does a system give values and gradients together?
template <class System, class = void>
struct SharesWork : std::false_type {};
template <class System>
struct SharesWork<System, std::void_t<decltype(&System::velocity_with_gradients)>>
    : std::true_type {};

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
/// and, where they share work, with the same bits
///
///   void position_with_gradient(t, q, r, G)
///   void velocity_with_gradients(t, q, v, r, G, H)
///
/// and the forms are
///
///   "index 1"    (q, v, lam):    q' = v, M v' = f - s G^T lam, 0 = g'' with v' for a
///   "index 1 w"  (q, v, w, lam): q' = v, v' = w, M w = f - s G^T lam, 0 = g'' with w for a
///   "index 2"    (q, v, lam):    q' = v, M v' = f - s G^T lam, 0 = g'
///   "index 3"    (q, v, lam):    the same with 0 = g
///   "GGL"        (q, v, lam, mu): q' = v - G^T mu, M v' = f - s G^T lam, 0 = g', 0 = g
///                (stabilised index 2 after Gear, Gupta and Leimkuhler)
///   "index 0"    (q, v):         q' = v, v' = a with M a = f - s G^T lam, g'' = 0 solved together
///   "index 2 w", "index 3 w", "GGL w" (w after v): as "index 1 w"; their dF/dy' is constant
///
/// Rows: "position", "velocity", "acceleration" (without w: with a from the equations of motion;
/// none for index 0).
template <class System>
class Mechanism {
 public:
  static constexpr bool shares_work = SharesWork<System>::value;
  static constexpr int n = System::n, m = System::m;
  using MatrixN = Eigen::Matrix<double, n, n, Eigen::RowMajor>;
  using MatrixG = Eigen::Matrix<double, m, n, Eigen::RowMajor>;
  using VectorN = Eigen::Matrix<double, n, 1>;
  using VectorM = Eigen::Matrix<double, m, 1>;

  static std::vector<std::string> forms() {
    return {"index 1",   "index 1 w", "index 2", "index 0",  "GGL",
            "index 2 w", "GGL w",     "index 3", "index 3 w"};
  }

  /// Everything but name, times and reference. Accelerations and multipliers of the start are
  /// computed from q0 and v0; row_names has m entries.
  static Problem make(const System& system, const std::string& name, const std::string& form,
                      const std::vector<double>& q0, const std::vector<double>& v0,
                      const std::vector<std::string>& row_names) {
    const std::vector<std::string> known = forms();
    if (std::find(known.begin(), known.end(), form) == known.end()) unknown_form(name, form, known);
    const Layout at(form);

    Problem p;
    p.name = name;
    p.form = form;
    p.index = at.index;
    p.size = at.size;
    p.error_components = n;
    VectorN a;
    VectorM multipliers;
    solve_motion(system, 0.0, q0.data(), v0.data(), a.data(), multipliers.data());
    const auto N = static_cast<std::size_t>(at.size);
    p.y0 = join(at, q0, v0, a.data(), multipliers.data());
    p.yp0.assign(N, 0.0);
    std::copy(v0.begin(), v0.end(), p.yp0.begin());
    std::copy(a.data(), a.data() + n, p.yp0.begin() + n);
    p.id.assign(N, 0.0);
    std::fill(p.id.begin(), p.id.begin() + 2 * n, 1.0);
    if (at.ggl) {
      // mu is round-off of g times 1/(step |G|^2): with a tolerance of its own IDA's Newton
      // iteration never meets it (Andrews: |G| is 0.01).
      p.atol_scale.assign(N, 1.0);
      std::fill(p.atol_scale.begin() + at.lam, p.atol_scale.end(), 1e15);
    }
    if (at.index > 1) {
      p.variable_index.assign(N, at.index);
      std::fill(p.variable_index.begin(), p.variable_index.begin() + n, 1);
      std::fill(p.variable_index.begin() + n, p.variable_index.begin() + 2 * n, at.index - 1);
    }

    if (at.index == 0) {
      p.residual = [system](double t, const double* y, const double* yp, double* r) {
        kinematics(y, yp, r);
        double acceleration[n];
        motion(system, t, y, y + n, acceleration);
        for (int i = 0; i < n; ++i) r[n + i] = yp[n + i] - acceleration[i];
      };
    } else {
      p.residual = [system, at](double t, const double* y, const double* yp, double* r) {
        equations(system, at, t, y, yp, r);
      };
      p.jacobian = [system, at](double t, double cj, const double* y, const double* yp, double* J) {
        derivatives(system, at, t, cj, y, yp, J);
      };
    }
    add_rows(system, at, row_names, p);
    p.recommended = {"position", "velocity"};
    return p;
  }

  /// Reference from q, v and lam at t_end; accelerations are computed where they are unknowns.
  static void set_reference(const System& system, const std::vector<double>& q,
                            const std::vector<double>& v, const std::vector<double>& lam,
                            Problem& p) {
    VectorN a;
    VectorM multipliers;
    solve_motion(system, p.t_end, q.data(), v.data(), a.data(), multipliers.data());
    p.reference = join(Layout(p.form), q, v, a.data(), lam.data());
  }

  /// a and lam of the motion through (q, v), in long double from the double values of M, f, G,
  /// gamma.
  static void solve_motion(const System& system, double t, const double* q, const double* v,
                           double* a, double* lam) {
    MatrixN M = MatrixN::Zero();
    MatrixG G = MatrixG::Zero();
    VectorN f;
    VectorM gamma;
    const VectorN none = VectorN::Zero();
    system.mass(q, M.data());
    system.force(t, q, v, f.data());
    system.gradient(t, q, G.data());
    system.acceleration(t, q, v, none.data(), gamma.data());
    solve_motion_wide(n, m, M.data(), G.data(), System::sign, f.data(), gamma.data(), a, lam);
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
  // Places of the unknowns of a form.
  struct Layout {
    int index;  // 0 .. 3
    bool with_w, ggl;
    int lam, mu, size;  // lam, mu: where they begin; as large as size when they are absent

    explicit Layout(const std::string& form)
        : index(form.rfind("index ", 0) == 0 ? form[6] - '0' : 2),
          with_w(form.size() > 2 && form.compare(form.size() - 2, 2, " w") == 0),
          ggl(form.rfind("GGL", 0) == 0),
          lam(with_w ? 3 * n : 2 * n),
          mu(index == 0 ? lam : lam + m),
          size(ggl ? mu + m : mu) {}
  };

  static std::vector<double> join(const Layout& at, const std::vector<double>& q,
                                  const std::vector<double>& v, const double* a,
                                  const double* lam) {
    std::vector<double> all = q;
    all.insert(all.end(), v.begin(), v.end());
    if (at.with_w) all.insert(all.end(), a, a + n);
    if (at.index > 0) all.insert(all.end(), lam, lam + m);
    all.resize(static_cast<std::size_t>(at.size), 0.0);  // mu
    return all;
  }

  // a with M a = f - s G^T lam, G a = -gamma, in double.
  static void motion(const System& system, double t, const double* q, const double* v, double* a) {
    using Square = Eigen::Matrix<double, n + m, n + m, Eigen::RowMajor>;
    MatrixN M = MatrixN::Zero();
    MatrixG G = MatrixG::Zero();
    const VectorN none = VectorN::Zero();
    Eigen::Matrix<double, n + m, 1> right;
    system.mass(q, M.data());
    system.gradient(t, q, G.data());
    system.force(t, q, v, right.data());
    system.acceleration(t, q, v, none.data(), right.data() + n);
    Square K = Square::Zero();
    K.template topLeftCorner<n, n>() = M;
    K.template topRightCorner<n, m>() = System::sign * G.transpose();
    K.template bottomLeftCorner<m, n>() = G;
    right.template tail<m>() *= -1.0;
    const Eigen::Matrix<double, n + m, 1> solution = K.partialPivLu().solve(right);
    std::copy(solution.data(), solution.data() + n, a);
  }

  static void equations(const System& system, const Layout& at, double t, const double* y,
                        const double* yp, double* r) {
    const double* a = at.with_w ? y + 2 * n : yp + n;
    kinematics(y, yp, r);
    if (at.with_w)
      for (int i = 0; i < n; ++i) r[n + i] = yp[n + i] - a[i];
    dynamics(system, t, y, y + n, a, y + at.lam, r + at.lam - n);
    if (at.index == 1)
      system.acceleration(t, y, y + n, a, r + at.lam);
    else if (at.index == 2)
      system.velocity(t, y, y + n, r + at.lam);
    else
      system.position(t, y, r + at.lam);
    if (at.ggl) {
      MatrixG G = MatrixG::Zero();
      system.gradient(t, y, G.data());
      Eigen::Map<VectorN>(r).noalias() += G.transpose() * Eigen::Map<const VectorM>(y + at.mu);
      system.position(t, y, r + at.mu);
    }
  }

  static void move(const System& system, double t, const double* q, const VectorM& r, double* x) {
    MatrixG G = MatrixG::Zero();
    system.gradient(t, q, G.data());
    take_least_step_wide(n, m, G.data(), r.data(), x);
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

  static void derivatives(const System& system, const Layout& at, double t, double cj,
                          const double* y, const double* yp, double* J) {
    const Blocks b(system, t, y, y + n, at.with_w ? y + 2 * n : yp + n, y + at.lam);
    Eigen::Map<Eigen::MatrixXd> out(J, at.size, at.size);
    out.setZero();
    const int row = at.lam - n;  // of the dynamics
    out.template block<n, n>(0, 0).diagonal().setConstant(cj);
    out.template block<n, n>(0, n).diagonal().setConstant(-1.0);
    if (at.with_w) {
      out.template block<n, n>(n, n).diagonal().setConstant(cj);
      out.template block<n, n>(n, 2 * n).diagonal().setConstant(-1.0);
    }
    out.template block<n, n>(row, 0) = b.Dq;
    out.template block<n, n>(row, n) += b.Dv;
    // v' stands for the acceleration where w is absent.
    const int a = at.with_w ? 2 * n : n;
    const double rate = at.with_w ? 1.0 : cj;
    out.template block<n, n>(row, a) += rate * b.M;
    out.template block<n, m>(row, at.lam) = System::sign * b.G.transpose();
    if (at.index == 1) {
      out.template block<m, n>(at.lam, 0) = b.K;
      out.template block<m, n>(at.lam, n) = 2.0 * b.H;
      out.template block<m, n>(at.lam, a) += rate * b.G;
    } else if (at.index == 2) {
      out.template block<m, n>(at.lam, 0) = b.H;
      out.template block<m, n>(at.lam, n) = b.G;
    } else {
      out.template block<m, n>(at.lam, 0) = b.G;
    }
    if (!at.ggl) return;
    out.template block<n, m>(0, at.mu) = b.G.transpose();
    out.template block<m, n>(at.mu, 0) = b.G;
    // d(G^T mu)/dq column by column: H is linear in v up to its part from explicit time.
    MatrixG still = MatrixG::Zero();
    const VectorN none = VectorN::Zero();
    system.velocity_gradient(t, y, none.data(), still.data());
    for (int j = 0; j < n; ++j) {
      MatrixG along = MatrixG::Zero();
      const VectorN unit = VectorN::Unit(j);
      system.velocity_gradient(t, y, unit.data(), along.data());
      out.template block<n, 1>(0, j) +=
          (along - still).transpose() * Eigen::Map<const VectorM>(y + at.mu);
    }
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

  static void add_rows(const System& system, const Layout& at,
                       const std::vector<std::string>& row_names, Problem& p) {
    const int N = at.size;
    using Map = Eigen::Map<MatrixG, 0, Eigen::OuterStride<>>;
    p.rows.push_back(make_rows(
        "position", row_names,
        [system](double t, const double* y, double* r) { system.position(t, y, r); },
        [system, N](double t, const double* y, double* C) {
          MatrixG G = MatrixG::Zero();
          system.gradient(t, y, G.data());
          Map(C, Eigen::OuterStride<>(N)) = G;
        },
        [system, N](double t, const double* y, double* r, double* C) {
          MatrixG G = MatrixG::Zero();
          if constexpr (shares_work) {
            system.position_with_gradient(t, y, r, G.data());
          } else {
            system.position(t, y, r);
            system.gradient(t, y, G.data());
          }
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
        },
        [system, N](double t, const double* y, double* r, double* C) {
          MatrixG G = MatrixG::Zero(), H = MatrixG::Zero();
          if constexpr (shares_work) {
            system.velocity_with_gradients(t, y, y + n, r, G.data(), H.data());
          } else {
            system.velocity(t, y, y + n, r);
            system.gradient(t, y, G.data());
            system.velocity_gradient(t, y, y + n, H.data());
          }
          Map(C, Eigen::OuterStride<>(N)) = H;
          Map(C + n, Eigen::OuterStride<>(N)) = G;
        }));
    if (at.index == 0) return;
    if (at.with_w) {
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
