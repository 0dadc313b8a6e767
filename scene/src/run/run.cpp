// Tether: runs a scene. SPDX-License-Identifier: BSD-3-Clause

#include <ctime>
#include <sstream>
#include <tether/scene/words.hpp>

#include "certificate/sheet.hpp"
#include "effects/list.hpp"
#include "judge.hpp"
#include "output/binary.hpp"
#include "output/files.hpp"
#include "record/formats.hpp"
#include "saved_state.hpp"
#include "stepping/stepping_engine.hpp"
#include "switching/switching.hpp"

namespace tether::scene {

namespace {

/// Since it was made.
class Stopwatch {
 public:
  double wall() const { return seconds(CLOCK_MONOTONIC) - wall_; }
  double processor() const { return seconds(CLOCK_PROCESS_CPUTIME_ID) - processor_; }

 private:
  static double seconds(clockid_t clock) {
    timespec now{};
    clock_gettime(clock, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  }
  double wall_ = seconds(CLOCK_MONOTONIC), processor_ = seconds(CLOCK_PROCESS_CPUTIME_ID);
};

/// The plan, behind checks of values that a caller may have put over those of the scene.
Plan checked_plan(const Scene& scene) {
  const auto demand = [](bool holds, const char* what, double value, const std::string& range) {
    if (!holds) throw std::invalid_argument(fmt::format("{} = {}: {}", what, value, range));
  };
  demand(scene.end > 0 && std::isfinite(scene.end), "end", scene.end,
         "must be a finite number > 0, s");
  for (const auto& [what, value] :
       {std::pair("every", scene.output.every), std::pair("checkpoint", scene.output.checkpoint)})
    demand(value == 0 || (value > 0 && scene.end / value <= kMostRecords), what, value,
           fmt::format("must be > 0, s, and end / it at most {:g}", kMostRecords));
  Plan plan = make_plan(scene);
  if (plan.engine != EngineKind::stepping && !(plan.then_steps > 0)) return plan;
  const double step = scene.stepping.value_or(SteppingOptions{}).step;
  demand(scene.end / step <= kMostSteps, "step", step,
         fmt::format("end / step must be at most {:g}", kMostSteps));
  return plan;
}

std::unique_ptr<Engine> engine_of(const Scene& scene, const Plan& plan, contact::SolverTeam* team) {
  if (!team) return make_engine(scene, plan);
  if (plan.engine == EngineKind::stepping)
    return with_switching(scene, [team](const Scene& of) -> std::unique_ptr<Engine> {
      return std::make_unique<stepping::SteppingEngine>(of, team);
    });
  throw std::invalid_argument(fmt::format(
      "several processes share steps with impulses; this scene is moved by the engine \"{}\", in "
      "one process ({})",
      word(plan.engine), plan.why));
}

/// One run from its start, or from a saved state, to the end.
class Run {
 public:
  Run(const Scene& scene, const RunOptions& options)
      : scene_(scene),
        plan_(checked_plan(scene)),
        options_(options),
        judge_(scene),
        overlaps_(options.restart.empty() ? overlaps_at_start(scene) : std::vector<std::string>()),
        engine_(engine_of(scene, plan_, options.team)) {
    const Output& o = scene.output;
    std::vector<std::string> inputs = inputs_of(scene);
    if (o["state"] != options.restart) inputs.push_back(options.restart);
    formats::check_names(o, inputs);
    if (options.among.rank == 0 && !options.force) formats::check_replaceable(o);
    if (options.among.rank == 0)
      for (const std::string& each : formats::names(o)) lock_.take(each);
    if (!o["state"].empty()) check_writable(o["state"]);
    if (!o["state"].empty() || !options.restart.empty()) scene_hash_ = hash_of_motion(scene, plan_);
    result_.engine = engine_->name();
    if (plan_.engine == EngineKind::stepping)
      step_ = scene.stepping.value_or(SteppingOptions{}).step;
    if (!options.restart.empty()) {
      restore(options.restart);
    } else {
      const Diagnostics d = engine_->diagnostics();
      summary().start_energy = d.kinetic_energy + d.potential_energy;
    }
    engine_->stop_when(options.interrupted);
    const formats::Beginning beginning{
        scene, plan_, resume_, options.among, summary().start_energy, engine_->time()};
    for (const formats::Format* each : formats::all())
      if (const std::string& file = o[each->name]; !file.empty() && each->add_recorders)
        each->add_recorders(file, beginning, recorders_);
  }

