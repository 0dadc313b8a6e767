// Tether: solves problems over products of cones. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <tether/contact/cones.hpp>
#include <tether/linalg/index.hpp>

#include "cones/cone_rows.hpp"
#include "cones/embedding.hpp"
#include "problem/criterion.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {

using linalg::at;

namespace {

// Sets impulses of islands to zero in which no block needs any. A start may have small ones there,
// which the relative tolerance of the island would not remove.
Eigen::VectorXd without_idle(const ConeProblem& problem, Eigen::VectorXd x) {
  const std::vector<int> island = detail::islands(problem);
  std::vector<char> needs(island.size(), 0);
  const int n = static_cast<int>(island.size());
  for (int k = 0; k < n; ++k)
    if (detail::needed_change(problem, k) > 0) needs[at(island[at(k)])] = 1;
  for (int k = 0; k < n; ++k)
    if (needs[at(island[at(k)])] == 0)
      x.segment(problem.first_row(k), problem.cones()[at(k)].rows).setZero();
  return x;
}

}  // namespace

struct ConeSolver::Implementation {
  explicit Implementation(Options given)
      : options((given.measure = Measure::fixed_point, given)), solver(options) {}

  ConeSolution solve(const ConeProblem& problem, const linalg::VectorView* start);
  void judge(const ConeProblem& problem, const detail::Embedding& embedding, ConeSolution& out);
  void report(const Solution& found, ConeSolution& out) const;

  Options options;
  Solver solver;
};

void ConeSolver::Implementation::judge(const ConeProblem& problem,
                                       const detail::Embedding& embedding, ConeSolution& out) {
  out.velocities = problem.velocities(out.impulses);
  out.residuals = evaluate(problem, options.law, out.impulses);
  out.error = out.residuals.error;
  out.contradicting.clear();
  const double needed = detail::largest_need(problem);
  for (int row : embedding.free_rows().rows()) {
    const double scale = problem.row_scale()[at(row)], w = std::abs(out.velocities[row]);
    if (scale > 0 ? w * scale > detail::kContradiction * needed : w > 0)
      out.contradicting.push_back(row);
  }
}

// Status and advice.
void ConeSolver::Implementation::report(const Solution& found, ConeSolution& out) const {
  out.status = found.status;
  out.advice = found.advice;
  if (!out.contradicting.empty() || !out.blocked.empty()) {
    out.status = Status::infeasible;
    out.advice = out.contradicting.empty()
                     ? "block " + std::to_string(out.blocked.front()) +
                           " approaches, but free rows hold its normal: no impulse stops it"
                     : "free row " + std::to_string(out.contradicting.front()) +
                           " contradicts others: see `contradicting`";
  } else if (out.error <= options.tolerance) {
    out.status = Status::solved;
    out.advice.clear();
  } else if (found.status == Status::solved) {
    out.status = Status::round_off;
    out.advice = "the error of block " + std::to_string(out.residuals.worst) +
                 " is round-off of its free rows: a smaller tolerance cannot be reached";
  }
}

// The contacts of the embedding have scales of their own, so a solution of them may leave a larger
// residual in the rows. It is then solved again with a smaller tolerance, three times at most.
ConeSolution ConeSolver::Implementation::solve(const ConeProblem& problem,
                                               const linalg::VectorView* start) {
  detail::require_law(problem, options.law);
  if (start != nullptr && start->size() != problem.rows())
    detail::refuse_size("start", start->size(), problem.rows(), "one for each row");
  const detail::Embedding embedding(problem, options.tolerance);
  const Problem& contacts = embedding.contacts();
  ConeSolution out;
  Solution found;
  double tolerance = options.tolerance;
  Eigen::VectorXd from;
  if (start != nullptr) from = embedding.lift(*start);
  for (int tries = 0;; ++tries) {
    if (contacts.contacts() > 0) {
      if (tries > 0) {
        Options tighter = options;
        tighter.tolerance = tolerance;
        found = Solver(tighter).solve(contacts, from);
      } else {
        found = start != nullptr ? solver.solve(contacts, from) : solver.solve(contacts);
      }
      out.counts.add(found.counts);
      out.impulses = embedding.complete(embedding.lower(found.impulses), problem.b());
    } else {
      found.status = Status::solved;
      out.impulses = embedding.complete(Eigen::VectorXd::Zero(problem.rows()), problem.b());
    }
    judge(problem, embedding, out);
    if (!found.replaced.empty()) out.error = found.error;
    if (out.error <= options.tolerance || found.status != Status::solved || tries == 3 ||
        contacts.contacts() == 0 || !out.contradicting.empty())
      break;
    tolerance *= std::max(0.01, 0.5 * options.tolerance / out.error);
    from = embedding.lift(without_idle(problem, out.impulses));
  }
  for (int contact : found.replaced) out.replaced.push_back(embedding.block_of(contact));
  out.blocked = embedding.blocked();
  report(found, out);
  if (found.status == Status::infeasible && !found.infeasible_direction.empty()) {
    const auto n = static_cast<Eigen::Index>(found.infeasible_direction.size());
    const Eigen::VectorXd d = embedding.complete(
        embedding.lower(Eigen::Map<const Eigen::VectorXd>(found.infeasible_direction.data(), n)),
        Eigen::VectorXd::Zero(problem.rows()));
    out.infeasible_direction.assign(d.data(), d.data() + d.size());
  }
  return out;
}

ConeSolver::ConeSolver(const Options& options)
    : implementation_(std::make_unique<Implementation>(options)) {}
ConeSolver::~ConeSolver() = default;
ConeSolver::ConeSolver(ConeSolver&&) noexcept = default;
ConeSolver& ConeSolver::operator=(ConeSolver&&) noexcept = default;

ConeSolution ConeSolver::solve(const ConeProblem& problem) {
  return implementation_->solve(problem, nullptr);
}

ConeSolution ConeSolver::solve(const ConeProblem& problem, const linalg::VectorView& start) {
  return implementation_->solve(problem, &start);
}

}  // namespace tether::contact
