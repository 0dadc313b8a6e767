// Tether: the engine of scenes whose events are found to a tolerance. SPDX-License-Identifier:
// BSD-3-Clause

#include "certificate/instant_scribe.hpp"
#include "driver.hpp"
#include "effects/numbers.hpp"
#include "event/model/model.hpp"
#include "event/resumable.hpp"
#include "joints/joint_type.hpp"
#include "mechanics/force.hpp"
#include "output/binary.hpp"
#include "smooth/units.hpp"

namespace tether::scene {

namespace {

using namespace event;
using mechanics::at;

constexpr binary::Magic kMagic = {'e', 'v', 'e', 'n', 't', ' ', ' ', '6'};

DriverOptions driver_options(const Scene& scene, double time_unit) {
  const EventOptions o = scene.event.value_or(EventOptions{});
  DriverOptions out;
  out.tolerance = o.tolerance;
  out.max_step = effects::longest_step(scene, o.max_step);
  out.simultaneous = scene.simultaneous_impacts;
  out.max_events = o.max_events;
  out.max_steps = o.max_steps;
  out.end = scene.end / time_unit;
  return out;
}

// The state that is saved is the start of the present phase and the time reached, as that of the
// smooth engine: IDA's history cannot be given to it.
class EventEngine : public ResumableEngine {
 public:
  EventEngine(const Scene& scene, Begin begin)
      : units_(event::units_of(scene)),
        origin_(event::origin_of(scaled(scene, units_))),
        scene_(event::seen_from(origin_, scaled(scene, units_))),
        options_(driver_options(scene_, units_.time)),
        model_(std::make_unique<Model>(scene_, units_.time, units_.length)),
        reactions_(scene_, mechanics::placed_bodies(scene_)),
        bodies_(mechanics::placed_states(scene)) {
    now_.setZero(model_->coordinates() + model_->velocities() + 1);
    if (scene.certificate) to_certify_ = scene;
    if (begin == Begin::later) return;
    driver_ = std::make_unique<Driver>(*model_, options_, scene_.start ? scene_.start->time : 0.0,
                                       model_->start());
    update_results();
    certify();
  }

  const char* name() const override { return "event"; }
  double time() const override { return units_.time * driver_->time(); }

  void advance(double t) override {
    std::function<double()> above;
    if (excess()) above = [this] { return excess()(forces_of_motion()); };
    try {
      driver_->advance(
          t / units_.time, [this] { return interrupted(); }, above);
    } catch (const SimulationError&) {
      update_results();
      throw;
    }
    update_results();
  }

  const std::vector<BodyState>& bodies() const override { return bodies_; }
  Diagnostics diagnostics() const override { return diagnostics_; }
  const std::vector<ContactState>& contacts() const override {
    if (!contacts_) contacts_ = contact_states();
    return *contacts_;
  }
  Forces forces() const override {
    find_forces();
    return forces_of_motion();
  }
  const std::vector<ContactEvent>& events() const override { return events_; }

  Counts counts() const override { return driver_->counts(); }
  std::vector<EffectCost> costs() const override { return {}; }

  void save(std::ostream& out) const override {
    Driver::Memory m = driver_->memory();
    double reached = driver_->time();
    VectorXd now = now_;
    write_bodies(out, time(), bodies_, kMagic);
    binary::Archive io(out);
    exchange(io, m, reached, now);
  }
  void restore(std::istream& in, Restore how) override {
    binary::Archive io(in);
    skip_bodies(in, bodies_.size(), kNoState);
    if (!binary::begins(in, kMagic)) throw std::runtime_error(kNoState);
    Driver::Memory m;
    double reached = 0;
    VectorXd saved;
    exchange(io, m, reached, saved);
    for (int i = 0; i < model_->contacts(); ++i)
      if (const int by = model_->law(i).held_by; by >= 0)
        io.demand(m.modes[at(i)].mode == Mode::open || m.modes[at(by)].mode != Mode::open);
    io.demand(m.is_sound() && reached >= m.time && std::isfinite(reached));
    events_.clear();
    if (how == Restore::near) {
      driver_ = std::make_unique<Driver>(*model_, options_, reached,
                                         VectorXd(saved.head(saved.size() - 1)));
      update_results();
      return certify();
    }
    driver_ = std::make_unique<Driver>(*model_, options_, m);
    bool arrives = false;
    try {
      arrives = driver_->arrive(reached);
    } catch (const SimulationError& e) {
      throw std::runtime_error(std::string("the saved state cannot be arrived at again: ") +
                               e.what());
    }
    update_results();
    certify();
    if (!arrives || now_ != saved)
      throw std::runtime_error(
          "the saved state is of another build or machine: the same steps lead to other bits here");
  }

