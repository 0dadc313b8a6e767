// Tether: all contact problems of folders and generated ones, solved.
// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <set>
#include <tether/contact.hpp>
#include <tether/contact/files.hpp>
#include <utility>

#include "assemblies.hpp"
#include "packing.hpp"

namespace {

using namespace tether::contact;
using Eigen::Vector3d;
using random::Generator;

constexpr double kPi = 3.14159265358979;

using Assembly = random::RigidAssembly;

RigidBody body(Generator& g, double mass, const Vector3d& half, double speed) {
  RigidBody b = random::box(mass, half);
  b.velocity = speed * g.vector() - 0.05 * Vector3d::UnitZ();
  b.angular_velocity = speed * g.vector();
  return b;
}

double size(Generator& g, double least, double most) {
  return std::exp(g.uniform(std::log(least), std::log(most)));
}

// Boxes on each other, of random masses.
Assembly tower(Generator& g) {
  Assembly out;
  const int n = static_cast<int>(size(g, 3, 60));
  const double mu = g.uniform(0.2, 1), spread = g.uniform(0, 3), speed = size(g, 1e-4, 0.3);
  for (int k = 0; k < n; ++k) {
    out.bodies.push_back(body(g, std::pow(10, g.uniform(-spread, spread)), {0.5, 0.5, 0.5}, speed));
    for (double x : {-0.5, 0.5})
      for (double y : {-0.5, 0.5}) out.touch(k, k - 1, {x, y, -0.5}, {x, y, 0.5}, {0, 0, 1}, mu);
  }
  return out;
}

// Unit cubes on each other with masses that alternate, grow or fall, at rest, leaning or pushed,
// the contacts in any order.
Assembly stack(Generator& g) {
  Assembly out;
  const int n = static_cast<int>(size(g, 20, 201)), masses = static_cast<int>(g.uniform(0, 4));
  const double ratio = size(g, 1e2, 1e6), mu = g.uniform(0.2, 0.6);
  const double lean = g.uniform(0, 1) < 0.3 ? 0 : size(g, 1e-3, 0.3), push = lean * g.uniform(0, 1);
  for (int k = 0; k < n; ++k) {
    const double up = std::pow(ratio, k / (n - 1.0));
    const double mass = masses < 2 ? ((k + masses) % 2 ? ratio : 1) : masses == 2 ? up : ratio / up;
    RigidBody b = random::box(mass, Vector3d::Constant(0.5));
    b.velocity = Vector3d(push + (lean - push) * (k + 1) / n, 0, -9.81e-3);
    out.bodies.push_back(b);
    for (double x : {-0.5, 0.5})
      for (double y : {-0.5, 0.5}) out.touch(k, k - 1, {x, y, -0.5}, {x, y, 0.5}, {0, 0, 1}, mu);
  }
  if (g.uniform(0, 1) < 0.5)
    for (std::size_t k = out.contacts.size(); k-- > 1;)
      std::swap(out.contacts[k],
                out.contacts[static_cast<std::size_t>(g.uniform(0, static_cast<double>(k + 1)))]);
  return out;
}

// Bricks in bond, which meet their neighbours at many points.
Assembly wall(Generator& g) {
  Assembly out;
  const int rows = 3 + static_cast<int>(g.uniform(0, 6));
  const double length = 0.4, side = 0.2, mu = g.uniform(0.2, 0.9), push = size(g, 1e-3, 1);
  std::vector<Vector3d> at;
  for (int i = 0; i < rows * rows; ++i) {
    const int row = i / rows, column = i % rows;
    out.bodies.push_back(body(g, 32, {0.5 * length, 0.5 * side, 0.5 * side}, push));
    const Vector3d p(length * (column + 0.5 * (row % 2)), 0, side * (row + 0.5));
    at.push_back(p);
    const auto meet = [&](int j, const Vector3d& point, const Vector3d& normal) {
      const Vector3d other = j < 0 ? Vector3d::Zero() : at[static_cast<std::size_t>(j)];
      out.touch(i, j, point - p, point - other, normal, mu);
    };
    const double left = p.x() - 0.5 * length, foot = p.z() - 0.5 * side;
    for (double y : {-0.5 * side, 0.5 * side}) {
      if (column > 0)
        for (double z : {foot, foot + side}) meet(i - 1, {left, y, z}, Vector3d::UnitX());
      if (row == 0)
        for (double x : {left, left + length}) meet(-1, {x, y, foot}, Vector3d::UnitZ());
      for (int j = (row - 1) * rows; row > 0 && j < row * rows; ++j) {
        const double below = at[static_cast<std::size_t>(j)].x() - 0.5 * length;
        const double from = std::max(left, below), to = std::min(left, below) + length;
        if (to - from > 1e-9)
          for (double x : {from, to}) meet(j, {x, y, foot}, Vector3d::UnitZ());
      }
    }
  }
  return out;
}

// Discs on each other that touch at many points of their rims.
Assembly discs(Generator& g) {
  Assembly out;
  const int n = 2 + static_cast<int>(g.uniform(0, 6)), points = static_cast<int>(size(g, 4, 40));
  const double mu = g.uniform(0.1, 0.9);
  for (int k = 0; k < n; ++k) {
    out.bodies.push_back(body(g, size(g, 0.5, 2), {0.8, 0.8, 0.2}, 0.4));
    for (int p = 0; p < points; ++p) {
      const double a = 2 * kPi * (p + 0.3 * k) / points;
      const Vector3d rim(std::cos(a), std::sin(a), 0), up(0, 0, 0.2);
      out.touch(k, k - 1, rim - up, rim + up, {0, 0, 1}, mu);
    }
  }
  return out;
}

// Blocks of a half ring that stands on its ends.
Assembly arch(Generator& g) {
  Assembly out;
  const int n = 5 + static_cast<int>(g.uniform(0, 25));
  const double mu = g.uniform(0.3, 0.9), thick = g.uniform(0.1, 0.3), speed = size(g, 1e-4, 0.1);
  const auto on_ring = [](double angle, double radius) {
    return Vector3d(radius * std::cos(angle), 0, radius * std::sin(angle));
  };
  const auto centre = [&](int k) { return on_ring(kPi * (k + 0.5) / n, 1); };
  for (int k = 0; k < n; ++k) {
    RigidBody b = body(g, 1, {0.5 * thick, 0.2, 0.5 * kPi / n}, speed);
    const Eigen::AngleAxisd turn(-kPi * (k + 0.5) / n, Vector3d::UnitY());
    b.inverse_inertia = turn * b.inverse_inertia * turn.inverse();
    out.bodies.push_back(b);
  }
  for (int joint = 0; joint <= n; ++joint) {
    const double angle = kPi * joint / n;
    const int first = joint < n ? joint : n - 1, second = joint < n ? joint - 1 : -1;
    const Vector3d along(-std::sin(angle), 0, std::cos(angle));
    for (double radius : {1 - 0.5 * thick, 1 + 0.5 * thick})
      for (double y : {-0.2, 0.2}) {
        const Vector3d p = on_ring(angle, radius) + y * Vector3d::UnitY();
        out.touch(first, second, p - centre(first), second < 0 ? p : Vector3d(p - centre(second)),
                  joint < n ? along : Vector3d(-along), mu);
      }
  }
  return out;
}

// A plate on spheres.
Assembly plate(Generator& g) {
  Assembly out;
  const int n = static_cast<int>(size(g, 10, 150));
  const double mass = size(g, 1, 1e6), width = std::sqrt(n), mu = g.uniform(0.1, 0.8);
  out.bodies.push_back(body(g, mass, {width, width, 0.2}, 0.02));
  for (int k = 1; k <= n; ++k) {
    out.bodies.push_back(random::sphere(1, 0.5));
    out.touch(k, -1, {0, 0, -0.5}, {0, 0, 0}, {0, 0, 1}, mu);
    out.touch(0, k, {g.uniform(-width, width), g.uniform(-width, width), -0.2}, {0, 0, 0.5},
              {0, 0, 1}, mu);
  }
  return out;
}

// A heavy block on a heap of light boxes in two layers, each of which carries a part of it.
Assembly load(Generator& g) {
  Assembly out;
  const int n = 2 + static_cast<int>(g.uniform(0, 4));
  const double mu = g.uniform(0.2, 0.9), width = n + 0.5, heavy = size(g, 1e3, 1e7);
  out.bodies.push_back(body(g, heavy, {0.5 * width, 0.5 * width, 0.5}, size(g, 1e-4, 0.1)));
  const auto corners = [&](int first, int second, const Vector3d& r1, const Vector3d& r2) {
    for (double x : {-0.4, 0.4})
      for (double y : {-0.4, 0.4})
        out.touch(first, second, r1 + Vector3d(x, y, 0), r2 + Vector3d(x, y, 0), {0, 0, 1}, mu);
  };
  for (int k = 0; k < n * n; ++k) {
    const Vector3d at(k % n - 0.5 * (n - 1), k / n - 0.5 * (n - 1), 0), up(0, 0, 0.5);
    for (int layer = 0; layer < 2; ++layer)
      out.bodies.push_back(body(g, size(g, 0.5, 2), {0.5, 0.5, 0.5}, 0.01));
    corners(2 * k + 1, -1, -up, at);
    corners(2 * k + 2, 2 * k + 1, -up, up);
    corners(0, 2 * k + 2, at - up, up);
  }
  return out;
}

// One body at many points, with the friction that makes e of a contact as large as wanted.
Assembly one_object(Generator& g) {
  Assembly out;
  const int points = static_cast<int>(size(g, 6, 40));
  const Vector3d half(size(g, 0.05, 1), size(g, 0.05, 1), size(g, 0.1, 2));
  const double wanted = g.uniform(0.7, 1.6);
  out.bodies.push_back(body(g, 1, half, size(g, 1e-3, 1)));
  for (int k = 0; k < points; ++k) {
    const Vector3d r = half.cwiseProduct(
        Vector3d(g.uniform(-1, 1), g.uniform(-1, 1), g.uniform(-1, 1)).normalized());
    Vector3d normal = 0.5 * g.vector() - r.cwiseQuotient(half);
    normal.z() += g.uniform(0, 1);
    out.touch(0, -1, r, {0, 0, 0}, normal, 1);
  }
  const Problem problem = out.problem();
  double most = 0;
  for (int i = 0; i < points; ++i) most = std::max(most, problem.local(i).e);
  for (PointContact& c : out.contacts) c.mu = std::min(2.0, wanted / most);
  return out;
}

// Stacks on a slope whose tangent is the coefficient of friction, or a few bits off: each contact
// is at its bound, some graze, and round-off of heavy boxes is as large as the difference.
Assembly bound(Generator& g) {
  Assembly out;
  const int n = static_cast<int>(size(g, 2, 40));
  const double mu = g.uniform(0.2, 0.8), ratio = size(g, 1, 1e7);
  const double off = g.uniform(0, 1) < 0.3 ? 0 : size(g, 1e-15, 1e-6);
  const Vector3d down = 9.81e-3 * Vector3d(mu * (1 + off), 0, -1).normalized();
  for (int k = 0; k < n; ++k) {
    RigidBody b = random::box(k % 2 ? ratio : 1, {0.5, 0.5, 0.1});
    b.velocity = down;
    out.bodies.push_back(b);
    const double grazes = g.uniform(0, 1) < 0.2 ? -size(g, 1e-14, 1e-4) : 0;
    for (double x : {-0.5, 0.5})
      for (double y : {-0.5, 0.5}) {
        out.touch(k, k - 1, {x, y, -0.1}, {x, y, 0.1}, {0, 0, 1}, mu);
        if (x > 0) out.contacts.back().bias = grazes * down.z();
      }
  }
  return out;
}

// Unlike assemblies beside each other, without a contact between them.
Assembly islands(Generator& g) {
  Assembly out;
  const int n = 3 + static_cast<int>(g.uniform(0, 12));
  for (int k = 0; k < n; ++k) {
    const double which = g.uniform(0, 4);
    out.add(which < 1 ? tower(g) : which < 2 ? discs(g) : which < 3 ? one_object(g) : load(g));
  }
  return out;
}

Assembly packing(Generator& g) {
  const int side = 3 + static_cast<int>(g.uniform(0, 4));
  const random::Packing p =
      random::packing(side, g.uniform(0, 1) < 0.5, static_cast<std::uint64_t>(g.uniform(1, 1e6)));
  Assembly out{p.bodies, p.contacts};
  const double mu = g.uniform(0, 1.2);
  for (PointContact& c : out.contacts) c.mu = mu;
  return out;
}

// Lattices on which sweeps wander: close, with much friction.
Assembly close_packing(Generator& g) {
  const int cells = 3 + static_cast<int>(g.uniform(0, 3));
  const bool spheres = g.uniform(0, 1) < 0.5, mixed = g.uniform(0, 1) < 0.5;
  const random::Packing p = random::close_packing(cells, spheres, g.uniform(0.4, 1.1),
                                                  static_cast<std::uint64_t>(g.uniform(1, 1e6)),
                                                  mixed ? 0.05 : 0.03, 1, mixed);
  return {p.bodies, p.contacts};
}

// Stacks of 200 boxes that only the last digits of long paths solve, the same for every seed.
Assembly hard_tower(int k) {
  const int heavy[] = {1, 0, 0, 0, 0}, seeds[] = {29, 1012, 1027, 2012, 2013};
  Generator g(static_cast<std::uint64_t>(seeds[k]));
  return random::moving_stack(200, heavy[k], g);
}

// Points anywhere on few bodies of any shape, whose normals may wedge them.
Assembly tangle(Generator& g, int bodies, int contacts, double masses, double steep) {
  Assembly out;
  for (int k = 0; k < bodies; ++k) {
    const Vector3d half(size(g, 0.05, 1), size(g, 0.05, 1), size(g, 0.05, 1));
    RigidBody b = body(g, std::pow(10, g.uniform(-masses, masses)), half, 1);
    const Eigen::Matrix3d R = g.rotation();
    const Eigen::Matrix3d turned = R * b.inverse_inertia * R.transpose();
    b.inverse_inertia = 0.5 * (turned + turned.transpose());
    out.bodies.push_back(b);
  }
  const double mu = size(g, 0.05, 3);
  for (int k = 0; k < contacts; ++k) {
    const int first = static_cast<int>(g.uniform(0, bodies));
    int second = static_cast<int>(g.uniform(-1, bodies));
    if (second < 0 || second == first) second = -1;
    Vector3d normal = g.vector();
    normal.z() = std::abs(normal.z()) + steep;
    out.touch(first, second, g.vector(), g.vector(), normal, mu);
  }
  return out;
}

struct Group {
  const char* name;
  int count;
  std::function<Assembly(Generator&)> make;
  bool strict = false;  // contacts are strongly coupled
};

const Group kGroups[] = {
    {"towers", 16, tower},
    {"unlike towers", 12,
     [](Generator& g) {
       const int n = static_cast<int>(size(g, 20, 120));
       return random::moving_stack(n, static_cast<int>(g.uniform(0, 2)), g);
     }},
    {"stacks", 12, stack},
    {"walls", 8, wall},
    {"discs", 12, discs},
    {"arches", 16, arch},
    {"plates", 8, plate},
    {"loads", 10, load},
    {"one object", 24, one_object, true},
    {"at a bound", 24, bound},
    {"islands", 8, islands},
    {"packings", 12, packing},
    {"close packings", 8, close_packing},
    {"tangles", 20, [](Generator& g) { return tangle(g, 8, 30, 0.5, 0.5); }, true},
    {"wedged", 20, [](Generator& g) { return tangle(g, 4, 15, 2, 0); }, true},
    {"few", 120,
     [](Generator& g) {
       const int contacts = 1 + static_cast<int>(g.uniform(0, 7));
       return tangle(g, 1 + static_cast<int>(g.uniform(0, 4)), contacts, g.uniform(0, 6), 0.5);
     },
     true},
};

struct Rule {
  const char* name;
  Law law;
  bool strict;
};
const Rule kRules[] = {{"coulomb", Law::coulomb, false},
                       {"maximum_dissipation", Law::maximum_dissipation, false},
                       {"strict maximum_dissipation", Law::maximum_dissipation, true}};

struct Demand {
  double max_work;
  bool strict;  // maximum dissipation also without replacement of the law
  std::vector<double> tolerances = {1e-3, 1e-6, 1e-9};
};

// One line a solve.
void solve(const std::string& group, const std::string& label, const Problem& problem,
           const Demand& demand) {
  for (const Rule& rule : kRules)
    for (double tolerance : demand.tolerances) {
      if (rule.strict && !demand.strict) continue;
      Options o;
      o.law = rule.law;
      o.strict = rule.strict;
      o.tolerance = tolerance;
      o.max_work = demand.max_work;
      const Solution s = Solver(o).solve(problem);
      const bool judged = s.status == Status::solved && s.replaced.empty();
      const bool wrong =
          judged && evaluate(problem, rule.law, s.impulses).fixed_point > 1.0001 * tolerance;
      std::printf("%s,%s,%s,%g,%s,%.6g,%zu\n", group.c_str(), label.c_str(), rule.name, tolerance,
                  wrong ? "wrong" : name(s.status), s.counts.work, s.replaced.size());
    }
}

void solve_both(const std::string& group, const std::string& label, Problem problem,
                const Demand& demand) {
  solve(group, label, problem, demand);
  problem.set_body_form(nullptr);
  solve(group, label + " as (A b mu)", problem, demand);
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> folders;
  std::uint64_t seed = 1;
  double max_work = 2e8;
  CLI::App app("Contact problems of folders and generated ones, one line of work a solve");
  app.add_option("folders", folders, "Folders of .dat and .hdf5 files");
  app.add_option("--seed", seed, "Of the generated problems; 0: none");
  app.add_option("--work", max_work, "Most work of a solve");
  CLI11_PARSE(app, argc, argv);
  std::printf("group,problem,law,tolerance,status,work,replaced\n");
  for (const std::string& folder : folders) {
    std::set<std::string> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder))
      if (entry.path().extension() == ".dat" || entry.path().extension() == ".hdf5")
        files.insert(entry.path());
    for (const std::string& file : files)
      solve("files", std::filesystem::path(file).filename(), read_problem(file), {max_work, true});
  }
  if (seed == 0) return 0;
  for (const Group& group : kGroups) {
    Generator g(seed);
    for (int k = 0; k < group.count; ++k)
      solve_both(group.name, std::to_string(k), group.make(g).problem(), {max_work, group.strict});
  }
  Generator g(seed);
  for (const std::string& kind : random::classes())
    for (int k = 0; k < 30; ++k) {
      const random::Contact c = g(kind);
      solve("one contact", kind + std::to_string(k),
            Problem::dense(c.A, c.b, Eigen::VectorXd::Constant(1, c.mu)),
            {max_work, true, {1e-6, 1e-9, 1e-12}});
    }
  for (int k = 0; k < 5; ++k)
    solve("hard towers", std::to_string(k), hard_tower(k).problem(), {5 * max_work, false, {1e-6}});
}
