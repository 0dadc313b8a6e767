// Tether: parts of a robot as bodies, joints and contacts of a scene. SPDX-License-Identifier:
// BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tether/scene/plan.hpp>

#include "bounds.hpp"
#include "parts.hpp"
#include "toml/report.hpp"

namespace tether::scene::import {

namespace {

constexpr std::size_t kMostMaterials = 32;

using Chain = std::vector<PlacedJoint>;

/// Point in which the axes of two hinges meet.
std::optional<Vector3d> crossing(const PlacedJoint& a, const PlacedJoint& b) {
  const Vector3d across = a.axis.cross(b.axis), d = b.at - a.at;
  const double square = across.squaredNorm();
  if (square < 1e-12) return {};
  const Vector3d on_a = a.at + d.cross(b.axis).dot(across) / square * a.axis;
  const Vector3d on_b = b.at + d.cross(a.axis).dot(across) / square * b.axis;
  if (!((on_a - on_b).norm() <= kSameFigure * (1 + d.norm()))) return {};
  return (on_a + on_b) / 2;
}

bool passes(const PlacedJoint& joint, const Vector3d& point) {
  return (point - joint.at).cross(joint.axis).norm() <=
         kSameFigure * (1 + (point - joint.at).norm());
}

bool are_right(const Vector3d& u, const Vector3d& v) { return std::abs(u.dot(v)) <= 1e-9; }

/// The joints as one, which has no axis or point before; `chain` from the parent outwards.
std::optional<Joint> as_one(const Chain& chain) {
  if (!all_of(chain, [](const PlacedJoint& each) { return each.has_coordinate(); })) return {};
  std::vector<const PlacedJoint*> hinges, slides;
  for (const PlacedJoint& each : chain)
    (each.kind == JointKind::hinge ? hinges : slides).push_back(&each);
  Joint out;
  if (hinges.size() == 1 && slides.size() == 2) {
    out.kind = JointKind::planar;
    out.axis = hinges[0]->axis;
    out.at = hinges[0]->at;
    if (are_right(slides[0]->axis, out.axis) && are_right(slides[1]->axis, out.axis) &&
        !(slides[0]->axis.cross(slides[1]->axis).norm() < 1e-3))
      return out;
    return {};
  }
  if (!slides.empty() || hinges.size() < 2 || hinges.size() > 3) return {};
  const auto point = crossing(chain[0], chain[1]);
  if (!point) return {};
  out.at = *point;
  if (hinges.size() == 2) {
    out.kind = JointKind::universal;
    out.axis = chain[1].axis;         // carried by the body itself
    out.axis_second = chain[0].axis;  // by its parent
    return are_right(out.axis, out.axis_second) ? std::optional(out) : std::nullopt;
  }
  const double volume = std::abs(chain[0].axis.cross(chain[1].axis).dot(chain[2].axis));
  if (!passes(chain[2], *point) || volume < 1e-3) return {};
  out.kind = JointKind::ball;
  return out;
}

/// Joints in a kept sum, or driven by what exerts something.
std::set<std::string> with_common_laws(const Model& model, const ImportOptions& options) {
  std::set<std::string> out;
  for (const Drive& drive : model.drives)
    for (const Transmission& to : drive.to)
      if (!law_of(drive, options).isZero(0)) out.insert(to.joint);
  for (const KeptSum& sum : model.kept_sums)
    for (const Transmission& term : sum.terms) out.insert(term.joint);
  return out;
}

/// Whether something of its own acts along the coordinate of a joint, which it needs for that.
bool has_laws(const LinkJoint& law, const ImportOptions& options) {
  return law.damping > 0 || law.stiffness > 0 || law.armature > 0 || law.mimic ||
         (options.joint_laws && (law.limits || law.friction > 0));
}

std::string clean_title(const std::string& name) {
  std::string title = files::printable(name);
  for (char& c : title)
    if (c == ',' || c == '"' || c == '\'') c = ' ';
  title.erase(0, title.find_first_not_of("=+-@ "));
  return files::is_plain(title) ? title : "";  // too long
}

/// Gives each a name that the file uses for two things, which a scene tells apart.
template <class Named>
void make_unique(std::vector<Named>& all) {
  std::set<std::string> names;
  for (const Named& each : all) names.insert(each.name);
  std::set<std::string> used;
  std::map<std::string, int> last;  // number of each name
  for (Named& each : all) {
    if (used.insert(each.name).second) continue;
    const std::string stem = each.name;
    int& k = last.emplace(stem, 1).first->second;
    do each.name = fmt::format("{} {}", stem, ++k);
    while (names.count(each.name) > 0 || !used.insert(each.name).second);
  }
}

class Drafting {
 public:
  Drafting(const Model& model, const std::vector<Part>& parts, const ImportOptions& options,
           Remarks& remarks)
      : model_(model),
        parts_(parts),
        options_(options),
        remarks_(remarks),
        common_(with_common_laws(model, options)) {}

