// Tether: the equations of an island's derivative and their factors.
// SPDX-License-Identifier: BSD-3-Clause

#include "derivative/solution_derivative.hpp"

#include <algorithm>
#include <cmath>
#include <tether/linalg/block_lu.hpp>
#include <tether/linalg/eigen.hpp>
#include <tether/linalg/least_squares.hpp>
#include <tether/linalg/sparse_minimum_norm.hpp>

namespace tether::contact::detail {
namespace {

using linalg::at;
using linalg::PackedVector;
using linalg::PackedVectors;

Eigen::VectorXd unpacked(const PackedVector* y, int n) {
  Eigen::VectorXd out(3 * n);
  for (int i = 0; i < n; ++i)
    for (int c = 0; c < 3; ++c) out[3 * i + c] = y[i].v[c];
  return out;
}
void pack(const Eigen::VectorXd& from, PackedVector* y) {
  for (Eigen::Index k = 0; k < from.size(); ++k) y[k / 3].v[k % 3] = from[k];
}

class DenseFactors final : public EquationFactors {
 public:
  DenseFactors(const IslandEquations& e, double rank_tolerance)
      : n_(e.size()), factors_(rank_tolerance) {
    Eigen::MatrixXd M = Eigen::MatrixXd::Zero(3 * n_, 3 * n_);
    for (int i = 0; i < n_; ++i)
      for (int k = e.starts[at(i)]; k < e.starts[at(i + 1)]; ++k)
        M.block<3, 3>(3 * i, 3 * e.columns[at(k)]) = as_matrix(e.blocks[at(k)]);
    factors_.factor(M);
  }
  void solve(PackedVector* y) override { pack(factors_.solve(unpacked(y, n_)), y); }
  void solve_transposed(PackedVector* y) override {
    pack(factors_.solve_transposed(unpacked(y, n_)), y);
  }
  int deficiency() const override { return 3 * n_ - factors_.rank(); }

 private:
  int n_;
  linalg::LeastSquares factors_;
};

class SparseFactors final : public EquationFactors {
 public:
  explicit SparseFactors(const IslandEquations& e) : e_(e) {
    const linalg::BlockPattern pattern{e.size(), e.starts.data(), e.columns.data()};
    lu_.order(pattern);
    lu_.analyse(pattern, nullptr);
    for (int row = 0; row < lu_.size(); ++row) {
      const int i = lu_.block_row(row);
      lu_.begin_row(row);
      for (int k = e.starts[at(i)]; k < e.starts[at(i + 1)]; ++k)
        lu_.add(e.columns[at(k)], e.blocks[at(k)].column);
      regular_ = lu_.end_row() && regular_;
    }
    right_.resize(e.contacts.size());
    rest_.resize(e.contacts.size());
  }
  bool regular() const { return regular_; }
  void solve(PackedVector* y) override { refine<false>(y); }
  void solve_transposed(PackedVector* y) override { refine<true>(y); }
  int deficiency() const override { return 0; }

 private:
  template <bool kTransposed>
  void refine(PackedVector* y) {
    std::copy(y, y + e_.size(), right_.begin());
    kTransposed ? lu_.solve_transposed(y) : lu_.solve(y);
    for (int k = 0; k < 2; ++k) {
      kTransposed ? e_.multiply_transposed(y, rest_.data()) : e_.multiply(y, rest_.data());
      entries(rest_) = entries(right_) - entries(rest_);
      kTransposed ? lu_.solve_transposed(rest_.data()) : lu_.solve(rest_.data());
      for (std::size_t i = 0; i < rest_.size(); ++i)
        for (int c = 0; c < 3; ++c) y[i].v[c] += rest_[i].v[c];
    }
  }

  const IslandEquations& e_;
  linalg::BlockLu lu_;
  bool regular_ = true;
  PackedVectors right_, rest_;
};

// Least-norm least squares of M, or of M' (the symmetric pattern serves for both).
class DeficientFactors final : public EquationFactors {
 public:
  DeficientFactors(const IslandEquations& e, double rank_tolerance)
      : e_(e), rank_tolerance_(rank_tolerance) {
    deficiency_ = factors(false).dropped();
  }
  // The factors weigh contradicting equations by the lengths of rows. The part outside of the range
  // is removed first, so that both are the pseudoinverse and each is the transpose of the other.
  void solve(PackedVector* y) override {
    const PackedVectors right(y, y + e_.size());
    solve(factors(false), y);
    if (factors(false).residual() <= 1e-10) return;
    e_.multiply_transposed(right.data(), y);
    solve(factors(true), y);
    solve(factors(false), y);
  }
  void solve_transposed(PackedVector* y) override {
    const PackedVectors right(y, y + e_.size());
    e_.multiply(right.data(), y);
    solve(factors(false), y);
    solve(factors(true), y);
  }
  int deficiency() const override { return deficiency_; }

