// Tether: the Delassus matrix of bodies in contact (method, eq. 1). SPDX-License-Identifier:
// BSD-3-Clause
#include <tether/contact/bodies.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <stdexcept>
#include <string>
#include <tether/linalg/index.hpp>
#include <tether/linalg/symmetric_eigen.hpp>

#include "problem/body_form.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {

using linalg::at;

Matrix6d RigidBody::inverse_mass_matrix() const {
  Matrix6d out = Matrix6d::Zero();
  out.diagonal().head<3>().setConstant(inverse_mass);
  out.bottomRightCorner<3, 3>() = inverse_inertia;
  return out;
}

Vector6d RigidBody::velocities() const {
  Vector6d out;
  out << velocity, angular_velocity;
  return out;
}

void RigidBody::set_velocities(const Vector6d& v) {
  velocity = v.head<3>();
  angular_velocity = v.tail<3>();
}

Matrix6d detail::inverse_mass_root(const Matrix6d& inverse_mass) {
  using Plain = Eigen::Matrix<double, 6, 6>;
  const Eigen::LLT<Plain> cholesky((Plain(inverse_mass)));
  if (cholesky.info() == Eigen::Success) return Plain(cholesky.matrixL());
  const linalg::SymmetricEigen<6> eigen = linalg::symmetric_eigen(inverse_mass);
  return eigen.vectors * eigen.values.cwiseMax(0).cwiseSqrt().asDiagonal();
}

void detail::check(const std::vector<RigidBody>& bodies, const std::vector<ContactRows>& contacts) {
  for (std::size_t k = 0; k < bodies.size(); ++k) check(k, bodies[k]);
  const int n = static_cast<int>(bodies.size());
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const ContactRows& c = contacts[k];
    if (c.first < 0 || c.first >= n || c.second < -1 || c.second >= n || c.first == c.second) {
      throw std::invalid_argument("contact " + std::to_string(k) + " names bodies " +
                                  std::to_string(c.first) + " and " + std::to_string(c.second) +
                                  ": must be two of " + std::to_string(n) +
                                  ", the second one -1 for the world");
    }
    const auto where = [k] { return "contact " + std::to_string(k) + ": "; };
    if (!c.J1.allFinite()) require_finite("J1", c.J1, where());
    if (!c.J2.allFinite()) require_finite("J2", c.J2, where());
    if (!c.bias.allFinite()) require_finite("bias", c.bias, where());
  }
}

Eigen::Matrix3d tangent_frame(const Eigen::Vector3d& n) {
  // Duff et al., Building an orthonormal basis, revisited: no branch, no loss of accuracy.
  const double sign = std::copysign(1.0, n[2]), a = -1 / (sign + n[2]), b = n[0] * n[1] * a;
  Eigen::Matrix3d F;
  F.row(0) = n.transpose();
  F.row(1) << 1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0];
  F.row(2) << b, sign + n[1] * n[1] * a, -n[1];
  return F;
}

ContactRows ContactRows::at_point(int first, int second, const Eigen::Vector3d& r1,
                                  const Eigen::Vector3d& r2, const Eigen::Vector3d& normal,
                                  double mu) {
  detail::require(std::abs(normal.norm() - 1) < 1e-6, "length of normal", normal.norm(),
                  "must be 1 (to 1e-6)");
  detail::require_finite("r1", r1);
  detail::require_finite("r2", r2);
  ContactRows c;
  c.first = first;
  c.second = second;
  c.mu = mu;
  const Eigen::Matrix3d F = tangent_frame(normal);
  c.J1.leftCols<3>() = F;
  for (int r = 0; r < 3; ++r) c.J1.block<1, 3>(r, 3) = r1.cross(F.row(r).transpose()).transpose();
  if (second >= 0) {
    c.J2.leftCols<3>() = -F;
    for (int r = 0; r < 3; ++r)
      c.J2.block<1, 3>(r, 3) = -r2.cross(F.row(r).transpose()).transpose();
  }
  return c;
}

namespace {

std::shared_ptr<const detail::BodyForm> body_form(const std::vector<RigidBody>& bodies,
                                                  const std::vector<ContactRows>& contacts) {
  auto form = std::make_shared<detail::BodyForm>();
  form->nodes = 2 * static_cast<int>(bodies.size());
  std::vector<Matrix6d> C;
  for (const RigidBody& body : bodies)
    C.push_back(detail::inverse_mass_root(body.inverse_mass_matrix()));
  for (const ContactRows& c : contacts) {
    for (int body : {c.first, c.second}) {
      if (body < 0 || !bodies[at(body)].moves()) continue;
      const Matrix36d H = (body == c.first ? c.J1 : c.J2) * C[at(body)];
      for (int h = 0; h < 2; ++h) {
        linalg::PackedBlock block;
        detail::as_matrix(block) = H.block<3, 3>(0, 3 * h);
        form->add(2 * body + h, block);
      }
    }
    form->end_contact();
  }
  return form;
}

}  // namespace

Problem delassus(const std::vector<RigidBody>& bodies, const std::vector<ContactRows>& contacts) {
  detail::check(bodies, contacts);
  const int n = static_cast<int>(contacts.size());
  struct Side {
    int contact;
    const Matrix36d* J;
  };
  std::vector<std::vector<Side>> sides(bodies.size());
  Eigen::VectorXd b(3 * n), mu(n);
  for (int i = 0; i < n; ++i) {
    const ContactRows& c = contacts[at(i)];
    Eigen::Vector3d u = c.bias + c.J1 * bodies[at(c.first)].velocities();
    sides[at(c.first)].push_back({i, &c.J1});
    if (c.second >= 0) {
      u += c.J2 * bodies[at(c.second)].velocities();
      sides[at(c.second)].push_back({i, &c.J2});
    }
    b.segment<3>(3 * i) = -u;
    mu[i] = c.mu;
  }
  std::vector<MatrixBlock> blocks;
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    if (!bodies[k].moves()) continue;
    const Matrix6d inverse_mass = bodies[k].inverse_mass_matrix();
    for (const Side& p : sides[k]) {
      const Matrix36d JM = *p.J * inverse_mass;
      for (const Side& q : sides[k])
        blocks.push_back({p.contact, q.contact, JM * q.J->transpose()});
    }
  }
  Problem problem = Problem::sparse(3, std::move(blocks), b, mu);
  // Only where it may serve: rows of bodies are fewer than those of contacts.
  if (bodies.size() < contacts.size()) problem.set_body_form(body_form(bodies, contacts));
  return problem;
}

std::vector<Vector6d> velocities_after(const std::vector<RigidBody>& bodies,
                                       const std::vector<ContactRows>& contacts,
                                       const linalg::VectorView& impulses) {
  detail::check(bodies, contacts);
  if (impulses.size() != 3 * static_cast<Eigen::Index>(contacts.size())) {
    detail::refuse_size("impulses", impulses.size(), 3 * static_cast<Eigen::Index>(contacts.size()),
                        "3 for each contact");
  }
  detail::require_finite("impulses", impulses);
  std::vector<Vector6d> v;
  for (const RigidBody& body : bodies) v.push_back(body.velocities());
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const ContactRows& c = contacts[i];
    const Eigen::Vector3d x = impulses.segment<3>(3 * static_cast<Eigen::Index>(i));
    v[at(c.first)] += bodies[at(c.first)].inverse_mass_matrix() * (c.J1.transpose() * x);
    if (c.second >= 0)
      v[at(c.second)] += bodies[at(c.second)].inverse_mass_matrix() * (c.J2.transpose() * x);
  }
  return v;
}

}  // namespace tether::contact
