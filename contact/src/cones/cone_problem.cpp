// Tether: contact problems over products of cones. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/cones.hpp>

#include <Eigen/Cholesky>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <tether/linalg/disjoint_sets.hpp>
#include <tether/linalg/index.hpp>

#include "cones/cone_rows.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {
namespace {

using linalg::at;

[[noreturn]] void fail(const std::string& what) { throw std::invalid_argument(what); }

std::string block(int k) { return "block " + std::to_string(k) + ": "; }

int rows_of(Cone::Kind kind) {
  if (kind == Cone::Kind::free) return 0;  // any number
  const detail::ConeParts parts = detail::parts_of(kind);
  return 1 + parts.tangents + (parts.spin >= 0 ? 1 : 0) + (parts.rolling >= 0 ? 2 : 0);
}

void check(int k, const Cone& cone) {
  if (cone.kind > Cone::Kind::rolling_torsional) fail(block(k) + "is of no kind");
  const int rows = rows_of(cone.kind);
  if (cone.rows < 1 || (rows > 0 && cone.rows != rows))
    fail(block(k) + std::to_string(cone.rows) + " rows, " + name(cone.kind) + " has " +
         (rows > 0 ? std::to_string(rows) : "one at least"));
  const struct {
    const char* name;
    double value;
  } numbers[] = {{"mu", cone.mu},
                 {"rolling", cone.rolling},
                 {"torsional", cone.torsional},
                 {"bound", cone.bound}};
  for (const auto& n : numbers)
    detail::require(std::isfinite(n.value) && n.value >= 0, (block(k) + n.name).c_str(), n.value,
                    "must be finite and >= 0");
}

// Sorts entries by row, then by column, and adds up those of equal position.
void compress(std::vector<MatrixEntry>& entries) {
  std::stable_sort(entries.begin(), entries.end(), [](const MatrixEntry& a, const MatrixEntry& b) {
    return a.row != b.row ? a.row < b.row : a.column < b.column;
  });
  std::size_t n = 0;
  for (const MatrixEntry& e : entries) {
    if (n > 0 && entries[n - 1].row == e.row && entries[n - 1].column == e.column)
      entries[n - 1].value += e.value;
    else
      entries[n++] = e;
  }
  entries.resize(n);
}

using Sparse = Eigen::SparseMatrix<double>;

// Factors of the connected part of M that begins at `row`. One of its halves may be all that is
// given.
void factor_mass(const std::vector<Eigen::Triplet<double>>& entries, Eigen::Index size, int row,
                 Eigen::SimplicialLLT<Sparse>& factor) {
  Sparse M(size, size);
  M.setFromTriplets(entries.begin(), entries.end());
  const Sparse other = M.transpose(), above = M.triangularView<Eigen::StrictlyUpper>(),
               below = M.triangularView<Eigen::StrictlyLower>();
  bool symmetric = true;
  if ((above.norm() == 0) != (below.norm() == 0)) {
    M = (M + Sparse((above + below).transpose())).eval();
  } else {
    // Problem files of other programs hold six digits or fewer.
    symmetric = (M - other).norm() <= 1e-2 * M.norm();
    M = (0.5 * (M + other)).eval();
  }
  if (symmetric) factor.compute(M);
  if (!symmetric || factor.info() != Eigen::Success)
    fail("M is not symmetric and positive definite in the part of row " + std::to_string(row));
}

// A connected part of M: its rows, and the entries of M and J in them.
struct MassPart {
  std::vector<int> members;
  std::vector<Eigen::Triplet<double>> mass;  // by places in the part
  std::vector<MatrixEntry> rows;
};

std::vector<MassPart> mass_parts(const std::vector<MatrixEntry>& M,
                                 const std::vector<MatrixEntry>& J, int n,
                                 std::vector<int>& place) {
  linalg::DisjointSets sets(n);
  for (const MatrixEntry& e : M)
    if (e.value != 0) sets.join(e.row, e.column);
  std::vector<MassPart> out;
  std::vector<int> part(at(n));
  place.resize(at(n));
  for (int i = 0; i < n; ++i) {
    if (sets.root(i) == i) out.emplace_back();
    part[at(i)] = sets.root(i) == i ? static_cast<int>(out.size()) - 1 : part[at(sets.root(i))];
    std::vector<int>& members = out[at(part[at(i)])].members;
    place[at(i)] = static_cast<int>(members.size());
    members.push_back(i);
  }
  for (const MatrixEntry& e : M)
    if (e.value != 0)
      out[at(part[at(e.row)])].mass.emplace_back(place[at(e.row)], place[at(e.column)], e.value);
  for (const MatrixEntry& e : J) out[at(part[at(e.column)])].rows.push_back(e);
  return out;
}

}  // namespace

