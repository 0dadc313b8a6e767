// Tether: contacts of a set of bodies. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <functional>
#include <map>
#include <tether/contact/stepping.hpp>
#include <utility>
#include <vector>

#include "stepping/detection/broadphase.hpp"
#include "stepping/detection/mesh/mesh_contacts.hpp"
#include "stepping/detection/polyhedra/polyhedra.hpp"
#include "stepping/detection/polyhedra/seams.hpp"

namespace tether::contact::detail {

/// Velocity of body a relative to body b at the contact.
Eigen::Vector3d relative_velocity(const RigidBody& a, const RigidBody& b,
                                  const PointContact& contact);
/// Normal component of the relative velocity; > 0: the bodies separate.
double normal_velocity(const std::vector<RigidBody>& motion, const PointContact& contact);

/// Finds the points at which bodies touch, or may touch within a step at their velocities.
class NearContacts {
 public:
  /// Throws std::invalid_argument; see Stepper.
  NearContacts(const BodySet& bodies, std::vector<Surface> surfaces,
               const std::vector<Meeting>& meetings, Law law, double near_part);

  /// Fills the points and gaps of `out` with all contacts of a step of dt.
  void find(const BodySet& bodies, double dt, StepContacts& out);

  /// After find(), when velocities have changed at the same positions: adds contacts of bodies that
  /// now are fast enough to reach each other. A contact is added if the bodies would end the step
  /// deeper in each other than near_part of their size. Returns whether any was.
  bool find_more(const BodySet& bodies, double dt, StepContacts& out);

  /// After find() has found this contact: fills `out` with all contacts of its two surfaces at the
  /// present positions of their bodies.
  void follow(const BodySet& bodies, const PointContact& contact, StepContacts& out);

  /// For each body, 1 if it rests. Pairs of bodies that rest or are fixed are left out.
  void set_resting(const std::vector<char>& resting);

  const Surface& surface(int k) const { return surfaces_[static_cast<std::size_t>(k)]; }
  const Meeting& meeting(const PointContact& c) const;
  /// Reach of the smaller shape of a contact: distance of its farthest point from its origin, m.
  double size(const PointContact& c) const;
  /// Whether has(m) is true for any meeting.
  template <class Has>
  bool any(const Has& has) const {
    for (const auto& each : meetings_)
      if (has(each.second)) return true;
    return false;
  }
  bool any_rolling() const { return any(std::mem_fn(&Meeting::rolls)); }
  bool any_elliptic() const { return has_friction_ && any(std::mem_fn(&Meeting::is_elliptic)); }
  /// Asked for in every sub-step.
  bool any_static() const { return static_meetings_ > 0; }
  /// Two tangents at right angles of a contact with elliptic friction, after find(): each as long
  /// as its coefficient over the larger one, which is PointContact::mu.
  std::array<Eigen::Vector3d, 2> scaled_tangents(const PointContact& c) const;

 private:
  void add_surface(int k, const BodySet& bodies);
  void find_polyhedra(const BodySet& bodies);
  void join_parts();
  void drop_seams(int first, int second);  // in near_
  void take_axes();
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
  const bool has_friction_;
  int static_meetings_ = 0;  // with friction
  double near_part_;
  PolyhedraContacts polyhedra_;
  Parts parts_;
  std::vector<MeshContacts> meshes_;
  std::vector<int> mesh_;  // of each surface: its index in meshes_, or -1
  Broadphase broadphase_;
  std::vector<int> planes_, bounded_;  // surfaces
  std::vector<int> index_;             // of each surface: k in bounded_, or ~k in planes_
  // For each surface.
  std::vector<char> centred_;          // whether it is a sphere about the centre of its body
  std::vector<double> size_;           // its reach, infinite for planes
  std::vector<int> with_axis_;         // surfaces with a friction_axis
  std::vector<Eigen::Vector3d> axis_;  // of those, in world axes; by surface
  // For each bounded surface.
  std::vector<double> reach_;
  std::vector<Eigen::Vector3d> centre_;
  std::vector<double> ball_;  // reach, margin and way within the step
  std::vector<char> still_, fixed_, faster_;
  StepContacts more_;
  std::vector<std::uint64_t> known_;  // identities of contacts
  NearPoints near_;
};

}  // namespace tether::contact::detail
