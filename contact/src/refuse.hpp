// Tether: bad input is refused. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>
#include <tether/contact/body_solver.hpp>

namespace tether::contact::detail {

// std::invalid_argument "argument = value: wanted", wanted: what would be right.
[[noreturn]] void refuse(const std::string& argument, double value, const char* wanted);
[[noreturn]] void refuse_size(const std::string& argument, Eigen::Index entries,
                              Eigen::Index needed, const std::string& why);

inline void require(bool holds, const char* argument, double value, const char* wanted) {
  if (!holds) refuse(argument, value, wanted);
}
// Every entry finite; names the first one that is not. `where` comes before the argument.
void require_finite(const char* argument, const Eigen::Ref<const Eigen::MatrixXd>& values,
                    const std::string& where = {});

// Body k of BodySolver, and contact i between `count` bodies.
void check(std::size_t k, const RigidBody& body);
void check(std::size_t i, const PointContact& contact, int count);

}  // namespace tether::contact::detail
