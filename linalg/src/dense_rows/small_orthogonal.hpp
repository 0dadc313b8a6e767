// Tether: orthogonal factors of a few short rows, without allocation or variable-length loops.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace tether::linalg::small {

/// A = C D (m x n) as (I + L) U with mutually orthogonal rows in U and L unit lower triangular in
/// pivot order: modified Gram-Schmidt without square roots, reorthogonalised where a row loses more
/// than kReorthogonalise of its length ("twice is enough"). Then A du = c has the minimum-norm
/// solution du = sum_k (z_k / |u_k|^2) u_k, z = (I + L)^-1 c.
///
/// For short rows this beats Householder reflections: the chain of dependent operations in a step
/// is a dot product and a division, with no square root and no reflector to apply afterwards.
struct Storage {
  static constexpr int kRows = 16, kColumns = 32;
  alignas(32) double u[kRows * kColumns];  // rows, padded with zeros to an even length ("stride")
  double L[kRows * kRows];                 // L[i][k], i the original row, k the pivot step
  double inverse_square[kRows];            // 1 / |u_k|^2 by pivot step
  double ratio[kRows];                     // |u_k|^2 / |a_k|^2 by pivot step
  double square[kRows];                    // |a_i|^2, after scale
  double scale[kRows];                     // guard against overflow, almost always 1
  int pivot[kRows];

  void clear() {
    for (double& x : u) x = 0.0;
  }
};

constexpr double kReorthogonalise = 1e-4;  // of the squared length: at most two digits are lost

template <int Length>
using Row = Eigen::Map<Eigen::Matrix<double, Length, 1>, Eigen::Aligned16>;

/// Largest |a_j|; NaN if an entry is not finite.
inline double largest_entry(const double* a, int n) {
  double largest = 0.0;
  for (int j = 0; j < n; ++j) {
    if (!std::isfinite(a[j])) return std::numeric_limits<double>::quiet_NaN();
    largest = std::max(largest, std::abs(a[j]));
  }
  return largest;
}

/// |a| without overflow or underflow; NaN if an entry is not finite.
inline double careful_norm(const double* a, int n) {
  const double largest = largest_entry(a, n);
  if (largest == 0.0 || !std::isfinite(largest)) return largest;
  double sum = 0.0;
  for (int j = 0; j < n; ++j) sum += (a[j] / largest) * (a[j] / largest);
  return largest * std::sqrt(sum);
}

/// A row whose squared length leaves the safe range is scaled by its largest entry. False if an
/// entry is not finite.
bool rescale_row(Storage& s, double* a, int stride, int i);

/// Squared length of row i.
template <int Stride>
inline bool measure_row(Storage& s, int i) {
  Row<Stride> a(s.u + i * Stride);
  const double square = a.squaredNorm();
  s.scale[i] = 1.0;
  s.square[i] = square;
  return (square > 1e-280 && square < 1e280) || rescale_row(s, a.data(), Stride, i);
}

/// C D, formed in place, and the squared lengths of its rows.
template <int Stride>
bool form_rows(Storage& s, int m, const double* D) {
  const Row<Stride> metric(const_cast<double*>(D));
  for (int i = 0; i < m; ++i) {
    Row<Stride> a(s.u + i * Stride);
    a = a.cwiseProduct(metric);
    if (!measure_row<Stride>(s, i)) return false;
  }
  return true;
}

/// The same from rows and columns of a wider row-major array.
template <int Stride>
bool gather_rows(Storage& s, int m, int n, const double* wide, int width, const int* rows,
                 const int* columns, const double* D) {
  const bool whole = n == Stride && columns[Stride - 1] - columns[0] == Stride - 1;
  for (int i = 0; i < m; ++i) {
    const double* c = wide + static_cast<std::ptrdiff_t>(rows[i]) * width;
    double* a = s.u + i * Stride;
    if (whole)
      for (int j = 0; j < Stride; ++j) a[j] = c[columns[0] + j] * D[j];
    else
      for (int j = 0; j < n; ++j) a[j] = c[columns[j]] * D[j];
    if (!measure_row<Stride>(s, i)) return false;
  }
  return true;
}

/// Removes the components of row i along the k rows already chosen and stores them in L. Returns
/// |row|^2.
template <int Stride>
double reorthogonalise(Storage& s, int i, int k) {
  Row<Stride> a(s.u + i * Stride);
  for (int j = 0; j < k; ++j) {
    const Row<Stride> u(s.u + s.pivot[j] * Stride);
    const double share = a.dot(u) * s.inverse_square[j];
    a -= share * u;
    s.L[i * Storage::kRows + j] += share;
  }
  return a.squaredNorm();
}

/// Returns the rank.
template <int Stride>
int factor(Storage& s, int m, int n, double rank_tolerance) {
  const double* square = s.square;
  const double smallest = rank_tolerance * rank_tolerance;
  double left[Storage::kRows];     // |remaining part of row i|^2 / |a_i|^2
  double inverse[Storage::kRows];  // 1 / |a_i|^2
  for (int i = 0; i < m; ++i) {
    s.pivot[i] = i;
    left[i] = square[i] > 0.0 ? 1.0 : 0.0;
    inverse[i] = square[i] > 0.0 ? 1.0 / square[i] : 0.0;
  }
  const int steps = std::min(m, n);
  for (int k = 0; k < steps; ++k) {
    int best = k;
    for (int i = k + 1; i < m; ++i)
      if (left[s.pivot[i]] > left[s.pivot[best]]) best = i;
    std::swap(s.pivot[k], s.pivot[best]);
    const int p = s.pivot[k];
    Row<Stride> u(s.u + p * Stride);
    double length = left[p] * square[p];
    if (left[p] < kReorthogonalise) {
      length = reorthogonalise<Stride>(s, p, k);
      left[p] = length * inverse[p];
    } else if (k > 0) {
      length = u.squaredNorm();
    }
    if (!(left[p] > smallest)) return k;

    s.ratio[k] = left[p];
    s.inverse_square[k] = 1.0 / length;
    for (int j = k + 1; j < m; ++j) {
      const int i = s.pivot[j];
      Row<Stride> a(s.u + i * Stride);
      const double dot = a.dot(u);
      const double share = dot * s.inverse_square[k];
      a -= share * u;
      s.L[i * Storage::kRows + k] = share;
      left[i] -= dot * share * inverse[i];
    }
  }
  return steps;
}

/// dy = D sum_k z_k / |u_k|^2 u_k.
template <int Stride>
void combine(const Storage& s, int rank, const double* z, const double* D, double* dy, int n) {
  Eigen::Matrix<double, Stride, 1> du = Eigen::Matrix<double, Stride, 1>::Zero();
  for (int k = 0; k < rank; ++k)
    du +=
        (z[k] * s.inverse_square[k]) * Row<Stride>(const_cast<double*>(s.u) + s.pivot[k] * Stride);
  for (int j = 0; j < n; ++j) dy[j] = du[j] * D[j];
}

/// The functions for one padded row length.
struct Kernel {
  int stride;
  bool (*form_rows)(Storage&, int m, const double* D);
  bool (*gather_rows)(Storage&, int m, int n, const double* wide, int width, const int* rows,
                      const int* columns, const double* D);
  int (*factor)(Storage&, int m, int n, double rank_tolerance);
  void (*combine)(const Storage&, int rank, const double* z, const double* D, double* dy, int n);
};

/// The kernel with the smallest stride >= n, n <= 32.
const Kernel& kernel_for(int n);

}  // namespace tether::linalg::small
