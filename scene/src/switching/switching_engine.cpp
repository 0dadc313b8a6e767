// Tether: joints that attach, detach and break, in any engine. SPDX-License-Identifier:
// BSD-3-Clause
//
// Between two changes of joints a scene of those that hold moves in an engine of its own, which
// knows nothing of the others. A change is a stop, and a start of the next such scene:
//
//   detach   at `to`
//   attach   at `from`: positions as they are, velocities by the impulse of closing.cpp
//   snap     where the reaction reaches its bound (Engine::stop_above)
//
// At one instant joints open first, and close in one problem. Of several beyond their bounds the
// one that exceeds its bound most breaks; the reactions of the others are computed anew.
#include <iterator>
#include <sstream>

#include "bounds.hpp"
#include "joints/window_rules.hpp"
#include "lists.hpp"
#include "output/binary.hpp"
#include "switching.hpp"

namespace tether::scene {

namespace {

using namespace switching;
using linalg::at;
using Kind = ContactEvent::Kind;

constexpr binary::Magic kSwitched = {'s', 'w', 'i', 't', 'c', 'h', ' ', '1'};
enum class Status : std::uint8_t { waiting, holding, over };

/// Reaction over its bound.
double load_of(const JointWindow& window, const JointForce& force) {
  return std::max(force.force.norm() / window.break_force,
                  force.moment.norm() / window.break_moment);
}

void check(const Scene& scene) {
  joints::check_windows(scene, [](const Place&, const std::string& field, const std::string& value,
                                  const std::string& why) {
    throw std::invalid_argument(field + " = " + value + " " + why);
  });
}

class SwitchingEngine final : public Engine {
 public:
  SwitchingEngine(const Scene& scene, MakeEngine make) : scene_(scene), make_(std::move(make)) {
    check(scene_);
    step_ = scene_.stepping.value_or(SteppingOptions{}).step;
    for (const Joint& joint : scene_.joints) {
      const bool waits = joint.window && joint.window->from > 0;
      status_.push_back(waits ? Status::waiting : Status::holding);
    }
    begin(holding());
  }

  const char* name() const override { return engine_->name(); }
  double time() const override { return engine_->time(); }
  // An engine that has stopped early for no interruption is where a joint breaks; one of steps is
  // at the end of the step.
  void advance(double t) override {
    for (;;) {
      const double target = std::min(t, next_switch());
      if (time() < target) engine_->advance(target);
      append_events();
      if (interrupted()) return;
      if (breaks_ && (!is_due(target) || excess(engine_->forces()) > 0))
        snap();
      else if (is_due(next_switch()))
        switch_joints();
      else
        return;
    }
  }
  const std::vector<BodyState>& bodies() const override { return engine_->bodies(); }
  Diagnostics diagnostics() const override { return engine_->diagnostics(); }
  const std::vector<ContactState>& contacts() const override { return engine_->contacts(); }
  // Joints that do not hold are where the first body has them.
  Forces forces() const override {
    Forces out = engine_->forces();
    std::vector<JointForce> all(scene_.joints.size());
    for (std::size_t j = 0; j < all.size(); ++j) {
      const Joint& joint = scene_.joints[j];
      all[j].at = joint.at;
      if (joint.first < 0) continue;
      const Body& start = scene_.bodies[at(joint.first)];
      const BodyState& now = bodies()[at(joint.first)];
      all[j].at = now.position + now.orientation * (start.orientation.normalized().conjugate() *
                                                    (joint.at - start.position));
    }
    for (std::size_t k = 0; k < joint_of_.size(); ++k) all[at(joint_of_[k])] = out.joints[k];
    out.joints = std::move(all);
    return out;
  }
  const std::vector<ContactEvent>& events() const override { return events_; }
  Counts counts() const override {
    Counts out = before_, start = start_;
    out += engine_->counts();
    start.each([](long& n) { n = -n; });
    out += start;
    return out;
  }
  std::vector<EffectCost> costs() const override {
    std::vector<EffectCost> out = engine_->costs();
    for (const EffectCost& before : costs_before_) {
      const auto same = std::find_if(out.begin(), out.end(), [&](const EffectCost& each) {
        return each.effect == before.effect;
      });
      if (same == out.end())
        out.push_back(before);
      else
        same->seconds += before.seconds;
    }
    return out;
  }
  void save(std::ostream& out) const override {
    write_bodies(out, time(), bodies(), kSwitched);
    binary::Archive io(out);
    exchange(*this, io);
    engine_->save(out);
  }
  void restore(std::istream& in, Restore how) override {
    const char* const no_such_state = "this is no state of joints that attach, detach or break";
    skip_bodies(in, scene_.bodies.size(), no_such_state);
    if (!binary::begins(in, kSwitched)) throw std::runtime_error(no_such_state);
    binary::Archive io(in);
    exchange(*this, io);
    events_.clear();
    engine_.reset();
    before_ = Counts();
    costs_before_.clear();
    try {
      begin(holding());
    } catch (const SimulationError& e) {
      throw std::runtime_error(std::string("the saved state is damaged: ") + e.what());
    }
    events_.clear();
    engine_->restore(in, how);
    start_ = Counts();
  }

