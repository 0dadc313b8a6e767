// Tether: many packed contacts: time and memory of a sweep. SPDX-License-Identifier: BSD-3-Clause
//
//   contact_scale [--most N] [--sweeps S]
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

}  // namespace

int main(int argc, char** argv) {
  double most = 1e6;
  int sweeps = 30;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::string(argv[i]) == "--most") most = std::atof(argv[i + 1]);
    if (std::string(argv[i]) == "--sweeps") sweeps = std::atoi(argv[i + 1]);
  }
  std::printf("%-9s %-20s %8s %3s %8s %14s %7s %10s %8s %s\n", "bodies", "law", "contacts", "thr", "colours", "ns/contact/sweep", "CPU ns", "B/contact", "speed-up", "same bits");
  for (int side : {7, 15, 32, 69}) {
    for (bool spheres : {false, true}) {
      if (3.0 * side * side * side > 1.3 * most) continue;
      const random::Packing p = random::packing(side, spheres);
      for (Law law : {Law::maximum_dissipation, Law::coulomb}) {
        if (spheres && law == Law::coulomb) continue;
        double alone = 0;
        unsigned long bits = 0;
        for (int threads : {1, 2}) {
          // Time of (many - few) sweeps: set-up and tests cancel.
          double wall[2] = {1e9, 1e9}, work[2] = {1e9, 1e9};
          BodySolution last;
          for (int round = 0; round < (side < 10 ? 40 : side < 40 ? 6 : 2); ++round) {
            for (int k = 0; k < 2; ++k) {
              BodyOptions o;
              o.law = law;
              o.tolerance = 1e-300;
              o.threads = threads;
              o.max_sweeps = k == 0 ? sweeps : 3 * sweeps;
              BodySolver solver(o);
              const double begin = seconds(), used = cpu();
              last = solver.solve(p.bodies, p.contacts);
              wall[k] = std::min(wall[k], seconds() - begin);
              work[k] = std::min(work[k], cpu() - used);
            }
          }
          // Test passes come at sweeps 1, 5, 10, 16, ...: counted as sweeps.
          const auto passes = [](int n) {
            int count = n, next = 1;
            for (int k = 1; k <= n; ++k) {
              if (k >= next || k == n) {
                ++count;
                next = k + 4 + k / 4;
              }
            }
            return count;
          };
          const double scale = 1e9 / (static_cast<double>(p.contacts.size()) * (passes(3 * sweeps) - passes(sweeps)));
          const double ns = scale * (wall[1] - wall[0]), cpu_ns = scale * (work[1] - work[0]);
          if (threads == 1) {
            alone = ns;
            bits = hash(last);
          }
          std::printf("%-9s %-20s %8zu %3d %8d %14.1f %7.1f %10.0f %8.2f %s\n", spheres ? "spheres" : "general", name(law), p.contacts.size(), threads, last.colours, ns, cpu_ns,
                      static_cast<double>(last.bytes) / static_cast<double>(p.contacts.size()), alone / ns, hash(last) == bits ? "yes" : "NO");
          std::fflush(stdout);
        }
      }
    }
  }
  return 0;
}
