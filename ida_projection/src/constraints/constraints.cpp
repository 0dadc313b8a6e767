// Tether: constraint sets, their union and the check of a caller's Jacobian.
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <tether/ida_projection/constraints.hpp>

#include "constraints/evaluator.hpp"
#include "host/shortest.hpp"

namespace tether::ida_projection {

namespace {

// Other processes may have some DistributedRows.
bool empty(const Constraints& set) {
  return set.count == 0 && set.joined.empty() &&
         !std::holds_alternative<DistributedRows>(set.jacobian);
}

const char* kind(const Constraints& set) {
  if (std::holds_alternative<Gradients>(set.jacobian)) return "Gradients";
  if (std::holds_alternative<UserProjection>(set.jacobian)) return "UserProjection";
  if (std::holds_alternative<DistributedRows>(set.jacobian)) return "DistributedRows";
  return "";
}

}  // namespace

std::string Constraints::name(int row) const {
  if (row >= 0 && row < count)
    return static_cast<std::size_t>(row) < names.size() ? names[static_cast<std::size_t>(row)]
                                                        : "row " + std::to_string(row);
  int first = count;
  for (const Constraints& part : joined) {
    const int rows = part.total_count();
    if (row >= first && row < first + rows) {
      const std::string found = part.name(row - first);
      // Unnamed rows are numbered in the whole set, not in the part.
      return found.rfind("row ", 0) == 0 ? "row " + std::to_string(row) : found;
    }
    first += rows;
  }
  return "row " + std::to_string(row);
}

std::string wrong_length(const Constraints& set, long unknowns) {
  if (set.count > 0 && (unknowns < set.least_unknowns || unknowns > set.most_unknowns)) {
    const bool exact = set.least_unknowns == set.most_unknowns;
    return "constraint \"" + set.name(0) + "\" needs " +
           (exact                           ? "exactly "
            : unknowns < set.least_unknowns ? "at least "
                                            : "at most ") +
           std::to_string(unknowns < set.least_unknowns ? set.least_unknowns : set.most_unknowns) +
           " unknowns; y has " + std::to_string(unknowns);
  }
  for (const Constraints& part : set.joined) {
    std::string refusal = wrong_length(part, unknowns);
    if (!refusal.empty()) return refusal;
  }
  return "";
}

Constraints operator+(Constraints a, const Constraints& b) {
  if (empty(b)) return a;
  if (empty(a)) return b;
  const std::string left = kind(a), right = kind(b);
  if (left == "UserProjection" || right == "UserProjection")
    throw std::invalid_argument(
        "Constraints +: a UserProjection cannot be joined; it must project onto all rows itself");
  if (right == "DistributedRows" || (left == "DistributedRows" && right != "Gradients"))
    throw std::invalid_argument(
        "Constraints +: to DistributedRows, which come first, only Gradients can be joined; give "
        "sparse rows of all sets as one");
  if (left != right && left != "DistributedRows")
    throw std::invalid_argument(
        "Constraints +: rows given as Gradients join only rows given as Gradients; give both sets "
        "the same kind of Jacobian");
  if (static_cast<long>(a.total_count()) + b.total_count() > std::numeric_limits<int>::max())
    throw std::invalid_argument("Constraints +: " + std::to_string(a.total_count()) + " and " +
                                std::to_string(b.total_count()) +
                                " rows are more than an int counts");
  a.joined.push_back(b);
  return a;
}

namespace {

// Fills the report with two values that should be equal, of g (column -1) or C.
bool tell(const Constraints& constraints, int row, int column, double given, double expected,
          const char* from_given, const char* from_expected, JacobianReport& report) {
  report.row = row;
  report.column = column;
  report.given = given;
  report.expected = expected;
  PlainText text;
  text.precision(10);
  text << "row " << row << " (" << constraints.name(row) << "), ";
  if (column < 0)
    text << "g";
  else
    text << "column " << column;
  text << ": " << from_given << " " << given << ", " << from_expected << " " << expected;
  report.message = text.str();
  return false;
}

// fill_with_value against value and fill, up to the rounding of another order of operations.
bool check_both(const Constraints& constraints, Evaluator& evaluator, double t, ConstVector y,
                const Eigen::VectorXd& increments, const std::vector<int>& columns,
                const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>& C,
                double tolerance, const std::function<void(Status)>& require,
                JacobianReport& report) {
  const int m = evaluator.rows(), n = static_cast<int>(y.size());
  auto together = C;
  Eigen::VectorXd alone(m), g(m);
  require(evaluator.value(t, y.data(), n, alone.data()));
  require(
      evaluator.jacobian(t, y.data(), n, increments.data(), columns, together.data(), g.data()));
  const auto differ = [tolerance](double a, double b, double size) {
    return !(std::abs(a - b) <= tolerance * size);
  };
  for (int i = 0; i < m; ++i) {
    const double terms = C.row(i).cwiseAbs().dot(y.cwiseAbs().cwiseMax(1.0));
    const char* const from = "fill_with_value gives";
    if (differ(g[i], alone[i], std::max(terms, std::abs(alone[i]))))
      return tell(constraints, i, -1, g[i], alone[i], from, "value gives", report);
    for (int j = 0; j < n; ++j)
      if (differ(together(i, j), C(i, j), C.row(i).cwiseAbs().maxCoeff()))
        return tell(constraints, i, j, together(i, j), C(i, j), from, "fill gives", report);
  }
  return true;
}

// Rows whose Jacobian is the caller's.
void mark_given(const Constraints& set, std::vector<char>& given) {
  const bool by_caller = !std::holds_alternative<FiniteDifferences>(set.jacobian);
  given.insert(given.end(), static_cast<std::size_t>(set.count), by_caller ? 1 : 0);
  for (const Constraints& part : set.joined) mark_given(part, given);
}

}  // namespace

JacobianReport check_jacobian(const Constraints& constraints, double t, ConstVector y,
                              double tolerance) {
  if (!(tolerance > 0.0))
    throw std::invalid_argument("check_jacobian: tolerance = " + brief(tolerance) +
                                "; it must be > 0");
  if (kind(constraints)[0] != '\0')
    throw std::invalid_argument(
        std::string("check_jacobian: rows are given as ") + kind(constraints) +
        "; it works for DenseJacobian, SparseJacobian and FiniteDifferences");
  if (y.size() == 0) throw std::invalid_argument("check_jacobian: y has no entries");
  const std::string refusal = wrong_length(constraints, static_cast<long>(y.size()));
  if (!refusal.empty()) throw std::invalid_argument("check_jacobian: " + refusal);
  Statistics counts;
  Evaluator evaluator(constraints, counts);
  const int n = static_cast<int>(y.size());
  const int m = evaluator.rows();
  const auto require = [&](Status status) {
    if (status != Status::success)
      throw std::invalid_argument("check_jacobian: " + evaluator.report.text);
  };

  std::vector<int> columns(static_cast<std::size_t>(n));
  for (int j = 0; j < n; ++j) columns[static_cast<std::size_t>(j)] = j;
  const Eigen::VectorXd scale = y.cwiseAbs().cwiseMax(1.0), increments = 1e-7 * scale;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> given(m, n),
      expected(m, n);
  require(evaluator.jacobian(t, y.data(), n, increments.data(), columns, given.data()));

  Eigen::VectorXd at = y;
  std::vector<double> slope(static_cast<std::size_t>(m)), values(slope);
  for (int j = 0; j < n; ++j) {
    require(central_differences(5e-4 * scale[j], slope, values, [&](double h, auto& g) {
      at[j] = y[j] + h;
      return evaluator.value(t, at.data(), n, g.data());
    }));
    at[j] = y[j];
    expected.col(j) = ConstVector(slope.data(), m);
  }

  JacobianReport report;
  std::vector<char> by_caller;
  mark_given(constraints, by_caller);
  for (int i = 0; i < m; ++i) {
    if (by_caller[static_cast<std::size_t>(i)] == 0) continue;
    const double largest = (expected.row(i).transpose().cwiseProduct(scale)).cwiseAbs().maxCoeff();
    for (int j = 0; j < n; ++j) {
      const double size = std::max(largest, std::abs(given(i, j)) * scale[j]);
      const double difference = std::abs(given(i, j) - expected(i, j)) * scale[j];
      double relative = size > 0.0 ? difference / size : 0.0;
      if (std::isnan(difference)) relative = std::numeric_limits<double>::infinity();
      if (relative > report.worst) {
        report.worst = relative;
        report.row = i;
        report.column = j;
        report.given = given(i, j);
        report.expected = expected(i, j);
      }
    }
  }
  report.correct = report.worst <= tolerance;
  if (!report.correct) {
    tell(constraints, report.row, report.column, report.given, report.expected, "given",
         "differences give", report);
    return report;
  }
  report.row = report.column = -1;
  if (evaluator.gives_both())
    report.correct = check_both(constraints, evaluator, t, y, increments, columns, given, tolerance,
                                require, report);
  return report;
}

JacobianReport check_jacobian(const Constraints& constraints, double t,
                              const std::vector<double>& y, double tolerance) {
  return check_jacobian(constraints, t, ConstVector(y.data(), static_cast<Eigen::Index>(y.size())),
                        tolerance);
}

}  // namespace tether::ida_projection
