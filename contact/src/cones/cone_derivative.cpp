// Tether: derivatives of solutions over products of cones. SPDX-License-Identifier: BSD-3-Clause
//
// method, section 8. A enters through w = A x - b alone: dA does what -dA x does to b.
#include <tether/contact/cone_derivative.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <tether/linalg/index.hpp>

#include "cones/cone_rows.hpp"
#include "cones/embedding.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {

using linalg::at;

namespace {

// Blocks whose contact separates.
std::vector<char> open_blocks(const ConeProblem& problem, const linalg::VectorView& impulses) {
  std::vector<char> out;
  const linalg::VectorX w = problem.velocities(impulses);
  for (std::size_t k = 0; k < problem.cones().size(); ++k) {
    const int row = problem.first_row(static_cast<int>(k));
    const double a = detail::diagonal_block(problem, row, 1)(0, 0);
    out.push_back(detail::is_contact(problem.cones()[k].kind) && w[row] > a * impulses[row]);
  }
  return out;
}

const ConeProblem& checked(const ConeProblem& problem, const linalg::VectorView& impulses,
                           const DerivativeOptions& options) {
  const ConeResiduals residuals = evaluate(problem, Law::coulomb, impulses);
  if (!(residuals.error <= options.tolerance))
    detail::refuse(
        "error of the impulses", residuals.error,
        ("must be <= tolerance = " + std::to_string(options.tolerance) + ": they are no solution")
            .c_str());
  return problem;
}

DerivativeOptions for_contacts(DerivativeOptions options) {
  options.replaced.clear();
  // Judged by evaluate() already; the contacts' own scale may be smaller.
  options.tolerance = std::max(options.tolerance, 1e-3);
  return options;
}

}  // namespace

struct detail::ConeDerivativeParts {
  ConeDerivativeParts(const ConeProblem& given, const linalg::VectorView& x,
                      const DerivativeOptions& options)
      : problem(checked(given, x, options)),
        impulses(x),
        embedding(problem, options.tolerance, open_blocks(problem, x)),
        contacts(derivative(embedding.contacts(), Law::coulomb, embedding.lift(x),
                            for_contacts(options))),
        report(contacts.report()) {
    report.error = evaluate(problem, Law::coulomb, x).error;
    const std::vector<Regime> of_contacts = report.regimes;
    report.regimes.clear();
    for (int k = 0; k < static_cast<int>(problem.cones().size()); ++k) {
      const int contact = embedding.main_contact(k);
      report.regimes.push_back(problem.cones()[at(k)].kind == Cone::Kind::free ? Regime::sticking
                               : contact >= 0 ? of_contacts[at(contact)]
                                              : Regime::separating);
    }
    const auto add = [&](linalg::VectorX ConeDirection::*of, int block, int contact, double factor,
                         bool is_bound = false) {
      if (contact >= 0) parameters.push_back({of, block, contact, factor, is_bound});
    };
    for (int k = 0; k < static_cast<int>(problem.cones().size()); ++k) {
      const Embedding::Moments& m = embedding.moments_of(k);
      const Embedding::Bound bound = embedding.bound_of(k);
      add(&ConeDirection::bound, k, bound.contact, bound.factor, true);
      if (parts_of(problem.cones()[at(k)].kind).tangents > 0)
        add(&ConeDirection::mu, k, embedding.main_contact(k), 1);
      add(&ConeDirection::torsional, k, m.spin, m.spin_factor);
      add(&ConeDirection::rolling, k, m.rolling, m.rolling_factor);
    }
    for (Kink& kink : report.kinks) kink.contact = embedding.block_of(kink.contact);
    for (int& contact : report.not_unique) contact = embedding.block_of(contact);
  }

  // By row: what direction.A does to A x.
  Eigen::VectorXd shift(const ConeDirection& direction) const {
    Eigen::VectorXd out = Eigen::VectorXd::Zero(problem.rows());
    for (const MatrixEntry& e : direction.A) {
      if (e.row < 0 || e.row >= problem.rows() || e.column < 0 || e.column >= problem.rows())
        throw std::invalid_argument("A(" + std::to_string(e.row) + ", " + std::to_string(e.column) +
                                    ") is outside of the matrix");
      if (!std::isfinite(e.value)) refuse("A", e.value, "must be finite");
      out[e.row] += e.value * impulses[e.column];
    }
    return out;
  }

