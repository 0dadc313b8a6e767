// Tether: bodies that joints connect. SPDX-License-Identifier: BSD-3-Clause
#include "joints/mechanisms.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <tether/linalg/disjoint_sets.hpp>
#include <tether/linalg/index.hpp>
#include <utility>

#include "problem/body_form.hpp"
#include "problem/criterion.hpp"

namespace tether::contact::detail {

using linalg::at;

Mechanism::Mechanism(std::vector<int> bodies, std::vector<int> rows, const JointRows& joints,
                     const std::vector<int>& place, const std::vector<char>& moves)
    : bodies_(std::move(bodies)),
      rows_(std::move(rows)),
      entries_(6 * static_cast<int>(bodies_.size())) {
  starts_.push_back(0);
  std::vector<int> places;
  for (const int row : rows_) {
    const int begin = starts_.back();
    places.clear();
    for (const JointRows::Term* t = joints.begin(row); t != joints.end(row); ++t)
      if (moves[at(t->body)]) places.push_back(place[at(t->body)]);
    std::vector<int> once = places;
    std::sort(once.begin(), once.end());
    once.erase(std::unique(once.begin(), once.end()), once.end());
    for (const int p : once)
      for (int k = 0; k < 6; ++k) columns_.push_back(6 * p + k);
    for (const int p : places) {
      const auto found = std::lower_bound(once.begin(), once.end(), p);
      first_.push_back(begin + 6 * static_cast<int>(found - once.begin()));
    }
    starts_.push_back(static_cast<int>(columns_.size()));
  }
  values_.resize(columns_.size());
  b_.resize(rows_.size());
  step_.resize(at(entries_));
  factor_.resize(entries_, starts_, columns_, 0);
}

bool Mechanism::factor(const JointRows& joints, const std::vector<Matrix6d>& C) {
  std::fill(values_.begin(), values_.end(), 0.0);
  std::size_t term = 0;
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    const int row = rows_[k];
    for (const JointRows::Term* t = joints.begin(row); t != joints.end(row); ++t) {
      const Matrix6d& root = C[at(t->body)];
      if (root.isZero(0)) continue;
      double* to = values_.data() + first_[term++];
      for (int c = 0; c < 6; ++c) to[c] += t->G.dot(root.col(c));
    }
  }
  std::copy(values_.begin(), values_.end(), factor_.entries());
  std::fill_n(factor_.metric(), entries_, 1.0);
  return factor_.factor();
}

void Mechanism::multiply(const double* u, double* x) const {
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    double sum = 0;
    for (int e = starts_[k]; e < starts_[k + 1]; ++e) sum += values_[at(e)] * u[columns_[at(e)]];
    x[k] = sum;
  }
}

void Mechanism::project(double* u) {
  multiply(u, b_.data());
  factor_.solve(b_.data(), step_.data());
  for (int k = 0; k < entries_; ++k) u[k] -= step_[at(k)];
}

// Bodies and kinds of the rows, as numbers.
bool Mechanisms::is_same(const std::vector<RigidBody>& bodies, const JointRows& joints) const {
  if (moves_.size() != bodies.size()) return false;
  for (std::size_t i = 0; i < bodies.size(); ++i)
    if ((moves_[i] != 0) != bodies[i].moves()) return false;
  std::size_t k = 0;
  for (int row = 0; row < joints.count(); ++row) {
    const auto terms = joints.end(row) - joints.begin(row);
    if (k + 1 + at(static_cast<int>(terms)) > pattern_.size()) return false;
    if (pattern_[k++] != -1) return false;
    for (const JointRows::Term* t = joints.begin(row); t != joints.end(row); ++t)
      if (pattern_[k++] != t->body) return false;
  }
  return k == pattern_.size();
}

void Mechanisms::analyse(const std::vector<RigidBody>& bodies, const JointRows& joints) {
  const int n = static_cast<int>(bodies.size());
  moves_.resize(bodies.size());
  for (std::size_t i = 0; i < bodies.size(); ++i) moves_[i] = bodies[i].moves();
  pattern_.clear();
  linalg::DisjointSets joined(n);
  std::vector<int> any(at(joints.count()), -1);  // a moving body of each row
  for (int row = 0; row < joints.count(); ++row) {
    pattern_.push_back(-1);
    for (const JointRows::Term* t = joints.begin(row); t != joints.end(row); ++t) {
      if (t->body >= n)
        throw std::invalid_argument("joint " + std::to_string(joints.joint(row)) +
                                    ": body = " + std::to_string(t->body) + ": must be one of " +
                                    std::to_string(n));
      pattern_.push_back(t->body);
      if (!moves_[at(t->body)]) continue;
      if (any[at(row)] >= 0) joined.join(t->body, any[at(row)]);
      any[at(row)] = t->body;
    }
  }
  mechanism_.assign(bodies.size(), -1);
  place_.assign(bodies.size(), -1);
  std::vector<int> number(bodies.size(), -1);
  std::vector<std::vector<int>> rows, members;
  for (int row = 0; row < joints.count(); ++row) {
    if (any[at(row)] < 0)
      throw std::invalid_argument("joint " + std::to_string(joints.joint(row)) + ": row " +
                                  std::to_string(row) + " is on no body that moves");
    int& m = number[at(joined.root(any[at(row)]))];
    if (m < 0) {
      m = static_cast<int>(rows.size());
      rows.emplace_back();
      members.emplace_back();
    }
    rows[at(m)].push_back(row);
  }
  for (int i = 0; i < n; ++i) {
    const int m = number[at(joined.root(i))];
    if (m < 0 || !moves_[at(i)]) continue;
    mechanism_[at(i)] = m;
    place_[at(i)] = static_cast<int>(members[at(m)].size());
    members[at(m)].push_back(i);
  }
  list_.clear();
  pulls_.clear();
  for (std::size_t m = 0; m < rows.size(); ++m) {
    list_.push_back(std::make_unique<Mechanism>(std::move(members[m]), std::move(rows[m]), joints,
                                                place_, moves_));
    pulls_.emplace_back(at(list_.back()->entries()), 0.0);
  }
  b_.resize(at(joints.count()));
  x_.resize(at(joints.count()));
}

