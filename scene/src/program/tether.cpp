// Tether: the program. SPDX-License-Identifier: BSD-3-Clause
#include <exception>
#include <iostream>
#include <new>
#include <sstream>

#include "commands.hpp"

namespace {

/// A message of several problems starts each of them on its line.
void complain(const std::exception& e) {
  std::cerr << "tether: " << tether::scene::on_terminal(e.what()) << "\n";
}

}  // namespace

int main(int argc, char** argv) {
  using namespace tether::scene;
  guard_standard_streams();
  CLI::App app{"Keeps a computed motion on the constraints that it must obey", "tether"};
  app.require_subcommand(1);
  app.footer(
      "Exit codes: 0 good; 1 an expectation is not met or a contact problem not solved; 2 a file, "
      "a "
      "scene or an option is wrong; 3 a run could not go on; 128 and its number: a signal.");
  int status = 0;
  tether::scene::add_run_command(app, &status);
  tether::scene::add_plan_command(app, &status);
  tether::scene::add_check_command(app, &status);
  tether::scene::add_cost_command(app, &status);
  tether::scene::add_sweep_command(app, &status);
  tether::scene::add_verify_command(app, &status);
  tether::scene::add_import_command(app, &status);
  tether::scene::add_new_command(app, &status);
  tether::scene::add_contact_command(app, &status);
  const std::string version = "tether " TETHER_VERSION;
  app.set_version_flag("--version", version);
  for (CLI::App* command : app.get_subcommands({})) command->set_version_flag("--version", version);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    std::ostringstream out, error;
    const int code = app.exit(e, out, error);
    std::cout << out.str() << std::flush;
    std::cerr << on_terminal(error.str());
    return flushed(code == 0 ? kGood : kWrong);
  } catch (const Interrupted& e) {
    complain(e);
    return kSignal + caught_signal();
  } catch (const std::bad_alloc&) {
    std::cerr
        << "tether: the memory has ended: what is asked for is too large for this machine, or "
           "for its limit (ulimit -v)\n";
    return kFailed;
  } catch (const std::exception& e) {
    if (const int lost = flushed(kWrong); lost != kWrong) return lost;
    complain(e);
    return kWrong;
  }
  return flushed(status);
}
