// Tether: tabulated springs and dampers of ball joints. SPDX-License-Identifier: BSD-3-Clause
//
// With the turn p of the first body against the second since t = 0 and its angular velocity w
// against it, in world axes: the moment
//
//   -f(|p|) p / |p| - c(|w|) w / |w|,   the potential of f up to |p|,   power -c(|w|) |w|
//
// Steps take f(|p|) / |p| and c(|w|) / |w| of their start with the turn and the speed of their end.
#include "bounds.hpp"
#include "joints/coordinate.hpp"
#include "joints/laws/joint_law_effect.hpp"
#include "mechanics/pair_forces.hpp"

namespace tether::scene::effects {

namespace {

bool has_table(const Joint& joint) {
  return joint.spring &&
         !(joint.spring->stiffness_table.empty() && joint.spring->damping_table.empty()) &&
         joints::type(joint.kind).turns_freely();
}
bool has_damping(const Joint& joint) {
  return has_table(joint) && !joint.spring->damping_table.empty();
}

/// The moment over the turn or speed, of which this is the square; without a table none.
template <class S>
S softened(const ForceTable& table, const S& square) {
  using std::sqrt;
  if (table.empty()) return S(0.0);
  const auto to = std::find_if(table.begin(), table.end(), [&square](const auto& row) {
    return value_of(square) < row[0] * row[0];
  });
  if (to == table.end()) return S(table.back()[1] / sqrt(square));
  if (to == table.begin()) return S((*to)[1] / (*to)[0]);
  const auto from = to - 1;
  const double k = slope(*from, *to);
  return S(k + ((*from)[1] - k * (*from)[0]) / sqrt(square));
}

/// The tables of one ball.
struct BallTable {
  int first, second;
  std::size_t joint;
  std::vector<joints::Coordinate> turn;  // its components
  ForceTable stiffness, damping;

  template <class S>
  Vector3<S> moment(const Frame<S>& A, const Frame<S>& B, bool with_damping) const {
    Vector3<S> p;
    for (int k = 0; k < 3; ++k) p[k] = turn[at(k)].value(A, B);
    const S factor = softened(stiffness, dot(p, p));
    for (int k = 0; k < 3; ++k) p[k] *= S(-factor);
    if (!with_damping || damping.empty()) return p;
    const Vector3<S> w = A.W - B.W;
    const S slows = softened(damping, dot(w, w));
    for (int k = 0; k < 3; ++k) p[k] -= slows * w[k];
    return p;
  }
  template <class S>
  void pull(const Bodies&, const Frame<S>& A, const Frame<S>& B, bool all, Wrench<S>& on_first,
            Wrench<S>& on_second) const {
    const Vector3<S> M = moment(A, B, all);
    on_first.torque += M;
    on_second.torque -= M;
  }
  double potential(const Bodies&, const Frame<double>& A, const Frame<double>& B) const {
    if (stiffness.empty()) return 0;
    double square = 0, sum = 0;
    for (const joints::Coordinate& each : turn) square += std::pow(each.value(A, B), 2);
    const double turned = std::sqrt(square);
    each_piece(stiffness, [&](const auto& from, const auto& to) {
      const double way = std::min(turned, to[0]) - from[0];
      if (way > 0) sum += way * (from[1] + 0.5 * slope(from, to) * way);
    });
    return sum + std::max(0.0, turned - stiffness.back()[0]) * stiffness.back()[1];
  }
  bool works() const { return !damping.empty(); }
  template <class S>
  S power(const Bodies&, const Frame<S>& A, const Frame<S>& B) const {
    const Vector3<S> w = A.W - B.W;
    const S square = dot(w, w);
    return S(-softened(damping, square) * square);
  }
};

struct BallTables : PairForces<BallTable> {
  BallTables(const Scene& scene, const Bodies& bodies) {
    for (std::size_t j = 0; j < scene.joints.size(); ++j) {
      if (!has_table(scene.joints[j])) continue;
      std::vector<joints::Coordinate> turn = joints::coordinates_of(scene.joints[j], j, bodies);
      const int first = turn[0].first(), second = turn[0].second();
      const JointSpring& spring = *scene.joints[j].spring;
      push_back({first, second, j, std::move(turn), spring.stiffness_table, spring.damping_table});
    }
  }
  const char* name() const override { return "joint springs"; }
  // As contact::JointLaws.
  Stepping stepping() const override { return Stepping::by_contact; }
  void report(const Bodies& bodies, Forces& forces) const override {
    for (const BallTable& each : items()) {
      const auto frames = frame_pair(bodies, each);
      forces.joints[each.joint].moment += each.moment(frames.first, frames.second, true);
    }
  }
};

struct BallTableEffect : Effect {
  std::unique_ptr<Force> make_force(const Scene& scene, const Bodies& bodies) const override {
    return any_of(scene.joints, has_table) ? std::make_unique<BallTables>(scene, bodies) : nullptr;
  }
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    add_count(lines, "tables of balls", count_if(scene.joints, has_table), "joint");
  }
  void limit_momenta(Momenta& momenta) const override {
    for (const Joint& each : momenta.scene.joints)
      if (has_table(each) && momenta.holds_outside(each.first, each.second))
        momenta.axes.none("a spring of joint \"" + each.name + "\" holds from outside");
  }
  void take_rates(const Scene& scene, double length, double mass, Largest& rate) const override {
    for (const Joint& each : scene.joints)
      if (has_table(each))
        each_piece(each.spring->stiffness_table, [&](const auto& from, const auto& to) {
          rate.take(std::sqrt(slope(from, to) / (mass * length * length)));
        });
  }
  bool does_work(const Scene& scene) const override { return any_of(scene.joints, has_damping); }
  void add_laws(const Joint& joint, int number, double value, JointLawList& out) const override {
    if (!has_table(joint)) return;
    const double stiffness = softened(joint.spring->stiffness_table, out.turn_squared),
                 damping = softened(joint.spring->damping_table, out.spin_squared);
    if (stiffness > 0 || damping > 0)
      out.sprung(number, value, stiffness, damping, 0, kInfinity);
    else
      out.bounded(number, 0, 0);  // always as many laws
  }
};

}  // namespace

TETHER_EFFECT(ball_table, BallTableEffect)

}  // namespace tether::scene::effects