namespace detail {

void check_entries(const char* matrix, const std::vector<MatrixEntry>& entries, Eigen::Index rows,
                   Eigen::Index columns) {
  const auto place = [&](const MatrixEntry& e) {
    return std::string(matrix) + "(" + std::to_string(e.row) + ", " + std::to_string(e.column) +
           ")";
  };
  for (const MatrixEntry& e : entries) {
    if (e.row < 0 || e.row >= rows || e.column < 0 || e.column >= columns)
      fail(place(e) + " is outside of a matrix of " + std::to_string(rows) + " x " +
           std::to_string(columns));
    if (!std::isfinite(e.value)) refuse(place(e), e.value, "must be finite");
  }
}

Matrix6d diagonal_block(const ConeProblem& problem, int row, int size) {
  Matrix6d D = Matrix6d::Zero();
  for (int r = 0; r < size; ++r)
    for (int e = problem.row_start()[at(row + r)]; e < problem.row_start()[at(row + r + 1)]; ++e) {
      const int c = problem.entries()[at(e)].column - row;
      if (c >= 0 && c < size) D(r, c) = problem.entries()[at(e)].value;
    }
  return D;
}

std::vector<int> islands(const ConeProblem& problem) {
  const int n = static_cast<int>(problem.cones().size());
  std::vector<int> block_of(at(problem.rows())), out(at(n));
  for (int k = 0; k < n; ++k)
    for (int r = 0; r < problem.cones()[at(k)].rows; ++r)
      block_of[at(problem.first_row(k) + r)] = k;
  linalg::DisjointSets sets(n);
  for (const MatrixEntry& e : problem.entries())
    if (e.value != 0) sets.join(block_of[at(e.row)], block_of[at(e.column)]);
  for (int k = 0; k < n; ++k) out[at(k)] = sets.root(k);
  return out;
}

double needed_change(const ConeProblem& problem, int block) {
  const Cone& cone = problem.cones()[at(block)];
  const int first = problem.first_row(block);
  const std::vector<double>& scale = problem.row_scale();
  const auto b = [&](int r) { return scale[at(first + r)] * problem.b()[first + r]; };
  double most = 0;
  if (cone.kind == Cone::Kind::free) {
    for (int r = 0; r < cone.rows; ++r) most = std::max(most, std::abs(b(r)));
    return most;
  }
  if (cone.kind == Cone::Kind::bounded) {
    const double s = scale[at(first)];
    return s > 0 ? std::min(std::abs(b(0)), cone.bound / s) : 0;
  }
  const double bn = b(0);
  if (!(bn > 0)) return 0;
  const Matrix6d D = diagonal_block(problem, first, cone.rows);
  const ConeParts parts = parts_of(cone.kind);
  // Largest change of velocity by friction or a moment, at the normal impulse b_n / A_nn.
  const auto part = [&](int from, int count, double length) {
    double bb = 0;
    for (int r = from; r < from + count; ++r) bb += b(r) * b(r);
    const double mean = D.diagonal().segment(from, count).mean(), own = scale[at(first + from)];
    return std::min(std::sqrt(bb), length * mean * own * problem.b()[first] / D(0, 0));
  };
  most = bn;
  if (parts.tangents > 0) most += part(1, parts.tangents, cone.mu);
  if (parts.spin >= 0) most += part(parts.spin, 1, cone.torsional);
  if (parts.rolling >= 0) most += part(parts.rolling, 2, cone.rolling);
  return most;
}

void require_law(const ConeProblem& problem, Law law) {
  name(law);  // throws where `law` is none of laws()
  if (law == Law::coulomb) return;
  for (std::size_t k = 0; k < problem.cones().size(); ++k) {
    const Cone::Kind kind = problem.cones()[k].kind;
    // Maximum dissipation depends on the contact's diagonal block of A, which the elimination of
    // free rows changes.
    if (kind == Cone::Kind::bounded || kind >= Cone::Kind::torsional ||
        (kind == Cone::Kind::free && law == Law::maximum_dissipation))
      fail(block(static_cast<int>(k)) + "law = " + name(law) + ": " + name(kind) +
           " needs coulomb");
  }
}

}  // namespace detail

