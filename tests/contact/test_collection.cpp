// Tether: contact problems in files: those that ship with the tests, and those of other projects.
// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <set>
#include <tether/contact.hpp>
#include <tether/contact/files.hpp>

#include "assemblies.hpp"
#include "contact_differences.hpp"
#include "support/catch.hpp"
#include "support/skip.hpp"

using namespace tether::contact;

namespace {

using Paths = std::set<std::string>;

Paths problems_in(const std::filesystem::path& folder) {
  Paths out;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(folder, none)) {
    const std::string kind = entry.path().extension();
    if (kind == ".dat" || (kind == ".hdf5" && has_fclib())) out.insert(entry.path());
  }
  return out;
}

// The project's own, written by collection/make.cpp.
Paths own() {
  const Paths all = problems_in(TETHER_OWN_CONTACT_DATA);
  REQUIRE(all.size() >= 6);
  return all;
}

// Empty in a clean clone: a test on these alone is then skipped.
Paths others() {
  const char* folder = std::getenv("TETHER_CONTACT_DATA");
  return problems_in(folder ? folder : TETHER_CONTACT_DATA);
}
#define NEEDS(paths) \
  if (paths.empty()) TETHER_SKIP("no contact problems of other projects: set TETHER_CONTACT_DATA")

// RockPile: 463 contacts, rank 744 of 1389, contacts with e up to 1.54. At 1e-9 it takes seconds.
bool hard(const std::string& path) { return path.find("RockPile") != std::string::npos; }

void solve_under_coulomb(const Paths& paths) {
  for (const std::string& path : paths) {
    const Problem p = read_problem(path);
    for (Measure measure : {Measure::natural_map, Measure::fixed_point}) {
      Options o;
      o.law = Law::coulomb;
      o.measure = measure;
      o.tolerance = hard(path) ? 1e-6 : 1e-9;
      const Solution s = Solver(o).solve(p);
      const Residuals r = evaluate(p, o.law, s.impulses);
      INFO(path << ", " << name(measure) << ": " << name(s.status) << " " << s.error);
      CHECK(s.status == Status::solved);
      CHECK((measure == Measure::natural_map ? r.natural_map : r.fixed_point) <= o.tolerance);
      CHECK(r.cone <= 1e-12 * (1 + s.impulses.norm()));
    }
  }
}

void solve_under_maximum_dissipation(const Paths& paths) {
  for (const std::string& path : paths) {
    const Problem p = read_problem(path);
    Options o;
    o.tolerance = hard(path) ? 1e-6 : 1e-9;
    const Solution s = Solver(o).solve(p);
    INFO(path << ": " << name(s.status) << " " << s.error << ", replaced " << s.replaced.size());
    CHECK(s.status == Status::solved);
    if (s.replaced.empty())
      CHECK(evaluate(p, o.law, s.impulses).fixed_point <= 1.001 * o.tolerance);
    if (!hard(path)) CHECK(s.replaced.empty());
  }
}

void solve_in_other_orders(const Paths& paths) {
  random::Generator g(7);
  for (const std::string& path : paths) {
    const Problem p = read_problem(path);
    for (int k = 0; k < 3; ++k) {
      const Problem q = random::shuffled(p, g);
      for (Law law : {Law::coulomb, Law::maximum_dissipation}) {
        Options o;
        o.law = law;
        o.tolerance = hard(path) ? 1e-5 : 1e-9;
        const Solution s = Solver(o).solve(q);
        INFO(path << ", " << k << ", " << name(law) << ": " << name(s.status) << " " << s.error);
        CHECK(s.status == Status::solved);
      }
    }
  }
}

// The share of the problems for which an exact solution is proven, of themselves or of one nearby.
double proven(const Paths& paths, double tolerance) {
  int count = 0;
  for (const std::string& path : paths) {
    const Problem p = read_problem(path);
    Options o;
    o.law = Law::coulomb;
    o.tolerance = tolerance;
    const Proof proof = prove(p, Solver(o).solve(p).impulses);
    UNSCOPED_INFO(path << ": " << name(proof.status) << ", radius " << proof.relative_radius
                       << ", change " << proof.relative_change << ", " << proof.reason);
    if (proof.status == ProofStatus::not_proven) continue;
    ++count;
    CHECK(std::isfinite(proof.radius));
    CHECK(proof.relative_change <= (proof.status == ProofStatus::proven ? 0 : 1e-9));
  }
  return static_cast<double>(count) / static_cast<double>(paths.size());
}

