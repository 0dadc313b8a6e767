// Tether: writes instants of smooth motion to the certificate. SPDX-License-Identifier:
// BSD-3-Clause
#include "instant_scribe.hpp"

#include <Eigen/LU>
#include <tether/linalg/least_squares.hpp>

#include "natural_map.hpp"

namespace tether::scene::certificate {

InstantScribe::InstantScribe(const Scene& scene, const Engine& engine, Accelerations accelerations,
                             Sheet& sheet)
    : scene_(scene),
      engine_(engine),
      accelerations_(std::move(accelerations)),
      sheet_(sheet),
      bodies_(mechanics::weighed_bodies(scene)),
      joints_(scene) {
  for (std::size_t i = 0; i < scene.springs.size(); ++i) {
    const Spring& each = scene.springs[i];
    if (!each.cable || each.cable->capstans.empty()) continue;
    if (each.cable->capstans.size() > 1)
      throw std::invalid_argument(fmt::format(
          "certificates of events know one ring that rubs, and cable \"{}\" has {}: run "
          "it without --certificate, or in steps",
          each.name, each.cable->capstans.size()));
    slips_.emplace_back(each, i, each.cable->capstans[0], bodies_);
  }
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
  if (!scene_.joints.empty()) joints_.put_pulls(bodies_, last_, engine_.forces().joints, out);
  sheet_.put(out);
}

void InstantScribe::put_impact(double time, const std::vector<BodyState>& before,
                               const std::vector<BodyState>& after,
                               const std::vector<ContactState>& contacts,
                               const std::vector<ContactState>& rest, bool exact) {
  std::string out, inside;
  set_places(time, after);
  Eigen::VectorXd momenta = Eigen::VectorXd::Zero(6 * bodies_.moving);
  Line(out, "reached") << time;
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
  if (!scene_.joints.empty()) put_reactions(time, momenta, inside);
  Line(out, "part") << time << 0.0 << (exact ? 0 : 1) << worst;
  out += inside;
  for (const std::size_t b : scene_.moving()) Line(out, "to") << static_cast<int>(b) << after[b];
  sheet_.put(out);
}

// The reactions of least size that make up these momenta.
void InstantScribe::put_reactions(double time, const Eigen::VectorXd& momenta, std::string& out) {
  const std::vector<JointLines::Unit> units = joints_.units(bodies_, time);
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(momenta.size(), static_cast<int>(units.size()));
  for (std::size_t k = 0; k < units.size(); ++k)
    for (std::size_t side = 0; side < 2; ++side) {
      const int slot = bodies_.inertia[at(units[k].body[side])].slot;
      if (slot < 0) continue;
      G.block<3, 1>(6 * slot, static_cast<int>(k)) += units[k].on[side].force;
      G.block<3, 1>(6 * slot + 3, static_cast<int>(k)) += units[k].on[side].torque;
    }
  linalg::LeastSquares factors;
  factors.factor(G);
  const Eigen::VectorXd x = factors.solve(momenta);
  for (std::size_t k = 0; k < units.size(); ++k)
    Line(out, "pull") << units[k].number << x[static_cast<int>(k)];
}

void InstantScribe::put_pushes(std::string& out) {
  for (const auto& force : forces_) {
    const std::string_view name = force->name();
    // The judge has these of its own; forces of joints have those of their springs.
    if (name == "gravity" || name == "gyroscopic term" || name == "joint springs") continue;
    mechanics::clear(loads_);
    force->add(bodies_, loads_);
    for (const std::size_t b : scene_.moving()) {
      const mechanics::Load6& load = loads_[at(bodies_.inertia[b].slot)];
      const Vector3d torque = load.torque_world + bodies_.frames[b].R * load.torque_body;
      if (load.force.isZero(0) && torque.isZero(0)) continue;
      Line(out, "push") << static_cast<int>(b) << load.force << torque << name;
    }
  }
  if (slips_.empty()) return;
  const std::vector<SpringForce> tensions = engine_.forces().springs;
  for (const effects::CapstanSlip& slip : slips_) {
    const SpringForce& cable = tensions[at(slip.cable())];
    const double x = (cable.tension - cable.tension_second) / 2;
    slip.each_load(bodies_, [&](int body, const mechanics::Wrench<double>& unit) {
      Line(out, "push") << body << Vector3d(x * unit.force) << Vector3d(x * unit.torque)
                        << "capstan friction";
    });
  }
}

}  // namespace tether::scene::certificate
