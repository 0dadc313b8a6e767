// Tether: impulses that hold all contacts of a mechanism. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace tether::contact::detail {

/// Where contacts share their forces in more than one way (four wheels of a cart), an iteration may
/// end at any lawful split, and once it has left that of the steps before it stays with the other:
/// wheels without load need not roll. So the least x, each row in its own scale, that leaves
/// w = A x - b = 0 is looked at first: it hangs on nothing but A and b. Sets x to that and returns
/// true where normals depend on each other and Coulomb's law allows it. (Slips that do so, in a
/// chain that lies on the floor, would hold all by stress along it: it left its rest.)
bool hold_all(const Eigen::Ref<const Eigen::MatrixXd>& A, const Eigen::VectorXd& b,
              const Eigen::VectorXd& mu, double tolerance, Eigen::VectorXd& x);

}  // namespace tether::contact::detail