// How many problems had a derivative to compare, and how many of these one of impulses.
std::array<int, 2> compare_derivatives(const Paths& paths) {
  std::array<int, 2> out = {0, 0};
  for (const std::string& path : paths) {
    if (hard(path)) continue;  // A of 1389 rows: differences cost too much
    const Problem p = read_problem(path);
    for (Law law : {Law::coulomb, Law::maximum_dissipation}) {
      const differences::Comparison found = differences::compare(p, law, 7);
      INFO(path << ", " << name(law) << ": " << found.words);
      CHECK(found.transposed < 1e-12);
      if (!found.regular) continue;
      ++out[0];
      out[1] += found.unique;
      CHECK(found.residual < 1e-8);
      CHECK(found.error < 1e-6);
    }
  }
  return out;
}

}  // namespace

TEST_CASE("own collection: every problem is solved under coulomb") { solve_under_coulomb(own()); }

TEST_CASE("own collection: every problem is solved under maximum dissipation") {
  solve_under_maximum_dissipation(own());
}

TEST_CASE("own collection: derivatives against differences, wherever strictly regular") {
  const auto [all, unique] = compare_derivatives(own());
  CHECK(all >= 13);  // under one law a contact of stack.dat is at a kink
  CHECK(unique >= 10);
}

TEST_CASE("own collection: other orders and tangents") { solve_in_other_orders(own()); }

TEST_CASE("own collection: exact solutions are proven near every solution") {
  for (double tolerance : {1e-6, 1e-9}) CHECK(proven(own(), tolerance) == 1);
}

TEST_CASE("own collection: both formats hold what is written again") {
  for (const std::string& path : own()) {
    const Problem p = read_problem(path);
    const std::string again = "test_collection_again.dat";
    write_dat(p, again);
    const Problem q = read_problem(again);
    std::filesystem::remove(again);
    INFO(path);
    CHECK(p.contacts() >= 4);
    CHECK(q.dense_matrix() == p.dense_matrix());
    CHECK(q.b() == p.b());
    for (int i = 0; i < p.contacts(); ++i) CHECK(q.mu(i) == p.mu(i));
  }
}

TEST_CASE("the collection under coulomb") {
  const Paths all = others();
  NEEDS(all);
  solve_under_coulomb(all);
}

TEST_CASE("the collection: exact solutions are proven near at least nine solutions of ten") {
  const Paths all = others();
  NEEDS(all);
  for (double tolerance : {1e-6, 1e-9}) CHECK(proven(all, tolerance) >= 0.9);
}

TEST_CASE("the collection: derivatives against differences, wherever strictly regular") {
  const Paths all = others();
  NEEDS(all);
  const auto [compared, unique] = compare_derivatives(all);
  std::cout << "derivatives compared: " << compared << ", of impulses: " << unique << "\n";
  CHECK(compared >= 16);
  CHECK(unique >= 12);
}

TEST_CASE("the collection under maximum dissipation") {
  const Paths all = others();
  NEEDS(all);
  solve_under_maximum_dissipation(all);
}

TEST_CASE("the hardest problem of the collection") {
  const Paths all = others();
  int found = 0;
  for (const std::string& path : all) {
    if (!hard(path)) continue;
    ++found;
    const Problem p = read_problem(path);
    for (Law law : {Law::coulomb, Law::maximum_dissipation}) {
      Options o;
      o.law = law;
      o.max_work = 5e9;  // 5 s
      const Solution s = Solver(o).solve(p);
      INFO(name(law) << ": " << name(s.status) << " " << s.error << ", work " << s.counts.work);
      CHECK(s.error <= 5e-8);
      CHECK(s.replaced.size() <= (law == Law::coulomb ? 0u : 11u));  // e > 0.98
      if (law == Law::coulomb) CHECK(evaluate(p, law, s.impulses).fixed_point <= 1.001 * s.error);
    }
  }
  if (found == 0) TETHER_SKIP("RockPile is not in TETHER_CONTACT_DATA");
}

TEST_CASE("the collection in other orders and tangents") {
  const Paths all = others();
  NEEDS(all);
  solve_in_other_orders(all);
}