const char* name(Cone::Kind kind) {
  return detail::text(kind, {"free", "nonnegative", "bounded", "planar", "friction", "torsional",
                             "rolling", "rolling_torsional"});
}

ConeProblem ConeProblem::sparse(const std::vector<MatrixEntry>& A, const linalg::VectorView& b,
                                std::vector<Cone> cones, const linalg::VectorView& compliance) {
  ConeProblem out;
  const Eigen::Index n = b.size();
  detail::require_finite("b", b);
  Eigen::Index rows = 0;
  for (std::size_t k = 0; k < cones.size(); ++k) {
    check(static_cast<int>(k), cones[k]);
    out.first_.push_back(static_cast<int>(rows));
    rows += cones[k].rows;
    if (rows > n) break;
  }
  if (rows != n) detail::refuse_size("b", n, rows, "as many as the cones have rows");
  if (compliance.size() != 0 && compliance.size() != n)
    detail::refuse_size("compliance", compliance.size(), n, "one for each row, or none");
  detail::check_entries("A", A, n, n);
  out.entries_ = A;
  for (Eigen::Index r = 0; r < compliance.size(); ++r) {
    detail::require(std::isfinite(compliance[r]) && compliance[r] >= 0, "compliance", compliance[r],
                    "must be finite and >= 0");
    out.entries_.push_back({static_cast<int>(r), static_cast<int>(r), compliance[r]});
  }
  compress(out.entries_);
  detail::check_entries("A", out.entries_, n, n);  // a sum of finite entries may overflow
  out.b_ = b;
  out.cones_ = std::move(cones);
  out.row_start_.assign(at(static_cast<int>(n) + 1), 0);
  for (const MatrixEntry& e : out.entries_) ++out.row_start_[at(e.row + 1)];
  std::partial_sum(out.row_start_.begin(), out.row_start_.end(), out.row_start_.begin());

  out.scale_.assign(at(static_cast<int>(n)), 0);
  for (std::size_t k = 0; k < out.cones_.size(); ++k) {
    const Cone& cone = out.cones_[k];
    const int first = out.first_[k];
    const bool one = cone.kind != Cone::Kind::free;
    // The block of a contact is scaled as a whole, free rows one by one.
    for (int row = first; row < first + cone.rows; row += one ? cone.rows : 1) {
      const Matrix6d D = detail::diagonal_block(out, row, one ? cone.rows : 1);
      if (detail::is_contact(cone.kind) && !(D(0, 0) > 0))
        detail::refuse(block(static_cast<int>(k)) + "A_nn", D(0, 0), "must be > 0");
      // Rows of forces and of moments differ in unit, so the block is tested with a unit diagonal.
      Vector6d root = Vector6d::Zero();
      for (int r = 0; r < 6; ++r) root[r] = D(r, r) > 0 ? 1 / std::sqrt(D(r, r)) : 1;
      detail::require_semidefinite(
          "A", Matrix6d(root.asDiagonal() * (0.5 * (D + D.transpose())) * root.asDiagonal()),
          [&] { return block(static_cast<int>(k)); });
      const detail::ConeParts parts = detail::parts_of(cone.kind);
      const auto set = [&](int from, int count) {
        const double mean = D.diagonal().segment(from, count).mean();
        for (int r = 0; r < count; ++r)
          out.scale_[at(row + from + r)] = mean > 0 ? 1 / std::sqrt(mean) : 0;
      };
      set(0, 1 + parts.tangents);
      if (parts.spin >= 0) set(parts.spin, 1);
      if (parts.rolling >= 0) set(parts.rolling, 2);
    }
  }
  return out;
}

