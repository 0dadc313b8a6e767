// Tether: events, and steps from where they cannot go on. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <istream>
#include <iterator>
#include <ostream>
#include <sstream>
#include <stdexcept>

#include "output/binary.hpp"
#include "output/saved_bodies.hpp"
#include "stepping/stepping_engine.hpp"

namespace tether::scene {

namespace {

constexpr char kHandedOver[8] = {'h', 'a', 'n', 'd', 'e', 'd', ' ', '1'};
constexpr std::uint64_t kLongestWhy = 100000;

/// Those that the event engine has.
template <class Counts, class F>
void each_number(Counts& c, const F& f) {
  for (auto* n : {&c.steps, &c.residual_evaluations, &c.jacobian_evaluations, &c.projections,
                  &c.error_test_failures, &c.contact_problems, &c.events, &c.impacts})
    f(*n);
}

/// A state of the event engine until the hand-over; behind it that of the stepping engine, after
/// the bodies (for a scene of steps alone), the time and why.
class EventsThenSteps final : public Engine {
 public:
  explicit EventsThenSteps(const Scene& scene) : scene_(scene) {
    scene_.event->otherwise = Otherwise::stop;
    steps_scene_ = scene_;
    steps_scene_.event.reset();
    steps_scene_.engine = EngineChoice::stepping;
    try {
      events_ = make_event_engine(scene_);
      pass_interrupts_to(*events_);
    } catch (const SimulationError& e) {  // in impacts at the start
      begin_steps();
      tell({0, e.what(), {}});
    }
  }

  const char* name() const override { return "event"; }
  double time() const override { return now().time(); }

  void advance(double t) override {
    if (!steps_) try {
        events_->advance(t);
        return tell_events();
      } catch (const SimulationError& e) {
        take_over(e.what());
      }
    steps_->advance(t);
  }

  const std::vector<BodyState>& bodies() const override { return now().bodies(); }
  Diagnostics diagnostics() const override { return now().diagnostics(); }
  const std::vector<ContactState>& contacts() const override { return now().contacts(); }
  Forces forces() const override { return now().forces(); }
  const std::vector<ContactEvent>& events() const override { return told_; }
  std::vector<EffectCost> costs() const override { return now().costs(); }
  std::optional<HandOver> hand_over() const override { return hand_over_; }

  Counts counts() const override {
    Counts c = now().counts();
    if (!hand_over_) return c;
    const double step = scene_.stepping.value_or(SteppingOptions{}).step;
    c.steps -= static_cast<long>(hand_over_->time / step);  // counted from t = 0
    c.events = hand_over_->before.events;
    c.impacts = hand_over_->before.impacts;
    return c;
  }

  void save(std::ostream& out) const override {
    if (!steps_) return events_->save(out);
    put_bodies(out, time(), bodies());
    out.write(kHandedOver, sizeof kHandedOver);
    each_number(hand_over_->before,
                [&](long n) { binary::put(out, static_cast<std::int64_t>(n)); });
    binary::put(out, hand_over_->time, static_cast<std::uint64_t>(hand_over_->why.size()));
    out << hand_over_->why;
    steps_->save(out);
  }

  void restore(std::istream& in, Restore how) override;

 private:
  const Engine& now() const { return steps_ ? static_cast<const Engine&>(*steps_) : *events_; }
  void pass_interrupts_to(Engine& engine) {
    engine.stop_when([this] { return interrupted(); });
  }
  void begin_steps() {
    steps_ = std::make_unique<stepping::SteppingEngine>(steps_scene_);
    pass_interrupts_to(*steps_);
  }

  void tell_events() {
    const std::vector<ContactEvent>& all = events_->events();
    told_.insert(told_.end(), all.begin() + static_cast<std::ptrdiff_t>(from_events_), all.end());
    from_events_ = all.size();
  }
  void tell(HandOver hand_over) {
    ContactEvent event;
    event.time = hand_over.time;
    event.kind = ContactEvent::Kind::hand_over;
    told_.push_back(event);
    hand_over_ = std::move(hand_over);
  }
  void take_over(const std::string& why) {
    tell_events();
    begin_steps();
    tell({events_->time(), why, events_->counts()});
    steps_->begin_at(events_->time(), events_->bodies());
  }

  Scene scene_, steps_scene_;
  std::unique_ptr<Engine> events_;
  std::unique_ptr<stepping::SteppingEngine> steps_;  // from the hand-over on
  std::optional<HandOver> hand_over_;
  std::vector<ContactEvent> told_;
  std::size_t from_events_ = 0;
};

void EventsThenSteps::restore(std::istream& in, Restore how) {
  const std::string all{std::istreambuf_iterator<char>(in), {}};
  std::istringstream content(all);
  char magic[sizeof kHandedOver];
  std::vector<BodyState> bodies(scene_.bodies.size());
  content.read(magic, sizeof magic);
  if (content && std::equal(magic, magic + sizeof magic, kBodiesFirst)) {
    get_bodies(content, bodies);
    content.read(magic, sizeof magic);
  }
  told_.clear();
  from_events_ = 0;
  if (!content || !std::equal(magic, magic + sizeof magic, kHandedOver)) {
    if (!events_) events_ = make_event_engine(scene_);
    pass_interrupts_to(*events_);
    steps_.reset();
    hand_over_.reset();
    std::istringstream whole(all);
    events_->restore(whole, how);
    if (whole.peek() != std::char_traits<char>::eof())
      throw std::runtime_error("the saved state is longer than this scene needs");
    return;
  }
  HandOver was;
  std::uint64_t length = 0;
  each_number(was.before,
              [&](long& n) { n = static_cast<long>(binary::get<std::int64_t>(content)); });
  binary::get(content, was.time, length);
  if (length > kLongestWhy) throw std::runtime_error("the saved state is damaged");
  was.why.resize(length);
  content.read(was.why.data(), static_cast<std::streamsize>(length));
  begin_steps();
  steps_->restore(content, how);
  if (content.peek() != std::char_traits<char>::eof())
    throw std::runtime_error("the saved state is longer than this scene needs");
  hand_over_ = std::move(was);
}

}  // namespace

std::unique_ptr<Engine> make_event_engine_with_steps(const Scene& scene) {
  return std::make_unique<EventsThenSteps>(scene);
}

}  // namespace tether::scene
