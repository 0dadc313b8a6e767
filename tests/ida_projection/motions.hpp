// Tether: smooth motions with invariants, each in several forms. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <problems/problem.hpp>
#include <string>

namespace tether::test {

/// A point (mass 1) on a sphere of radius 1, gravity 1, from 1 rad off the lowest point with
/// speed 1.5 along the parallel. Forms of problems/mechanism.hpp; every absolute tolerance is the
/// same. Rows "position", "velocity", "energy", "momentum" (about the vertical).
problems::Problem spherical_pendulum(const std::string& form, double t_end);

/// `count` points (mass 1) on the unit sphere, repelling each other with the inverse square of
/// their distance: 8 count unknowns in form "GGL". "index 0", "index 1", "index 2", "GGL" as in
/// mechanism.hpp. Rows "sphere" (positions, then velocities), "energy".
problems::Problem points_on_sphere(int count, const std::string& form, double t_end);

/// Four point vortices in the plane, of strengths of both signs; 8 unknowns. Rows "all": impulse
/// (2), angular impulse, Hamiltonian.
problems::Problem vortices(double t_end);

/// A symmetric top under gravity (moments of inertia 1, 1, 0.5; m g l = 1) by a quaternion and its
/// angular velocity in the body. Rows "all": norm, energy, momentum about the vertical and the
/// axis.
problems::Problem lagrange_top(double t_end);

/// Three bodies of mass 1 on the figure eight of Chenciner and Montgomery (Annals of Mathematics
/// 152 (2000) 881-901); 12 unknowns. Rows "all": centre of mass and momentum, energy, angular
/// momentum.
problems::Problem figure_eight(double t_end);

}  // namespace tether::test
