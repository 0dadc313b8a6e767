// Tether: runs a scene. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <limits>
#include <tether/scene/plan.hpp>
#include <tether/scene/run.hpp>

#include "binary.hpp"
#include "judge.hpp"
#include "recorder.hpp"

namespace tether::scene {

namespace {

constexpr const char kMagic[] = "tether state 1\n";

/// Times at which the run stops, in order, each for one or several reasons.
struct Event {
  double time;
  bool record, checkpoint;
};

/// Multiples of `every` and the end. The last multiple may be the end but for rounding.
std::vector<double> multiples(double every, double end) {
  std::vector<double> times;
  const double count = end / every;
  for (long k = 1; static_cast<double>(k) < count * (1 - 1e-12); ++k)
    times.push_back(static_cast<double>(k) * every);
  times.push_back(end);
  return times;
}

std::vector<Event> events(const Scene& scene, const std::vector<double>& stops) {
  std::vector<Event> all;
  const double every = scene.output.every > 0 ? scene.output.every : scene.end / 1000;
  for (const double t : multiples(every, scene.end)) all.push_back({t, true, false});
  if (scene.output.checkpoint > 0)
    for (const double t : multiples(scene.output.checkpoint, scene.end))
      all.push_back({t, false, true});
  all.push_back({scene.end, true, true});
  for (const Expect& expect : scene.expect)
    if (expect.time <= scene.end) all.push_back({expect.time, false, false});
  for (const double t : stops)
    if (t <= scene.end) all.push_back({t, false, false});
  std::stable_sort(all.begin(), all.end(),
                   [](const Event& a, const Event& b) { return a.time < b.time; });
  std::vector<Event> merged;
  for (const Event& event : all) {
    if (merged.empty() || merged.back().time != event.time) {
      merged.push_back(event);
    } else {
      merged.back().record = merged.back().record || event.record;
      merged.back().checkpoint = merged.back().checkpoint || event.checkpoint;
    }
  }
  return merged;
}

double processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// What a command line or a caller may have put over the scene.
const Scene& checked(const Scene& scene) {
  const auto demand = [](bool holds, const char* what, double value, const std::string& range) {
    if (!holds) throw std::invalid_argument(fmt::format("{} = {}: {}", what, value, range));
  };
  demand(scene.end > 0 && std::isfinite(scene.end), "end", scene.end,
         "must be a finite number > 0, s");
  for (const auto& [what, value] :
       {std::pair("every", scene.output.every), std::pair("checkpoint", scene.output.checkpoint)})
    demand(value == 0 || (value > 0 && scene.end / value <= kMostRecords), what, value,
           fmt::format("must be > 0, s, and end / it at most {:g}", kMostRecords));
  if (make_plan(scene).engine != EngineKind::stepping) return scene;
  const double step = scene.stepping.value_or(SteppingOptions{}).step;
  demand(scene.end / step <= kMostSteps, "step", step,
         fmt::format("end / step must be at most {:g}", kMostSteps));
  return scene;
}

/// One run from its start, or from a saved state, to the end.
class Run {
 public:
  Run(const Scene& scene, const RunOptions& options)
      : scene_(checked(scene)), options_(options), judge_(scene), engine_(make_engine(scene)) {
    result_.engine = engine_->name();
    if (options.restart.empty())
      start();
    else
      restore(options.restart);
    const Output& o = scene.output;
    if (!o.csv.empty())
      recorders_.push_back(make_csv_recorder(scene, o.csv, summary().start_energy, resume_));
    if (!o.vtk.empty()) recorders_.push_back(make_vtk_recorder(scene, o.vtk, resume_));
    if (!o.svg.empty())
      recorders_.push_back(make_picture_recorder(scene, o.svg, summary().start_energy));
    if (!resume_.restarted) stop({0, true, false});
  }

  RunResult go() {
    try {
      for (const Event& event : events(scene_, options_.stops)) {
        if (event.time <= done_) continue;
        const double before = processor_seconds();
        engine_->advance(event.time);
        result_.seconds += processor_seconds() - before;
        stop(event);
      }
    } catch (const SimulationError& e) {
      result_.failure = e.what();
    }
    finish();
    return std::move(result_);
  }

