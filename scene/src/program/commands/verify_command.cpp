// Tether: `tether verify`: does a certificate hold? SPDX-License-Identifier: BSD-3-Clause
#include <fmt/core.h>

#include "certificate/judge.hpp"
#include "program/commands.hpp"

namespace tether::scene {

namespace {

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
