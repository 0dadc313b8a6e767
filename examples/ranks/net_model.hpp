// Tether: a net of rods over MPI ranks: F, its Jacobian, and the rows that are kept.
// SPDX-License-Identifier: BSD-3-Clause
//
// A curtain of n x n balls of 1 kg, joined by massless rods and hung from n points. Each rank has
// some rows of balls; rods to the row above reach into the next rank. Unknowns of a ball: position
// p, velocity v, and the forces of the rods upwards and to the left, divided by their lengths:
//
//   p' = v,   v' = -g - sum of d lambda,   d.(a - a_other) + |v - v_other|^2 = 0
//
// (index 1; for a rod d = p - p_other, a = v').
#pragma once

#include <mpi.h>

#include <Eigen/SparseLU>
#include <algorithm>
#include <array>
#include <cmath>
#include <tether/ida_projection.hpp>
#include <tether/ida_projection/mpi_rows.hpp>
#include <utility>
#include <vector>

namespace net {

namespace tp = tether::ida_projection;

constexpr int kPerBall = 8;  // p, v, lambda upwards and to the left
constexpr double kGravity = 9.81, kSpacing = 0.1;
using Point = std::array<double, 3>;

inline Point start_of(int row, int column) {
  const double wave = 0.05 * std::sin(1.3 * row + 0.7 * column);
  return {kSpacing * column, wave, -kSpacing * (row + 1)};
}
inline Point operator-(const Point& a, const Point& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
inline double dot(const Point& a, const Point& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Rows first .. last - 1 of n balls each.
struct Share {
  MPI_Comm comm = MPI_COMM_SELF;
  int n = 0, first = 0, last = 0;

  Share(MPI_Comm c, int balls) : comm(c), n(balls) {
    int rank = 0, ranks = 1;
    MPI_Comm_rank(c, &rank);
    MPI_Comm_size(c, &ranks);
    first = n * rank / ranks;
    last = n * (rank + 1) / ranks;
  }
  int unknowns() const { return kPerBall * n * (last - first); }
  long long global(int row, int column, int k) const {
    return kPerBall * (static_cast<long long>(row) * n + column) + k;
  }
  int local(int row, int column, int k) const {
    return kPerBall * ((row - first) * n + column) + k;
  }
  // All unknowns of the rows of balls above and below.
  std::vector<long long> beside() const {
    std::vector<long long> ids;
    for (const int row : {first - 1, last})
      for (long long k = 0; row >= 0 && row < n && first < last && k < kPerBall * n; ++k)
        ids.push_back(global(row, 0, 0) + k);
    return ids;
  }
};

// A vector on the rows first - 1 .. last.
class Halo {
 public:
  Halo(const Share& share, tp::GhostExchange& exchange)
      : share_(share), exchange_(exchange), ghosts_(exchange.ids().size()) {}
  void load(const double* own) {
    own_ = own;
    exchange_.update(own, ghosts_.data());
  }
  const double* ball(int row, int column) const {
    if (row >= share_.first && row < share_.last) return own_ + share_.local(row, column, 0);
    const bool below = row >= share_.last && share_.first > 0;
    return ghosts_.data() + kPerBall * ((below ? share_.n : 0) + column);
  }

 private:
  const Share& share_;
  tp::GhostExchange& exchange_;
  std::vector<double> ghosts_;
  const double* own_ = nullptr;
};

inline Point three(const double* x) { return {x[0], x[1], x[2]}; }

// A rod from ball (row, column) upwards (k = 0) or to the left (k = 1).
struct Rod {
  int row, column, k;
  int other_row() const { return k == 0 ? row - 1 : row; }
  int other_column() const { return k == 0 ? column : column - 1; }
  bool anchored() const { return other_row() < 0; }
  bool exists(int n) const {
    return row >= 0 && row < n && column >= 0 && column < n && (k == 0 || column > 0);
  }
  double square() const {  // of its length
    const Point d = start_of(row, column) - start_of(other_row(), other_column());
    return dot(d, d);
  }
};

struct Model {
  Share share;
  tp::GhostExchange exchange;
  Halo y, yp;
  Eigen::SparseLU<Eigen::SparseMatrix<double>> factors;

  explicit Model(Share given)
      : share(given),
        exchange(share.comm, share.unknowns(), share.beside()),
        y(share, exchange),
        yp(share, exchange) {}

  template <class Visit>
  void balls(Visit visit) const {
    for (int row = share.first; row < share.last; ++row)
      for (int column = 0; column < share.n; ++column) visit(row, column);
  }
  // p - p_other and v - v_other of vectors (p, v), or v' - v'_other in `second` of yp.
  std::array<Point, 2> along(const Rod& rod, const Halo& of) const {
    const double* here = of.ball(rod.row, rod.column);
    std::array<Point, 2> d = {three(here), three(here + 3)};
    if (rod.anchored()) {
      if (&of == &y) d[0] = d[0] - start_of(-1, rod.column);
      return d;
    }
    const double* there = of.ball(rod.other_row(), rod.other_column());
    return {d[0] - three(there), d[1] - three(there + 3)};
  }

  void residual(const double* own, const double* rates, double* out) {
    y.load(own);
    yp.load(rates);
    balls([&](int row, int column) {
      const double *b = y.ball(row, column), *bp = yp.ball(row, column);
      double* r = out + share.local(row, column, 0);
      for (int i = 0; i < 3; ++i) {
        r[i] = bp[i] - b[3 + i];
        r[3 + i] = bp[3 + i] + (i == 2 ? kGravity : 0.0);
      }
      for (int k = 0; k < 2; ++k) {
        const Rod rod{row, column, k},
            next{k == 0 ? row + 1 : row, k == 0 ? column : column + 1, k};
        r[6 + k] = b[6 + k];
        if (rod.exists(share.n)) {
          const auto [d, w] = along(rod, y);
          for (std::size_t i = 0; i < 3; ++i) r[3 + i] += d[i] * b[6 + k];
          r[6 + k] = dot(d, along(rod, yp)[1]) + dot(w, w);
        }
        if (next.exists(share.n)) {
          const Point d = along(next, y)[0];
          const double lambda = y.ball(next.row, next.column)[6 + k];
          for (std::size_t i = 0; i < 3; ++i) r[3 + i] -= d[i] * lambda;
        }
      }
    });
  }

  // The rows of dF/dy + cj dF/dy' that belong to this rank: add(row, column, entry), global.
  template <class Add>
  void jacobian(const double* own, const double* rates, double cj, Add add) {
    y.load(own);
    yp.load(rates);
    balls([&](int row, int column) {
      const long long at = share.global(row, column, 0);
      for (int i = 0; i < 3; ++i) {
        add(at + i, at + i, cj);
        add(at + i, at + 3 + i, -1.0);
        add(at + 3 + i, at + 3 + i, cj);
      }
      for (int k = 0; k < 2; ++k)
        if (!Rod{row, column, k}.exists(share.n)) add(at + 6 + k, at + 6 + k, 1.0);
    });
    const auto here = [&](int row) { return row >= share.first && row < share.last; };
    for (int row = share.first; row <= std::min(share.last, share.n - 1); ++row)
      for (int column = 0; column < share.n; ++column)
        for (int k = 0; k < 2; ++k) {
          const Rod rod{row, column, k};
          if (!rod.exists(share.n) || (!here(row) && (k == 1 || !here(row - 1)))) continue;
          const auto [d, w] = along(rod, y);
          const Point a = along(rod, yp)[1];
          const double lambda = y.ball(row, column)[6 + k];
          struct End {
            bool mine;
            long long at;
            double sign;
          };
          std::vector<End> ends = {{here(row), share.global(row, column, 0), 1.0}};
          if (!rod.anchored())
            ends.push_back({here(rod.other_row()),
                            share.global(rod.other_row(), rod.other_column(), 0), -1.0});
          const long long force = ends[0].at + 6 + k;
          for (const End& end : ends)
            for (int i = 0; i < 3; ++i) {
              const auto x = static_cast<std::size_t>(i);
              if (end.mine) {
                for (const End& by : ends)
                  add(end.at + 3 + i, by.at + i, end.sign * by.sign * lambda);
                add(end.at + 3 + i, force, end.sign * d[x]);
              }
              if (!ends[0].mine) continue;
              add(force, end.at + i, end.sign * a[x]);
              add(force, end.at + 3 + i, end.sign * (cj * d[x] + 2.0 * w[x]));
            }
        }
  }

  // The part of it that ties this rank's unknowns to each other.
  bool factor(const double* own, const double* rates, double cj) {
    const long long first = share.global(share.first, 0, 0), count = share.unknowns();
    std::vector<Eigen::Triplet<double>> entries;
    jacobian(own, rates, cj, [&](long long row, long long column, double entry) {
      if (column >= first && column < first + count)
        entries.emplace_back(static_cast<int>(row - first), static_cast<int>(column - first),
                             entry);
    });
    Eigen::SparseMatrix<double> matrix(share.unknowns(), share.unknowns());
    matrix.setFromTriplets(entries.begin(), entries.end());
    factors.compute(matrix);
    return factors.info() == Eigen::Success;
  }

  // Lengths and their rates, each row given by its rank. Own unknowns, then ghosts.
  tp::Constraints rows() const {
    std::vector<Rod> rods;
    balls([&](int row, int column) {
      for (int k = 0; k < 2; ++k)
        if (Rod{row, column, k}.exists(share.n)) rods.push_back({row, column, k});
    });
    std::vector<int> starts = {0};
    std::vector<long long> columns;
    for (const int entries : {3, 6})  // of each ball: p; p and v
      for (const Rod& rod : rods) {
        for (int i = 0; i < entries; ++i) {
          columns.push_back(share.global(rod.row, rod.column, i));
          if (!rod.anchored())
            columns.push_back(share.global(rod.other_row(), rod.other_column(), i));
        }
        starts.push_back(static_cast<int>(columns.size()));
      }
    tp::DistributedRows given = tp::distributed_rows(share.comm, share.unknowns(), starts, columns);

    // The entries of the second half say where the rods' p - p_other and v - v_other are.
    const auto read = [rods, starts, local = given.columns](tp::ConstVector all, std::size_t rod) {
      std::array<double, 6> d{};
      int e = starts[rods.size() + rod];
      for (std::size_t i = 0; i < 6; ++i) {
        d[i] = all[local[static_cast<std::size_t>(e++)]];
        if (!rods[rod].anchored()) d[i] -= all[local[static_cast<std::size_t>(e++)]];
      }
      if (rods[rod].anchored())
        for (std::size_t i = 0; i < 3; ++i) d[i] -= start_of(-1, rods[rod].column)[i];
      return d;
    };
    tp::Constraints set;
    set.count = static_cast<int>(2 * rods.size());
    set.value = [rods, read](double, tp::ConstVector all, tp::Vector g) {
      const auto count = static_cast<Eigen::Index>(rods.size());
      for (Eigen::Index r = 0; r < count; ++r) {
        const auto d = read(all, static_cast<std::size_t>(r));
        g[r] = 0.5 * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] -
                      rods[static_cast<std::size_t>(r)].square());
        g[count + r] = d[0] * d[3] + d[1] * d[4] + d[2] * d[5];
      }
    };
    given.fill = [rods, read](double, tp::ConstVector all, tp::Vector entries) {
      Eigen::Index e = 0;
      for (const bool rate : {false, true})
        for (std::size_t r = 0; r < rods.size(); ++r) {
          const auto d = read(all, r);
          for (std::size_t i = 0; i < (rate ? 6 : 3); ++i) {
            const double entry = !rate ? d[i] : i < 3 ? d[3 + i] : d[i - 3];
            entries[e++] = entry;
            if (!rods[r].anchored()) entries[e++] = -entry;
          }
        }
    };
    set.jacobian = std::move(given);
    return set;
  }

  // Largest error of a length, in parts of it.
  double drift(const double* own) {
    y.load(own);
    double worst = 0.0;
    balls([&](int row, int column) {
      for (int k = 0; k < 2; ++k) {
        const Rod rod{row, column, k};
        if (!rod.exists(share.n)) continue;
        const Point d = along(rod, y)[0];
        worst = std::max(worst, std::abs(std::sqrt(dot(d, d) / rod.square()) - 1.0));
      }
    });
    MPI_Allreduce(MPI_IN_PLACE, &worst, 1, MPI_DOUBLE, MPI_MAX, share.comm);
    return worst;
  }
};

}  // namespace net
