// Tether: rows whose algebraic variables F determines, joined with the equations that do so.
// SPDX-License-Identifier: BSD-3-Clause
#include "rows/equations.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <initializer_list>
#include <numeric>
#include <tether/linalg/least_squares.hpp>

#include "host/rounding.hpp"
#include "rows/split_rows.hpp"

namespace tether::ida_projection {

namespace {

using Dense = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr double kRestricts = 1e-2;  // of a row: the candidate is off the set by its own error
constexpr double kGrown = 1e-3;      // of a row: entries that are next to nothing here may grow

std::size_t at(Eigen::Index i) { return static_cast<std::size_t>(i); }

/// The equations and their differences; columns in groups that share no equation.
class Differences {
 public:
  Differences(const JoinedEquations& found, Residual residual,
              std::function<const double*()> weights, int size)
      : equations_(found.equations),
        columns_(found.columns),
        residual_(std::move(residual)),
        weights_(std::move(weights)),
        group_of_(at(size), -1),
        point_(at(size)),
        base_(at(size)),
        shifted_(at(size)),
        change_(at(size)),
        size_(at(size)) {
    for (int j = 0; j < size; ++j) assign_group(j);
  }

  int value(const double* y, double* g) {
    if (!residual_(y, base_.data())) return 1;
    for (std::size_t i = 0; i < equations_.size(); ++i) g[i] = base_[at(equations_[i])];
    return 0;
  }

  // Central differences: rows that nearly depend on each other magnify what one-sided ones leave.
  int entries(const double* y, double* values) {
    std::copy(y, y + point_.size(), point_.begin());
    double largest = 0.0;
    for (double value : point_) largest = std::max(largest, std::abs(value));
    const double* w = weights_();
    for (int group = 0; group < groups_; ++group) {
      for (std::size_t j = 0; j < point_.size(); ++j) {
        if (group_of_[j] != group) continue;
        const double tolerance = w != nullptr && w[j] > 0.0 ? 1.0 / w[j] : largest;
        size_[j] = std::max(size_[j], std::abs(y[j]));
        change_[j] = std::max(kIncrement * size_[j], std::min(tolerance, kIncrement * largest));
        if (!(change_[j] > 0.0)) change_[j] = kIncrement;
        point_[j] = y[j] - change_[j];
      }
      if (!residual_(point_.data(), base_.data())) return 1;
      for (std::size_t j = 0; j < point_.size(); ++j) {
        if (group_of_[j] != group) continue;
        const double low = point_[j];
        point_[j] = y[j] + change_[j];
        change_[j] = point_[j] - low;
      }
      if (!residual_(point_.data(), shifted_.data())) return 1;
      double* entry = values;
      for (std::size_t i = 0; i < equations_.size(); ++i) {
        const std::size_t e = at(equations_[i]);
        for (int j : columns_[i]) {
          if (group_of_[at(j)] == group) *entry = (shifted_[e] - base_[e]) / change_[at(j)];
          ++entry;
        }
      }
      for (std::size_t j = 0; j < point_.size(); ++j)
        if (group_of_[j] == group) point_[j] = y[j];
    }
    return 0;
  }

 private:
  // The first group with no column that meets column j in an equation.
  void assign_group(int j) {
    std::vector<char> taken(at(groups_) + 1, 0);
    bool used = false;
    for (const std::vector<int>& columns : columns_) {
      if (!std::binary_search(columns.begin(), columns.end(), j)) continue;
      used = true;
      for (int other : columns)
        if (group_of_[at(other)] >= 0) taken[at(group_of_[at(other)])] = 1;
    }
    if (!used) return;
    const auto free = std::find(taken.begin(), taken.end(), 0);
    group_of_[at(j)] = static_cast<int>(free - taken.begin());
    groups_ = std::max(groups_, group_of_[at(j)] + 1);
  }

