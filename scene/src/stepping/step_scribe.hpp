// Tether: writes what steps do to the certificate. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bounds.hpp"
#include "certificate/joint_lines.hpp"
#include "certificate/sheet.hpp"
#include "stepping_engine.hpp"

namespace tether::scene::stepping {

using certificate::Line;
using contact::PointContact;
using contact::StepContacts;
using Eigen::Vector3d;
using linalg::at;

/// Observes the stages of each sub-step. A sub-step that the stepper takes back is known by the
/// next one, which begins where that one began; an impact at which a step is cut, and what an error
/// control has moved, by the next one, too, which begins elsewhere than the last one ended.
class StepScribe final : public certificate::Source {
 public:
  StepScribe(const Scene& scene, contact::Stepper& stepper, certificate::Sheet& sheet)
      : scene_(scene),
        stepper_(stepper),
        sheet_(sheet),
        held_(scene.bodies.size(), 0),
        chain_(scene.bodies.size()),
        at_places_(scene) {
    for (const std::size_t i : scene.moving()) moving_.push_back(static_cast<int>(i));
    joints_ = std::make_unique<SteppedJoints>(scene);
    if (!scene.joints.empty()) joint_lines_ = std::make_unique<certificate::JointLines>(scene);
    for (const Joint& joint : scene.joints)
      for (const int body : {joint.first, joint.second})
        if (scene.moves(body)) held_[at(body)] = 1;
    sheet.begin(scene, "stepping", *this);
    stepper.observe([this](const contact::StepStage& stage) { see(stage); });
  }
  ~StepScribe() override {
    try {
      flush();
    } catch (const std::exception&) {  // the recorder of the certificate meets it again
    }
    sheet_.leave(*this);
  }
  StepScribe(const StepScribe&) = delete;
  StepScribe& operator=(const StepScribe&) = delete;

  /// Between steps: writes those so far.
  void flush() override {
    if (step_ < 0 || stepper_.counts().steps == step_) return;  // nothing, or amid a step
    explain(stepper_.time(), moving_);
    std::string out;
    Line(out, "step") << static_cast<double>(step_) << began_ << stepper_.time()
                      << stepper_.residual() << (stepper_.succeeded() ? 1 : 0);
    for (const Part& part : parts_) out += part.text;
    parts_.clear();
    step_ = -1;
    sheet_.put(out);
  }

 private:
  static bool same_place(const BodyState& a, const BodyState& b) {
    return a.position == b.position && a.orientation.coeffs() == b.orientation.coeffs();
  }

  static bool same(const BodyState& a, const BodyState& b) {
    return same_place(a, b) && a.velocity == b.velocity && a.angular_velocity == b.angular_velocity;
  }

  // Stages that are no forces, and the weight, which the judge knows.
  static bool is_mechanism(std::string_view effect) {
    return contains(std::array<std::string_view, 7>{"joints", "contact", "restitution", "collision",
                                                    "penetration", "motion", "gravity"},
                    effect);
  }

  static bool any(const std::vector<Vector3d>& impulses) {
    return any_of(impulses, [](const Vector3d& x) { return !x.isZero(0); });
  }

  /// A body's state and since when it has it.
  struct Reached {
    double time = -1;
    BodyState state;
  };
  struct Part {
    double start = 0;
    std::vector<int> bodies;
    std::vector<Reached> before;  // of these
    std::string text;
  };

