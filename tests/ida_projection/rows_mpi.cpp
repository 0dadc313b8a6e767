// Tether: rows that are spread over MPI ranks. SPDX-License-Identifier: BSD-3-Clause
//
// mpiexec -n 3 rows_mpi: points that go round a circle at one speed. Rows hold the radius of each
// and the angle between neighbours, which may live on two ranks; of several ranks the last one has
// no points. Oracles are the closed form and sparse rows in one process. Then: rows that fail on
// one rank alone, and rows of different ranks that contradict each other.
#include <ida/ida.h>
#include <mpi.h>
#include <nvector/nvector_parallel.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_spgmr.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <tether/ida_projection.hpp>
#include <tether/ida_projection/mpi_rows.hpp>
#include <vector>

namespace tp = tether::ida_projection;

namespace {

constexpr int kPoints = 30;
constexpr double kEnd = 10.0, kTolerance = 1e-6;
int rank_of_world = 0, failures = 0;

void check(bool good, const std::string& what) {
  if (good) return;
  ++failures;
  std::printf("rank %d: %s\n", rank_of_world, what.c_str());
}

double angle(int point) { return 0.3 * point + 0.1 * std::sin(5.0 * point); }

/// Points first .. last - 1.
struct Share {
  MPI_Comm comm = MPI_COMM_SELF;
  int first = 0, last = kPoints;
  int unknowns() const { return 2 * (last - first); }
};

/// The rows that this rank gives: first the radii, then the angles to the next point.
struct Rows {
  std::vector<int> starts = {0};
  std::vector<long long> columns;
  std::vector<double> right;  ///< p.p or p.q
  std::vector<std::string> names;

