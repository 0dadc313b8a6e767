// Tether: `tether run`: moves a scene. SPDX-License-Identifier: BSD-3-Clause

#include <chrono>
#include <filesystem>
#include <progress.hpp>

#include "program/commands.hpp"
#include "program/ranks/ranks.hpp"

namespace tether::scene {

namespace {

struct RunArguments {
  std::string file, restart, folder;
  std::optional<std::string> otherwise;
  std::map<const formats::Format*, std::string> files;  // as named by options
  std::optional<double> end, every;
  bool force = false, quiet = false, strict = false;
};

/// A link to what is not there: nobody can tell where it leads.
bool is_loose_link(const std::filesystem::path& path) {
  std::error_code error;
  return std::filesystem::is_symlink(path, error) && !std::filesystem::exists(path, error);
}

/// File names given in a scene, and those made of them, stay inside the output folder, links
/// resolved: only the command line may choose to overwrite files elsewhere.
void stay_inside(const std::string& folder, const Output& o) {
  namespace fs = std::filesystem;
  const fs::path inside = fs::weakly_canonical(fs::absolute(folder.empty() ? "." : folder));
  for (const std::string& file : formats::all_names(o)) {
    const fs::path whole = fs::weakly_canonical(inside / file),
                   way = whole.lexically_relative(inside);
    std::error_code error;
    const fs::file_status there = fs::status(whole, error);
    if (way.empty() || *way.begin() == ".." || is_loose_link(inside / file) ||
        (fs::exists(there) && !fs::is_regular_file(there) && !fs::is_directory(there)))
      throw std::invalid_argument(fmt::format(
          "output: \"{}\" leads to {}: names in a scene stay in the folder of its output, {}, and "
          "name files; options of the command line may name any place",
          file, whole.string(), inside.string()));
  }
}

/// Settings of the command line override those of the scene.
void overlay(const RunArguments& arguments, Scene& scene) {
  Output& o = scene.output;
  Output by_scene = o;
  for (const auto& [format, file] : arguments.files) by_scene[format->name].clear();
  stay_inside(arguments.folder, by_scene);
  for (const auto& [format, file] : arguments.files) o[format->name] = file;
  if (arguments.every) o.every = *arguments.every;
  if (!arguments.folder.empty())
    for (const formats::Format* each : formats::all())
      if (std::string& file = o[each->name]; !file.empty() && file != "-")
        file = (std::filesystem::path(arguments.folder) / file).string();
  if (arguments.otherwise) {
    if (scene.engine != EngineKind::event && !scene.event)
      throw std::invalid_argument(
          "--otherwise is for scenes of the event engine: engine = \"event\", or [event]");
    if (!scene.event) scene.event.emplace();
    scene.event->otherwise =
        *arguments.otherwise == "stepping" ? Otherwise::stepping : Otherwise::stop;
  }
  if (!arguments.end) return;
  // Records stay where they were, so that runs in parts make one table.
  if (o.every == 0) o.every = scene.end / 1000;
  scene.end = *arguments.end;
}

/// Leaves a process only its share of a film: the first of several processes writes all else.
void write_film_alone(Output& o) {
  for (const formats::Format* each : formats::all())
    if (!each->film) o[each->name].clear();
}

/// ranks: processes that make the same run, null: there is one.
int run_scene(const RunArguments& arguments, Ranks* ranks) {
  const auto begin = std::chrono::steady_clock::now();
  const bool first = !ranks || ranks->messages().rank() == 0;
  if (ranks && arguments.file == "-")
    throw std::invalid_argument("several processes have no standard input: give the scene's file");
  Scene scene = read_scene_argument(arguments.file);
  overlay(arguments, scene);
  if (!first) write_film_alone(scene.output);
  catch_signals();
  StandardOutputFile standard_output(scene.output);
  tether::Progress bar(1);
  RunOptions options;
  options.restart = arguments.restart;
  options.force = arguments.force;
  int signal = 0;
  options.interrupted = [&] {
    signal = ranks ? ranks->largest(caught_signal()) : caught_signal();
    return signal != 0;
  };
  std::optional<contact::RankTeam> team;
  if (ranks) {
    options.team = &team.emplace(ranks->messages());
    options.among = {ranks->messages().rank(), ranks->messages().size(),
                     [ranks] { ranks->largest(0); }};
  }
  if (first) bar.start(scene.name, scene.end, 1);
  if (!arguments.quiet && first) options.progress = [&](double t) { bar.at(t); };
  const RunResult result = run(scene, options);
  int code = result.interrupted ? kSignal + signal : exit_code(result);
  if (arguments.strict && !result.warnings.empty() && code == kGood) code = kNotMet;
  if (!first) return code;
  bar.hide();
  standard_output.copy();
  std::string shared;
  if (ranks)
    shared = fmt::format("  ranks        {} processes, which shared {} contact problems\n",
                         ranks->messages().size(), team->problems());
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  report(scene, result, shared, took.count());
  return code;
}

/// By all processes that mpirun has started, by the one that there is otherwise.
int run_together(const RunArguments& arguments) {
  const std::unique_ptr<Ranks> ranks = join_ranks();
  if (!ranks) return run_scene(arguments, nullptr);
  int status = kWrong;
  std::string why;
  try {
    status = run_scene(arguments, ranks.get());
  } catch (const std::exception& e) {
    why = e.what();
  }
  std::fflush(stdout);
  return ranks->finish(status, why);
}

}  // namespace

void add_run_command(CLI::App& app, int* status) {
  auto a = std::make_shared<RunArguments>();
  CLI::App* command = app.add_subcommand(
      "run", "Moves a scene, records what its [output] names, and judges it by its [[expect]]");
  command->add_option("scene", a->file, "Scene file (TOML); - is the standard input")->required();
  command->add_option("--restart", a->restart,
                      "Go on from a saved state; the bits are those of a run in one piece");
  command->add_option("--output", a->folder, "Folder of all files written");
  for (const formats::Format* each : formats::all())
    command->add_option_function<std::string>(
        std::string("--") + each->name,
        [a = a.get(), each](const std::string& file) { a->files[each] = file; }, each->help);
  command->add_option("--every", a->every, "Time between records, s")->check(positive_number());
  command->add_option("--end", a->end, "End of the run, s")->check(positive_number());
  command
      ->add_option(
          "--otherwise", a->otherwise,
          "Where the event engine cannot go on: stop (exit code 3), or stepping from there "
          "(said in the summary; exit code as of a run of steps)")
      ->check(CLI::IsMember({"stop", "stepping"}));
  command->add_flag("--force", a->force,
                    "Replace files that Tether did not write; with --restart: the state may be of "
                    "another scene, of which positions and velocities are taken over, not bits");
  command->add_flag("--quiet", a->quiet, "No progress bar");
  command->add_flag(
      "--strict", a->strict,
      "Exit code 1 if the summary has a WARNING: of steps too long for a rotation, or "
      "of contact problems that were not solved");
  command->footer(
      "Exit code: 0 every expectation is met, 1 one is not, 2 the scene, a file or an option is\n"
      "wrong, 3 the run could not go on, 130 (143) ended by Ctrl-C (SIGTERM), with all files "
      "whole\n"
      "and the state saved. Options go before what the scene says in [output]. One of --csv, "
      "--svg, --html and "
      "--state may\nbe -, the standard output; what the run says goes to the standard error then.\n"
      "mpirun -n N tether run SCENE: N processes share the contact problems of a scene that steps "
      "with\nimpulses; the bits are those of one.");
  command->callback([a, status] { *status = run_together(*a); });
}

}  // namespace tether::scene