  RunResult go() {
    try {
      if (!resume_.time) stop({0, Event::record | Event::expect});
      if (is_over_ && options_.record) options_.record(*engine_);
      for (const Event& event : schedule(scene_, options_.stops)) {
        if (event.time <= done_ || same_time(event.time, done_)) continue;
        move(event.time);
        const bool there = engine_->time() >= event.time || !interrupted();
        if (there) stop(event);
        if (!interrupted() || (event.is(Event::end) && there)) continue;
        result_.interrupted = true;
        stop({engine_->time(), Event::end});
        break;
      }
    } catch (const SimulationError& e) {
      result_.failure = e.what();
      hand_over();
    }
    finish();
    return std::move(result_);
  }

 private:
  // Steps can go on where events cannot.
  void hand_over() {
    if (plan_.engine != EngineKind::event || engine_->in_steps()) return;
    if (any_of(scene_.joints, [](const Joint& each) { return each.window.has_value(); })) return;
    if (scene_.output["state"].empty()) {
      result_.remarks.emplace_back(
          "with [event] otherwise = \"stepping\" (--otherwise stepping) the run goes on in steps "
          "where events cannot go on");
      return;
    }
    save(scene_.output["state"]);
    result_.remarks.push_back(
        fmt::format("{} has the state at {:g} s: with engine = \"stepping\" the scene goes on from "
                    "its positions "
                    "and velocities (--restart {} --force)",
                    scene_.output["state"], engine_->time(), scene_.output["state"]));
  }

  Summary& summary() { return result_.summary; }
  bool interrupted() const { return options_.interrupted && options_.interrupted(); }

  void move(double time) {
    const Stopwatch watch;
    engine_->advance(time);
    if (!step_ && !engine_->hand_overs().empty())
      step_ = scene_.stepping.value_or(SteppingOptions{}).step;
    result_.seconds += watch.processor();
    result_.wall += watch.wall();
  }

  // A state is that of a run which goes on: what belongs to an end on the way comes after it.
  void stop(const Event& event) {
    diagnose();
    done_ = event.time;
    const bool on_grid = event.is(Event::record);
    if (on_grid || event.is(Event::expect))
      judge_.judge(event.time, on_grid, *engine_, summary().start_energy);
    if (options_.record) options_.record(*engine_);
    if (on_grid) record();
    if (event.is(Event::checkpoint | Event::end) && !scene_.output["state"].empty())
      save(scene_.output["state"]);
    if (event.is(Event::end) && !on_grid) record();
  }

  // Steps may be longer than the time between stops: no state is judged, or recorded, twice.
  void diagnose() {
    if (diagnosed_at_ == engine_->time()) return;
    diagnostics_ = engine_->diagnostics();
    demand_finite(diagnostics_);
    diagnosed_at_ = engine_->time();
  }

  void record() {
    const Diagnostics& d = diagnostics_;
    if (recorded_ && engine_->time() == last_record_) return;
    recorded_ = true;
    last_record_ = engine_->time();
    Summary& s = summary();
    s.end_energy = d.kinetic_energy + d.potential_energy;
    s.lowest_change = std::min(s.lowest_change, s.end_energy - s.start_energy);
    s.largest_change = std::max(s.largest_change, s.end_energy - s.start_energy);
    s.drift = std::max(s.drift, d.drift);
    s.penetration = std::max(s.penetration, d.penetration);
    s.residual = std::max(s.residual, d.residual);
    s.contacts = std::max(s.contacts, d.contacts);
    most_kinetic_ = std::max(most_kinetic_, d.kinetic_energy);
    most_energy_ = std::max({most_energy_, d.kinetic_energy, std::abs(d.potential_energy)});
    note_fastest_turn();
    for (const auto& recorder : recorders_) recorder->record(*engine_, d);
    if (options_.progress) options_.progress(engine_->time());
  }

