// Tether: what is wrong with rows at a point. SPDX-License-Identifier: BSD-3-Clause
#include "watch/row_faults.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "host/shortest.hpp"
#include "start/algebraic.hpp"
#include "start/linear_system.hpp"

namespace tether::ida_projection {

namespace {

constexpr double kReach = 1e-4, kDiffer = 0.1;  // of y; of the slopes
constexpr double kWrong = 1e-3;                 // of the row's largest entry

}  // namespace

bool RowFaults::may_search(std::size_t n) const {
  return has_values(constraints_) && n <= static_cast<std::size_t>(kLargestProbed);
}

void RowFaults::reserve(std::size_t n) {
  moved_.resize(n);
  evaluator_.reserve(static_cast<int>(n));
  const auto m = static_cast<std::size_t>(evaluator_.rows());
  for (std::vector<double>* g : {&here_, &sides_[0], &sides_[1], &sides_[2], &sides_[3]})
    g->resize(m);
}

std::string RowFaults::name(int row) const {
  return "row " + std::to_string(row) + " (" + constraints_.name(row) + ")";
}

bool RowFaults::value(double t, const std::vector<double>& y, std::vector<double>& g) {
  g.resize(static_cast<std::size_t>(evaluator_.rows()));
  return evaluator_.value(t, y.data(), static_cast<int>(y.size()), g.data()) == Status::success;
}

bool RowFaults::jacobian(double t, const std::vector<double>& y, const std::vector<double>& WT) {
  std::vector<int> columns(y.size());
  std::iota(columns.begin(), columns.end(), 0);
  C_.resize(static_cast<std::size_t>(evaluator_.rows()) * y.size());
  return evaluator_.jacobian(t, y.data(), static_cast<int>(y.size()), WT.data(), columns,
                             C_.data()) == Status::success;
}

std::string RowFaults::wrong_entry(double t, const std::vector<double>& y) {
  try {
    const JacobianReport report = check_jacobian(constraints_, t, y, kWrong);
    return report.correct ? std::string() : report.message;
  } catch (const std::exception&) {  // g refuses a point nearby: nothing is known
    return {};
  }
}

std::string RowFaults::unkept(double t, const std::vector<double>& y, const std::vector<double>& yp,
                              const std::vector<double>& WT) {
  std::vector<double> rate, in_time, terms;
  if (!rates(t, y, yp, rate) || !rates(t, y, std::vector<double>(y.size(), 0.0), in_time) ||
      !jacobian(t, y, WT))
    return {};
  std::size_t worst = 0;
  for (std::size_t i = 0; i < rate.size(); ++i) {
    terms.push_back(std::abs(in_time[i]));
    for (std::size_t j = 0; j < y.size(); ++j) terms[i] += std::abs(C_[i * y.size() + j] * yp[j]);
    if (std::abs(rate[i]) * terms[worst] > std::abs(rate[worst]) * terms[i]) worst = i;
  }
  if (!(std::abs(rate[worst]) > kNoInvariant * terms[worst])) return {};
  return unkept_text(static_cast<int>(worst), "", rate[worst], terms[worst]);
}

std::string RowFaults::unkept_text(int row, const std::string& where, double rate,
                                   double terms) const {
  return "F does not keep " + name(row) + ": " + where + "C y' + g_t = " + brief(rate) +
         ", its terms sum up to " + brief(terms) +
         " in absolute value; check the row, its constants and F, or give also the rows without "
         "which F does not keep it";
}

// Two directions of no structure.
std::string RowFaults::one_sided(const std::vector<int>& rows, double t,
                                 const std::vector<double>& y) {
  if (!value(t, y, here_)) return {};
  for (const double turn : {3.7, 1.3}) {
    for (const int side : {0, 1}) {
      moved_ = y;
      for (std::size_t j = 0; j < y.size(); ++j)
        moved_[j] += (1 - 2 * side) * kReach * std::max(1.0, std::abs(y[j])) *
                     std::sin(1.0 + turn * static_cast<double>(j));
      if (!value(t, moved_, sides_[side])) return {};
    }
    for (const int row : rows) {
      const auto i = static_cast<std::size_t>(row);
      const double ahead = std::abs(sides_[0][i] - here_[i]);
      const double behind = std::abs(sides_[1][i] - here_[i]);
      if (ahead != behind && std::min(ahead, behind) <= kDiffer * std::max(ahead, behind))
        return name(row) +
               " and its gradient vanish to one side of the set; its slopes to both sides differ "
               "there: a row with |.| or max has no derivative on the set, write it without";
    }
  }
  return {};
}

std::vector<std::string> RowFaults::dependent(double t, const std::vector<double>& y,
                                              const std::vector<double>& WT) {
  std::vector<std::string> names;
  if (!may_search(y.size()) || !jacobian(t, y, WT)) return names;
  const auto n = static_cast<Eigen::Index>(y.size());
  Eigen::MatrixXd transposed = Eigen::Map<Eigen::MatrixXd>(C_.data(), n, evaluator_.rows());
  transposed.array().colwise() *= Eigen::Map<const Eigen::ArrayXd>(WT.data(), n);
  const std::vector<char> found = undetermined_columns(std::move(transposed), false);
  for (std::size_t i = 0; i < found.size(); ++i)
    if (found[i]) names.push_back(constraints_.name(static_cast<int>(i)));
  return names;
}

double RowFaults::fastest(double t, const std::vector<double>& y, const std::vector<double>& yp) {
  double rate = 1.0 / std::max(1.0, std::abs(t));
  for (std::size_t j = 0; j < y.size(); ++j)
    rate = std::max(rate, std::abs(yp[j]) / std::max(1.0, std::abs(y[j])));
  return rate;
}

bool RowFaults::rates(double t, const std::vector<double>& y, const std::vector<double>& yp,
                      std::vector<double>& out) {
  const double dt = std::cbrt(2e-16) / fastest(t, y, yp);
  const auto at = [&](double time, std::vector<double>& g) {
    moved_ = y;
    for (std::size_t j = 0; j < y.size(); ++j) moved_[j] += time * yp[j];
    return value(t + time, moved_, g);
  };
  if (!at(0.0, here_) || !at(dt, sides_[0]) || !at(2.0 * dt, sides_[1]) || !at(-dt, sides_[2]) ||
      !at(-2.0 * dt, sides_[3]))
    return false;
  out.resize(here_.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto slope = [&](int side, double reach) {
      return (4.0 * sides_[side][i] - sides_[side + 1][i] - 3.0 * here_[i]) / (2.0 * reach);
    };
    const double ahead = slope(0, dt), behind = slope(2, -dt);
    out[i] = !(ahead * behind > 0.0) ? 0.0 : std::abs(ahead) < std::abs(behind) ? ahead : behind;
  }
  return true;
}

}  // namespace tether::ida_projection
