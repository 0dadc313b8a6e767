// Tether: difference quotients and plain IDA, to judge the test problems. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <Eigen/Dense>
#include <problems/problem.hpp>
#include <random>
#include <string>
#include <vector>

namespace tether::problems::test {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr double kThirdTurn = 2.09439510239319549231;

Eigen::VectorXd vector(const std::vector<double>& from);
/// The group of that name; null: there is none.
const Rows* find(const Problem& problem, const std::string& name);
/// Name and form.
std::string label(const Problem& problem);

/// g(t, y) and its given Jacobian, of a single group.
Eigen::VectorXd value(const Rows& rows, double t, const Eigen::VectorXd& y);
RowMajor jacobian(const Rows& rows, double t, const Eigen::VectorXd& y);

/// dg/dy and dg/dt by central differences, extrapolated twice.
RowMajor differences(const Rows& rows, double t, const Eigen::VectorXd& y);
Eigen::VectorXd time_differences(const Rows& rows, double t, const Eigen::VectorXd& y);

Eigen::VectorXd residual(const Problem& problem, double t, const Eigen::VectorXd& y,
                         const Eigen::VectorXd& yp);
Eigen::MatrixXd residual_differences(const Problem& problem, double t, double cj,
                                     const Eigen::VectorXd& y, const Eigen::VectorXd& yp);

/// A time and a state near the start or near the end, not on any constraint.
Eigen::VectorXd random_state(const Problem& problem, std::mt19937& random, double* t);

/// Gauss-Newton onto the named groups (all when empty), minimum norm, rank deficient or not.
Eigen::VectorXd project(const Problem& problem, double t, Eigen::VectorXd y,
                        const std::vector<std::string>& names = {});

/// y' of the differential unknowns from the differential equations, which come first in F and are
/// linear in them; zero for the others.
Eigen::VectorXd derivative(const Problem& problem, double t, const Eigen::VectorXd& y);

/// Both y' of the differential and the values of the algebraic unknowns from F = 0, index 1, where
/// F is affine in them.
Eigen::VectorXd motion(const Problem& problem, double t, Eigen::VectorXd* y);

/// Plain IDA from t0 to t_end, dense LU, difference Jacobian or the problem's own, algebraic
/// variables out of the error test. Throws std::runtime_error with IDA's flag.
Eigen::VectorXd integrate(const Problem& problem, double rtol, double atol, long* steps = nullptr,
                          bool analytic = false);

}  // namespace tether::problems::test