  std::optional<std::vector<int>> closed_in(const SteppedState& state) override {
    const VectorXd y = coordinates_of(state.bodies);
    return closed_contacts(*model_, exactness_of(*model_, state, y));
  }
  void resume(const SteppedState& state, const Counts& so_far) override {
    // A saved state does not hold what a model remembers of earlier states.
    auto model = std::make_unique<Model>(scene_, units_.time, units_.length);
    const VectorXd y = coordinates_of(state.bodies);
    StartState start = exactness_of(*model, state, y);
    start.so_far = so_far;
    driver_ = std::make_unique<Driver>(*model, options_, state.time / units_.time, y, start);
    model_ = std::move(model);
    events_.clear();
    update_results();
    certify();
  }

 private:
  void certify() {
    if (to_certify_ && !scribe_)
      scribe_ = std::make_unique<certificate::InstantScribe>(
          *to_certify_, *this, [this] { return accelerations(); }, *to_certify_->certificate);
    if (scribe_)
      driver_->observe([this](const ContactRows& rows, const VectorXd& x, const VectorXd& rest,
                              const VectorXd& before, bool exact) {
        const auto struck = [&](const VectorXd& impulses) {
          return states_of(impulses.size() > 0 ? rows.contacts() : std::vector<int>(),
                           units_.mass * units_.speed(),
                           [&](std::size_t k) { return rows.of(static_cast<int>(k), impulses); });
        };
        put_impact(before, struck(x), struck(rest), exact);
      });
  }
  // Pairs that touch, with the forces or impulses on their first bodies: those by normal and
  // tangents that each contact has, in this unit. Moments are those of the pairs that hold them.
  std::vector<ContactState> states_of(const std::vector<int>& contacts, double unit,
                                      const std::function<VectorXd(std::size_t)>& parts) const {
    std::vector<ContactState> out;
    std::vector<int> pairs;
    for (std::size_t k = 0; k < contacts.size(); ++k) {
      const int contact = contacts[k];
      if (model_->is_law(contact)) continue;
      const Vector3d on_first = model_->in_space(contact, parts(k));
      if (model_->is_moment(contact)) {
        const auto by = std::find(pairs.begin(), pairs.end(), model_->law(contact).held_by);
        out[at(static_cast<int>(by - pairs.begin()))].moment += unit * units_.length * on_first;
        continue;
      }
      const FeaturePair& pair = model_->pair(contact);
      const Touch touch = pair.touch(model_->bodies().all());
      pairs.push_back(contact);
      ContactState& c = out.emplace_back();
      c.first = pair.first;
      c.second = pair.second;
      c.point = units_.length * touch.point;
      to_world(c.point);
      c.normal = touch.normal;
      c.gap = units_.length * touch.gap;
      c.force = unit * on_first;
    }
    return out;
  }
  // The model has the state after it.
  void put_impact(const VectorXd& before, const std::vector<ContactState>& contacts,
                  const std::vector<ContactState>& rest, bool exact) {
    std::vector<BodyState> after = bodies_;
    const smooth::MovingBodies& bodies = model_->bodies();
    bodies.read(model_->bodies_state(), after);
    std::vector<BodyState> came = after;
    for (int k = 0; k < bodies.count(); ++k) {
      BodyState &end = after[at(bodies.body(k))], &start = came[at(bodies.body(k))];
      start.velocity = before.segment<3>(6 * k);
      start.angular_velocity = bodies.frame(k).R * before.segment<3>(6 * k + 3);
      for (BodyState* each : {&start, &end}) {
        smooth::to_si(units_, *each);
        to_world(each->position);
      }
    }
    scribe_->put_impact(units_.time * bodies.all().time, came, after, contacts, rest, exact);
  }
  std::vector<std::array<Vector3d, 2>> accelerations() const {
    const VectorXd rate = find_forces();
    std::vector<std::array<Vector3d, 2>> out;
    for (int k = 0; k < model_->bodies().count(); ++k) {
      const Vector3d a = rate.segment<3>(model_->coordinates() + 6 * k);
      const Vector3d turn = rate.segment<3>(model_->coordinates() + 6 * k + 3);
      out.push_back({a * (units_.speed() / units_.time),
                     model_->bodies().frame(k).R * turn / (units_.time * units_.time)});
    }
    return out;
  }
  VectorXd coordinates_of(const std::vector<BodyState>& bodies) const {
    const smooth::MovingBodies& moving = model_->bodies();
    const int nq = model_->coordinates();
    VectorXd y(nq + model_->velocities());
    for (int k = 0; k < moving.count(); ++k) {
      const BodyState& b = bodies[at(moving.body(k))];
      Vector3d place = b.position / units_.length;
      if (far()) place -= origin_;
      const linalg::Quaternion& q = b.orientation;
      y.segment<3>(7 * k) = place;
      y.segment<4>(7 * k + 3) << q.w(), q.x(), q.y(), q.z();
      y.segment<3>(nq + 6 * k) = b.velocity / units_.speed();
      y.segment<3>(nq + 6 * k + 3) = q.conjugate() * (b.angular_velocity * units_.time);
    }
    return y;
  }
  // Contacts that a step has closed fall and are stopped by as much as the accelerations make of
  // it.
  StartState exactness_of(Model& model, const SteppedState& state, const VectorXd& y) const {
    constexpr double kLeast = 1e-6;
    model.set(state.time / units_.time, y.data());
    VectorXd a;
    model.forces(a);
    model.divide_by_mass(a);
    double fastest = 0;
    for (int k = 0; k < model.bodies().count(); ++k)
      fastest = std::max(fastest, a.segment<3>(6 * k).norm());
    const double step = state.step / units_.time;
    StartState out;
    out.speed = 4 * fastest * step + kLeast;
    out.gap = out.speed * step + kLeast;
    return out;
  }
  Forces forces_of_motion() const {
    event::Motion& motion = driver_->motion();
    const event::RowForces forces = motion.row_forces();
    Forces out = model_->forces_of(reactions_, forces.joints);
    for (std::size_t k = 0; k < forces.contacts.size(); ++k)
      if (const int contact = motion.closed()[k]; model_->is_law(contact))
        model_->add_law_force(contact, forces.contacts[k], out);
    smooth::to_si(units_, scene_, out);
    for (JointForce& each : out.joints) to_world(each.at);
    for (SpringForce& each : out.springs) {
      to_world(each.at);
      to_world(each.at_second);
    }
    return out;
  }
  void update_results() {
    now_ = driver_->state();
    const smooth::MovingBodies& bodies = model_->bodies();
    bodies.read(model_->bodies_state(), bodies_);
    for (std::size_t b = 0; b < bodies_.size(); ++b)
      if (!scene_.bodies[b].fixed) {
        smooth::to_si(units_, bodies_[b]);
        to_world(bodies_[b].position);
      }
    Diagnostics d;
    d.potential_energy = model_->potential();
    d.kinetic_energy = bodies.kinetic_energy();
    d.momentum = bodies.momentum();
    d.angular_momentum = bodies.angular_momentum();
    if (far()) {
      d.angular_momentum += origin_.cross(d.momentum);
      for (const Body& body : scene_.bodies)
        if (!body.fixed && scene_.gravity)
          d.potential_energy -= body.mass * scene_.gravity->dot(origin_);
    }
    contacts_.reset();
    for (const int i : driver_->motion().closed()) d.contacts += model_->is_pair(i);
    // A point behind a face that has a border is not always in the body.
    const std::vector<ContactMode>& modes = driver_->motion().modes();
    for (int i = 0; i < model_->contacts(); ++i) {
      const bool closed = modes[at(i)].mode != Mode::open;
      double rate = 0;
      if (!closed && model_->is_apart(i, 0)) continue;
      if (model_->is_pair(i) && (closed || std::isinf(model_->margin(i))))
        d.penetration = std::max(d.penetration, -model_->gap(i, rate) * units_.length);
    }
    const VectorXd g = model_->joint_values<0>();
    if (g.size() > 0) d.drift = g.cwiseAbs().maxCoeff() * units_.length;
    smooth::to_si(units_, d);
    diagnostics_ = d;
    append_events();
  }
  // The rate of this state; the motion has its forces from here on.
  VectorXd find_forces() const {
    VectorXd rate(now_.size());
    driver_->motion().rate(driver_->time(), now_.data(), rate.data());
    return rate;
  }
  std::vector<ContactState> contact_states() const {
    event::Motion& motion = driver_->motion();
    const std::vector<int>& closed = motion.closed();
    if (closed.empty()) return {};
    find_forces();
    const std::vector<VectorXd> forces = motion.row_forces().contacts;
    std::vector<ContactState> out =
        states_of(closed, units_.force(), [&](std::size_t k) { return forces[k]; });
    auto state = out.begin();
    for (std::size_t k = 0; k < closed.size(); ++k) {
      if (!model_->is_pair(closed[k])) continue;
      VectorXd slip(3);
      slip << 0, motion.slip(static_cast<int>(k));
      state++->slip =
          units_.speed() * (model_->pair(closed[k]).elliptic ? model_->slip_of(closed[k])
                                                             : model_->in_space(closed[k], slip));
    }
    return out;
  }
  void append_events() {
    const std::vector<EventRecord>& all = driver_->events();
    for (std::size_t k = events_.size(); k < all.size(); ++k) {
      const EventRecord& from = all[k];
      ContactEvent e;
      e.time = units_.time * from.time;
      e.kind = from.kind;
      double arm = 1;  // of what turns, m
      if (const auto* slip = model_->slip_law(from.contact)) {
        const Spring& cable = scene_.springs[at(slip->cable())];
        e.first = cable.first;
        e.second = cable.second;
      } else if (model_->is_law(from.contact)) {
        const int number = model_->joint_laws().joint(model_->joint_law(from.contact));
        const Joint& joint = scene_.joints[at(number)];
        e.joint = number;
        e.first = joint.first;
        e.second = joint.second;
        if (joints::is_angle(joint)) arm = units_.length;
      } else {
        const int by = model_->law(from.contact).held_by;
        const FeaturePair& pair = model_->pair(by >= 0 ? by : from.contact);
        e.first = pair.first;
        e.second = pair.second;
      }
      e.before = units_.speed() / arm * from.before;
      e.after = units_.speed() / arm * from.after;
      e.lost = units_.energy() * from.lost;
      e.impulse = units_.mass * units_.speed() * arm * from.impulse;
      events_.push_back(e);
    }
  }
  // The part of a state behind the bodies.
  void exchange(binary::Archive& io, Driver::Memory& m, double& reached, VectorXd& now) const {
    const auto contacts = at(model_->contacts());
    std::uint64_t size = at(static_cast<int>(now_.size())), count = contacts;
    Units units = units_;
    io(size, count, units.length, units.time, units.mass, m.time, reached, m.kept_energy,
       m.at_one_time, m.events, m.impacts);
    if (units.length != units_.length || units.time != units_.time || units.mass != units_.mass ||
        size != static_cast<std::uint64_t>(now_.size()) || count != contacts)
      throw std::runtime_error("the saved state is of another scene: of another size");
    Vector3d origin = origin_;
    m.y.resize(now_.size());
    now.resize(now_.size());
    io(origin, m.y, now);
    if (origin != origin_)
      throw std::runtime_error("the saved state is of another scene: somewhere else");
    m.modes.resize(contacts), m.bounces.resize(contacts), m.levels.resize(contacts);
    m.axes.resize(contacts), m.lifted.resize(contacts);
    for (std::size_t i = 0; i < contacts; ++i) {
      ContactMode& each = m.modes[i];
      auto directions = static_cast<std::int32_t>(each.direction.size());
      io(each.mode, directions);
      io.demand(each.mode <= Mode::slide &&
                (directions == kTangents || (each.mode != Mode::slide && directions == 0)));
      each.direction.resize(directions);
      io(each.direction);
      Bounces& b = m.bounces[i];
      for (int k = 0; k < 3; ++k) io(b.time[k], b.speed[k]);
      bool lifted = m.lifted[i];
      io(m.levels[i], b.count, m.axes[i], lifted);
      m.lifted[i] = lifted;
    }
  }

