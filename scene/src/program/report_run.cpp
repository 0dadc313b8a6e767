// Tether: prints what a run gave. SPDX-License-Identifier: BSD-3-Clause
#include "commands.hpp"

#include <ctime>
#include <tether/scene/words.hpp>

#include "bounds.hpp"
#include "toml/report.hpp"

namespace tether::scene {

std::string on_terminal(std::string_view text) {
  std::string out;
  for (;;) {
    const std::size_t end = text.find('\n');
    out += files::printable(text.substr(0, end));
    if (end == std::string_view::npos) return out;
    out += '\n';
    text.remove_prefix(end + 1);
  }
}

std::string table_field(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const bool control = static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
    out += control ? ' ' : c;
    if (c == '"') out += '"';
  }
  return out.find_first_of(",\"") == std::string::npos ? out : '"' + out + '"';
}

namespace {

/// Rows under a heading, columns as wide as they must be.
class Table {
 public:
  explicit Table(std::vector<std::string> heading) : rows_{std::move(heading)} {}
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  void print() const {
    std::vector<std::size_t> widths(rows_.front().size());
    for (const auto& row : rows_)
      for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
    for (const auto& row : rows_) {
      std::string line = " ";
      for (std::size_t i = 0; i < row.size(); ++i)
        line += fmt::format(" {:<{}} ", row[i], widths[i]);
      line.erase(line.find_last_not_of(' ') + 1);
      fmt::print("{}\n", line);
    }
  }

 private:
  std::vector<std::vector<std::string>> rows_;
};

std::string text(const std::vector<double>& value) {
  if (value.empty()) return "-";
  if (value.size() == 1) return fmt::format("{:.9g}", value.front());
  std::string out = "[";
  for (const double x : value) out += fmt::format("{}{:.6g}", out.size() > 1 ? ", " : "", x);
  return out + "]";
}

const char* text(Verdict verdict) {
  constexpr const char* kTexts[] = {"NOT REACHED", "beyond", "met", "NOT MET"};  // as enumerated
  return kTexts[static_cast<std::size_t>(verdict)];
}

std::string bound(const Expect& e) {
  std::string out;
  if (!e.value.empty()) out += fmt::format("{} within {:g}", text(e.value), e.within);
  if (e.at_least) out += fmt::format("{}>= {:g}", out.empty() ? "" : ", ", *e.at_least);
  if (e.at_most) out += fmt::format("{}<= {:g}", out.empty() ? "" : ", ", *e.at_most);
  return out;
}

/// The body, joint or spring of a quantity.
std::string subject(const Scene& scene, const Expect& e) {
  if (e.joint >= 0) return scene.joints[static_cast<std::size_t>(e.joint)].name;
  if (e.spring >= 0) return scene.springs[static_cast<std::size_t>(e.spring)].name;
  return e.body >= 0 ? scene.bodies[static_cast<std::size_t>(e.body)].name : "";
}

void print_events(const Summary& s, const Counts& c) {
  fmt::print("  events       at {} times; {} impacts, {} contact problems\n", c.events, c.impacts,
             c.contact_problems);
  fmt::print("  drift        {:.2e} m; penetration {:.2e} m\n", s.drift, s.penetration);
  fmt::print("  work         {} steps, {} residuals, {} Jacobians, {} failed error tests\n",
             c.steps, c.residual_evaluations, c.jacobian_evaluations, c.error_test_failures);
}

void print_hand_overs(const Scene& scene, const RunResult& r) {
  for (std::size_t k = 0; k < std::min(kMostNamed, r.hand_overs.size()); ++k) {
    const HandOver& each = r.hand_overs[k];
    fmt::print(
        "  HANDED OVER  at {:.9g} s events could not go on; steps of {:g} s did{}: {}\n", each.time,
        scene.stepping.value_or(SteppingOptions{}).step,
        each.back ? fmt::format(" until {:.9g} s, and took {:.3g} J", *each.back, each.lost) : "",
        each.why);
  }
  if (r.hand_overs.size() > kMostNamed)
    fmt::print("               and {} times more, the last time at {:.9g} s\n",
               r.hand_overs.size() - kMostNamed, r.hand_overs.back().time);
}

void print_joint_events(const Scene& scene, const RunResult& r) {
  for (std::size_t k = 0; k < std::min(kMostNamed, r.joint_events.size()); ++k) {
    const ContactEvent& each = r.joint_events[k];
    fmt::print("  {:<12} {} at {:.9g} s{}\n", name(each.kind),
               scene.joints[static_cast<std::size_t>(each.joint)].name, each.time,
               each.lost != 0 ? fmt::format(", its impulse takes {:.6g} J", each.lost) : "");
  }
  if (r.joint_events.size() > kMostNamed)
    fmt::print("               and {} more\n", r.joint_events.size() - kMostNamed);
}

void print_work(const Scene& scene, const Summary& s, const Counts& c) {
  if (c.contact_problems > 0) {
    fmt::print("  contacts     at most {}; penetration {:.2e} m; residual {:.2e}\n", s.contacts,
               s.penetration, s.residual);
    fmt::print("  work         {} steps, {} contact problems, {} sweeps, {} unsolved\n", c.steps,
               c.contact_problems, c.sweeps, c.unsolved);
    if (c.accepted + c.halved > 0)
      fmt::print("  accepted     {} contact problems above the tolerance; {} steps halved\n",
                 c.accepted, c.halved);
    if (const double accuracy = scene.stepping.value_or(SteppingOptions{}).accuracy; accuracy > 0)
      fmt::print("  accuracy     {:g} of the size of each body: {} sub-steps refused\n", accuracy,
                 c.error_test_failures);
  } else if (c.residual_evaluations > 0) {
    fmt::print("  drift        {:.2e} (largest violation of a joint or a kept invariant)\n",
               s.drift);
    fmt::print(
        "  work         {} steps, {} residuals, {} Jacobians, {} projections, {} failed "
        "error tests\n",
        c.steps, c.residual_evaluations, c.jacobian_evaluations, c.projections,
        c.error_test_failures);
  } else {
    fmt::print("  work         {} steps{}\n", c.steps,
               c.halved > 0 ? fmt::format(", {} of them or of their parts halved", c.halved) : "");
  }
}

void print_summary(const Scene& scene, const RunResult& r) {
  const Summary& s = r.summary;
  const Counts& c = r.counts;
  fmt::print("{}: {} engine, {:g} s\n", scene.name.empty() ? on_terminal(scene.file) : scene.name,
             r.engine, r.time);
  fmt::print(
      "  energy       {:.9g} J at the start, {:.9g} J at the end; change {:.2e} to {:.2e} J\n",
      s.start_energy, s.end_energy, s.lowest_change, s.largest_change);
  print_joint_events(scene, r);
  if (r.engine == "event") print_events(s, r.counts_of_events);
  print_hand_overs(scene, r);
  if (r.engine != "event" || !r.hand_overs.empty()) print_work(scene, s, c);
  if (r.engine != "smooth" && c.contact_problems + r.counts_of_events.contact_problems > 0)
    fmt::print("  impacts      {}\n", simultaneous_impacts_text(scene));
  for (const std::string& warning : r.warnings)
    fmt::print("  WARNING      {}\n", on_terminal(warning));
  if (!r.failure.empty()) fmt::print("  stopped at {:g} s: {}\n", r.time, on_terminal(r.failure));
}

void print_times(const RunResult& r, double wall) {
  timespec processor{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &processor);
  fmt::print(
      "  time         engine {:.3g} s (processor {:.3g} s); with reading and output {:.3g} s "
      "(processor {:.3g} s)\n",
      r.wall, r.seconds, wall,
      static_cast<double>(processor.tv_sec) + 1e-9 * static_cast<double>(processor.tv_nsec));
}

void print_judgements(const Scene& scene, const RunResult& r) {
  if (scene.expect.empty()) return;
  const long beyond = r.count(Verdict::beyond);
  fmt::print("expectations: {} of {} met{}\n", r.count(Verdict::met), scene.expect.size(),
             beyond > 0 ? fmt::format(", {} beyond the end", beyond) : "");
  Table table({"", "t / s", "quantity", "of", "found", "expected", "error"});
  for (std::size_t i = 0; i < scene.expect.size(); ++i) {
    const Expect& e = scene.expect[i];
    const Judgement& j = r.judgements[i];
    table.add({text(j.verdict),
               e.throughout ? fmt::format("to {:g}", e.time) : fmt::format("{:g}", e.time),
               std::string(word(e.quantity)), subject(scene, e), text(j.value), bound(e),
               e.value.empty() ? "" : fmt::format("{:.1e}", j.error)});
  }
  table.print();
}

}  // namespace

