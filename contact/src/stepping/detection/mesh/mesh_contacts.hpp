// Tether: convex shapes on a mesh of triangles (detection, section 4). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <tether/contact/shapes.hpp>
#include <vector>

#include "stepping/detection/collide.hpp"
#include "stepping/detection/mesh/triangle_mesh.hpp"

namespace tether::contact::detail {

/// Contacts of bodies with a mesh (detection, section 4). The storage is reused between bodies.
class MeshContacts {
 public:
  explicit MeshContacts(const Shape& mesh);

  /// Adds all contacts of the solid shape a with a gap below `margin`. Normals point from the mesh
  /// to a.
  void collide(const Shape& a, const Pose& pose_a, const Pose& mesh, double margin,
               NearPoints& out);

 private:
  struct Body;  // shape a in the axes of the mesh, about its own origin
  // Data of one triangle near a body.
  struct Near {
    const TriangleMesh::Triangle& triangle;
    std::array<Eigen::Vector3d, 3> corner;  // about the origin of the body
    double longest;                         // of its edges
  };
  void touch(const Body& body, const Near& near, NearPoints& out);
  bool separate(const Body& body, const Near& near, bool& face, NearPoints& out);
  bool top_of(const Near& near, const Eigen::Vector3d& n, Flat& top, std::uint64_t& part) const;
  void cut_edges(const Body& body, const Near& near, double low, NearPoints& out);
  void add(const Eigen::Vector3d& at, const Eigen::Vector3d& normal, double gap, std::uint64_t key,
           NearPoints& out);

  TriangleMesh mesh_;
  TriangleTree tree_;
  NearPoints plane_, edges_;
  std::vector<Eigen::Vector3d> corners_;
  std::vector<std::uint64_t> keys_;  // of the points of this body
  std::vector<int> features_;
};

}  // namespace tether::contact::detail