void Mechanisms::update(const std::vector<RigidBody>& bodies, const JointRows& joints) {
  if (!is_same(bodies, joints)) {
    analyse(bodies, joints);
    root_.assign(bodies.size(), Matrix6d::Zero());
    inverse_mass_.assign(bodies.size(), Matrix6d::Zero());
  }
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    if (!moves_[i]) continue;
    const Matrix6d inverse_mass = bodies[i].inverse_mass_matrix();
    if (inverse_mass_[i] == inverse_mass) continue;
    inverse_mass_[i] = inverse_mass;
    root_[i] = inverse_mass_root(inverse_mass);
  }
  for (const auto& each : list_)
    if (!each->factor(joints, root_))
      throw std::invalid_argument("joint " + std::to_string(joints.joint(each->rows().front())) +
                                  " and those beside it: their rows times the inverse mass must "
                                  "be finite");
}

double Mechanisms::pull_norm() const {
  double sum = 0;
  for (const std::vector<double>& each : pulls_)
    for (const double u : each) sum += u * u;
  return std::sqrt(sum);
}

void Mechanisms::clear_pulls() {
  for (std::vector<double>& each : pulls_) std::fill(each.begin(), each.end(), 0.0);
}

void Mechanisms::add(int m, const double* u, std::vector<Vector6d>& v) const {
  const std::vector<int>& bodies = list_[at(m)]->bodies();
  for (std::size_t k = 0; k < bodies.size(); ++k)
    v[at(bodies[k])] +=
        root_[at(bodies[k])] * Eigen::Map<const Eigen::Matrix<double, 6, 1>>(u + 6 * k);
}

// b_ = rate - G v of the rows of mechanism m; returns the largest speed that they
// see, in the units of u, in which a row has length 1.
double Mechanisms::defect(int m, const JointRows& joints, const std::vector<Vector6d>& v) {
  const Mechanism& mechanism = *list_[at(m)];
  double most = 0;
  for (std::size_t k = 0; k < mechanism.rows().size(); ++k) {
    const int row = mechanism.rows()[k];
    double sum = joints.rate(row), speed = std::abs(sum);
    for (const JointRows::Term* t = joints.begin(row); t != joints.end(row); ++t) {
      sum -= t->G.dot(v[at(t->body)]);
      speed += t->G.cwiseAbs().dot(v[at(t->body)].cwiseAbs());
    }
    b_[k] = sum;
    const double norm = mechanism.row_norm(static_cast<int>(k));
    if (norm > 0) most = std::max(most, speed / norm);
  }
  return most;
}

void Mechanisms::satisfy(const JointRows& joints, std::vector<Vector6d>& v) {
  contradicting_.clear();
  for (int m = 0; m < count(); ++m) {
    Mechanism& mechanism = *list_[at(m)];
    const double scale = defect(m, joints, v);
    u_.resize(at(mechanism.entries()));
    mechanism.least(b_.data(), u_.data());
    add(m, u_.data(), v);
    for (std::size_t k = 0; k < u_.size(); ++k) pulls_[at(m)][k] += u_[k];
    find_contradicting(m, joints, scale);
  }
  std::sort(contradicting_.begin(), contradicting_.end());
  contradicting_.erase(std::unique(contradicting_.begin(), contradicting_.end()),
                       contradicting_.end());
}

// Least squares share what cannot be solved among the rows that contradict each other.
void Mechanisms::find_contradicting(int m, const JointRows& joints, double scale) {
  const Mechanism& mechanism = *list_[at(m)];
  for (std::size_t k = 0; k < mechanism.rows().size(); ++k) {
    const int i = static_cast<int>(k);
    const double norm = mechanism.row_norm(i);
    // The squares of smaller speeds underflow, so that relative errors lose their meaning.
    const bool holds = norm > 0
                           ? std::abs(mechanism.left(i)) <= std::max(kContradiction * scale, 1e-150)
                           : b_[k] == 0;  // a row of zeros
    if (!holds) contradicting_.push_back(joints.joint(mechanism.rows()[k]));
  }
}

double Mechanisms::error(const JointRows& joints, const std::vector<Vector6d>& v) {
  double error = 0;
  for (int m = 0; m < count(); ++m) {
    const double scale = defect(m, joints, v);
    double most = 0;
    for (std::size_t k = 0; k < list_[at(m)]->rows().size(); ++k)
      if (const double norm = list_[at(m)]->row_norm(static_cast<int>(k)); norm > 0)
        most = std::max(most, std::abs(b_[k]) / norm);
    if (most > 0) error = std::max(error, most / scale);
  }
  return error;
}

void Mechanisms::impulses(double* x) {
  for (int m = 0; m < count(); ++m) {
    list_[at(m)]->impulses(pulls_[at(m)].data(), x_.data());
    for (std::size_t k = 0; k < list_[at(m)]->rows().size(); ++k)
      x[list_[at(m)]->rows()[k]] = x_[k];
  }
}

}  // namespace tether::contact::detail