void report(const Scene& scene, const RunResult& r, const std::string& shared, double wall) {
  print_summary(scene, r);
  fmt::print("{}", shared);
  print_times(r, wall);
  print_judgements(scene, r);
  for (const std::string& file : r.written) fmt::print("written: {}\n", on_terminal(file));
  for (const std::string& remark : r.remarks) fmt::print("note: {}\n", on_terminal(remark));
  if (r.interrupted)
    fmt::print("interrupted at {:.9g} s of {:g} s{}\n", r.time, scene.end,
               scene.output["state"].empty()
                   ? ""
                   : fmt::format("; to go on: --restart {}", scene.output["state"]));
  std::fflush(stdout);
}

// Everything on the clock: parts that were measured on different clocks add up to nothing.
void print_costs(const RunResult& r) {
  double sum = 0;
  for (const EffectCost& each : r.costs) sum += each.seconds;
  fmt::print("cost: {:.3g} s for {:g} s (processor {:.3g} s)\n", r.whole_wall, r.time,
             r.whole_seconds);
  Table table({"effect", "s", "share"});
  const auto add = [&](const std::string& what, double seconds) {
    table.add({what, fmt::format("{:.3g}", seconds),
               fmt::format("{:.1f} %", 100 * seconds / std::max(r.whole_wall, 1e-300))});
  };
  for (const EffectCost& each : r.costs) add(each.effect, each.seconds);
  add("start, records, expectations", std::max(0.0, r.whole_wall - sum));
  table.print();
}

int exit_code(const RunResult& r) {
  if (!r.failure.empty()) return kFailed;
  return r.met() ? kGood : kNotMet;
}

}  // namespace tether::scene