 private:
  // The scene of the joints that hold, from scene_.start on.
  Scene holding() const {
    Scene now = scene_;
    now.joints.clear();
    std::vector<int> place(scene_.joints.size(), -1);
    for (std::size_t j = 0; j < scene_.joints.size(); ++j) {
      if (status_[j] != Status::holding) continue;
      place[j] = static_cast<int>(now.joints.size());
      now.joints.push_back(scene_.joints[j]);
      now.joints.back().window.reset();
    }
    for (Coupling& each : now.couplings)
      for (int& joint : each.joints) joint = place[at(joint)];
    return now;
  }
  void begin(const Scene& now) {
    if (engine_) {
      before_ = counts();
      costs_before_ = costs();
    }
    joint_of_.clear();
    breaks_ = false;
    for (std::size_t j = 0; j < scene_.joints.size(); ++j) {
      if (status_[j] != Status::holding) continue;
      joint_of_.push_back(static_cast<int>(j));
      breaks_ = breaks_ || (scene_.joints[j].window && scene_.joints[j].window->breaks());
    }
    try {
      engine_ = make_(now);
    } catch (const std::invalid_argument& e) {
      if (!scene_.start) throw;
      throw SimulationError(fmt::format(
          "t = {:g} s: the motion cannot go on where joints attach, detach or break: {}",
          scene_.start->time, e.what()));
    }
    start_ = engine_->counts();
    from_engine_ = 0;
    engine_->stop_when([this] { return interrupted(); });
    if (breaks_) engine_->stop_above([this](const Forces& forces) { return excess(forces); });
    append_events();
  }
  void append_events() {
    const std::vector<ContactEvent>& all = engine_->events();
    for (; from_engine_ < all.size(); ++from_engine_) {
      events_.push_back(all[from_engine_]);
      if (int& joint = events_.back().joint; joint >= 0) joint = joint_of_[at(joint)];
    }
  }
  double next_switch() const {
    double next = JointWindow::kNever;
    for (std::size_t j = 0; j < status_.size(); ++j) {
      const auto& window = scene_.joints[j].window;
      if (!window || status_[j] == Status::over) continue;
      next = std::min(next, status_[j] == Status::waiting ? window->from : window->to);
    }
    return next;
  }
  bool is_due(double time) const {
    return this->time() >= time - kSameFigure * std::min(step_, time);
  }
  void switch_joints() {
    std::vector<int> opening, closing;
    for (std::size_t j = 0; j < status_.size(); ++j) {
      const auto& window = scene_.joints[j].window;
      if (!window) continue;
      if (status_[j] == Status::holding && is_due(window->to))
        opening.push_back(static_cast<int>(j));
      if (status_[j] == Status::waiting && is_due(window->from))
        closing.push_back(static_cast<int>(j));
    }
    scene_.start = SceneStart{time(), bodies()};
    const double potential = engine_->diagnostics().potential_energy;
    change(opening, Kind::detach, 0);
    for (const int j : closing) {
      take_places(scene_, time(), bodies(), scene_.joints[at(j)]);
      status_[at(j)] = Status::holding;
    }
    Scene now = holding();
    double lost = 0;
    if (!closing.empty()) {
      std::vector<int> places;
      for (const int j : closing)
        places.push_back(
            static_cast<int>(std::count(status_.begin(), status_.begin() + j, Status::holding)));
      lost = close(now, time(), places, now.start->bodies);
      scene_.start = now.start;
    }
    const std::size_t event = change(closing, Kind::attach, lost);
    begin(now);
    const auto is_sprung = [&](int j) { return scene_.joints[at(j)].spring.has_value(); };
    if (any_of(closing, is_sprung))
      events_[event].lost += potential - engine_->diagnostics().potential_energy;
  }
  void snap() {
    const int joint = joint_of_[largest_load(engine_->forces()).joint];
    scene_.start = SceneStart{time(), bodies()};
    change({joint}, Kind::snap, 0);
    begin(holding());
  }
  std::size_t change(const std::vector<int>& joints, Kind kind, double lost) {
    const std::size_t first = events_.size();
    for (const int j : joints) {
      status_[at(j)] = kind == Kind::attach ? Status::holding : Status::over;
      ContactEvent event;
      event.time = time();
      event.kind = kind;
      event.joint = j;
      event.first = scene_.joints[at(j)].first;
      event.second = scene_.joints[at(j)].second;
      if (events_.size() == first) event.lost = lost;
      events_.push_back(event);
    }
    return first;
  }
  struct Load {
    std::size_t joint = 0;  // of the engine
    double share = 0;       // of its bound
  };
  Load largest_load(const Forces& forces) const {
    Load most;
    for (std::size_t k = 0; k < joint_of_.size(); ++k) {
      const auto& window = scene_.joints[at(joint_of_[k])].window;
      const double share = window ? load_of(*window, forces.joints[k]) : 0;
      if (share > most.share) most = {k, share};
    }
    return most;
  }
  double excess(const Forces& forces) const { return largest_load(forces).share - 1; }
  template <class Self>
  static void exchange(Self& self, binary::Archive& io) {
    for (std::size_t j = 0; j < self.status_.size(); ++j) {
      auto& joint = self.scene_.joints[j];
      if (!joint.window) continue;
      io(self.status_[j]);
      io.demand(self.status_[j] <= Status::over);
      bool closed = joint.closed.has_value();
      Pose pose = joint.closed.value_or(Pose{});
      double length = joint.length.value_or(0), target = joint.motor ? joint.motor->target : 0;
      io(closed, pose.position, pose.orientation, length, target);
      io.demand(std::abs(pose.orientation.norm() - 1) < 1e-6 && std::isfinite(length) &&
                length >= 0 && std::isfinite(target));
      if constexpr (!std::is_const_v<Self>) {
        joint.closed.reset();
        if (closed) joint.closed = pose;
        if (joint.kind == JointKind::distance && length > 0) joint.length = length;
        if (joint.motor) joint.motor->target = target;
      }
    }
    bool started = self.scene_.start.has_value();
    SceneStart start = self.scene_.start.value_or(SceneStart{});
    start.bodies.resize(self.scene_.bodies.size());
    io(started);
    exchange_bodies(io, start.time, start.bodies);
    io.demand(start.time >= 0 && std::isfinite(start.time));
    if constexpr (!std::is_const_v<Self>) {
      self.scene_.start.reset();
      if (started) self.scene_.start = std::move(start);
    }
  }

  Scene scene_;  // with the places of what has closed, and the start of the present engine
  MakeEngine make_;
  double step_;
  std::vector<Status> status_;  // by joint of the scene
  std::vector<int> joint_of_;   // of the scene, by joint of the engine
  bool breaks_ = false;         // some of them can
  std::unique_ptr<Engine> engine_;
  std::vector<ContactEvent> events_;
  std::size_t from_engine_ = 0;  // of its events
  Counts before_, start_;        // of engines before this one; of this one at its start
  std::vector<EffectCost> costs_before_;
};

}  // namespace

std::unique_ptr<Engine> with_switching(const Scene& scene, MakeEngine make) {
  const bool switches =
      any_of(scene.joints, [](const Joint& joint) { return joint.window.has_value(); });
  if (!switches) return make(scene);
  return std::make_unique<SwitchingEngine>(scene, std::move(make));
}

}  // namespace tether::scene
