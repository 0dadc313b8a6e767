// Tether: derivatives with respect to the data of a contact problem. SPDX-License-Identifier:
// BSD-3-Clause
#include <tether/contact/derivative.hpp>

#include <stdexcept>

#include "derivative/solution_derivative.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {
namespace detail {

using Eigen::Matrix3d;

void DataChange::add(int i, const LocalBlock& L, const Matrix3d& block, double friction) {
  mu[at(i)] += friction;
  for (int t = 0; t < 2; ++t) {
    const double c = L.c[t] * L.inv_a, dc = 0.5 * (block(0, t + 1) + block(t + 1, 0));
    gamma[at(i)][at(t)] += friction * c + L.mu * (L.inv_a * (dc - c * block(0, 0)));
  }
}

Matrix3d DataChange::block_gradient(int i, const LocalBlock& L) const {
  Matrix3d out = Matrix3d::Zero();
  for (int t = 0; t < 2; ++t) {
    const double g = L.mu * L.inv_a * gamma[at(i)][at(t)];
    out(0, t + 1) = out(t + 1, 0) = 0.5 * g;
    out(0, 0) -= L.c[t] * L.inv_a * g;
  }
  return out;
}

double DataChange::mu_gradient(int i, const LocalBlock& L) const {
  return mu[at(i)] + L.inv_a * (L.c[0] * gamma[at(i)][0] + L.c[1] * gamma[at(i)][1]);
}

namespace {

void check_place(std::size_t k, const MatrixBlock& block, int contacts) {
  const std::string where = "A, block " + std::to_string(k) + ": ";
  for (int i : {block.row, block.column}) {
    if (i >= 0 && i < contacts) continue;
    throw std::invalid_argument(where + "place (" + std::to_string(block.row) + ", " +
                                std::to_string(block.column) + ") must lie within " +
                                std::to_string(contacts) + " contacts");
  }
  require_finite("value", block.value, where);
}

}  // namespace
}  // namespace detail

const char* name(DerivativeStatus status) {
  switch (status) {
    case DerivativeStatus::unique:
      return "unique";
    case DerivativeStatus::minimum_norm:
      return "minimum_norm";
  }
  return "?";
}

const DerivativeReport& Derivative::report() const { return implementation_->report(); }
const linalg::VectorX& Derivative::impulses() const { return implementation_->impulses(); }

SolutionDirection Derivative::forward(const ProblemDirection& direction) const {
  using detail::at;
  const Problem& p = implementation_->problem();
  const int n = p.contacts(), d = p.dimension();
  detail::check_entries("b", direction.b, p.b().size(), "as many as b of the problem has");
  detail::check_entries("mu", direction.mu, n, "one for each contact");
  detail::DataChange change(at(n));
  if (direction.b.size() > 0) {
    change.shift = p.pack(direction.b);
    for (PackedVector& v : change.shift)
      for (double& c : v.v) c = -c;
  }
  for (int i = 0; i < n && direction.mu.size() > 0; ++i)
    change.add(i, p.local(i), Eigen::Matrix3d::Zero(), direction.mu[i]);
  for (std::size_t k = 0; k < direction.A.size(); ++k) {
    MatrixBlock block = direction.A[k];
    detail::check_place(k, block, n);
    if (d == 2) {
      block.value.row(2).setZero();
      block.value.col(2).setZero();
    }
    const double* x = implementation_->x()[at(block.column)].v;
    double* shift = change.shift[at(block.row)].v;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) shift[r] += block.value(r, c) * x[c];
    if (block.row == block.column) change.add(block.row, p.local(block.row), block.value, 0);
  }
  const detail::SolutionChange found = implementation_->forward(change);
  SolutionDirection out;
  out.residual = found.residual;
  p.unpack(found.x, out.impulses);
  p.unpack(found.w, out.velocities);
  return out;
}

ProblemDirection Derivative::adjoint(const linalg::VectorView& impulses,
                                     const linalg::VectorView& velocities) const {
  using detail::at;
  const Problem& p = implementation_->problem();
  const int n = p.contacts(), d = p.dimension();
  detail::check_entries("impulses", impulses, d * n, "as many as b of the problem has");
  detail::check_entries("velocities", velocities, d * n, "as many as b of the problem has");
  const auto packed = [&](const linalg::VectorView& v) {
    return v.size() > 0 ? p.pack(v) : detail::Packed(at(n));
  };
  const detail::DataChange found =
      implementation_->adjoint({packed(impulses), packed(velocities), 0});
  ProblemDirection out;
  p.unpack(found.shift, out.b);
  out.b = -out.b;
  out.mu.resize(n);
  out.A.reserve(p.blocks().size());
  for (int i = 0; i < n; ++i) {
    out.mu[i] = found.mu_gradient(i, p.local(i));
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k) {
      const int j = p.columns()[at(k)];
      MatrixBlock& to = out.A.emplace_back(MatrixBlock{i, j, Eigen::Matrix3d::Zero()});
      if (i == j) to.value = found.block_gradient(i, p.local(i));
      for (int r = 0; r < d; ++r)
        for (int c = 0; c < d; ++c)
          to.value(r, c) += found.shift[at(i)].v[r] * implementation_->x()[at(j)].v[c];
      if (d == 2) {
        to.value.row(2).setZero();
        to.value.col(2).setZero();
      }
    }
  }
  return out;
}

Derivative derivative(const Problem& problem, Law law, const linalg::VectorView& impulses,
                      const DerivativeOptions& options) {
  return Derivative(std::make_unique<detail::SolutionDerivative>(problem, law, impulses, options));
}

Derivative derivative(const Problem& problem, Law law, const Solution& solution,
                      const DerivativeOptions& options) {
  DerivativeOptions with = options;
  with.replaced = solution.replaced;
  return derivative(problem, law, solution.impulses, with);
}

}  // namespace tether::contact
