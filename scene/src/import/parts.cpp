// Tether: what moves as one. SPDX-License-Identifier: BSD-3-Clause
#include "import/parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/mass.hpp"
#include "import/robot/geometry.hpp"
#include "import/start.hpp"

namespace tether::scene::import {

namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kSmallRadius = 1e-3;  // m, of gyration, where a mass has no inertia
constexpr double kNoMass = 1e-12;      // of the whole: the round-off of a program that wrote it

std::size_t at(int k) { return static_cast<std::size_t>(k); }

/// Takes a link in, `place`: its frame in that of the part.
void weld(const Link& link, const Isometry3d& place, Part& part) {
  part.links.push_back(link.name);
  part.places.push_back(place);
  const Matrix3d R = place.linear(), turned = R * link.inertia * R.transpose();
  // Turning by the identity would only add rounding.
  const Matrix3d inertia =
      R == Matrix3d::Identity() ? link.inertia : Matrix3d((turned + turned.transpose()) / 2);
  add_mass(link.mass, place * link.centre, inertia, part.mass, part.centre, part.inertia);
  for (Shape shape : link.shapes) {
    shape.position = place * shape.position;
    shape.orientation = Eigen::Quaterniond(R) * shape.orientation;
    part.shapes.push_back(std::move(shape));
  }
  if (!link.touch) return;
  if (!part.touch) part.touch = link.touch;
  part.touch->join(*link.touch);
}

std::vector<Part> welded(const Model& model, const std::vector<LinkStart>& starts) {
  std::vector<Part> parts;
  std::vector<int> part_of;
  std::vector<Isometry3d> place;  // of each link in its part
  for (std::size_t k = 0; k < model.links.size(); ++k) {
    const Link& link = model.links[k];
    const int above = link.parent < 0 ? -1 : part_of[at(link.parent)];
    const bool is_new = above < 0 || !starts[k].joints.empty();
    if (is_new) {
      Part part;
      part.name = link.name;
      part.line = link.line;
      part.parent = above;
      part.joints = starts[k].joints;
      part.pose = starts[k].pose;
      part.scenery = link.scenery;
      part_of.push_back(static_cast<int>(parts.size()));
      place.push_back(Isometry3d::Identity());
      parts.push_back(std::move(part));
    } else {
      part_of.push_back(above);
      place.push_back(place[at(link.parent)] * starts[k].weld);
    }
    weld(link, place.back(), parts[at(part_of.back())]);
  }
  return parts;
}

void drop_round_off(std::vector<Part>& parts, Remarks& remarks) {
  double whole = 0;
  for (const Part& part : parts)
    if (!part.fixed()) whole += part.mass;
  for (Part& part : parts) {
    if (part.fixed() || !(part.mass > 0) || part.mass > kNoMass * whole) continue;
    part.mass = 0;
    part.inertia.setZero();
    remarks.add(fmt::format("masses below {} of the whole, which count as none", kNoMass),
                part.name);
  }
}

/// A scene needs something that moves.
void check_moves(const Model& model, const std::vector<Part>& parts, Problems& problems) {
  if (std::any_of(parts.begin(), parts.end(),
                  [](const Part& part) { return !part.gone && !part.fixed(); }))
    return;
  const bool joints = std::any_of(parts.begin(), parts.end(), [](const Part& p) { return p.gone; });
  problems.add(model.links.empty() ? 1 : model.links.front().line, "", "",
               joints ? "nothing that moves has mass: its links need an <inertial>"
                      : "nothing moves while the base is fixed: --base free lets it");
}

/// A part without mass has no equations of motion of its own.
void fold_massless(std::vector<Part>& parts, Remarks& remarks, Problems& problems) {
  // How many children there are, and the sum of their places: that of the child where it is one.
  std::vector<int> count(parts.size(), 0);
  std::vector<long> sum(parts.size(), 0);
  for (std::size_t k = 0; k < parts.size(); ++k)
    if (parts[k].parent >= 0) {
      ++count[at(parts[k].parent)];
      sum[at(parts[k].parent)] += static_cast<long>(k);
    }
  std::vector<std::vector<PlacedJoint>> ahead(parts.size());  // of its own, the nearest one first
  for (std::size_t k = parts.size(); k-- > 0;) {
    Part& part = parts[k];
    if (part.fixed() || part.mass > 0 || !part.inertia.isZero(0)) continue;
    if (count[k] > 1) {
      problems.add(part.line, fmt::format("link \"{}\"", part.name), "",
                   fmt::format("moves, has no mass, and {} links hang on it: give it mass and "
                               "inertia",
                               count[k]));
      continue;
    }
    part.gone = true;
    const int above = part.parent;
    if (count[k] == 0) {
      remarks.add("links without mass at the end of their branch, and their joints", part.name);
    } else {
      const auto child = static_cast<std::size_t>(sum[k]);
      ahead[child].insert(ahead[child].end(), part.joints.rbegin(), part.joints.rend());
      parts[child].parent = above;
      if (!part.shapes.empty()) remarks.add("shapes of links without mass", part.name);
    }
    if (above < 0) continue;
    count[at(above)] += count[k] - 1;
    sum[at(above)] += sum[k] - static_cast<long>(k);
  }
  for (std::size_t k = 0; k < parts.size(); ++k)
    parts[k].joints.insert(parts[k].joints.begin(), ahead[k].rbegin(), ahead[k].rend());
}

bool is_small(const Vector3d& v) {
  return v.allFinite() && v.cwiseAbs().maxCoeff() < kLargestLength;
}

void check_part(Part& part, bool mend, Remarks& remarks, Problems& problems) {
  const std::string called = fmt::format("link \"{}\"", part.name);
  bool small = is_small(part.pose.translation()) && is_small(part.centre);
  for (const Shape& shape : part.shapes) {
    small = small && is_small(shape.position) && is_small(shape.size) &&
            std::max(shape.radius, shape.length) < kLargestLength;
    for (const Vector3d& p : shape.points) small = small && is_small(p);
  }
  for (const PlacedJoint& joint : part.joints) small = small && is_small(joint.at);
  if (!small)
    problems.add(part.line, called, "",
                 fmt::format("has a place or size beyond {:g} m", kLargestLength));
  if (part.fixed()) return;
  if (!std::isfinite(part.mass) || !part.inertia.allFinite())
    return problems.add(part.line, called, "", "has a mass or inertia beyond the range of numbers");
  if (!(part.mass > 0))
    return problems.add(part.line, called + ": mass", "", "must be > 0: the link has inertia");
  if (is_inertia(part.inertia, true)) return;
  if (mend && part.inertia.isZero(0)) {
    part.inertia = kSmallRadius * kSmallRadius * part.mass * Matrix3d::Identity();
    return remarks.add(
        fmt::format("masses without inertia, which get a radius of gyration of {} m", kSmallRadius),
        part.name);
  }
  const Matrix3d mended = mended_inertia(part.inertia);
  if (mend && is_inertia(mended, true)) {
    part.inertia = mended;
    return remarks.add("inertias that no body has, changed to the nearest ones", part.name);
  }
  const Matrix3d& J = part.inertia;
  problems.add(
      part.line, called + ": inertia",
      fmt::format("[{}, {}, {}, {}, {}, {}]", J(0, 0), J(1, 1), J(2, 2), J(0, 1), J(0, 2), J(1, 2)),
      std::string("no body has this: principal moments are > 0 and each at most the sum "
                  "of the other two") +
          (part.links.size() > 1 ? fmt::format(" (of {} links welded together)", part.links.size())
                                 : "") +
          "; --mend takes the nearest ones");
}

}  // namespace

std::vector<Part> make_parts(Model& model, const ImportOptions& options, Problems& problems) {
  const std::vector<LinkStart> starts = starts_of(model, options);
  std::vector<Part> parts = welded(model, starts);
  drop_round_off(parts, model.remarks);
  fold_massless(parts, model.remarks, problems);
  if (problems.clean()) check_moves(model, parts, problems);
  for (Part& part : parts)
    if (!part.gone) check_part(part, options.mend, model.remarks, problems);
  return parts;
}

}  // namespace tether::scene::import
