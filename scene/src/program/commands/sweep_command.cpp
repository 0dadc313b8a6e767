// Tether: `tether sweep`: runs a scene over ranges of its numbers. SPDX-License-Identifier:
// BSD-3-Clause

#include <progress.hpp>
#include <tether/scene/words.hpp>
#include <thread>

#include "bounds.hpp"
#include "files/read.hpp"
#include "lists.hpp"
#include "program/commands.hpp"

namespace tether::scene {

namespace {

struct SweepArguments {
  std::string file, out = "-";
  std::vector<std::string> vary;
  int jobs = 0;
  bool quiet = false, force = false;
};

/// PATH=FROM:TO:COUNT[:log] or PATH=VALUE,VALUE,...
struct VariedNumber {
  std::string path;
  std::vector<double> values;
};

[[noreturn]] void refuse(const std::string& word, const std::string& why) {
  throw std::invalid_argument(fmt::format("--vary {}: {}", word, why));
}

std::vector<double> range(const std::string& word, const std::vector<std::string>& parts) {
  const bool logarithmic = parts.size() == 4 && parts[3] == "log";
  const std::optional<double> from = finite_number(parts[0]), to = finite_number(parts[1]),
                              count = finite_number(parts[2]);
  if ((parts.size() == 4 && !logarithmic) || !from || !to || !count)
    refuse(word, "a range is FROM:TO:COUNT or FROM:TO:COUNT:log, e.g. 0.1:0.5:9");
  if (*count != std::floor(*count) || *count < 2 || *count > static_cast<double>(kMostListed))
    refuse(word, fmt::format("COUNT must be a whole number from 2 to {}", kMostListed));
  if (logarithmic && !(*from > 0 && *to > 0)) refuse(word, "both ends of log must be > 0");
  const int last = static_cast<int>(*count) - 1;
  std::vector<double> values;
  for (int k = 0; k <= last; ++k) {
    const double share = static_cast<double>(k) / last;
    // Values have 15 digits, so that 0.1:0.5:9 has 0.15 and not the number beside it.
    const double value =
        logarithmic ? *from * std::pow(*to / *from, share) : *from * (1 - share) + *to * share;
    values.push_back(finite_number(fmt::format("{:.15g}", value)).value_or(value));
  }
  values.back() = *to;
  return values;
}

/// Throws std::invalid_argument if a path leads to nothing. Values that are wrong are no matter.
void parse_paths(const SceneText& scene, const std::vector<Setting>& settings) {
  try {
    parse_scene_with(scene.text, scene.name, settings);
  } catch (const SceneError& e) {
    // An unknown key is a path that leads to nothing; values are judged one by one.
    for (const Problem& problem : e.problems())
      for (const Setting& each : settings) {
        const std::string key = each.path.substr(each.path.rfind('.') + 1);
        const std::size_t at = problem.field.size() - std::min(problem.field.size(), key.size());
        if (problem.allowed.rfind("unknown key", 0) == 0 && problem.field.substr(at) == key)
          throw std::invalid_argument(fmt::format("\"{}\": {}", each.path, problem.allowed));
      }
  }
}

/// std::invalid_argument naming the word otherwise.
VariedNumber read_varied(const std::string& word) {
  const std::size_t equals = word.find('=');
  if (equals == std::string::npos || equals == 0)
    refuse(word, "must be PATH=VALUES, e.g. pair.friction=0.1:0.5:9");
  VariedNumber out;
  out.path = word.substr(0, equals);
  const std::string values = word.substr(equals + 1);
  if (const auto parts = files::split(values, ':'); parts.size() == 3 || parts.size() == 4) {
    out.values = range(word, parts);
    return out;
  }
  for (const std::string& each : files::split(values, ',')) {
    const std::optional<double> value = finite_number(each);
    if (!value) refuse(word, fmt::format("\"{}\" is not a finite number", each));
    out.values.push_back(*value);
  }
  return out;
}

/// All combinations, the last range being the fastest.
std::vector<std::vector<Setting>> combinations(const std::vector<VariedNumber>& varied) {
  std::vector<std::vector<Setting>> all(1);
  for (const VariedNumber& each : varied) {
    if (all.size() * each.values.size() > kMostListed)
      throw std::invalid_argument(
          fmt::format("--vary: more than {} combinations of values", kMostListed));
    std::vector<std::vector<Setting>> longer;
    for (const std::vector<Setting>& before : all)
      for (const double value : each.values) {
        longer.push_back(before);
        longer.back().push_back({each.path, value});
      }
    all = std::move(longer);
  }
  return all;
}

std::string header(const Scene& scene, const std::vector<VariedNumber>& varied) {
  std::string text;
  for (const VariedNumber& each : varied) text += table_field(each.path) + ',';
  text += kSweepHead;
  for (std::size_t k = 0; k < scene.expect.size(); ++k) {
    const Expect& e = scene.expect[k];
    const std::string of =
        e.body >= 0 ? scene.bodies[static_cast<std::size_t>(e.body)].name + '.' : std::string();
    for (int i = 0; i < components(e.quantity); ++i)
      text += ',' + table_field(fmt::format(
                        "{}{}{}@{:g}", of, word(e.quantity),
                        components(e.quantity) > 1 ? fmt::format("[{}]", i + 1) : "", e.time));
  }
  return text + ",failure\n";
}

const char* status_of(const RunResult& r) {
  if (r.interrupted) return "interrupted";
  if (!r.failure.empty()) return "failed";
  return r.met() ? "ok" : "not met";
}

std::string row_of(const Scene& scene, const RunResult& r) {
  const Summary& s = r.summary;
  const Counts& c = r.counts;
  std::string row =
      fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{:.3g}", status_of(r),
                  r.count(Verdict::met), scene.expect.size(), r.time, s.start_energy, s.end_energy,
                  s.lowest_change, s.largest_change, s.drift, s.penetration, s.residual, s.contacts,
                  c.steps, c.contact_problems, c.unsolved, r.seconds);
  for (std::size_t k = 0; k < scene.expect.size(); ++k)
    for (int i = 0; i < components(scene.expect[k].quantity); ++i) {
      const std::vector<double>& value = r.judgements[k].value;
      const auto at = static_cast<std::size_t>(i);
      row += at < value.size() ? fmt::format(",{}", value[at]) : ",";
    }
  std::string why = r.failure;
  for (const std::string& each : r.warnings)
    why += (why.empty() ? "WARNING: " : "; WARNING: ") + each;
  return row + ',' + table_field(why);
}

/// A row without its settings: of a run, or with what is wrong and empty fields between.
std::string row_of(const std::string& text, const std::string& name,
                   const std::vector<Setting>& settings, std::size_t fields) {
  try {
    Scene scene = parse_scene_with(text, name, settings);
    const double every = scene.output.every;
    scene.output = Output{};
    scene.output.every = every;
    RunOptions options;
    options.interrupted = [] { return caught_signal() != 0; };
    return row_of(scene, run(scene, options));
  } catch (const std::exception& e) {
    return "wrong" + std::string(fields, ',') + table_field(e.what());
  }
}

bool begins(const std::string& row, const char* status) { return row.rfind(status, 0) == 0; }

int exit_code(const std::vector<std::string>& rows) {
  const auto any = [&](const char* status) {
    return any_of(rows, [&](const std::string& row) { return begins(row, status); });
  };
  if (all_of(rows, [](const auto& row) { return begins(row, "wrong"); })) return kWrong;
  if (any("wrong") || any("failed")) return kFailed;
  return any("not met") ? kNotMet : kGood;
}

int sweep(const SweepArguments& arguments) {
  const SceneText scene_text = read_scene_text(arguments.file);
  std::vector<VariedNumber> varied;
  for (const std::string& each : arguments.vary) varied.push_back(read_varied(each));
  const std::vector<std::vector<Setting>> all = combinations(varied);
  const Scene plain = parse_scene(scene_text.text, scene_text.name);
  parse_paths(scene_text, all.front());
  const std::string first = header(plain, varied);
  const auto fields =
      static_cast<std::size_t>(std::count(first.begin(), first.end(), ',')) - varied.size();

  catch_signals();
  if (arguments.out != "-") {
    Output table;
    table["csv"] = arguments.out;
    std::vector<std::string> inputs = plain.surface_files;
    if (arguments.file != "-") inputs.push_back(arguments.file);
    check_outputs(table, inputs, arguments.force);
  }
  StandardOutput output(arguments.out);
  tether::Progress bar(1);
  bar.start(plain.name.empty() ? plain.file : plain.name, 1, 1);
  WorkerProcesses workers(arguments.jobs > 0 ? static_cast<unsigned>(arguments.jobs)
                                             : std::max(1u, std::thread::hardware_concurrency()));
  workers.work = [&](std::size_t k) {
    return row_of(scene_text.text, scene_text.name, all[k], fields);
  };
  workers.lost = [&](const std::string& why) {
    return "failed" + std::string(fields, ',') + table_field(why);
  };
  workers.stopped = [] { return caught_signal() != 0; };
  if (!arguments.quiet)
    workers.progress = [&](std::size_t done) {
      bar.at(static_cast<double>(done) / static_cast<double>(all.size()));
    };
  const std::vector<std::string> rows = workers.run(all.size());
  bar.hide();
  std::string table = first;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (rows[k].empty()) continue;  // not begun
    for (const Setting& each : all[k]) table += fmt::format("{},", each.value);
    table += rows[k] + '\n';
  }
  output.write(table);
  const auto count = [&](const char* status) {
    return count_if(rows, [&](const std::string& row) { return begins(row, status); });
  };
  fmt::print("{} runs: {} ok, {} not met, {} failed, {} wrong{}\n", rows.size(), count("ok"),
             count("not met"), count("failed"), count("wrong"),
             caught_signal() != 0 ? ", the others interrupted" : "");
  if (arguments.out != "-") fmt::print("written: {}\n", on_terminal(arguments.out));
  return caught_signal() != 0 ? kSignal + caught_signal() : exit_code(rows);
}

}  // namespace