  Draft take() {
    scene_.name = clean_title(model_.name);
    scene_.end = options_.end;
    scene_.gravity = model_.gravity;
    add_ground();
    for (const Part& part : parts_) body_of_.push_back(part.gone ? -1 : add_body(part));
    for (std::size_t k = 0; k < parts_.size(); ++k) {
      const Part& part = parts_[k];
      if (part.gone || part.fixed()) continue;
      add_joints(part, body_of_[k], part.parent < 0 ? -1 : body_of_[at(part.parent)]);
    }
    add_common_laws(model_, parts_, options_, draft_, remarks_);
    add_closures();
    if (model_.touches) add_contacts();
    make_unique(scene_.bodies);
    make_unique(scene_.joints);
    make_unique(scene_.springs);
    make_unique(scene_.couplings);
    const bool laws =
        any_of(scene_.joints, [](const Joint& each) { return each.limits || each.friction > 0; });
    if (model_.step > 0 && (laws || !scene_.pairs.empty()))
      scene_.stepping.emplace().step = model_.step;
    return std::move(draft_);
  }

 private:
  void add_ground() {
    if (!options_.ground) return;
    Body body;
    body.name = "ground";
    body.fixed = true;
    body.position.z() = *options_.ground;
    body.shapes.emplace_back().kind = ShapeKind::plane;
    draft_.add(std::move(body), "--ground");
  }
  /// -1: the world, where a fixed part has nothing to show.
  int add_body(const Part& part) {
    if (part.fixed() && part.shapes.empty()) return -1;
    Body body;
    body.name = part.name;
    if (body.name == "world")
      body.name = part.links.size() > 1 ? part.links[1] : std::string("world link");
    body.fixed = part.fixed();
    body.position = part.pose * part.centre;
    body.orientation = Quaterniond(part.pose.linear()).normalized();
    if (!part.fixed()) {
      body.mass = part.mass;
      body.inertia = part.inertia;
    }
    body.shapes = part.shapes;
    for (Shape& shape : body.shapes) {
      shape.position -= part.centre;
      shape.orientation.normalize();
    }
    std::string comment = fmt::format("line {}", part.line);
    for (std::size_t k = 1; k < part.links.size(); ++k)
      comment += (k > 1 ? ", " : ", with ") + part.links[k];
    return draft_.add(std::move(body), std::move(comment));
  }
  /// The joints that carry `part`, which is the body `body`, on the body `on` (-1: the world).
  /// Several joints without laws are one where scenes have it (universal, ball, planar, none), else
  /// small bodies stand between them.
  void add_joints(const Part& part, int body, int on) {
    const Chain& chain = part.joints;
    if (any_of(chain, [](const PlacedJoint& each) { return !each.kind; })) {
      for (const PlacedJoint& each : chain) name_lost_laws(each, false);
      if (chain.size() > 1)
        remarks_.add("joints in a row with a free one, which leaves nothing of them", part.name);
      return;
    }
    if (chain.size() == 1) return add_joint(chain[0], body, on);
    const bool plain = !any_of(chain, [&](const PlacedJoint& j) {
      return common_.count(j.name) > 0 || has_laws(j, options_);
    });
    if (std::optional<Joint> one = plain ? as_one(chain) : std::nullopt) {
      for (const PlacedJoint& each : chain)
        one->name += (one->name.empty() ? "" : " + ") + each.name;
      one->first = body;
      one->second = on;
      draft_.add(std::move(*one),
                 fmt::format("{} joints from line {} on", chain.size(), chain.front().line));
      return;
    }
    remarks_.add(fmt::format("small bodies between joints in a row ({:g} of the mass)", kSmallBody),
                 part.name);
    int below = on;
    for (std::size_t k = 0; k < chain.size(); ++k) {
      const int above = k + 1 < chain.size() ? add_between(part, body, k + 1) : body;
      add_joint(chain[k], above, below);
      below = above;
    }
  }
  void add_joint(const PlacedJoint& placed, int first, int second) {
    Joint joint;
    joint.kind = placed.kind.value_or(joint.kind);
    joint.name = placed.name;
    joint.first = first;
    joint.second = second;
    joint.at = placed.at;
    joint.axis = placed.axis;
    std::string comment = fmt::format("line {}", placed.line);
    const bool is_ball = joint.kind == JointKind::ball, one_way = placed.has_coordinate();
    if (one_way && placed.value != 0) comment += fmt::format("; 0 here is {} there", placed.value);
    if (one_way)
      add_laws(placed, joint);
    else
      name_lost_laws(placed, is_ball);
    if ((one_way || is_ball) && (placed.stiffness > 0 || placed.damping > 0))
      joint.spring =
          JointSpring{placed.stiffness, placed.damping, one_way ? placed.rest - placed.value : 0};
    draft_.add(std::move(joint), std::move(comment));
  }
  void add_laws(const PlacedJoint& placed, Joint& joint) {
    if (!options_.joint_laws) return;
    joint.friction = placed.friction;
    if (!placed.limits) return;
    const double lower = placed.limits->first - placed.value,
                 upper = placed.limits->second - placed.value;
    if (!(lower <= 0 && upper >= 0 && lower < upper))
      return remarks_.add("limits that the start is beyond", placed.name);
    if (!has_wide_limits(placed)) joint.limits = JointLimits{lower, upper, 0};
  }
  /// A body that hardly weighs anything, between two joints of `part`.
  int add_between(const Part& part, int body, std::size_t number) {
    const Body& carried = scene_.bodies[at(body)];
    Body small;
    small.name = fmt::format("{} joint {}", carried.name, number);
    small.mass = kSmallBody * carried.mass;
    small.inertia = kSmallBody * part.inertia_about_joints() * Matrix3d::Identity();
    small.position = carried.position;
    small.orientation = carried.orientation;
    return draft_.add(
        std::move(small),
        fmt::format("between two joints of \"{}\"; {:g} of its mass", part.name, kSmallBody));
  }
  /// Laws of a joint without a coordinate; `sprung`: it has springs and dampers all the same.
  void name_lost_laws(const LinkJoint& law, bool sprung) {
    for (const auto& [has, word] : {std::pair(law.friction > 0, "friction"),
                                    {law.damping > 0 && !sprung, "damping"},
                                    {law.stiffness > 0 && !sprung, "stiffness"},
                                    {law.limits.has_value(), "limits"}})
      if (has) remarks_.add(fmt::format("{} of balls, free and planar joints", word), law.name);
  }

