// Tether: L diag(d) L^T of A A^T + eps I for sparse A. SPDX-License-Identifier: BSD-3-Clause
//
// L is found row by row ("up-looking"; T. A. Davis, Direct Methods for Sparse Linear Systems,
// section 4.8): row k of L solves a triangular system with the rows above it. Neither A A^T nor a
// list of its products is stored: row k of A A^T is summed over the columns of row k of A.
#include "gram_factor.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "elimination.hpp"

namespace tether::linalg {

namespace {

constexpr double kDependent = 16.0;  // eps (1 + |c|^2)
constexpr double kThin = 1e6;        // eps
constexpr int kTogether = 4;         // columns of L that are applied in one pass
// The mean of eight squares is below a sixth of |c|^2 in one case of two hundred.
constexpr int kProbes = 8;
constexpr double kDependentByProbes = 6.0;  // eps (1 + |c|^2)

/// Columns j to j + 3 of L, which have the same `count` rows below them.
struct FourColumns {
  FourColumns(const double* L, const int* starts, const int* rows, int j)
      : L0(L + starts[j]),
        L1(L + starts[j + 1]),
        L2(L + starts[j + 2]),
        L3(L + starts[j + 3]),
        row(rows + starts[j + 3]) {}

  /// Solves L^T x = z for x_j to x_(j+3), which replace z, from the entries of x below them.
  void back(const double* __restrict x, int count, double* __restrict z) const {
    double x0 = z[0], x1 = z[1], x2 = z[2], x3 = z[3];
    for (int q = 0; q < count; ++q) {
      const double xq = x[row[q]];
      x0 -= L0[q + 3] * xq;
      x1 -= L1[q + 2] * xq;
      x2 -= L2[q + 1] * xq;
      x3 -= L3[q] * xq;
    }
    x2 -= L2[0] * x3;
    x1 -= L1[0] * x2 + L1[1] * x3;
    x0 -= L0[0] * x1 + L0[1] * x2 + L0[2] * x3;
    z[0] = x0;
    z[1] = x1;
    z[2] = x2;
    z[3] = x3;
  }