  bool far() const { return !origin_.isZero(0); }
  /// Moves a place in SI to the origin of the world.
  void to_world(Vector3d& place) const {
    if (far()) place += units_.length * origin_;
  }

  Units units_;
  Vector3d origin_;
  Scene scene_;  // in these units and from this origin, as everything here but the results
  DriverOptions options_;
  std::unique_ptr<Model> model_;  // forces are found at the state that it is set to
  std::unique_ptr<Driver> driver_;
  joints::Reactions reactions_;
  VectorXd now_;
  std::vector<BodyState> bodies_;
  mutable std::optional<std::vector<ContactState>> contacts_;  // once they are asked for
  std::vector<ContactEvent> events_;
  Diagnostics diagnostics_;
  std::optional<Scene> to_certify_;  // in SI; only with Scene::certificate
  std::unique_ptr<certificate::InstantScribe> scribe_;
};

}  // namespace

std::unique_ptr<event::ResumableEngine> event::make_resumable_engine(const Scene& scene,
                                                                     Begin begin) {
  const std::string no = event_engine_refusal(scene);
  if (!no.empty()) throw std::invalid_argument(no);
  return std::make_unique<EventEngine>(scene, begin);
}

std::unique_ptr<Engine> make_event_engine(const Scene& scene) {
  return event::make_resumable_engine(scene, event::Begin::at_start);
}

}  // namespace tether::scene
