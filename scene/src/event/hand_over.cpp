// Tether: events, and steps where they cannot go on (method, section 11). SPDX-License-Identifier:
// BSD-3-Clause
//
// Time steps take over until the same contacts stay closed for a number of steps: then the
// accumulation or burst of impacts that stopped the events is over.
#include <iterator>
#include <sstream>

#include "bounds.hpp"
#include "event/resumable.hpp"
#include "output/binary.hpp"
#include "stepping/stepping_engine.hpp"

namespace tether::scene {

namespace {

constexpr binary::Magic kHandedOver = {'h', 'a', 'n', 'd', 'e', 'd', ' ', '3'};

// Steps go on until this many of them have left the same contacts closed. The number doubles if
// events failed again within a time of that many steps.
constexpr std::int64_t kUnchangedSteps = 20;
constexpr std::uint64_t kMostHandOvers = 1000;  // then steps go to the end

double energy_of(const Engine& engine) {
  const Diagnostics d = engine.diagnostics();
  return d.kinetic_energy + d.potential_energy;
}

/// A state of the event engine until the first hand-over; then, after the bodies (for a scene of
/// steps alone), the hand-overs and the state of the engine that is at work.
class EventsThenSteps final : public Engine {
 public:
  EventsThenSteps(const Scene& scene, event::MakeResumable make)
      : step_(scene.stepping.value_or(SteppingOptions{}).step),
        scene_(scene),
        make_(std::move(make)) {
    scene_.event->otherwise = Otherwise::stop;
    steps_scene_ = scene_;
    steps_scene_.event.reset();
    steps_scene_.engine = EngineKind::stepping;
    try {
      begin_events(event::Begin::at_start);
    } catch (const SimulationError& e) {  // in impacts at the start
      begin_events(event::Begin::later);
      begin_steps();
      append_hand_over({0, e.what(), {}, {}, 0}, energy_of(*steps_));
    }
  }

  const char* name() const override { return "event"; }
  double time() const override { return now().time(); }
  void advance(double t) override {
    const double slack = kSameFigure * step_;
    while (true) {
      if (!steps_) try {
          events_->advance(t);
          return append_events();
        } catch (const SimulationError& e) {
          take_over(e.what());
        }
      while (steps_ && time() < t - slack) {
        const double before = time();
        steps_->advance(before + 0.5 * step_);
        if (!(time() > before)) return;  // interrupted
        give_back_if_settled();
      }
      if (steps_ || time() >= t) return;
    }
  }

  const std::vector<BodyState>& bodies() const override { return now().bodies(); }
  Diagnostics diagnostics() const override { return now().diagnostics(); }
  const std::vector<ContactState>& contacts() const override { return now().contacts(); }
  Forces forces() const override { return now().forces(); }
  const std::vector<ContactEvent>& events() const override { return all_events_; }
  std::vector<EffectCost> costs() const override { return now().costs(); }
  const std::vector<HandOver>& hand_overs() const override { return hand_overs_; }

  Counts counts() const override {
    if (hand_overs_.empty()) return events_->counts();
    Counts c = steps_before_;
    if (steps_) c += counts_of_steps();
    const Counts of_events = counts_of_events();
    c.events = of_events.events;
    c.impacts = of_events.impacts;
    return c;
  }
  Counts counts_of_events() const override {
    return steps_ ? hand_overs_.back().before : events_->counts();
  }

  void save(std::ostream& out) const override {
    if (hand_overs_.empty()) return events_->save(out);
    write_bodies(out, time(), bodies(), kHandedOver);
    binary::Archive io(out);
    exchange_hand_overs(*this, io);
    now().save(out);
  }
  void restore(std::istream& in, Restore how) override {
    const std::string all{std::istreambuf_iterator<char>(in), {}};
    std::istringstream content(all);
    binary::Archive io(content);
    skip_bodies(content, scene_.bodies.size(), event::kNoState);
    all_events_.clear();
    hand_overs_.clear();
    closed_.clear();
    steps_.reset();
    steps_before_ = Counts();
    begin_events(event::Begin::later);
    if (!binary::begins(content, kHandedOver)) {
      content = std::istringstream(all);
      events_->restore(content, how);
    } else {
      exchange_hand_overs(*this, io);
      io.demand(are_in_order());
      if (hand_overs_.back().back) {
        events_->restore(content, how);
      } else {
        begin_steps();
        steps_->restore(content, how);
      }
      io.demand(hand_overs_.back().back.value_or(hand_overs_.back().time) <=
                time() + step_);  // a boundary may lie shortly before
    }
    if (content.peek() != std::char_traits<char>::eof())
      throw std::runtime_error("the saved state is longer than this scene needs");
  }

 private:
  const Engine& now() const {
    return steps_ ? static_cast<const Engine&>(*steps_) : static_cast<const Engine&>(*events_);
  }
  void pass_interrupts_to(Engine& engine) {
    engine.stop_when([this] { return interrupted(); });
  }
  void begin_events(event::Begin begin) {
    events_ = make_(scene_, begin);
    pass_interrupts_to(*events_);
    from_events_ = 0;
  }
  void begin_steps() {
    steps_ = std::make_unique<stepping::SteppingEngine>(steps_scene_);
    pass_interrupts_to(*steps_);
  }
  Counts counts_of_steps() const {
    Counts c = steps_->counts();
    c.steps -= static_cast<long>(hand_overs_.back().time / step_);  // counted from t = 0
    return c;
  }

