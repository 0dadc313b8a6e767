// Tether: what a scene begins with that its author may not have meant. SPDX-License-Identifier:
// BSD-3-Clause

#include "bounds.hpp"
#include "geometry/shape_type.hpp"
#include "stepping/stepping_engine.hpp"

namespace tether::scene {

namespace {

using Bodies = std::pair<int, int>;

/// Planes, and points at the centre, have no size.
double size_of(const Body& body) {
  const double reach = reach_of(body);
  return reach > 0 ? reach : HUGE_VAL;
}

/// Bodies and how they meet, without what moves them.
Scene only_contacts(const Scene& scene) {
  Scene out;
  out.engine = EngineKind::stepping;
  out.bodies = scene.bodies;
  out.pairs = scene.pairs;
  for (Body& body : out.bodies) {
    body.velocity.setZero();
    body.angular_velocity.setZero();
  }
  for (Pair& pair : out.pairs) {
    pair.friction = pair.rolling = pair.torsional = 0;
    pair.friction_across.reset();
    pair.static_friction.reset();
  }
  SteppingOptions& steps = out.stepping.emplace();
  steps.error_reduction = 0;  // nothing moves
  steps.on_failure = OnFailure::warn;
  return out;
}

/// The deepest contact of each pair of bodies at the start, m; none where steps know no contacts
/// of the shapes.
std::map<Bodies, double> depths_at_start(const Scene& scene) {
  std::map<Bodies, double> out;
  if (scene.pairs.empty()) return out;
  try {
    const Scene still = only_contacts(scene);
    stepping::SteppingEngine engine(still);
    engine.advance(still.stepping->step);
    for (const ContactState& each : engine.contacts())
      if (each.gap < 0) {
        double& depth = out[std::minmax(each.first, each.second)];
        depth = std::max(depth, -each.gap);
      }
  } catch (const std::invalid_argument&) {
    out.clear();
  } catch (const SimulationError&) {
    out.clear();
  }
  return out;
}

}  // namespace

std::vector<std::string> overlaps_at_start(const Scene& scene) {
  std::map<Bodies, double> depths = depths_at_start(scene);
  for (const Joint& joint : scene.joints)  // which let their bodies pass through each other
    if (joint_rows(joint) >= 3) depths.erase(std::minmax(joint.first, joint.second));
  const auto body = [&](int k) -> const Body& { return scene.bodies[static_cast<std::size_t>(k)]; };
  std::vector<std::pair<double, Bodies>> deep;
  for (const auto& [pair, depth] : depths)
    // Places of three digits are nearer than that.
    if (depth > 1e-2 * std::min(size_of(body(pair.first)), size_of(body(pair.second))))
      deep.emplace_back(depth, pair);
  std::sort(deep.rbegin(), deep.rend());
  std::vector<std::string> out;
  for (std::size_t k = 0; k < std::min(kMostNamed, deep.size()); ++k) {
    auto [one, other] = deep[k].second;
    if (body(one).fixed) std::swap(one, other);
    out.push_back(
        fmt::format("\"{}\" begins {:.3g} m inside \"{}\": pushing them apart does work on them",
                    body(one).name, deep[k].first, body(other).name));
  }
  if (deep.size() > kMostNamed)
    out.push_back(
        fmt::format("{} more pairs of bodies begin inside each other", deep.size() - kMostNamed));
  return out;
}

std::vector<std::string> bodies_out_of_touch(const Scene& scene) {
  std::map<std::string, long> all, moving;  // bodies with shapes, by material
  for (const Body& each : scene.bodies) {
    if (each.shapes.empty()) continue;
    ++all[each.material];
    moving[each.material] += !each.fixed;
  }
  std::set<std::string> of_moving, of_fixed;  // materials of bodies that something can touch
  for (const Pair& pair : scene.pairs)
    for (const auto& [one, other] :
         {std::pair(pair.first, pair.second), std::pair(pair.second, pair.first)}) {
      if (pair.touch && all[other] > (one == other ? 1 : 0)) of_moving.insert(one);
      if (pair.touch && moving[other] > 0) of_fixed.insert(one);
    }
  std::vector<std::string> out;
  if (scene.pairs.empty()) return out;
  for (const Body& each : scene.bodies)
    if (!each.shapes.empty() && (each.fixed ? of_fixed : of_moving).count(each.material) == 0)
      out.push_back(each.name);
  return out;
}

}  // namespace tether::scene
