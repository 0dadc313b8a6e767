// Tether: how fast bodies vibrate across the forces of their joints. SPDX-License-Identifier:
// BSD-3-Clause
#include "joint_frequency.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>

#include "stepping/motion/rotation.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;

namespace {

using linalg::at;

// Numbers of no pattern that modes could be orthogonal to: multiples of the golden ratio, modulo 1.
Vector6d any_direction(int body) {
  Vector6d out;
  for (int k = 0; k < 6; ++k) {
    const double x = 0.6180339887498949 * (6 * body + k + 1);
    out[k] = x - std::floor(x) - 0.5;
  }
  return out;
}

// Radius of gyration about the common centre of mass.
double size_of_all(const Mechanisms& mechanisms, const BodySet& bodies) {
  double mass = 0, square = 0;
  Vector3d centre = Vector3d::Zero();
  for (int i = 0; i < bodies.size(); ++i) {
    if (mechanisms.mechanism_of(i) < 0) continue;
    mass += bodies.mass[at(i)];
    centre += bodies.mass[at(i)] * bodies.position[at(i)];
  }
  centre /= mass;
  for (int i = 0; i < bodies.size(); ++i)
    if (mechanisms.mechanism_of(i) >= 0)
      square += bodies.mass[at(i)] * (bodies.position[at(i)] - centre).squaredNorm() +
                bodies.inertia[at(i)].trace();
  return std::sqrt(square / mass);
}

}  // namespace

// Moves then_ along the mode; returns the factor of this, 0 where nothing can move.
double JointFrequency::displace(const Mechanisms& mechanisms, const BodySet& bodies) {
  const double size = size_of_all(mechanisms, bodies);
  double most = 0;
  for (const Vector6d& v : memory_.mode)
    most = std::max({most, v.head<3>().norm() / size, v.tail<3>().norm()});
  if (!(most > 0) || !std::isfinite(most)) return 0;
  // 1e-5 rad, and in parts of the size of what joints hold.
  const double factor = 1e-5 / most;
  then_ = bodies;
  for (std::size_t i = 0; i < memory_.mode.size(); ++i) {
    const Vector6d move = factor * memory_.mode[i];
    if (move.isZero(0)) continue;
    then_.position[i] = bodies.position[i] + move.head<3>();
    then_.orientation[i] = (exponential(move.tail<3>()) * bodies.orientation[i]).normalized();
  }
  return factor;
}

double JointFrequency::iterate(const RowsAt& rows_at, const JointRows& rows,
                               const std::vector<double>& impulses, double t, double dt,
                               Mechanisms& mechanisms, const BodySet& bodies) {
  const double factor = displace(mechanisms, bodies);
  if (factor == 0) return 0;
  rows_at(then_, t, displaced_);
  pull_.assign(bodies.position.size(), Vector6d::Zero());
  for (int row = 0; row < rows.count(); ++row) {
    const JointRows::Term* then = displaced_.begin(row);
    for (const JointRows::Term* now = rows.begin(row); now != rows.end(row); ++now, ++then)
      pull_[at(now->body)] += impulses[at(row)] / (dt * factor) * (then->G - now->G);
  }
  double most = 0;
  for (int m = 0; m < mechanisms.count(); ++m) {
    const std::vector<int>& list = mechanisms[m].bodies();
    u_.resize(at(mechanisms[m].entries()));
    for (std::size_t k = 0; k < list.size(); ++k)
      Eigen::Map<Vector6d, Eigen::Unaligned>(u_.data() + 6 * k) =
          mechanisms.root(list[k]).transpose() * pull_[at(list[k])];
    mechanisms[m].project(u_.data());
    const double length = norm(u_);
    if (!(length > 0) || !std::isfinite(length)) continue;
    most = std::max(most, length);
    for (double& x : u_) x /= length;
    for (const int body : list) memory_.mode[at(body)].setZero();
    mechanisms.add(m, u_.data(), memory_.mode);
  }
  return most;
}

void JointFrequency::update(const RowsAt& rows_at, const JointRows& rows,
                            const std::vector<double>& impulses, double acceleration, double t,
                            double dt, Mechanisms& mechanisms, const BodySet& bodies) {
  memory_.acceleration = acceleration;
  if (memory_.mode.empty()) {
    memory_.mode.assign(bodies.position.size(), Vector6d::Zero());
    for (int i = 0; i < bodies.size(); ++i)
      if (mechanisms.mechanism_of(i) >= 0)
        memory_.mode[at(i)] = mechanisms.root(i) * any_direction(i);
  }
  double square = memory_.frequency * memory_.frequency;
  for (int k = 0; k < 10; ++k) {
    const double last = square;
    square = iterate(rows_at, rows, impulses, t, dt, mechanisms, bodies);
    if (!(square > 1.05 * last)) break;
  }
  memory_.frequency = at_end_ = std::sqrt(square);
}

void JointFrequency::follow(double acceleration) {
  if (!(memory_.acceleration > 0)) return;
  memory_.frequency *= std::sqrt(acceleration / memory_.acceleration);
  memory_.acceleration = acceleration;
}

bool JointFrequency::resolves_change(double dt) const {
  const double change = std::abs(memory_.frequency - at_end_) * dt;
  // A step whose frequency changes may change the energy of a vibration by a hundredth.
  return !(memory_.frequency * dt * change > 0.01);
}

}  // namespace tether::contact::detail
