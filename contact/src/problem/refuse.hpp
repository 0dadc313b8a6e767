// Tether: bad input is refused. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <string>
#include <tether/contact/body_solver.hpp>
#include <tether/linalg/symmetric_eigen.hpp>

namespace tether::contact::detail {

// A number of a message: nine digits, the same in every locale.
std::string shown(double value);

// std::invalid_argument "argument = value: wanted", wanted: what would be right.
[[noreturn]] void refuse(const std::string& argument, double value, const char* wanted);
[[noreturn]] void refuse_size(const std::string& argument, Eigen::Index entries,
                              Eigen::Index needed, const std::string& why);

// The enumerator as text, by a list of all.
template <class Enum, std::size_t n>
const char* text(Enum value, const char* const (&names)[n]) {
  return static_cast<std::size_t>(value) < n ? names[static_cast<std::size_t>(value)] : "?";
}

inline void require(bool holds, const char* argument, double value, const char* wanted) {
  if (!holds) refuse(argument, value, wanted);
}
// Every entry finite; names the first one that is not. `where` comes before the argument.
void require_finite(const char* argument, const Eigen::Ref<const Eigen::MatrixXd>& values,
                    const std::string& where = {});

// An argument of `needed` entries, or none.
inline void check_entries(const char* argument, const Eigen::Ref<const Eigen::VectorXd>& v,
                          Eigen::Index needed, const char* why) {
  if (v.size() != 0 && v.size() != needed) refuse_size(argument, v.size(), needed, why);
  require_finite(argument, v);
}

// Symmetric to 1e-8 and without eigenvalues below -1e-8 of the trace; names the entry or the
// eigenvalue that is not. where() comes before the argument.
template <class Derived, class Where>
void require_semidefinite(const char* argument, const Eigen::MatrixBase<Derived>& A,
                          const Where& where) {
  constexpr int n = Derived::RowsAtCompileTime;
  constexpr double kSmall = 1e-8;
  const double trace = A.diagonal().cwiseAbs().sum(), most = kSmall * trace;
  for (int c = 0; c < n; ++c) {
    for (int r = c + 1; r < n; ++r) {
      if (std::abs(A(r, c) - A(c, r)) <= most) continue;
      refuse(where() + argument + "(" + std::to_string(r) + ", " + std::to_string(c) + ")", A(r, c),
             ("must be " + std::string(argument) + "(" + std::to_string(c) + ", " +
              std::to_string(r) + "): the matrix is symmetric")
                 .c_str());
    }
  }
  if (!(trace > 0)) return;
  // A Cholesky factor of a slightly raised matrix costs far less than eigenvalues.
  Eigen::Matrix<double, n, n> raised = A / trace;
  raised.diagonal().array() += kSmall;
  if (Eigen::LLT<Eigen::Matrix<double, n, n>>(raised).info() == Eigen::Success) return;
  const double least = linalg::symmetric_eigenvalues(A)[0];
  refuse(where() + "least eigenvalue of " + argument, least, "must be >= 0");
}

// For delassus(): also refuses contacts between bodies that do not exist, or of one body.
void check(const std::vector<RigidBody>& bodies, const std::vector<ContactRows>& contacts);
// Body k, and contact i between `count` bodies.
void check(std::size_t k, const RigidBody& body);
void check(std::size_t i, const PointContact& contact, int count);
[[noreturn]] void refuse_fixed(std::size_t i);  // neither body of contact i moves

}  // namespace tether::contact::detail
