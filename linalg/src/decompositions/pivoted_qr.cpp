// Tether: dense orthogonal factors with chosen columns. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/QR>
#include <tether/linalg/pivoted_qr.hpp>

namespace tether::linalg {

struct PivotedQr::Factors {
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> of;
};

PivotedQr::PivotedQr(double threshold) : factors_(std::make_unique<Factors>()) {
  if (threshold > 0) factors_->of.setThreshold(threshold);
}
PivotedQr::PivotedQr(PivotedQr&&) noexcept = default;
PivotedQr& PivotedQr::operator=(PivotedQr&&) noexcept = default;
PivotedQr::~PivotedQr() = default;

void PivotedQr::factor(MatrixView A) { factors_->of.compute(A); }
int PivotedQr::rank() const { return static_cast<int>(factors_->of.rank()); }
MatrixView PivotedQr::R() const { return factors_->of.matrixR(); }

std::vector<int> PivotedQr::order() const {
  const auto& indices = factors_->of.colsPermutation().indices();
  return std::vector<int>(indices.data(), indices.data() + indices.size());
}

MatrixX PivotedQr::Q() const {
  const Eigen::Index n = factors_->of.rows();
  return Eigen::MatrixXd(factors_->of.householderQ() * Eigen::MatrixXd::Identity(n, n));
}

MatrixX PivotedQr::left_null_space() const {
  return Q().rightCols(factors_->of.rows() - factors_->of.rank());
}

}  // namespace tether::linalg
