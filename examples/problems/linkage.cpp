// Tether: planar rods held together by pins, in any arrangement. SPDX-License-Identifier:
// BSD-3-Clause
#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <limits>
#include <problems/linkage.hpp>
#include <problems/pinned_rods.hpp>
#include <problems/rows.hpp>
#include <tether/linalg/least_squares.hpp>

namespace tether::problems {

namespace {

// a of least constraint: with M = D^2, z = D a is nearest to D^-1 f among G D^-1 z = -gamma.
class LeastConstraint {
 public:
  explicit LeastConstraint(const Linkage& linkage)
      : root_(linkage.n()),
        free_(linkage.n()),
        B_(linkage.m(), linkage.n()),
        right_(linkage.m()),
        zero_(Eigen::VectorXd::Zero(linkage.n())),
        solver_(1e-6) {
    for (int i = 0; i < linkage.n(); ++i) {
      root_[i] = std::sqrt(linkage.mass(i));
      free_[i] = linkage.force(i) / root_[i];
    }
  }

  void operator()(const Linkage& linkage, const double* q, const double* v, double* a) {
    B_.setZero();
    linkage.gradient(q, [this](int i, int j, double entry) { B_(i, j) = entry / root_[j]; });
    linkage.acceleration(q, v, zero_.data(), right_.data());
    right_ = -right_;
    right_.noalias() -= B_ * free_;
    solver_.factor(B_);
    Eigen::Map<Eigen::VectorXd> out(a, linkage.n());
    out = solver_.solve(right_);
    out = (out + free_).cwiseQuotient(root_);
  }

