// Tether: what one contact costs, and whether it is right. SPDX-License-Identifier: BSD-3-Clause
//
//   one_contact [--check N] [--points P]
//
// Times: nanoseconds per solve over 4096 contacts, best of 60. --check N: N random problems a class
// against a dense scan of P points with local refinement.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <tether/contact/one_contact.hpp>

#include "random_contacts.hpp"

using namespace tether::contact;

namespace {

double seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

constexpr int kContacts = 4096;

struct Sample {
  std::vector<LocalBlock> blocks;
  std::vector<Eigen::Vector3d> b;
};

// Contacts of a class in one regime; mixed: as they come, b_n > 0.
Sample draw(const std::string& kind, Law law, const char* regime) {
  random::Generator g(31);
  Sample out;
  for (int tries = 0; static_cast<int>(out.blocks.size()) < kContacts && tries < 1000000; ++tries) {
    random::Contact p = g(kind);
    p.b[0] = std::abs(p.b[0]);
    const LocalBlock block(p.A, p.mu);
    LocalState s;
    solve_local(law, block, p.b, s);
    if (std::string(regime) != "any" && std::string(regime) != name(s.regime)) continue;
    out.blocks.push_back(block);
    out.b.push_back(p.b);
  }
  return out;
}

struct Cost {
  double cold = 1e9, warm = 1e9, repeat = 1e9, evaluations = 0;
  int most = 0;
};

Cost measure(const Sample& sample, Law law) {
  Cost cost;
  const std::size_t n = sample.blocks.size();
  std::vector<LocalState> state(n);
  random::Generator g(5);
  std::vector<Eigen::Vector3d> near(sample.b);
  for (auto& b : near) b += 1e-3 * b.norm() * g.vector();
  for (int round = 0; round < 60; ++round) {
    std::fill(state.begin(), state.end(), LocalState());
    const double t0 = seconds();
    for (std::size_t i = 0; i < n; ++i) solve_local(law, sample.blocks[i], sample.b[i], state[i]);
    const double t1 = seconds();
    if (round == 0) {
      for (const LocalState& s : state) {
        cost.evaluations += s.evaluations / static_cast<double>(n);
        cost.most = std::max(cost.most, s.evaluations);
      }
    }
    const double t2 = seconds();
    for (std::size_t i = 0; i < n; ++i) solve_local(law, sample.blocks[i], near[i], state[i]);
    const double t3 = seconds();
    for (std::size_t i = 0; i < n; ++i) solve_local(law, sample.blocks[i], near[i], state[i]);
    const double t4 = seconds();
    const double scale = 1e9 / static_cast<double>(n);
    cost.cold = std::min(cost.cold, scale * (t1 - t0));
    cost.warm = std::min(cost.warm, scale * (t3 - t2));
    cost.repeat = std::min(cost.repeat, scale * (t4 - t3));
  }
  return cost;
}

}  // namespace

int main(int argc, char** argv) {
  long check = 0;
  int points = 180;
  CLI::App app("One contact: nanoseconds and evaluations of each law by class and regime");
  app.add_option("--check", check, "Problems of each class that are compared with the reference")
      ->check(CLI::Range(0L, 1000000000L));
  app.add_option("--points", points, "Angles of the reference's search")
      ->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  std::printf("%-20s %-15s %-10s %6s %6s %6s %6s %5s\n", "law", "class", "regime", "cold", "warm",
              "repeat", "evals", "most");
  for (Law law : {Law::maximum_dissipation, Law::coulomb}) {
    std::vector<double> cold, warm;
    for (const std::string& kind : random::classes()) {
      for (const char* regime : {"sticking", "sliding", "any"}) {
        const Sample sample = draw(kind, law, regime);
        if (sample.blocks.size() < kContacts) continue;
        const bool sliding = std::string(regime) == "sliding";
        const Cost c = measure(sample, law);
        std::printf("%-20s %-15s %-10s %6.0f %6.0f %6.0f %6.2f %5d\n", name(law), kind.c_str(),
                    regime, c.cold, c.warm, c.repeat, c.evaluations, c.most);
        if (sliding && kind != "mu_zero") {
          cold.push_back(c.cold);
          warm.push_back(c.warm);
        }
      }
    }
    std::sort(cold.begin(), cold.end());
    std::sort(warm.begin(), warm.end());
    std::printf("%s, sliding, median over classes: cold %.0f ns, warm %.0f ns\n", name(law),
                cold[cold.size() / 2], warm[warm.size() / 2]);
  }
  if (check > 0) {
    std::printf("%-15s %10s %9s %9s %6s\n", "class", "problems", "failures", "evals", "most");
    for (const std::string& kind : random::classes()) {
      random::Generator g(99);
      long failures = 0;
      double evaluations = 0;
      int most = 0;
      const char* first = nullptr;
      for (long k = 0; k < check; ++k) {
        const random::Contact p = g(kind);
        const OneContact s = solve_one(Law::maximum_dissipation, p.A, p.b, p.mu);
        evaluations += s.evaluations;
        most = std::max(most, s.evaluations);
        const char* why = random::failure(p, s.impulse, points);
        if (why) {
          ++failures;
          if (!first) first = why;
        }
      }
      std::printf("%-15s %10ld %9ld %9.2f %6d %s\n", kind.c_str(), check, failures,
                  evaluations / static_cast<double>(check), most, first ? first : "");
      std::fflush(stdout);
    }
  }
  return 0;
}
