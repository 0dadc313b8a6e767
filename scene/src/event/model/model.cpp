// Tether: the bodies, joints, forces and contacts of a scene as a model of the event engine.
// SPDX-License-Identifier: BSD-3-Clause
#include "model.hpp"

#include "bounds.hpp"
#include "effects/list.hpp"
#include "mechanics/frames.hpp"

namespace tether::scene::event {

namespace {

using Row = Eigen::RowVectorXd;

constexpr double kOtherNormal = 1e-4;  // squared sine

/// Adds the velocity gradient of a force at a point, times the sign.
void add_force(const Bodies& bodies, int body, const Vector3d& point, const Vector3d& force,
               double sign, Eigen::Ref<Row> row) {
  const int slot = bodies.inertia[at(body)].slot;
  if (slot < 0) return;
  const Frame<double>& f = bodies.frames[at(body)];
  const Vector3d torque = (point - f.x).cross(force);
  row.segment<3>(6 * slot) += sign * force.transpose();
  row.segment<3>(6 * slot + 3) += sign * (f.R.transpose() * torque).transpose();
}

/// The rate of the velocity of a body's points where the contact point is, which moves with
/// `point_velocity`, without accelerations of the body.
struct Material {
  Vector3d rest;
  Material(const Frame<double>& f, const Vector3d& point_velocity)
      : rest(f.W.cross(point_velocity - f.v)) {}
};

}  // namespace

Model::Model(const Scene& scene, double time_unit, double length_unit)
    : time_unit_(time_unit),
      length_unit_(length_unit),
      bodies_(scene),
      rows_(scene, bodies_.all()),
      forces_(effects::make_forces(scene, bodies_.all())),
      kinks_(effects::kinks_of(scene)),
      pairs_(potential_contacts(scene)),
      laws_(scene, bodies_.all()),
      y_(bodies_.start()),
      loads_(at(bodies_.count())) {
  for (const Body& each : scene.bodies) body_names_.push_back(each.name);
  for (const Joint& each : scene.joints) joint_names_.push_back(each.name);
  for (const Spring& each : scene.springs) spring_names_.push_back(each.name);
  bodies_.set_state(y_.data());
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    if (!scene.bodies[b].surface) continue;
    surface_.resize(bodies_.all().frames.size());
    surface_[b] = scene.bodies[b].surface;
  }
  axes_.assign(pairs_.size(), Vector3d::Zero());
  add_moments();
  find_holding(scene);
  settle();
}

void Model::find_holding(const Scene& scene) {
  for (const Pair& from : scene.pairs)
    for (std::size_t k = 0; from.static_friction && k < pairs_.size(); ++k) {
      const std::string &a = scene.bodies[at(pairs_[k].first)].material,
                        &b = scene.bodies[at(pairs_[k].second)].material;
      holding_.resize(pairs_.size(), -1);
      if (std::minmax(a, b) == std::minmax(from.first, from.second))
        holding_[k] = pairs_[k].elliptic
                          ? *from.static_friction / from.friction * pairs_[k].friction
                          : *from.static_friction;
    }
  for (std::size_t k = 0; k < holding_.size(); ++k)
    holding_[k] = std::max(holding_[k], pairs_[k].friction);
}

void Model::set(double t, const double* y) {
  for (int k = 0; k < bodies_.count(); ++k) {
    std::copy_n(y + 7 * k, 7, y_.data() + kBody * k);
    std::copy_n(y + coordinates() + 6 * k, 6, y_.data() + kBody * k + kVelocity);
  }
  rows_.set_time(t);
  bodies_.set_time(t);
  bodies_.set_state(y_.data());
  bodies_.set_turns(y_.data());
}

void Model::settle() {
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    if (!axes_[i].isZero(0) && pairs_[i].is_apart(bodies_.all(), 0)) continue;
    const Vector3d normal = pairs_[i].touch(bodies_.all()).normal;
    // The tangents keep to an axis that is far from the normal.
    if (axes_[i].cross(normal).squaredNorm() > 0.1) continue;
    Eigen::Index least = 0;
    normal.cwiseAbs().minCoeff(&least);
    axes_[i] = Vector3d::Unit(least);
  }
}

void Model::forces(VectorXd& h) {
  clear(loads_);
  for (const auto& force : forces_) force->add(bodies_.all(), loads_);
  h.resize(velocities());
  for (int k = 0; k < bodies_.count(); ++k) {
    const Load6& load = loads_[at(k)];
    h.segment<3>(6 * k) = load.force;
    h.segment<3>(6 * k + 3) = load.torque_body + bodies_.frame(k).R.transpose() * load.torque_world;
  }
}

