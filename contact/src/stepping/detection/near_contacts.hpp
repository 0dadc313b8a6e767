// Tether: contacts of a set of bodies. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <tether/contact/stepping.hpp>
#include <utility>
#include <vector>

#include "stepping/detection/broadphase.hpp"
#include "stepping/detection/mesh/mesh_contacts.hpp"
#include "stepping/detection/polyhedra/polyhedra.hpp"

namespace tether::contact::detail {

/// Velocity of a at the contact against that of b.
Eigen::Vector3d relative_velocity(const RigidBody& a, const RigidBody& b,
                                  const PointContact& contact);
/// Normal velocity of separation.
double normal_velocity(const std::vector<RigidBody>& motion, const PointContact& contact);

/// Finds the points at which bodies are or, by their velocities, may come into contact in a step.
class NearContacts {
 public:
  /// Throws std::invalid_argument; see Stepper.
  NearContacts(const BodySet& bodies, std::vector<Surface> surfaces,
               const std::vector<Meeting>& meetings, Law law, double near_part);

  /// Fills points and gaps.
  void find(const BodySet& bodies, double dt, StepContacts& out);

  /// After find(), with other velocities at the same places: adds points whose bodies were too slow
  /// to reach each other and are no longer, if they would end the step deeper in each other than
  /// near_part of their size. False: none.
  bool find_more(const BodySet& bodies, double dt, StepContacts& out);

  /// After find(), which has found the contact: all points of its two surfaces where their bodies
  /// are now.
  void follow(const BodySet& bodies, const PointContact& contact, StepContacts& out);

  /// Bodies that stay where they are, of each body: they meet only what moves.
  void set_resting(const std::vector<char>& resting);

  const Surface& surface(int k) const { return surfaces_[static_cast<std::size_t>(k)]; }
  const Meeting& meeting(const PointContact& c) const;
  /// Distance of the farthest point of its smaller shape from that shape's origin, m.
  double size(const PointContact& c) const;
  bool any_restitution() const;
  bool any_rolling() const;

 private:
  void find_polyhedra(const BodySet& bodies);
  const Meeting* meeting_of(int a, int b) const;  // of surfaces; null: they pass through
  void place(const BodySet& bodies, double dt);
  void set_pose(const BodySet& bodies, int surface);
  double way(const BodySet& bodies, std::size_t k, double dt) const;
  template <class Use>
  void pairs(const BodySet& bodies, StepContacts& out, const Use& use);
  void pair(const BodySet& bodies, int a, int b, StepContacts& out);
  void find_points(int i, int j, double margin);

  std::vector<Surface> surfaces_;
  std::map<std::pair<int, int>, Meeting> meetings_;  // by materials, the lower one first
  Law law_;
  double near_part_;
  PolyhedraContacts polyhedra_;
  std::vector<Polyhedron> polyhedron_;  // of each surface; empty: none is needed
  std::vector<MeshContacts> meshes_;    // and of each surface its index there, or -1
  std::vector<int> mesh_;
  Broadphase broadphase_;
  std::vector<int> planes_, bounded_;  // surfaces
  std::vector<int> index_;             // of each surface: k in bounded_, or ~k in planes_
  // For each surface: its pose; for each bounded one: reach with and without what it may move.
  std::vector<Pose> pose_;
  std::vector<char> centred_;  // a sphere about the centre of its body
  std::vector<double> size_;   // of each surface: its reach, infinite for planes
  std::vector<double> reach_;
  std::vector<Eigen::Vector3d> centre_;
  std::vector<double> ball_;
  std::vector<char> still_, fixed_, faster_;
  StepContacts more_;
  std::vector<std::uint64_t> known_;  // identities of contacts
  NearPoints near_;
};

}  // namespace tether::contact::detail