  struct Side {
    int body = -1;  // -1: the world
    Isometry3d pose = Isometry3d::Identity();
  };
  std::optional<Side> side_of(const std::string& link) const {
    if (link == "world") return Side();
    for (std::size_t k = 0; k < parts_.size(); ++k) {
      const Part& part = parts_[k];
      const auto found = std::find(part.links.begin(), part.links.end(), link);
      if (found == part.links.end() || part.gone || part.scenery) continue;
      const auto place = static_cast<std::size_t>(found - part.links.begin());
      return Side{body_of_[k], part.pose * part.places[place]};
    }
    return {};
  }
  /// Adds a ball or fixed joint for each closure of the model, at the start.
  void add_closures() {
    for (const Closure& each : model_.closures) {
      const std::optional<Side> first = side_of(each.first), second = side_of(each.second);
      if (!first || !second || first->body == second->body ||
          (is_fixed(first->body) && is_fixed(second->body))) {
        remarks_.add("equalities of bodies that do not move against each other", each.name);
        continue;
      }
      Joint joint;
      joint.kind = each.kind;
      joint.name = each.name;
      joint.first = first->body;
      joint.second = second->body;
      joint.at = first->pose * each.at;
      if (joint.first < 0) std::swap(joint.first, joint.second);
      draft_.add(std::move(joint), fmt::format("line {}, closes a loop", each.line));
    }
    const auto is_moved = [](const Part& part) {
      return any_of(part.joints, [](const PlacedJoint& joint) {
        return joint.value != joint.reference && joint.has_coordinate();
      });
    };
    if (!model_.closures.empty() && any_of(parts_, is_moved))
      remarks_.add("loops are closed where the joints start, not where the file has them at zero");
  }

