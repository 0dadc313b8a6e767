// Tether: contacts as rows, and what their forces do through the joints. SPDX-License-Identifier:
// BSD-3-Clause
#include "contact_rows.hpp"

#include <algorithm>
#include <cmath>

namespace tether::scene::event {

using linalg::at;

ContactRows::ContactRows(Model& model, std::vector<int> contacts)
    : model_(model), contacts_(std::move(contacts)), factor_(kDependent) {
  take_rows();
  PL_ = L_.transpose();
  model.divide_by_mass(PL_);
  if (model.joint_rows() > 0) {
    VectorXd g, rate;
    model.joints(g, G_, rate, joint_rest_);
    MG_ = G_.transpose();
    model.divide_by_mass(MG_);
    look_at_joints();
    // With the forces of the joints: A = F' M^-1 F is never indefinite, and light bodies, whose
    // parts cancel in L P L', leave no rounding in it.
    const MatrixXd F = L_.transpose() - G_.transpose() * joint_solve(G_ * PL_);
    PL_ = F;
    model.divide_by_mass(PL_);
    A_ = F.transpose() * PL_;
  } else {
    A_ = L_ * PL_;
  }
  A_ = (0.5 * (A_ + A_.transpose())).eval();
  if (G_.rows() > 0) free_held();
}

// A limit has no slip, a bounded law and a moment have no normal of their own.
void ContactRows::take_rows() {
  std::vector<ContactKinematics> kinematics(contacts_.size());
  int rows = 0;
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    const ContactLaw law = model_.law(contacts_[k]);
    model_.evaluate_contact(contacts_[k], kinematics[k]);
    ConePart p;
    p.first = rows;
    p.slips = law.is_line() ? 1 : kinematics[k].tangents.isZero(0) ? 0 : model_.tangents();
    p.mu = law.is_bounded() ? 0 : law.friction;
    p.bound = std::max(0.0, law.bound);
    if (law.has_normal()) p.normal = rows;
    if (law.is_moment())
      p.normal =
          parts_[at(static_cast<int>(std::find(contacts_.begin(), contacts_.end(), law.held_by) -
                                     contacts_.begin()))]
              .first;
    parts_.push_back(p);
    rows += p.rows();
  }
  L_.resize(rows, model_.velocities());
  rate_.resize(rows);
  rest_.resize(rows);
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    const ConePart& p = parts_[k];
    if (p.has_normal()) {
      L_.row(p.first) = kinematics[k].normal;
      rate_[p.first] = kinematics[k].normal_rate;
      rest_[p.first] = kinematics[k].normal_rest;
    }
    L_.middleRows(p.slip(), p.slips) = kinematics[k].tangents.topRows(p.slips);
    p.slip_of(rate_) = kinematics[k].slip_rate.head(p.slips);
    p.slip_of(rest_) = kinematics[k].slip_rest.head(p.slips);
  }
}

VectorXd ContactRows::of(int k, const VectorXd& values) const {
  const ConePart& p = parts_[at(k)];
  VectorXd out = VectorXd::Zero(1 + model_.tangents());
  if (p.has_normal()) out[0] = values[p.first];
  out.segment(1, p.slips) = p.slip_of(values);
  return out;
}

// Bounded laws and moments about axes that joints hold do nothing: what is left of their mobility
// is rounding.
void ContactRows::free_held() {
  for (const ConePart& p : parts_) {
    if (p.has_normal()) continue;
    MatrixXd alone = L_.middleRows(p.first, p.slips).transpose();
    model_.divide_by_mass(alone);
    const double most =
        L_.middleRows(p.first, p.slips).cwiseProduct(alone.transpose()).rowwise().sum().maxCoeff();
    for (int i = p.first; i < p.first + p.slips; ++i) {
      if (A_(i, i) > kHeldByJoints * most) continue;
      A_.row(i).setZero();
      A_.col(i).setZero();
      PL_.col(i).setZero();
      A_(i, i) = most;
    }
  }
}

// Rows of unit length: whether one depends on others does not depend on masses.
void ContactRows::look_at_joints() {
  scale_.setOnes(G_.rows());
  for (int i = 0; i < G_.rows(); ++i) {
    const double square = G_.row(i).dot(MG_.col(i));
    if (square > 0) scale_[i] = 1 / std::sqrt(square);
  }
  factor_.factor(scale_.asDiagonal() * (G_ * MG_) * scale_.asDiagonal());
}

MatrixXd ContactRows::joint_solve(const MatrixXd& right) const {
  return scale_.asDiagonal() * MatrixXd(factor_.solve_columns(scale_.asDiagonal() * right));
}

VectorXd ContactRows::free_accelerations() {
  VectorXd a;
  model_.forces(a);
  model_.divide_by_mass(a);
  if (G_.rows() > 0) a -= MG_ * joint_solve(G_ * a + joint_rest_);
  return L_ * a + rest_;
}

}  // namespace tether::scene::event
