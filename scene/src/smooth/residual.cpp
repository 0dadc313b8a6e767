// Tether: the residual of the equations of motion. SPDX-License-Identifier: BSD-3-Clause
#include "quaternions.hpp"
#include "system.hpp"

namespace tether::scene::smooth {

namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

}  // namespace

void System::sum_forces(Stopwatch* watch) {
  for (Load6& load : loads_) load.force = load.torque_body = load.torque_world = Vector3d::Zero();
  for (std::size_t i = 0; i < effects_.size(); ++i) {
    effects_[i]->add(bodies_, loads_);
    if (watch) watch->lap(i);
  }
}

void System::add_multipliers(const double* lambda, std::vector<Load6>& loads) const {
  each_row([&](const auto& row) {
    const Frame<double>&A = bodies_.frames[at(row.first)], &B = bodies_.frames[at(row.second)];
    Wrench<double> a = no_wrench<double>(), b = no_wrench<double>();
    row.pull(A, B, lambda + row.row, a, b);
    const auto put = [&](int body, const Wrench<double>& wrench) {
      const int slot = bodies_.inertia[at(body)].slot;
      if (slot < 0) return;
      loads[at(slot)].force += wrench.force;
      loads[at(slot)].torque_world += wrench.torque;
    };
    put(row.first, a);
    put(row.second, b);
  });
}

void System::torques_to_body_axes(std::vector<Load6>& loads) const {
  for (int k = 0; k < moving(); ++k) {
    Load6& load = loads[at(k)];
    load.torque_body += bodies_.frames[at(body_of_slot_[at(k)])].R.transpose() * load.torque_world;
  }
}

double System::power(const double* lambda) const {
  double sum = 0;
  for (const auto& effect : effects_)
    if (effect->has_power()) sum += effect->power(bodies_);
  if (has_motion_)
    each_row([&](const auto& row) {
      double g_t[3];
      row.rate_by_time(g_t);
      for (int i = 0; i < row.count; ++i) sum -= lambda[row.row + i] * g_t[i];
    });
  return sum;
}

// In the place of a row that depends on others: its multiplier is 0.
void System::pin_multipliers(const double* multipliers, double* rows) const {
  for (int i = 0; i < m_; ++i)
    if (!carries_[at(i)]) rows[i] = size_of_row_[i] * multipliers[i];
}

void System::residual(double t, const double* y, const double* yp, double* r, Stopwatch* watch) {
  const std::size_t joints = effects_.size(), bodies = joints + 1;
  const double* lambda = y + first_multiplier();
  if (watch) watch->start();
  update(t, y);
  if (watch) watch->lap(bodies);
  sum_forces(watch);

  const bool index0 = form_ == Formulation::index0;
  const bool index2 = form_ == Formulation::stabilised_index2;
  if (index0) {
    torques_to_body_axes(loads_);
    if (watch) watch->lap(bodies);
    solve_multipliers();
    lambda = lambda_.data();
    if (watch) watch->lap(joints);
  } else {
    if (m_ > 0) add_multipliers(lambda, loads_);
    torques_to_body_axes(loads_);
    if (index2) {
      for (Load6& pull : pulls_)
        pull.force = pull.torque_body = pull.torque_world = Vector3d::Zero();
      add_multipliers(y + first_eta(), pulls_);
      torques_to_body_axes(pulls_);
    }
    if (watch) watch->lap(joints);
  }

  for (int k = 0; k < moving(); ++k) {
    const Inertia& inertia = bodies_.inertia[at(body_of_slot_[at(k)])];
    const double *s = y + kBody * k, *p = yp + kBody * k;
    double* out = r + kBody * k;
    using Map3 = Eigen::Map<const Vector3d>;
    Vector3d v = Map3(s + kVelocity), w = Map3(s + kSpin);
    if (index2) {
      v += pulls_[at(k)].force / inertia.mass;
      w += inertia.inverse * pulls_[at(k)].torque_body;
    }
    Eigen::Map<Vector3d>(out + kPosition) = Map3(p + kPosition) - v;
    Eigen::Map<Eigen::Vector4d>(out + kQuaternion) =
        Eigen::Map<const Eigen::Vector4d>(p + kQuaternion) - quaternion_rate(s + kQuaternion, w);
    if (index0) {
      Eigen::Map<Eigen::Matrix<double, 6, 1>>(out + kVelocity) =
          Eigen::Map<const Eigen::Matrix<double, 6, 1>>(p + kVelocity) - a_.segment<6>(6 * k);
    } else {
      Eigen::Map<Vector3d>(out + kVelocity) =
          inertia.mass * Map3(p + kVelocity) - loads_[at(k)].force;
      Eigen::Map<Vector3d>(out + kSpin) =
          inertia.inertia * Map3(p + kSpin) - loads_[at(k)].torque_body;
    }
  }
  if (has_work_) r[first_work()] = yp[first_work()] - power(lambda);
  if (watch) watch->lap(bodies);
  if (index0 || m_ == 0) return;

  double* out = r + first_multiplier();
  if (index2) {
    double* positions = r + first_eta();
    each_row([&](const auto& row) {
      const Frame<double>&A = bodies_.frames[at(row.first)], &B = bodies_.frames[at(row.second)];
      row.template rows<1>(A, B, out + row.row);
      row.template rows<0>(A, B, positions + row.row);
    });
    pin_multipliers(y + first_eta(), positions);
  } else {
    update_accelerations(yp);
    each_row([&](const auto& row) {
      row.template rows<2>(bodies_.frames[at(row.first)], bodies_.frames[at(row.second)],
                           out + row.row);
    });
  }
  pin_multipliers(lambda, out);
  if (watch) watch->lap(joints);
}

}  // namespace tether::scene::smooth