  std::vector<int> equations_;
  std::vector<std::vector<int>> columns_;
  Residual residual_;
  std::function<const double*()> weights_;
  std::vector<int> group_of_;  // of each column; -1: in no equation
  int groups_ = 0;
  std::vector<double> point_, base_, shifted_, change_;
  std::vector<double> size_;  // largest |y_j| so far
};

// A point at which no unknown is zero by chance. The smallest relative tolerance tells how many
// tolerances the size of an unknown is that happens to be zero.
std::vector<double> further_away(const std::vector<double>& y, const std::vector<double>& WT) {
  double relative = kIncrement;
  for (std::size_t j = 0; j < y.size(); ++j)
    if (WT[j] > 0.0 && y[j] != 0.0) relative = std::min(relative, WT[j] / std::abs(y[j]));
  std::vector<double> reach = WT;
  for (double& length : reach) length *= kIncrement / relative;
  return some_tolerances_away(y, reach);
}

// Orthonormal rows, by Gram-Schmidt applied twice.
class Span {
 public:
  Eigen::VectorXd rest(Eigen::VectorXd row) const {
    for (int pass = 0; pass < 2; ++pass)
      for (const Eigen::VectorXd& unit : units_) row -= unit.dot(row) * unit;
    return row;
  }
  // True: the row was not in the span, and is now.
  bool add(const Eigen::VectorXd& row, double smallest) {
    const Eigen::VectorXd left = rest(row);
    const double length = left.norm();
    if (!(length > smallest)) return false;
    units_.push_back(left / length);
    return true;
  }

 private:
  std::vector<Eigen::VectorXd> units_;
};

// C at one point, then h, scaled, with the multiples x of h that cancel the algebraic part of rows
// of C. Columns that are not free are zero.
struct Point {
  std::vector<double> y;
  Dense C, h;
  Dense grown;         // C with algebraic entries of at least kGrown, unless they are exactly zero
  bool hangs = false;  // some row contains an algebraic variable, however weakly
  linalg::LeastSquares factors{kQuotientRounding};  // of h_a^T

  bool evaluate_rows(Evaluator& rows, double t, const std::vector<double>& WT,
                     const std::vector<int>& free, const std::vector<int>& algebraic) {
    C = Dense::Zero(rows.rows(), static_cast<Eigen::Index>(y.size()));
    const auto n = static_cast<int>(y.size());
    std::vector<double> fine(WT);  // differences over a tolerance are not good to kQuotientRounding
    for (double& change : fine) change *= kWideIncrement;
    if (rows.jacobian(t, y.data(), n, fine.data(), free, C.data()) != Status::success) return false;
    grown = C;
    if (!finish(&C, WT, free)) return false;
    for (Eigen::Index i = 0; i < C.rows(); ++i)
      for (const int j : algebraic) {
        double& entry = grown(i, j);
        hangs = hangs || entry != 0.0;
        if (entry != 0.0) entry = std::copysign(std::max(kGrown, std::abs(C(i, j))), entry);
      }
    return true;
  }
  bool evaluate_equations(const Residual& residual, const std::vector<int>& equations,
                          const std::vector<double>& WT, const std::vector<int>& free,
                          const std::vector<int>& algebraic) {
    h = Dense::Zero(static_cast<Eigen::Index>(equations.size()), C.cols());
    std::vector<int> all(y.size());
    std::iota(all.begin(), all.end(), 0);
    std::vector<double> weights(WT);
    for (double& w : weights) w = w > 0.0 ? 1.0 / w : 0.0;
    Differences of_F(
        {equations, {equations.size(), all}, {}, {}}, residual, [&] { return weights.data(); },
        static_cast<int>(y.size()));
    if (of_F.entries(y.data(), h.data()) != 0 || !finish(&h, WT, free)) return false;
    Dense part(h.rows(), static_cast<Eigen::Index>(algebraic.size()));
    for (Eigen::Index k = 0; k < part.cols(); ++k) part.col(k) = h.col(algebraic[at(k)]);
    factors.factor(part.transpose());
    return true;
  }
  // False: h leaves something of the algebraic part of this row, of C or grown.
  bool explain(const Dense& rows, int row, const std::vector<int>& algebraic,
               Eigen::VectorXd* x) const {
    Eigen::VectorXd part(static_cast<Eigen::Index>(algebraic.size()));
    for (Eigen::Index k = 0; k < part.size(); ++k) part[k] = rows(row, algebraic[at(k)]);
    *x = factors.solve(part);
    const double largest = x->size() > 0 ? x->lpNorm<Eigen::Infinity>() : 0.0;
    for (double& share : *x)
      if (std::abs(share) < kQuotientRounding * largest) share = 0.0;
    Eigen::VectorXd made = Eigen::VectorXd::Zero(part.size());
    for (Eigen::Index i = 0; i < x->size(); ++i)
      for (Eigen::Index k = 0; k < part.size(); ++k) made[k] += (*x)[i] * h(i, algebraic[at(k)]);
    return (made - part).norm() <= kProductRounding * part.norm();
  }

