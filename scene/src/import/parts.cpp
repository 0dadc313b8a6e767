// Tether: what moves as one. SPDX-License-Identifier: BSD-3-Clause
#include "parts.hpp"

#include <fmt/format.h>

#include <cmath>
#include <tether/linalg/pi.hpp>

#include "geometry/shape_type.hpp"
#include "import.hpp"
#include "robot.hpp"

namespace tether::scene::import {

namespace {

struct LinkStart {
  std::vector<PlacedJoint> joints;  ///< those that move
  Eigen::Isometry3d pose;           ///< in the world
  Eigen::Isometry3d weld;           ///< in the frame of the parent
};

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Translation3d;

bool has_coordinate(const LinkJoint& joint) {
  return joint.kind == MotionKind::hinge || joint.kind == MotionKind::slide;
}

/// Refuses names that no joint has.
void check_names(const Model& model, const ImportOptions& options) {
  std::map<std::string, const LinkJoint*> all;
  std::string known;
  for (const Link& link : model.links)
    for (const LinkJoint& joint : link.joints) {
      all[joint.name] = &joint;
      if (all.size() <= 30) known += (known.empty() ? "" : ", ") + joint.name;
    }
  const auto look = [&](const char* option, const std::string& name) {
    const auto found = all.find(name);
    if (found == all.end())
      throw std::invalid_argument(shown(fmt::format(
          "{} {}: no joint that moves has this name; {}{}", option, name,
          known.empty() ? "none does" : "there are " + known, all.size() > 30 ? ", ..." : "")));
    return found->second;
  };
  for (const auto& [name, value] : options.positions) {
    const LinkJoint& joint = *look("--joint", name);
    if (!has_coordinate(joint))
      throw std::invalid_argument(
          fmt::format("--joint {}: is no hinge or slider, whose position is one number", name));
    if (options.joint_laws && joint.limits &&
        !(value >= joint.limits->first && value <= joint.limits->second))
      throw std::invalid_argument(fmt::format("--joint {}={}: its limits are {} and {}", name,
                                              value, joint.limits->first, joint.limits->second));
  }
  for (const std::string& name : options.held) look("--hold", name);
  for (const auto& [name, value] : options.controls) {
    const auto drive = std::find_if(model.drives.begin(), model.drives.end(),
                                    [&n = name](const Drive& each) { return each.name == n; });
    if (drive == model.drives.end())
      throw std::invalid_argument(
          shown(fmt::format("--control {}: no actuator that is taken over has this name", name)));
    if (drive->has_activation)
      throw std::invalid_argument(
          shown(fmt::format("--control {}: acts through a state, which scenes do not have", name)));
  }
}

const LinkJoint* find_joint(const Model& model, const std::string& name) {
  for (const Link& link : model.links)
    for (const LinkJoint& joint : link.joints)
      if (joint.name == name) return &joint;
  return nullptr;
}

// `depth`: of joints that follow each other in a circle the last one stands as if alone.
double value_of(const LinkJoint& joint, const ImportOptions& options, const Model& model,
                Remarks& remarks, std::size_t depth = 0) {
  for (const auto& [name, value] : options.positions)
    if (name == joint.name) return value;
  if (joint.mimic && depth < model.links.size())
    if (const LinkJoint* of = find_joint(model, joint.mimic->of))
      return joint.mimic->multiplier * value_of(*of, options, model, remarks, depth + 1) +
             joint.mimic->offset;
  if (!joint.limits || !options.joint_laws || !has_coordinate(joint)) return joint.reference;
  const auto [lower, upper] = *joint.limits;
  if (joint.reference < lower || joint.reference > upper)
    remarks.add(
        "joints that start at their nearest limit, since zero lies beyond it (--joint "
        "NAME=VALUE)",
        joint.name);
  return std::min(std::max(joint.reference, lower), upper);
}

Isometry3d moved(const LinkJoint& joint, double way) {
  if (joint.kind == MotionKind::slide) return Isometry3d(Translation3d(way * joint.axis));
  return Translation3d(joint.at) * AngleAxisd(way, joint.axis) * Translation3d(-joint.at);
}

/// Joints that --base gives a link in the world.
std::vector<LinkJoint> base_joints(const Link& link, Base base) {
  if (base == Base::as_file || link.scenery) return link.joints;
  if (base == Base::free) {
    LinkJoint free;
    free.kind = MotionKind::free;
    free.name = "base";
    free.line = link.line;
    return {free};
  }
  std::vector<LinkJoint> out;
  for (const LinkJoint& joint : link.joints)
    if (joint.kind != MotionKind::free) out.push_back(joint);
  return out;
}

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

/// Links to which the file gives no mass weigh as their shapes.
void weigh_shapes(Model& model, double density) {
  for (Link& link : model.links) {
    if (link.is_weighed) continue;
    const MassProperties solid = mass_properties(link.shapes);
    if (!(solid.volume > 0)) continue;
    link.mass = density * solid.volume;
    link.centre = solid.centre;
    link.inertia = density * solid.inertia;
    model.remarks.add(
        fmt::format("links without <inertial>, whose shapes weigh {} kg/m^3", density), link.name);
  }
}

/// A scene needs something that moves.
void check_moves(const Model& model, const std::vector<Part>& parts, Problems& problems) {
  if (any_of(parts, [](const Part& part) { return !part.gone && !part.fixed(); })) return;
  const bool joints = any_of(parts, [](const Part& p) { return p.gone; });
  problems.add(model.links.empty() ? 1 : model.links.front().line, "", "",
               joints ? "nothing that moves has mass: its links need an <inertial>, or --density "
                        "lets them weigh as their collision shapes"
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
                   fmt::format("moves, has no mass, and carries {} links: give it mass and "
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

/// Marks the joints that need a coordinate for what acts on several.
void find_common_laws(Model& model, const ImportOptions& options) {
  std::set<std::string> driven, summed;
  for (const Drive& drive : model.drives)
    for (const Transmission& to : drive.to)
      if (!law_of(drive, options).isZero(0)) driven.insert(to.joint);
  for (const KeptSum& sum : model.kept_sums)
    for (const Transmission& term : sum.terms) summed.insert(term.joint);
  for (Link& link : model.links)
    for (LinkJoint& joint : link.joints) {
      joint.is_driven = driven.count(joint.name) > 0;
      joint.is_summed = summed.count(joint.name) > 0;
    }
}

std::vector<LinkStart> starts_of(Model& model, const ImportOptions& options) {
  check_names(model, options);
  find_common_laws(model, options);
  std::vector<LinkStart> out;
  for (const Link& link : model.links) {
    LinkStart start;
    start.weld = link.pose;
    const bool base = link.parent < 0;
    Isometry3d pose =
        base ? link.pose : out[static_cast<std::size_t>(link.parent)].pose * link.pose;
    if (base && !link.scenery) pose.pretranslate(Eigen::Vector3d(0, 0, options.height));
    for (const LinkJoint& joint : base ? base_joints(link, options.base) : link.joints) {
      PlacedJoint placed{joint, pose.linear() * joint.axis, pose * joint.at, 0};
      if (has_coordinate(joint)) {
        placed.value = value_of(joint, options, model, model.remarks);
        const double way = placed.value - joint.reference;
        // Turning by nothing would only add rounding.
        if (way != 0) {
          const Isometry3d motion = moved(joint, way);
          pose = pose * motion;
          start.weld = start.weld * motion;
        }
      }
      const bool has_no_range = options.joint_laws && has_coordinate(joint) && joint.limits &&
                                joint.limits->first == joint.limits->second;
      if (options.held.count(joint.name) == 0 && !has_no_range)
        start.joints.push_back(std::move(placed));
    }
    start.pose = pose;
    out.push_back(std::move(start));
  }
  return out;
}

double inertia_about_joints(const Part& part) {
  double out = part.inertia.cwiseAbs().maxCoeff();
  for (const PlacedJoint& each : part.joints)
    out += part.mass * (each.at - part.pose * part.centre).squaredNorm();
  return out;
}

bool has_wide_limits(const LinkJoint& joint) {
  return joint.kind == MotionKind::hinge && joint.limits &&
         !(joint.limits->second - joint.limits->first < 2 * linalg::kPi);
}

std::vector<Part> make_parts(Model& model, const ImportOptions& options, Problems& problems) {
  if (options.density) weigh_shapes(model, *options.density);
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
