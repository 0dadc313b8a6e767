// Tether: forces of a smooth scene. SPDX-License-Identifier: BSD-3-Clause
#include "effects.hpp"

#include <cmath>

namespace tether::scene::smooth {

namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

class Gravity : public Effect {
 public:
  Gravity(const Vector3d& g, const Bodies& bodies) : g_(g) {
    for (std::size_t b = 0; b < bodies.inertia.size(); ++b)
      if (bodies.inertia[b].slot >= 0) bodies_.push_back(static_cast<int>(b));
  }
  const char* name() const override { return "gravity"; }
  void add(const Bodies& bodies, std::vector<Load6>& loads) const override {
    for (const int b : bodies_) {
      const Inertia& inertia = bodies.inertia[at(b)];
      loads[at(inertia.slot)].force += inertia.mass * g_;
    }
  }
  double potential(const Bodies& bodies) const override {
    double sum = 0;
    for (const int b : bodies_) sum -= bodies.inertia[at(b)].mass * g_.dot(bodies.frames[at(b)].x);
    return sum;
  }
  void add_potential_gradient(const Bodies& bodies, double* row) const override {
    for (const int b : bodies_) {
      const Inertia& inertia = bodies.inertia[at(b)];
      for (int k = 0; k < 3; ++k) row[kBody * inertia.slot + k] -= inertia.mass * g_[k];
    }
  }

 private:
  Vector3d g_;
  std::vector<int> bodies_;
};

// Torque -w x I w; a body whose inertia is a sphere's has none.
class GyroscopicTerm : public Effect {
 public:
  explicit GyroscopicTerm(std::vector<int> bodies) : bodies_(std::move(bodies)) {}
  const char* name() const override { return "gyroscopic term"; }
  void add(const Bodies& bodies, std::vector<Load6>& loads) const override {
    for (const int b : bodies_) {
      const Inertia& inertia = bodies.inertia[at(b)];
      const Vector3d& w = bodies.w[at(b)];
      loads[at(inertia.slot)].torque_body -= w.cross(inertia.inertia * w);
    }
  }
  void add_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const int b : bodies_) {
      const Inertia& inertia = bodies.inertia[at(b)];
      const Vector3d& w = bodies.w[at(b)];
      J.add_block(J.motion_row(inertia.slot, 3), kBody * inertia.slot + kSpin,
                  skew(w) * inertia.inertia - skew(inertia.inertia * w));
    }
  }

 private:
  std::vector<int> bodies_;
};

class DragEffect : public Effect {
 public:
  struct Item {
    int body;
    Drag drag;
  };
  explicit DragEffect(std::vector<Item> items) : items_(std::move(items)) {}
  const char* name() const override { return "drag"; }
  void add(const Bodies& bodies, std::vector<Load6>& loads) const override {
    for (const Item& each : items_) {
      Load6& load = loads[at(bodies.inertia[at(each.body)].slot)];
      const Vector3d& v = bodies.frames[at(each.body)].v;
      load.force -= (each.drag.linear + each.drag.quadratic * v.norm()) * v;
      load.torque_body -= each.drag.rotational * bodies.w[at(each.body)];
    }
  }
  void add_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const Item& each : items_) {
      const int slot = bodies.inertia[at(each.body)].slot;
      const Vector3d& v = bodies.frames[at(each.body)].v;
      const double speed = v.norm();
      Matrix3d D = (each.drag.linear + each.drag.quadratic * speed) * Matrix3d::Identity();
      if (speed > 0) D += each.drag.quadratic / speed * v * v.transpose();
      J.add_block(J.motion_row(slot, 0), kBody * slot + kVelocity, D);
      J.add_block(J.motion_row(slot, 3), kBody * slot + kSpin,
                  each.drag.rotational * Matrix3d::Identity());
    }
  }
  bool has_power() const override { return true; }
  double power(const Bodies& bodies) const override {
    double sum = 0;
    for (const Item& each : items_) {
      const Vector3d& v = bodies.frames[at(each.body)].v;
      sum -= (each.drag.linear + each.drag.quadratic * v.norm()) * v.squaredNorm() +
             each.drag.rotational * bodies.w[at(each.body)].squaredNorm();
    }
    return sum;
  }
  void add_power_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const Item& each : items_) {
      const int column = kBody * bodies.inertia[at(each.body)].slot;
      const Vector3d& v = bodies.frames[at(each.body)].v;
      for (int k = 0; k < 3; ++k) {
        J.add(J.work_row, column + kVelocity + k,
              (2 * each.drag.linear + 3 * each.drag.quadratic * v.norm()) * v[k]);
        J.add(J.work_row, column + kSpin + k,
              2 * each.drag.rotational * bodies.w[at(each.body)][k]);
      }
    }
  }

 private:
  std::vector<Item> items_;
};

