// Tether: edges of polyhedra that touch. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "stepping/detection/polyhedra/separating_axes.hpp"

namespace tether::contact::detail {

// Nearest points of the segments p .. p + u and q .. q + v.
void nearest(const Eigen::Vector3d& p, const Eigen::Vector3d& u, const Eigen::Vector3d& q,
             const Eigen::Vector3d& v, Eigen::Vector3d& on_first, Eigen::Vector3d& on_second);

// Contact of the two edges of an axis. A distance from the axis below `tie` is rounding.
void crossing_edges(const Placed& a, const Placed& b, const EdgeAxis& axis, double tie,
                    double margin, NearPoints& out);
// Contacts of the edges or corners that are farthest along the unit vector m, which points from a
// to b.
void edge_along_edge(const Placed& a, const Placed& b, const Eigen::Vector3d& m, double rounding,
                     double margin, NearPoints& out);

}  // namespace tether::contact::detail