 private:
  Summary& summary() { return result_.summary; }

  void start() {
    const Diagnostics d = engine_->diagnostics();
    summary().start_energy = d.kinetic_energy + d.potential_energy;
  }

  void stop(const Event& event) {
    done_ = event.time;
    judge_.look(event.time, *engine_, summary().start_energy);
    if (options_.record) options_.record(*engine_);
    if (event.record) record();
    if (event.checkpoint && !scene_.output.state.empty()) save(scene_.output.state);
  }

  void record() {
    const Diagnostics d = engine_->diagnostics();
    Summary& s = summary();
    s.end_energy = d.kinetic_energy + d.potential_energy;
    s.lowest_change = std::min(s.lowest_change, s.end_energy - s.start_energy);
    s.largest_change = std::max(s.largest_change, s.end_energy - s.start_energy);
    s.drift = std::max(s.drift, d.drift);
    s.penetration = std::max(s.penetration, d.penetration);
    s.residual = std::max(s.residual, d.residual);
    s.contacts = std::max(s.contacts, d.contacts);
    for (const auto& recorder : recorders_) recorder->record(*engine_, d);
    if (options_.progress) options_.progress(engine_->time());
  }

  void finish() {
    result_.time = engine_->time();
    result_.counts = engine_->counts();
    result_.costs = engine_->costs();
    result_.judgements = judge_.judgements();
    for (const auto& recorder : recorders_) recorder->finish(result_.written, result_.remarks);
    if (saved_) result_.written.push_back(scene_.output.state);
  }

  // A state is whole or absent: it replaces the old one in one go.
  void save(const std::string& file) {
    make_folder_of(file);
    if (std::filesystem::exists(file) && !std::filesystem::is_regular_file(file))
      throw std::runtime_error("cannot write " + file + ": it is there and is no file");
    const std::string fresh = file + ".new";
    {
      std::ofstream out(fresh, std::ios::binary | std::ios::trunc);
      out << kMagic;
      const Summary& s = summary();
      binary::put(out, done_, engine_->time(), s.start_energy, s.end_energy, s.lowest_change,
                  s.largest_change, s.drift, s.penetration, s.residual, s.contacts);
      judge_.save(out);
      engine_->save(out);
      if (!out.flush()) throw std::runtime_error("cannot write " + fresh);
    }
    if (std::rename(fresh.c_str(), file.c_str()) != 0)
      throw std::runtime_error("cannot write " + file);
    saved_ = true;
  }

  void restore(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    if (!in) throw std::runtime_error("cannot open the saved state " + file);
    std::string magic(sizeof kMagic - 1, '\0');
    in.read(magic.data(), static_cast<std::streamsize>(magic.size()));
    if (!in || magic != kMagic) throw std::runtime_error(file + " is not a saved state");
    Summary& s = summary();
    binary::get(in, done_, resume_.time, s.start_energy, s.end_energy, s.lowest_change,
                s.largest_change, s.drift, s.penetration, s.residual, s.contacts);
    judge_.restore(in);
    engine_->restore(in);
    resume_.restarted = true;
    if (done_ >= scene_.end)
      throw std::runtime_error(fmt::format(
          "{} was saved at {} s, but the scene ends at {} s: nothing is left to run (--end)", file,
          done_, scene_.end));
  }

  const Scene& scene_;
  const RunOptions& options_;
  Judge judge_;
  std::unique_ptr<Engine> engine_;
  RunResult result_;
  Resume resume_;
  std::vector<std::unique_ptr<Recorder>> recorders_;
  double done_ = -1;  // the last event
  bool saved_ = false;
};

}  // namespace

bool RunResult::met() const {
  return std::all_of(judgements.begin(), judgements.end(),
                     [](const Judgement& j) { return j.beyond || (j.judged && j.met); });
}

RunResult run(const Scene& scene, const RunOptions& options) { return Run(scene, options).go(); }

}  // namespace tether::scene