  void demand_finite(const Diagnostics& d) const {
    const auto refuse = [&](const std::string& what) {
      throw SimulationError(fmt::format(
          "t = {:g} s: {} is not a finite number: the motion has left the range of numbers, about "
          "1e-150 to 1e150 in SI units, or a step is far too long for it",
          engine_->time(), what));
    };
    for (std::size_t i = 0; i < scene_.bodies.size(); ++i) {
      if (!engine_->bodies()[i].is_finite())
        refuse(fmt::format("the state of body \"{}\"", scene_.bodies[i].name));
    }
    if (!std::isfinite(d.kinetic_energy + d.potential_energy)) refuse("the energy");
    if (!d.momentum.allFinite() || !d.angular_momentum.allFinite()) refuse("a momentum");
    if (!std::isfinite(d.drift) || !std::isfinite(d.penetration) || std::isnan(d.residual))
      refuse("an error");
  }

  void note_fastest_turn() {
    if (!step_ || (!engine_->hand_overs().empty() && !engine_->in_steps())) return;
    for (std::size_t i = 0; i < scene_.bodies.size(); ++i)
      if (const double turn = *step_ * engine_->bodies()[i].angular_velocity.norm();
          turn > fastest_turn_) {
        fastest_turn_ = turn;
        fastest_ = i;
      }
  }

  void finish() {
    result_.time = engine_->time();
    result_.counts = engine_->counts();
    result_.hand_overs = engine_->hand_overs();
    for (const ContactEvent& each : engine_->events())
      if (is_of_joint(each.kind)) result_.joint_events.push_back(each);
    result_.counts_of_events = engine_->counts_of_events();
    result_.costs = engine_->costs();
    result_.judgements = judge_.judgements();
    for (const auto& recorder : recorders_) recorder->finish(result_.written, result_.remarks);
    result_.warnings = overlaps_;
    if (saved_) result_.written.push_back(scene_.output["state"]);
    // Beyond a radian a step the midpoint rule of rotations is no longer near the motion.
    if (fastest_turn_ > 1)
      result_.warnings.push_back(fmt::format(
          "body \"{}\" turns by {:.3g} rad in a step: its rotation is not resolved, its energy not "
          "kept; stepping.step should be below {:.2g} s",
          scene_.bodies[fastest_].name, fastest_turn_, 0.1 * *step_ / fastest_turn_));
    if (result_.counts.unsolved > 0)
      result_.warnings.push_back(
          fmt::format("{} contact problems were not solved (stepping.on_failure = \"warn\")",
                      result_.counts.unsolved));
    if (result_.counts.unsolved == 0 && result_.counts.accepted > 0) warn_of_residual();
    if (result_.warnings.empty()) warn_of_energy();  // which the others would explain
    result_.whole_seconds = watch_.processor();
    result_.whole_wall = watch_.wall();
  }

  // Tolerances are of places: a motion that is smaller than they, as on a very stiff spring, may
  // take or give any energy.
  // Resolved ones change it by some tolerances, and by little in steps that roll or stick.
  void warn_of_energy() {
    const auto warn = [this](double change, double part, const char* why) {
      if (std::abs(change) > part * most_kinetic_ && std::abs(change) > 1e-6 * most_energy_)
        result_.warnings.push_back(
            fmt::format("the energy changes by {:.2g} J, of at most {:.2g} J of motion, {}", change,
                        most_kinetic_, why));
    };
    if (plan_.engine == EngineKind::stepping)
      warn(diagnostics_.energy_error, 0.01,
           "in steps in which nothing strikes or slips: stepping.step is too long for the motion");
    else if (plan_.pairs == 0 && effects::keeps_energy(scene_))
      warn(std::max(summary().largest_change, -summary().lowest_change), 0.1,
           "though nothing takes or gives any: the tolerance does not resolve the motion");
  }

  // Within its own limit a residual is said by the summary alone.
  void warn_of_residual() {
    const double allowed = contact::accepted_residual(scene_.stepping.value_or(SteppingOptions{}));
    if (summary().residual > allowed)
      result_.warnings.push_back(
          fmt::format("a contact problem was used at a residual of {:.2e}, above the {:.2g} that "
                      "stepping.acceptance allows: shorter sub-steps and more work did not help",
                      summary().residual, allowed));
  }

