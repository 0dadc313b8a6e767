// Tether: what accuracy costs in time. SPDX-License-Identifier: BSD-3-Clause

#include "effects/list.hpp"
#include "reference.hpp"

namespace tether::scene {

namespace {

using namespace costs;

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