class Loads : public Effect {
 public:
  explicit Loads(std::vector<Load> loads) : loads_(std::move(loads)) {}
  const char* name() const override { return "loads"; }
  void add(const Bodies& bodies, std::vector<Load6>& loads) const override {
    for (const Load& each : loads_) {
      Load6& load = loads[at(bodies.inertia[at(each.body)].slot)];
      load.force += each.force;
      load.torque_world += each.torque;
    }
  }
  // d(R^T torque) = [R^T torque]x turn
  void add_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const Load& each : loads_) {
      const int slot = bodies.inertia[at(each.body)].slot;
      const Matrix3d& R = bodies.frames[at(each.body)].R;
      J.add_turn(J.motion_row(slot, 3), slot, -skew(R.transpose() * each.torque));
    }
  }
  bool has_power() const override { return true; }
  double power(const Bodies& bodies) const override {
    double sum = 0;
    for (const Load& each : loads_) {
      const Frame<double>& f = bodies.frames[at(each.body)];
      sum += each.force.dot(f.v) + each.torque.dot(f.W);
    }
    return sum;
  }
  void add_power_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const Load& each : loads_) {
      const int slot = bodies.inertia[at(each.body)].slot;
      const Vector3d torque = bodies.frames[at(each.body)].R.transpose() * each.torque;
      for (int k = 0; k < 3; ++k) {
        J.add(J.work_row, kBody * slot + kVelocity + k, -each.force[k]);
        J.add(J.work_row, kBody * slot + kSpin + k, -torque[k]);
      }
      const Vector3d turn = bodies.w[at(each.body)].cross(torque);
      const Eigen::RowVector4d q = turn.transpose() * bodies.turns[at(slot)];
      for (int k = 0; k < 4; ++k) J.add(J.work_row, kBody * slot + kQuaternion + k, -q[k]);
    }
  }

 private:
  std::vector<Load> loads_;
};

// k (|d| - rest) + c d|d|/dt along d, from a point of the first to one of the second body.
class Springs : public Effect {
 public:
  struct Item {
    int first, second;
    Vector3d at_first, at_second;
    double stiffness, damping, rest;
  };
  explicit Springs(std::vector<Item> items) : items_(std::move(items)) {
    for (const Item& each : items_) damped_ = damped_ || each.damping > 0;
  }
  const char* name() const override { return damped_ ? "springs and dampers" : "springs"; }

