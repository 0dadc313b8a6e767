// Tether: a problem over cones as one of 3-D friction cones. SPDX-License-Identifier: BSD-3-Clause
#include "cones/embedding.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/index.hpp>
#include <tether/linalg/symmetric_eigen.hpp>

#include "cones/cone_rows.hpp"

namespace tether::contact::detail {

namespace {

using linalg::at;

// Diagonal entries are 1 before free rows are eliminated. A row whose entry falls below this value
// is held by the free rows. Rounding leaves about 1e-15.
constexpr double kHeld = 1e-11;

double mobility(const ConeProblem& problem, int row) {
  return diagonal_block(problem, row, 1)(0, 0);
}

}  // namespace

double largest_need(const ConeProblem& problem) {
  double most = 0;
  for (int k = 0; k < static_cast<int>(problem.cones().size()); ++k)
    most = std::max(most, needed_change(problem, k));
  for (int r = 0; r < problem.rows() && !(most > 0); ++r)
    most = std::abs(problem.b()[r]) * problem.row_scale()[at(r)];
  return most;
}

Embedding::Embedding(const ConeProblem& problem, double tolerance, const std::vector<char>& open)
    : free_(problem), scale_(problem.rows()), need_(largest_need(problem)) {
  for (int r = 0; r < problem.rows(); ++r)
    scale_[r] = problem.row_scale()[at(r)] > 0 ? problem.row_scale()[at(r)] : 1;
  eliminate(problem);
  if (!free_.empty()) clear_held(problem);
  place_rows(problem, tolerance);
  assemble(problem, open);
}

// For each connected part of the free rows: the other rows that A couples to it, ascending.
std::vector<std::vector<int>> Embedding::rows_seeing_parts() const {
  std::vector<std::vector<int>> seeing(at(free_.part_count()));
  const Eigen::SparseMatrix<double>& C = free_.coupling();
  for (int f = 0; f < C.outerSize(); ++f)
    for (Eigen::SparseMatrix<double>::InnerIterator it(C, f); it; ++it)
      if (it.value() != 0) seeing[at(free_.parts()[at(f)])].push_back(static_cast<int>(it.row()));
  for (std::vector<int>& rows : seeing) {
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  }
  return seeing;
}

// Adds column seeing[p][k] of -A_cf A_ff^-1 A_fc for every part p. Parts are independent, so that
// one solve serves the k-th columns of all; each right-hand side has length 1 within its part.
void Embedding::eliminate_columns(const ConeProblem& problem,
                                  const std::vector<std::vector<int>>& seeing, std::size_t k,
                                  std::vector<Eigen::Triplet<double>>& entries) const {
  const Eigen::SparseMatrix<double>&B = free_.back(), &C = free_.coupling();
  Eigen::VectorXd g = Eigen::VectorXd::Zero(B.rows());
  std::vector<double> length(seeing.size(), 0);
  for (std::size_t p = 0; p < seeing.size(); ++p) {
    if (k >= seeing[p].size()) continue;
    const auto each = [&](const auto& take) {
      for (Eigen::SparseMatrix<double>::InnerIterator it(B, seeing[p][k]); it; ++it)
        if (at(free_.parts()[at(static_cast<int>(it.row()))]) == p) take(it);
    };
    double sum = 0;
    each([&](const auto& it) {
      const double v =
          it.value() * problem.row_scale()[at(free_.rows()[at(static_cast<int>(it.row()))])];
      sum += v * v;
    });
    length[p] = std::sqrt(sum);
    if (!(length[p] > 0)) continue;
    each([&](const auto& it) { g[it.row()] = it.value() / length[p]; });
  }
  const Eigen::VectorXd y = free_.solve(g);
  for (std::size_t p = 0; p < seeing.size(); ++p) {
    if (k >= seeing[p].size() || !(length[p] > 0)) continue;
    const int column = seeing[p][k];
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(seeing[p].size()));
    for (int f = 0; f < C.outerSize(); ++f) {
      if (at(free_.parts()[at(f)]) != p) continue;
      for (Eigen::SparseMatrix<double>::InnerIterator it(C, f); it; ++it) {
        const auto row =
            std::lower_bound(seeing[p].begin(), seeing[p].end(), static_cast<int>(it.row()));
        if (row != seeing[p].end() && *row == it.row())
          sum[row - seeing[p].begin()] += it.value() * y[f];
      }
    }
    for (std::size_t i = 0; i < seeing[p].size(); ++i)
      entries.emplace_back(
          seeing[p][i], column,
          -length[p] * sum[static_cast<Eigen::Index>(i)] * scale_[seeing[p][i]] * scale_[column]);
  }
}

