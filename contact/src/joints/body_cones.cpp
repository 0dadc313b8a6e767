// Tether: contacts, limits, motors and moments of bodies as a product of cones.
// SPDX-License-Identifier: BSD-3-Clause
#include "joints/body_cones.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tether/linalg/index.hpp>
#include <tether/linalg/least_squares.hpp>
#include <tether/linalg/pivoted_qr.hpp>
#include <tether/linalg/symmetric_eigen.hpp>

#include "cones/cone_rows.hpp"

namespace tether::contact::detail {

namespace {

// A direction is held by the joints if A is less than this part of A without joints there. Both are
// squares of lengths; rounding leaves a length of about 1e-14.
constexpr double kHeld = 1e-14;

using linalg::at;

// Sum of its terms, row by row, each as `part` has it.
template <class Part>
BodyCone::Column sum(const BodyCone& c, const std::vector<Vector6d>& v, const Part& part) {
  BodyCone::Column w = part(c.bias);
  for (const BodyCone::Term& t : c.terms) w += part(t.J) * part(v[at(t.body)]);
  return w;
}
BodyCone::Column speeds(const BodyCone& c, const std::vector<Vector6d>& v) {
  return sum(
      c, v, [](const auto& x) -> const auto& { return x; });
}
// Upper bound of that.
BodyCone::Column largest_speeds(const BodyCone& c, const std::vector<Vector6d>& v) {
  return sum(c, v, [](const auto& x) { return x.cwiseAbs(); });
}

constexpr double kRank = 1e-6;  // of rows in their own scale

// A in that scale, and the scale.
Eigen::MatrixXd scaled(const ConeProblem& problem, Eigen::VectorXd& scale) {
  const Eigen::MatrixXd A = problem.dense_matrix();
  scale = A.diagonal();
  for (double& s : scale) s = s > 0 ? 1 / std::sqrt(s) : 0;
  return scale.asDiagonal() * A * scale.asDiagonal();
}

// Whether contacts can share their loads in more than one way, as four wheels of a cart can. An
// iteration may end at any lawful distribution and would jump between them from step to step.
// (Slips that depend on each other, as in a chain on the floor, do not count: with a stress along
// it the chain did not stay at rest.)
bool share_loads(const ConeProblem& problem) {
  Eigen::VectorXd scale;
  const Eigen::MatrixXd A = scaled(problem, scale);
  std::vector<int> rows;
  for (std::size_t k = 0; k < problem.cones().size(); ++k)
    if (is_contact(problem.cones()[k].kind)) rows.push_back(problem.first_row(static_cast<int>(k)));
  const auto n = static_cast<Eigen::Index>(rows.size());
  if (n == 0) return false;
  Eigen::MatrixXd normals(n, n);
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = 0; i < n; ++i)
      normals(i, j) = A(rows[at(static_cast<int>(i))], rows[at(static_cast<int>(j))]);
  linalg::PivotedQr of_normals(kRank);
  of_normals.factor(normals);
  return of_normals.rank() < n;
}

// The least x, each row in its own scale, with A x = b: it depends on A and b alone. Sets x to it
// and returns true if Coulomb's law allows it.
bool hold_all(const ConeProblem& problem, double tolerance, linalg::VectorX& x) {
  Eigen::VectorXd scale;
  linalg::LeastSquares factor(kRank);
  factor.factor(scaled(problem, scale));
  const Eigen::VectorXd held =
      scale.cwiseProduct(Eigen::VectorXd(factor.solve(scale.cwiseProduct(problem.b()))));
  for (std::size_t k = 0; k < problem.cones().size(); ++k) {
    const Cone& cone = problem.cones()[k];
    const int first = problem.first_row(static_cast<int>(k));
    const double normal = held[first];
    if (is_contact(cone.kind) && !(normal >= 0)) return false;
    bool lawful = true;
    each_part(cone.kind, [&](int from, int count) {
      lawful = lawful && held.segment(first + from, count).norm() <= bound_of(cone, from, normal);
    });
    if (!lawful) return false;
  }
  const double enough = 0.1 * tolerance * problem.b().cwiseAbs().maxCoeff();
  if (!(problem.velocities(held).cwiseAbs().maxCoeff() <= enough)) return false;
  x = held;
  return true;
}

}  // namespace

