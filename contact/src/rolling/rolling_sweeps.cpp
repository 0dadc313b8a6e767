// Tether: sweeps over contacts with rolling friction. SPDX-License-Identifier: BSD-3-Clause
#include "rolling/rolling_sweeps.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <tether/contact/cones.hpp>
#include <tether/linalg/index.hpp>

namespace tether::contact {

using detail::RollingSweeps;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using linalg::at;

namespace detail {

namespace {

// Rows of the contact on one body's velocities; turn: scale of the lower three.
Matrix6d rows_on(const Matrix3d& frame, const Vector3d& r, double turn) {
  Matrix6d J = Matrix6d::Zero();
  J.topLeftCorner<3, 3>() = frame;
  for (int k = 0; k < 3; ++k)
    J.block<1, 3>(k, 3) = r.cross(Vector3d(frame.row(k).transpose())).transpose();
  J.bottomRightCorner<3, 3>() = turn * frame;
  return J;
}

}  // namespace

void RollingSweeps::begin(const std::vector<RigidBody>& bodies,
                          const std::vector<RollingContact>& contacts) {
  rows_.clear();
  velocity_.resize(bodies.size());
  for (std::size_t k = 0; k < bodies.size(); ++k) velocity_[k] = bodies[k].velocities();
  scale_ = 0;
  for (const RollingContact& c : contacts) {
    const PointContact& p = c.point;
    Row row;
    row.first = p.first;
    row.second = p.second;
    row.frame = tangent_frame(p.normal);
    row.r1 = p.r1;
    row.r2 = p.r2;
    row.bias = p.bias;
    row.x.setZero();
    const Matrix6d M1 = bodies[at(p.first)].inverse_mass_matrix();
    const Matrix6d M2 =
        p.second < 0 ? Matrix6d(Matrix6d::Zero()) : bodies[at(p.second)].inverse_mass_matrix();
    // Both halves of A alike: that is the length at which moments move as much as forces do.
    const Matrix6d J1 = rows_on(row.frame, p.r1, 1), J2 = rows_on(row.frame, p.r2, 1);
    const Matrix6d plain = J1 * M1 * J1.transpose() + J2 * M2 * J2.transpose();
    const double turns = plain.bottomRightCorner<3, 3>().trace();
    row.length = turns > 0 ? std::sqrt(plain.topLeftCorner<3, 3>().trace() / turns) : 1;
    Vector6d unit = Vector6d::Ones();
    unit.tail<3>().setConstant(row.length);
    row.block = RollingBlock(unit.asDiagonal() * plain * unit.asDiagonal(), p.mu,
                             turns > 0 ? c.torsional / row.length : 0,
                             turns > 0 ? c.rolling / row.length : 0);
    row.move1 = M1 * J1.transpose() * unit.asDiagonal();
    row.move2 = M2 * J2.transpose() * unit.asDiagonal();
    // What this contact alone would change.
    const Vector6d w = relative(row);
    const RollingBlock& b = row.block;
    const double n = std::max(0.0, -w[0]), part = n / b.A(0, 0);
    if (n > 0) {
      const double slip =
          std::min(w.segment<2>(1).norm(), part * b.mu * b.A.block<2, 2>(1, 1).trace());
      const double turn = std::min(
          w.tail<3>().norm(), part * (b.spin + b.roll) * b.A.bottomRightCorner<3, 3>().trace());
      scale_ = std::max(scale_, n + slip + turn);
    }
    rows_.push_back(row);
  }
}

Vector6d RollingSweeps::relative(const Row& row) const {
  const auto of = [&](int body, const Vector3d& r) {
    const Vector6d& v = velocity_[at(body)];
    Vector6d w;
    const Vector3d turn = v.tail<3>();
    w.head<3>() = row.frame * (v.head<3>() + turn.cross(r));
    w.tail<3>() = row.length * (row.frame * turn);
    return w;
  };
  Vector6d w = of(row.first, row.r1);
  if (row.second >= 0) w -= of(row.second, row.r2);
  w[0] += row.bias;
  return w;
}

void RollingSweeps::push(const Row& row, const Vector6d& impulse) {
  velocity_[at(row.first)] += row.move1 * impulse;
  if (row.second >= 0) velocity_[at(row.second)] -= row.move2 * impulse;
}

void RollingSweeps::set(int contact, const Vector3d& impulse, const Vector3d& moment) {
  Row& row = rows_[at(contact)];
  Vector6d x;
  x.head<3>() = row.frame * impulse;
  x.tail<3>() = row.frame * moment / row.length;
  push(row, x - row.x);
  row.x = x;
}

double RollingSweeps::residual() const {
  double most = 0;
  for (const Row& row : rows_) most = std::max(most, row.block.residual(row.x, relative(row)));
  return scale_ > 0 ? most / scale_ : most;
}

// Sweeps alternate in direction: what one sends along a stack, the next one sends back.
void RollingSweeps::solve(double tolerance, int min_sweeps, int max_sweeps) {
  status = Status::solved;
  error = 0;
  sweeps = 0;
  if (!(scale_ > 0)) return;  // nothing approaches
  status = Status::work_limit;
  while (sweeps < max_sweeps) {
    double most = 0;
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      Row& row = rows_[sweeps % 2 == 0 ? k : rows_.size() - 1 - k];
      const Vector6d w = relative(row);
      most = std::max(most, row.block.residual(row.x, w));
      Vector6d x = row.x;
      row.block.solve(row.block.A * row.x - w, x);
      push(row, x - row.x);
      row.x = x;
    }
    ++sweeps;
    if (sweeps < min_sweeps && rows_.size() > 1) continue;
    if (rows_.size() > 1 && most > 10 * tolerance * scale_) continue;
    error = residual();
    if (error <= tolerance) {
      status = Status::solved;
      return;
    }
  }
  error = residual();
  if (solve_together(tolerance)) status = Status::solved;
}

// Where sweeps cycle: all rows at once, as cones. Keeps what is better.
bool RollingSweeps::solve_together(double tolerance) {
  constexpr std::size_t kMost = 100;  // A is dense in stacks
  constexpr double kMostWork = 1e8;
  if (rows_.size() > kMost) return false;
  const auto size = static_cast<Eigen::Index>(6 * rows_.size());
  const std::vector<Vector6d> kept = velocity_;
  Eigen::VectorXd b(size), x(size);
  std::vector<Cone> cones;
  for (std::size_t k = 0; k < rows_.size(); ++k) push(rows_[k], -rows_[k].x);
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    const auto row = static_cast<Eigen::Index>(6 * k);
    b.segment<6>(row) = -relative(rows_[k]);
    x.segment<6>(row) = rows_[k].x;
    const RollingBlock& block = rows_[k].block;
    cones.push_back(Cone::with_rolling(block.mu, block.roll, block.spin));
  }
  std::vector<MatrixEntry> A;
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    const Row& from = rows_[k];
    for (int c = 0; c < 6; ++c) {
      std::fill(velocity_.begin(), velocity_.end(), Vector6d::Zero());
      push(from, Vector6d::Unit(c));
      for (std::size_t i = 0; i < rows_.size(); ++i) {
        const Row& to = rows_[i];
        Vector6d w = relative(to);
        w[0] -= to.bias;
        for (int r = 0; r < 6; ++r)
          if (w[r] != 0)
            A.push_back({static_cast<int>(6 * i) + r, static_cast<int>(6 * k) + c, w[r]});
      }
    }
  }
  Options options;
  options.law = Law::coulomb;
  options.tolerance = 0.1 * tolerance;  // of another measure
  options.max_work = kMostWork;
  const Eigen::VectorXd found =
      ConeSolver(options).solve(ConeProblem::sparse(A, b, std::move(cones)), x).impulses;
  velocity_ = kept;
  const auto take = [&](const Eigen::VectorXd& impulses) {
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      const Vector6d to = impulses.segment<6>(static_cast<Eigen::Index>(6 * k));
      push(rows_[k], to - rows_[k].x);
      rows_[k].x = to;
    }
  };
  take(found);
  const double now = residual();
  if (now < error) {
    error = now;
    return error <= tolerance;
  }
  take(x);
  velocity_ = kept;
  return false;
}

