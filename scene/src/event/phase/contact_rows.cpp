// Tether: contacts as rows, and what their forces do through the joints. SPDX-License-Identifier:
// BSD-3-Clause
#include "contact_rows.hpp"

#include <algorithm>
#include <cmath>

namespace tether::scene::event {

using linalg::at;

namespace {

constexpr double kDependentJoints = 1e-11;
constexpr double kHeldMoment = 1e-10;  // of the mobility without joints

}  // namespace

ContactRows::ContactRows(Model& model, std::vector<int> contacts)
    : model_(model),
      contacts_(std::move(contacts)),
      block_(1 + model.tangents()),
      factor_(kDependentJoints) {
  const int n = block_ * static_cast<int>(contacts_.size());
  L_.resize(n, model.velocities());
  rate_.resize(n);
  rest_.resize(n);
  ContactLook look;
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    const int row = block_ * static_cast<int>(k);
    model.look(contacts_[k], look);
    L_.row(row) = look.normal;
    rate_[row] = look.normal_rate;
    rest_[row] = look.normal_rest;
    L_.middleRows(row + 1, block_ - 1) = look.tangents;
    rate_.segment(row + 1, block_ - 1) = look.slip_rate;
    rest_.segment(row + 1, block_ - 1) = look.slip_rest;
  }
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
  find_holders();
  if (!holders_.empty() && G_.rows() > 0) free_held_moments();
  complete();
}

bool ContactRows::is_bounded(int k) const { return model_.law(contacts_[at(k)]).is_bounded(); }

void ContactRows::find_holders() {
  const auto begin = contacts_.begin();
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    const int by = model_.law(contacts_[k]).held_by;
    if (by < 0) continue;
    holders_.resize(contacts_.size(), -1);
    holders_[k] = static_cast<int>(std::find(begin, contacts_.end(), by) - begin);
  }
}

// Moments about axes that joints hold do nothing: what is left of them is rounding.
void ContactRows::free_held_moments() {
  MatrixXd alone = L_.transpose();
  model_.divide_by_mass(alone);
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    if (holders_[k] < 0) continue;
    const int row = block_ * static_cast<int>(k);
    double most = 0;
    for (int i = row + 1; i < row + block_; ++i) most = std::max(most, L_.row(i).dot(alone.col(i)));
    for (int i = row + 1; i < row + block_; ++i) {
      if (A_(i, i) > kHeldMoment * most) continue;
      A_.row(i).setZero();
      A_.col(i).setZero();
      PL_.col(i).setZero();
      A_(i, i) = most;
    }
  }
}

void ContactRows::complete() {
  for (int k = 0; k < static_cast<int>(contacts_.size()); ++k) {
    const int row = block_ * k, there = has_normal(k) ? row : row + 1;
    for (int i = row; i < row + block_; ++i)
      if (L_.row(i).isZero(0)) A_(i, i) = A_(there, there);
  }
}

// Rows of unit length: which of them depend on others hangs on no mass.
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
