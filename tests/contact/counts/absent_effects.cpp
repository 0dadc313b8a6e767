// Takes the place of what a frictionless scene of spheres does not name: friction (all kernels but
// the frictionless one, and the stages for assembled islands, which contain the laws), rolling
// friction, restitution, gyroscopic terms. Whoever calls one of them fails.
// SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <cstdlib>

#include "body_passes/body_kernels.hpp"
#include "joints/cone_islands.hpp"
#include "stepping/impacts/restitution.hpp"
#include "stepping/motion/rotation.hpp"

namespace tether::contact {
namespace {
[[noreturn]] void absent(const char* what) {
  std::fprintf(stderr, "called though the scene does not name it: %s\n", what);
  std::abort();
}
}  // namespace

struct Solver::Implementation {};
Solver::Solver(const Options&) { absent("assembled islands"); }
Solver::~Solver() = default;
Solution Solver::solve(const Problem&, const linalg::VectorView&) { absent("assembled islands"); }
Problem delassus(const std::vector<RigidBody>&, const std::vector<ContactRows>&) {
  absent("assembled islands");
}
Residuals evaluate(const std::vector<RigidBody>&, const std::vector<PointContact>&, Law,
                   const std::vector<Eigen::Vector3d>&) {
  absent("assembled islands");
}

namespace detail {
using S = const BodyArrays&;
Squares pass(S, Law, GeneralContact*, GeneralContact*, Coupled) { absent("friction"); }
Squares pass(S, Law, SphereContact*, SphereContact*, Coupled) { absent("friction"); }
Squares pass(S, Law, GeneralGroup*, GeneralGroup*, Coupled) { absent("friction"); }
Squares pass(S, Law, SphereGroup*, SphereGroup*, Coupled) { absent("friction"); }

ConeIslands::ConeIslands(ConeSources& sources, LawUse, const BodyOptions&)
    : mechanisms_(sources.mechanisms), moments_(own_), solver_(Options()) {
  absent("joints");
}
void ConeIslands::solve(BodySolver&, const std::vector<RigidBody>&,
                        const std::vector<PointContact>&, BodySolution&) {
  absent("joints");
}
void ConeIslands::set_options(const BodyOptions&) { absent("joints"); }

Restitution::Restitution(RestitutionLaw, const BodyOptions& options, ConeSources& sources,
                         LawUse use)
    : sources_(sources), solver_(options, sources, use) {
  absent("restitution");
}
void Restitution::choose(const Impacts&, const std::vector<Strike>&, const BodySet&,
                         StepContacts&) {
  absent("restitution");
}
int Restitution::apply(BodySet&, StepContacts&) { absent("restitution"); }

using M = const Eigen::Matrix3d&;
using V = const Eigen::Vector3d&;
Eigen::Vector3d gyroscopic_explicit(M, M, const linalg::Quaternion&, V, double) {
  absent("gyroscopic term");
}
Eigen::Vector3d gyroscopic_implicit(M, const linalg::Quaternion&, V, double) {
  absent("gyroscopic term");
}
void turn_with_momentum(M, M, double, linalg::Quaternion&, Eigen::Vector3d&, StepperMemory::Spin&) {
  absent("gyroscopic term");
}
}  // namespace detail
}  // namespace tether::contact
