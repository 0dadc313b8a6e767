// Tether: a move that stiff components take part in as F has it. SPDX-License-Identifier:
// BSD-3-Clause
//
// With P g the shortest move for g in the metric at hand and M = J^-1 cj F_y', the move z = M p
// ends on the constraints where
//
//     P C M p = P g.
//
// P C is the identity on what P makes, and so is P C M but for what stiff components do: GMRES
// needs few directions. Each costs one F, one solve with IDA's factors and one with those of the
// rows.
#include "step/stiff_move.hpp"

#include <algorithm>
#include <cmath>

namespace tether::ida_projection {

namespace {

constexpr double kLeft = 1e-3;   // of the move: the last moves onto the constraints take it
constexpr double kLonger = 4.0;  // than p and what answers to it: no cure
constexpr double kShort = 1.0;   // tolerances: never too long
// Old factors leave a part of what answers, which then vibrates; with them GMRES is slow as well.
constexpr double kCancelled = 0.1;  // tolerances

}  // namespace

void StiffMove::allocate(const Candidate& candidate) {
  const auto n = static_cast<std::size_t>(N_VGetLength(candidate.correction));
  if (first_.size() == n) return;
  for (Vector* v : {&first_, &moved_, &left_, &total_}) v->assign(n, 0.0);
  for (Vector& v : directions_) v.assign(n, 0.0);
  for (Vector& v : answered_) v.assign(n, 0.0);
  change_ = OwnedVector(candidate.correction);
}

double StiffMove::dot(const Vector& a, const Vector& b) const {
  double sum = 0.0;
  for (std::size_t j = 0; j < a.size(); ++j)
    if (mask_ == nullptr || mask_[j] != 0.0) sum += a[j] * weights_[j] * b[j] * weights_[j];
  return sum / static_cast<double>(a.size());
}

// z = M p.
bool StiffMove::answer(const Candidate& candidate, Polish& polish, const Vector& p, Vector& z) {
  const double* corrected = N_VGetArrayPointer(polish.corrected());
  for (std::size_t j = 0; j < p.size(); ++j) candidate.correction_entries[j] = corrected[j] - p[j];
  if (polish.answer(candidate) < 0.0) return false;
  const double* answer = polish.answer_entries();
  for (std::size_t j = 0; j < p.size(); ++j) z[j] = p[j] - answer[j];
  return true;
}

// Directions p / length and what becomes of them, H the matrix of Arnoldi's method; how many.
// `known`: so is the answer to the first one, which is the move itself.
int StiffMove::search(const Candidate& candidate, Polish& polish, Mover& mover, double length,
                      bool known) {
  const double* corrected = N_VGetArrayPointer(polish.corrected());
  const auto differential = [this](std::size_t j) { return mask_ == nullptr || mask_[j] != 0.0; };
  Vector& p = total_;
  double rotated = 1.0;  // rest of the least squares problem
  double c[kMost], s[kMost];
  for (int k = 0; k < kMost; ++k) {
    const Vector& direction = directions_[k];
    for (std::size_t j = 0; j < p.size(); ++j) p[j] = length * direction[j];
    Vector& z = answered_[k];
    if (k == 0 && known) {
      const double* answer = polish.answer_entries();
      for (std::size_t j = 0; j < p.size(); ++j) z[j] = p[j] - answer[j];
    } else if (!answer(candidate, polish, p, z)) {
      return -1;
    }
    for (std::size_t j = 0; j < p.size(); ++j)
      candidate.correction_entries[j] = differential(j) ? corrected[j] - z[j] : moved_[j];
    if (!mover.solve_at(candidate, left_.data())) return -1;
    Vector& next = directions_[k + 1];
    for (std::size_t j = 0; j < p.size(); ++j)
      next[j] = differential(j) ? (first_[j] - left_[j]) / length : 0.0;
    for (int i = 0; i <= k; ++i) {
      H_[i][k] = dot(next, directions_[i]);
      for (std::size_t j = 0; j < p.size(); ++j) next[j] -= H_[i][k] * directions_[i][j];
    }
    const double norm = std::sqrt(dot(next, next));
    if (!std::isfinite(norm)) return -1;
    // Rotations make H triangular; what they leave of the right-hand side is the residual.
    for (int i = 0; i < k; ++i) {
      const double above = H_[i][k];
      H_[i][k] = c[i] * above + s[i] * H_[i + 1][k];
      H_[i + 1][k] = c[i] * H_[i + 1][k] - s[i] * above;
    }
    const double both = std::hypot(H_[k][k], norm);
    if (!(both > 0.0)) return -1;
    c[k] = H_[k][k] / both;
    s[k] = norm / both;
    H_[k][k] = both;
    rhs_[k] = c[k] * rotated;
    rotated *= -s[k];
    trusted_ = std::abs(rotated) <= kLeft || norm <= kLeft * both;
    if (trusted_) return k + 1;
    for (double& x : next) x /= norm;
  }
  return kMost;
}

// Did mover.move() leave the algebraic variables where the corrector had them?
bool StiffMove::only_differential(const double* corrected) const {
  for (std::size_t j = 0; j < moved_.size(); ++j)
    if (mask_ != nullptr && mask_[j] == 0.0 && moved_[j] != corrected[j]) return false;
  return true;
}

// total <- the move of all directions; algebraic variables by their own factor.
void StiffMove::combine(int count, double algebraic) {
  for (int k = count - 1; k >= 0; --k) {
    for (int i = k + 1; i < count; ++i) rhs_[k] -= H_[k][i] * rhs_[i];
    rhs_[k] /= H_[k][k];
  }
  std::fill(total_.begin(), total_.end(), 0.0);
  for (int k = 0; k < count; ++k)
    for (std::size_t j = 0; j < total_.size(); ++j) total_[j] += rhs_[k] * answered_[k][j];
  if (mask_ == nullptr) return;
  for (std::size_t j = 0; j < total_.size(); ++j)
    if (mask_[j] == 0.0) total_[j] = std::isfinite(total_[j]) ? algebraic * total_[j] : 0.0;
}

bool StiffMove::too_long(double length) const {
  const double answered = std::sqrt(dot(answered_[0], answered_[0]));
  return !(std::sqrt(dot(total_, total_)) <= std::max(kLonger * (length + answered), kShort));
}

bool StiffMove::make(const Candidate& candidate, double cj, Polish& polish, Mover& mover,
                     bool any_length) {
  trusted_ = false;
  allocate(candidate);
  double* ycor = candidate.correction_entries;
  const double* corrected = N_VGetArrayPointer(polish.corrected());
  weights_ = candidate.weight_entries;
  mask_ = variables_.mask();
  for (std::size_t j = 0; j < moved_.size(); ++j) {
    moved_[j] = ycor[j];
    first_[j] = mask_ == nullptr || mask_[j] != 0.0 ? corrected[j] - ycor[j] : 0.0;
  }
  const double length = std::sqrt(dot(first_, first_));
  if (!(length > 0.0)) return false;
  for (std::size_t j = 0; j < first_.size(); ++j) directions_[0][j] = first_[j] / length;
  const bool known = polish.answer_known() && only_differential(corrected);
  const int count = search(candidate, polish, mover, length, known);
  bool made = count > 0;
  if (made) {
    combine(count, polish.algebraic_factor(cj));
    const bool too_long = this->too_long(length);
    trusted_ = trusted_ && !too_long && dot(answered_[0], answered_[0]) <= kCancelled * kCancelled;
    made = !too_long || (any_length && std::isfinite(dot(total_, total_)));
  }
  if (!made) polish.forget_answer();
  double* change = N_VGetArrayPointer(change_);
  for (std::size_t j = 0; j < moved_.size(); ++j) {
    ycor[j] = made ? corrected[j] - total_[j] : moved_[j];
    change[j] = ycor[j] - moved_[j];
  }
  return made;
}

}  // namespace tether::ida_projection
