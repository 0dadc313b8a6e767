// Tether: many packed contacts: time and memory of a sweep. SPDX-License-Identifier: BSD-3-Clause
//
//   contact_scale [--least N] [--most N] [--sweeps S] [--rounds R] [--threads T] [--shuffle 1]
//                 [--spheres 1]
//   contact_scale --residual TOLERANCE [--least N] [--most N] [--mu MU] [--shuffle 1]
//
// ns: per contact and sweep, the least of R rounds, from the difference of S and 3 S sweeps, so
// that set-up and results cancel; "setup" is what remains for S sweeps. One and T threads
// alternate. Where others use the machine, "chrt -f 10 contact_scale ..." (as root) gives it the
// cores.
// --residual: what is reached with at most 100, 300, 1000, 3000 sweeps instead.
#include <malloc.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string>

#include "packing.hpp"

using namespace tether::contact;

namespace {

double seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double cpu() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double heap() {
  const struct mallinfo2 m = mallinfo2();
  return static_cast<double>(m.uordblks + m.hblkhd);
}

// FNV over the bits of the velocities.
unsigned long hash(const BodySolution& s) {
  unsigned long h = 1469598103934665603ul;
  for (const auto* list : {&s.velocities, &s.angular_velocities}) {
    for (const Eigen::Vector3d& v : *list) {
      unsigned char bytes[24];
      std::memcpy(bytes, v.data(), 24);
      for (unsigned char b : bytes) h = (h ^ b) * 1099511628211ul;
    }
  }
  return h;
}

struct Timing {
  double wall[2] = {1e9, 1e9}, work[2] = {1e9, 1e9};
  unsigned long bits = 0;
};

void residuals(random::Packing p, bool spheres, double tolerance, double mu) {
  for (PointContact& c : p.contacts) c.mu = mu;
  std::printf("%-8s %8zu %5g ", spheres ? "spheres" : "general", p.contacts.size(), mu);
  for (int most : {100, 300, 1000, 3000}) {
    BodyOptions o;
    o.tolerance = tolerance;
    o.max_assembled = 0;
    o.max_sweeps = most;
    const BodySolution s = BodySolver(o).solve(p.bodies, p.contacts);
    std::printf(" %8.1e (%4d)", s.error, s.sweeps);
  }
  std::printf("\n");
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  double least = 0, most = 1e6, tolerance = 0, mu = 0.4;
  int sweeps = 20, rounds = 0, many = 2;
  bool shuffle = false, only_spheres = false;
  CLI::App app("Sweeps over packings between bodies: time, memory and bits by size and threads");
  app.add_option("--least", least, "Contacts of the smallest packing")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--most", most, "Contacts of the largest packing")->check(CLI::NonNegativeNumber);
  app.add_option("--residual", tolerance, "Residuals over sweeps instead, down to this one")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--mu", mu, "Friction coefficient with --residual")->check(CLI::NonNegativeNumber);
  app.add_option("--sweeps", sweeps, "Sweeps of a run")->check(CLI::Range(1, 1000000));
  app.add_option("--rounds", rounds, "Runs of which the fastest counts; 0: by size")
      ->check(CLI::Range(0, 1000000));
  app.add_option("--threads", many, "Threads of the second run")->check(CLI::Range(1, 256));
  app.add_option("--shuffle", shuffle, "1: bodies in random order");
  app.add_option("--spheres", only_spheres, "1: no bodies of other shapes");
  CLI11_PARSE(app, argc, argv);
  if (tolerance > 0) {
    std::printf("bodies   contacts    mu  residual (sweeps) with at most 100, 300, 1000, 3000\n");
  } else {
    std::printf("%-8s %-19s %8s %3s %4s %6s %7s %6s %6s %8s %s\n", "bodies", "law", "contacts",
                "thr", "col", "ns", "CPU ns", "setup", "B/con", "speed-up", "same bits");
  }
  for (int side : {7, 15, 32, 69}) {
    for (bool spheres : {false, true}) {
      const double expected = 3.0 * side * side * side;
      if (!spheres && only_spheres) continue;
      if (expected > 1.3 * most || expected < 0.7 * least) continue;
      const random::Packing p = random::packing(side, spheres, 1, shuffle);
      if (tolerance > 0) {
        residuals(p, spheres, tolerance, mu);
        continue;
      }
      const double n = static_cast<double>(p.contacts.size());
      for (Law law : {Law::maximum_dissipation, Law::coulomb}) {
        if (spheres && law == Law::coulomb) continue;
        Timing timing[2];
        BodySolution last;
        BodyOptions o;
        o.law = law;
        o.tolerance = 1e-300;
        o.max_assembled = 0;
        const double before = heap();
        BodySolver solver[2] = {BodySolver(o), BodySolver(o)};
        const int repeat = rounds > 0  ? rounds
                           : side < 10 ? 40
                           : side < 20 ? 12
                           : side < 40 ? 5
                                       : 3;
        for (int round = 0; round < repeat; ++round) {
          for (int t = 0; t < 2; ++t) {
            for (int k = 0; k < 2; ++k) {
              o.threads = t == 0 ? 1 : many;
              o.max_sweeps = k == 0 ? sweeps : 3 * sweeps;
              solver[t].set_options(o);
              const double begin = seconds(), used = cpu();
              solver[t].solve(p.bodies, p.contacts, last);
              timing[t].wall[k] = std::min(timing[t].wall[k], seconds() - begin);
              timing[t].work[k] = std::min(timing[t].work[k], cpu() - used);
            }
            timing[t].bits = hash(last);
          }
        }
        const double scale = 1e9 / (n * 2 * sweeps), memory = (heap() - before) / 2;
        for (int t = 0; t < 2; ++t) {
          const double* wall = timing[t].wall;
          const double ns = scale * (wall[1] - wall[0]);
          std::printf("%-8s %-19s %8.0f %3d %4d %6.1f %7.1f %6.0f %6.0f %8.2f %s\n",
                      spheres ? "spheres" : "general", name(law), n, t == 0 ? 1 : many,
                      last.colours, ns, scale * (timing[t].work[1] - timing[t].work[0]),
                      1e9 * wall[0] / n - (sweeps + 1) * ns, memory / n,
                      (timing[0].wall[1] - timing[0].wall[0]) / (wall[1] - wall[0]),
                      timing[t].bits == timing[0].bits ? "yes" : "NO");
        }
        std::fflush(stdout);
      }
    }
  }
  return 0;
}