  void exchange(binary::Archive io, std::uint64_t& events) {
    Summary& s = summary();
    io(done_, last_record_, s.start_energy, s.end_energy, s.lowest_change, s.largest_change,
       s.drift, s.penetration, s.residual, s.contacts, events);
    judge_.exchange(io);
  }

  void save(const std::string& file) {
    for (const auto& recorder : recorders_) recorder->keep(*engine_);
    std::ostringstream out;
    std::uint64_t events = resume_.events + engine_->events().size();
    exchange(binary::Archive(out), events);
    engine_->save(out);
    write_state(file, scene_hash_, out.str());
    saved_ = true;
  }

  void restore(const std::string& file) {
    const SavedState saved = read_state(file, scene_hash_, options_.force, options_.interrupted);
    if (!options_.force) return restore(file, saved.content, Engine::Restore::exact);
    try {
      return restore(file, saved.content, saved.how);
    } catch (const std::runtime_error&) {
      if (saved.how == Engine::Restore::near) throw;
    }
    restore(file, saved.content, Engine::Restore::near);
  }

  void restore(const std::string& file, const std::string& content, Engine::Restore how) {
    std::istringstream in(content);
    Summary& s = summary();
    exchange(binary::Archive(in), resume_.events);
    engine_->restore(in, how);
    if (in.peek() != std::char_traits<char>::eof())
      throw std::runtime_error("the saved state " + file + " is longer than this scene needs");
    const double time = engine_->time();
    // Sums of a run are finite, or it has ended; its last stop lies behind it.
    for (const double x : {s.start_energy, s.end_energy, s.lowest_change, s.largest_change, s.drift,
                           s.penetration, time})
      if (!std::isfinite(x) || std::isnan(s.residual))
        throw std::runtime_error("the saved state " + file + " is damaged");
    if (!(done_ >= 0 && last_record_ >= 0 && last_record_ <= time) ||
        !(done_ <= time || same_time(done_, time)))
      throw std::runtime_error("the saved state " + file + " is damaged: it is of no one time");
    resume_.time = last_record_;
    recorded_ = true;
    is_over_ = same_time(done_, scene_.end);  // what it came to is judged once more
    if (done_ > scene_.end && !is_over_)
      throw std::runtime_error(fmt::format(
          "{} was saved at {} s, but the scene ends at {} s: nothing is left to run (--end)", file,
          done_, scene_.end));
    if (is_over_)
      result_.remarks.push_back(fmt::format("{} is of the end: nothing was left to run", file));
  }

  const Stopwatch watch_;
  const Scene& scene_;
  const Plan plan_;
  const RunOptions& options_;
  OutputLock lock_;
  Judge judge_;
  const std::vector<std::string> overlaps_;
  std::unique_ptr<Engine> engine_;
  RunResult result_;
  Resume resume_;
  std::vector<std::unique_ptr<Recorder>> recorders_;
  Diagnostics diagnostics_;
  std::optional<double> diagnosed_at_;  // the time that they are of
  std::uint64_t scene_hash_ = 0;
  double done_ = -1;  // the last event
  bool recorded_ = false, saved_ = false, is_over_ = false;
  double last_record_ = 0;
  std::optional<double> step_;                 // of the stepping engine
  double fastest_turn_ = 0;                    // rad in a step
  std::size_t fastest_ = 0;                    // body
  double most_kinetic_ = 0, most_energy_ = 0;  // since the start or the restart, J
};

}  // namespace

long RunResult::count(Verdict verdict) const {
  return count_if(judgements, [=](const Judgement& j) { return j.verdict == verdict; });
}

bool RunResult::met() const { return count(Verdict::open) == 0 && count(Verdict::missed) == 0; }

RunResult run(const Scene& scene, const RunOptions& options) {
  if (scene.output["certificate"].empty()) return Run(scene, options).go();
  certificate::Sheet sheet(scene);
  Scene observed = scene;
  observed.certificate = &sheet;
  return Run(observed, options).go();
}

}  // namespace tether::scene