  using BodyPair = std::pair<int, int>;  // the smaller one first
  struct Material {
    std::string name;
    std::vector<int> bodies;
  };
  using Materials = std::map<Touch, Material>;
  /// Bodies that pass through each other because a joint connects them.
  std::set<BodyPair> joined() const {
    std::set<BodyPair> out;
    for (const Joint& joint : scene_.joints)
      if (joint_rows(joint) >= 3 && joint.second >= 0)
        out.insert(std::minmax(joint.first, joint.second));
    return out;
  }
  /// Those that the file excludes, and neighbours in its tree, where no joint does so.
  std::set<BodyPair> apart(const std::set<BodyPair>& joined) const {
    std::map<std::string, int> named;
    for (std::size_t k = 0; k < parts_.size(); ++k)
      for (const std::string& link : parts_[k].links)
        if (!parts_[k].scenery) named.emplace(link, body_of_[k]);
    std::set<BodyPair> out;
    const auto add = [&](int a, int b) {
      const BodyPair pair = std::minmax(a, b);
      if (a >= 0 && b >= 0 && a != b && joined.count(pair) == 0) out.insert(pair);
    };
    for (const auto& [first, second] : model_.excluded) {
      const auto a = named.find(first), b = named.find(second);
      if (a != named.end() && b != named.end())
        add(a->second, b->second);
      else
        remarks_.add("<exclude> of the world, or of a body without mass", first + " and " + second);
    }
    for (std::size_t k = 0; k < parts_.size(); ++k)
      if (parts_[k].parent >= 0) add(body_of_[k], body_of_[at(parts_[k].parent)]);
    return out;
  }
  /// Bodies that touch alike have one material; those that pass through single others have their
  /// own.
  void add_contacts() {
    const bool is_mjcf = model_.format == Format::mjcf;
    const std::set<BodyPair> joined = this->joined();
    std::set<BodyPair> apart;
    std::set<int> own;
    if (is_mjcf) apart = this->apart(joined);
    for (const auto& [a, b] : apart) own.insert({a, b});
    const bool touches_itself = is_mjcf && own.size() < kMostMaterials;

    Materials moving, still;
    for (std::size_t k = 0; k < parts_.size(); ++k) {
      const Part& part = parts_[k];
      // The base of a URDF is part of the robot, which does not touch itself.
      if (body_of_[k] < 0 || !part.touch || part.shapes.empty() || (part.fixed() && !is_mjcf))
        continue;
      Touch touch = *part.touch;
      if (touches_itself && own.count(body_of_[k]) > 0) touch.own = body_of_[k];
      add_to(part.fixed() ? still : moving, touch, body_of_[k]);
    }
    if (options_.ground) {
      Touch touch;
      touch.type = touch.affinity = std::numeric_limits<unsigned>::max();
      add_to(still, touch, 0);
    }
    std::map<int, const std::string*> material_of;
    for (const Materials* of : {&moving, &still})
      for (const auto& [touch, material] : *of)
        for (const int body : material.bodies) material_of[body] = &material.name;
    // How many pairs of bodies of two materials are joined.
    std::map<std::pair<std::string, std::string>, long> joints;
    for (const auto& [a, b] : joined)
      if (material_of.count(a) > 0 && material_of.count(b) > 0)
        ++joints[std::minmax(*material_of[a], *material_of[b])];
    // By MuJoCo's rules.
    const auto add = [&](const Materials::value_type& a, const Materials::value_type& b,
                         bool meet) {
      const Touch &first = a.first, &second = b.first;
      const auto n = static_cast<long>(a.second.bodies.size()),
                 m = static_cast<long>(b.second.bodies.size());
      Pair& pair = scene_.pairs.emplace_back();
      pair.first = a.second.name;
      pair.second = b.second.name;
      pair.touch =
          meet &&
          (&a == &b ? n * (n - 1) / 2 : n * m) > joints[std::minmax(pair.first, pair.second)] &&
          apart.count(std::minmax(first.own, second.own)) == 0 &&
          ((first.type & second.affinity) != 0 || (second.type & first.affinity) != 0);
      if (pair.touch && (first.tangential || second.tangential))
        pair.friction = std::max(first.friction, second.friction);
    };
    for (auto a = moving.begin(); a != moving.end(); ++a) {
      for (const auto& b : still) add(*a, b, true);
      for (auto b = a; b != moving.end(); ++b) add(*a, *b, touches_itself);
    }
    if (!any_of(scene_.pairs, [](const Pair& pair) { return pair.touch; }))
      return scene_.pairs.clear();
    for (const auto& [body, name] : material_of) scene_.bodies[at(body)].material = *name;
    if (!touches_itself)
      remarks_.add("contacts of the robot with itself (touch = false in a [[pair]])");
  }
  void add_to(Materials& of, Touch touch, int body) {
    // Materials differ by what is asked of them only.
    if (options_.friction) {
      touch.friction = *options_.friction;
      touch.tangential = true;
    }
    auto found = of.find(touch);
    if (found == of.end() && of.size() >= kMostMaterials) {
      remarks_.add(fmt::format("kinds of contact beyond the first {} have the rule of the first",
                               kMostMaterials));
      found = of.begin();
    }
    if (found == of.end()) {
      std::string name = is_fixed(body) ? "ground" : "robot";
      if (!of.empty()) name += fmt::format(" {}", of.size() + 1);
      found = of.emplace(touch, Material{name, {}}).first;
    }
    found->second.bodies.push_back(body);
  }
  bool is_fixed(int body) const { return body < 0 || scene_.bodies[at(body)].fixed; }

  const Model& model_;
  const std::vector<Part>& parts_;
  const ImportOptions& options_;
  Remarks& remarks_;
  const std::set<std::string> common_;
  Draft draft_;
  Scene& scene_ = draft_.scene;
  std::vector<int> body_of_;  // of each part
};

}  // namespace

Draft make_draft(const Model& model, const std::vector<Part>& parts, const ImportOptions& options,
                 Remarks& remarks) {
  return Drafting(model, parts, options, remarks).take();
}

}  // namespace tether::scene::import