  void add(const Bodies& bodies, std::vector<Load6>& loads) const override {
    for (const Item& each : items_) {
      const Frame<double>&A = bodies.frames[at(each.first)], &B = bodies.frames[at(each.second)];
      auto [a, b] = no_pair<double>();
      pull(each, A, B, true, a, b);
      put(bodies, each.first, a, loads);
      put(bodies, each.second, b, loads);
    }
  }
  void add_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const Item& each : items_) {
      const auto [A, B] = seed_pair(bodies, each);
      auto [a, b] = no_pair<Dual>();
      pull(each, A, B, true, a, b);
      put(bodies, each, each.first, A, a, J);
      put(bodies, each, each.second, B, b, J);
    }
  }
  double potential(const Bodies& bodies) const override {
    double sum = 0;
    for (const Item& each : items_) {
      const double stretch = (point<0>(bodies.frames[at(each.second)], each.at_second).x -
                              point<0>(bodies.frames[at(each.first)], each.at_first).x)
                                 .norm() -
                             each.rest;
      sum += 0.5 * each.stiffness * stretch * stretch;
    }
    return sum;
  }
  void add_potential_gradient(const Bodies& bodies, double* row) const override {
    for (const Item& each : items_) {
      const Frame<double>&A = bodies.frames[at(each.first)], &B = bodies.frames[at(each.second)];
      auto [a, b] = no_pair<double>();
      pull(each, A, B, false, a, b);
      gradient(bodies, each.first, a, row);
      gradient(bodies, each.second, b, row);
    }
  }
  bool has_power() const override { return damped_; }
  double power(const Bodies& bodies) const override {
    double sum = 0;
    for (const Item& each : items_)
      sum += lost<double>(each, bodies.frames[at(each.first)], bodies.frames[at(each.second)]);
    return sum;
  }
  void add_power_jacobian(const Bodies& bodies, JacobianBlocks& J) const override {
    for (const Item& each : items_) {
      const auto [A, B] = seed_pair(bodies, each);
      const Dual P = lost<Dual>(each, A, B);
      if (bodies.moves(each.first))
        J.add_directions(J.work_row, bodies.inertia[at(each.first)].slot, P.derivatives(), 0, -1.0);
      if (bodies.moves(each.second))
        J.add_directions(J.work_row, bodies.inertia[at(each.second)].slot, P.derivatives(),
                         kBodyDirections, -1.0);
    }
  }

 private:
  template <class S>
  static std::pair<Wrench<S>, Wrench<S>> no_pair() {
    return {no_wrench<S>(), no_wrench<S>()};
  }
  static std::pair<Frame<Dual>, Frame<Dual>> seed_pair(const Bodies& bodies, const Item& each) {
    return {seed(bodies.frames[at(each.first)], bodies.moves(each.first), 0),
            seed(bodies.frames[at(each.second)], bodies.moves(each.second), kBodyDirections)};
  }

  template <class S>
  static void pull(const Item& each, const Frame<S>& A, const Frame<S>& B, bool with_damping,
                   Wrench<S>& on_first, Wrench<S>& on_second) {
    using std::sqrt;
    const Jet<S> a = point<1>(A, each.at_first), b = point<1>(B, each.at_second);
    const Vector3<S> d = b.x - a.x;
    // Per length of d; a spring without rest length has no direction at d = 0 and needs none.
    S factor(each.stiffness);
    const bool damps = with_damping && each.damping > 0;
    if (each.rest > 0 || damps) {
      const S square = dot(d, d);
      if (each.rest > 0) factor -= each.stiffness * each.rest / sqrt(square);
      if (damps) {
        const Vector3<S> rate = b.x1 - a.x1;
        factor += each.damping * dot(d, rate) / square;
      }
    }
    Vector3<S> force;
    for (int i = 0; i < 3; ++i) force[i] = factor * d[i];
    on_first.add(A, a.x, force);
    on_second.add(B, b.x, Vector3<S>(-force));
  }
  // Power of the damper, <= 0.
  template <class S>
  static S lost(const Item& each, const Frame<S>& A, const Frame<S>& B) {
    if (!(each.damping > 0)) return S(0.0);
    const Jet<S> a = point<1>(A, each.at_first), b = point<1>(B, each.at_second);
    const Vector3<S> d = b.x - a.x, rate = b.x1 - a.x1;
    const S along = dot(d, rate);
    return S(-each.damping * along * along / dot(d, d));
  }

  static void put(const Bodies& bodies, int body, const Wrench<double>& wrench,
                  std::vector<Load6>& loads) {
    const int slot = bodies.inertia[at(body)].slot;
    if (slot < 0) return;
    loads[at(slot)].force += wrench.force;
    loads[at(slot)].torque_world += wrench.torque;
  }
  static void put(const Bodies& bodies, const Item& each, int body, const Frame<Dual>& frame,
                  const Wrench<Dual>& wrench, JacobianBlocks& J) {
    const int slot = bodies.inertia[at(body)].slot;
    if (slot < 0) return;
    const Vector3<Dual> torque = transposed_times(frame.R, wrench.torque);
    for (int i = 0; i < 6; ++i) {
      const Derivatives& d = (i < 3 ? wrench.force[i] : torque[i - 3]).derivatives();
      const int row = J.motion_row(slot, i);
      if (bodies.moves(each.first))
        J.add_directions(row, bodies.inertia[at(each.first)].slot, d, 0, -1.0);
      if (bodies.moves(each.second))
        J.add_directions(row, bodies.inertia[at(each.second)].slot, d, kBodyDirections, -1.0);
    }
  }
  static void gradient(const Bodies& bodies, int body, const Wrench<double>& wrench, double* row) {
    const int slot = bodies.inertia[at(body)].slot;
    if (slot < 0) return;
    const Frame<double>& f = bodies.frames[at(body)];
    for (int k = 0; k < 3; ++k) row[kBody * slot + k] -= wrench.force[k];
    const Eigen::RowVector4d q =
        (f.R.transpose() * wrench.torque).transpose() * bodies.turns[at(slot)];
    for (int k = 0; k < 4; ++k) row[kBody * slot + kQuaternion + k] -= q[k];
  }

  std::vector<Item> items_;
  bool damped_ = false;
};

}  // namespace

