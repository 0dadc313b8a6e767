// Tether: the motion of a model while its closed contacts stay as they are.
// SPDX-License-Identifier: BSD-3-Clause
#include "motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::scene::event {

namespace {

constexpr double kRank = 1e-10;  // of rows of unit length
constexpr double kStill = 1e-3;  // speeds and accelerations in the units of the model

}  // namespace

Motion::Motion(Model& model, double speed)
    : model_(model),
      speed_(speed),
      nq_(model.coordinates()),
      nu_(model.velocities()),
      tangents_(model.tangents()),
      modes_(index(model.contacts())),
      joints_(model.joint_rows()) {
  u_.setZero(nu_);
  a_.setZero(nu_);
}

void Motion::set(double t, const double* y) {
  model_.set(t, y, y + nq_);
  u_ = Eigen::Map<const VectorXd>(y + nq_, nu_);
}

VectorXd Motion::slip_of(const ContactLook& look) const {
  return look.tangents * u_ + look.slip_rate;
}

void Motion::choose(double t, const VectorXd& y, std::vector<ContactMode> modes) {
  modes_ = std::move(modes);
  closed_.clear();
  for (int i = 0; i < model_.contacts(); ++i)
    if (modes_[index(i)].mode != Mode::open) closed_.push_back(i);
  looks_.resize(closed_.size());
  row_of_.resize(closed_.size());
  rows_ = joints_;
  for (std::size_t k = 0; k < closed_.size(); ++k) {
    row_of_[k] = rows_;
    rows_ += modes_[index(closed_[k])].mode == Mode::stick ? 1 + tangents_ : 1;
  }
  works_ = model_.does_work();
  for (const int i : closed_)
    works_ = works_ || (modes_[index(i)].mode == Mode::slide && model_.law(i).friction > 0);
  R_.setZero(rows_, nu_);
  C_.setZero(nu_, rows_);
  r_.setZero(rows_);
  lambda_.setZero(rows_);
  set(t, y.data());
  gather();
  const int rank = choose_rows();
  VectorXd y_rate(size());
  rate(t, y.data(), y_rate.data());
  // Of what stands still energy is known to rounding only, and says nothing of the state.
  keeps_energy_ = rank < nu_ && a_.norm() + u_.norm() > kStill;
}

// Rows, columns and what is left of the second derivatives, at the state that is set.
void Motion::gather() {
  if (joints_ > 0) {
    model_.joints(joint_g_, joint_W_, joint_rate_, joint_rest_);
    R_.topRows(joints_) = joint_W_;
    C_.leftCols(joints_) = joint_W_.transpose();
    r_.head(joints_) = joint_rest_;
  }
  smallest_slip_ = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < closed_.size(); ++k) {
    const int row = row_of_[k];
    ContactLook& look = looks_[k];
    model_.look(closed_[k], look);
    const ContactMode& mode = modes_[index(closed_[k])];
    R_.row(row) = look.normal;
    C_.col(row) = look.normal.transpose();
    r_[row] = look.normal_rest;
    if (mode.mode == Mode::stick) {
      R_.middleRows(row + 1, tangents_) = look.tangents;
      C_.middleCols(row + 1, tangents_) = look.tangents.transpose();
      r_.segment(row + 1, tangents_) = look.slip_rest;
      continue;
    }
    const double mu = model_.law(closed_[k]).friction;
    if (mu == 0) continue;
    // Slip that ends passes through zero within a step: its direction stays.
    VectorXd s = slip_of(look);
    const double along = s.dot(mode.direction);
    if (along < speed_) s += (speed_ - along) * mode.direction;
    smallest_slip_ = std::min(smallest_slip_, s.norm());
    C_.col(row) -= mu / s.norm() * look.tangents.transpose() * s;
  }
}

