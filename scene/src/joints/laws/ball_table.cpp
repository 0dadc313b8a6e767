// Tether: tabulated springs of ball joints. SPDX-License-Identifier: BSD-3-Clause
//
// With the turn p of the first body against the second since t = 0, in world axes: the moment
// -f(|p|) p / |p|, the potential of f up to |p|. Steps take the stiffness f(|p|) / |p| of their
// start with the turn of their end.
#include "bounds.hpp"
#include "joints/coordinate.hpp"
#include "joints/laws/joint_law_effect.hpp"
#include "mechanics/pair_forces.hpp"

namespace tether::scene::effects {

namespace {

bool has_table(const Joint& joint) {
  return joint.spring && !joint.spring->stiffness_table.empty() &&
         joints::type(joint.kind).turns_freely();
}

double number(double x) { return x; }
double number(const Dual& x) { return x.value(); }

/// The moment over the turn, of which this is the square.
template <class S>
S softened(const ForceTable& table, const S& square) {
  using std::sqrt;
  const auto to = std::find_if(table.begin(), table.end(), [&square](const auto& row) {
    return number(square) < row[0] * row[0];
  });
  if (to == table.end()) return S(table.back()[1] / sqrt(square));
  if (to == table.begin()) return S((*to)[1] / (*to)[0]);
  const auto from = to - 1;
  const double k = slope(*from, *to);
  return S(k + ((*from)[1] - k * (*from)[0]) / sqrt(square));
}

/// The table of one ball.
struct BallTable {
  int first, second;
  std::size_t joint;
  std::vector<joints::Coordinate> turn;  // its components
  ForceTable table;

  template <class S>
  Vector3<S> moment(const Frame<S>& A, const Frame<S>& B) const {
    Vector3<S> p;
    for (int k = 0; k < 3; ++k) p[k] = turn[at(k)].value(A, B);
    const S factor = softened(table, dot(p, p));
    for (int k = 0; k < 3; ++k) p[k] *= S(-factor);
    return p;
  }
  template <class S>
  void pull(double, const Frame<S>& A, const Frame<S>& B, bool, Wrench<S>& on_first,
            Wrench<S>& on_second) const {
    const Vector3<S> M = moment(A, B);
    on_first.torque += M;
    on_second.torque -= M;
  }
  double potential(double, const Frame<double>& A, const Frame<double>& B) const {
    double square = 0, sum = 0;
    for (const joints::Coordinate& each : turn) square += std::pow(each.value(A, B), 2);
    const double turned = std::sqrt(square);
    each_piece(table, [&](const auto& from, const auto& to) {
      const double way = std::min(turned, to[0]) - from[0];
      if (way > 0) sum += way * (from[1] + 0.5 * slope(from, to) * way);
    });
    return sum + std::max(0.0, turned - table.back()[0]) * table.back()[1];
  }
  bool works() const { return false; }
  template <class S>
  S power(double, const Frame<S>&, const Frame<S>&) const {
    return S(0.0);
  }
};

struct BallTables : PairForces<BallTable> {
  BallTables(const Scene& scene, const Bodies& bodies) {
    for (std::size_t j = 0; j < scene.joints.size(); ++j) {
      if (!has_table(scene.joints[j])) continue;
      std::vector<joints::Coordinate> turn = joints::coordinates_of(scene.joints[j], j, bodies);
      const int first = turn[0].first(), second = turn[0].second();
      push_back({first, second, j, std::move(turn), scene.joints[j].spring->stiffness_table});
    }
  }
  const char* name() const override { return "joint springs"; }
  // As contact::JointLaws.
  Stepping stepping() const override { return Stepping::by_contact; }
  void report(const Bodies& bodies, Forces& forces) const override {
    for (const BallTable& each : items()) {
      const auto frames = frame_pair(bodies, each);
      forces.joints[each.joint].moment += each.moment(frames.first, frames.second);
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
  void add_laws(const Joint& joint, int number, double value, JointLawList& out) const override {
    if (!has_table(joint)) return;
    const double stiffness = softened(joint.spring->stiffness_table, out.turn * out.turn);
    if (stiffness > 0)
      out.sprung(number, value, stiffness, 0, 0, kInfinity);
    else
      out.bounded(number, 0, 0);  // always as many laws
  }
};

}  // namespace

TETHER_EFFECT(ball_table, BallTableEffect)

}  // namespace tether::scene::effects
