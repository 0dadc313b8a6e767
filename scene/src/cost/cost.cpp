// Tether: what accuracy costs in time, and what errors are measured against.
// SPDX-License-Identifier: BSD-3-Clause
#include "cost/with_setting.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "effects/list.hpp"
#include "run/judge.hpp"

namespace tether::scene {

namespace {

using costs::with_setting;

/// Poses of the moving bodies at times, which ascend: all bodies at the first one, ...
struct Samples {
  std::vector<double> times;
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Quaterniond> orientations;
};

struct Measured {
  RunResult result;
  Samples samples;
};

/// Thrown where somebody does not want to wait.
struct Interrupted {};

/// Times at which anything is compared with a reference (`all`), and those at which the reference
/// is compared with others like it (`own`), which do not depend on what it is asked for.
struct Times {
  std::vector<double> all, own;
};

struct Reference {
  Samples samples;
  std::string what;
  double error = 0;  // what it may be off
  double drift = 0;  // how far it left the joints
  CostMethod by = CostMethod::smooth;
};

constexpr int kMostPoses = 50000;

Eigen::Quaterniond turned(const Eigen::Vector3d& by, const Eigen::Quaterniond& q) {
  const double angle = by.norm();
  if (!(angle > 0)) return q;
  return Eigen::AngleAxisd(angle, by / angle) * q;
}

/// Runs the scene, with poses at these times. Throws Interrupted.
Measured measure_once(const Scene& scene, const std::vector<double>& times,
                      const CostOptions& cost) {
  Measured out;
  RunOptions options;
  options.interrupted = cost.interrupted;
  options.stops = times;
  // Records and expectations stop the run at other times, too.
  std::size_t next = 0;
  options.record = [&](const Engine& engine) {
    while (next < options.stops.size() &&
           engine.time() >= options.stops[next] * (1 - kTimeRounding)) {
      out.samples.times.push_back(options.stops[next]);
      for (const std::size_t b : scene.moving()) {
        // A time step ends at its boundary; the way to it is straight, and about one axis.
        const BodyState& state = engine.bodies()[b];
        const double late = engine.time() - options.stops[next];
        out.samples.positions.push_back(state.position - late * state.velocity);
        out.samples.orientations.push_back(
            turned(-late * state.angular_velocity, state.orientation));
      }
      ++next;
    }
  };
  out.result = run(scene, options);
  if (out.result.interrupted) throw Interrupted{};
  return out;
}

/// The place of a time among times; their number: it is none of them.
std::size_t place_of(double time, const std::vector<double>& times) {
  const auto at = std::lower_bound(times.begin(), times.end(), time * (1 - kTimeRounding));
  const bool there = at != times.end() && *at <= time * (1 + kTimeRounding);
  return static_cast<std::size_t>((there ? at : times.end()) - times.begin());
}

/// The largest distance (m) and angle (rad) at those of the times that both have.
double distance(const Samples& a, const Samples& b, const std::vector<double>& times) {
  double largest = 0;
  const std::size_t bodies = a.times.empty() ? 0 : a.positions.size() / a.times.size();
  for (std::size_t i = 0; i < a.times.size(); ++i) {
    const std::size_t j = place_of(a.times[i], b.times);
    if (j == b.times.size() || place_of(a.times[i], times) == times.size()) continue;
    for (std::size_t k = 0; k < bodies; ++k) {
      const std::size_t m = i * bodies + k, n = j * bodies + k;
      largest = std::max(largest, (a.positions[m] - b.positions[n]).norm());
      largest = std::max(largest, a.orientations[m].angularDistance(b.orientations[n]));
    }
  }
  return largest;
}

/// So many equal times.
std::vector<double> equal_times(double end, int count) {
  std::vector<double> out;
  for (int k = 1; k <= count; ++k) out.push_back(end * k / count);
  return out;
}

/// The ends of all steps; of more than kMostPoses / bodies, each second, third, ...
std::vector<double> step_ends(const Scene& scene, double step, int least) {
  const auto bodies = static_cast<double>(std::max<std::size_t>(1, scene.moving().size()));
  const double most = std::max(kMostPoses / bodies, static_cast<double>(least));
  const double stride = std::max(1.0, std::ceil(scene.end / step / most));
  std::vector<double> out;
  for (double k = stride; k * step < scene.end * (1 - kTimeRounding); k += stride)
    out.push_back(k * step);
  out.push_back(scene.end);
  return out;
}

/// Those of both, once.
std::vector<double> merged(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> all;
  std::merge(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(all));
  std::vector<double> out;
  for (const double t : all)
    if (out.empty() || t > out.back() * (1 + kTimeRounding)) out.push_back(t);
  return out;
}

/// Step of a scene without [stepping]: a thousandth of the time, at most the default.
double step_of(const Scene& scene) {
  return scene.stepping ? scene.stepping->step : std::min(SteppingOptions{}.step, 1e-3 * scene.end);
}

Scene projected(const Scene& scene, double tolerance) {
  Scene out = with_setting(scene, CostMethod::smooth, tolerance);
  // Between two stops; then it is given up.
  out.smooth->max_steps = std::min(out.smooth->max_steps, 20000);
  return out;
}

/// Plain IDA in the form that differentiates everything, which drifts least at tight tolerances.
Scene plain(const Scene& scene, double tolerance) {
  Scene out = projected(scene, tolerance);
  out.smooth->projection = false;
  out.smooth->formulation = Formulation::index0;
  for (Invariant& each : out.invariants) each.project = false;
  return out;
}

/// The tightest run that gets through, and by how much the next looser one differs from it.
std::optional<Reference> tightest(Scene (*make)(const Scene&, double), const Scene& scene,
                                  const char* name, double tolerance, const Times& times,
                                  const CostOptions& options) {
  // Each ten times as loose; a mechanism at a singular position may get through from 1e-8 on only.
  std::optional<Reference> best;
  for (int k = 0; k < 8 && tolerance < 0.1; ++k, tolerance *= 10) {
    const Measured m = measure_once(make(scene, tolerance), times.all, options);
    if (!m.result.failure.empty()) continue;
    if (best) {
      best->error = distance(best->samples, m.samples, times.own);
      return best;
    }
    best = Reference{m.samples, fmt::format("{}, tolerance {:g}", name, tolerance), 0,
                     m.result.summary.drift};
  }
  return std::nullopt;
}

/// First-order extrapolation to step 0: 2 x(h) - x(2h); rotations are extrapolated by their angle.
Samples extrapolated(const Samples& fine, const Samples& coarse) {
  Samples out = fine;
  const std::size_t count = std::min(fine.positions.size(), coarse.positions.size());
  for (std::size_t i = 0; i < count; ++i) {
    out.positions[i] = 2 * fine.positions[i] - coarse.positions[i];
    const Eigen::Quaterniond turn = coarse.orientations[i].conjugate() * fine.orientations[i];
    out.orientations[i] = (fine.orientations[i] * turn).normalized();
  }
  return out;
}

// At the times. Each throws std::runtime_error where there is none.

// Plain IDA, unless the scene's own run settles ten times as well: then that, and what plain IDA
// says of it. Where the two agree they are right, having little in common.
Reference smooth_reference(const Scene& scene, double tolerance, const Times& times,
                           const CostOptions& options) {
  const auto own = tightest(projected, scene, "the scene", tolerance, times, options);
  const auto other = tightest(plain, scene, "plain IDA, index 0", tolerance, times, options);
  if (!own && !other)
    throw std::runtime_error(fmt::format(
        "no reference: neither plain IDA nor the scene itself gets to the end at tolerances from "
        "{:g}; give --reference",
        tolerance));
  if (!own || !other) {
    Reference only = own ? *own : *other;
    only.what += own ? " (plain IDA fails)" : "";
    return only;
  }
  const double apart = distance(own->samples, other->samples, times.own);
  const bool take_own = 10 * own->error < other->error;
  Reference out = take_own ? *own : *other;
  const Reference& witness = take_own ? *other : *own;
  // A difference that neither estimate explains counts as an error of the reference.
  out.error = std::max(out.error, apart - witness.error);
  out.what += fmt::format(" ({:.1e} from {}, whose joints drift by {:.1e})", apart, witness.what,
                          witness.drift);
  return out;
}

// Steps h, 2h, 4h and 8h. How far the reference is off is estimated twice, at the finest steps and,
// by what it must be there, at coarser ones: one of them may be small by chance. Where impacts or
// chaos leave no order in the errors, the extrapolated points differ more than the runs themselves,
// which are the reference then.
Reference stepping_reference(const Scene& scene, double step, const Times& times,
                             const CostOptions& options) {
  std::vector<Samples> runs;
  for (const double h : {step, 2 * step, 4 * step, 8 * step}) {
    Scene each = with_setting(scene, CostMethod::steps, h);
    if (h > step) each.stepping->on_failure = OnFailure::warn;
    const Measured m = measure_once(each, times.all, options);
    if (!m.result.failure.empty())
      throw std::runtime_error(
          fmt::format("no reference: at a step of {:g} s {}", h, m.result.failure));
    runs.push_back(m.samples);
  }
  std::vector<Samples> limits;
  for (std::size_t k = 0; k + 1 < runs.size(); ++k)
    limits.push_back(extrapolated(runs[k], runs[k + 1]));
  const auto apart = [&](const Samples& a, const Samples& b) { return distance(a, b, times.own); };
  const double of_run = 1.5 * std::max(apart(runs[0], runs[1]), apart(runs[1], runs[2]) / 2);
  const double of_limit = std::max(apart(limits[0], limits[1]), apart(limits[1], limits[2]) / 2);
  if (of_limit < of_run)
    return {limits[0],
            fmt::format("the limit of the scene at steps of {:g} and {:g} s", step, 2 * step),
            of_limit};
  return {runs[0], fmt::format("the scene at a step of {:g} s", step), of_run};
}

/// The event engine at a tight tolerance, and how far a looser one is from it. None: it does not
/// get to the end.
std::optional<Reference> event_reference(const Scene& scene, double tolerance, const Times& times,
                                         const CostOptions& options) {
  for (const double looser : {1, 10, 100}) {
    const double of_tight = looser * tolerance;
    const auto run = [&](double setting) {
      return measure_once(with_setting(scene, CostMethod::events, setting), times.all, options);
    };
    const Measured tight = run(of_tight), loose = run(10 * of_tight);
    if (!tight.result.failure.empty() || !loose.result.failure.empty()) continue;
    return Reference{tight.samples,
                     fmt::format("the scene's events at a tolerance of {:g}", of_tight),
                     distance(tight.samples, loose.samples, times.own), 0, CostMethod::events};
  }
  return std::nullopt;
}

struct Setting {
  CostMethod method;
  double value;
};

CostMethod method_of(EngineKind engine) {
  return engine == EngineKind::smooth  ? CostMethod::smooth
         : engine == EngineKind::event ? CostMethod::events
                                       : CostMethod::steps;
}

/// Why the event engine does not move the same problem; empty: it does.
std::string no_events(const Scene& scene, const Plan& plan) {
  if (plan.engine == EngineKind::event) return {};
  if (!plan.no_event.empty()) return plan.no_event;
  const SteppingOptions o = scene.stepping.value_or(SteppingOptions{});
  const bool bounces = any_of(scene.pairs, [](const Pair& pair) { return pair.restitution > 0; });
  if (o.law != contact::Law::coulomb) return "the event engine has Coulomb's law only";
  if (bounces && o.restitution_law != contact::RestitutionLaw::newton)
    return "the event engine has Newton's restitution only";
  return {};
}

std::vector<double> default_settings(const Scene& scene, CostMethod method) {
  const double step = step_of(scene);
  switch (method) {
    case CostMethod::smooth:
      return {1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9};
    case CostMethod::events:
      return {1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8};
    case CostMethod::accuracy:
      return {1e-2, 1e-3, 1e-4, 1e-5};
    case CostMethod::steps:
      break;
  }
  return {8 * step, 4 * step, 2 * step, step, step / 2, step / 4};
}

std::vector<Setting> settings_of(const Scene& scene, const Plan& plan, bool events,
                                 const CostOptions& options) {
  std::vector<Setting> out;
  const auto add = [&](CostMethod method, std::vector<double> values) {
    std::sort(values.begin(), values.end(), std::greater<>());
    for (const double each : values) {
      if (!(each > 0) || !std::isfinite(each))
        throw std::invalid_argument(
            fmt::format("a tolerance or time step must be > 0, not {}", each));
      if (method == CostMethod::steps && !(scene.end / each <= kMostSteps))
        throw std::invalid_argument(
            fmt::format("time step {}: end / step must be at most {:g}, the end is {} s", each,
                        kMostSteps, scene.end));
      out.push_back({method, each});
    }
  };
  const CostMethod planned = method_of(plan.engine);
  const bool all =
      options.tolerances.empty() && options.steps.empty() && options.accuracies.empty();
  if (planned == CostMethod::smooth) {
    add(planned, all ? default_settings(scene, planned) : options.tolerances);
  } else {
    const auto take = [&](CostMethod method, const std::vector<double>& values) {
      add(method, all ? default_settings(scene, method) : values);
    };
    if (events) take(CostMethod::events, options.tolerances);
    take(CostMethod::steps, options.steps);
    if (plan.pairs > 0) take(CostMethod::accuracy, options.accuracies);
  }
  return out;
}

// The event engine where it gets through: it has nothing in common with steps.
Reference reference_of(const Scene& scene, const Plan& plan, bool events, double finest_step,
                       const Times& times, const CostOptions& options) {
  if (plan.engine == EngineKind::smooth)
    return smooth_reference(scene, options.reference.value_or(1e-12), times, options);
  const bool own = plan.engine == EngineKind::event;
  if (own || (events && !options.reference)) {
    const double tolerance = options.reference.value_or(1e-11);
    const auto found = event_reference(scene, tolerance, times, options);
    if (found) return *found;
    if (own && options.reference)
      throw std::runtime_error("no reference: the event engine does not get to the end");
  }
  return stepping_reference(
      scene, own ? finest_step / 4 : options.reference.value_or(finest_step / 4), times, options);
}

// Ends of steps have a state to compare; what impacts leave there may last a few steps only.
std::vector<double> times_of(const Scene& scene, Setting setting, const CostOptions& options) {
  if (setting.method == CostMethod::steps) return step_ends(scene, setting.value, options.samples);
  if (setting.method == CostMethod::accuracy)
    return step_ends(scene, step_of(scene), options.samples);
  return equal_times(scene.end, options.samples);
}

CostRow measure_row(const Scene& scene, Setting setting, const std::vector<double>& times,
                    const CostOptions& options, const Reference& reference) {
  CostRow row;
  row.method = setting.method;
  row.setting = setting.value;
  Measured m;
  try {
    m = measure_once(scene, times, options);
  } catch (const std::invalid_argument& refused) {  // as a step for which a spring is too stiff
    row.failure = refused.what();
    return row;
  }
  const RunResult& r = m.result;
  row.failure = r.failure;
  // On the safe side: the error of the reference may add to the difference found.
  row.error = distance(m.samples, reference.samples, m.samples.times) + reference.error;
  row.drift = r.summary.drift;
  row.penetration = r.summary.penetration;
  row.steps = r.counts.steps;
  row.contact_problems = r.counts.contact_problems;
  row.seconds = r.seconds;
  row.met = static_cast<int>(r.count(Verdict::met));
  // Without the records in between; the least of several: everything else on the machine only adds.
  double spent = 0;
  for (int repeat = 0; repeat < 5 && spent < 0.3 && row.failure.empty(); ++repeat) {
    RunOptions plain;
    plain.interrupted = options.interrupted;
    const RunResult again = run(scene, plain);
    if (again.interrupted) throw Interrupted{};
    const double seconds = again.seconds;
    spent += seconds;
    row.seconds = repeat == 0 ? seconds : std::min(row.seconds, seconds);
  }
  return row;
}

}  // namespace

Scene costs::with_setting(const Scene& scene, CostMethod method, double setting) {
  Scene out = scene;
  out.output = Output{};
  out.output.every = out.end;  // records cost time
  if (method == CostMethod::smooth) {
    out.smooth = scene.smooth.value_or(SmoothOptions{});
    out.smooth->tolerance = setting;
    return out;
  }
  out.engine = EngineKind::automatic;
  out.event.reset();
  out.stepping.reset();
  if (method == CostMethod::events) {
    out.event = scene.event.value_or(EventOptions{});
    out.event->otherwise = Otherwise::stop;
    out.event->tolerance = setting;
    out.event->max_events = std::min(out.event->max_events, kMostPoses);
    out.event->max_steps = std::min(out.event->max_steps, 1000000);  // more are a storm
    return out;
  }
  out.stepping = scene.stepping.value_or(SteppingOptions{});
  out.stepping->step = method == CostMethod::steps ? setting : step_of(scene);
  out.stepping->accuracy = method == CostMethod::steps ? 0 : setting;
  return out;
}

const char* name(CostMethod method) {
  constexpr std::array words = {"smooth", "events", "steps", "accuracy"};
  const auto k = static_cast<std::size_t>(method);
  return k < words.size() ? words[k] : "?";
}

const char* setting_name(CostMethod method) {
  return method == CostMethod::steps      ? "step / s"
         : method == CostMethod::accuracy ? "accuracy"
                                          : "tolerance";
}

const CostRow* CostTable::cheapest(double wanted) const {
  const CostRow* best = nullptr;
  for (const CostRow& row : rows)
    if (row.failure.empty() && row.error <= wanted &&
        (best == nullptr || row.seconds < best->seconds))
      best = &row;
  return best;
}

CostTable cost(const Scene& scene, const CostOptions& options) {
  CostTable table;
  const Plan plan = make_plan(scene);
  table.smooth = plan.engine != EngineKind::stepping;
  const bool contact =
      plan.engine != EngineKind::smooth && (plan.pairs > 0 || effects::has_joint_laws(scene));
  if (contact) table.no_events = no_events(scene, plan);
  const bool events = plan.engine == EngineKind::event || (contact && table.no_events.empty());
  const std::vector<Setting> settings = settings_of(scene, plan, events, options);
  double finest_step = step_of(scene) / 4;
  for (const Setting& each : settings)  // the last one of them is the finest
    if (each.method == CostMethod::steps) finest_step = each.value;
  int done = 0;
  const auto tell = [&](const std::string& what) {
    if (options.progress) options.progress(what, done++, 1 + static_cast<int>(settings.size()));
  };

  tell("reference");
  try {
    Times times;
    times.own = equal_times(scene.end, options.samples);
    if (contact) times.own = merged(times.own, step_ends(scene, step_of(scene), options.samples));
    times.all = times.own;
    for (const Setting& each : settings)
      times.all = merged(times.all, times_of(scene, each, options));
    const Reference reference = reference_of(scene, plan, events, finest_step, times, options);
    table.reference = reference.what;
    table.reference_error = reference.error;
    table.reference_setting = options.reference;
    if (plan.engine == EngineKind::stepping && !(events && reference.by == CostMethod::events))
      table.reference_setting = options.reference.value_or(finest_step / 4);
    for (const Setting& each : settings) {
      tell(fmt::format("{} {:g}", name(each.method), each.value));
      const bool any = each.method == CostMethod::events;
      table.rows.push_back(measure_row(with_setting(scene, each.method, each.value), each,
                                       any ? times.own : times_of(scene, each, options), options,
                                       reference));
    }
  } catch (const Interrupted&) {
    table.interrupted = true;
  }
  return table;
}

}  // namespace tether::scene
