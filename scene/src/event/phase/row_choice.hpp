// Tether: rows that do not depend on each other. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/linalg/pivoted_qr.hpp>
#include <vector>

#include "event/model/model.hpp"

namespace tether::scene::event {

constexpr double kIndependentRow = 1e-6;  // of rows of unit length

/// Rows that the earlier ones do not imply, in the metric of the masses; Gram and Schmidt, twice.
class IndependentRows {
 public:
  IndependentRows(const Model& model, int velocities, int rows)
      : model_(model),
        basis_(velocities, std::min(velocities, rows)),
        dual_(velocities, std::min(velocities, rows)) {}
  int rank() const { return rank_; }

  /// Whether the row, of length 1, adds to those before it.
  bool add(VectorXd v) {
    if (rank_ == basis_.cols()) return false;
    for (int pass = 0; pass < 2; ++pass)
      v -= basis_.leftCols(rank_) * (dual_.leftCols(rank_).transpose() * v);
    MatrixXd w = v;
    model_.divide_by_mass(w);
    const double length = std::sqrt(std::max(0.0, v.dot(w.col(0))));
    if (length < kIndependentRow) return false;
    basis_.col(rank_) = v / length;
    dual_.col(rank_) = w.col(0) / length;
    ++rank_;
    return true;
  }

 private:
  const Model& model_;
  MatrixXd basis_, dual_;
  int rank_ = 0;
};

/// Rows (given as columns) that imply all others. Independence is measured in the metric of the
/// projection. In that of the masses a body that is thin about an axis would count as held about it
/// by rows that hardly turn it.
struct RowChoice {
  std::vector<int> rows;  // ascending
  double least = 1;       // what a row added to the others, of its length

  explicit RowChoice(MatrixXd columns) {
    const Eigen::RowVectorXd lengths = columns.colwise().norm().cwiseMax(1e-300);
    columns *= lengths.cwiseInverse().asDiagonal();
    linalg::PivotedQr qr;
    qr.factor(columns);
    const linalg::MatrixView R = qr.R();
    const std::vector<int> order = qr.order();
    for (Eigen::Index k = 0; k < std::min(R.rows(), R.cols()); ++k) {
      const double left = std::abs(R(k, k));
      if (left < kIndependentRow) break;
      least = std::min(least, left);
      rows.push_back(order[static_cast<std::size_t>(k)]);
    }
    std::sort(rows.begin(), rows.end());
  }
};

}  // namespace tether::scene::event
