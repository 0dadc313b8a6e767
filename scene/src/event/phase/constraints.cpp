// Tether: the constraints of the projection between events (method, eq. 3).
// SPDX-License-Identifier: BSD-3-Clause
//
// Gaps and joints, their rates, the slips of stuck contacts, the rows of the model itself, and
// energy less work.
#include <cmath>
#include <tether/linalg/least_squares.hpp>

#include "motion.hpp"

namespace tether::scene::event {

namespace {

constexpr double kDependentRows = 1e-10;  // of rows of unit length

}  // namespace

int Motion::constraint_count() const {
  return static_cast<int>(positions_in_use_.size() + rates_in_use_.size()) + model_.own_rows() +
         (keeps_energy_ ? 1 : 0);
}

void Motion::keep_energy_of(double t, const VectorXd& y) {
  set(t, y.data());
  kept_energy_ = model_.energy() - y[work()];
}

// Values of all rows at the state that is set; slips have no position.
void Motion::values_of_rows(VectorXd& positions, VectorXd& rates) {
  positions.setZero(rows_);
  gather();
  rates = R_ * u_;
  if (joints_ > 0) {
    positions.head(joints_) = joint_g_.head(joints_);
    rates.head(joints_) += joint_rate_.head(joints_);
  }
  for (std::size_t k = 0; k < closed_.size(); ++k) {
    const int row = row_of_[k], tangents = tangents_of(k);
    if (normals_of(k) > 0) {
      positions[row] = looks_[k].gap - levels_[index(closed_[k])];
      rates[row] += looks_[k].normal_rate;
    }
    rates.segment(row + normals_of(k), tangents) += looks_[k].slip_rate.head(tangents);
  }
}

void Motion::settle_velocities(double t, VectorXd& y) {
  if (rows_ == 0) return;
  set(t, y.data());
  VectorXd positions, rates;
  values_of_rows(positions, rates);
  MatrixXd columns = R_.transpose() * row_scale_.asDiagonal();
  const MatrixXd rows = columns.transpose();
  model_.divide_by_mass(columns);
  linalg::LeastSquares factor(kDependentRows);
  factor.factor(MatrixXd(rows * columns));
  const VectorXd forces = factor.solve(row_scale_.cwiseProduct(rates));
  y.segment(nq_, nu_) -= columns * forces;
  set(t, y.data());
}

void Motion::constraints(double t, const double* y, double* g) {
  set(t, y);
  VectorXd positions, rates;
  values_of_rows(positions, rates);
  for (const int row : positions_in_use_) *g++ = positions[row];
  for (const int row : rates_in_use_) *g++ = rates[row];
  model_.own_values(g);
  g += model_.own_rows();
  if (keeps_energy_) *g = model_.energy() - y[work()] - kept_energy_;
}

// Derivatives of the contacts of the body whose coordinate j is changed in the state set.
void Motion::differentiate_contacts(int j, double step, const VectorXd& rates, int first_rate,
                                    Eigen::Ref<Eigen::Matrix<double, -1, -1, Eigen::RowMajor>> C) {
  const int block = model_.velocity_block(), body = j / model_.coordinate_block();
  VectorXd now;
  for (std::size_t k = 0; k < closed_.size(); ++k) {
    const int row = row_of_[k], normals = normals_of(k), rows = normals + tangents_of(k);
    if (rows == 0 || R_.block(row, block * body, rows, block).isZero(0)) continue;
    ContactLook& look = looks_[k];
    model_.look(closed_[k], look);
    now.resize(rows);
    if (normals > 0) now[0] = look.normal.dot(u_) + look.normal_rate;
    now.tail(rows - normals) = (look.tangents * u_ + look.slip_rate).head(rows - normals);
    for (int r = 0; r < rows; ++r)
      if (const int place = rate_place_[index(row + r)]; place >= 0)
        C(first_rate + place, j) = (now[r] - rates[row + r]) / step;
  }
}

void Motion::constraint_gradient(double t, const double* y,
                                 Eigen::Ref<Eigen::Matrix<double, -1, -1, Eigen::RowMajor>> C) {
  set(t, y);
  VectorXd positions, rates, moved;
  values_of_rows(positions, rates);
  int out = 0;
  Eigen::RowVectorXd line(nu_);
  for (const int row : positions_in_use_) {
    line = R_.row(row);
    model_.to_coordinates(line.data(), C.row(out++).data());
  }
  const int first_rate = out;
  for (const int row : rates_in_use_) C.row(out++).segment(nq_, nu_) = R_.row(row);
  for (int k = 0; k < model_.own_rows(); ++k) model_.own_gradient(k, C.row(out++).data());
  if (keeps_energy_) {
    model_.energy_gradient(C.row(out).data(), C.row(out).data() + nq_);
    if (works_) C(out, work()) = -1;
  }
  if (rates_in_use_.empty() || u_.isZero(0)) return;
  // Rates by coordinates: differences, which Newton's moves onto the rows need not be better than.
  VectorXd near = Eigen::Map<const VectorXd>(y, size());
  for (int j = 0; j < nq_; ++j) {
    const double step = 1e-7 * std::max(1.0, std::abs(y[j]));
    near[j] = y[j] + step;
    set(t, near.data());
    near[j] = y[j];
    if (joints_ == 0) {
      differentiate_contacts(j, step, rates, first_rate, C);
      continue;
    }
    values_of_rows(positions, moved);
    for (std::size_t k = 0; k < rates_in_use_.size(); ++k)
      C(first_rate + static_cast<int>(k), j) =
          (moved[rates_in_use_[k]] - rates[rates_in_use_[k]]) / step;
  }
  set(t, y);
}

}  // namespace tether::scene::event
