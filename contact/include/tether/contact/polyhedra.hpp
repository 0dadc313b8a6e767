// Tether: collision of polyhedra (target tether::contact_collision). SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <memory>
#include <tether/contact/shapes.hpp>
#include <tether/export.hpp>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// Boxes and convex hulls against each other, capsules against both, spheres and points against
/// hulls.
///
/// Touching faces are found to round-off and without any margin or skin: the separating axis is
/// chosen among all face normals and edge products (detection, 2), then the face that lies
/// against the reference face is clipped to it. Hulls come from Bullet.
///
/// Normals. A face gives its normal. Crossing edges: their product. Where an edge lies along an
/// edge (or a corner on one) and the faces of both bodies separate them equally well, there is no
/// unique normal: it is the mean of the two faces' (cards that lean against each other by their top
/// edges: horizontal).
std::unique_ptr<PairCollision> make_polyhedra();

}  // namespace tether::contact
TETHER_EXPORT_END
