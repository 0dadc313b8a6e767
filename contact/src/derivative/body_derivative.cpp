// Tether: derivatives of impacts with respect to masses, velocities and friction of bodies.
// SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/body_derivative.hpp>

#include "derivative/solution_derivative.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {

using detail::at;
using Eigen::Matrix3d;
using Eigen::Vector3d;

struct detail::BodyDerivativeParts {
  std::vector<RigidBody> bodies;
  std::vector<ContactRows> contacts;
  SolutionDerivative solution;
  std::vector<Vector6d> momenta;  // J'x, of each body

  BodyDerivativeParts(const std::vector<RigidBody>& b, const std::vector<ContactRows>& c, Law law,
                      const linalg::VectorView& impulses, const DerivativeOptions& options)
      : bodies(b), contacts(c), solution(delassus(b, c), law, impulses, options) {
    momenta = to_bodies(solution.x());
  }

  // f(contact, body, rows of it) for both sides of each contact.
  template <class F>
  void each_side(const F& f) const {
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      f(i, at(contacts[i].first), contacts[i].J1);
      if (contacts[i].second >= 0) f(i, at(contacts[i].second), contacts[i].J2);
    }
  }
  // J'x
  std::vector<Vector6d> to_bodies(const Packed& x) const {
    std::vector<Vector6d> out(bodies.size(), Vector6d::Zero());
    each_side([&](std::size_t i, std::size_t k, const Matrix36d& J) {
      out[k] += J.transpose() * Eigen::Map<const Vector3d>(x[i].v);
    });
    return out;
  }
  // out += J v
  void add_rows(const std::vector<Vector6d>& v, Packed& out) const {
    each_side([&](std::size_t i, std::size_t k, const Matrix36d& J) {
      Eigen::Map<Vector3d>(out[i].v) += J * v[k];
    });
  }
  void check(const BodyDirection& direction) const;
};

void detail::BodyDerivativeParts::check(const BodyDirection& direction) const {
  const auto count = [](const char* argument, std::size_t found, std::size_t needed,
                        const char* why) {
    if (found != 0 && found != needed)
      refuse_size(argument, static_cast<Eigen::Index>(found), static_cast<Eigen::Index>(needed),
                  why);
  };
  count("bodies", direction.bodies.size(), bodies.size(), "one for each body");
  count("bias", direction.bias.size(), contacts.size(), "one for each contact");
  count("mu", static_cast<std::size_t>(direction.mu.size()), contacts.size(),
        "one for each contact");
  for (std::size_t k = 0; k < direction.bodies.size(); ++k) {
    const std::string where = "body " + std::to_string(k) + ": change of ";
    const RigidBody& b = direction.bodies[k];
    require_finite("inverse_mass", Eigen::Matrix<double, 1, 1>(b.inverse_mass), where);
    require_finite("inverse_inertia", b.inverse_inertia, where);
    require_finite("velocity", b.velocity, where);
    require_finite("angular_velocity", b.angular_velocity, where);
    if (bodies[k].moves()) continue;
    if (b.inverse_mass != 0)
      refuse(where + "inverse_mass", b.inverse_mass, "must be 0: the body is fixed");
    if (!b.inverse_inertia.isZero(0))
      refuse(where + "inverse_inertia", b.inverse_inertia.cwiseAbs().maxCoeff(),
             "must be 0: the body is fixed");
  }
  for (const Vector3d& b : direction.bias) require_finite("bias", b);
  require_finite("mu", direction.mu);
}

const DerivativeReport& BodyDerivative::report() const { return parts_->solution.report(); }
const linalg::VectorX& BodyDerivative::impulses() const { return parts_->solution.impulses(); }

// dA x - db = J (dM^-1 J'x + dv) + dbias
ImpactDirection BodyDerivative::forward(const BodyDirection& direction) const {
  const detail::BodyDerivativeParts& s = *parts_;
  s.check(direction);
  const Problem& p = s.solution.problem();
  detail::DataChange change(s.contacts.size());
  std::vector<Vector6d> moved(s.bodies.size(), Vector6d::Zero());
  if (!direction.bodies.empty()) {
    for (std::size_t k = 0; k < moved.size(); ++k)
      moved[k] = direction.bodies[k].inverse_mass_matrix() * s.momenta[k] +
                 direction.bodies[k].velocities();
    s.add_rows(moved, change.shift);
    std::vector<Matrix3d> own(s.contacts.size(), Matrix3d::Zero());
    s.each_side([&](std::size_t i, std::size_t k, const Matrix36d& J) {
      own[i] += J * direction.bodies[k].inverse_mass_matrix() * J.transpose();
    });
    for (int i = 0; i < p.contacts(); ++i) change.add(i, p.local(i), own[at(i)], 0);
  }
  for (std::size_t i = 0; i < direction.bias.size(); ++i)
    Eigen::Map<Vector3d>(change.shift[i].v) += direction.bias[i];
  for (int i = 0; i < p.contacts() && direction.mu.size() > 0; ++i)
    change.add(i, p.local(i), Matrix3d::Zero(), direction.mu[i]);
  const detail::SolutionChange found = s.solution.forward(change);
  ImpactDirection out;
  out.residual = found.residual;
  p.unpack(found.x, out.impulses);
  out.velocities = s.to_bodies(found.x);
  for (std::size_t k = 0; k < moved.size(); ++k)
    out.velocities[k] = s.bodies[k].inverse_mass_matrix() * out.velocities[k] + moved[k];
  return out;
}