BodyCone contact_cone(const PointContact& p, double rolling, double torsional) {
  const bool rolls = rolling > 0, spins = torsional > 0;
  BodyCone out(rolls && spins ? Cone::with_rolling(p.mu, rolling, torsional)
               : rolls        ? Cone::with_rolling(p.mu, rolling)
               : spins        ? Cone::with_torsional(p.mu, torsional)
                              : Cone::friction(p.mu));
  const ContactRows point = ContactRows::at_point(p.first, p.second, p.r1, p.r2, p.normal, p.mu);
  const Eigen::Matrix3d frame = tangent_frame(p.normal);
  const ConeParts parts = parts_of(out.cone.kind);
  BodyCone::Rows J = BodyCone::Rows::Zero(out.cone.rows, 6);
  J.topRows<3>() = point.J1;
  if (spins) J.block<1, 3>(parts.spin, 3) = frame.row(0);
  if (rolls) J.block<2, 3>(parts.rolling, 3) = frame.bottomRows<2>();
  out.terms.push_back({p.first, J});
  if (p.second >= 0) {
    J = -J;
    J.topRows<3>() = point.J2;
    out.terms.push_back({p.second, J});
  }
  out.bias.head<3>() = frame * p.slip;
  out.bias[0] += p.bias;
  return out;
}

void scale_tangents(const std::array<Eigen::Vector3d, 2>& tangents, const PointContact& p,
                    BodyCone& cone) {
  const Eigen::Matrix3d frame = tangent_frame(p.normal);
  Eigen::Matrix2d turn;
  for (int k = 0; k < 2; ++k) turn.row(k) = frame.bottomRows<2>() * tangents[at(k)];
  for (BodyCone::Term& t : cone.terms) t.J.middleRows<2>(1) = (turn * t.J.middleRows<2>(1)).eval();
  cone.bias.segment<2>(1) = (turn * cone.bias.segment<2>(1)).eval();
}

void BodyCones::find_islands(const Mechanisms& mechanisms, const std::vector<BodyCone>& cones) {
  const int n = static_cast<int>(cones.size());
  sets_.reset(n);
  first_on_.assign(at(mechanisms.count() + mechanisms.bodies()), -1);
  for (int i = 0; i < n; ++i)
    for (const BodyCone::Term& t : cones[at(i)].terms) {
      if (!mechanisms.moves(t.body)) continue;
      int& first = first_on_[at(node_of(mechanisms, t.body))];
      if (first < 0) first = i;
      sets_.join(first, i);
    }
  order_.resize(cones.size());
  std::iota(order_.begin(), order_.end(), 0);
  std::stable_sort(order_.begin(), order_.end(),
                   [&](int i, int j) { return sets_.root(i) < sets_.root(j); });
  start_.clear();
  for (int k = 0; k < n; ++k)
    if (k == 0 || sets_.root(order_[at(k)]) != sets_.root(order_[at(k - 1)])) start_.push_back(k);
  start_.push_back(n);
}

// Lists the moving bodies of the island's cones, by node, then by cone. Returns whether it has a
// mechanism.
bool BodyCones::collect_sides(const Mechanisms& mechanisms, const std::vector<BodyCone>& cones) {
  sides_.clear();
  alone_.clear();
  for (std::size_t l = 0; l < members_.size(); ++l) {
    const BodyCone& c = cones[at(members_[l])];
    alone_.emplace_back(BodyCone::Column::Zero(c.cone.rows));
    for (const auto& [body, J] : c.terms) {
      if (!mechanisms.moves(body)) continue;
      const BodyCone::Rows H = J * mechanisms.root(body);
      sides_.push_back({static_cast<int>(l), body, node_of(mechanisms, body), H});
      alone_.back() += H.rowwise().squaredNorm();
    }
  }
  std::stable_sort(sides_.begin(), sides_.end(),
                   [](const Side& a, const Side& b) { return a.node < b.node; });
  return !sides_.empty() && sides_.front().node < mechanisms.count();
}

// Adds the blocks of A of one mechanism, sides begin .. end: the response of the mechanism to unit
// impulses of each cone on it.
void BodyCones::add_mechanism(Mechanisms& mechanisms, std::size_t begin, std::size_t end) {
  Mechanism& mechanism = mechanisms[sides_[begin].node];
  for (std::size_t p = begin; p < end;) {
    const int j = sides_[p].place;
    response_.setZero(mechanism.entries(), sides_[p].H.rows());
    for (; p < end && sides_[p].place == j; ++p)
      response_.middleRows(6 * mechanisms.place_of(sides_[p].body), 6) += sides_[p].H.transpose();
    for (Eigen::Index k = 0; k < response_.cols(); ++k) mechanism.project(response_.col(k).data());
    // Squares: never negative, and small where the joints hold a direction.
    A_.push_back({j, j, response_.transpose() * response_});
    for (std::size_t q = p; q < end; ++q)
      A_.push_back(
          {sides_[q].place, j,
           sides_[q].H * response_.middleRows(6 * mechanisms.place_of(sides_[q].body), 6)});
  }
}

