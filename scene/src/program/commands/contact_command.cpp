// Tether: `tether contact`: solves contact problems in files. SPDX-License-Identifier: BSD-3-Clause
#include "program/commands.hpp"

#include <cstdio>
#include <filesystem>
#include <tether/contact.hpp>
#include <tether/contact/files.hpp>

namespace tether::scene {
namespace {

using namespace tether::contact;

struct ContactArguments {
  std::vector<std::string> files;
  Options options;
  bool csv = false, prove = false;
};

std::map<std::string, Law> laws_by_name() {
  std::map<std::string, Law> out;
  for (const Law each : laws()) out[name(each)] = each;
  return out;
}

const std::map<std::string, Measure> kMeasures = {{"fixed_point", Measure::fixed_point},
                                                  {"natural_map", Measure::natural_map}};

// Words, not values: CLI11 would print those of an enumeration of bytes as characters. `value` has
// to outlive the parsing.
template <class E>
void add_choice(CLI::App& command, const char* option, const char* what,
                const std::map<std::string, E>& words, E& value) {
  std::vector<std::string> names;
  std::string now;
  for (const auto& [word, each] : words) {
    names.push_back(word);
    if (each == value) now = word;
  }
  command
      .add_option_function<std::string>(
          option, [words, &value](const std::string& word) { value = words.at(word); }, what)
      ->check(CLI::IsMember(names))
      ->default_str(now);
}

// The proof of one solution, as columns or as lines; false: there is none.
bool print_proof(const Proof& proof, bool csv) {
  const bool holds = proof.status != ProofStatus::not_proven;
  if (csv) {
    std::printf(",%s,%.3e,%.3e,%.3e,%.3e", name(proof.status), proof.radius, proof.relative_radius,
                proof.change, proof.relative_change);
    return holds;
  }
  std::printf("  %s", name(proof.status));
  if (holds)
    std::printf(": an exact solution within %.3e N s, %.3e of the largest impulse", proof.radius,
                proof.relative_radius);
  if (proof.status == ProofStatus::proven_nearby)
    std::printf(", for b changed by at most %.3e m/s, %.3e of the largest", proof.change,
                proof.relative_change);
  std::printf("\n");
  if (!proof.reason.empty()) std::printf("  contact %d: %s\n", proof.contact, proof.reason.c_str());
  return holds;
}

// Whether a file that holds more than contacts is solved: joints, masses, rolling friction.
bool run_cones(const ContactArguments& arguments, const std::string& file,
               const ConeProblem& problem) {
  const Options& o = arguments.options;
  const ConeSolution s = ConeSolver(o).solve(problem);
  const auto blocks = static_cast<int>(problem.cones().size());
  const double dissipation = s.impulses.dot(s.velocities);
  const double energy_change = 0.5 * s.impulses.dot(s.velocities - problem.b());
  if (arguments.csv) {
    // The other measures are of contacts of one kind: empty.
    std::printf("%s,%d,%s,%g,%s,%.3e,%d,%d,,,,,%.3e,%.3e,%.3e,%s\n", table_field(file).c_str(),
                blocks, name(o.law), o.tolerance, name(s.status), s.error, s.counts.sweeps,
                s.counts.factorisations, dissipation, energy_change, s.error,
                arguments.prove ? ",not_proven,,,," : "");
    return s.status == Status::solved;
  }
  std::printf("%s: %d cones of %d rows, %s\n", on_terminal(file).c_str(), blocks, problem.rows(),
              name(o.law));
  std::printf("  %s, error %.3e; %d sweeps, %d factorisations\n", name(s.status), s.error,
              s.counts.sweeps, s.counts.factorisations);
  std::printf("  energy change %.9e\n", energy_change);
  if (!s.advice.empty()) std::printf("  %s\n", s.advice.c_str());
  if (arguments.prove) std::printf("  not_proven: proofs are of friction contacts alone\n");
  return s.status == Status::solved;
}

// Reads a file that is no problem of contacts alone; null for a pipe, which has been read by then.
std::unique_ptr<ConeProblem> as_cones(const std::string& file) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) return nullptr;
  try {
    return std::make_unique<ConeProblem>(read_cones(file));
  } catch (const std::runtime_error&) {
    return nullptr;
  }
}