BodyDirection BodyDerivative::adjoint(const linalg::VectorView& impulses,
                                      const std::vector<Vector6d>& velocities) const {
  const detail::BodyDerivativeParts& s = *parts_;
  const Problem& p = s.solution.problem();
  const std::size_t n = s.contacts.size(), count = s.bodies.size();
  detail::check_entries("impulses", impulses, p.b().size(), "3 for each contact");
  if (!velocities.empty() && velocities.size() != count)
    detail::refuse_size("velocities", static_cast<Eigen::Index>(velocities.size()),
                        static_cast<Eigen::Index>(count), "one for each body");
  for (const Vector6d& v : velocities) detail::require_finite("velocities", v);
  // Gradients with respect to dM^-1 J'x + dv of each body, by way of w and of v after the impact.
  std::vector<Vector6d> of_moved(count, Vector6d::Zero()), rows(count, Vector6d::Zero());
  detail::SolutionChange of{detail::Packed(n), detail::Packed(n), 0};
  if (impulses.size() > 0) of.x = p.pack(impulses);
  if (!velocities.empty()) {
    of_moved = velocities;
    for (std::size_t k = 0; k < count; ++k)
      rows[k] = s.bodies[k].inverse_mass_matrix() * velocities[k];
    s.add_rows(rows, of.x);
  }
  const detail::DataChange found = s.solution.adjoint(of);
  const std::vector<Vector6d> seen = s.to_bodies(found.shift);
  std::vector<Matrix6d> of_inverse_mass(count);
  for (std::size_t k = 0; k < count; ++k) {
    of_moved[k] += seen[k];
    of_inverse_mass[k] = of_moved[k] * s.momenta[k].transpose();
  }
  s.each_side([&](std::size_t i, std::size_t k, const Matrix36d& J) {
    const int contact = static_cast<int>(i);
    of_inverse_mass[k] += J.transpose() * found.block_gradient(contact, p.local(contact)) * J;
  });
  BodyDirection out;
  for (std::size_t k = 0; k < count; ++k) {
    RigidBody& to = out.bodies.emplace_back();
    to.set_velocities(of_moved[k]);
    if (!s.bodies[k].moves()) continue;
    to.inverse_mass = of_inverse_mass[k].diagonal().head<3>().sum();
    const Matrix3d I = of_inverse_mass[k].bottomRightCorner<3, 3>();
    to.inverse_inertia = 0.5 * (I + I.transpose());
  }
  out.mu.resize(p.contacts());
  for (int i = 0; i < p.contacts(); ++i) {
    out.mu[i] = found.mu_gradient(i, p.local(i));
    out.bias.emplace_back(found.shift[at(i)].v[0], found.shift[at(i)].v[1],
                          found.shift[at(i)].v[2]);
  }
  return out;
}

BodyDerivative derivative(const std::vector<RigidBody>& bodies,
                          const std::vector<ContactRows>& contacts, Law law,
                          const linalg::VectorView& impulses, const DerivativeOptions& options) {
  return BodyDerivative(
      std::make_unique<detail::BodyDerivativeParts>(bodies, contacts, law, impulses, options));
}

BodyDerivative derivative(const std::vector<RigidBody>& bodies,
                          const std::vector<PointContact>& points, Law law,
                          const BodySolution& solution, const DerivativeOptions& options) {
  if (solution.impulses.size() != points.size())
    detail::refuse_size("solution.impulses", static_cast<Eigen::Index>(solution.impulses.size()),
                        static_cast<Eigen::Index>(points.size()), "one for each contact");
  linalg::VectorX impulses(3 * static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i)
    impulses.segment<3>(3 * static_cast<Eigen::Index>(i)) =
        tangent_frame(points[i].normal) * solution.impulses[i];
  DerivativeOptions with = options;
  with.replaced = solution.replaced;
  return derivative(bodies, to_contacts(points), law, impulses, with);
}

}  // namespace tether::contact