// The number of independent ones.
int Motion::choose_rows() {
  positions_in_use_.clear();
  rates_in_use_.clear();
  row_scale_.setOnes(rows_);
  hyperstatic_ = false;
  if (rows_ == 0) return 0;
  MC_ = R_.transpose();
  model_.divide_by_mass(MC_);
  for (int i = 0; i < rows_; ++i) {
    const double square = R_.row(i).dot(MC_.col(i));
    row_scale_[i] = square > 0 ? 1 / std::sqrt(square) : 0;
  }
  // Joints come first, then normals, then tangents: the earlier row is kept.
  std::vector<int> normals, order;
  for (int i = 0; i < joints_; ++i) order.push_back(i);
  for (const int row : row_of_) order.push_back(row);
  const std::size_t positions = order.size();
  for (std::size_t k = 0; k < closed_.size(); ++k)
    if (modes_[index(closed_[k])].mode == Mode::stick)
      for (int j = 1; j <= tangents_; ++j) order.push_back(row_of_[k] + j);
  // Gram and Schmidt in the metric of the masses, twice.
  MatrixXd basis(nu_, rows_), dual(nu_, rows_);
  int rank = 0, rank_of_joints = 0;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const int row = order[k];
    VectorXd v = row_scale_[row] * R_.row(row).transpose();
    for (int pass = 0; pass < 2; ++pass)
      v -= basis.leftCols(rank) * (dual.leftCols(rank).transpose() * v);
    MatrixXd w = v;
    model_.divide_by_mass(w);
    const double length = std::sqrt(std::max(0.0, v.dot(w.col(0))));
    if (length < 1e-6) continue;
    basis.col(rank) = v / length;
    dual.col(rank) = w.col(0) / length;
    ++rank;
    if (row < joints_) ++rank_of_joints;
    if (k < positions) positions_in_use_.push_back(row);
    rates_in_use_.push_back(row);
  }
  hyperstatic_ = rank - rank_of_joints < rows_ - joints_;
  return rank;
}

void Motion::rate(double t, const double* y, double* y_rate) {
  ++evaluations_;
  set(t, y);
  gather();
  model_.forces(h_);
  a_ = h_;
  model_.divide_by_mass(a_);
  if (rows_ > 0) {
    MC_ = C_;
    model_.divide_by_mass(MC_);
    for (int i = 0; i < rows_; ++i) MC_.col(i) *= row_scale_[i];
    K_.noalias() = row_scale_.asDiagonal() * R_ * MC_;
    VectorXd right = -row_scale_.cwiseProduct(r_ + R_ * a_);
    factor_.setThreshold(kRank);
    factor_.compute(K_);
    const VectorXd scaled = factor_.solve(right);
    a_.noalias() += MC_ * scaled;
    lambda_ = row_scale_.cwiseProduct(scaled);
  }
  model_.rates(y_rate);
  Eigen::Map<VectorXd>(y_rate + nq_, nu_) = a_;
  double power = model_.power();
  for (int i = 0; i < joints_; ++i) power -= lambda_[i] * joint_rate_[i];
  for (std::size_t k = 0; k < closed_.size(); ++k)
    if (modes_[index(closed_[k])].mode == Mode::slide)
      power += friction_force(static_cast<int>(k)).dot(slip_of(looks_[k]));
  y_rate[work()] = power;
}

VectorXd Motion::friction_force(int closed) const {
  const int row = row_of_[index(closed)];
  const ContactMode& mode = modes_[index(closed_[index(closed)])];
  if (mode.mode == Mode::stick) return lambda_.segment(row + 1, tangents_);
  const double mu = model_.law(closed_[index(closed)]).friction;
  VectorXd s = slip_of(looks_[index(closed)]);
  if (mu == 0) return VectorXd::Zero(tangents_);
  const double along = s.dot(mode.direction);
  if (along < speed_) s += (speed_ - along) * mode.direction;
  return -mu * lambda_[row] / s.norm() * s;
}

}  // namespace tether::scene::event
