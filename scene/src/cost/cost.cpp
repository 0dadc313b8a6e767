// Tether: what accuracy costs in time. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <stdexcept>
#include <tether/scene/cost.hpp>
#include <tether/scene/plan.hpp>

namespace tether::scene {

namespace {

/// Poses of the moving bodies at the sampled times.
struct Samples {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Quaterniond> orientations;
};

struct Measured {
  RunResult result;
  Samples samples;
};

Eigen::Quaterniond turned(const Eigen::Vector3d& by, const Eigen::Quaterniond& q) {
  const double angle = by.norm();
  if (!(angle > 0)) return q;
  return Eigen::AngleAxisd(angle, by / angle) * q;
}

Measured measure_once(const Scene& scene, int samples) {
  Measured out;
  RunOptions options;
  for (int k = 1; k <= samples; ++k) options.stops.push_back(scene.end * k / samples);
  // Records and expectations stop the run at other times, too.
  std::size_t next = 0;
  options.record = [&](const Engine& engine) {
    while (next < options.stops.size() && engine.time() >= options.stops[next] * (1 - 1e-12)) {
      for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
        if (scene.bodies[b].fixed) continue;
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
  return out;
}

double distance(const Samples& a, const Samples& b) {
  double largest = 0;
  for (std::size_t i = 0; i < std::min(a.positions.size(), b.positions.size()); ++i) {
    largest = std::max(largest, (a.positions[i] - b.positions[i]).norm());
    largest = std::max(largest, a.orientations[i].angularDistance(b.orientations[i]));
  }
  return largest;
}

/// The scene with one setting, and nothing written.
Scene with_setting(const Scene& scene, bool smooth, double setting) {
  Scene out = scene;
  if (make_plan(scene).engine == EngineKind::event) {
    out.output = Output{};
    out.output.every = out.end;
    out.event = scene.event.value_or(EventOptions{});
    out.event->tolerance = setting;
    return out;
  }
  out.output = Output{};
  out.output.every = out.end;  // records cost time
  if (smooth) {
    out.smooth = scene.smooth.value_or(SmoothOptions{});
    out.smooth->tolerance = setting;
  } else {
    out.stepping = scene.stepping.value_or(SteppingOptions{});
    out.stepping->step = setting;
  }
  return out;
}

std::vector<double> default_settings(const Scene& scene, bool smooth) {
  if (smooth) return {1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9};
  const double step = scene.stepping.value_or(SteppingOptions{}).step;
  return {8 * step, 4 * step, 2 * step, step, step / 2, step / 4};
}

struct Reference {
  Samples samples;
  std::string what;
  double error = 0;  // what it may be off
  double drift = 0;  // how far it left the joints
};

constexpr int kReferenceSteps = 20000;  // between two stops; then it is given up

/// Plain IDA in the form that differentiates everything, which drifts least at tight tolerances.
Scene plain(const Scene& scene, double tolerance) {
  Scene out = with_setting(scene, true, tolerance);
  out.smooth->projection = false;
  out.smooth->formulation = Formulation::index0;
  for (Invariant& each : out.invariants) each.project = false;
  out.smooth->max_steps = std::min(out.smooth->max_steps, kReferenceSteps);
  return out;
}

Scene projected(const Scene& scene, double tolerance) {
  Scene out = with_setting(scene, true, tolerance);
  out.smooth->max_steps = std::min(out.smooth->max_steps, kReferenceSteps);
  return out;
}

/// The tightest run that gets through, and by how much the next looser one differs from it.
std::optional<Reference> tightest(Scene (*make)(const Scene&, double), const Scene& scene,
                                  const char* name, double tolerance, int samples) {
  // Each ten times as loose; a mechanism at a dead point may get through from 1e-8 on only.
  constexpr int kTries = 8;
  std::optional<Reference> best;
  for (int k = 0; k < kTries && tolerance < 0.1; ++k, tolerance *= 10) {
    const Measured m = measure_once(make(scene, tolerance), samples);
    if (!m.result.failure.empty()) continue;
    if (best) {
      best->error = distance(best->samples, m.samples);
      return best;
    }
    best = Reference{m.samples, fmt::format("{}, tolerance {:g}", name, tolerance), 0,
                     m.result.summary.drift};
  }
  return std::nullopt;
}

// Plain IDA, unless the scene's own run settles ten times as well: then that, and what plain IDA
// says of it. Where the two agree they are right, having little in common.
Reference smooth_reference(const Scene& scene, double tolerance, int samples) {
  const auto own = tightest(projected, scene, "the scene", tolerance, samples);
  const auto other = tightest(plain, scene, "plain IDA, index 0", tolerance, samples);
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
  const double apart = distance(own->samples, other->samples);
  const bool take_own = 10 * own->error < other->error;
  Reference out = take_own ? *own : *other;
  const Reference& witness = take_own ? *other : *own;
  // A difference that neither estimate explains counts as an error of the reference.
  out.error = std::max(out.error, apart - witness.error);
  out.what += fmt::format(" ({:.1e} from {}, whose joints drift by {:.1e})", apart, witness.what,
                          witness.drift);
  return out;
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

// Steps h, 2h, 4h and 8h. How far the reference is off is estimated twice, at the finest steps and,
// by what it must be there, at coarser ones: one of them may be small by chance. Where impacts or
// chaos leave no order in the errors, the extrapolated points differ more than the runs themselves,
// which are the reference then.
Reference stepping_reference(const Scene& scene, double step, int samples) {
  constexpr int kRuns = 4;
  std::vector<Samples> runs;
  for (int k = 0; k < kRuns; ++k) {
    const double h = step * (1 << k);
    Scene each = with_setting(scene, false, h);
    if (k > 0) each.stepping->on_failure = OnFailure::warn;
    const Measured m = measure_once(each, samples);
    if (!m.result.failure.empty())
      throw std::runtime_error(
          fmt::format("no reference: at a step of {:g} s {}", h, m.result.failure));
    runs.push_back(m.samples);
  }
  std::vector<Samples> limits;
  for (int k = 0; k + 1 < kRuns; ++k)
    limits.push_back(
        extrapolated(runs[static_cast<std::size_t>(k)], runs[static_cast<std::size_t>(k) + 1]));
  const double of_run = 1.5 * std::max(distance(runs[0], runs[1]), distance(runs[1], runs[2]) / 2);
  const double of_limit =
      std::max(distance(limits[0], limits[1]), distance(limits[1], limits[2]) / 2);
  Reference out;
  if (of_limit < of_run) {
    out.samples = limits[0];
    out.error = of_limit;
    out.what = fmt::format("the limit of the scene at steps of {:g} and {:g} s", step, 2 * step);
  } else {
    out.samples = runs[0];
    out.error = of_run;
    out.what = fmt::format("the scene at a step of {:g} s", step);
  }
  return out;
}

/// The event engine at a tight tolerance, and how far a looser one is from it.
Reference event_reference(const Scene& scene, double tolerance, int samples) {
  constexpr int kTries = 3;
  for (int k = 0; k < kTries; ++k, tolerance *= 10) {
    const Measured tight = measure_once(with_setting(scene, true, tolerance), samples);
    const Measured loose = measure_once(with_setting(scene, true, 10 * tolerance), samples);
    if (!tight.result.failure.empty() || !loose.result.failure.empty()) continue;
    Reference out;
    out.samples = tight.samples;
    out.error = distance(tight.samples, loose.samples);
    out.what = fmt::format("the scene's events at a tolerance of {:g}", tolerance);
    return out;
  }
  throw std::runtime_error(
      "no reference: the event engine does not get to the end; give --reference");
}

CostRow measure_row(const Scene& scene, double setting, int samples, const Reference& reference) {
  CostRow row;
  row.setting = setting;
  const Measured m = measure_once(scene, samples);
  const RunResult& r = m.result;
  row.failure = r.failure;
  // On the safe side: the error of the reference may add to the difference found.
  row.error = distance(m.samples, reference.samples) + reference.error;
  row.drift = r.summary.drift;
  row.penetration = r.summary.penetration;
  row.steps = r.counts.steps;
  row.seconds = r.seconds;
  row.met = static_cast<int>(std::count_if(r.judgements.begin(), r.judgements.end(),
                                           [](const Judgement& j) { return j.judged && j.met; }));
  // Without the looks in between; the least of several: everything else on the machine only adds.
  double spent = 0;
  for (int repeat = 0; repeat < 5 && spent < 0.3 && row.failure.empty(); ++repeat) {
    const double seconds = run(scene).seconds;
    spent += seconds;
    row.seconds = repeat == 0 ? seconds : std::min(row.seconds, seconds);
  }
  return row;
}

}  // namespace

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
  const EngineKind engine = make_plan(scene).engine;
  table.smooth = engine != EngineKind::stepping;
  std::vector<double> settings =
      options.settings.empty() ? default_settings(scene, table.smooth) : options.settings;
  std::sort(settings.begin(), settings.end(), std::greater<>());
  for (const double each : settings)
    if (!(each > 0) || !std::isfinite(each))
      throw std::invalid_argument(
          fmt::format("a tolerance or time step must be > 0, not {}", each));
  int done = 0;
  const auto tell = [&](const std::string& what) {
    if (options.progress) options.progress(what, done++, 1 + static_cast<int>(settings.size()));
  };

  tell("reference");
  const Reference reference =
      engine == EngineKind::event
          ? event_reference(scene, options.reference.value_or(1e-11), options.samples)
      : table.smooth ? smooth_reference(scene, options.reference.value_or(1e-12), options.samples)
                     : stepping_reference(scene, options.reference.value_or(settings.back() / 4),
                                          options.samples);
  table.reference = reference.what;
  table.reference_error = reference.error;
  for (const double setting : settings) {
    tell(fmt::format("{:g}", setting));
    table.rows.push_back(measure_row(with_setting(scene, table.smooth, setting), setting,
                                     options.samples, reference));
  }
  return table;
}

}  // namespace tether::scene
