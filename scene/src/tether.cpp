// Tether: the program. SPDX-License-Identifier: BSD-3-Clause
#include <exception>
#include <iostream>

#include "contact_command.hpp"

int main(int argc, char** argv) {
  CLI::App app{"Keeps a computed motion on the constraints that it must obey", "tether"};
  app.require_subcommand(1);
  int status = 0;
  tether::scene::add_contact_command(app, &status);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e);
  } catch (const std::exception& e) {
    std::cerr << "tether: " << e.what() << "\n";
    return 2;
  }
  return status;
}
