// Tether: contacts of a set of bodies. SPDX-License-Identifier: BSD-3-Clause
#include "stepping/detection/near_contacts.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <tether/linalg/index.hpp>

#include "problem/refuse.hpp"
#include "stepping/detection/collide.hpp"

namespace tether::contact::detail {

using Eigen::Vector3d;

namespace {

using linalg::at;

bool moves(const BodySet& bodies, int body) { return bodies.mass[at(body)] > 0; }

// Surfaces of a contact, from its identity; see contact_id.
int first_surface(const PointContact& c) { return static_cast<int>(c.id >> 40); }
int second_surface(const PointContact& c) { return static_cast<int>(c.id >> 16 & 0xffffff); }

// Velocity of a moving surface against its body, at r from the centre of the body, in world axes.
Vector3d surface_velocity(const BodySet& bodies, const Surface& s, const Vector3d& r) {
  const linalg::Quaternion& q = bodies.orientation[at(s.body)];
  return q * s.velocity + (q * s.angular_velocity).cross(r);
}

void check(const Meeting& m) {
  if (m.first < 0 || m.second < 0 || !(m.friction >= 0) || !std::isfinite(m.friction) ||
      !(m.restitution >= 0 && m.restitution <= 1))
    throw std::invalid_argument(
        "meeting: materials must be >= 0, friction >= 0 and finite, restitution 0 .. 1");
  if (!(m.rolling >= 0 && m.torsional >= 0) || !std::isfinite(m.rolling + m.torsional))
    throw std::invalid_argument("meeting: rolling and torsional must be >= 0 and finite");
  if (!(m.friction_across.value_or(0) >= 0) || !std::isfinite(m.friction_across.value_or(0)))
    throw std::invalid_argument("meeting: friction_across must be >= 0 and finite");
  if (m.static_friction &&
      !(*m.static_friction >= m.friction && std::isfinite(*m.static_friction) &&
        (m.friction > 0 || !m.is_elliptic())))
    throw std::invalid_argument(
        "meeting: static_friction must be finite and at least friction, which must be > 0 with "
        "friction_across");
  if (m.is_elliptic() && m.first == m.second)
    throw std::invalid_argument(
        "meeting: friction_across is of two materials: the first one has the axis");
}

}  // namespace

Vector3d relative_velocity(const RigidBody& a, const RigidBody& b, const PointContact& c) {
  return a.velocity + a.angular_velocity.cross(c.r1) - b.velocity - b.angular_velocity.cross(c.r2);
}

double normal_velocity(const std::vector<RigidBody>& motion, const PointContact& c) {
  return c.normal.dot(relative_velocity(motion[at(c.first)], motion[at(c.second)], c));
}

NearContacts::NearContacts(const BodySet& bodies, std::vector<Surface> surfaces,
                           const std::vector<Meeting>& meetings, Law law, double near_part)
    : surfaces_(std::move(surfaces)),
      has_friction_(law != Law::frictionless),
      near_part_(near_part) {
  for (const Meeting& m : meetings) {
    check(m);
    meetings_[std::minmax({m.first, m.second})] = m;  // the last one of a pair counts
  }
  for (const auto& [materials, m] : meetings_)
    static_meetings_ += has_friction_ && m.static_friction.has_value();
  if (surfaces_.size() >= (1u << 24))
    throw std::invalid_argument("more than 16777215 surfaces");  // contact_id has 24 bits
  for (std::size_t k = 0; k < surfaces_.size(); ++k) add_surface(static_cast<int>(k), bodies);
  find_polyhedra(bodies);
  join_parts();
  take_axes();
  parts_.pose.resize(surfaces_.size());
  centre_.resize(bounded_.size());
  ball_.resize(bounded_.size());
  fixed_ = still_;
}

void NearContacts::add_surface(int k, const BodySet& bodies) {
  const Surface& s = surface(k);
  const std::string where = "surface " + std::to_string(k) + ": ";
  if (s.body < 0 || s.body >= bodies.size())
    throw std::invalid_argument(where + "names a body that does not exist");
  if (s.material < 0) throw std::invalid_argument(where + "material must be >= 0");
  if (!s.velocity.allFinite() || !s.angular_velocity.allFinite())
    throw std::invalid_argument(where + "velocity and angular_velocity must be finite");
  check(s.shape);
  const bool plane = s.shape.kind == ShapeKind::plane, mesh = s.shape.kind == ShapeKind::mesh;
  if ((plane || mesh) && moves(bodies, s.body))
    throw std::invalid_argument(where + "a " + name(s.shape.kind) + " belongs to a fixed body" +
                                (mesh ? "; one that moves has its convex_parts()" : ""));
  mesh_.push_back(mesh ? static_cast<int>(meshes_.size()) : -1);
  if (mesh) meshes_.emplace_back(s.shape);
  index_.push_back(plane ? ~static_cast<int>(planes_.size()) : static_cast<int>(bounded_.size()));
  (plane ? planes_ : bounded_).push_back(k);
  centred_.push_back(s.shape.kind == ShapeKind::sphere && s.shape.position.isZero(0));
  size_.push_back(form(s.shape.kind).reach(s.shape));
  if (plane) return;
  reach_.push_back(size_.back());
  still_.push_back(!moves(bodies, s.body));
}

void NearContacts::take_axes() {
  if (!any_elliptic()) return;
  axis_.resize(surfaces_.size());
  for (std::size_t k = 0; k < surfaces_.size(); ++k)
    if (!surfaces_[k].friction_axis.isZero(0)) with_axis_.push_back(static_cast<int>(k));
  for (const auto& [materials, m] : meetings_)
    for (std::size_t k = 0; k < surfaces_.size() && m.is_elliptic(); ++k)
      if (surfaces_[k].material == m.first && surfaces_[k].friction_axis.isZero(0))
        throw std::invalid_argument("surface " + std::to_string(k) +
                                    ": its material has elliptic friction, so that it needs a "
                                    "friction_axis");
}

// The axis along the normal has no direction there: any one is taken.
std::array<Vector3d, 2> NearContacts::scaled_tangents(const PointContact& c) const {
  const Meeting& m = meeting(c);
  const int first = first_surface(c);
  const int k = surface(first).material == m.first ? first : second_surface(c);
  Vector3d along = axis_[at(k)] - c.normal.dot(axis_[at(k)]) * c.normal;
  if (!(along.squaredNorm() > 0)) along = tangent_frame(c.normal).row(1);
  along.normalize();
  return {m.friction / m.largest_friction() * along,
          *m.friction_across / m.largest_friction() * c.normal.cross(along)};
}

void NearContacts::set_resting(const std::vector<char>& resting) {
  for (std::size_t k = 0; k < bounded_.size(); ++k)
    still_[k] = fixed_[k] != 0 || resting[at(surface(bounded_[k]).body)] != 0;
}

// Refuses pairs of kinds that can meet by their materials but for which no algorithm exists, and
// makes the polyhedra that the others need.
void NearContacts::find_polyhedra(const BodySet& bodies) {
  struct Kind {
    bool moves = false, polyhedra = false;
    std::vector<int> surfaces;
  };
  std::map<int, std::map<ShapeKind, Kind>> kinds;  // by material
  for (std::size_t k = 0; k < surfaces_.size(); ++k) {
    Kind& kind = kinds[surfaces_[k].material][surfaces_[k].shape.kind];
    kind.moves = kind.moves || moves(bodies, surfaces_[k].body);
    kind.surfaces.push_back(static_cast<int>(k));
  }
  for (const auto& [materials, m] : meetings_)
    for (auto& [a, of_a] : kinds[m.first])
      for (auto& [b, of_b] : kinds[m.second]) {
        const bool itself = &of_a == &of_b && of_a.surfaces.size() < 2;
        if (!(of_a.moves || of_b.moves) || itself) continue;
        if (!has_collision(a, b))
          throw std::invalid_argument(std::string("contact of ") + name(of_a.moves ? a : b) +
                                      " and " + name(of_a.moves ? b : a) + " is not supported");
        for (Kind* each : {&of_a, &of_b})
          each->polyhedra = each->polyhedra || meet_as_polyhedra(a, b);
      }
  parts_.polyhedron.resize(surfaces_.size());
  for (const auto& [material, list] : kinds)
    for (const auto& [kind, each] : list)
      if (each.polyhedra && is_polyhedron(kind))
        for (const int k : each.surfaces)
          parts_.polyhedron[at(k)] = make_polyhedron(surface(k).shape);
}

// Boxes and hulls of one body and material that lie against each other are parts of one solid.
void NearContacts::join_parts() {
  std::map<std::pair<int, int>, std::vector<int>> solids;  // by body and material
  for (int k = 0; k < static_cast<int>(surfaces_.size()); ++k)
    if (is_polyhedron(surface(k).shape.kind))
      solids[{surface(k).body, surface(k).material}].push_back(k);
  for (const auto& [body, numbers] : solids) {
    if (numbers.size() < 2) continue;
    std::vector<Polyhedron> shapes;
    std::vector<Pose> on_body;
    for (const int k : numbers) {
      const Shape& s = surface(k).shape;
      shapes.push_back(make_polyhedron(s));
      on_body.push_back({s.position, s.orientation.toRotationMatrix()});
    }
    parts_.join(numbers, std::move(shapes), on_body);
  }
}

const Meeting* NearContacts::meeting_of(int a, int b) const {
  const auto found = meetings_.find(std::minmax({surface(a).material, surface(b).material}));
  return found != meetings_.end() ? &found->second : nullptr;
}

const Meeting& NearContacts::meeting(const PointContact& c) const {
  return *meeting_of(first_surface(c), second_surface(c));
}

double NearContacts::size(const PointContact& c) const {
  return std::min(size_[at(first_surface(c))], size_[at(second_surface(c))]);
}

void NearContacts::set_pose(const BodySet& bodies, int surface) {
  const Surface& s = surfaces_[at(surface)];
  Pose& pose = parts_.pose[at(surface)];
  const linalg::Quaternion& q = bodies.orientation[at(s.body)];
  pose.position = bodies.position[at(s.body)];
  if (!s.shape.position.isZero(0)) pose.position += q * s.shape.position;
  if (s.shape.kind != ShapeKind::sphere)
    pose.rotation = (q * s.shape.orientation).toRotationMatrix();
}

void NearContacts::place(const BodySet& bodies, double dt) {
  for (int k = 0; k < static_cast<int>(surfaces_.size()); ++k) set_pose(bodies, k);
  for (const int k : with_axis_)
    axis_[at(k)] = bodies.orientation[at(surface(k).body)] * surface(k).friction_axis;
  for (std::size_t k = 0; k < bounded_.size(); ++k) {
    centre_[k] = parts_.pose[at(bounded_[k])].position;
    // Meshes add nothing to the margin: the size of the other shape decides.
    const double near = mesh_[at(bounded_[k])] < 0 ? near_part_ * reach_[k] : 0;
    ball_[k] = reach_[k] + near + way(bodies, k, dt);
  }
}

// Longest way of a point of bounded surface k in the step.
inline double NearContacts::way(const BodySet& bodies, std::size_t k, double dt) const {
  const Surface& s = surface(bounded_[k]);
  const RigidBody& b = bodies.motion[at(s.body)];
  const double arm = reach_[k] + s.shape.position.norm();
  return dt * (b.velocity.norm() + arm * b.angular_velocity.norm());
}

// Writes the near points of surfaces i and j into near_.
void NearContacts::find_points(int i, int j, double margin) {
  const Shape &s = surface(i).shape, &t = surface(j).shape;
  const Pose &S = parts_.pose[at(i)], &T = parts_.pose[at(j)];
  near_.count = 0;
  if (mesh_[at(j)] >= 0) return meshes_[at(mesh_[at(j)])].collide(s, S, T, margin, near_);
  if (mesh_[at(i)] >= 0) {
    meshes_[at(mesh_[at(i)])].collide(t, T, S, margin, near_);
    return turn(near_, 0);
  }
  const bool seams = parts_.has_seams(i) || parts_.has_seams(j);
  const bool points = s.kind == ShapeKind::points || t.kind == ShapeKind::points;
  if (meet_as_polyhedra(s.kind, t.kind) || (seams && points))
    return polyhedra_.collide(s, parts_.polyhedron[at(i)], S, t, parts_.polyhedron[at(j)], T,
                              margin, near_, parts_.seam(i), parts_.seam(j));
  collide(s, S, t, T, margin, near_);
}

// Serves round shapes on polyhedra, and polyhedra on meshes. A normal belongs to one point where
// the shape is a ball, and to all that lie flat otherwise; then the deepest point decides. Points
// at which the shape passes the edge of a part are none where the surface goes on in the plane.
void NearContacts::drop_seams(int i, int j) {
  const ShapeKind a = surface(i).shape.kind, b = surface(j).shape.kind;
  if ((!parts_.has_seams(i) && !parts_.has_seams(j)) || (is_polyhedron(a) && is_polyhedron(b)))
    return;
  const auto is_curved = [](ShapeKind k) { return form(k).family() == ShapeForm::Family::curved; };
  const bool on_mesh = a == ShapeKind::mesh || b == ShapeKind::mesh;
  const bool curved = !on_mesh && (is_curved(a) || is_curved(b));
  const double angle = on_mesh ? kTie : curved ? kNear : kUpright;
  const auto seam = [&](const NearPoint& p) {
    return parts_.is_seam(i, p.on_first, -p.normal, angle) ||
           parts_.is_seam(j, p.on_second, p.normal, angle);
  };
  const auto first = near_.point.begin();
  auto end = first + near_.count;
  if (near_.count > 0 && curved) {
    const auto deepest = std::min_element(
        first, end, [](const NearPoint& p, const NearPoint& q) { return p.gap < q.gap; });
    if (seam(*deepest)) end = first;
  } else {
    end = std::remove_if(first, end, seam);
  }
  const bool capsule = a == ShapeKind::capsule || b == ShapeKind::capsule;
  end = std::remove_if(first, end, [&](const NearPoint& p) {
    return (capsule ? p.feature >= kCapsuleOnEdge : p.feature >= kCut && p.feature < kNoCut) &&
           (parts_.goes_on(i, p.on_first, -p.normal) || parts_.goes_on(j, p.on_second, p.normal));
  });
  near_.count = static_cast<int>(end - first);
}

void NearContacts::pair(const BodySet& bodies, int a, int b, StepContacts& out) {
  const int i = bounded_[at(a)];
  // b < 0: plane ~b.
  const int j = b < 0 ? planes_[at(~b)] : bounded_[at(b)];
  const Surface &s = surface(i), &t = surface(j);
  if (s.body == t.body) return;
  const Meeting* const m = meeting_of(i, j);
  if (m == nullptr) return;
  double margin = ball_[at(a)] - reach_[at(a)];
  if (b >= 0) margin += ball_[at(b)] - reach_[at(b)];
  find_points(i, j, margin);
  if (!parts_.touching.empty() && b >= 0) drop_seams(i, j);
  // Impulses between two bodies act at one point, halfway: at two points a gap apart, friction
  // would change their common angular momentum.
  const double part = moves(bodies, s.body) && moves(bodies, t.body) ? 0.5 : 0;
  const bool conveys = near_.count > 0 && (s.moves_on_body() || t.moves_on_body());
  for (int k = 0; k < near_.count; ++k) {
    const NearPoint& p = near_.point[k];
    if (!std::isfinite(p.gap))
      refuse(
          std::string("contact of ") + name(s.shape.kind) + " and " + name(t.shape.kind) + ": gap",
          p.gap, "must be finite");
    const Vector3d half = part * (p.on_second - p.on_first);
    PointContact c;
    c.first = s.body;
    c.second = t.body;
    // For a sphere about the centre of its body the arm is along the normal to the last bit, so
    // that normal forces have no moment.
    c.r1 = centred_[at(i)] ? Vector3d(-(s.shape.radius + part * p.gap) * p.normal)
                           : Vector3d(p.on_first + half - bodies.position[at(s.body)]);
    c.r2 = centred_[at(j)] ? Vector3d((t.shape.radius + part * p.gap) * p.normal)
                           : Vector3d(p.on_second - half - bodies.position[at(t.body)]);
    c.normal = p.normal;
    c.mu = has_friction_ ? m->largest_friction() : 0;
    if (conveys) {
      c.slip = surface_velocity(bodies, s, c.r1) - surface_velocity(bodies, t, c.r2);
      c.slip -= c.normal.dot(c.slip) * c.normal;
    }
    c.id = contact_id(i, j, p.feature);
    out.points.push_back(c);
    out.gaps.push_back(p.gap);
  }
}

// Adds contacts of all near pairs, of two bounded surfaces or of one and a plane, for which
// use(first, second) is true.
template <class Use>
void NearContacts::pairs(const BodySet& bodies, StepContacts& out, const Use& use) {
  for (int p = 0; p < static_cast<int>(planes_.size()); ++p) {
    const Pose& plane = parts_.pose[at(planes_[at(p)])];
    const Vector3d n = plane.rotation * surface(planes_[at(p)]).shape.normal;
    for (int k = 0; k < static_cast<int>(bounded_.size()); ++k)
      if (!still_[at(k)] && use(k, k) && n.dot(centre_[at(k)] - plane.position) < ball_[at(k)])
        pair(bodies, k, ~p, out);
  }
  broadphase_.pairs(centre_, ball_, still_, [&](int a, int b) {
    if (use(a, b)) pair(bodies, a, b, out);
  });
}

void NearContacts::find(const BodySet& bodies, double dt, StepContacts& out) {
  out.points.clear();
  out.gaps.clear();
  place(bodies, dt);
  pairs(bodies, out, [](int, int) { return true; });
}

void NearContacts::follow(const BodySet& bodies, const PointContact& c, StepContacts& out) {
  out.points.clear();
  out.gaps.clear();
  const int i = first_surface(c), j = second_surface(c);
  const Pose first = parts_.pose[at(i)], second = parts_.pose[at(j)];
  set_pose(bodies, i);
  set_pose(bodies, j);
  pair(bodies, index_[at(i)], index_[at(j)], out);
  parts_.pose[at(i)] = first;
  parts_.pose[at(j)] = second;
}

bool NearContacts::find_more(const BodySet& bodies, double dt, StepContacts& out) {
  faster_.assign(bounded_.size(), 0);
  bool any = false;
  for (std::size_t k = 0; k < bounded_.size(); ++k) {
    if (still_[k]) continue;
    const double now = way(bodies, k, dt);
    if (!(reach_[k] + now > ball_[k])) continue;
    faster_[k] = 1;
    any = true;
    ball_[k] = reach_[k] + near_part_ * reach_[k] + now;
  }
  if (!any) return false;
  more_.points.clear();
  more_.gaps.clear();
  pairs(bodies, more_, [&](int a, int b) { return faster_[at(a)] || faster_[at(b)]; });
  known_.clear();
  for (const PointContact& c : out.points) known_.push_back(c.id);
  std::sort(known_.begin(), known_.end());
  const std::size_t before = out.points.size();
  for (std::size_t k = 0; k < more_.points.size(); ++k) {
    const PointContact& c = more_.points[k];
    if (more_.gaps[k] + dt * normal_velocity(bodies.motion, c) > -near_part_ * size(c) ||
        std::binary_search(known_.begin(), known_.end(), c.id))
      continue;
    out.points.push_back(c);
    out.gaps.push_back(more_.gaps[k]);
  }
  return out.points.size() > before;
}

}  // namespace tether::contact::detail