void BodyCones::assemble(Mechanisms& mechanisms, const std::vector<BodyCone>& cones) {
  A_.clear();
  for (std::size_t l = 0; l < members_.size(); ++l)
    if (const BodyCone& c = cones[at(members_[l])]; c.compliance > 0) {
      const int place = static_cast<int>(l), rows = c.cone.rows;
      A_.push_back({place, place, c.compliance * Block::Identity(rows, rows)});
    }
  for (std::size_t begin = 0, end = 0; begin < sides_.size(); begin = end) {
    while (end < sides_.size() && sides_[end].node == sides_[begin].node) ++end;
    if (sides_[begin].node < mechanisms.count()) {
      add_mechanism(mechanisms, begin, end);
      continue;
    }
    for (std::size_t p = begin; p < end; ++p)
      for (std::size_t q = p; q < end; ++q)
        A_.push_back({sides_[q].place, sides_[p].place, sides_[q].H * sides_[p].H.transpose()});
  }
}

// Leaves out contacts whose normal velocity no impulse changes, and removes from A the directions
// of slip and of moments that the joints hold: there a solve would divide rounding by rounding.
void BodyCones::leave_out_held(const std::vector<BodyCone>& cones, const std::vector<Vector6d>& v) {
  std::vector<Block> own(members_.size()), clear(members_.size());
  for (std::size_t l = 0; l < own.size(); ++l) own[l].setZero(alone_[l].size(), alone_[l].size());
  for (const Entry& e : A_)
    if (e.row == e.column) own[at(e.row)] += e.value;
  for (std::size_t l = 0; l < own.size(); ++l) {
    const BodyCone& c = cones[at(members_[l])];
    each_part(c.cone.kind, [&](int from, int count) {
      const double alone = alone_[l].segment(from, count).sum();
      linalg::Matrix<2, 2> T = alone * linalg::Matrix<2, 2>::Identity();
      T.topLeftCorner(count, count) = own[l].block(from, from, count, count);
      const linalg::SymmetricEigen<2> eigen = linalg::symmetric_eigen(T);
      for (int k = 0; k < 2; ++k)
        if (!(eigen.values[k] > kHeld * alone))
          held_.push_back({static_cast<int>(l), from, count, eigen.vectors.col(k)});
    });
    if (!is_contact(c.cone.kind) || own[l](0, 0) > kHeld * alone_[l][0]) continue;
    kept_[l] = 0;
    const double w = speeds(c, v)[0], scale = largest_speeds(c, v)[0];
    if (w >= -options_.tolerance * scale) continue;
    result_.blocked.push_back(members_[l]);
    result_.status = Status::infeasible;
    result_.error = std::max(result_.error, -w / scale);
  }
  for (const Held& h : held_) {
    Block& Q = clear[at(h.place)];
    const Eigen::Index n = alone_[at(h.place)].size();
    if (Q.size() == 0) Q.setIdentity(n, n);
    const auto d = h.direction.head(h.count);
    Q.block(h.from, h.from, h.count, h.count) -= d * d.transpose();
  }
  for (Entry& e : A_) {
    if (clear[at(e.row)].size() > 0) e.value = (clear[at(e.row)] * e.value).eval();
    if (clear[at(e.column)].size() > 0) e.value = (e.value * clear[at(e.column)]).eval();
  }
}

// b of a cone; in directions that the joints hold, a slip of the size of rounding counts as 0.
Eigen::VectorXd BodyCones::approach(int place, const BodyCone& c,
                                    const std::vector<Vector6d>& v) const {
  BodyCone::Column w = speeds(c, v);
  for (const Held& h : held_) {
    if (h.place != place) continue;
    const auto d = h.direction.head(h.count);
    const double slip = d.dot(w.segment(h.from, h.count));
    if (std::abs(slip) <= kSlip * largest_speeds(c, v).segment(h.from, h.count).sum())
      w.segment(h.from, h.count) -= slip * d;
  }
  return -w;
}