// One solved problem in words.
void print(const std::string& file, const contact::Problem& problem, Law law, const Solution& s,
           const Residuals& r) {
  int count[3] = {0, 0, 0};
  for (Regime regime : s.regimes) ++count[static_cast<int>(regime)];
  std::printf("%s: %d contacts, %s\n", on_terminal(file).c_str(), problem.contacts(), name(law));
  std::printf("  %s, error %.3e; %d sweeps, %d factorisations\n", name(s.status), s.error,
              s.counts.sweeps, s.counts.factorisations);
  std::printf("  separating %d, sticking %d, sliding %d\n", count[0], count[1], count[2]);
  std::printf("  fixed point %.3e, natural map %.3e, Signorini %.3e, cone %.3e, alignment %.3e\n",
              r.fixed_point, r.natural_map, r.signorini, r.cone, r.alignment);
  std::printf("  energy change %.9e\n", r.energy_change);
  if (!s.replaced.empty()) {
    std::printf("  the Coulomb rule replaces the law at %zu contacts:", s.replaced.size());
    for (int i : s.replaced) std::printf(" %d", i);
    std::printf("\n");
  }
  if (!s.advice.empty()) std::printf("  %s\n", s.advice.c_str());
}

// 0: all solved, and proven where that is asked for, 1: some not, 2: some file or option is wrong.
int run(const ContactArguments& arguments) {
  int status = 0;
  if (arguments.csv) {
    std::printf(
        "file,contacts,law,tolerance,status,error,sweeps,factorisations,replaced,signorini,cone,"
        "alignment,dissipation,energy_change,fixed_point,natural_map%s\n",
        arguments.prove ? ",proof,radius,relative_radius,change,relative_change" : "");
  }
  for (const std::string& file : arguments.files) {
    try {
      contact::Problem problem;
      try {
        problem = read_problem(file);
      } catch (const std::runtime_error&) {
        const std::unique_ptr<ConeProblem> cones = as_cones(file);
        if (!cones) throw;
        const bool good = run_cones(arguments, file, *cones) && !arguments.prove;
        if (!good && status == 0) status = 1;
        continue;
      }
      const Options& o = arguments.options;
      const Solution s = Solver(o).solve(problem);
      const Residuals r = evaluate(problem, o.law, s.impulses);
      if (arguments.csv)
        std::printf("%s,%d,%s,%g,%s,%.3e,%d,%d,%zu,%.3e,%.3e,%.3e,%.3e,%.3e,%.3e,%.3e",
                    table_field(file).c_str(), problem.contacts(), name(o.law), o.tolerance,
                    name(s.status), s.error, s.counts.sweeps, s.counts.factorisations,
                    s.replaced.size(), r.signorini, r.cone, r.alignment, r.dissipation,
                    r.energy_change, r.fixed_point, r.natural_map);
      else
        print(file, problem, o.law, s, r);
      bool good = s.status == Status::solved;
      if (arguments.prove) good = print_proof(prove(problem, s.impulses), arguments.csv) && good;
      if (arguments.csv) std::printf("\n");
      if (!good && status == 0) status = 1;
    } catch (const std::exception& e) {
      std::fprintf(stderr, "tether contact: %s\n", on_terminal(e.what()).c_str());
      status = 2;
    }
  }
  return status;
}

}  // namespace

void add_contact_command(CLI::App& app, int* status) {
  auto arguments = std::make_shared<ContactArguments>();
  CLI::App* command =
      app.add_subcommand("contact", "Solves frictional contact problems (.dat, fclib .hdf5)");
  command->add_option("files", arguments->files, "Problem files")->required();
  add_choice(*command, "--law", "Friction law", laws_by_name(), arguments->options.law);
  command->add_option("--tolerance", arguments->options.tolerance, "The measure ends below it")
      ->capture_default_str();
  add_choice(*command, "--measure", "What is compared with the tolerance", kMeasures,
             arguments->options.measure);
  command->add_flag("--strict", arguments->options.strict, "Never replace the law");
  command->add_flag("--prove", arguments->prove,
                    "Prove that an exact solution is near, or exit with 1; needs --law coulomb");
  command->add_flag("--csv", arguments->csv, "One line a file");
  command->callback([arguments, status] {
    if (arguments->prove && arguments->options.law != Law::coulomb)
      throw CLI::ValidationError("--prove", "needs --law coulomb");
    *status = run(*arguments);
  });
}

}  // namespace tether::scene
