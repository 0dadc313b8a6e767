// Tether: small assemblies of bodies in contact. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/bodies.hpp>
#include <tether/contact/body_solver.hpp>

#include "random_contacts.hpp"

namespace tether::contact::random {

struct Assembly {
  std::vector<RigidBody> bodies;
  std::vector<ContactRows> contacts;
  Problem problem() const { return delassus(bodies, contacts); }
};

RigidBody box(double mass, const Eigen::Vector3d& half);

RigidBody sphere(double mass, double radius);

// n unit cubes on the ground, four contacts a level, the top one `ratio` times heavier; one step of
// gravity, with a small push so that the data are not symmetric.
Assembly stack(int n, double ratio, double mu = 0.5);

struct RigidAssembly {
  std::vector<RigidBody> bodies;
  std::vector<PointContact> contacts;
  Problem problem() const { return delassus(bodies, to_contacts(contacts)); }
  // A contact without id; the normal, of any length, points to the first body.
  void touch(int first, int second, const Eigen::Vector3d& r1, const Eigen::Vector3d& r2,
             const Eigen::Vector3d& normal, double mu);
  // Another assembly beside this one; ids continue.
  void add(const RigidAssembly& other);
};

// stack() for BodySolver; contacts have ids 0, 1, ...
RigidAssembly rigid_stack(int n, double ratio, double mu = 0.5);

// Boxes that lie on each other a little aside, each with a velocity and a spin of its own, every
// other one a million times as heavy: boxes 0, 2, ... if heavy = 1, else 1, 3, ...
RigidAssembly moving_stack(int n, int heavy, Generator& g);

// Five bodies with random inertia, twelve random contacts.
Assembly cluster(Generator& g, double mu, int bodies = 5, int contacts = 12);

// Contacts in random order with randomly turned tangents: the same problem to the eye.
Problem shuffled(const Problem& p, Generator& g, std::vector<int>* order = nullptr);

}  // namespace tether::contact::random
