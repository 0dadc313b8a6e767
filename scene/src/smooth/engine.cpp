// Tether: the engine of scenes without contact. SPDX-License-Identifier: BSD-3-Clause

#include "certificate/instant_scribe.hpp"
#include "effects/list.hpp"
#include "effects/numbers.hpp"
#include "integrator.hpp"
#include "mechanics/force.hpp"
#include "output/binary.hpp"
#include "units.hpp"

namespace tether::scene {

namespace {

using namespace smooth;

constexpr binary::Magic kMagic = {'s', 'm', 'o', 'o', 't', 'h', ' ', '2'};

// Closed to rounding already, of the largest unknown: thin rows magnify it into moves that lead
// nowhere.
constexpr double kRounding = 1e-14;

// A multistep method's history cannot be read from IDA nor given to it. So a saved state holds an
// anchor, a point from which the history was built anew, and the time reached: whoever restores it
// takes the same steps once more from there. Anchors are part of the integration, whether anybody
// saves or not: the start, then every some thousand steps (Integrator::anchor_is_due).
class SmoothEngine : public Engine {
 public:
  explicit SmoothEngine(const Scene& scene)
      : units_(units_of(scene)),
        scene_(in_units(scene, units_)),
        options_(scene_.smooth.value_or(SmoothOptions{})),
        start_time_(scene_.start ? scene_.start->time : 0),
        system_(std::make_unique<System>(scene_, units_)),
        reactions_(scene_, mechanics::placed_bodies(scene_)),
        bodies_(mechanics::placed_states(scene)) {
    options_.max_step = effects::longest_step(scene_, options_.max_step);
    y_ = system_->start_state();
    check_start(kStartTolerance, kStartTolerance, "is taken for rounding");
    system_->complete(start_time_, y_, yp_);
    if (system_->constraint_count() > 0) {
      SmoothOptions with = options_;
      with.projection = true;
      // Invariants keep the values of the start once it is consistent.
      system_->keep_invariants_of(start_time_, y_);
      for (int pass = 0; pass < 2; ++pass) {
        Integrator start(*system_, with, start_time_, y_, yp_);
        const ida_projection::ConsistencyReport report = start.make_consistent(start_time_);
        if (report.status == ida_projection::Status::not_converged &&
            report.drift_before <= kRounding * std::max(1.0, y_.lpNorm<Eigen::Infinity>()))
          break;
        if (!report)
          throw std::invalid_argument("the start of the scene contradicts its joints: " +
                                      report.message);
        y_ = start.y();
        system_->keep_invariants_of(start_time_, y_);
      }
      // Velocities may have more, since weak rows near a singular position leave it.
      check_start(1e-7, 1e-5, "may be left where joints contradict each other in a loop");
    }
    renew(start_time_, y_, std::vector<double>(system_->kept()));
    if (scene.certificate)
      scribe_ = std::make_unique<certificate::InstantScribe>(
          scene, *this, [this] { return accelerations(); }, *scene.certificate);
  }

  const char* name() const override { return "smooth"; }
  double time() const override { return units_.time * integrator_->time(); }

  void advance(double t) override {
    long steps_left = options_.max_steps;
    const auto stop = [this] { return interrupted(); };
    integrator_->stop_above(excess_of_state());
    while (!integrator_->advance(t / units_.time, steps_left, stop) && !interrupted() &&
           !integrator_->is_above()) {
      anchor();
      integrator_->stop_above(excess_of_state());
    }
    update_bodies();
  }

  const std::vector<BodyState>& bodies() const override { return bodies_; }
  Diagnostics diagnostics() const override {
    Diagnostics d = system_->diagnostics(integrator_->time(), integrator_->y().data());
    to_si(units_, d);
    return d;
  }
  const std::vector<ContactState>& contacts() const override { return no_contacts_; }
  scene::Forces forces() const override {
    return forces_at(integrator_->time(), integrator_->y().data());
  }

  Counts counts() const override {
    Counts sum = before_;
    sum += integrator_->counts();
    return sum;
  }