Vector3d RollingSweeps::impulse(int contact) const {
  const Row& row = rows_[at(contact)];
  return row.frame.transpose() * row.x.head<3>();
}

Vector3d RollingSweeps::moment(int contact) const {
  const Row& row = rows_[at(contact)];
  return row.length * (row.frame.transpose() * row.x.tail<3>());
}

Regime RollingSweeps::regime(int contact) const {
  const Row& row = rows_[at(contact)];
  if (!(row.x[0] > 0)) return Regime::separating;
  return row.x.segment<2>(1).norm() < (1 - 1e-12) * row.block.mu * row.x[0] ? Regime::sticking
                                                                            : Regime::sliding;
}

}  // namespace detail

static void check(const RollingProblem& problem) {
  const int n = static_cast<int>(problem.bodies.size());
  for (std::size_t k = 0; k < problem.contacts.size(); ++k) {
    const RollingContact& c = problem.contacts[k];
    const PointContact& p = c.point;
    const auto fail = [&](const char* what) {
      throw std::invalid_argument("rolling contact " + std::to_string(k) + ": " + what);
    };
    if (p.first < 0 || p.first >= n || p.second < -1 || p.second >= n || p.first == p.second)
      fail("names a body that does not exist");
    if (!(p.mu >= 0 && c.rolling >= 0 && c.torsional >= 0) ||
        !std::isfinite(p.mu + c.rolling + c.torsional + p.bias))
      fail("friction, rolling and torsional must be >= 0 and finite");
    if (!p.r1.allFinite() || !p.r2.allFinite() || !(std::abs(p.normal.norm() - 1) < 1e-6))
      fail("arms must be finite and the normal a unit vector");
    if (!problem.bodies[at(p.first)].moves() &&
        (p.second < 0 || !problem.bodies[at(p.second)].moves()))
      fail("both bodies are fixed");
  }
}

RollingSolution solve(const RollingProblem& problem, double tolerance, int max_sweeps) {
  check(problem);
  RollingSweeps sweeps;
  sweeps.begin(problem.bodies, problem.contacts);
  sweeps.solve(tolerance, 0, max_sweeps);
  RollingSolution out;
  out.status = sweeps.status;
  out.error = sweeps.error;
  out.sweeps = sweeps.sweeps;
  for (int k = 0; k < static_cast<int>(problem.contacts.size()); ++k) {
    out.impulses.push_back(sweeps.impulse(k));
    out.moments.push_back(sweeps.moment(k));
  }
  for (int k = 0; k < static_cast<int>(problem.bodies.size()); ++k)
    out.velocities.push_back(sweeps.velocity(k));
  return out;
}

double rolling_residual(const RollingProblem& problem, const std::vector<Vector3d>& impulses,
                        const std::vector<Vector3d>& moments) {
  check(problem);
  if (impulses.size() != problem.contacts.size() || moments.size() != impulses.size())
    throw std::invalid_argument("rolling_residual: an impulse and a moment for each contact");
  RollingSweeps sweeps;
  sweeps.begin(problem.bodies, problem.contacts);
  for (int k = 0; k < static_cast<int>(impulses.size()); ++k)
    sweeps.set(k, impulses[at(k)], moments[at(k)]);
  return sweeps.residual();
}

}  // namespace tether::contact