  /// A number of a block is that of a contact that stands for it, times a factor: mu, or b.
  struct Parameter {
    linalg::VectorX ConeDirection::*of;
    int block, contact;
    double factor;
    bool is_bound;
  };

  ConeProblem problem;
  Eigen::VectorXd impulses;
  Embedding embedding;
  Derivative contacts;
  DerivativeReport report;
  std::vector<Parameter> parameters;
};

const DerivativeReport& ConeDerivative::report() const { return parts_->report; }

SolutionDirection ConeDerivative::forward(const ConeDirection& direction) const {
  const ConeProblem& p = parts_->problem;
  const detail::Embedding& e = parts_->embedding;
  const auto blocks = static_cast<Eigen::Index>(p.cones().size());
  detail::check_entries("b", direction.b, p.rows(), "one for each row");
  detail::check_entries("mu", direction.mu, blocks, "one for each block");
  detail::check_entries("rolling", direction.rolling, blocks, "one for each block");
  detail::check_entries("torsional", direction.torsional, blocks, "one for each block");
  detail::check_entries("bound", direction.bound, blocks, "one for each block");
  Eigen::VectorXd db = -parts_->shift(direction);
  if (direction.b.size() > 0) db += direction.b;
  ProblemDirection of_contacts;
  Eigen::VectorXd b = e.lift_b(db), mu = Eigen::VectorXd::Zero(e.contacts().contacts());
  for (const auto& each : parts_->parameters)
    if (const linalg::VectorX& change = direction.*each.of; change.size() > 0)
      (each.is_bound ? b[3 * each.contact] : mu[each.contact]) += each.factor * change[each.block];
  of_contacts.b = b;
  of_contacts.mu = mu;
  SolutionDirection out;
  Eigen::VectorXd x = Eigen::VectorXd::Zero(p.rows());
  if (e.contacts().contacts() > 0) {
    const SolutionDirection found = parts_->contacts.forward(of_contacts);
    out.residual = found.residual;
    x = e.lower(found.impulses);
  }
  out.impulses = e.complete(x, db);
  out.velocities = -db;
  for (const MatrixEntry& a : p.entries())
    out.velocities[a.row] += a.value * out.impulses[a.column];
  return out;
}

ConeDirection ConeDerivative::adjoint(const linalg::VectorView& impulses,
                                      const linalg::VectorView& velocities) const {
  const ConeProblem& p = parts_->problem;
  const detail::Embedding& e = parts_->embedding;
  detail::check_entries("impulses", impulses, p.rows(), "one for each row");
  detail::check_entries("velocities", velocities, p.rows(), "one for each row");
  // Gradients by x and by b, by rows: dw = A dx - db.
  Eigen::VectorXd gx = Eigen::VectorXd::Zero(p.rows()), gb = gx;
  if (impulses.size() > 0) gx = impulses;
  if (velocities.size() > 0) {
    gb = -velocities;
    for (const MatrixEntry& a : p.entries()) gx[a.column] += a.value * velocities[a.row];
  }
  // x_f = A_ff^+ (b_f - A_fc x_c)
  const detail::FreeRows& f = e.free_rows();
  if (!f.empty()) {
    const Eigen::VectorXd y = f.solve(f.of(gx));
    f.put(f.of(gb) + y, gb);
    f.put(Eigen::VectorXd::Zero(y.size()), gx);
    gx -= f.back().transpose() * y;
  }
  const auto blocks = static_cast<Eigen::Index>(p.cones().size());
  ConeDirection out;
  for (linalg::VectorX* v : {&out.mu, &out.rolling, &out.torsional, &out.bound})
    *v = Eigen::VectorXd::Zero(blocks);
  if (e.contacts().contacts() > 0) {
    const ProblemDirection g = parts_->contacts.adjoint(e.raise(gx));
    gb += e.lower_b(g.b);
    for (const auto& each : parts_->parameters)
      (out.*each.of)[each.block] =
          each.factor * (each.is_bound ? g.b[3 * each.contact] : g.mu[each.contact]);
  }
  out.b = gb;
  for (const MatrixEntry& a : p.entries())
    out.A.push_back({a.row, a.column, -gb[a.row] * parts_->impulses[a.column]});
  return out;
}

ConeDerivative derivative(const ConeProblem& problem, const linalg::VectorView& impulses,
                          const DerivativeOptions& options) {
  return ConeDerivative(std::make_unique<detail::ConeDerivativeParts>(problem, impulses, options));
}

}  // namespace tether::contact