void BodyCones::solve_island(const std::vector<BodyCone>& cones, const std::vector<Vector6d>& v,
                             bool jointed, linalg::VectorX& x) {
  std::vector<Cone> kept;
  std::vector<int> row(members_.size(), -1);
  linalg::VectorX b(x.size()), start(x.size()), soft(x.size());
  Eigen::Index n = 0;
  for (std::size_t l = 0; l < members_.size(); ++l) {
    const int cone = members_[l];
    const BodyCone& c = cones[at(cone)];
    const Eigen::Index rows = c.cone.rows;
    if (kept_[l] == 0) {
      x.segment(row_[at(cone)], rows).setZero();
      continue;
    }
    row[l] = static_cast<int>(n);
    kept.push_back(c.cone);
    b.segment(n, rows) = approach(static_cast<int>(l), c, v);
    start.segment(n, rows) = x.segment(row_[at(cone)], rows);
    // Far above the rounding of A, and too stiff to be felt: a part of what the bodies alone yield.
    soft.segment(n, rows) = 1e-5 * alone_[l];
    each_part(c.cone.kind, [&](int from, int count) {
      soft.segment(n + from, count).setConstant(soft.segment(n + from, count).mean());
    });
    n += rows;
  }
  if (n == 0) return;
  b.conservativeResize(n);
  start.conservativeResize(n);
  soft.conservativeResize(n);
  std::vector<MatrixEntry> A;
  for (const Entry& e : A_) {
    const int r0 = row[at(e.row)], c0 = row[at(e.column)];
    if (r0 < 0 || c0 < 0) continue;
    for (int r = 0; r < e.value.rows(); ++r)
      for (int c = 0; c < e.value.cols(); ++c) {
        A.push_back({r0 + r, c0 + c, e.value(r, c)});
        if (r0 != c0) A.push_back({c0 + c, r0 + r, e.value(r, c)});
      }
  }
  const ConeProblem problem = ConeProblem::sparse(A, b, kept);
  // Dense factors of up to 20 cones cost little beside their solve.
  if (jointed && kept.size() <= 20 &&
      !(evaluate(problem, options_.law, start).error <= options_.tolerance) &&
      share_loads(problem) && !hold_all(problem, options_.tolerance, start)) {
    // Contacts that slide share their loads as soft supports of one kind would.
    const ConeSolution shared =
        solver_.solve(ConeProblem::sparse(A, b, std::move(kept), soft), start);
    if (shared.status == Status::solved) start = shared.impulses;
  }
  const ConeSolution solution = solver_.solve(problem, start);
  result_.sweeps = std::max(result_.sweeps, solution.counts.sweeps);
  if (!(solution.error <= result_.error)) result_.error = solution.error;
  if (solution.status != Status::solved) {
    ++result_.failed;
    if (result_.status != Status::infeasible) result_.status = solution.status;
  }
  for (std::size_t l = 0; l < members_.size(); ++l)
    if (const Eigen::Index rows = alone_[l].size(); row[l] >= 0)
      x.segment(row_[at(members_[l])], rows) = solution.impulses.segment(row[l], rows);
}

void BodyCones::apply(Mechanisms& mechanisms, const linalg::VectorX& x, std::vector<Vector6d>& v) {
  for (std::size_t begin = 0, end = 0; begin < sides_.size(); begin = end) {
    while (end < sides_.size() && sides_[end].node == sides_[begin].node) ++end;
    const int node = sides_[begin].node;
    const auto impulse = [&](const Side& s) {
      return Eigen::Matrix<double, 6, 1>(s.H.transpose() *
                                         x.segment(row_[at(members_[at(s.place)])], s.H.rows()));
    };
    if (node >= mechanisms.count()) {
      for (std::size_t p = begin; p < end; ++p)
        v[at(sides_[p].body)] += mechanisms.root(sides_[p].body) * impulse(sides_[p]);
      continue;
    }
    Mechanism& mechanism = mechanisms[node];
    Eigen::Map<Eigen::VectorXd> pull(mechanisms.pull(node).data(), mechanism.entries());
    response_.setZero(mechanism.entries(), 1);
    for (std::size_t p = begin; p < end; ++p)
      response_.middleRows(6 * mechanisms.place_of(sides_[p].body), 6) += impulse(sides_[p]);
    pull -= response_.col(0);
    mechanism.project(response_.data());
    pull += response_.col(0);
    mechanisms.add(node, response_.data(), v);
  }
}

const BodyCones::Result& BodyCones::solve(Mechanisms& mechanisms,
                                          const std::vector<BodyCone>& cones,
                                          std::vector<Vector6d>& v, linalg::VectorX& x) {
  result_ = {};
  if (cones.empty()) return result_;
  row_.assign(1, 0);
  for (const BodyCone& c : cones) row_.push_back(row_.back() + c.cone.rows);
  find_islands(mechanisms, cones);
  for (std::size_t k = 0; k + 1 < start_.size(); ++k) {
    members_.assign(order_.begin() + start_[k], order_.begin() + start_[k + 1]);
    const bool jointed = collect_sides(mechanisms, cones);
    assemble(mechanisms, cones);
    kept_.assign(members_.size(), 1);
    held_.clear();
    if (jointed) leave_out_held(cones, v);
    solve_island(cones, v, jointed, x);
    apply(mechanisms, x, v);
    ++result_.islands;
  }
  std::sort(result_.blocked.begin(), result_.blocked.end());
  return result_;
}

}  // namespace tether::contact::detail