  void see(const contact::StepStage& stage) {
    using When = contact::StepStage::When;
    if (stage.when == When::before_all) return begin_part(stage);
    after_stage(stage);
    if (stage.when == When::after_all) end_part(stage);
  }
  void begin_part(const contact::StepStage& stage) {
    if (stepper_.counts().steps != step_) {
      flush();
      step_ = stepper_.counts().steps;
      began_ = stage.start;
    }
    now_.clear();
    for (const int i : moving_)
      if (stage.active == nullptr || (*stage.active)[at(i)] != 0) now_.push_back(i);
    explain(stage.start, now_);
    take_states(begin_);
    last_ = solved_ = placed_ = begin_;
    pushes_.clear();
    phase_ = Phase::first;
    first_impulses_.clear();
    contacts_ = {};
  }
  void after_stage(const contact::StepStage& stage) {
    const std::string_view effect = stage.effect;
    const bool at_first = phase_ == Phase::first;
    if (at_first) phase_ = Phase::solving;
    if (phase_ == Phase::solving && effect == "motion") {
      phase_ = Phase::moved;
      placed_ = last_;
      contacts_ = stepper_.contacts();
      as_solved_ = stage.solved;
    }
    const bool moved = phase_ == Phase::moved;
    if (at_first && effect == "joints") note_push("put onto joints");
    if (!is_mechanism(effect) && (!moved || effect == "sleep")) note_push(stage.effect);
    take_states(last_);
    if (!moved && effect != "penetration") solved_ = last_;
    if (effect == "contact") first_impulses_ = stepper_.contacts().impulses;
  }
  void note_push(const char* effect) {
    const contact::BodySet& b = stepper_.bodies();
    for (const int i : now_) {
      const BodyState now = state(i);
      const Vector3d dv = now.velocity - last_[at(i)].velocity;
      const Vector3d dw = now.angular_velocity - last_[at(i)].angular_velocity;
      if (dv.isZero(0) && dw.isZero(0)) continue;
      const Vector3d spin =
          now.orientation * (b.inertia[at(i)] * (now.orientation.conjugate() * dw));
      Line(pushes_, "push") << i << b.mass[at(i)] * dv << spin << effect;
    }
  }
  void end_part(const contact::StepStage& stage) {
    const double end = stage.start + stage.length;
    std::string inside = pushes_;
    const bool composed = contacts_.impulses != first_impulses_;
    const double residual = put_contacts(inside, contacts_, as_solved_, solved_);
    if (hold(now_)) {
      std::vector<double> pulls = stepper_.joint_impulses();
      for (std::size_t row = 0; row < pulls.size(); ++row)
        pulls[row] -= stage.joint_impulses_at_end[row];  // these are told at the end
      put_pulls(inside, begin_, stage.start, pulls);
    }
    put_laws(inside, stage.start, stage.length);
    Part part;
    part.start = stage.start;
    part.bodies = now_;
    Line(part.text, "part") << stage.start << stage.length << (composed ? 1 : 0) << residual;
    part.text += inside;
    for (const int i : now_) {
      part.before.push_back(chain_[at(i)]);
      if (!same_place(placed_[at(i)], begin_[at(i)]))
        Line(part.text, "placed") << i << placed_[at(i)].position << placed_[at(i)].orientation;
    }
    const bool pulled = any_of(stage.joint_impulses_at_end, [](double x) { return x != 0; });
    if (hold(now_) && pulled) put_pulls_at_end(end, stage.joint_impulses_at_end, part);
    reach(end, now_, part.text);
    parts_.push_back(std::move(part));
  }
  // Says how bodies have come from where the last sub-step left them to where they are.
  void explain(double time, const std::vector<int>& bodies) {
    if (is_at(time, bodies) || take_back(time, bodies)) return;
    const auto reached = [&](const auto& like) {
      return all_of(bodies, [&](int i) {
        return chain_[at(i)].time >= 0 && like(chain_[at(i)].state, state(i));
      });
    };
    Part part;
    part.start = time;
    part.bodies = bodies;
    for (const int i : bodies) part.before.push_back(chain_[at(i)]);
    if (reached(same_place) && any(stepper_.contacts().impulses))
      put_impact(part);
    else
      Line(part.text, "reached") << time;
    reach(time, bodies, part.text);
    parts_.push_back(std::move(part));
  }
  // False: they have never been where they are now.
  bool take_back(double time, const std::vector<int>& bodies) {
    const std::vector<Reached> end = chain_;
    for (std::size_t k = parts_.size(); k > 0; --k) {
      const Part& part = parts_[k - 1];
      for (std::size_t i = 0; i < part.bodies.size(); ++i)
        chain_[at(part.bodies[i])] = part.before[i];
      if (!is_at(time, bodies)) continue;
      parts_.resize(k - 1);
      return true;
    }
    chain_ = end;
    return false;
  }
  bool is_at(double time, const std::vector<int>& bodies) const {
    for (const int i : bodies) {
      const Reached& reached = chain_[at(i)];
      if (std::abs(reached.time - time) > kSameFigure * stepper_.options().step ||
          !same(reached.state, state(i)))
        return false;
    }
    return true;
  }
  // At the places that the bodies have, from the velocities of the chain.
  void put_impact(Part& part) {
    take_states(begin_);
    StepContacts struck = stepper_.contacts();
    std::string inside;
    const double residual = put_contacts(inside, struck, struck.points, begin_);
    if (hold(part.bodies)) put_pulls(inside, begin_, part.start, stepper_.joint_impulses());
    const bool in_turn =
        stepper_.options().simultaneous_impacts == contact::SimultaneousImpacts::in_turn;
    Line(part.text, "part") << part.start << 0.0 << (in_turn ? 1 : 0) << residual;
    part.text += inside;
  }
  bool hold(const std::vector<int>& bodies) const {
    return joint_lines_ && any_of(bodies, [&](int i) { return held_[at(i)] != 0; });
  }
  void put_pulls(std::string& out, const std::vector<BodyState>& at, double t,
                 const std::vector<double>& impulses) {
    if (!joint_lines_) return;
    const mechanics::Bodies& bodies = place(at);
    joint_lines_->put_pulls(bodies, t, joint_lines_->reactions(bodies, t, impulses), out);
  }
  // Joints pull once more at the end of a sub-step, which is a part of no length.
  void put_pulls_at_end(double t, const std::vector<double>& impulses, Part& part) {
    const mechanics::Bodies& bodies = place(last_);
    const std::vector<JointForce> pulls = joint_lines_->reactions(bodies, t, impulses);
    for (std::size_t j = 0; j < pulls.size(); ++j)
      for (const auto& [body, sign] :
           {std::pair(scene_.joints[j].first, 1.0), std::pair(scene_.joints[j].second, -1.0)}) {
        if (!scene_.moves(body)) continue;
        const contact::BodySet& set = stepper_.bodies();
        BodyState& s = last_[at(body)];
        const Vector3d moment = pulls[j].moment + (pulls[j].at - s.position).cross(pulls[j].force);
        const linalg::Quaternion& q = s.orientation;
        s.velocity -= sign / set.mass[at(body)] * pulls[j].force;
        s.angular_velocity -=
            sign * (q * (set.inertia[at(body)].inverse() * (q.conjugate() * moment)));
      }
    for (const int i : now_) Line(part.text, "to") << i << last_[at(i)];
    Line(part.text, "part") << t << 0.0 << 0 << 0.0;
    put_pulls(part.text, last_, t, impulses);
  }
  // As they were where the sub-step began.
  void put_laws(std::string& out, double t, double dt) {
    if (!joints_->has_laws()) return;
    place(begin_);
    laws_.clear();
    joints_->add_laws(places_, t, laws_);
    const std::vector<double>& impulses = stepper_.law_impulses();
    joints_->change_bounds(impulses, dt, laws_);
    for (int k = 0; k < laws_.count() && at(k) < impulses.size(); ++k) {
      const contact::JointLaws::Law& law = laws_[k];
      const auto *first = laws_.rows().begin(k), *last = laws_.rows().end(k);
      if (std::none_of(first, last, [&](const auto& term) { return contains(now_, term.body); }))
        continue;
      // A spring: x = -dt (stiffness (stretch + dt slip) + damping slip), slip = speed - rate.
      const double gain = law.stiffness * dt + law.damping;
      const double wanted =
          law.is_sprung() ? law.rate - law.stiffness * law.stretch / gain : law.rate;
      const double most = std::min(law.bound * dt, std::numeric_limits<double>::max());
      Line(out, "law") << k << (law.is_limit() ? 0 : -most)
                       << (law.is_limit() ? std::numeric_limits<double>::max() : most)
                       << (law.is_limit() ? 0 : wanted) << (law.is_sprung() ? 1 / (dt * gain) : 0)
                       << (law.is_limit() ? law.gap : 0) << (law.is_limit() ? law.restitution : 0)
                       << impulses[at(k)] << joints_->name(law.joint);
      for (const auto* term = first; term != last; ++term)
        Line(out, "on") << k << term->body << Vector3d(term->G.head<3>())
                        << Vector3d(term->G.tail<3>());
    }
  }
  const mechanics::Bodies& place(const std::vector<BodyState>& states) {
    places_ = stepper_.bodies();
    for (int i = 0; i < places_.size(); ++i) mechanics::put_state(states[at(i)], i, places_);
    at_places_.copy(places_);
    return at_places_.bodies();
  }
  // Returns the largest natural residual, m/s.
  double put_contacts(std::string& out, const StepContacts& contacts,
                      const std::vector<PointContact>& solved,
                      const std::vector<BodyState>& velocities) const {
    const contact::BodySet& b = stepper_.bodies();
    bool as_solved = solved.size() == contacts.points.size() && any(contacts.impulses);
    for (std::size_t k = 0; as_solved && k < solved.size(); ++k)
      as_solved = solved[k].id == contacts.points[k].id;
    double most = 0;
    for (std::size_t k = 0; k < contacts.points.size(); ++k) {
      const PointContact& c = as_solved ? solved[k] : contacts.points[k];
      const Vector3d x = k < contacts.impulses.size() ? contacts.impulses[k] : Vector3d::Zero();
      const Vector3d moment = k < contacts.moments.size() ? contacts.moments[k] : Vector3d::Zero();
      Line(out, "contact") << c.first << c.second << begin_[at(c.first)].position + c.r1
                           << begin_[at(c.second)].position + c.r2 << c.normal << contacts.gaps[k]
                           << c.bias << c.slip << x << moment;
      const auto speed = [&](int body, const Vector3d& r) -> Vector3d {
        const BodyState& s = velocities[at(body)];
        return s.velocity + s.angular_velocity.cross(r);
      };
      const Vector3d w = speed(c.first, c.r1) - speed(c.second, c.r2) + c.slip + c.bias * c.normal;
      const double inverse =
          b.motion[at(c.first)].inverse_mass + b.motion[at(c.second)].inverse_mass;
      most = std::max(most, certificate::natural_residual(
                                certificate::friction(scene_, c.first, c.second, begin_), c.normal,
                                inverse * x, w));
    }
    return most;
  }
  void reach(double time, const std::vector<int>& bodies, std::string& out) {
    for (const int i : bodies) {
      chain_[at(i)] = {time, state(i)};
      Line(out, "to") << i << chain_[at(i)].state;
    }
  }
  BodyState state(int body) const { return mechanics::state_of(stepper_.bodies(), body); }
  void take_states(std::vector<BodyState>& out) const {
    out.resize(chain_.size());
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = state(static_cast<int>(i));
  }

  const Scene scene_;
  contact::Stepper& stepper_;
  certificate::Sheet& sheet_;
  std::unique_ptr<SteppedJoints> joints_;                 // null: none
  std::unique_ptr<certificate::JointLines> joint_lines_;  // as above
  std::vector<int> moving_;
  std::vector<char> held_;      // bodies, by joints
  long step_ = -1;              // that `parts_` belong to
  double began_ = 0;            // s
  std::vector<Reached> chain_;  // by body
  std::vector<Part> parts_;

  // The sub-step that is being taken.
  std::vector<int> now_;                                   // bodies
  std::vector<BodyState> begin_, last_, solved_, placed_;  // by body; solved_: by contacts
  std::string pushes_;
  enum class Phase : std::uint8_t { first, solving, moved } phase_ = Phase::first;
  std::vector<Eigen::Vector3d> first_impulses_;
  contact::StepContacts contacts_;
  std::vector<contact::PointContact> as_solved_;
  contact::JointLaws laws_;
  contact::BodySet places_;             // as joints see them
  mechanics::SteppedBodies at_places_;  // bodies there
};

}  // namespace tether::scene::stepping
