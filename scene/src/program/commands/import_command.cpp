// Tether: `tether import`: robots of other programs as scenes. SPDX-License-Identifier:
// BSD-3-Clause

#include "import/import.hpp"
#include "program/commands.hpp"

namespace tether::scene {

namespace {

using Robot = import::ImportOptions;

struct ImportArguments {
  std::string file, out = "-", base;
  std::vector<std::string> joints, held, controls;
  Robot robot;
  bool no_joint_laws = false, strict = false, force = false;
};

/// NAME=VALUE; a name may have an equals sign, a value has none.
std::pair<std::string, double> read_named(const char* option, const std::string& word,
                                          const char* what) {
  const std::size_t equals = word.rfind('=');
  const auto value = equals == std::string::npos || equals == 0
                         ? std::nullopt
                         : finite_number(word.substr(equals + 1));
  if (!value)
    throw std::invalid_argument(fmt::format("{} {}: must be NAME=VALUE, {}", option, word, what));
  return {word.substr(0, equals), *value};
}

Robot options_of(const ImportArguments& a) {
  Robot out = a.robot;
  if (!a.base.empty()) out.base = a.base == "fixed" ? import::Base::fixed : import::Base::free;
  for (const std::string& word : a.joints)
    out.positions.push_back(read_named("--joint", word, "a position in rad or m"));
  for (const std::string& word : a.controls)
    out.controls.push_back(read_named("--control", word, "a number"));
  out.held.insert(a.held.begin(), a.held.end());
  out.joint_laws = !a.no_joint_laws;
  const auto check = [](const char* name, double number) {
    if (!std::isfinite(number) || std::abs(number) > 1e9)
      throw std::invalid_argument(fmt::format("{} {}: must be a finite number", name, number));
  };
  check("--height", out.height);
  check("--ground", out.ground.value_or(0));
  check("--friction", out.friction.value_or(0));
  if (out.friction && *out.friction < 0)
    throw std::invalid_argument(fmt::format("--friction {}: must be >= 0", *out.friction));
  return out;
}

/// Said once more on the standard error, since a scene may leave through a pipe.
int write_import(const ImportArguments& a) {
  const Robot options = options_of(a);
  Output scene;
  scene["state"] = a.out == "-" ? "" : a.out;
  formats::check_names(scene, {a.file == "-" ? "" : a.file});
  const SceneText robot = read_text(a.file);
  const import::Imported made = import::import_robot(robot.text, robot.name, options);
  write_scene_file(a.out, made.toml, a.force);
  for (const std::string& remark : made.remarks)
    fmt::print(stderr, "left out or changed: {}\n", remark);
  return a.strict && !made.remarks.empty() ? kNotMet : kGood;
}

}  // namespace

void add_import_command(CLI::App& app, int* status) {
  auto a = std::make_shared<ImportArguments>();
  CLI::App* command = app.add_subcommand(
      "import", "Makes a scene of a robot (URDF, or MuJoCo's MJCF), and says what it leaves out");
  command->add_option("robot", a->file, "Robot file (XML); - is the standard input")->required();
  command->add_option("--out", a->out, "The scene [-, the standard output]");
  command->add_option("--base", a->base, "The base: fixed or free [URDF: fixed; MJCF: as it says]")
      ->check(CLI::IsMember({"fixed", "free"}));
  command->add_option("--height", a->robot.height, "Raise the robot by this, m");
  command->add_option("--joint", a->joints, "Start: NAME=VALUE, rad or m; may be repeated")
      ->allow_extra_args(false);
  command->add_option("--control", a->controls, "Of an actuator: NAME=VALUE [0]; may be repeated")
      ->allow_extra_args(false);
  command->add_option("--hold", a->held, "Fix this joint where it starts; may be repeated")
      ->allow_extra_args(false);
  command->add_flag("--no-joint-laws", a->no_joint_laws,
                    "Leave out limits and friction of joints, which need the stepping engine");
  command->add_option("--ground", a->robot.ground,
                      "Add ground at this height, m, that the robot touches");
  command->add_option("--friction", a->robot.friction,
                      "Of all contacts [MJCF: as it says; URDF: 1]");
  command->add_flag("--mend", a->robot.mend,
                    "Change inertias that no body has to the nearest ones");
  command->add_flag("--hulls", a->robot.hulls,
                    "Meshes of a URDF touch as their convex hulls, not as convex parts");
  command
      ->add_option("--density", a->robot.density,
                   "Links of a URDF without <inertial> weigh as their shapes, kg/m^3")
      ->check(positive_number());
  command
      ->add_option("--files", a->robot.files,
                   "Folder that meshes and included files lie below [that of the robot]")
      ->check(CLI::ExistingDirectory);
  command->add_option("--end", a->robot.end, "End of the run, s [1]")->check(positive_number());
  command->add_flag("--strict", a->strict, "Exit code 1 if anything was left out or changed");
  command->add_flag("--force", a->force, "Replace a file that is there");
  command->footer(
      "Exit code: 0 written (what was left out is on the standard error and in the scene's "
      "comments),\n1 with --strict: something was left out or changed; 2 the robot or an option is "
      "wrong, or the\nfile cannot be read or written. What is taken over: scene/README.md.");
  command->callback([a, status] { *status = write_import(*a); });
}

}  // namespace tether::scene
