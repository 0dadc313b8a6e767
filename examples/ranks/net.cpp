// Tether: a net of rods over MPI ranks that keep their lengths. SPDX-License-Identifier:
// BSD-3-Clause
//
// mpiexec -n 4 example_ranks_net [balls in a row [seconds]]
//
// A curtain of n x n balls of 1 kg, joined by massless rods and hung from n points. Each rank has
// some rows of balls; rods to the row above reach into the next rank. Unknowns of a ball: position
// p, velocity v, and the forces of the rods upwards and to the left, divided by their lengths:
//
//   p' = v,   v' = -g - sum of d lambda,   d.(a - a_other) + |v - v_other|^2 = 0
//
// (index 1; for a rod d = p - p_other, a = v'). IDA lets the lengths drift; DistributedRows hold
// them and their rates. GMRES solves IDA's systems, preconditioned by each rank's own block, or,
// where it was found, MUMPS.
#include <Eigen/SparseLU>
#include <ida/ida.h>
#include <mpi.h>
#include <nvector/nvector_parallel.h>
#include <sunlinsol/sunlinsol_spgmr.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <tether/ida_projection.hpp>
#include <tether/ida_projection/mpi_rows.hpp>
#include <utility>
#include <vector>

#ifdef TETHER_EXAMPLE_MUMPS
#include "mumps_solver.hpp"
#endif

namespace tp = tether::ida_projection;

