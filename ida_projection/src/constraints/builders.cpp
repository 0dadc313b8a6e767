// Tether: constraint sets that people ask for most. SPDX-License-Identifier: BSD-3-Clause
#include <stdexcept>
#include <tether/ida_projection/builders.hpp>

namespace tether::ida_projection {

Constraints quaternion_norm(int first, std::string name) {
  if (first < 0)
    throw std::invalid_argument("quaternion_norm: first = " + std::to_string(first) +
                                "; it must be >= 0");
  Constraints set;
  set.count = 1;
  set.names = {std::move(name)};
  set.value = [first](double, ConstVector y, Vector g) {
    const double* q = y.data() + first;
    g[0] = 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0);
  };
  set.jacobian = DenseJacobian([first](double, ConstVector y, Matrix C) {
    for (int k = 0; k < 4; ++k) C(0, first + k) = y[first + k];
  });
  set.least_unknowns = static_cast<long>(first) + 4;
  return set;
}

Constraints linear_invariant(std::vector<double> coefficients, double value, std::string name) {
  Constraints set;
  set.count = 1;
  set.names = {std::move(name)};
  const Eigen::VectorXd a = Eigen::Map<const Eigen::VectorXd>(
      coefficients.data(), static_cast<Eigen::Index>(coefficients.size()));
  set.value = [a, value](double, ConstVector y, Vector g) { g[0] = a.dot(y) - value; };
  set.jacobian = DenseJacobian([a](double, ConstVector, Matrix C) { C.row(0) = a.transpose(); });
  set.least_unknowns = set.most_unknowns = static_cast<long>(coefficients.size());
  return set;
}

Constraints invariant(ScalarFunction H, GradientFunction gradient, double value, std::string name) {
  return energy(std::move(H), std::move(gradient), value, -1, std::move(name));
}

Constraints energy(ScalarFunction H, GradientFunction gradient, double value, int work,
                   std::string name) {
  if (!H) throw std::invalid_argument("energy: H is empty; give the function H(y)");
  if (!gradient) throw std::invalid_argument("energy: gradient is empty; give dH/dy");
  if (work < -1)
    throw std::invalid_argument("energy: work = " + std::to_string(work) +
                                "; it must be the index of the work state, or -1 for none");
  Constraints set;
  set.count = 1;
  set.names = {std::move(name)};
  set.value = [H = std::move(H), value, work](double, ConstVector y, Vector g) {
    g[0] = H(y) - value - (work >= 0 ? y[work] : 0.0);
  };
  set.jacobian =
      DenseJacobian([gradient = std::move(gradient), work](double, ConstVector y, Matrix C) {
        gradient(y, Vector(C.data(), C.cols()));
        if (work >= 0) C(0, work) -= 1.0;
      });
  set.least_unknowns = static_cast<long>(work) + 1;
  return set;
}

}  // namespace tether::ida_projection