 private:
  linalg::SparseMinimumNorm& factors(bool transposed) {
    std::unique_ptr<linalg::SparseMinimumNorm>& f = factors_[transposed ? 1 : 0];
    if (f) return *f;
    f = std::make_unique<linalg::SparseMinimumNorm>();
    const int n = e_.size();
    std::vector<int> starts{0}, columns;
    for (int i = 0; i < n; ++i)
      for (int r = 0; r < 3; ++r) {
        for (int k = e_.starts[at(i)]; k < e_.starts[at(i + 1)]; ++k)
          for (int c = 0; c < 3; ++c) columns.push_back(3 * e_.columns[at(k)] + c);
        starts.push_back(static_cast<int>(columns.size()));
      }
    f->resize(3 * n, starts, columns, 0);
    // Place of the next entry of each row.
    std::vector<int> next(starts.begin(), starts.end() - 1);
    double* to = f->entries();
    for (int i = 0; i < n; ++i)
      for (int k = e_.starts[at(i)]; k < e_.starts[at(i + 1)]; ++k) {
        const int j = e_.columns[at(k)];
        for (int r = 0; r < 3; ++r)
          for (int c = 0; c < 3; ++c) {
            const int row = transposed ? 3 * j + c : 3 * i + r;
            to[next[at(row)]++] = e_.blocks[at(k)].column[4 * c + r];
          }
      }
    std::fill(f->metric(), f->metric() + 3 * n, 1.0);
    f->factor(rank_tolerance_);
    return *f;
  }
  void solve(linalg::SparseMinimumNorm& f, PackedVector* y) {
    const Eigen::VectorXd right = unpacked(y, e_.size());
    Eigen::VectorXd out(right.size());
    f.solve(right.data(), out.data());
    pack(out, y);
  }

  const IslandEquations& e_;
  double rank_tolerance_;
  int deficiency_;
  std::unique_ptr<linalg::SparseMinimumNorm> factors_[2];
};

}  // namespace

void IslandEquations::multiply(const PackedVector* y, PackedVector* out) const {
  for (int i = 0; i < size(); ++i) {
    out[i] = {};
    for (int k = starts[at(i)]; k < starts[at(i + 1)]; ++k) {
      const double *M = blocks[at(k)].column, *v = y[columns[at(k)]].v;
      for (int r = 0; r < 3; ++r) out[i].v[r] += M[r] * v[0] + M[4 + r] * v[1] + M[8 + r] * v[2];
    }
  }
}

void IslandEquations::multiply_transposed(const PackedVector* y, PackedVector* out) const {
  std::fill(out, out + size(), PackedVector());
  for (int i = 0; i < size(); ++i) {
    const double* v = y[i].v;
    for (int k = starts[at(i)]; k < starts[at(i + 1)]; ++k) {
      const double* M = blocks[at(k)].column;
      double* sum = out[columns[at(k)]].v;
      for (int c = 0; c < 3; ++c)
        sum[c] += M[4 * c] * v[0] + M[4 * c + 1] * v[1] + M[4 * c + 2] * v[2];
    }
  }
}

namespace {

// The part of a direction without symmetry that M^+ M removes: its component in the null space.
double find_free_direction(IslandEquations& e) {
  PackedVectors z(e.contacts.size());
  e.free.resize(z.size());
  double phase = 0;
  for (PackedVector& v : z)
    for (int c = 0; c < 3; ++c) {
      phase += 0.6180339887498949;  // the golden ratio
      phase -= std::floor(phase);
      v.v[c] = phase - 0.5;
    }
  e.multiply(z.data(), e.free.data());
  e.factors->solve(e.free.data());
  entries(e.free) = entries(z) - entries(e.free);
  return entries(e.free).norm() / entries(z).norm();
}

// The least singular value of M, by inverse iteration from the direction that M hardly sees.
double least_singular_value(IslandEquations& e) {
  PackedVectors y = e.free;
  double length = 0;
  const auto normalise = [&] {
    length = entries(y).norm();
    entries(y) /= length;
  };
  normalise();
  for (int k = 0; k < 3 && length > 0; ++k) {
    e.factors->solve_transposed(y.data());
    e.factors->solve(y.data());
    normalise();
  }
  return length > 0 ? 1 / std::sqrt(length) : 0;
}

}  // namespace

void IslandEquations::factor(double rank_tolerance) {
  constexpr double kLost = 1e-5;  // of a known solution: M is singular to working precision
  deficiency = 0;
  if (size() > 100) {
    auto sparse = std::make_unique<SparseFactors>(*this);
    const bool regular = sparse->regular();
    factors = std::move(sparse);
    if (regular && find_free_direction(*this) <= kLost &&
        least_singular_value(*this) > rank_tolerance) {
      free.clear();
      return;
    }
  }
  if (size() <= 400) {
    factors = std::make_unique<DenseFactors>(*this, rank_tolerance);
    deficiency = factors->deficiency();
    if (deficiency > 0) find_free_direction(*this);
  } else {
    factors = std::make_unique<DeficientFactors>(*this, rank_tolerance);
    deficiency = factors->deficiency();
    if (find_free_direction(*this) > kLost) deficiency = std::max(deficiency, 1);
  }
  if (deficiency == 0) free.clear();
}

}  // namespace tether::contact::detail