namespace {

constexpr int kPerBall = 8;  // p, v, lambda upwards and to the left
constexpr double kGravity = 9.81, kSpacing = 0.1, kTolerance = 1e-6;
using Point = std::array<double, 3>;

Point start_of(int row, int column) {
  const double wave = 0.05 * std::sin(1.3 * row + 0.7 * column);
  return {kSpacing * column, wave, -kSpacing * (row + 1)};
}
Point operator-(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
double dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

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

Point three(const double* x) { return {x[0], x[1], x[2]}; }

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

    // Where the rods' p - p_other and v - v_other are, by the entries of the second half.
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

Model& model_of(void* data) { return *static_cast<Model*>(data); }

int residual(sunrealtype, N_Vector y, N_Vector yp, N_Vector r, void* data) {
  model_of(data).residual(NV_DATA_P(y), NV_DATA_P(yp), NV_DATA_P(r));
  return 0;
}
int set_up(sunrealtype, N_Vector y, N_Vector yp, N_Vector, sunrealtype cj, void* data) {
  return model_of(data).factor(NV_DATA_P(y), NV_DATA_P(yp), cj) ? 0 : 1;
}
int precondition(sunrealtype, N_Vector, N_Vector, N_Vector, N_Vector r, N_Vector z, sunrealtype,
                 sunrealtype, void* data) {
  const Model& model = model_of(data);
  Eigen::Map<Eigen::VectorXd>(NV_DATA_P(z), model.share.unknowns()) =
      model.factors.solve(Eigen::Map<const Eigen::VectorXd>(NV_DATA_P(r), model.share.unknowns()));
  return 0;
}

#ifdef TETHER_EXAMPLE_MUMPS
int fill(sunrealtype, sunrealtype cj, N_Vector y, N_Vector yp, N_Vector, SUNMatrix matrix,
         void* data, N_Vector, N_Vector, N_Vector) {
  RankEntries& entries = entries_of(matrix);
  model_of(data).jacobian(
      NV_DATA_P(y), NV_DATA_P(yp), cj,
      [&](long long row, long long column, double entry) { entries.add(row, column, entry); });
  return 0;
}
#endif

enum class Solver { gmres, mumps };

// IDA's linear solver, and its matrix if it has one.
struct LinearSolver {
  SUNLinearSolver solver = nullptr;
  SUNMatrix matrix = nullptr;

  LinearSolver(Solver which, void* ida, N_Vector y, SUNContext context) {
#ifdef TETHER_EXAMPLE_MUMPS
    if (which == Solver::mumps) {
      matrix = new_rank_matrix(context);
      solver = new_mumps_solver(y, context);
      IDASetLinearSolver(ida, solver, matrix);
      IDASetJacFn(ida, fill);
      return;
    }
#endif
    (void)which;
    // One message for all scalar products of an iteration, not one for each.
    solver = SUNLinSol_SPGMR(y, SUN_PREC_LEFT, 60, context);
    SUNLinSol_SPGMRSetGSType(solver, SUN_CLASSICAL_GS);
    IDASetLinearSolver(ida, solver, nullptr);
    IDASetPreconditioner(ida, set_up, precondition);
    IDASetEpsLin(ida, 0.01);
  }
  void free() {
    SUNLinSolFree(solver);
    if (matrix != nullptr) SUNMatDestroy(matrix);
  }
};

struct End {
  std::vector<double> own;
  double drift = 0.0, seconds = 0.0, projecting = 0.0;
  long steps = 0;
  int flag = 0;
};

End run(MPI_Comm comm, int n, double seconds, bool project, Solver which = Solver::gmres) {
  SUNContext context = nullptr;
#if SUNDIALS_VERSION_MAJOR >= 7
  SUNContext_Create(comm, &context);
#else
  SUNContext_Create(&comm, &context);
#endif
  Model model{Share(comm, n)};
  const Share& share = model.share;
  N_Vector y = N_VNew_Parallel(comm, share.unknowns(), kPerBall * n * n, context);
  N_VEnableFusedOps_Parallel(y, 1);
  N_Vector yp = N_VClone(y), id = N_VClone(y);
  N_VConst(0.0, y);
  N_VConst(0.0, yp);
  N_VConst(1.0, id);
  model.balls([&](int row, int column) {
    const Point p = start_of(row, column);
    const int at = share.local(row, column, 0);
    std::copy(p.begin(), p.end(), NV_DATA_P(y) + at);
    NV_DATA_P(yp)[at + 5] = -kGravity;
    NV_DATA_P(id)[at + 6] = NV_DATA_P(id)[at + 7] = 0.0;
  });
  void* ida = IDACreate(context);
  IDAInit(ida, residual, 0.0, y, yp);
  IDASStolerances(ida, kTolerance, kTolerance);
  IDASetUserData(ida, &model);
  IDASetMaxNumSteps(ida, 100000);
  IDASetId(ida, id);
  IDASetSuppressAlg(ida, 1);
  LinearSolver linear(which, ida, y, context);
  End end;
  {
    tp::Options options;
    options.id = id;
    std::unique_ptr<tp::Projection> projection;
    if (project) projection = std::make_unique<tp::Projection>(ida, model.rows(), options);
    end.flag = IDACalcIC(ida, IDA_YA_YDP_INIT, 1e-3);
    double t = 0.0;
    const double begin = MPI_Wtime();
    if (end.flag >= 0) end.flag = IDASolve(ida, seconds, &t, y, yp, IDA_NORMAL);
    end.seconds = MPI_Wtime() - begin;
    if (projection) {
      end.projecting = projection->statistics().seconds;
      projection->project(t, y, yp);
    }
    IDAGetNumSteps(ida, &end.steps);
    IDAFree(&ida);
  }
  end.own.assign(NV_DATA_P(y), NV_DATA_P(y) + share.unknowns());
  end.drift = model.drift(NV_DATA_P(y));
  linear.free();
  for (N_Vector v : {y, yp, id}) N_VDestroy(v);
  SUNContext_Free(&context);
  return end;
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  int rank = 0, ranks = 1;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  const int n = argc > 1 ? std::atoi(argv[1]) : 8;
  const double seconds = argc > 2 ? std::atof(argv[2]) : 0.5;
  if (argc > 3 || n < std::max(ranks, 2) || n > 1000 || !(seconds > 0.0 && seconds <= 100.0)) {
    if (rank == 0)
      std::fprintf(
          stderr,
          "usage: example_ranks_net [balls in a row, %d to 1000 on %d ranks [seconds, above "
          "0, at most 100]]\n",
          std::max(ranks, 2), ranks);
    MPI_Finalize();
    return 2;
  }
  const End plain = run(MPI_COMM_WORLD, n, seconds, false);
  const End spread = run(MPI_COMM_WORLD, n, seconds, true);
  const End alone = run(MPI_COMM_SELF, n, seconds, true);
  std::vector<std::pair<const char*, End>> others;  // projected, too
#ifdef TETHER_EXAMPLE_MUMPS
  others.emplace_back("projected, MUMPS", run(MPI_COMM_WORLD, n, seconds, true, Solver::mumps));
#endif

  const Share mine(MPI_COMM_WORLD, n);
  const auto apart = [&](const End& one) {  // its positions from those on one rank
    const auto from = static_cast<std::size_t>(mine.global(mine.first, 0, 0));
    double most = 0.0;
    for (std::size_t j = 0; j < one.own.size(); ++j)
      if (j % kPerBall < 3) most = std::max(most, std::abs(one.own[j] - alone.own[j + from]));
    MPI_Allreduce(MPI_IN_PLACE, &most, 1, MPI_DOUBLE, MPI_MAX, MPI_COMM_WORLD);
    return most;
  };
  double most_apart = apart(spread);
  bool good = plain.flag >= 0 && spread.flag >= 0 && alone.flag >= 0 && spread.drift < 1e-10;
  for (const auto& [name, end] : others) {
    most_apart = std::max(most_apart, apart(end));
    good = good && end.flag >= 0 && end.drift < 1e-10;
  }
  if (rank == 0) {
    std::printf(
        "%d ranks, %d x %d balls, %.2g s   steps   lengths off by   seconds   projection's part\n",
        ranks, n, n, seconds);
    const auto print = [](const char* name, const End& end) {
      std::printf("%-29s %5ld %16.1e %9.2f %18.0f%%   flag %d\n", name, end.steps, end.drift,
                  end.seconds, 100.0 * end.projecting / end.seconds, end.flag);
    };
    print("plain IDA", plain);
    print("projected", spread);
    print("projected, one rank", alone);
    for (const auto& [name, end] : others) print(name, end);
    std::printf("positions on %d ranks and on one are %.1e apart\n", ranks, most_apart);
  }
  MPI_Finalize();
  return good && most_apart < 1e2 * kTolerance ? 0 : 1;
}