  void append_events() {
    const std::vector<ContactEvent>& all = events_->events();
    all_events_.insert(all_events_.end(), all.begin() + static_cast<std::ptrdiff_t>(from_events_),
                       all.end());
    from_events_ = all.size();
  }
  void append_hand_over(HandOver hand_over, double energy) {
    ContactEvent event;
    event.time = hand_over.time;
    event.kind = ContactEvent::Kind::hand_over;
    all_events_.push_back(event);
    hand_overs_.push_back(std::move(hand_over));
    energy_ = energy;
    unchanged_steps_ = 0;
    closed_.clear();
  }
  void require_twice() {
    required_steps_ = std::min(2 * required_steps_, std::int64_t{binary::kMostCounted});
  }
  void take_over(const std::string& why) {
    append_events();
    const double since = hand_overs_.empty() ? 0 : *hand_overs_.back().back;
    const double required_time = static_cast<double>(required_steps_) * step_;
    if (events_->time() - since >= required_time)
      required_steps_ = kUnchangedSteps;
    else if (!hand_overs_.empty())
      require_twice();
    begin_steps();
    append_hand_over({events_->time(), why, events_->counts(), {}, 0}, energy_of(*events_));
    steps_->begin_at(events_->time(), events_->bodies());
  }
  void give_back_if_settled() {
    if (!may_give_back()) return;
    std::optional<std::vector<int>> closed = events_->closed_in({time(), bodies(), step_});
    unchanged_steps_ =
        closed && (unchanged_steps_ == 0 || *closed == closed_) ? unchanged_steps_ + 1 : 0;
    if (closed) closed_ = std::move(*closed);
    if (unchanged_steps_ < required_steps_) return;
    try {
      give_back();
    } catch (const SimulationError&) {
      require_twice();
    } catch (const std::invalid_argument&) {
      require_twice();
    }
  }
  void give_back() {
    HandOver& last = hand_overs_.back();
    events_->resume({time(), bodies(), step_}, last.before);
    from_events_ = 0;
    double lost = energy_ - energy_of(*events_);
    for (const ContactEvent& each : events_->events()) lost -= each.lost;
    last.back = time();
    last.lost = lost;
    ContactEvent event;
    event.time = time();
    event.kind = ContactEvent::Kind::resume;
    event.lost = lost;
    all_events_.push_back(event);
    steps_before_ += counts_of_steps();
    steps_.reset();
    append_events();
  }
  // Returns false if the event engine has used up its limits of events or steps.
  bool may_give_back() const {
    const EventOptions& options = *scene_.event;
    const Counts& before = hand_overs_.back().before;
    return before.events <= options.max_events && before.steps <= options.max_steps &&
           hand_overs_.size() < kMostHandOvers;
  }
  template <class Self>
  static void exchange_hand_overs(Self& self, binary::Archive& io) {
    io.list(self.hand_overs_, [&](auto& each) {
      Counts before = each.before;
      before.each([&](long& n) { io(n); });
      double back = each.back.value_or(-1);
      io(each.time, back, each.lost, each.why);
      io.demand(std::isfinite(each.time) && std::isfinite(back) && std::isfinite(each.lost));
      if constexpr (!std::is_const_v<Self>) {
        each.before = before;
        if (back >= 0) each.back = back;
      }
    });
    io(self.energy_, self.unchanged_steps_, self.required_steps_);
    io.demand(std::isfinite(self.energy_) && self.unchanged_steps_ >= 0 &&
              self.unchanged_steps_ <= std::int64_t{binary::kMostCounted} &&
              self.required_steps_ >= kUnchangedSteps &&
              self.required_steps_ <= std::int64_t{binary::kMostCounted});
    io.list(self.closed_, [&](auto& contact) { io(contact); });
  }
  // Each begins where the one before has ended, or later.
  bool are_in_order() const {
    bool good = !hand_overs_.empty() && hand_overs_.size() <= kMostHandOvers;
    std::optional<double> since = 0;
    for (const HandOver& each : hand_overs_) {
      Counts before = each.before;
      before.each([&](long n) { good = good && n >= 0 && n <= binary::kMostCounted; });
      good = good && since && each.time >= *since && each.back.value_or(each.time) >= each.time;
      since = each.back;
    }
    return good;
  }

  double step_;
  Scene scene_, steps_scene_;
  event::MakeResumable make_;
  std::unique_ptr<event::ResumableEngine> events_;
  std::unique_ptr<stepping::SteppingEngine> steps_;  // while they stand in
  std::vector<HandOver> hand_overs_;
  std::vector<ContactEvent> all_events_;
  std::size_t from_events_ = 0;
  Counts steps_before_;  // of steps that have given back
  double energy_ = 0;    // at the last hand-over
  std::int64_t unchanged_steps_ = 0, required_steps_ = kUnchangedSteps;
  std::vector<int> closed_;  // contacts, for `unchanged_steps_` steps
};

}  // namespace

const std::vector<HandOver>& Engine::hand_overs() const {
  static const std::vector<HandOver> none;
  return none;
}

std::unique_ptr<Engine> event::make_events_then_steps(const Scene& scene, MakeResumable make) {
  return std::make_unique<EventsThenSteps>(scene, std::move(make));
}

std::unique_ptr<Engine> make_event_engine_with_steps(const Scene& scene) {
  return event::make_events_then_steps(scene, event::make_resumable_engine);
}

}  // namespace tether::scene