ConeProblem ConeProblem::dense(const linalg::MatrixView& A, const linalg::VectorView& b,
                               std::vector<Cone> cones, const linalg::VectorView& compliance) {
  if (A.rows() != b.size() || A.cols() != b.size())
    fail("A is " + std::to_string(A.rows()) + " x " + std::to_string(A.cols()) +
         ": must be square with " + std::to_string(b.size()) + " rows, as b has entries");
  detail::require_finite("A", A);
  std::vector<MatrixEntry> entries;
  for (Eigen::Index r = 0; r < A.rows(); ++r)
    for (Eigen::Index c = 0; c < A.cols(); ++c)
      if (A(r, c) != 0) entries.push_back({static_cast<int>(r), static_cast<int>(c), A(r, c)});
  return sparse(entries, b, std::move(cones), compliance);
}

ConeProblem ConeProblem::saddle(const std::vector<MatrixEntry>& M,
                                const std::vector<MatrixEntry>& J, const linalg::VectorView& f,
                                const linalg::VectorView& bias, std::vector<Cone> cones,
                                const linalg::VectorView& compliance) {
  const int n = static_cast<int>(f.size()), m = static_cast<int>(bias.size());
  detail::require_finite("f", f);
  detail::require_finite("bias", bias);
  detail::check_entries("M", M, n, n);
  detail::check_entries("J", J, m, n);
  std::vector<int> place, row_place(at(m), -1);
  const std::vector<MassPart> parts = mass_parts(M, J, n, place);
  std::vector<MatrixEntry> A;
  Eigen::VectorXd b = -bias;
  for (const MassPart& part : parts) {
    const auto size = static_cast<Eigen::Index>(part.members.size());
    Eigen::SimplicialLLT<Sparse> factor;
    factor_mass(part.mass, size, part.members.front(), factor);
    std::vector<int> touched;
    for (const MatrixEntry& e : part.rows)
      if (row_place[at(e.row)] < 0) {
        row_place[at(e.row)] = static_cast<int>(touched.size());
        touched.push_back(e.row);
      }
    // A = E'E, E = L^-1 J' with M = L L', is symmetric to the last bit. Entries that should vanish
    // are as small as rounding.
    Eigen::MatrixXd E = Eigen::MatrixXd::Zero(size, static_cast<Eigen::Index>(touched.size()));
    for (const MatrixEntry& e : part.rows) E(place[at(e.column)], row_place[at(e.row)]) += e.value;
    Eigen::VectorXd g(size);
    for (int i : part.members) g[place[at(i)]] = f[i];
    E = (factor.permutationP() * E).eval();
    g = (factor.permutationP() * g).eval();
    factor.matrixL().solveInPlace(E);
    factor.matrixL().solveInPlace(g);
    const Eigen::MatrixXd Ak = E.transpose() * E;
    const Eigen::VectorXd bk = E.transpose() * g;
    for (std::size_t r = 0; r < touched.size(); ++r) {
      const auto i = static_cast<Eigen::Index>(r);
      b[touched[r]] -= bk[i];
      row_place[at(touched[r])] = -1;
      for (std::size_t c = 0; c < touched.size(); ++c)
        A.push_back({touched[r], touched[c], Ak(i, static_cast<Eigen::Index>(c))});
    }
  }
  return sparse(A, b, std::move(cones), compliance);
}

linalg::MatrixX ConeProblem::dense_matrix() const {
  linalg::MatrixX A = linalg::MatrixX::Zero(rows(), rows());
  for (const MatrixEntry& e : entries_) A(e.row, e.column) = e.value;
  return A;
}

linalg::VectorX ConeProblem::velocities(const linalg::VectorView& impulses) const {
  if (impulses.size() != rows())
    detail::refuse_size("impulses", impulses.size(), rows(), "one for each row");
  linalg::VectorX w(rows());
  for (int r = 0; r < rows(); ++r) {
    long double sum = -b_[r];
    for (int e = row_start_[at(r)]; e < row_start_[at(r + 1)]; ++e)
      sum += static_cast<long double>(entries_[at(e)].value) * impulses[entries_[at(e)].column];
    w[r] = static_cast<double>(sum);
  }
  return w;
}

}  // namespace tether::contact