std::vector<std::unique_ptr<Effect>> make_effects(const Scene& scene, const Bodies& bodies) {
  std::vector<std::unique_ptr<Effect>> effects;
  if (scene.gravity) effects.push_back(std::make_unique<Gravity>(*scene.gravity, bodies));

  std::vector<int> precessing;
  std::vector<DragEffect::Item> drags;
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const Body& body = scene.bodies[b];
    if (body.fixed) continue;
    const double mean = body.inertia.trace() / 3;
    if (!(body.inertia - mean * Matrix3d::Identity())
             .isZero(1e-14 * body.inertia.cwiseAbs().maxCoeff()))
      precessing.push_back(static_cast<int>(b));
    if (body.drag) drags.push_back({static_cast<int>(b), *body.drag});
  }
  if (!precessing.empty()) effects.push_back(std::make_unique<GyroscopicTerm>(precessing));

  std::vector<Springs::Item> springs;
  const int world = static_cast<int>(scene.bodies.size());
  for (const Spring& each : scene.springs) {
    Springs::Item item;
    item.first = each.first < 0 ? world : each.first;
    item.second = each.second < 0 ? world : each.second;
    const Frame<double>&A = bodies.frames[at(item.first)], &B = bodies.frames[at(item.second)];
    item.at_first = A.R.transpose() * (each.at - A.x);
    item.at_second = B.R.transpose() * (each.at_second - B.x);
    item.stiffness = each.stiffness;
    item.damping = each.damping;
    item.rest = each.rest ? *each.rest : (each.at_second - each.at).norm();
    springs.push_back(item);
  }
  if (!springs.empty()) effects.push_back(std::make_unique<Springs>(std::move(springs)));
  if (!drags.empty()) effects.push_back(std::make_unique<DragEffect>(std::move(drags)));

  std::vector<Load> loads;
  for (const Load& each : scene.loads)
    if (bodies.moves(each.body)) loads.push_back(each);
  if (!loads.empty()) effects.push_back(std::make_unique<Loads>(std::move(loads)));
  return effects;
}

}  // namespace tether::scene::smooth
