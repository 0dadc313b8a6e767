// Tether: short ways to write groups of rows. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <problems/problem.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace tether::problems {

/// value(t, y, g) writes the m values, gradient(t, y, C) the non-zero entries of the m x N Jacobian
/// (row-major, leading dimension N, zero on entry); m = row_names.size().
template <class Value, class Gradient>
Rows make_rows(std::string name, std::vector<std::string> row_names, Value value,
               Gradient gradient) {
  Rows rows;
  rows.name = std::move(name);
  rows.constraints.count = static_cast<int>(row_names.size());
  rows.constraints.names = std::move(row_names);
  rows.constraints.value = [value](double t, ida_projection::ConstVector y,
                                   ida_projection::Vector g) { value(t, y.data(), g.data()); };
  rows.constraints.jacobian = ida_projection::DenseJacobian(
      [gradient](double t, ida_projection::ConstVector y, ida_projection::Matrix C) {
        gradient(t, y.data(), C.data());
      });
  return rows;
}

/// The same; both(t, y, g, C) gives values and gradients together, with the same bits.
template <class Value, class Gradient, class Both>
Rows make_rows(std::string name, std::vector<std::string> row_names, Value value, Gradient gradient,
               Both both) {
  Rows rows =
      make_rows(std::move(name), std::move(row_names), std::move(value), std::move(gradient));
  std::get<ida_projection::DenseJacobian>(rows.constraints.jacobian).fill_with_value =
      [both](double t, ida_projection::ConstVector y, ida_projection::Vector g,
             ida_projection::Matrix C) { both(t, y.data(), g.data(), C.data()); };
  return rows;
}

/// A problem whose unknowns are all compared: name, form, index, end and consistent start.
inline Problem start_problem(std::string name, std::string form, int index, double t_end,
                             std::vector<double> y0, std::vector<double> yp0,
                             std::vector<double> id) {
  Problem p;
  p.name = std::move(name);
  p.form = std::move(form);
  p.index = index;
  p.size = static_cast<int>(y0.size());
  p.error_components = p.size;
  p.t_end = t_end;
  p.y0 = std::move(y0);
  p.yp0 = std::move(yp0);
  p.id = std::move(id);
  return p;
}

/// Throws std::invalid_argument that lists what there is.
[[noreturn]] inline void unknown_form(const std::string& problem, const std::string& form,
                                      const std::vector<std::string>& forms) {
  std::string message = problem + ": no form \"" + form + "\"; there are";
  for (const std::string& known : forms) message += " \"" + known + "\"";
  throw std::invalid_argument(message);
}

}  // namespace tether::problems
