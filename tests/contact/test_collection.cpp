// Tether: contact problems of other projects. SPDX-License-Identifier: BSD-3-Clause
#include <cstdlib>
#include <filesystem>
#include <set>
#include <tether/contact.hpp>
#include <tether/contact/files.hpp>

#include "assemblies.hpp"
#include "support/catch.hpp"

using namespace tether::contact;

namespace {

std::set<std::string> collection() {
  const char* folder = std::getenv("TETHER_CONTACT_DATA");
  const std::filesystem::path path = folder ? folder : TETHER_CONTACT_DATA;
  std::set<std::string> out;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(path, none)) {
    const std::string kind = entry.path().extension();
    if (kind == ".dat" || (kind == ".hdf5" && has_fclib())) out.insert(entry.path());
  }
  if (out.empty()) WARN("no contact problems in " << path << ": set TETHER_CONTACT_DATA");
  return out;
}

// RockPile: 463 contacts, rank 744 of 1389, contacts with e up to 1.54. At 1e-9 it takes seconds.
bool hard(const std::string& path) { return path.find("RockPile") != std::string::npos; }

}  // namespace

TEST_CASE("the collection under coulomb") {
  for (const std::string& path : collection()) {
    const Problem p = read_problem(path);
    for (Measure measure :
         {Measure::natural_map, Measure::natural_map_data, Measure::fixed_point}) {
      Options o;
      o.law = Law::coulomb;
      o.measure = measure;
      o.tolerance = hard(path) ? 1e-6 : 1e-9;
      const Solution s = Solver(o).solve(p);
      const Residuals r = evaluate(p, o.law, s.impulses);
      INFO(path << ", " << name(measure) << ": " << name(s.status) << " " << s.error);
      CHECK(s.status == Status::solved);
      CHECK((measure == Measure::natural_map        ? r.natural_map
             : measure == Measure::natural_map_data ? r.natural_map_data
                                                    : r.fixed_point) <= o.tolerance);
      CHECK(r.cone <= 1e-12 * (1 + s.impulses.norm()));
    }
  }
}

TEST_CASE("the collection under maximum dissipation") {
  for (const std::string& path : collection()) {
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

TEST_CASE("the hardest problem of the collection") {
  for (const std::string& path : collection()) {
    if (!hard(path)) continue;
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
}

TEST_CASE("the collection in other orders and tangents") {
  random::Generator g(7);
  for (const std::string& path : collection()) {
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