void Embedding::eliminate(const ConeProblem& problem) {
  const int n = problem.rows();
  std::vector<Eigen::Triplet<double>> entries;
  for (const MatrixEntry& e : problem.entries())
    if (free_.place(e.row) < 0 && free_.place(e.column) < 0)
      entries.emplace_back(e.row, e.column, scale_[e.row] * e.value * scale_[e.column]);
  b_ = problem.b();
  if (!free_.empty()) {
    b_ -= free_.to_cones(free_.solve(free_.of(b_)));
    const std::vector<std::vector<int>> seeing = rows_seeing_parts();
    std::size_t columns = 0;
    for (const std::vector<int>& rows : seeing) columns = std::max(columns, rows.size());
    for (std::size_t k = 0; k < columns; ++k) eliminate_columns(problem, seeing, k, entries);
  }
  b_ = b_.cwiseProduct(scale_).eval();
  A_.resize(n, n);
  A_.setFromTriplets(entries.begin(), entries.end());
  // Rounding has made the Schur complement slightly unsymmetric.
  if (!free_.empty())
    A_ = (0.5 * (A_ + Eigen::SparseMatrix<double, Eigen::RowMajor>(A_.transpose()))).eval();
}

// Clears rows and columns of A in directions of slip, and of moments, that the free rows hold.
// There A is rounding, and a solver would divide rounding by rounding.
void Embedding::clear_held(const ConeProblem& problem) {
  std::vector<Eigen::Triplet<double>> Q;
  bool any = false;
  for (int r = 0; r < problem.rows(); ++r) Q.emplace_back(r, r, 1);
  const auto clear = [&](int from, int count) {
    Eigen::Matrix2d T = Eigen::Matrix2d::Identity();
    for (int r = 0; r < count; ++r)
      for (int c = 0; c < count; ++c) T(r, c) = A_.coeff(from + r, from + c);
    const linalg::SymmetricEigen<2> eigen = linalg::symmetric_eigen(T);
    for (int k = 0; k < 2; ++k) {
      if (eigen.values[k] > kHeld) continue;
      const Eigen::Vector2d d = eigen.vectors.col(k);
      for (int r = 0; r < count; ++r)
        for (int c = 0; c < count; ++c) Q.emplace_back(from + r, from + c, -d[r] * d[c]);
      any = true;
      double slip = 0;
      for (int r = 0; r < count; ++r) slip += d[r] * b_[from + r];
      if (std::abs(slip) <= kSlip * need_)
        for (int r = 0; r < count; ++r) b_[from + r] -= slip * d[r];
    }
  };
  for (std::size_t k = 0; k < problem.cones().size(); ++k) {
    const Cone& cone = problem.cones()[k];
    const int first = problem.first_row(static_cast<int>(k));
    each_part(cone.kind, [&](int from, int count) { clear(first + from, count); });
  }
  if (!any) return;
  Eigen::SparseMatrix<double, Eigen::RowMajor> q(problem.rows(), problem.rows());
  q.setFromTriplets(Q.begin(), Q.end());
  A_ = (q * A_ * q).eval();
}

void Embedding::place_rows(const ConeProblem& problem, double tolerance) {
  places_.assign(at(problem.rows()), {});
  bounds_.resize(problem.cones().size());
  moments_.resize(problem.cones().size());
  main_.assign(problem.cones().size(), -1);
  const auto add = [&](int block, double mu) {
    block_of_.push_back(block);
    mu_.push_back(mu);
    return static_cast<int>(mu_.size()) - 1;
  };
  for (int k = 0; k < static_cast<int>(problem.cones().size()); ++k) {
    const Cone& cone = problem.cones()[at(k)];
    const int first = problem.first_row(k);
    const auto put = [&](int row, int contact, int component) {
      places_[at(first + row)] = {contact, component};
    };
    if (cone.kind == Cone::Kind::free) continue;
    if (cone.kind == Cone::Kind::bounded) {
      const double N = cone.bound / scale_[first];
      const int contact = add(k, 1);
      put(0, contact, 1);
      main_[at(k)] = contact;
      // The normal of a bounded block is no row of the problem. Its velocity stays below the
      // largest velocity scale, so that it does not spoil relative errors.
      bounds_[at(k)] = {contact, (need_ > 0 && N > need_ ? need_ / N : 1) / scale_[first]};
      continue;
    }
    const double own = scale_[first] * scale_[first] * mobility(problem, first);
    if (!free_.empty() && !(A_.coeff(first, first) > kHeld * own)) {
      if (b_[first] > tolerance * need_) blocked_.push_back(k);
      continue;
    }
    const int contact = add(k, cone.mu);
    main_[at(k)] = contact;
    const ConeParts parts = parts_of(cone.kind);
    for (int r = 0; r <= parts.tangents; ++r) put(r, contact, r);
    Moments& moments = moments_[at(k)];
    if (parts.spin >= 0) {
      moments.spin_factor = scale_[first] / scale_[first + parts.spin];
      moments.spin = add(k, cone.torsional * moments.spin_factor);
      put(parts.spin, moments.spin, 1);
    }
    if (parts.rolling >= 0) {
      moments.rolling_factor = scale_[first] / scale_[first + parts.rolling];
      moments.rolling = add(k, cone.rolling * moments.rolling_factor);
      put(parts.rolling, moments.rolling, 1);
      put(parts.rolling + 1, moments.rolling, 2);
    }
  }
}

