// Tether: what moves as one. SPDX-License-Identifier: BSD-3-Clause
#include "parts.hpp"

#include <fmt/format.h>

#include <cmath>
#include <tether/linalg/pi.hpp>
#include <tether/linalg/symmetric_eigen.hpp>

#include "bounds.hpp"

namespace tether::scene::import {

namespace {

using Eigen::AngleAxisd;
using Eigen::Translation3d;

constexpr double kSmallRadius = 1e-3;  // m, of gyration, where a mass has no inertia
constexpr double kNoMass = 1e-12;      // of the whole: the round-off of a program that wrote it

struct LinkStart {
  std::vector<PlacedJoint> joints;  ///< those that move
  Isometry3d pose;                  ///< in the world
  Isometry3d weld;                  ///< in the frame of the parent
};

std::map<std::string, const LinkJoint*> joints_of(const Model& model) {
  std::map<std::string, const LinkJoint*> all;
  for (const Link& link : model.links)
    for (const LinkJoint& joint : link.joints) all[joint.name] = &joint;
  return all;
}

/// Refuses names that no joint has.
void check_names(const Model& model, const ImportOptions& options) {
  const auto refuse = [](const std::string& why) { throw std::invalid_argument(shown(why)); };
  const std::map<std::string, const LinkJoint*> all = joints_of(model);
  const auto demand_joint = [&](const char* option, const std::string& name) {
    if (all.count(name) > 0) return;
    std::string known;
    std::size_t count = 0;
    for (const Link& link : model.links)
      for (const LinkJoint& joint : link.joints)
        if (++count <= kMostSuggested) known += (known.empty() ? "" : ", ") + joint.name;
    refuse(fmt::format("{} {}: no joint that moves has this name; {}{}", option, name,
                       known.empty() ? "none does" : "there are " + known,
                       count > kMostSuggested ? ", ..." : ""));
  };
  for (const auto& [name, value] : options.positions) {
    demand_joint("--joint", name);
    const LinkJoint& joint = *all.at(name);
    if (!joint.has_coordinate())
      refuse(fmt::format("--joint {}: is no hinge or slider, whose position is one number", name));
    if (options.joint_laws && joint.limits &&
        !(value >= joint.limits->first && value <= joint.limits->second))
      refuse(fmt::format("--joint {}={}: its limits are {} and {}", name, value,
                         joint.limits->first, joint.limits->second));
  }
  for (const std::string& name : options.held) demand_joint("--hold", name);
  for (const auto& [name, value] : options.controls) {
    const auto drive = std::find_if(model.drives.begin(), model.drives.end(),
                                    [&n = name](const Drive& each) { return each.name == n; });
    if (drive == model.drives.end())
      refuse(fmt::format("--control {}: no actuator that is taken over has this name", name));
    if (!drive->gain)
      refuse(fmt::format("--control {}: acts through a state, which scenes do not have", name));
  }
}

// `depth`: of so many joints that follow each other in a circle the last one stands as if alone.
double value_of(const LinkJoint& joint, const ImportOptions& options,
                const std::map<std::string, const LinkJoint*>& all, Remarks& remarks,
                std::size_t depth) {
  for (const auto& [name, value] : options.positions)
    if (name == joint.name) return value;
  if (joint.mimic && depth > 0)
    if (const auto of = all.find(joint.mimic->of); of != all.end())
      return joint.mimic->multiplier * value_of(*of->second, options, all, remarks, depth - 1) +
             joint.mimic->offset;
  if (!joint.limits || !options.joint_laws || !joint.has_coordinate()) return joint.reference;
  const auto [lower, upper] = *joint.limits;
  if (joint.reference < lower || joint.reference > upper)
    remarks.add(
        "joints that start at their nearest limit, since zero lies beyond it (--joint "
        "NAME=VALUE)",
        joint.name);
  return std::min(std::max(joint.reference, lower), upper);
}

Isometry3d moved(const LinkJoint& joint, double way) {
  if (joint.kind == JointKind::slider) return Isometry3d(Translation3d(way * joint.axis));
  return Translation3d(joint.at) * AngleAxisd(way, joint.axis) * Translation3d(-joint.at);
}

/// Joints that --base gives a link in the world.
std::vector<LinkJoint> base_joints(const Link& link, Base base) {
  if (base == Base::as_file || link.scenery) return link.joints;
  std::vector<LinkJoint> out;
  if (base == Base::free) {
    LinkJoint& free = out.emplace_back();
    free.kind.reset();
    free.name = "base";
    free.line = link.line;
    return out;
  }
  for (const LinkJoint& joint : link.joints)
    if (joint.kind) out.push_back(joint);
  return out;
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
      Part& part = parts.emplace_back();
      part.name = link.name;
      part.line = link.line;
      part.parent = above;
      part.joints = starts[k].joints;
      part.pose = starts[k].pose;
      part.scenery = link.scenery;
    }
    part_of.push_back(is_new ? static_cast<int>(parts.size()) - 1 : above);
    place.push_back(is_new ? Isometry3d::Identity() : place[at(link.parent)] * starts[k].weld);
    Part& part = parts[at(part_of.back())];
    part.links.push_back(link.name);
    part.places.push_back(place.back());
    part.add(link, place.back());
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

bool is_small(const Part& part) {
  return is_small(part.pose.translation()) && is_small(part.centre) &&
         all_of(part.joints, [](const PlacedJoint& joint) { return is_small(joint.at); }) &&
         all_of(part.shapes, [](const Shape& shape) {
           return is_small(shape.position) && is_small(shape.size) &&
                  std::max(shape.radius, shape.length) < kLargestLength &&
                  all_of(shape.points, [](const Vector3d& p) { return is_small(p); });
         });
}

/// The nearest inertia that a body may have: negative and vanishing moments become small ones, then
/// the smaller two of the moments grow alike until they carry the largest.
Matrix3d mended_inertia(const Matrix3d& inertia) {
  const double scale = inertia.cwiseAbs().maxCoeff();
  const linalg::SymmetricEigen<3> eigen = linalg::symmetric_eigen(inertia / scale);
  Vector3d moment = eigen.values;
  moment = moment.cwiseMax(1e-6 * moment[2]);
  const double lacking = std::max(0.0, moment[2] * (1 + 1e-9) - moment[0] - moment[1]);
  moment[0] += lacking / 2;
  moment[1] += lacking / 2;
  const Matrix3d out = eigen.vectors * moment.asDiagonal() * eigen.vectors.transpose();
  return scale / 2 * (out + out.transpose());
}

void check_part(Part& part, bool mend, Remarks& remarks, Problems& problems) {
  const std::string called = fmt::format("link \"{}\"", part.name);
  if (!is_small(part))
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

std::vector<LinkStart> starts_of(Model& model, const ImportOptions& options) {
  const std::map<std::string, const LinkJoint*> all = joints_of(model);
  std::vector<LinkStart> out;
  for (const Link& link : model.links) {
    LinkStart start;
    start.weld = link.pose;
    const bool base = link.parent < 0;
    Isometry3d pose = base ? link.pose : out[at(link.parent)].pose * link.pose;
    if (base && !link.scenery) pose.pretranslate(Vector3d(0, 0, options.height));
    for (const LinkJoint& joint : base ? base_joints(link, options.base) : link.joints) {
      PlacedJoint placed{joint};
      placed.axis = pose.linear() * joint.axis;
      placed.at = pose * joint.at;
      if (joint.has_coordinate()) {
        placed.value = value_of(joint, options, all, model.remarks, model.links.size());
        const double way = placed.value - joint.reference;
        // Turning by nothing would only add rounding.
        if (way != 0) {
          const Isometry3d motion = moved(joint, way);
          pose = pose * motion;
          start.weld = start.weld * motion;
        }
      }
      const bool has_no_range = options.joint_laws && joint.has_coordinate() && joint.limits &&
                                joint.limits->first == joint.limits->second;
      if (options.held.count(joint.name) == 0 && !has_no_range)
        start.joints.push_back(std::move(placed));
    }
    start.pose = pose;
    out.push_back(std::move(start));
  }
  return out;
}

}  // namespace

Isometry3d placed(const Quaterniond& orientation, const Vector3d& position) {
  Isometry3d out = Isometry3d::Identity();
  out.linear() = orientation.toRotationMatrix();
  out.translation() = position;
  return out;
}

void Matter::add(const Matter& part, const Isometry3d& place) {
  inertia += rotated(place.linear(), part.inertia);
  const Vector3d there = place * part.centre;
  if (part.mass > 0 && mass > 0) {
    const Vector3d now = (mass * centre + part.mass * there) / (mass + part.mass);
    inertia += mass * point_inertia(centre - now) + part.mass * point_inertia(there - now);
    mass += part.mass;
    centre = now;
  } else if (part.mass > 0) {
    mass = part.mass;
    centre = there;
  }
  for (Shape shape : part.shapes) {
    shape.position = place * shape.position;
    shape.orientation = Quaterniond(place.linear()) * shape.orientation;
    shapes.push_back(std::move(shape));
  }
  if (!part.touch) return;
  if (!touch) touch = part.touch;
  touch->join(*part.touch);
}

bool has_wide_limits(const LinkJoint& joint) {
  return joint.kind == JointKind::hinge && joint.limits &&
         !(joint.limits->second - joint.limits->first < 2 * linalg::kPi);
}

std::vector<Part> make_parts(Model& model, const ImportOptions& options, Problems& problems) {
  if (options.density) weigh_shapes(model, *options.density);
  check_names(model, options);
  std::vector<Part> parts = welded(model, starts_of(model, options));
  drop_round_off(parts, model.remarks);
  fold_massless(parts, model.remarks, problems);
  if (problems.clean()) check_moves(model, parts, problems);
  for (Part& part : parts)
    if (!part.gone) check_part(part, options.mend, model.remarks, problems);
  return parts;
}

}  // namespace tether::scene::import