  std::vector<EffectCost> costs() const override {
    std::vector<EffectCost> costs;
    const std::vector<std::string> names = system_->effect_names();
    Integrator::Seconds s = integrator_->seconds();
    if (!seconds_before_.effects.empty()) add(seconds_before_, s);
    double rest = s.total - s.jacobian - s.projection;
    for (std::size_t i = 0; i < names.size(); ++i) {
      rest -= s.effects[i];
      if (names[i] != "joints" || system_->rows() > 0) costs.push_back({names[i], s.effects[i]});
    }
    costs.push_back({"Jacobian", s.jacobian});
    if (options_.projection) costs.push_back({"projection", s.projection});
    costs.push_back({"IDA and linear algebra", std::max(0.0, rest)});
    return costs;
  }

  void save(std::ostream& out) const override {
    out.write(kMagic, sizeof kMagic);
    Eigen::VectorXd y = y_, now = integrator_->y();
    std::vector<double> kept = system_->kept();
    double from = anchor_, to = integrator_->time();
    exchange(binary::Archive(out), from, to, y, now, kept);
  }

  void restore(std::istream& in, Restore how) override {
    if (!binary::begins(in, kMagic))
      throw std::runtime_error("this is not a state of the smooth engine");
    double from = 0, to = 0;
    Eigen::VectorXd y(y_.size()), saved(y_.size());
    std::vector<double> kept = system_->kept();
    exchange(binary::Archive(in), from, to, y, saved, kept);
    renew(from, y, kept);
    if (how == Restore::exact) repeat(to, saved);
    if (how == Restore::near) renew(to, saved, kept);
  }

 private:
  scene::Forces forces_at(double t, const double* y) const {
    scene::Forces out = system_->forces(t, y, reactions_);
    to_si(units_, scene_, out);
    return out;
  }
  std::vector<std::array<Eigen::Vector3d, 2>> accelerations() const {
    Eigen::VectorXd y = integrator_->y(), yp(y.size());
    system_->complete(integrator_->time(), y, yp);
    std::vector<std::array<Eigen::Vector3d, 2>> out;
    for (int k = 0; k < system_->moving(); ++k) {
      const double* q = y.data() + kBody * k + kQuaternion;
      const Eigen::Vector3d turn = mechanics::rotation(q) * yp.segment<3>(kBody * k + kSpin);
      out.push_back({yp.segment<3>(kBody * k + kVelocity) * (units_.speed() / units_.time),
                     turn / (units_.time * units_.time)});
    }
    return out;
  }
  Integrator::OfState excess_of_state() const {
    if (!excess()) return {};
    return [this](double t, const Eigen::VectorXd& y) { return excess()(forces_at(t, y.data())); };
  }

  void exchange(binary::Archive io, double& from, double& to, Eigen::VectorXd& y,
                Eigen::VectorXd& now, std::vector<double>& kept) const {
    auto size = static_cast<std::uint64_t>(y.size()), invariants = std::uint64_t{kept.size()};
    Units units = units_;
    io(size, invariants, units.length, units.time, units.mass, from, to);
    if (units.length != units_.length || units.time != units_.time || units.mass != units_.mass)
      throw std::runtime_error("the saved state is of another scene: of another size");
    if (size != static_cast<std::uint64_t>(y.size()) || invariants != kept.size())
      throw std::runtime_error(
          fmt::format("the saved state is of another scene: it has {} unknowns, this scene has {}",
                      size, y.size()));
    io(y, now);
    for (double& value : kept) {
      io(value);
      io.demand(std::isfinite(value));
    }
    io.demand(from >= 0 && to >= from && std::isfinite(to));
  }

  static void add(const Integrator::Seconds& from, Integrator::Seconds& to) {
    for (std::size_t i = 0; i < to.effects.size(); ++i) to.effects[i] += from.effects[i];
    to.jacobian += from.jacobian;
    to.projection += from.projection;
    to.total += from.total;
  }

  // The step that begins here is the first of a new history.
  void anchor() {
    const double t = integrator_->step_end();
    renew(t, integrator_->at_step_end(), std::vector<double>(system_->kept()));
  }

  // Everything anew from t and y: whoever has these bits goes on with the same ones.
  void renew(double t, const Eigen::VectorXd& y, const std::vector<double>& kept) {
    if (integrator_) {
      before_ = counts();
      Integrator::Seconds s = integrator_->seconds();
      if (!seconds_before_.effects.empty()) add(seconds_before_, s);
      seconds_before_ = s;
      integrator_.reset();
    }
    system_ = std::make_unique<System>(scene_, units_);
    system_->kept() = kept;
    y_ = y;
    anchor_ = t;
    system_->complete(t, y_, yp_);
    integrator_ = std::make_unique<Integrator>(*system_, options_, t, y_, yp_);
    update_bodies();
  }