void Embedding::assemble(const ConeProblem& problem, const std::vector<char>& open) {
  const int n = static_cast<int>(mu_.size());
  std::vector<MatrixBlock> blocks;
  Eigen::VectorXd b = Eigen::VectorXd::Zero(3 * n);
  std::vector<int> last(at(n), -1);
  std::vector<std::vector<int>> rows(at(n));
  for (int r = 0; r < problem.rows(); ++r)
    if (places_[at(r)].contact >= 0) rows[at(places_[at(r)].contact)].push_back(r);
  std::vector<double> normal(at(n), 0);  // mobility
  for (int i = 0; i < n; ++i) {
    const std::size_t begin = blocks.size();
    const auto value = [&](int row, int j, int column) -> double& {
      if (last[at(j)] < static_cast<int>(begin)) {
        last[at(j)] = static_cast<int>(blocks.size());
        blocks.push_back({i, j, Eigen::Matrix3d::Zero()});
      }
      return blocks[at(last[at(j)])].value(row, column);
    };
    bool used[3] = {false, false, false};
    for (int r : rows[at(i)]) {
      const int component = places_[at(r)].component;
      used[component] = true;
      b[3 * i + component] = b_[r];
      for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(A_, r); it; ++it) {
        const Place& p = places_[at(static_cast<int>(it.col()))];
        if (p.contact >= 0 && it.value() != 0)
          value(component, p.contact, p.component) += it.value();
      }
    }
    const int k = block_of_[at(i)];
    const Cone& cone = problem.cones()[at(k)];
    if (used[0]) {
      normal[at(i)] = value(0, i, 0);
      for (int c = 1; c < 3; ++c)
        if (!used[c]) value(c, i, c) = 1;
      continue;
    }
    if (cone.kind == Cone::Kind::bounded) {
      const double s = scale_[problem.first_row(k)], a = bounds_[at(k)].factor * s;
      value(0, i, 0) = a;
      b[3 * i] = a * cone.bound / s;
    } else {  // moments: their contact comes before them, so normal[contact] is known
      const int contact = main_[at(k)];
      value(0, i, 0) = normal[at(contact)];
      value(0, contact, 0) = -normal[at(contact)];
      if (!open.empty() && open[at(k)]) b[3 * i] = -(need_ > 0 ? need_ : 1);
    }
    if (!used[2]) value(2, i, 2) = 1;
  }
  std::vector<Eigen::Triplet<double>> scales;
  for (int i = 0; i < n; ++i)
    for (int r : rows[at(i)]) scales.emplace_back(3 * i + places_[at(r)].component, r, scale_[r]);
  raise_.resize(3 * n, problem.rows());
  raise_.setFromTriplets(scales.begin(), scales.end());
  contacts_ =
      Problem::sparse(3, std::move(blocks), b, Eigen::Map<const Eigen::VectorXd>(mu_.data(), n));
}

Eigen::VectorXd Embedding::lift(const linalg::VectorView& impulses) const {
  Eigen::VectorXd x = raise(impulses.cwiseQuotient(scale_.cwiseAbs2()));
  for (std::size_t k = 0; k < bounds_.size(); ++k) {
    if (const int i = bounds_[k].contact; i >= 0)
      x[3 * i] = contacts_.b()[3 * i] / contacts_.local(i).a;
    for (int i : {moments_[k].spin, moments_[k].rolling})
      if (i >= 0) x[3 * i] = std::max(0.0, x[3 * main_[k]]);
  }
  return x;
}

Eigen::VectorXd Embedding::complete(const Eigen::VectorXd& cones,
                                    const linalg::VectorView& g) const {
  Eigen::VectorXd x = cones;
  if (!free_.empty()) free_.put(free_.solve(free_.of(g) - free_.from_cones(cones)), x);
  return x;
}

Eigen::VectorXd Embedding::lift_b(const linalg::VectorView& db) const {
  if (free_.empty()) return raise(db);
  return raise(db - free_.to_cones(free_.solve(free_.of(db))));
}

Eigen::VectorXd Embedding::lower_b(const linalg::VectorView& db3) const {
  Eigen::VectorXd g = lower(db3);
  if (!free_.empty()) free_.put(-free_.solve(free_.coupling().transpose() * g), g);
  return g;
}

}  // namespace tether::contact::detail