  const double *L0, *L1, *L2, *L3;
  const int* row;
};

}  // namespace

void GramFactor::analyse(int n, const std::vector<int>& starts, const std::vector<int>& columns) {
  m_ = static_cast<int>(starts.size()) - 1;
  n_ = n;
  std::vector<int> gram_starts, gram_rows;
  find_gram(starts, columns, gram_starts, gram_rows);
  const BlockPattern gram{m_, gram_starts.data(), gram_rows.data()};
  row_at_ = minimum_degree_order(gram);
  place_.resize(at(m_));
  for (int k = 0; k < m_; ++k) place_[at(row_at_[at(k)])] = k;
  list_columns(starts, columns);
  find_fill(gram, row_at_, place_, L_.column_starts, L_.column_rows);
  transpose(m_, L_.column_starts, L_.column_rows, L_.row_starts, L_.row_columns);
  L_.filled.assign(at(m_), 0);
  L_.value.assign(L_.column_rows.size(), 0.0);
  find_supernodes();
  work_.assign(at(m_), 0.0);  // zero between calls of factor()
  solution_.assign(at(m_), 0.0);
  inverse_d_.assign(at(m_), 0.0);
  dependent_.assign(at(m_), 0);
  uncertain_.reserve(at(m_));
  square_.reserve(at(m_));
}

// Finds the pattern of A A^T, the columns of each row in ascending order.
void GramFactor::find_gram(const std::vector<int>& starts, const std::vector<int>& columns,
                           std::vector<int>& gram_starts, std::vector<int>& gram_rows) const {
  std::vector<int> column_starts, rows, seen(at(m_), -1), passed(at(n_), 0);
  transpose(n_, starts, columns, column_starts, rows);
  std::vector<int> later_starts{0}, later;  // rows after i that share a column with it
  for (int i = 0; i < m_; ++i) {
    seen[at(i)] = i;
    for (int e = starts[at(i)]; e < starts[at(i) + 1]; ++e) {
      const int j = columns[at(e)];
      const int first = column_starts[at(j)] + ++passed[at(j)];
      for (int p = first; p < column_starts[at(j) + 1]; ++p)
        if (seen[at(rows[at(p)])] != i) {
          seen[at(rows[at(p)])] = i;
          later.push_back(rows[at(p)]);
        }
    }
    later_starts.push_back(static_cast<int>(later.size()));
  }
  std::vector<int> earlier_starts, earlier;
  transpose(m_, later_starts, later, earlier_starts, earlier);
  gram_starts.assign(1, 0);
  gram_rows.clear();
  for (int i = 0; i < m_; ++i) {
    gram_rows.insert(gram_rows.end(), earlier.begin() + earlier_starts[at(i)],
                     earlier.begin() + earlier_starts[at(i) + 1]);
    gram_rows.push_back(i);
    gram_rows.insert(gram_rows.end(), later.begin() + later_starts[at(i)],
                     later.begin() + later_starts[at(i) + 1]);
    gram_starts.push_back(static_cast<int>(gram_rows.size()));
  }
}

void GramFactor::list_columns(const std::vector<int>& starts, const std::vector<int>& columns) {
  PA_.starts.assign(1, 0);
  PA_.entry.clear();
  PA_.column.clear();
  for (const int i : row_at_) {
    for (int e = starts[at(i)]; e < starts[at(i) + 1]; ++e) {
      PA_.entry.push_back(e);
      PA_.column.push_back(columns[at(e)]);
    }
    PA_.starts.push_back(static_cast<int>(PA_.entry.size()));
  }
  transpose(n_, PA_.starts, PA_.column, PA_.member_starts, PA_.member);
  PA_.met.assign(at(n_), 0);
  PA_.value.assign(PA_.entry.size(), 0.0);
}

// Counts for each column j the columns j, j + 1, ... of L in which each has the rows of the one
// before it, without its own row.
void GramFactor::find_supernodes() {
  L_.alike.assign(at(m_), 1);
  const auto length = [this](int j) {
    return L_.column_starts[at(j) + 1] - L_.column_starts[at(j)];
  };
  for (int j = m_ - 2; j >= 0; --j)
    if (length(j) == length(j + 1) + 1 && L_.column_rows[at(L_.column_starts[at(j)])] == j + 1)
      L_.alike[at(j)] = L_.alike[at(j + 1)] + 1;
}

// Adds the products of row k of A with the rows before it to work_.
void GramFactor::scatter_products(int k, const double* A) {
  double* __restrict y = work_.data();
  double* __restrict value = PA_.value.data();
  const int *member = PA_.member.data(), *starts = PA_.member_starts.data();
  for (int p = PA_.starts[at(k)]; p < PA_.starts[at(k) + 1]; ++p) {
    const int j = PA_.column[at(p)];
    const double a = A[PA_.entry[at(p)]];
    const int here = starts[j] + PA_.met[at(j)]++;
    for (int q = starts[j]; q < here; ++q) y[member[q]] += a * value[q];
    value[here] = a;
  }
}

// Computes row k of L from row k of A A^T in work_, which becomes zero again. Returns d_k.
double GramFactor::eliminate(int k, double d) {
  double* __restrict y = work_.data();
  double* __restrict L = L_.value.data();
  const double* __restrict inverse_d = inverse_d_.data();
  int* __restrict filled = L_.filled.data();
  const int *rows = L_.column_rows.data(), *starts = L_.column_starts.data();
  const int* column = L_.row_columns.data() + L_.row_starts[at(k)];
  const int* end = L_.row_columns.data() + L_.row_starts[at(k) + 1];
  const auto finish = [&](int j, double yj) {
    const double entry = yj * inverse_d[j];
    d -= entry * yj;
    L[starts[j] + filled[j]++] = entry;
    y[j] = 0.0;
  };
  while (column < end) {
    const int j = *column;
    if (L_.alike[at(j)] >= kTogether && end - column >= kTogether) {
      const auto [L0, L1, L2, L3, row] = FourColumns(L, starts, rows, j);
      const double y0 = y[j];
      const double y1 = y[j + 1] - L0[0] * y0;
      const double y2 = y[j + 2] - L0[1] * y0 - L1[0] * y1;
      const double y3 = y[j + 3] - L0[2] * y0 - L1[1] * y1 - L2[0] * y2;
      const int count = filled[j + 3];
      for (int q = 0; q < count; ++q)
        y[row[q]] -= L0[q + 3] * y0 + L1[q + 2] * y1 + L2[q + 1] * y2 + L3[q] * y3;
      finish(j, y0);
      finish(j + 1, y1);
      finish(j + 2, y2);
      finish(j + 3, y3);
      column += kTogether;
    } else {
      const double yj = y[j];
      const int stop = starts[j] + filled[j];
      for (int q = starts[j]; q < stop; ++q) y[rows[q]] -= L[q] * yj;
      finish(j, yj);
      ++column;
    }
  }
  return d;
}

// Returns |c|^2, where c are the coefficients of row k over the rows before it: L_before^T c is row
// k of L. Only rows in the pattern of row k of L are counted, which suffices where few rows depend
// on each other.
double GramFactor::coefficients_square(int k) {
  double* __restrict x = work_.data();
  const double* __restrict L = L_.value.data();
  const int *rows = L_.column_rows.data(), *starts = L_.column_starts.data();
  const int* first = L_.row_columns.data() + L_.row_starts[at(k)];
  const int* column = L_.row_columns.data() + L_.row_starts[at(k) + 1];
  double square = 0.0;
  while (column > first) {
    const int j = column[-1] - (kTogether - 1);  // of four columns, if they are alike
    if (column - first >= kTogether && column[-kTogether] == j && L_.alike[at(j)] >= kTogether) {
      const FourColumns L4(L, starts, rows, j);
      const int count = L_.filled[at(j + 3)] - 1;  // the last entry is that of row k
      double z[kTogether] = {L4.L0[count + 3], L4.L1[count + 2], L4.L2[count + 1], L4.L3[count]};
      L4.back(x, count, z);
      std::copy(z, z + kTogether, x + j);
      square += z[0] * z[0] + z[1] * z[1] + z[2] * z[2] + z[3] * z[3];
      column -= kTogether;
    } else {
      const int last = starts[column[-1]] + L_.filled[at(column[-1])] - 1;
      double xj = L[last];
      for (int q = starts[column[-1]]; q < last; ++q) xj -= L[q] * x[rows[q]];
      x[*--column] = xj;
      square += xj * xj;
    }
  }
  for (const int* end = L_.row_columns.data() + L_.row_starts[at(k) + 1]; column < end; ++column)
    x[*column] = 0.0;
  return square;
}

int GramFactor::factor(const double* A, const double* norm, double eps, double thin) {
  std::fill(L_.filled.begin(), L_.filled.end(), 0);
  std::fill(PA_.met.begin(), PA_.met.end(), 0);
  eps_ = eps;
  uncertain_.clear();
  int count = 0;
  for (int k = 0; k < m_; ++k) {
    scatter_products(k, A);
    // In exact arithmetic d is at least eps.
    const double d = std::max(eliminate(k, 1.0 + eps), eps);
    const bool examined = d <= std::max(kThin * eps, thin);
    const bool dependent = (examined && d <= kDependent * eps * (1.0 + coefficients_square(k))) ||
                           !(norm[row_at_[at(k)]] > 0.0);
    dependent_[at(k)] = dependent;
    count += dependent;
    inverse_d_[at(k)] = 1.0 / d;
    if (examined && !dependent) uncertain_.push_back(k);
  }
  return count + resolve_uncertain();
}

// Decides about thin rows that do not depend on the rows in their own pattern alone: the row that
// closes a long loop depends on all rows of the loop. |c|^2 is estimated at random: if z has
// independent components of mean 0 and variance 1, (c . z)^2 has the mean |c|^2, and
// c . z = z_k - (L^-1 z)_k, so that one substitution serves all rows. Returns how many are
// dependent.
int GramFactor::resolve_uncertain() {
  if (uncertain_.empty()) return 0;
  square_.assign(uncertain_.size(), 0.0);
  std::uint32_t random = 1;
  for (int probe = 0; probe < kProbes; ++probe) {
    for (double& component : solution_) {
      random = 1664525u * random + 1013904223u;  // Numerical Recipes, section 7.1
      component = std::sqrt(12.0) * (random / 4294967296.0 - 0.5);
    }
    for (std::size_t q = 0; q < uncertain_.size(); ++q) work_[q] = solution_[at(uncertain_[q])];
    forward_in_place();
    for (std::size_t q = 0; q < uncertain_.size(); ++q) {
      const double product = work_[q] - solution_[at(uncertain_[q])];
      square_[q] += product * product / kProbes;
      work_[q] = 0.0;
    }
  }
  int count = 0;
  for (std::size_t q = 0; q < uncertain_.size(); ++q) {
    const int k = uncertain_[q];
    dependent_[at(k)] = 1.0 / inverse_d_[at(k)] <= kDependentByProbes * eps_ * (1.0 + square_[q]);
    count += dependent_[at(k)];
  }
  return count;
}

double GramFactor::independent_part(int i) const {
  return std::sqrt(std::max(0.0, 1.0 / inverse_d_[at(place_of(i))] - eps_));
}

// Solves L x = b in place. Four columns with the same rows are applied in one pass, which reads
// each row index and each entry of x once.
void GramFactor::forward_in_place() {
  double* __restrict x = solution_.data();
  const double* __restrict L = L_.value.data();
  const int *rows = L_.column_rows.data(), *starts = L_.column_starts.data(),
            *alike = L_.alike.data();
  for (int j = 0; j < m_;) {
    if (alike[j] >= kTogether) {
      const auto [L0, L1, L2, L3, row] = FourColumns(L, starts, rows, j);
      const double x0 = x[j];
      const double x1 = x[j + 1] -= L0[0] * x0;
      const double x2 = x[j + 2] -= L0[1] * x0 + L1[0] * x1;
      const double x3 = x[j + 3] -= L0[2] * x0 + L1[1] * x1 + L2[0] * x2;
      const int count = starts[j + 4] - starts[j + 3];
      for (int q = 0; q < count; ++q)
        x[row[q]] -= L0[q + 3] * x0 + L1[q + 2] * x1 + L2[q + 1] * x2 + L3[q] * x3;
      j += kTogether;
    } else {
      const double xj = x[j];
      for (int q = starts[j]; q < starts[j + 1]; ++q) x[rows[q]] -= L[q] * xj;
      ++j;
    }
  }
}

// Solves diag(d) L^T x = b in place.
void GramFactor::back_in_place() {
  double* __restrict x = solution_.data();
  const double* __restrict L = L_.value.data();
  const double* __restrict inverse_d = inverse_d_.data();
  const int *rows = L_.column_rows.data(), *starts = L_.column_starts.data(),
            *alike = L_.alike.data();
  for (int j = m_ - 1; j >= 0;) {
    const int first = j - (kTogether - 1);
    if (first >= 0 && alike[first] >= kTogether) {
      double z[kTogether];
      for (int k = 0; k < kTogether; ++k) z[k] = x[first + k] * inverse_d[first + k];
      FourColumns(L, starts, rows, first).back(x, starts[j + 1] - starts[j], z);
      std::copy(z, z + kTogether, x + first);
      j = first - 1;
    } else {
      double xj = x[j] * inverse_d[j];
      for (int q = starts[j]; q < starts[j + 1]; ++q) xj -= L[q] * x[rows[q]];
      x[j--] = xj;
    }
  }
}

void GramFactor::forward(double* z) {
  for (int i = 0; i < m_; ++i) solution_[at(place_of(i))] = z[i];
  forward_in_place();
  for (int i = 0; i < m_; ++i) z[i] = solution_[at(place_of(i))];
}

void GramFactor::solve(double* z) {
  for (int i = 0; i < m_; ++i) solution_[at(place_of(i))] = z[i];
  forward_in_place();
  back_in_place();
  for (int i = 0; i < m_; ++i) z[i] = solution_[at(place_of(i))];
}

// Computes c = L^-T diag(d)^-1 L^-1 z over the rows before `last`. A dependent row among them
// passes its share on to the rows on which it depends: this is what c_j = 0 in the back
// substitution does.
void GramFactor::depend(double* z, int last) const {
  const int count = last < 0 ? m_ : place_of(last);
  std::vector<double> x(at(m_), 0.0);
  for (int k = 0; k < count; ++k) x[at(k)] = z[row_at_[at(k)]];
  for (int j = 0; j < count; ++j)
    for (int q = L_.column_starts[at(j)];
         q < L_.column_starts[at(j) + 1] && L_.column_rows[at(q)] < count; ++q)
      x[at(L_.column_rows[at(q)])] -= L_.value[at(q)] * x[at(j)];
  for (int j = count - 1; j >= 0; --j) {
    double xj = x[at(j)] * inverse_d_[at(j)];
    for (int q = L_.column_starts[at(j)];
         q < L_.column_starts[at(j) + 1] && L_.column_rows[at(q)] < count; ++q)
      xj -= L_.value[at(q)] * x[at(L_.column_rows[at(q)])];
    x[at(j)] = dependent_[at(j)] ? 0.0 : xj;
  }
  for (int i = 0; i < m_; ++i) z[i] = x[at(place_of(i))];
}

}  // namespace tether::linalg