  void add(int p, int q, double value, const std::string& name) {
    for (const int point : {p, q})
      for (int k = 0; k < 2 && (point == p || p != q); ++k) columns.push_back(2 * point + k);
    if (p == q) columns.resize(columns.size() - 2);
    starts.push_back(static_cast<int>(columns.size()));
    right.push_back(value);
    names.push_back(name);
  }
};

Rows rows_of(const Share& share, bool contradicting) {
  Rows rows;
  for (int p = share.first; p < share.last; ++p) rows.add(p, p, 1.0, "radius " + std::to_string(p));
  for (int p = share.first; p < share.last && p + 1 < kPoints; ++p)
    rows.add(p, p + 1, std::cos(angle(p + 1) - angle(p)), "angle " + std::to_string(p));
  // The rows above make it what it is, on several ranks.
  if (contradicting && share.first == 0)
    rows.add(0, kPoints - 1, std::cos(angle(kPoints - 1) - angle(0)) + 0.01, "closing");
  return rows;
}

template <class Given>
tp::Constraints constraints(const Rows& rows, Given given) {
  const auto visit = [starts = given.starts, columns = given.columns](const auto& y, auto at) {
    for (std::size_t i = 0; i + 1 < starts.size(); ++i) {
      const auto e = static_cast<std::size_t>(starts[i]);
      const bool radius = starts[i + 1] - starts[i] == 2;
      const double* p[2] = {y.data() + columns[e], y.data() + columns[radius ? e : e + 2]};
      at(i, e, radius, p);
    }
  };
  tp::Constraints set;
  set.count = static_cast<int>(rows.right.size());
  set.names = rows.names;
  set.value = [visit, right = rows.right](double, tp::ConstVector y, tp::Vector g) {
    visit(y, [&](std::size_t i, std::size_t, bool, const double* const* p) {
      g[static_cast<Eigen::Index>(i)] = p[0][0] * p[1][0] + p[0][1] * p[1][1] - right[i];
    });
  };
  given.fill = [visit](double, tp::ConstVector y, tp::Vector entries) {
    visit(y, [&](std::size_t, std::size_t e, bool radius, const double* const* p) {
      for (int k = 0; k < 2; ++k) {
        const auto at = static_cast<Eigen::Index>(e) + k;
        entries[at] = radius ? 2.0 * p[0][k] : p[1][k];
        if (!radius) entries[at + 2] = p[0][k];
      }
    });
  };
  set.jacobian = std::move(given);
  return set;
}

int residual(sunrealtype, N_Vector y, N_Vector yp, N_Vector r, void* data) {
  const int n = static_cast<Share*>(data)->unknowns();
  const double *s = N_VGetArrayPointer(y), *d = N_VGetArrayPointer(yp);
  double* out = N_VGetArrayPointer(r);
  for (int k = 0; k < n; k += 2) {
    out[k] = d[k] + s[k + 1];
    out[k + 1] = d[k + 1] - s[k];
  }
  return 0;
}

struct End {
  int flag = 0;
  long steps = 0;
  double error = 0.0;
  std::vector<double> own;
  tp::Statistics statistics;
  tp::Status status = tp::Status::unused;
  std::string message;
};

End run(Share share, const tp::Constraints& rows) {
  SUNContext context = nullptr;
#if SUNDIALS_VERSION_MAJOR >= 7
  SUNContext_Create(share.comm, &context);
  SUNContext_ClearErrHandlers(context);
#else
  SUNContext_Create(&share.comm, &context);
#endif
  const int n = share.unknowns();
  const bool whole = n == 2 * kPoints && share.comm == MPI_COMM_SELF;
  N_Vector y =
      whole ? N_VNew_Serial(n, context) : N_VNew_Parallel(share.comm, n, 2 * kPoints, context);
  N_Vector yp = N_VClone(y);
  for (int k = 0; k < n; k += 2) {
    const double a = angle(share.first + k / 2);
    double *s = N_VGetArrayPointer(y) + k, *d = N_VGetArrayPointer(yp) + k;
    d[1] = s[0] = std::cos(a);
    s[1] = std::sin(a);
    d[0] = -s[1];
  }
  void* ida = IDACreate(context);
#if SUNDIALS_VERSION_MAJOR < 7
  IDASetErrFile(ida, nullptr);
#endif
  IDAInit(ida, residual, 0.0, y, yp);
  IDASStolerances(ida, kTolerance, kTolerance);
  IDASetUserData(ida, &share);
  IDASetMaxNumSteps(ida, 20000);
  SUNLinearSolver solver = SUNLinSol_SPGMR(y, SUN_PREC_NONE, 20, context);
  IDASetLinearSolver(ida, solver, nullptr);
  End end;
  {
    tp::Projection projection(ida, rows);
    double t = 0.0;
    while (t < kEnd && end.flag >= 0) end.flag = IDASolve(ida, kEnd, &t, y, yp, IDA_ONE_STEP);
    IDAGetNumSteps(ida, &end.steps);
    end.statistics = projection.statistics();
    end.status = projection.status();
    end.message = projection.message();
    for (int k = 0; k < n; k += 2) {
      const double a = angle(share.first + k / 2) + t;
      const double* s = N_VGetArrayPointer(y) + k;
      end.error = std::max(end.error, std::hypot(s[0] - std::cos(a), s[1] - std::sin(a)));
      end.own.insert(end.own.end(), s, s + 2);
    }
    IDAFree(&ida);
  }
  SUNLinSolFree(solver);
  N_VDestroy(yp);
  N_VDestroy(y);
  SUNContext_Free(&context);
  return end;
}

tp::Constraints spread_rows(const Share& share, bool contradicting = false) {
  const Rows rows = rows_of(share, contradicting);
  return constraints(rows,
                     tp::distributed_rows(share.comm, share.unknowns(), rows.starts, rows.columns));
}

/// The squared length of the sum of all points, which the other rows imply.
tp::Constraints sum_row(const Share& share) {
  const auto sum = [share](N_Vector y) {
    std::array<double, 2> own{}, all{};
    for (int k = 0; k < share.unknowns(); ++k)
      own[static_cast<std::size_t>(k % 2)] += N_VGetArrayPointer(y)[k];
    MPI_Allreduce(own.data(), all.data(), 2, MPI_DOUBLE, MPI_SUM, share.comm);
    return all;
  };
  double x = 0.0, y = 0.0;
  for (int p = 0; p < kPoints; ++p) {
    x += std::cos(angle(p));
    y += std::sin(angle(p));
  }
  const double square = x * x + y * y;
  tp::Gradients rows;
  rows.value = [=](double, N_Vector at, double* g) {
    const std::array<double, 2> now = sum(at);
    g[0] = now[0] * now[0] + now[1] * now[1] - square;
  };
  rows.fill = [=](double, N_Vector at, N_Vector* row) {
    const std::array<double, 2> now = sum(at);
    for (int k = 0; k < share.unknowns(); ++k)
      N_VGetArrayPointer(row[0])[k] = 2.0 * now[static_cast<std::size_t>(k % 2)];
  };
  tp::Constraints set;
  set.count = 1;
  set.names = {"sum"};
  set.jacobian = rows;
  return set;
}

void with_full_row(const Share& share) {
  const End end = run(share, spread_rows(share) + sum_row(share));
  check(end.flag >= 0, "with a full row: " + end.message);
  check(end.statistics.failures() == 0, "with a full row moves failed");
  check(end.statistics.largest_drift_after < 1e-9, "with a full row drift is left");
  check(end.statistics.rank_drops == end.statistics.factorizations, "the full row is no other's");
}

void same_motion(const Share& share) {
  const Rows all = rows_of(Share{}, false);
  tp::SparseJacobian sparse;
  sparse.starts = all.starts;
  sparse.columns.assign(all.columns.begin(), all.columns.end());
  const End alone = run(Share{}, constraints(all, sparse)), spread = run(share, spread_rows(share));
  check(alone.flag >= 0 && spread.flag >= 0, "a run failed: " + spread.message);
  check(std::abs(alone.steps - spread.steps) <= alone.steps / 20, "the steps differ");
  check(spread.error <= 1.5 * alone.error + 1e-9, "the error is " + std::to_string(spread.error));
  check(spread.statistics.failures() == 0, "moves failed");
  check(spread.statistics.rank_drops == 0, "rows were dropped");
  check(spread.statistics.largest_drift_after < 1e-9, "the drift is left");
  check(spread.statistics.largest_drift_after > 0.0, "the drift was not looked at");
  if (rank_of_world == 0)
    std::printf("ranks: steps %ld (sparse rows, one process: %ld), error %.2e (%.2e), drift %.1e\n",
                spread.steps, alone.steps, spread.error, alone.error,
                spread.statistics.largest_drift_after);
}

/// g fails with `flag` on the rank that has the last point, once, in the middle of the run.
void failing(const Share& share, int flag) {
  tp::Constraints rows = spread_rows(share);
  const bool here = share.last == kPoints && share.first < kPoints;
  int calls = 0;
  rows.value = [&, value = rows.value](double t, tp::ConstVector y, tp::Vector g) {
    value(t, y, g);
    return here && ++calls == 40 ? flag : 0;
  };
  const End end = run(share, rows);
  const std::string name = "flag " + std::to_string(flag) + ": ";
  if (flag > 0) {
    check(end.flag >= 0, name + "the run failed");
    check(end.statistics.callback_recoverable == 1, name + "it was not counted everywhere");
    return;
  }
  check(end.flag < 0, name + "the run went on");
  check(end.status == tp::Status::callback_fatal, name + "status " + tp::to_string(end.status));
  check(
      end.message.find(here ? "value returned -1" : "rows of another process") != std::string::npos,
      name + end.message);
}

void contradicting(const Share& share) {
  const End end = run(share, spread_rows(share, true));
  check(end.flag < 0 && end.steps == 0, "contradicting rows were taken");
  check(end.status == tp::Status::inconsistent, std::string("status ") + tp::to_string(end.status));
  check(end.message.find("contradict") != std::string::npos, end.message);
}

void wrong_columns(const Share& share) {
  std::vector<long long> columns;
  if (share.last == kPoints && share.first < kPoints) columns = {2 * kPoints};
  std::string text;
  try {
    (void)tp::distributed_rows(share.comm, share.unknowns(), {0, static_cast<int>(columns.size())},
                               columns);
  } catch (const std::invalid_argument& refusal) {
    text = refusal.what();
  }
  check(text.find(columns.empty() ? "another rank" : "it must be 0 .. 59") != std::string::npos,
        "a wrong column: " + text);
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  int ranks = 1;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_of_world);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  const int with_points = std::max(1, ranks - 1);
  const int part = std::min(rank_of_world, with_points), next = std::min(part + 1, with_points);
  const Share share{MPI_COMM_WORLD, kPoints * part / with_points, kPoints * next / with_points};
  same_motion(share);
  with_full_row(share);
  failing(share, 1);
  failing(share, -1);
  contradicting(share);
  wrong_columns(share);
  MPI_Allreduce(MPI_IN_PLACE, &failures, 1, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
  MPI_Finalize();
  return failures == 0 ? 0 : 1;
}