void Model::joints(MatrixXd& W, VectorXd& rate, VectorXd& rest) const {
  rows_.gradient(bodies_.all(), W);
  rate.resize(rows_.count());
  rest = joint_values<2>();
  rows_.each([&](const auto& row) { row.rate_by_time(rate.data() + row.row); });
}

void Model::evaluate_contact(int contact, ContactKinematics& out) {
  if (is_law(contact)) return laws_.evaluate_contact(contact - pairs(), bodies_.all(), out);
  if (is_moment(contact)) return evaluate_moment(moment(contact), out);
  const FeaturePair& p = pair(contact);
  const Bodies& bodies = bodies_.all();
  const Touch touch = p.touch(bodies);
  const Material a(bodies.frames[at(p.first)], touch.point_velocity);
  const Material b(bodies.frames[at(p.second)], touch.point_velocity);
  Vector3d rest = a.rest - b.rest, convey = Vector3d::Zero();
  if (!surface_.empty()) {
    const Jet<double> first = surface_velocity(p.first, touch),
                      second = surface_velocity(p.second, touch);
    convey = first.x - second.x;
    rest += first.x1 - second.x1;
  }
  out.gap = touch.gap;
  out.normal.setZero(velocities());
  add_force(bodies, p.first, touch.point, touch.normal, 1, out.normal);
  add_force(bodies, p.second, touch.point, touch.normal, -1, out.normal);
  out.normal_rate = 0;
  out.normal_rest = touch.second;
  // The turning of the tangents does not matter at a sticking point.
  out.tangents.setZero(2, velocities());
  out.slip_rate.setZero(2);
  out.slip_rest.resize(2);
  const auto put = [&](int k, const Vector3d& tangent) {
    Row row = Row::Zero(velocities());
    add_force(bodies, p.first, touch.point, tangent, 1, row);
    add_force(bodies, p.second, touch.point, tangent, -1, row);
    out.tangents.row(k) = row;
    out.slip_rate[k] = tangent.dot(convey);
    out.slip_rest[k] = tangent.dot(rest);
  };
  if (p.elliptic) {
    const std::array<Jet<double>, 2> tangent = scaled_tangents(p, touch);
    const Vector3d slip = relative_velocity(p, touch) + convey;
    for (int k = 0; k < 2; ++k) {
      put(k, tangent[at(k)].x);
      out.slip_rest[k] += tangent[at(k)].x1.dot(slip);
    }
    return;
  }
  const std::array<Vector3d, 2> tangent = tangents_of(contact, touch.normal);
  for (int k = 0; k < 2; ++k) put(k, tangent[at(k)]);
}

Vector3d Model::relative_velocity(const FeaturePair& p, const Touch& touch) const {
  const Frame<double>&A = bodies_.all().frames[at(p.first)],
        &B = bodies_.all().frames[at(p.second)];
  return A.v + A.W.cross(touch.point - A.x) - B.v - B.W.cross(touch.point - B.x);
}

// The axis along the normal has no direction there: any one is taken.
std::array<Jet<double>, 2> Model::scaled_tangents(const FeaturePair& p, const Touch& touch) const {
  const EllipticFriction& e = *p.elliptic;
  const Frame<double>& f = bodies_.all().frames[at(e.body)];
  const Vector3d &n = touch.normal, &n1 = touch.normal_rate, axis = f.R * e.axis,
                 axis1 = f.W.cross(axis);
  Vector3d u = axis - n.dot(axis) * n;
  Vector3d u1 = axis1 - (n1.dot(axis) + n.dot(axis1)) * n - n.dot(axis) * n1;
  if (!(u.squaredNorm() > 0)) {
    u = n.unitOrthogonal();
    u1 = -u.dot(n1) * n;
  }
  const double length = u.norm();
  Jet<double> first, second;
  first.x = u / length;
  first.x1 = (u1 - first.x.dot(u1) * first.x) / length;
  second.x = n.cross(first.x);
  second.x1 = n1.cross(first.x) + n.cross(first.x1);
  first.x2 = second.x2 = Vector3d::Zero();  // nobody asks
  for (const auto& [jet, scale] : {std::pair(&first, e.along), std::pair(&second, e.across)}) {
    jet->x *= scale;
    jet->x1 *= scale;
  }
  return {first, second};
}

