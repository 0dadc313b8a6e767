// Tether: dense least squares of least norm, rank revealed. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/QR>
#include <tether/linalg/least_squares.hpp>

namespace tether::linalg {

struct LeastSquares::Factors {
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> of;
};

LeastSquares::LeastSquares(double threshold) : factors_(std::make_unique<Factors>()) {
  if (threshold > 0) factors_->of.setThreshold(threshold);
}
LeastSquares::LeastSquares(const LeastSquares& other)
    : factors_(std::make_unique<Factors>(*other.factors_)) {}
LeastSquares::LeastSquares(LeastSquares&&) noexcept = default;
LeastSquares& LeastSquares::operator=(LeastSquares&&) noexcept = default;
LeastSquares::~LeastSquares() = default;

void LeastSquares::factor(MatrixView A) { factors_->of.compute(A); }
int LeastSquares::rank() const { return static_cast<int>(factors_->of.rank()); }

VectorX LeastSquares::solve(VectorView b) const {
  return Eigen::VectorXd(factors_->of.solve(Eigen::VectorXd(b)));
}
MatrixX LeastSquares::solve_columns(MatrixView B) const {
  return Eigen::MatrixXd(factors_->of.solve(Eigen::MatrixXd(B)));
}
VectorX LeastSquares::solve_transposed(VectorView c) const {
  return Eigen::VectorXd(factors_->of.transpose().solve(Eigen::VectorXd(c)));
}

}  // namespace tether::linalg
