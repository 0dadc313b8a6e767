// Tether: derivatives with respect to the data of a problem. SPDX-License-Identifier: BSD-3-Clause
//
// method, section 9. A enters through w = A x - b, where dA does what -dA x does to b, and, under
// maximum dissipation, through gamma of each contact's own block.
#include <tether/contact/derivative.hpp>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "cones/cone_rows.hpp"
#include "cones/embedding.hpp"
#include "derivative/solution_derivative.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {

using detail::at;
using linalg::VectorX;

namespace {

std::vector<MatrixEntry> entries_of(const Problem& p) {
  std::vector<MatrixEntry> out;
  const int d = p.dimension();
  for (int i = 0; i < p.contacts(); ++i)
    for (int k = p.row_start()[at(i)]; k < p.row_start()[at(i + 1)]; ++k)
      for (int r = 0; r < d; ++r)
        for (int c = 0; c < d; ++c)
          out.push_back(
              {d * i + r, d * p.columns()[at(k)] + c, p.blocks()[at(k)].column[4 * c + r]});
  return out;
}

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

struct detail::DerivativeParts {
  // A number of a block is that of a contact that stands for it, times a factor: mu, or b.
  struct Parameter {
    VectorX ProblemDirection::*of;
    int block, contact;
    double factor;
    bool is_bound;
  };

  DerivativeParts(const Problem& problem, Law law, const linalg::VectorView& x,
                  const DerivativeOptions& options)
      : A(entries_of(problem)),
        impulses(x),
        contacts(problem, law, x, options),
        report(contacts.report()),
        blocks(problem.contacts()) {
    for (int i = 0; i < blocks; ++i) parameters.push_back({&ProblemDirection::mu, i, i, 1, false});
  }
  DerivativeParts(const ConeProblem& problem, const linalg::VectorView& x,
                  const DerivativeOptions& options)
      : A(checked(problem, x, options).entries()),
        impulses(x),
        embedding(std::in_place, problem, options.tolerance, open_blocks(problem, x)),
        contacts(embedding->contacts(), Law::coulomb, embedding->lift(x), for_contacts(options)),
        report(contacts.report()),
        blocks(static_cast<int>(problem.cones().size())) {
    report_blocks(problem);
    report.error = evaluate(problem, Law::coulomb, x).error;
    for (int k = 0; k < blocks; ++k) {
      const Embedding::Moments& m = embedding->moments_of(k);
      const Embedding::Bound bound = embedding->bound_of(k);
      const bool friction = parts_of(problem.cones()[at(k)].kind).tangents > 0;
      for (const Parameter& each :
           {Parameter{&ProblemDirection::bound, k, bound.contact, bound.factor, true},
            {&ProblemDirection::mu, k, friction ? embedding->main_contact(k) : -1, 1, false},
            {&ProblemDirection::torsional, k, m.spin, m.spin_factor, false},
            {&ProblemDirection::rolling, k, m.rolling, m.rolling_factor, false}})
        if (each.contact >= 0) parameters.push_back(each);
    }
  }

  void report_blocks(const ConeProblem& problem) {
    const std::vector<Regime> of_contacts = report.regimes;
    report.regimes.clear();
    for (int k = 0; k < blocks; ++k) {
      const int contact = embedding->main_contact(k);
      report.regimes.push_back(problem.cones()[at(k)].kind == Cone::Kind::free ? Regime::sticking
                               : contact >= 0 ? of_contacts[at(contact)]
                                              : Regime::separating);
    }
    for (Kink& kink : report.kinks) kink.contact = embedding->block_of(kink.contact);
    for (int& contact : report.not_unique) contact = embedding->block_of(contact);
  }
  void check(const ProblemDirection& direction) const;
  // The contact whose own block has an entry of A, under a law that uses that block; -1: none.
  int own_block(const MatrixEntry& e) const {
    const int d = contacts.problem().dimension();
    return !embedding && e.row / d == e.column / d ? e.row / d : -1;
  }

