// Tether: Siconos' solvers on a contact problem. SPDX-License-Identifier: BSD-3-Clause
#include "siconos.hpp"

#include <unistd.h>

#include <cstdlib>

#ifdef TETHER_HAVE_SICONOS
#include <sys/time.h>
#include <sys/wait.h>

#include <FrictionContactProblem.h>
#include <Friction_cst.h>
#include <NonSmoothDrivers.h>
#include <SolverOptions.h>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <fc3d_compute_error.h>
#include <map>
#include <tether/contact/files.hpp>
#endif

namespace tether::contact {

void use_one_thread(char** argv) {
  if (std::getenv("OPENBLAS_NUM_THREADS") != nullptr) return;
  setenv("OPENBLAS_NUM_THREADS", "1", 1);
  setenv("OMP_NUM_THREADS", "1", 1);
  execv("/proc/self/exe", argv);
}

bool siconos_is_tried_dense(const std::string& solver, int contacts) {
  if (contacts > 300) return false;
  return solver == "NSN_AC" || (contacts <= 60 && solver.rfind("NSGS", 0) == 0);
}

#ifndef TETHER_HAVE_SICONOS

bool has_siconos() { return false; }
std::vector<std::string> siconos_solvers() { return {}; }
SiconosRun run_siconos(const std::string&, const Problem&, bool, double, double) { return {}; }

#else

namespace {

struct Choice {
  int id;
  int local;  // of NSGS, 0: none
};
const std::map<std::string, Choice>& choices() {
  static const std::map<std::string, Choice> all = {
      {"NSGS_NSN_GP", {SICONOS_FRICTION_3D_NSGS, SICONOS_FRICTION_3D_ONECONTACT_NSN_GP}},
      {"NSGS_HYBRID", {SICONOS_FRICTION_3D_NSGS, SICONOS_FRICTION_3D_ONECONTACT_NSN_GP_HYBRID}},
      {"NSGS_QUARTIC", {SICONOS_FRICTION_3D_NSGS, SICONOS_FRICTION_3D_ONECONTACT_QUARTIC}},
      {"NSN_AC", {SICONOS_FRICTION_3D_NSN_AC, 0}},
      {"PROX", {SICONOS_FRICTION_3D_PROX, 0}},
      {"VI_EG", {SICONOS_FRICTION_3D_VI_EG, 0}},
      {"ADMM", {SICONOS_FRICTION_3D_ADMM, 0}},
      {"ACLMFP", {SICONOS_FRICTION_3D_ACLMFP, 0}}};
  return all;
}

double cpu_seconds() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

struct Report {
  int info, iterations;
  double milliseconds, error;
};

// In the child: solve, time, write the report and the impulses.
void child(int out, const std::string& name, const std::string& file, std::size_t size,
           int contacts, double tolerance, double time_limit) {
  const Choice choice = choices().at(name);
  FrictionContactProblem* p = frictionContact_new_from_filename(file.c_str());
  if (p == nullptr) _exit(2);
  std::vector<double> r(size), u(size);
  std::vector<double> times;
  Report report{};
  double sum = 0;
  do {
    std::fill(r.begin(), r.end(), 0.0);
    std::fill(u.begin(), u.end(), 0.0);
    SolverOptions* o = solver_options_create(choice.id);
    if (choice.local) solver_options_update_internal(o, 0, choice.local);
    o->dparam[SICONOS_DPARAM_TOL] = tolerance;
    if (choice.id == SICONOS_FRICTION_3D_NSGS || choice.id == SICONOS_FRICTION_3D_VI_EG ||
        choice.id == SICONOS_FRICTION_3D_ADMM) {
      o->iparam[SICONOS_IPARAM_MAX_ITER] = 1000000;
    }
    const double begin = cpu_seconds();
    report.info = fc3d_driver(p, r.data(), u.data(), o);
    const double t = cpu_seconds() - begin;
    report.iterations = o->iparam[SICONOS_IPARAM_ITER_DONE];
    sum += t;
    times.push_back(t);
    if (times.size() == 1) {
      double norm = 0;
      for (std::size_t i = 0; i < size; ++i) norm += p->q[i] * p->q[i];
      std::vector<double> rr = r, uu = u;
      fc3d_compute_error(p, rr.data(), uu.data(), tolerance, o, std::sqrt(norm), &report.error);
    }
    solver_options_delete(o);
    std::free(o);
  } while (times.size() < 201 && sum < 0.05 && sum < 0.2 * time_limit);
  (void)contacts;
  std::nth_element(times.begin(), times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2),
                   times.end());
  report.milliseconds = 1e3 * times[times.size() / 2];
  bool good = write(out, &report, sizeof report) == static_cast<ssize_t>(sizeof report);
  const char* data = reinterpret_cast<const char*>(r.data());
  for (std::size_t left = size * sizeof(double); good && left > 0;) {
    const ssize_t n = write(out, data, left);
    good = n > 0;
    if (good) {
      data += n;
      left -= static_cast<std::size_t>(n);
    }
  }
  _exit(good ? 0 : 3);
}

}  // namespace

bool has_siconos() { return true; }

std::vector<std::string> siconos_solvers() {
  std::vector<std::string> out;
  for (const auto& entry : choices()) out.push_back(entry.first);
  return out;
}

SiconosRun run_siconos(const std::string& name, const Problem& problem, bool dense,
                       double tolerance, double time_limit) {
  SiconosRun run;
  run.solver = name + (dense ? "(dense)" : "");
  const std::string file = "/tmp/tether_siconos_" + std::to_string(getpid()) + ".dat";
  write_dat(problem, file, dense ? DatStorage::dense : DatStorage::blocks);
  const std::size_t size = static_cast<std::size_t>(problem.dimension() * problem.contacts());
  int ends[2];
  if (pipe(ends) != 0) return run;
  std::fflush(nullptr);
  const pid_t pid = fork();
  if (pid == 0) {
    close(ends[0]);
    if (!std::freopen("/dev/null", "w", stdout) || !std::freopen("/dev/null", "w", stderr))
      _exit(4);
    itimerval limit = {};
    limit.it_value.tv_sec = static_cast<time_t>(time_limit);
    limit.it_value.tv_usec = static_cast<suseconds_t>(1e6 * (time_limit - std::floor(time_limit)));
    // Wall time: a timer of processor time would coarsen the clock of processor time to ticks.
    setitimer(ITIMER_REAL, &limit, nullptr);
    child(ends[1], name, file, size, problem.contacts(), tolerance, time_limit);
  }
  close(ends[1]);
  Report report{};
  std::vector<char> bytes(sizeof report + size * sizeof(double));
  std::size_t got = 0;
  for (ssize_t n;
       got < bytes.size() && (n = read(ends[0], bytes.data() + got, bytes.size() - got)) > 0;)
    got += static_cast<std::size_t>(n);
  close(ends[0]);
  int status = 0;
  waitpid(pid, &status, 0);
  std::remove(file.c_str());
  if (got != bytes.size()) return run;
  std::memcpy(&report, bytes.data(), sizeof report);
  run.finished = true;
  run.info = report.info;
  run.iterations = report.iterations;
  run.milliseconds = report.milliseconds;
  run.error = report.error;
  run.impulses.resize(static_cast<Eigen::Index>(size));
  std::memcpy(run.impulses.data(), bytes.data() + sizeof report, size * sizeof(double));
  return run;
}

#endif

}  // namespace tether::contact