  void update_bodies() {
    system_->bodies(integrator_->y().data(), bodies_);
    for (std::size_t b = 0; b < bodies_.size(); ++b)
      if (!scene_.bodies[b].fixed) to_si(units_, bodies_[b]);
  }

  // The steps from the anchor to the time of a saved state. Without the limit between two stops:
  // they were taken between several.
  void repeat(double t, const Eigen::VectorXd& saved) {
    long steps_left = std::numeric_limits<long>::max();
    try {
      while (!integrator_->advance(t, steps_left, nullptr))
        if (integrator_->anchor_is_due()) break;  // no state is saved so far from its anchor
    } catch (const SimulationError& e) {
      throw std::runtime_error(std::string("the saved state cannot be arrived at again: ") +
                               e.what());
    }
    const Eigen::VectorXd y = integrator_->y();
    if (integrator_->time() != t || y != saved)
      throw std::runtime_error(
          "the saved state is of another build or machine: the same steps lead to other bits here");
    update_bodies();
  }

  void check_start(double position, double velocity, const char* why) {
    const int m = system_->rows();
    if (m == 0) return;
    Eigen::VectorXd g(2 * m);
    system_->joint_values(start_time_, y_.data(), g.data());
    double size = 1, speed = 1;
    for (int k = 0; k < system_->moving(); ++k) {
      size = std::max(size, y_.segment<3>(kBody * k + kPosition).norm());
      speed = std::max({speed, y_.segment<3>(kBody * k + kVelocity).norm(),
                        y_.segment<3>(kBody * k + kSpin).norm()});
    }
    int worst = 0;
    for (const int half : {0, 1}) {
      const double value = g.segment(half * m, m).cwiseAbs().maxCoeff(&worst);
      const double allowed = half == 0 ? position * size : velocity * speed;
      if (value <= allowed) continue;
      const double unit = half == 0 ? units_.length : units_.speed();
      throw std::invalid_argument(fmt::format(
          "the start of the scene contradicts the {} of joint \"{}\": its bodies are off by {:.3g} "
          "{} at t = {:g} (at most {:.3g} {}){}",
          half == 0 ? "position" : "velocity", system_->joint_of_row(worst),
          unit * g[half * m + worst], half == 0 ? "m or rad" : "m/s or rad/s",
          units_.time * start_time_, unit * allowed, why,
          half == 0 ? ""
                    : "; give both bodies velocities and angular velocities that the joint "
                      "allows, and those of a prescribed motion"));
    }
  }

  Units units_;
  Scene scene_;  // in these units, as everything here but bodies_
  SmoothOptions options_;
  double start_time_;
  std::unique_ptr<System> system_;  // its workspace changes in diagnostics, too
  joints::Reactions reactions_;
  double anchor_ = 0;
  Eigen::VectorXd y_, yp_;  // at the anchor
  std::unique_ptr<Integrator> integrator_;
  std::vector<BodyState> bodies_;
  std::vector<ContactState> no_contacts_;
  Counts before_;
  Integrator::Seconds seconds_before_;
  std::unique_ptr<certificate::InstantScribe> scribe_;  // only with Scene::certificate
};

}  // namespace

std::unique_ptr<Engine> make_smooth_engine(const Scene& scene) {
  if (!scene.pairs.empty())
    throw std::invalid_argument(
        "the smooth engine has no contacts, but the scene has [[pair]] tables: use [stepping] or "
        "[event]");
  if (effects::has_joint_laws(scene))
    throw std::invalid_argument(
        "the smooth engine has no limits, motors and friction of joints and cables: use [stepping] "
        "or "
        "[event]");
  const SmoothOptions options = scene.smooth.value_or(SmoothOptions{});
  if (!(options.tolerance > 0 && options.tolerance < 1))
    throw std::invalid_argument("[smooth] tolerance must be between 0 and 1");
  return std::make_unique<SmoothEngine>(scene);
}

}  // namespace tether::scene
