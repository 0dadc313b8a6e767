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

// Flat boxes on each other, every other one a million times as heavy, all in motion.
Assembly unlike_tower(Generator& g) {
  Assembly out;
  const int n = static_cast<int>(size(g, 20, 120)), heavy = g.uniform(0, 1) < 0.5;
  const double mu = g.uniform(0.2, 0.9), speed = size(g, 1e-4, 0.03);
  const Vector3d half(size(g, 0.15, 1), size(g, 0.3, 1), size(g, 0.2, 0.6));
  for (int k = 0; k < n; ++k) {
    out.bodies.push_back(body(g, (k + heavy) % 2 ? 1e6 : 1, half, speed));
    const Vector3d shift(g.uniform(-0.1, 0.1), g.uniform(-0.1, 0.1), 0);
    for (double x : {-0.9, 0.9})
      for (double y : {-0.9, 0.9})
        out.touch(k, k - 1, half.cwiseProduct(Vector3d(x, y, -1)),
                  half.cwiseProduct(Vector3d(x, y, 1) + shift), {0, 0, 1}, mu);
  }
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

Assembly packing(Generator& g) {
  const int side = 3 + static_cast<int>(g.uniform(0, 4));
  const random::Packing p =
      random::packing(side, g.uniform(0, 1) < 0.5, static_cast<std::uint64_t>(g.uniform(1, 1e6)));
  Assembly out{p.bodies, p.contacts};
  const double mu = g.uniform(0, 1.2);
  for (PointContact& c : out.contacts) c.mu = mu;
  return out;
}

// A jittered face-centred lattice of bodies of unlike sizes, those that overlap in contact.
Assembly close_packing(Generator& g) {
  Assembly out;
  const int side = 2 + static_cast<int>(g.uniform(0, 3));
  const double mu = g.uniform(0.2, 1.1), off = g.uniform(0, 1) < 0.5 ? 0 : 0.1;
  std::vector<Vector3d> centre;
  std::vector<double> radius;
  for (int z = 0; z < 2 * side; ++z)
    for (int y = 0; y < 2 * side; ++y)
      for (int x = (y + z) % 2; x < 2 * side; x += 2) {
        centre.emplace_back(Vector3d(x, y, z) / std::sqrt(2) + 0.03 * g.vector());
        radius.push_back(0.5 * g.uniform(0.95, 1.1));
        out.bodies.push_back(body(g, size(g, 0.5, 2), Vector3d::Constant(0.4), 0.2));
        const int i = static_cast<int>(centre.size()) - 1;
        const Vector3d& p = centre.back();
        if (z == 0) out.touch(i, -1, {0, 0, -radius.back()}, p, {0, 0, 1}, mu);
        for (int j = 0; j < i; ++j) {
          const Vector3d d = p - centre[static_cast<std::size_t>(j)], side_step = off * g.vector();
          const double r = radius[static_cast<std::size_t>(j)];
          if (d.norm() > r + radius.back()) continue;
          out.touch(i, j, -radius.back() * d.normalized() + side_step,
                    r * d.normalized() + side_step, d, mu);
        }
      }
  return out;
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
};

const Group kGroups[] = {
    {"towers", 16, tower},
    {"unlike towers", 12, unlike_tower},
    {"walls", 8, wall},
    {"discs", 12, discs},
    {"arches", 16, arch},
    {"plates", 8, plate},
    {"packings", 12, packing},
    {"close packings", 8, close_packing},
    {"tangles", 20, [](Generator& g) { return tangle(g, 8, 30, 0.5, 0.5); }},
    {"wedged", 20, [](Generator& g) { return tangle(g, 4, 15, 2, 0); }},
    {"few", 120,
     [](Generator& g) {
       const int contacts = 1 + static_cast<int>(g.uniform(0, 7));
       return tangle(g, 1 + static_cast<int>(g.uniform(0, 4)), contacts, g.uniform(0, 6), 0.5);
     }},
};

// One line a solve.
void solve(const std::string& group, const std::string& label, const Problem& problem,
           double max_work) {
  for (Law law : {Law::coulomb, Law::maximum_dissipation})
    for (double tolerance : {1e-3, 1e-6, 1e-9}) {
      Options o;
      o.law = law;
      o.tolerance = tolerance;
      o.max_work = max_work;
      const Solution s = Solver(o).solve(problem);
      const bool judged = s.status == Status::solved && s.replaced.empty();
      const bool wrong =
          judged && evaluate(problem, law, s.impulses).fixed_point > 1.0001 * tolerance;
      std::printf("%s,%s,%s,%g,%s,%.6g,%zu\n", group.c_str(), label.c_str(), name(law), tolerance,
                  wrong ? "wrong" : name(s.status), s.counts.work, s.replaced.size());
    }
}

void solve_both(const std::string& group, const std::string& label, Problem problem,
                double max_work) {
  solve(group, label, problem, max_work);
  problem.set_body_form(nullptr);
  solve(group, label + " as (A b mu)", problem, max_work);
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> folders;
  std::uint64_t seed = 1;
  double max_work = 2e8;
  CLI::App app("Contact problems of folders and generated ones, one line of work a solve");
  app.add_option("folders", folders, "Folders of .dat and .hdf5 files");
  app.add_option("--seed", seed, "Of the generated problems");
  app.add_option("--work", max_work, "Most work of a solve");
  CLI11_PARSE(app, argc, argv);
  std::printf("group,problem,law,tolerance,status,work,replaced\n");
  for (const std::string& folder : folders) {
    std::set<std::string> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder))
      if (entry.path().extension() == ".dat" || entry.path().extension() == ".hdf5")
        files.insert(entry.path());
    for (const std::string& file : files)
      solve("files", std::filesystem::path(file).filename(), read_problem(file), max_work);
  }
  for (const Group& group : kGroups) {
    Generator g(seed);
    for (int k = 0; k < group.count; ++k)
      solve_both(group.name, std::to_string(k), group.make(g).problem(), max_work);
  }
}