Jet<double> Model::surface_velocity(int body, const Touch& touch) const {
  Jet<double> out;
  out.x = out.x1 = Vector3d::Zero();
  if (!conveys(body)) return out;
  const SurfaceSpeed& s = *surface_[at(body)];
  const Frame<double>& f = bodies_.all().frames[at(body)];
  const Vector3d r = touch.point - f.x, spin = f.R * s.angular_velocity;
  out.x = f.R * s.velocity + spin.cross(r);
  out.x1 = f.W.cross(out.x) + spin.cross(touch.point_velocity - f.v - f.W.cross(r));
  return out;
}

// Slip e.w of the turning w of one body against the other, e a tangent, or the normal; where it
// turns, (e.w)' = e.w' + e'.w.
void Model::evaluate_moment(const ContactLaw& moment, ContactKinematics& out) {
  const FeaturePair& p = pair(moment.held_by);
  const Bodies& bodies = bodies_.all();
  const Touch touch = p.touch(bodies);
  const Vector3d n = touch.normal, n1 = touch.normal_rate;
  const std::array<Vector3d, 2> t = tangents_of(moment.held_by, n);
  const Vector3d c1 = n1.cross(axes_[at(moment.held_by)]);
  const Vector3d first1 = (c1 - t[0] * t[0].dot(c1)) / n.cross(axes_[at(moment.held_by)]).norm();
  const std::array<Vector3d, 2> along = {moment.is_line() ? n : t[0], t[1]};
  const std::array<Vector3d, 2> turning = {moment.is_line() ? n1 : first1,
                                           n1.cross(t[0]) + n.cross(first1)};
  const Vector3d spin = bodies.frames[at(p.first)].W - bodies.frames[at(p.second)].W;
  out.gap = out.normal_rate = out.normal_rest = 0;
  out.normal.setZero(velocities());
  out.tangents.setZero(2, velocities());
  out.slip_rate.setZero(2);
  out.slip_rest.setZero(2);
  for (int k = 0; k < (moment.is_line() ? 1 : 2); ++k) {
    for (const int body : {p.first, p.second}) {
      const int slot = bodies.inertia[at(body)].slot;
      if (slot < 0) continue;
      const double sign = body == p.first ? 1 : -1;
      out.tangents.block<1, 3>(k, 6 * slot + 3) =
          sign * (bodies.frames[at(body)].R.transpose() * along[at(k)]).transpose();
    }
    out.slip_rest[k] = turning[at(k)].dot(spin);
  }
}

Vector3d Model::in_space(int contact, const VectorXd& parts) {
  if (is_law(contact)) return (parts[0] + parts[1]) * law_direction(contact);
  const bool turns = is_moment(contact), spins = turns && moment(contact).is_line();
  if (turns) contact = moment(contact).held_by;
  const Touch touch = pair(contact).touch(bodies_.all());
  const Vector3d& normal = touch.normal;
  std::array<Vector3d, 2> tangent = tangents_of(contact, normal);
  if (pair(contact).elliptic && !turns) {
    const std::array<Jet<double>, 2> scaled = scaled_tangents(pair(contact), touch);
    tangent = {scaled[0].x, scaled[1].x};
  }
  if (spins) return parts[1] * normal;
  return (turns ? 0 : parts[0]) * normal + parts[1] * tangent[0] + parts[2] * tangent[1];
}

bool Model::are_at_one_edge(int contact, int other, double distance) {
  return square_between(contact, other, distance) > kOtherNormal;
}

bool Model::are_one(int contact, int other, double distance) {
  if (contact == other) return true;
  const double square = square_between(contact, other, distance);
  return square >= 0 && square <= kOtherNormal;
}

void Model::energy_gradient(double* by_q, double* by_u) const {
  std::vector<double> row(at(kBody * bodies_.count()));
  for (const auto& force : forces_) force->add_potential_gradient(bodies_.all(), row.data());
  for (int k = 0; k < bodies_.count(); ++k) {
    std::copy_n(row.data() + kBody * k, 7, by_q + 7 * k);
    const Inertia& inertia = bodies_.inertia(k);
    Eigen::Map<Vector3d>(by_u + 6 * k) = inertia.mass * bodies_.frame(k).v;
    Eigen::Map<Vector3d>(by_u + 6 * k + 3) = inertia.inertia * bodies_.spin(k);
  }
}

}  // namespace tether::scene::event
