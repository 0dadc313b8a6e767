// Tether: `tether check`, `plan` and `verify`: is a scene right, what does it ask for, does a
// certificate hold? SPDX-License-Identifier: BSD-3-Clause
#include <iostream>

#include "bounds.hpp"
#include "certificate/judge.hpp"
#include "plan/engine_type.hpp"
#include "program/commands.hpp"

namespace tether::scene {

namespace {

/// Warnings of what the scene begins with that its author may not have meant.
void print_start(const Scene& scene) {
  for (const std::string& each : overlaps_at_start(scene))
    fmt::print("WARNING   {}\n", on_terminal(each));
  const std::vector<std::string> names = bodies_out_of_touch(scene);
  if (names.empty()) return;
  const auto end = names.begin() + static_cast<std::ptrdiff_t>(std::min(kMostNamed, names.size()));
  fmt::print(
      "note      nothing can touch {}{}: no [[pair]] lets something meet their material\n",
      fmt::join(names.begin(), end, ", "),
      names.size() > kMostNamed ? fmt::format(" and {} more", names.size() - kMostNamed) : "");
}

struct CheckArguments {
  std::vector<std::string> files;
  bool print = false;
};

int check(const CheckArguments& arguments) {
  int status = kGood;
  for (const std::string& file : arguments.files) {
    try {
      Scene scene = read_scene_argument(file);
      const Plan plan = make_plan(scene);
      if (!arguments.print) print_start(scene);
      make_engine(scene, plan);  // which refuses what a run would
      if (arguments.print) {
        engine_type(plan.engine).spell_out(scene, false);
        fmt::print("{}", write_scene(scene));
        continue;
      }
      fmt::print("{}: right (bodies: {}, effects: {}, expectations: {})\n", on_terminal(file),
                 plan.bodies, plan.effects.size(), scene.expect.size());
    } catch (const SceneError& e) {
      fmt::print(stderr, "{}\n", e.what());
      status = kWrong;
    } catch (const std::exception& e) {
      fmt::print(stderr, "{}: {}\n", on_terminal(file), on_terminal(e.what()));
      status = kWrong;
    }
  }
  return status;
}

struct PlanArguments {
  std::string file;
  bool run = false;
};

// Who begins inside whom is found by a step, which takes some 2 kB a body.

int plan(const PlanArguments& arguments) {
  const Scene scene = read_scene_argument(arguments.file);
  const Plan plan = make_plan(scene);
  std::cout << plan << std::flush;
  if (plan.bodies <= 10000)
    print_start(scene);
  else
    fmt::print("note      tether check tells which of so many bodies begin inside each other\n");
  if (!arguments.run) return kGood;
  Scene silent = scene;
  silent.output = Output{};
  catch_signals();
  RunOptions options;
  options.interrupted = [] { return caught_signal() != 0; };
  const RunResult result = run(silent, options);
  print_costs(result);
  if (result.interrupted) {
    fmt::print("interrupted at {:.9g} s of {:g} s\n", result.time, scene.end);
    return kSignal + caught_signal();
  }
  if (!result.failure.empty()) fmt::print("stopped at {:g} s: {}\n", result.time, result.failure);
  return result.failure.empty() ? kGood : kFailed;
}

int verify(const std::vector<std::string>& files) {
  int status = kGood;
  for (const std::string& file : files) {
    const certificate::Verdict verdict = certificate::judge(file);
    if (!verdict.damage.empty()) {
      fmt::print(stderr, "{}: cannot be judged: {}\n", on_terminal(file),
                 on_terminal(verdict.damage));
      status = kWrong;
      continue;
    }
    for (const std::string& each : verdict.faults)
      fmt::print("{}: {}\n", on_terminal(file), on_terminal(each));
    const std::string what =
        verdict.broken == 0 ? "holds" : fmt::format("{} laws are broken", verdict.broken);
    fmt::print("{}: {} (judgements: {})\n", on_terminal(file), what, verdict.judged);
    if (verdict.broken > 0 && status == kGood) status = kNotMet;
  }
  return status;
}

}  // namespace

void add_check_command(CLI::App& app, int* status) {
  auto arguments = std::make_shared<CheckArguments>();
  CLI::App* command = app.add_subcommand(
      "check", "Reads scene files and names what is wrong, with line, field and what is allowed");
  command->add_option("scenes", arguments->files, "Scene files (TOML); - is the standard input")
      ->required();
  command->add_flag("--print", arguments->print, "Print the scene with every default spelt out");
  command->footer("Exit code: 0 right, 2 wrong. The format: docs/scene_fields.md.");
  command->callback([arguments, status] { *status = check(*arguments); });
}

void add_plan_command(CLI::App& app, int* status) {
  auto arguments = std::make_shared<PlanArguments>();
  CLI::App* command = app.add_subcommand(
      "plan", "Tells which effects a scene asks for, which engine moves it, and how large it is");
  command->add_option("scene", arguments->file, "Scene file (TOML); - is the standard input")
      ->required();
  command->add_flag("--run", arguments->run, "Run it, and tell what each effect cost");
  command->footer(
      "Exit code: 0, 2 the scene is wrong or no engine has it, 3 --run could not go on, 130 (143) "
      "--run\nended by Ctrl-C (SIGTERM).");
  command->callback([arguments, status] { *status = plan(*arguments); });
}

void add_verify_command(CLI::App& app, int* status) {
  auto files = std::make_shared<std::vector<std::string>>();
  CLI::App* command = app.add_subcommand(
      "verify", "Judges certificates (tether run --certificate) by the laws of mechanics");
  command->add_option("certificates", *files, "Files of tether run --certificate")->required();
  command->footer(
      "Exit code: 0 every law holds, 1 one is broken (step, time, body or joint, law, amount and\n"
      "bound are told), 2 a file cannot be judged. The format: docs/certificate.md.");
  command->callback([files, status] { *status = verify(*files); });
}

}  // namespace tether::scene