void add_sweep_command(CLI::App& app, int* status) {
  auto a = std::make_shared<SweepArguments>();
  CLI::App* command =
      app.add_subcommand("sweep", "Runs a scene over ranges of its numbers: one row of CSV a run");
  command->add_option("scene", a->file, "Scene file (TOML); - is the standard input")->required();
  command
      ->add_option("--vary", a->vary,
                   "PATH=FROM:TO:COUNT, equally spaced, PATH=FROM:TO:COUNT:log, or "
                   "PATH=VALUE,VALUE,...; more than one: all combinations. PATH: "
                   "pair.friction, body.NAME.velocity.x, spring.2.stiffness, stepping.step; * is "
                   "every element")
      ->required()
      ->delimiter(' ');
  command->add_option("--out", a->out, "The table; - is the standard output")
      ->capture_default_str();
  command->add_option("--jobs", a->jobs, "Runs at a time [as many as there are processors]")
      ->check(CLI::Range(1, 1024));
  command->add_flag("--force", a->force, "Replace a table that Tether did not write");
  command->add_flag("--quiet", a->quiet, "No progress bar");
  command->footer(
      "Rows are in the order of the values, whichever run ends first. A run that fails, or whose "
      "value\nis wrong, is a row that says so. Exit code: 0 all met, 1 an expectation is not met, "
      "2 the scene,\na path or every value is wrong, 3 a run failed or a value is wrong, 130 "
      "(143) ended by Ctrl-C\n(SIGTERM), with the rows that were done.");
  command->callback([a, status] { *status = sweep(*a); });
}

}  // namespace tether::scene
