// Tether: what the guide's code takes for granted in a simulator. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cstdio>
#include <tether/contact.hpp>
#include <tether/contact/cones.hpp>
#include <tether/contact/stepping.hpp>
#include <vector>

extern Eigen::MatrixXd A;
extern Eigen::VectorXd b, mu, db, compliance;
extern Eigen::Matrix3d inertia;
extern std::vector<tether::contact::MatrixEntry> entries;
extern std::vector<tether::contact::RigidBody> bodies;
extern std::vector<tether::contact::PointContact> contacts;
extern tether::contact::Options options;
extern tether::contact::Problem problem;
extern tether::contact::Solution solution;
extern Eigen::VectorXd row;
extern int steps;
