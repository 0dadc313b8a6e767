// Tether: writes instants of smooth motion to the certificate. SPDX-License-Identifier:
// BSD-3-Clause
#include "instant_scribe.hpp"

#include <Eigen/LU>
#include <Eigen/QR>

#include "natural_map.hpp"

namespace tether::scene::certificate {

namespace {

mechanics::Bodies moving_bodies(const Scene& scene) {
  mechanics::Bodies out = mechanics::placed_bodies(scene);
  for (const std::size_t b : scene.moving()) {
    const Body& body = scene.bodies[b];
    out.inertia[b] = {out.moving++, body.mass, body.inertia, body.inertia.inverse()};
  }
  return out;
}

}  // namespace

InstantScribe::InstantScribe(const Scene& scene, const Engine& engine, Accelerations accelerations,
                             Sheet& sheet)
    : scene_(scene),
      engine_(engine),
      accelerations_(std::move(accelerations)),
      sheet_(sheet),
      bodies_(moving_bodies(scene)),
      rows_(scene, bodies_) {
  for (std::size_t j = 0; j < scene.joints.size(); ++j)
    if (const Joint& joint = scene.joints[j]; joint.limits || joint.motor || joint.friction != 0)
      laws_.emplace_back(static_cast<int>(j), joints::Coordinate(joint, bodies_));
  forces_ = effects::make_forces(scene, bodies_);
  loads_.resize(at(bodies_.moving));
  sheet.begin(scene, engine.name(), *this);
}

void InstantScribe::flush() {
  if (engine_.time() == last_) return;
  last_ = engine_.time();
  std::string out;
  Line(out, "instant") << last_ << static_cast<int>(engine_.events().size());
  const std::vector<std::array<Vector3d, 2>> rates = accelerations_();
  std::size_t slot = 0;
  for (const std::size_t b : scene_.moving()) {
    Line(out, "to") << static_cast<int>(b) << engine_.bodies()[b];
    Line(out, "rate") << static_cast<int>(b) << rates[slot][0] << rates[slot][1];
    ++slot;
  }
  set_places(last_, engine_.bodies());
  put_pushes(out);
  put_contacts(out);
  put_joints(out);
  sheet_.put(out);
}

void InstantScribe::set_places(double time, const std::vector<BodyState>& states) {
  bodies_.time = time;
  for (const std::size_t b : scene_.moving()) {
    const BodyState& s = states[b];
    mechanics::Frame<double>& f = bodies_.frames[b];
    f.x = s.position;
    f.R = s.orientation.toRotationMatrix();
    f.v = s.velocity;
    f.W = s.angular_velocity;
    bodies_.w[b] = f.R.transpose() * f.W;
  }
}

void InstantScribe::put_impact(double time, const std::vector<BodyState>& before,
                               const std::vector<BodyState>& after,
                               const std::vector<ContactState>& contacts,
                               const std::vector<ContactState>& rest, bool exact) {
  std::string out, inside;
  set_places(time, after);
  Eigen::VectorXd momenta = Eigen::VectorXd::Zero(6 * bodies_.moving);
  Line(out, "arrives") << time;
  for (const std::size_t b : scene_.moving()) {
    Line(out, "to") << static_cast<int>(b) << before[b];
    const Eigen::Matrix3d& R = bodies_.frames[b].R;
    const Vector3d dw = after[b].angular_velocity - before[b].angular_velocity;
    momenta.segment<3>(6 * bodies_.inertia[b].slot) =
        scene_.bodies[b].mass * (after[b].velocity - before[b].velocity);
    momenta.segment<3>(6 * bodies_.inertia[b].slot + 3) =
        R * (scene_.bodies[b].inertia * (R.transpose() * dw));
  }
  const auto acts = [&](int body, const Vector3d& force, const Vector3d& moment) {
    const int slot = bodies_.inertia[at(body)].slot;
    momenta.segment<3>(6 * slot) -= force;
    momenta.segment<3>(6 * slot + 3) -= moment;
  };
  for (const ContactState& c : rest)
    for (const auto& [body, sign] : {std::pair(c.first, 1.0), std::pair(c.second, -1.0)}) {
      if (!scene_.moves(body)) continue;
      const Vector3d force = sign * c.force;
      const Vector3d moment = sign * c.moment + (c.point - after[at(body)].position).cross(force);
      acts(body, force, moment);
      Line(inside, "push") << body << force << moment << "rest";
    }
  double worst = 0;
  for (const ContactState& c : contacts) {
    Vector3d w = surface_velocity(c.first, c.point) - surface_velocity(c.second, c.point);
    w -= c.normal.dot(w) * c.normal;
    const Vector3d belts = w;
    double inverse = 0;
    for (const auto& [body, sign] : {std::pair(c.first, 1.0), std::pair(c.second, -1.0)}) {
      const BodyState& s = after[at(body)];
      const Vector3d arm = c.point - s.position;
      w += sign * (s.velocity + s.angular_velocity.cross(arm));
      if (!scene_.moves(body)) continue;
      inverse += 1 / scene_.bodies[at(body)].mass;
      acts(body, sign * c.force, sign * (c.moment + arm.cross(c.force)));
    }
    // Newton's law is that the speed after is none, or a part of that before.
    const double bias = c.normal.dot(c.force) > 0 ? -c.normal.dot(w) : 0;
    worst = std::max(worst, natural_residual(friction(scene_, c.first, c.second, after), c.normal,
                                             inverse * c.force, w + bias * c.normal));
    Line(inside, "contact") << c.first << c.second << c.point << c.point << c.normal << c.gap
                            << bias << belts << c.force << c.moment;
  }
  put_reactions(time, after, std::move(momenta), inside);
  Line(out, "part") << time << 0.0 << (exact ? 0 : 1) << worst;
  out += inside;
  for (const std::size_t b : scene_.moving()) Line(out, "to") << static_cast<int>(b) << after[b];
  sheet_.put(out);
}

// The reactions of least size along what joints hold, and along the coordinates of their laws.
void InstantScribe::put_reactions(double time, const std::vector<BodyState>& after,
                                  Eigen::VectorXd momenta, std::string& out) {
  if (scene_.joints.empty()) return;
  set_places(time, after);
  rows_.set_time(time);
  struct Unit {
    int joint, body[2];
    mechanics::Wrench<double> on[2];
  };
  std::vector<Unit> units;
  rows_.each([&](const auto& row) {
    for (int i = 0; i < row.count; ++i) {
      Unit u{row.joint, {row.first, row.second}, {}};
      u.on[0] = u.on[1] = mechanics::no_wrench<double>();
      double one[3] = {0, 0, 0};
      one[i] = 1;
      row.pull(bodies_.frames[at(row.first)], bodies_.frames[at(row.second)], one, u.on[0],
               u.on[1]);
      units.push_back(u);
    }
  });
  for (const auto& [joint, along] : laws_) {
    Unit u{joint, {along.first(), along.second()}, {}};
    along.gradient(bodies_, u.on[0], u.on[1]);
    units.push_back(u);
  }
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(momenta.size(), static_cast<int>(units.size()));
  for (int k = 0; k < G.cols(); ++k)
    for (int side = 0; side < 2; ++side) {
      const int slot = bodies_.inertia[at(units[at(k)].body[side])].slot;
      if (slot < 0) continue;
      G.block<3, 1>(6 * slot, k) += units[at(k)].on[side].force;
      G.block<3, 1>(6 * slot + 3, k) += units[at(k)].on[side].torque;
    }
  const Eigen::VectorXd x = G.completeOrthogonalDecomposition().solve(momenta);
  std::vector<std::array<mechanics::Wrench<double>, 2>> sums(
      scene_.joints.size(), {mechanics::no_wrench<double>(), mechanics::no_wrench<double>()});
  for (int k = 0; k < G.cols(); ++k)
    for (std::size_t side = 0; side < 2; ++side) {
      auto& sum = sums[at(units[at(k)].joint)][side];
      sum.force += x[k] * units[at(k)].on[side].force;
      sum.torque += x[k] * units[at(k)].on[side].torque;
    }
  for (std::size_t j = 0; j < sums.size(); ++j)
    Line(out, "pull") << static_cast<int>(j) << 0 << sums[j][0] << sums[j][1];
}

void InstantScribe::put_pushes(std::string& out) {
  for (const auto& force : forces_) {
    const std::string_view name = force->name();
    // The judge has the gyroscopic term of its own; forces of joints have those of their springs.
    if (name == "gyroscopic term" || name == "joint springs") continue;
    for (mechanics::Load6& each : loads_)
      each.force = each.torque_body = each.torque_world = Vector3d::Zero();
    force->add(bodies_, loads_);
    for (const std::size_t b : scene_.moving()) {
      const mechanics::Load6& load = loads_[at(bodies_.inertia[b].slot)];
      const Vector3d torque = load.torque_world + bodies_.frames[b].R * load.torque_body;
      if (load.force.isZero(0) && torque.isZero(0)) continue;
      Line(out, "push") << static_cast<int>(b) << load.force << torque << name;
    }
  }
}

Vector3d InstantScribe::centre(int body) const {
  return body < 0 ? Vector3d(Vector3d::Zero()) : engine_.bodies()[at(body)].position;
}

Vector3d InstantScribe::surface_velocity(int body, const Vector3d& point) const {
  const auto& surface = scene_.bodies[at(body)].surface;
  if (!surface) return Vector3d::Zero();
  const linalg::Quaternion& q = engine_.bodies()[at(body)].orientation;
  return q * surface->velocity + (q * surface->angular_velocity).cross(point - centre(body));
}

void InstantScribe::put_contacts(std::string& out) const {
  for (const ContactState& c : engine_.contacts()) {
    Vector3d belts = surface_velocity(c.first, c.point) - surface_velocity(c.second, c.point);
    belts -= c.normal.dot(belts) * c.normal;
    Line(out, "contact") << c.first << c.second << c.point << c.point << c.normal << c.gap << 0.0
                         << belts << c.force << c.moment;
  }
}

void InstantScribe::put_joints(std::string& out) const {
  if (scene_.joints.empty()) return;
  const std::vector<JointForce> forces = engine_.forces().joints;
  for (std::size_t j = 0; j < forces.size(); ++j) {
    const JointForce& f = forces[j];
    const auto about = [&](int body) { return Vector3d((f.at - centre(body)).cross(f.force)); };
    Line(out, "pull") << static_cast<int>(j) << 0 << f.force
                      << Vector3d(f.moment + about(scene_.joints[j].first)) << Vector3d(-f.force)
                      << Vector3d(-f.moment - about(scene_.joints[j].second));
  }
}

}  // namespace tether::scene::certificate