  std::vector<MatrixEntry> A;
  VectorX impulses;
  std::optional<Embedding> embedding;  // none: rows are those of the contacts
  SolutionDerivative contacts;
  DerivativeReport report;
  int blocks;
  std::vector<Parameter> parameters;
};

void detail::DerivativeParts::check(const ProblemDirection& direction) const {
  const int n = static_cast<int>(impulses.size());
  check_entries("b", direction.b, n, "one for each row");
  for (const auto& [name, v] :
       {std::pair("mu", &direction.mu), std::pair("rolling", &direction.rolling),
        std::pair("torsional", &direction.torsional), std::pair("bound", &direction.bound)})
    check_entries(name, *v, blocks, "one for each contact or cone");
  check_entries("A", direction.A, n, n);
}

const char* name(DerivativeStatus status) {
  return detail::text(status, {"unique", "minimum_norm"});
}

const DerivativeReport& Derivative::report() const { return parts_->report; }
const VectorX& Derivative::impulses() const { return parts_->impulses; }

SolutionDirection Derivative::forward(const ProblemDirection& direction) const {
  const detail::DerivativeParts& s = *parts_;
  const Problem& p = s.contacts.problem();
  s.check(direction);
  Eigen::VectorXd db = Eigen::VectorXd::Zero(s.impulses.size());
  if (direction.b.size() > 0) db = direction.b;
  for (const MatrixEntry& e : direction.A) db[e.row] -= e.value * s.impulses[e.column];
  VectorX b = s.embedding ? s.embedding->lift_b(db) : db;
  detail::DataChange change(at(p.contacts()));
  for (const auto& each : s.parameters) {
    const VectorX& v = direction.*each.of;
    if (v.size() == 0) continue;
    const double by = each.factor * v[each.block];
    if (each.is_bound)
      b[3 * each.contact] += by;
    else
      change.add_friction(each.contact, p.local(each.contact), by);
  }
  for (const MatrixEntry& e : direction.A)
    if (const int i = s.own_block(e); i >= 0)
      change.add_entry(i, p.local(i), e.row % p.dimension(), e.column % p.dimension(), e.value);
  change.shift = p.pack(-b);
  const detail::SolutionChange found = s.contacts.forward(change);
  SolutionDirection out;
  out.residual = found.residual;
  p.unpack(found.x, out.impulses);
  if (s.embedding) out.impulses = s.embedding->complete(s.embedding->lower(out.impulses), db);
  out.velocities = -db;
  for (const MatrixEntry& a : s.A) out.velocities[a.row] += a.value * out.impulses[a.column];
  return out;
}

ProblemDirection Derivative::adjoint(const linalg::VectorView& impulses,
                                     const linalg::VectorView& velocities) const {
  const detail::DerivativeParts& s = *parts_;
  const Problem& p = s.contacts.problem();
  const Eigen::Index n = s.impulses.size();
  detail::check_entries("impulses", impulses, n, "one for each row");
  detail::check_entries("velocities", velocities, n, "one for each row");
  // Gradients by x and by b: dw = A dx - db.
  Eigen::VectorXd gx = Eigen::VectorXd::Zero(n), gb = gx;
  if (impulses.size() > 0) gx = impulses;
  if (velocities.size() > 0) {
    gb = -velocities;
    for (const MatrixEntry& a : s.A) gx[a.column] += a.value * velocities[a.row];
  }
  if (s.embedding && !s.embedding->free_rows().empty()) {  // x_f = A_ff^+ (b_f - A_fc x_c)
    const detail::FreeRows& f = s.embedding->free_rows();
    const Eigen::VectorXd y = f.solve(f.of(gx));
    f.put(f.of(gb) + y, gb);
    f.put(Eigen::VectorXd::Zero(y.size()), gx);
    gx -= f.back().transpose() * y;
  }
  const detail::DataChange found =
      s.contacts.adjoint(p.pack(s.embedding ? s.embedding->raise(gx) : gx));
  VectorX of_b;
  p.unpack(found.shift, of_b);
  of_b = -of_b;
  gb += s.embedding ? s.embedding->lower_b(of_b) : Eigen::VectorXd(of_b);
  ProblemDirection out;
  for (VectorX* v : {&out.mu, &out.rolling, &out.torsional, &out.bound})
    *v = VectorX::Zero(s.blocks);
  for (const auto& each : s.parameters)
    (out.*each.of)[each.block] =
        each.factor * (each.is_bound ? of_b[3 * each.contact]
                                     : found.mu_gradient(each.contact, p.local(each.contact)));
  out.b = gb;
  for (const MatrixEntry& a : s.A) {
    out.A.push_back({a.row, a.column, -gb[a.row] * s.impulses[a.column]});
    if (const int i = s.own_block(a); i >= 0)
      out.A.back().value +=
          found.entry_gradient(i, p.local(i), a.row % p.dimension(), a.column % p.dimension());
  }
  return out;
}

Derivative derivative(const Problem& problem, Law law, const linalg::VectorView& impulses,
                      const DerivativeOptions& options) {
  return Derivative(std::make_shared<detail::DerivativeParts>(problem, law, impulses, options));
}

Derivative derivative(const Problem& problem, Law law, const Solution& solution,
                      const DerivativeOptions& options) {
  DerivativeOptions with = options;
  with.replaced = solution.replaced;
  return derivative(problem, law, solution.impulses, with);
}

Derivative derivative(const ConeProblem& problem, const linalg::VectorView& impulses,
                      const DerivativeOptions& options) {
  return Derivative(std::make_shared<detail::DerivativeParts>(problem, impulses, options));
}

}  // namespace tether::contact
