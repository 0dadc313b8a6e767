// Tether: projection onto many sparse rows, by the caller's own hand. SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <map>
#include <problems/sparse_projection.hpp>

namespace tether::problems {

SparseProjection::SparseProjection(SparseRows rows, const double* y0) : rows_(std::move(rows)) {
  const int m = rows_.count - 1;
  std::map<std::pair<int, int>, int> where;
  rows_.gradient(y0, [&](int i, int j, double) {
    const auto [found, fresh] = where.try_emplace({i, j}, static_cast<int>(where.size()));
    if (fresh) {
      row_.push_back(i);
      column_.push_back(j);
    }
    slot_.push_back(found->second);
  });
  // Entries that share a column meet in A A^T.
  std::vector<std::vector<int>> in_column(static_cast<std::size_t>(rows_.columns));
  for (std::size_t k = 0; k < row_.size(); ++k)
    in_column[static_cast<std::size_t>(column_[k])].push_back(static_cast<int>(k));
  const auto row = [this](int entry) { return row_[static_cast<std::size_t>(entry)]; };
  std::vector<Eigen::Triplet<double>> pattern;
  for (const auto& column : in_column)
    for (const int a : column)
      for (const int b : column)
        if (row(a) >= row(b)) pattern.emplace_back(row(a), row(b), 1.0);
  normal_.resize(m, m);
  normal_.setFromTriplets(pattern.begin(), pattern.end());
  normal_.makeCompressed();
  for (const auto& column : in_column)
    for (const int a : column)
      for (const int b : column)
        if (row(a) >= row(b))
          products_.push_back(
              {static_cast<int>(&normal_.coeffRef(row(a), row(b)) - normal_.valuePtr()), a, b});
  factor_.analyzePattern(normal_);
  entries_.setZero(static_cast<Eigen::Index>(row_.size()));
  D_.setZero(rows_.columns);
  for (Eigen::VectorXd* each : {&y_, &full_, &spread_}) each->setZero(rows_.columns);
  for (Eigen::VectorXd* each : {&coupling_, &multipliers_}) each->setZero(m);
  g_.setZero(rows_.count);
}

void SparseProjection::scale_from(const double* corrector) {
  double largest = 0.0;
  for (int j = 0; j < rows_.columns; ++j) {
    D_[j] = std::max(0.8 * D_[j], std::abs(corrector[j]));
    largest = std::max(largest, D_[j]);
  }
  // A corrector that changed nothing has no scale: all alike.
  if (!(largest > 0.0)) D_.setOnes();
  size_ = 1e-3 * (largest > 0.0 ? largest : 1.0);
}

bool SparseProjection::factor(const double* y) {
  entries_.setZero();
  std::size_t call = 0;
  rows_.gradient(y, [&](int, int, double entry) { entries_[slot_[call++]] += entry; });
  const auto metric = [this](Eigen::Index j) { return std::max(D_[j], size_); };
  for (Eigen::Index k = 0; k < entries_.size(); ++k)
    entries_[k] *= metric(column_[static_cast<std::size_t>(k)]);
  std::fill(normal_.valuePtr(), normal_.valuePtr() + normal_.nonZeros(), 0.0);
  for (const Product& product : products_)
    normal_.valuePtr()[product.target] += entries_[product.a] * entries_[product.b];
  factor_.factorize(normal_);
  if (factor_.info() != Eigen::Success) return false;
  full_.setZero();
  rows_.full(y, full_.data());
  for (Eigen::Index j = 0; j < full_.size(); ++j) full_[j] *= metric(j);
  coupling_.setZero();
  for (Eigen::Index k = 0; k < entries_.size(); ++k) {
    const auto at = static_cast<std::size_t>(k);
    coupling_[row_[at]] += entries_[k] * full_[column_[at]];
  }
  multipliers_ = factor_.solve(coupling_);
  full_square_ = full_.squaredNorm() - coupling_.dot(multipliers_);
  // The full row hangs on the others where nothing of it is left.
  if (!(full_square_ > 1e-12 * full_.squaredNorm())) full_square_ = 0.0;
  spread_ = full_;
  for (Eigen::Index k = 0; k < entries_.size(); ++k) {
    const auto at = static_cast<std::size_t>(k);
    spread_[column_[at]] -= entries_[k] * multipliers_[row_[at]];
  }
  return true;
}

// The least move, in the metric, with C move = g: on the sparse rows, then along `spread_`, the
// part of the full row's gradient that leaves them alone.
void SparseProjection::solve(Eigen::VectorXd& move) {
  const Eigen::Index m = coupling_.size();
  const Eigen::VectorXd forces = factor_.solve(g_.head(m));
  move.setZero();
  for (Eigen::Index k = 0; k < entries_.size(); ++k) {
    const auto at = static_cast<std::size_t>(k);
    move[column_[at]] += entries_[k] * forces[row_[at]];
  }
  if (full_square_ > 0.0) move += spread_ * ((g_[m] - full_.dot(move)) / full_square_);
  for (Eigen::Index j = 0; j < move.size(); ++j) move[j] *= std::max(D_[j], size_);
}

int SparseProjection::project(const double* y, double* change, const double* corrector,
                              double epsilon) {
  scale_from(corrector);
  y_ = Eigen::Map<const Eigen::VectorXd>(y, rows_.columns);
  Eigen::VectorXd move(rows_.columns);
  double first = 0.0;
  for (int iteration = 0; iteration < 4; ++iteration) {
    rows_.value(y_.data(), g_.data());
    if (!factor(y_.data())) return 1;
    solve(move);
    const double length = move.norm();
    if (!std::isfinite(length)) return 1;
    y_ -= move;
    if (iteration == 0) first = length;
    // The move converges quadratically; what is left is far below the error test then.
    if (iteration > 0 && length <= epsilon * first) break;
    if (length <= 1e-15 * y_.norm()) break;
  }
  for (int j = 0; j < rows_.columns; ++j) change[j] = y_[j] - y[j];
  return 0;
}

ida_projection::Constraints SparseProjection::attach(SparseProjection* projection) {
  ida_projection::Constraints constraints;
  constraints.count = projection->rows_.count;
  ida_projection::UserProjection user;
  user.user_data = projection;
  user.function = [](double, N_Vector y, N_Vector change, double epsilon, N_Vector corrector,
                     void* data) {
    return static_cast<SparseProjection*>(data)->project(
        N_VGetArrayPointer(y), N_VGetArrayPointer(change), N_VGetArrayPointer(corrector), epsilon);
  };
  constraints.jacobian = user;
  return constraints;
}

}  // namespace tether::problems
