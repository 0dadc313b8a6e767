// Tether: derivatives of impacts with respect to masses, velocities and friction of bodies.
// SPDX-License-Identifier: BSD-3-Clause
//
// By the chain rule through A = J M^-1 J' and b = -(J v + bias) of the contact problem.
#include <tether/contact/derivative.hpp>
#include <tether/linalg/index.hpp>

#include "problem/refuse.hpp"

namespace tether::contact {

using linalg::at;
using linalg::VectorX;

struct detail::BodyDerivativeParts {
  std::vector<RigidBody> bodies;
  std::vector<ContactRows> contacts;
  Derivative solution;
  std::vector<Vector6d> momenta;  // J'x, of each body

  BodyDerivativeParts(const std::vector<RigidBody>& b, const std::vector<ContactRows>& c, Law law,
                      const linalg::VectorView& impulses, const DerivativeOptions& options)
      : bodies(b), contacts(c), solution(derivative(delassus(b, c), law, impulses, options)) {
    momenta = to_bodies(solution.impulses());
  }

  // The rows of contact i on a body; null: none.
  const Matrix36d* rows(std::size_t i, int body) const {
    return contacts[i].first == body    ? &contacts[i].J1
           : contacts[i].second == body ? &contacts[i].J2
                                        : nullptr;
  }
  // f(first row, body, rows of it) for both sides of each contact.
  template <class F>
  void each_side(const F& f) const {
    for (std::size_t i = 0; i < contacts.size(); ++i)
      for (int body : {contacts[i].first, contacts[i].second})
        if (body >= 0) f(3 * static_cast<Eigen::Index>(i), at(body), *rows(i, body));
  }
  // J'x
  std::vector<Vector6d> to_bodies(const VectorX& x) const {
    std::vector<Vector6d> out(bodies.size(), Vector6d::Zero());
    each_side([&](Eigen::Index row, std::size_t k, const Matrix36d& J) {
      out[k] += J.transpose() * x.segment<3>(row);
    });
    return out;
  }
  // J v
  VectorX to_rows(const std::vector<Vector6d>& v) const {
    VectorX out = VectorX::Zero(3 * static_cast<Eigen::Index>(contacts.size()));
    each_side([&](Eigen::Index row, std::size_t k, const Matrix36d& J) {
      out.segment<3>(row) += J * v[k];
    });
    return out;
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
  for (const Eigen::Vector3d& b : direction.bias) require_finite("bias", b);
  require_finite("mu", direction.mu);
}

const DerivativeReport& BodyDerivative::report() const { return parts_->solution.report(); }
const VectorX& BodyDerivative::impulses() const { return parts_->solution.impulses(); }

ImpactDirection BodyDerivative::forward(const BodyDirection& direction) const {
  const detail::BodyDerivativeParts& s = *parts_;
  s.check(direction);
  std::vector<Vector6d> moved(s.bodies.size(), Vector6d::Zero());  // dM^-1 J'x + dv
  ProblemDirection v;
  v.b = VectorX::Zero(impulses().size());
  v.mu = direction.mu;
  if (!direction.bodies.empty()) {
    std::vector<Vector6d> before;
    std::vector<std::vector<std::pair<Eigen::Index, const Matrix36d*>>> sides(s.bodies.size());
    s.each_side([&](Eigen::Index row, std::size_t k, const Matrix36d& J) {
      sides[k].emplace_back(row, &J);
    });
    for (std::size_t k = 0; k < moved.size(); ++k) {
      const Matrix6d of_inverse_mass = direction.bodies[k].inverse_mass_matrix();
      before.push_back(direction.bodies[k].velocities());
      moved[k] = of_inverse_mass * s.momenta[k] + before[k];
      if (of_inverse_mass.isZero(0)) continue;
      for (const auto& [row, J] : sides[k])
        for (const auto& [column, K] : sides[k]) {
          const Eigen::Matrix3d dA = *J * of_inverse_mass * K->transpose();
          for (int r = 0; r < 3; ++r)
            for (int c = 0; c < 3; ++c)
              v.A.push_back({static_cast<int>(row) + r, static_cast<int>(column) + c, dA(r, c)});
        }
    }
    v.b = -s.to_rows(before);
  }
  for (std::size_t i = 0; i < direction.bias.size(); ++i)
    v.b.segment<3>(3 * static_cast<Eigen::Index>(i)) -= direction.bias[i];
  const SolutionDirection found = s.solution.forward(v);
  ImpactDirection out{found.impulses, s.to_bodies(found.impulses), found.residual};
  for (std::size_t k = 0; k < moved.size(); ++k)
    out.velocities[k] = s.bodies[k].inverse_mass_matrix() * out.velocities[k] + moved[k];
  return out;
}

BodyDirection BodyDerivative::adjoint(const linalg::VectorView& impulses,
                                      const std::vector<Vector6d>& velocities) const {
  const detail::BodyDerivativeParts& s = *parts_;
  const std::size_t count = s.bodies.size();
  const Eigen::Index n = s.solution.impulses().size();
  detail::check_entries("impulses", impulses, n, "3 for each contact");
  if (!velocities.empty() && velocities.size() != count)
    detail::refuse_size("velocities", static_cast<Eigen::Index>(velocities.size()),
                        static_cast<Eigen::Index>(count), "one for each body");
  for (const Vector6d& v : velocities) detail::require_finite("velocities", v);
  // Gradients by dM^-1 J'x + dv of each body, by way of w and of v after the impact.
  std::vector<Vector6d> of_moved(count, Vector6d::Zero()), rows(count, Vector6d::Zero());
  VectorX of_x = VectorX::Zero(n);
  if (impulses.size() > 0) of_x = impulses;
  if (!velocities.empty()) {
    of_moved = velocities;
    for (std::size_t k = 0; k < count; ++k)
      rows[k] = s.bodies[k].inverse_mass_matrix() * velocities[k];
    of_x += s.to_rows(rows);
  }
  const ProblemDirection found = s.solution.adjoint(of_x);
  std::vector<Matrix6d> of_inverse_mass(count);
  for (std::size_t k = 0; k < count; ++k)
    of_inverse_mass[k] = of_moved[k] * s.momenta[k].transpose();
  for (const MatrixEntry& e : found.A) {
    const std::size_t i = at(e.row / 3), j = at(e.column / 3);
    for (int body : {s.contacts[i].first, s.contacts[i].second})
      if (const Matrix36d* K = body < 0 ? nullptr : s.rows(j, body))
        of_inverse_mass[at(body)] +=
            e.value * s.rows(i, body)->row(e.row % 3).transpose() * K->row(e.column % 3);
  }
  const std::vector<Vector6d> seen = s.to_bodies(found.b);
  BodyDirection out;
  for (std::size_t k = 0; k < count; ++k) {
    RigidBody& to = out.bodies.emplace_back();
    to.set_velocities(of_moved[k] - seen[k]);
    if (!s.bodies[k].moves()) continue;
    to.inverse_mass = of_inverse_mass[k].diagonal().head<3>().sum();
    const Eigen::Matrix3d I = of_inverse_mass[k].bottomRightCorner<3, 3>();
    to.inverse_inertia = 0.5 * (I + I.transpose());
  }
  out.mu = found.mu;
  for (Eigen::Index row = 0; row < n; row += 3) out.bias.emplace_back(-found.b.segment<3>(row));
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