 private:
  Eigen::VectorXd root_, free_;
  Eigen::MatrixXd B_;
  Eigen::VectorXd right_, zero_;
  linalg::LeastSquares solver_;
};

std::vector<std::string> pin_names(std::size_t pins, const std::string& suffix) {
  std::vector<std::string> names;
  for (std::size_t pin = 0; pin < pins; ++pin)
    for (const char* axis : {" x", " y"})
      names.push_back("pin " + std::to_string(pin) + axis + suffix);
  return names;
}

void add_rows(const LinkagePointer& linkage, const std::vector<double>& q0,
              const std::vector<double>& v0, Problem& p) {
  const int n = linkage->n(), m = linkage->m();
  const int width = p.size;
  p.rows.push_back(make_rows(
      "position", pin_names(linkage->pins.size(), ""),
      [linkage](double, const double* y, double* r) { linkage->position(y, r); },
      [linkage, width](double, const double* y, double* C) {
        linkage->gradient(y, [C, width](int i, int j, double entry) { C[i * width + j] += entry; });
      }));
  p.rows.push_back(make_rows(
      "velocity", pin_names(linkage->pins.size(), " rate"),
      [linkage, n](double, const double* y, double* r) { linkage->velocity(y, y + n, r); },
      [linkage, n, width](double, const double* y, double* C) {
        linkage->gradient(y, [=](int i, int j, double entry) { C[i * width + n + j] += entry; });
        linkage->velocity_gradient(
            y, y + n, [C, width](int i, int j, double entry) { C[i * width + j] += entry; });
      }));
  const double E = linkage->energy(q0.data(), v0.data());
  p.rows.push_back(make_rows(
      "energy", {"energy"},
      [linkage, n, E](double, const double* y, double* r) { r[0] = linkage->energy(y, y + n) - E; },
      [linkage, n](double, const double* y, double* C) {
        for (int i = 0; i < n; ++i) {
          C[i] = -linkage->force(i);
          C[n + i] = linkage->mass(i) * y[n + i];
        }
      }));
  p.recommended = {"position", "velocity", "energy"};
  // The plugin takes at most as many rows as unknowns, redundant or not.
  if (2 * m + 1 > p.size) p.recommended.pop_back();
}

}  // namespace

namespace {

// Accelerations and multipliers with solve(right) = (G M^-1 G^T + epsilon)^-1 right.
template <class Solve>
void refined_motion(const Linkage& linkage, double epsilon, const double* q, const double* v,
                    Solve solve, std::vector<double>* acceleration,
                    std::vector<double>* multipliers) {
  const int n = linkage.n(), m = linkage.m();
  acceleration->assign(static_cast<std::size_t>(n), 0.0);
  multipliers->assign(static_cast<std::size_t>(m), 0.0);
  Eigen::Map<Eigen::VectorXd> a(acceleration->data(), n), lam(multipliers->data(), m);
  Eigen::VectorXd r(n), second(m);
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(n);
  for (int refinement = 0; refinement < 4; ++refinement) {
    linkage.dynamics(q, none.data(), lam.data(), r.data());
    for (int i = 0; i < n; ++i) a[i] = -r[i] / linkage.mass(i);
    linkage.acceleration(q, v, a.data(), second.data());
    if (refinement < 3) lam += solve(Eigen::VectorXd(second - epsilon * lam));
  }
}

}  // namespace

void solve_motion(const Linkage& linkage, double epsilon, const double* q, const double* v,
                  std::vector<double>* acceleration, std::vector<double>* multipliers) {
  const int n = linkage.n(), m = linkage.m();
  constexpr int kLargestDense = 600;  // above: rows must be independent
  if (m > kLargestDense) {
    std::vector<Eigen::Triplet<double>> entries, scaled;
    linkage.gradient(q, [&](int i, int j, double entry) {
      entries.emplace_back(i, j, entry);
      scaled.emplace_back(i, j, entry / linkage.mass(j));
    });
    Eigen::SparseMatrix<double> G(m, n), left(m, n), S(m, m);
    G.setFromTriplets(entries.begin(), entries.end());
    left.setFromTriplets(scaled.begin(), scaled.end());
    S.setIdentity();
    S *= epsilon;
    S += Eigen::SparseMatrix<double>(left * G.transpose());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(S);
    refined_motion(
        linkage, epsilon, q, v,
        [&factor](const Eigen::VectorXd& right) { return Eigen::VectorXd(factor.solve(right)); },
        acceleration, multipliers);
    return;
  }
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(m, n);
  linkage.gradient(q, [&G](int i, int j, double entry) { G(i, j) = entry; });
  Eigen::MatrixXd left = G;
  for (int j = 0; j < n; ++j) left.col(j) /= linkage.mass(j);
  Eigen::MatrixXd S = left * G.transpose();
  S.diagonal().array() += epsilon;
  linalg::LeastSquares factor;
  factor.factor(S);
  refined_motion(
      linkage, epsilon, q, v,
      [&factor](const Eigen::VectorXd& right) { return Eigen::VectorXd(factor.solve(right)); },
      acceleration, multipliers);
}

Problem build(const std::string& name, const LinkagePointer& linkage, const std::string& form,
              double epsilon, double t_end, const std::vector<double>& q0,
              const std::vector<double>& v0) {
  const bool index0 = form == "index 0";
  if (!index0 && form != "index 1") unknown_form(name, form, pinned_rods_forms());
  if (!(epsilon >= 0.0)) throw std::invalid_argument(name + ": epsilon must be >= 0");
  const int n = linkage->n(), m = linkage->m();
  Problem p;
  p.name = name;
  p.form = form;
  p.index = index0 ? 0 : 1;
  p.size = index0 ? 2 * n : 2 * n + m;
  p.t_end = t_end;
  p.error_components = n;
  const auto N = static_cast<std::size_t>(p.size);

  p.y0 = q0;
  p.y0.insert(p.y0.end(), v0.begin(), v0.end());
  p.yp0 = v0;
  p.id.assign(static_cast<std::size_t>(2 * n), 1.0);
  p.id.resize(N, 0.0);
  if (index0) {
    LeastConstraint solve(*linkage);
    p.yp0.resize(N);
    solve(*linkage, q0.data(), v0.data(), p.yp0.data() + n);
    p.residual = [linkage, n, solve](double, const double* y, const double* yp, double* r) mutable {
      solve(*linkage, y, y + n, r + n);
      for (int i = 0; i < n; ++i) {
        r[i] = yp[i] - y[n + i];
        r[n + i] = yp[n + i] - r[n + i];
      }
    };
  } else {
    std::vector<double> a, lam;
    solve_motion(*linkage, epsilon, q0.data(), v0.data(), &a, &lam);
    p.y0.insert(p.y0.end(), lam.begin(), lam.end());
    p.yp0.insert(p.yp0.end(), a.begin(), a.end());
    p.yp0.resize(N, 0.0);
    // Redundant rows determine the multipliers to round-off / epsilon only.
    p.atol_scale.assign(static_cast<std::size_t>(2 * n), 1.0);
    p.atol_scale.resize(N, 1e4);
    p.residual = [linkage, n, m, epsilon](double, const double* y, const double* yp, double* r) {
      for (int i = 0; i < n; ++i) r[i] = yp[i] - y[n + i];
      linkage->dynamics(y, yp + n, y + 2 * n, r + n);
      linkage->acceleration(y, y + n, yp + n, r + 2 * n);
      for (int i = 0; i < m; ++i) r[2 * n + i] -= epsilon * y[2 * n + i];
    };
    p.jacobian = [linkage, epsilon](double, double cj, const double* y, const double* yp,
                                    double* J) {
      const int width = linkage->size();
      std::fill(J, J + width * width, 0.0);
      linkage->derivatives(epsilon, cj, y, yp,
                           [J, width](int i, int j, double entry) { J[i + width * j] += entry; });
    };
  }

  add_rows(linkage, q0, v0, p);
  return p;
}

void set_reference(const std::vector<double>& q, const std::vector<double>& v, Problem* p) {
  p->reference = q;
  p->reference.insert(p->reference.end(), v.begin(), v.end());
  p->reference.resize(static_cast<std::size_t>(p->size), std::numeric_limits<double>::quiet_NaN());
}

}  // namespace tether::problems