 private:
  // Columns in tolerances, rows to length 1, entries of rounding size to zero.
  static bool finish(Dense* a, const std::vector<double>& WT, const std::vector<int>& free) {
    if (!a->allFinite()) return false;
    Eigen::RowVectorXd size = Eigen::RowVectorXd::Zero(a->cols());
    for (int j : free) size[j] = WT[at(j)] > 0.0 ? WT[at(j)] : 1.0;
    a->array().rowwise() *= size.array();
    for (Eigen::Index i = 0; i < a->rows(); ++i) {
      const double length = a->row(i).norm();
      if (length > 0.0) a->row(i) /= length;
      for (Eigen::Index j = 0; j < a->cols(); ++j)
        if (std::abs((*a)(i, j)) < kQuotientRounding) (*a)(i, j) = 0.0;
    }
    return true;
  }
};

}  // namespace

// For each row whether it is, up to a factor, an equation of F without y': compares values at
// points in three directions, far enough away that rounding stays below the tenth digit. Rows that
// only touch an equation differ in the fifth. The last point is the first one with algebraic
// variables on the other side of y: the row contains them as the equation does, however weakly.
// Costs four evaluations of F.
static std::vector<char> repeat_equations(Evaluator& rows, const Residual& residual,
                                          const std::vector<char>& derivative_free, double t,
                                          const std::vector<double>& y,
                                          const std::vector<double>& WT, const double* id) {
  constexpr std::array<double, 3> directions = {2.9, 5.3, 8.1};
  constexpr std::size_t kLast = directions.size();
  constexpr double kSame = 1e-8, kSameChange = 1e-3, kRoundingOfChange = 1e-12;
  const std::vector<double> far = further_away(y, WT);
  std::vector<double> points[kLast + 1], g[kLast + 1], f[kLast + 1];
  for (std::size_t k = 0; k <= kLast; ++k) {
    points[k] = k < kLast ? y : points[0];
    for (std::size_t j = 0; j < y.size(); ++j) {
      if (k < kLast)
        points[k][j] += std::sin(1.0 + directions[k] * static_cast<double>(j)) * (far[j] - y[j]);
      else if (id[j] == 0.0)
        points[k][j] = 2.0 * y[j] - points[0][j];
    }
    g[k].resize(at(rows.rows()));
    f[k].resize(y.size());
    const auto n = static_cast<int>(y.size());
    if (rows.value(t, points[k].data(), n, g[k].data()) != Status::success ||
        !residual(points[k].data(), f[k].data()))
      return {};
  }
  const auto repeats_equation = [&](std::size_t i, std::size_t e) {
    bool same = g[0][i] != 0.0 && f[0][e] != 0.0;
    for (std::size_t k = 1; k < kLast; ++k) {
      const double a = g[k][i] * f[0][e], b = g[0][i] * f[k][e];
      same = same && std::abs(a - b) <= kSame * std::abs(a);
    }
    const double change = g[kLast][i] - g[0][i];
    const double a = change * f[0][e], b = g[0][i] * (f[kLast][e] - f[0][e]);
    return same && std::abs(change) > kRoundingOfChange * std::abs(g[0][i]) &&
           std::abs(a - b) <= kSameChange * std::abs(a);
  };
  std::vector<char> taken(y.size(), 0), repeats(g[0].size(), 0);
  for (std::size_t i = 0; i < repeats.size(); ++i)
    for (std::size_t e = 0; repeats[i] == 0 && e < y.size(); ++e)
      if (derivative_free[e] && !taken[e] && repeats_equation(i, e)) repeats[i] = taken[e] = 1;
  return repeats;
}

// Those of the rows `which` that constrain the differential variables in a direction that is not in
// `plain`.
static std::vector<int> rows_in_new_directions(const std::vector<int>& which, const Span& plain,
                                               const std::vector<int>& algebraic,
                                               const Point& here) {
  std::vector<int> rows;
  Eigen::VectorXd x;
  for (int i : which) {
    if (!here.explain(here.C, i, algebraic, &x)) continue;
    Eigen::VectorXd reduced = here.C.row(i).transpose() - here.h.transpose() * x;
    for (int j : algebraic) reduced[j] = 0.0;
    if (plain.rest(reduced).norm() > kRestricts * (1.0 + x.norm())) rows.push_back(i);
  }
  return rows;
}

// For each equation whether one of these rows needs it, or will need it where entries grow. Keeps
// the rows that the equations explain at both points.
static std::vector<char> equations_for(std::vector<int>* rows, const std::vector<int>& algebraic,
                                       const Point& away, const Point& here) {
  std::vector<char> used(at(here.h.rows()), 0);
  Eigen::VectorXd x, x_here;
  const auto explained = [&](int i, const Dense Point::*C) {
    return away.explain(away.*C, i, algebraic, &x) && here.explain(here.*C, i, algebraic, &x_here);
  };
  const auto use = [&] {
    for (Eigen::Index e = 0; e < x.size(); ++e)
      if (x[e] != 0.0 || x_here[e] != 0.0) used[at(e)] = 1;
  };
  std::vector<int> kept;
  for (int i : *rows) {
    if (!explained(i, &Point::C)) continue;
    kept.push_back(i);
    use();
    if (explained(i, &Point::grown)) use();
  }
  *rows = kept;
  return used;
}

// Marks the algebraic variables that these rows and equations contain at one of the points.
static std::vector<char> algebraic_in(
    const std::vector<int>& rows, const std::vector<char>& used, const std::vector<int>& algebraic,
    std::initializer_list<std::reference_wrapper<const Point>> points) {
  std::vector<char> found;
  for (const Point& point : points) {
    found.resize(point.y.size(), 0);
    const auto mark = [&](const Dense& a, int i) {
      for (int j : algebraic)
        if (a(i, j) != 0.0) found[at(j)] = 1;
    };
    for (int i : rows) mark(point.grown, i);
    for (std::size_t e = 0; e < used.size(); ++e)
      if (used[e]) mark(point.h, static_cast<int>(e));
  }
  return found;
}

// The unknowns that the equations notice, by large changes near a point where nothing is zero.
static void find_columns(const Residual& residual, double t, const std::vector<double>& point,
                         RowsReport& report, JoinedEquations* found) {
  const auto n = static_cast<int>(point.size());
  found->columns.assign(found->equations.size(), {});
  Constraints set = as_constraints(*found, residual, {}, n);
  set.jacobian = FiniteDifferences();
  Statistics uncounted;
  Evaluator equations(set, uncounted, &report);
  const std::vector<double> any_scale(point.size(), 0.0);
  equations.sensitive(t, point.data(), n, any_scale.data(), [found](int i, int j) {
    std::vector<int>& columns = found->columns[at(i)];
    if (columns.empty() || columns.back() != j) columns.push_back(j);
  });
}

JoinedEquations find_joined_equations(Evaluator& rows, const Residual& residual,
                                      const std::function<std::vector<char>()>& derivative_free,
                                      double t, const std::vector<double>& y,
                                      const std::vector<double>& WT, const std::vector<bool>& hold,
                                      const double* id, bool index_is_low) {
  JoinedEquations found;
  const auto n = static_cast<int>(y.size());
  std::vector<int> free, algebraic;
  for (int j = 0; j < n; ++j) {
    if (!hold.empty() && hold[at(j)]) continue;
    free.push_back(j);
    if (id[j] == 0.0) algebraic.push_back(j);
  }
  // Away from the candidate structural entries are not zero; at the candidate they have their size.
  Point away{further_away(y, WT), {}, {}, {}}, here{y, {}, {}, {}};
  if (algebraic.empty() || !here.evaluate_rows(rows, t, WT, free, algebraic)) return found;
  if (!away.evaluate_rows(rows, t, WT, free, algebraic)) {
    away.y = some_tolerances_away(y, WT);
    if (!away.evaluate_rows(rows, t, WT, free, algebraic)) return found;
  }
  if (!here.hangs && !away.hangs) return found;
  const std::vector<char> is_equation = derivative_free();
  found.repeats = repeat_equations(rows, residual, is_equation, t, y, WT, id);

  const int m = rows.rows();
  const auto contains = [&](int i, int j) { return away.C(i, j) != 0.0 || here.C(i, j) != 0.0; };
  std::vector<int> hanging, of_differential, equations;
  for (int i = 0; i < m; ++i) {
    const bool hangs =
        std::any_of(algebraic.begin(), algebraic.end(), [&](int j) { return contains(i, j); });
    (hangs ? hanging : of_differential).push_back(i);
  }
  if (hanging.empty()) return found;
  for (int i = 0; i < n; ++i)
    if (is_equation[at(i)]) equations.push_back(i);
  const bool all_repeat =
      !found.repeats.empty() &&
      std::all_of(hanging.begin(), hanging.end(), [&](int i) { return found.repeats[at(i)]; });
  if (index_is_low && all_repeat) return found;
  if (equations.empty() || !here.evaluate_equations(residual, equations, WT, free, algebraic))
    return found;

  Span plain;
  for (int i : of_differential) plain.add(here.C.row(i).transpose(), kQuotientRounding);
  std::vector<int> joint = rows_in_new_directions(hanging, plain, algebraic, here);
  if (joint.empty() || !away.evaluate_equations(residual, equations, WT, free, algebraic))
    return found;
  const std::vector<char> used = equations_for(&joint, algebraic, away, here);
  if (joint.empty()) return found;
  found.moves = algebraic_in(joint, used, algebraic, {away, here});
  // Rows without other algebraic variables move with them. Equations that they repeat are left out.
  Span together;
  const auto follows = [&](int j) { return id[j] == 0.0 && !found.moves[at(j)]; };
  for (int i = 0; i < m; ++i) {
    bool other = false;
    for (int j : algebraic) other = other || (follows(j) && contains(i, j));
    if (!other) together.add(here.C.row(i).transpose(), kQuotientRounding);
  }
  for (std::size_t e = 0; e < used.size(); ++e) {
    const auto k = static_cast<Eigen::Index>(e);
    if (!used[e] || !together.add(here.h.row(k).transpose(), kProductRounding)) continue;
    found.equations.push_back(equations[e]);
  }
  find_columns(residual, t, further_away(y, WT), rows.report, &found);
  return found;
}

Constraints as_constraints(const JoinedEquations& found, Residual residual,
                           std::function<const double*()> weights, int size) {
  const auto equations =
      std::make_shared<Differences>(found, std::move(residual), std::move(weights), size);
  Constraints set;
  set.count = static_cast<int>(found.equations.size());
  for (int i : found.equations) set.names.push_back("equation " + std::to_string(i) + " of F");
  set.value = [equations](double, ConstVector y, Vector g) {
    return equations->value(y.data(), g.data());
  };
  SparseJacobian jacobian;
  jacobian.starts.push_back(0);
  for (const std::vector<int>& columns : found.columns) {
    jacobian.columns.insert(jacobian.columns.end(), columns.begin(), columns.end());
    jacobian.starts.push_back(static_cast<int>(jacobian.columns.size()));
  }
  jacobian.fill = [equations](double, ConstVector y, Vector entries) {
    return equations->entries(y.data(), entries.data());
  };
  set.jacobian = std::move(jacobian);
  return set;
}

}  // namespace tether::ida_projection
