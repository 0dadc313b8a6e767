// Tether: the motion of a model while its closed contacts stay as they are.
// SPDX-License-Identifier: BSD-3-Clause
#include "motion.hpp"

#include <tether/linalg/pivoted_qr.hpp>

#include "bounds.hpp"
#include "friction_solve.hpp"
#include "lists.hpp"

namespace tether::scene::event {

namespace {

constexpr double kIndependentRow = 1e-6;  // of rows of unit length

/// Rows that the earlier ones do not imply, in the metric of the masses; Gram and Schmidt, twice.
class IndependentRows {
 public:
  IndependentRows(const Model& model, int velocities, int rows)
      : model_(model),
        basis_(velocities, std::min(velocities, rows)),
        dual_(velocities, std::min(velocities, rows)) {}
  int rank() const { return rank_; }

  /// Whether the row, of length 1, adds to those before it.
  bool add(VectorXd v) {
    if (rank_ == basis_.cols()) return false;
    for (int pass = 0; pass < 2; ++pass)
      v -= basis_.leftCols(rank_) * (dual_.leftCols(rank_).transpose() * v);
    MatrixXd w = v;
    model_.divide_by_mass(w);
    const double length = std::sqrt(std::max(0.0, v.dot(w.col(0))));
    if (length < kIndependentRow) return false;
    basis_.col(rank_) = v / length;
    dual_.col(rank_) = w.col(0) / length;
    ++rank_;
    return true;
  }

 private:
  const Model& model_;
  MatrixXd basis_, dual_;
  int rank_ = 0;
};

/// Rows (given as columns) that imply all others. Independence is measured in the metric of the
/// projection. In that of the masses a body that is thin about an axis would count as held about it
/// by rows that hardly turn it.
struct RowChoice {
  std::vector<int> rows;  // ascending
  double least = 1;       // what a row added to the others, of its length

  explicit RowChoice(MatrixXd columns) {
    const Eigen::RowVectorXd lengths = columns.colwise().norm().cwiseMax(1e-300);
    columns *= lengths.cwiseInverse().asDiagonal();
    linalg::PivotedQr qr;
    qr.factor(columns);
    const linalg::MatrixView R = qr.R();
    const std::vector<int> order = qr.order();
    for (Eigen::Index k = 0; k < std::min(R.rows(), R.cols()); ++k) {
      const double left = std::abs(R(k, k));
      if (left < kIndependentRow) break;
      least = std::min(least, left);
      rows.push_back(order[static_cast<std::size_t>(k)]);
    }
    std::sort(rows.begin(), rows.end());
  }
};

constexpr double kWeakened = 0.3;  // of the least joint row, before rows are chosen anew
constexpr double kAhead = 1e-5;    // s in the units of the model

/// At most 1; a power of 2, so that rounding does not show in it.
double part_of(double length) {
  return length > 0 ? std::min(1.0, std::exp2(std::round(std::log2(length)))) : 1.0;
}

// At the state that is set; at most the tolerance itself. (A sleeve with a play of half a
// millimetre turns on its pole: a tolerance of its angle is far less of its gap.)
Bands bands_of(Model& model, double tolerance) {
  Bands out{tolerance, {}};
  VectorXd gradient(model.coordinates());
  ContactKinematics kinematics;
  for (int i = 0; i < model.contacts(); ++i) {
    model.evaluate_contact(i, kinematics);
    gradient.setZero();
    model.to_coordinates(kinematics.normal.data(), gradient.data());
    const double gap = gradient.norm(), approach = kinematics.normal.norm();
    const double slip = kinematics.tangents.rowwise().norm().maxCoeff();
    // In the units of the model slower bounces than 1e-7 are as high as rounding.
    out.of.push_back({tolerance * part_of(gap), std::max(tolerance, 1e-7) * part_of(approach),
                      tolerance * part_of(slip)});
  }
  return out;
}

}  // namespace

Motion::Motion(Model& model, double tolerance, double t, const VectorXd& y)
    : model_(model),
      nq_(model.coordinates()),
      nu_(model.velocities()),
      modes_(at(model.contacts())),
      levels_(at(model.contacts()), 0.0) {
  u_.setZero(nu_);
  a_.setZero(nu_);
  set(t, y.data());
  bands_ = bands_of(model, tolerance);
}

void Motion::slips_with_friction(double t, const double* y, VectorXd& slips) {
  set(t, y);
  slips.resize(kTangents * static_cast<Eigen::Index>(closed_.size()));
  Eigen::Index size = 0;
  for (std::size_t k = 0; k < closed_.size(); ++k) {
    const int contact = closed_[k];
    const ContactLaw law = model_.law(contact);
    if (sticks(k) || law.friction == 0 || law.is_bounded()) continue;
    model_.evaluate_contact(contact, kinematics_[k]);
    slips.segment(size, kTangents) = held_slip(static_cast<int>(k));
    size += kTangents;
  }
  slips.conservativeResize(size);
}

void Motion::choose(double t, const VectorXd& y, std::vector<ContactMode> modes) {
  closed_.clear();
  set(t, y.data());
  for (int i = 0; i < model_.contacts(); ++i) {
    if (modes[at(i)].mode == Mode::open) continue;
    closed_.push_back(i);
    double rate = 0;
    if (modes_[at(i)].mode == Mode::open) levels_[at(i)] = model_.gap(i, rate);
  }
  modes_ = std::move(modes);
  kinematics_.resize(closed_.size());
  row_of_.resize(closed_.size());
  find_holders();
  choose_joints();
  rows_ = joints_;
  for (std::size_t k = 0; k < closed_.size(); ++k) {
    row_of_[k] = rows_;
    rows_ += normals_of(k) + tangents_of(k);
  }
  sharing_.clear();
  for (std::size_t k = 0; k < closed_.size(); ++k)
    if (model_.shares_bound(closed_[k])) sharing_.push_back(k);
  R_.setZero(rows_, nu_);
  C_.setZero(nu_, rows_);
  r_.setZero(rows_);
  lambda_.setZero(rows_);
  gather();
  const int rank = choose_rows();
  if (rows_ > 0) islands_.choose(R_, C_);
  VectorXd y_rate(size());
  rate(t, y.data(), y_rate.data());
  choose_energy_row(rank);
}

void Motion::choose_energy_row(int rank) {
  bool works = model_.does_work();
  for (std::size_t k = 0; k < closed_.size(); ++k)
    works = works || is_bounded(k) ||
            ((!sticks(k) || model_.law(closed_[k]).kind == ContactLaw::Kind::conveying) &&
             model_.law(closed_[k]).friction > 0);
  // The energy of bodies at rest, slower than 1e-3 in the units of the model, is known to rounding
  // only and does not determine the state.
  const bool moves = rank < nu_ && a_.norm() + u_.norm() > 1e-3;
  energy_row_ = !moves ? EnergyRow::none : works ? EnergyRow::less_work : EnergyRow::energy;
}

double Motion::margin_rate(double t, const VectorXd& y, int contact) {
  VectorXd ahead = y, rate(nq_);
  set(t, y.data());
  model_.rates(rate.data());
  ahead.head(nq_) += kAhead * rate;
  const double here = model_.margin(contact);
  set(t, ahead.data());
  const double there = model_.margin(contact);
  set(t, y.data());
  return (there - here) / kAhead;
}

// A corner that slid over an edge until its end comes to the plane of the face where the face ends:
// which of them is first is rounding. One that slides from an edge onto one of its faces closes the
// gap of the other.
bool Motion::passes_border(double t, const VectorXd& y, int contact) {
  const double margin = model_.margin(contact), band = bands_.gap(contact);
  if (margin < -band) return true;
  if (margin > kBesideBorder * band) return false;
  const double inward = margin_rate(t, y, contact), least = bands_.approach(contact);
  if (inward < -least) return true;
  return inward <= least && any_of(closed_, [&](int other) {
           return model_.are_at_one_edge(contact, other, kBesideBorder * band);
         });
}

// Redundant hinges, or ten copies of one, need no forces of their own.
void Motion::choose_joints() {
  joints_ = 0;
  joints_in_use_.clear();
  if (model_.joint_rows() == 0) return;
  model_.joints(joint_W_, joint_rate_, joint_rest_);
  const RowChoice choice(joint_W_.transpose());
  joints_in_use_ = std::move(choice.rows);
  joints_ = static_cast<int>(joints_in_use_.size());
  least_joint_row_ = choice.least;
}

// As a mechanism moves, rows that were far from implying each other may come to do so.
bool Motion::other_joint_rows_are_better(double t, const VectorXd& y) {
  if (joints_ == model_.joint_rows()) return false;
  set(t, y.data());
  evaluate_joints();
  const double now = RowChoice(joint_W_.topRows(joints_).transpose()).least;
  if (now > kWeakened * least_joint_row_) return false;
  least_joint_row_ = std::min(least_joint_row_, now);
  model_.joints(joint_W_, joint_rate_, joint_rest_);
  return now <= kWeakened * RowChoice(joint_W_.transpose()).least;
}

// Those in use, first.
void Motion::evaluate_joints() {
  model_.joints(joint_W_, joint_rate_, joint_rest_);
  for (int k = 0; k < joints_; ++k) {
    const int from = joints_in_use_[at(k)];
    if (from == k) continue;
    joint_W_.row(k) = joint_W_.row(from);
    joint_rate_[k] = joint_rate_[from];
    joint_rest_[k] = joint_rest_[from];
  }
}

// Rows, columns and what is left of the second derivatives, at the state that is set.
void Motion::gather() {
  if (joints_ > 0) {
    evaluate_joints();
    R_.topRows(joints_) = joint_W_.topRows(joints_);
    C_.leftCols(joints_) = joint_W_.topRows(joints_).transpose();
    r_.head(joints_) = joint_rest_.head(joints_);
  }
  smallest_slip_ = kInfinity;
  for (std::size_t k = 0; k < closed_.size(); ++k) {
    const int row = row_of_[k];
    ContactKinematics& kinematics = kinematics_[k];
    model_.evaluate_contact(closed_[k], kinematics);
    if (normals_of(k) > 0) {
      R_.row(row) = kinematics.normal;
      C_.col(row) = kinematics.normal.transpose();
      r_[row] = kinematics.normal_rest;
    }
    if (const int n = tangents_of(k); n > 0) {
      const int first = row + normals_of(k);
      R_.middleRows(first, n) = kinematics.tangents.topRows(n);
      C_.middleCols(first, n) = kinematics.tangents.topRows(n).transpose();
      r_.segment(first, n) = kinematics.slip_rest.head(n);
    }
    if (sticks(k) || is_bounded(k)) continue;
    const double mu = model_.law(closed_[k]).friction;
    if (mu == 0) continue;
    const VectorXd s = held_slip(static_cast<int>(k));
    smallest_slip_ = std::min(smallest_slip_, s.norm());
    C_.col(normal_row(k)) -= mu / s.norm() * kinematics.tangents.transpose() * s;
  }
}

// The number of independent ones.
int Motion::choose_rows() {
  positions_in_use_.clear();
  rates_in_use_.clear();
  rate_place_.assign(at(rows_), -1);
  row_scale_.setOnes(rows_);
  spare_rows_ = 0;
  if (rows_ == 0) return 0;
  MC_ = R_.transpose();
  model_.divide_by_mass(MC_);
  for (int i = 0; i < rows_; ++i) {
    const double square = R_.row(i).dot(MC_.col(i));
    row_scale_[i] = square > 0 ? 1 / std::sqrt(square) : 0;
  }
  // Joints come first, then normals, then tangents: the earlier row is kept.
  std::vector<int> normals, order;
  for (int i = 0; i < joints_; ++i) order.push_back(i);
  for (std::size_t k = 0; k < closed_.size(); ++k)
    if (normals_of(k) > 0) order.push_back(row_of_[k]);
  const std::size_t positions = order.size();
  for (std::size_t k = 0; k < closed_.size(); ++k)
    for (int j = 0; j < tangents_of(k); ++j) order.push_back(row_of_[k] + normals_of(k) + j);
  IndependentRows independent(model_, nu_, rows_);
  int rank_of_joints = 0;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const int row = order[k];
    if (!independent.add(row_scale_[row] * R_.row(row).transpose())) continue;
    if (row < joints_) ++rank_of_joints;
    if (k < positions) positions_in_use_.push_back(row);
    rate_place_[at(row)] = static_cast<int>(rates_in_use_.size());
    rates_in_use_.push_back(row);
  }
  spare_rows_ = rows_ - joints_ - (independent.rank() - rank_of_joints);
  return independent.rank();
}

// Laws that slide get their bounds without the forces of those that stick, whose columns have the
// rest.
void Motion::share_bounds() {
  shared_.assign(at(model_.contacts()), {});
  const auto force_of = [&](std::size_t k) -> LawForce& { return shared_[at(closed_[k])]; };
  for (const std::size_t k : sharing_)
    if (!sticks(k)) force_of(k).slides = -modes_[at(closed_[k])].direction[0];
  model_.share_bounds(1, shared_, bounds_);
  for (const std::size_t k : sharing_) {
    if (!sticks(k)) continue;
    force_of(k).held = 1;
    model_.share_bounds(0, shared_, bounds_moved_);
    force_of(k).held = 0;
    for (const std::size_t j : sharing_)
      C_.col(row_of_[k]) += force_of(j).slides * bounds_moved_[at(closed_[j])] *
                            kinematics_[j].tangents.row(0).transpose();
  }
}

// Accelerations without the forces of rows, and the columns of these.
void Motion::prepare(double t, const double* y) {
  set(t, y);
  gather();
  // A contact's kinematics take some 1000 operations.
  work_done_ += 1000 * static_cast<double>(closed_.size() + 1) + 4.0 * rows_ * (nu_ + rows_);
  model_.forces(h_);
  if (!sharing_.empty()) share_bounds();
  for (std::size_t k = 0; k < closed_.size(); ++k)
    if (is_bounded(k) && !sticks(k))
      h_ += kinematics_[k].tangents.transpose() * friction_force(static_cast<int>(k));
  a_ = h_;
  model_.divide_by_mass(a_);
  if (rows_ == 0) return;
  MC_ = C_;
  model_.divide_by_mass(MC_);
  for (int i = 0; i < rows_; ++i) MC_.col(i) *= row_scale_[i];
}

void Motion::rate(double t, const double* y, double* y_rate) {
  prepare(t, y);
  if (rows_ > 0) {
    islands_.factor(R_, MC_, row_scale_);
    work_done_ += 4 * islands_.work();
    const VectorXd right = -row_scale_.cwiseProduct(r_ + R_ * a_);
    const VectorXd scaled = islands_.solve(right);
    a_.noalias() += MC_ * scaled;
    lambda_ = row_scale_.cwiseProduct(scaled);
  }
  if (!sharing_.empty()) find_bounds();
  finish_rate(y_rate);
}

void Motion::finish_rate(double* y_rate) {
  model_.rates(y_rate);
  Eigen::Map<VectorXd>(y_rate + nq_, nu_) = a_;
  double power = model_.power();
  for (int i = 0; i < joints_; ++i) power -= lambda_[i] * joint_rate_[i];
  for (std::size_t k = 0; k < closed_.size(); ++k)
    // On the bodies: a motor and a belt work at their speeds, too.
    if (is_bounded(k) || !sticks(k) || !kinematics_[k].slip_rate.isZero(0))
      power += friction_force(static_cast<int>(k)).dot(kinematics_[k].tangents * u_);
  y_rate[work()] = power;
}

std::vector<VectorXd> Motion::slides() const {
  std::vector<VectorXd> out(closed_.size());
  for (std::size_t k = 0; k < closed_.size(); ++k) {
    const ContactMode& mode = modes_[at(closed_[k])];
    if (mode.mode != Mode::slide) continue;
    const VectorXd s = slip_of(kinematics_[k]);
    const bool fast = s.dot(mode.direction) > bands_.slip(closed_[k]);
    out[k] = fast ? VectorXd(s.normalized()) : mode.direction;
  }
  return out;
}

bool Motion::forces_are_lawful() const {
  for (std::size_t k = 0; k < closed_.size(); ++k) {
    const int contact = static_cast<int>(k);
    const double normal = normal_force(contact), mu = friction(k);
    if (!(normal >= 0 && friction_force(contact).norm() <= mu * normal * (1 + kNoForce)))
      return false;
  }
  const VectorXd left = row_scale_.cwiseProduct(R_ * a_ + r_);
  const double scale = row_scale_.cwiseProduct(r_).norm() + a_.norm();
  // Rounding of rows is below 1e-9 of their size.
  return left.size() == 0 ||
         left.cwiseAbs().maxCoeff() <= std::max(1e-9, bands_.of_accelerations()) * scale;
}

RowForces Motion::row_forces() {
  RowForces out;
  for (std::size_t k = 0; k < closed_.size(); ++k) {
    const int contact = static_cast<int>(k);
    out.contacts.emplace_back(1 + kTangents) << normal_force(contact), friction_force(contact);
  }
  const VectorXd moved = find_lawful(out.contacts);
  const int rows = model_.joint_rows();
  if (rows == 0 || (joints_ == rows && moved.isZero(0))) {
    out.joints = lambda_.head(joints_);
    return out;
  }
  model_.joints(joint_W_, joint_rate_, joint_rest_);
  VectorXd load = moved;
  for (int k = 0; k < joints_; ++k)
    load += lambda_[k] * joint_W_.row(joints_in_use_[at(k)]).transpose();
  linalg::LeastSquares factor(kDependentRow);
  factor.factor(joint_W_.transpose());
  out.joints = factor.solve(load);
  return out;
}

VectorXd Motion::find_lawful(std::vector<VectorXd>& forces) {
  VectorXd moved = VectorXd::Zero(nu_);
  double largest = 0;
  for (const VectorXd& force : forces) largest = std::max(largest, force.norm());
  bool lawful = true;
  for (std::size_t k = 0; k < closed_.size(); ++k) {
    const double least = -kNoForce * largest, mu = friction(k);
    lawful = lawful && forces[k][0] >= least &&
             mu * forces[k][0] - forces[k].tail(kTangents).norm() >= least;
  }
  if (lawful || !is_hyperstatic()) return moved;
  ContactRows rows(model_, closed_);
  const AccelerationSolution answer =
      solve_accelerations(rows, slides(), bands_.of_accelerations());
  if (!answer.contacts.solved) return moved;
  for (std::size_t k = 0; k < closed_.size(); ++k) {
    VectorXd force = rows.of(static_cast<int>(k), answer.contacts.x);
    if (normals_of(k) == 0) force[0] = forces[k][0];  // it is known
    const VectorXd less = forces[k] - force;
    moved += less[0] * kinematics_[k].normal.transpose() +
             kinematics_[k].tangents.transpose() * less.tail(kTangents);
    forces[k] = std::move(force);
  }
  return moved;
}

VectorXd Motion::friction_force(int closed) const {
  const auto k = at(closed);
  const int row = row_of_[k];
  const ContactLaw law = model_.law(closed_[k]);
  if (sticks(k)) {
    const int n = tangents_of(k);
    VectorXd force = VectorXd::Zero(kTangents);
    force.head(n) = lambda_.segment(row + normals_of(k), n);
    return force;
  }
  if (law.is_bounded()) return -bound(k) * modes_[at(closed_[k])].direction;
  const double mu = law.friction;
  if (mu == 0) return VectorXd::Zero(kTangents);
  const VectorXd s = held_slip(closed);
  return -mu * lambda_[normal_row(k)] / s.norm() * s;
}

// Gaps and joints, their rates, the slips of stuck contacts, the rows of the model itself, and
// energy less work (method, eq. 3).

// Rates of the rows of a contact, whose kinematics are evaluated.
VectorXd Motion::rates_of_contact(std::size_t k) const {
  const ContactKinematics& kinematics = kinematics_[k];
  const int normals = normals_of(k), tangents = tangents_of(k);
  VectorXd out(normals + tangents);
  if (normals > 0) out[0] = kinematics.normal.dot(u_) + kinematics.normal_rate;
  out.tail(tangents) = slip_of(kinematics).head(tangents);
  return out;
}

// Values of all rows at the state that is set; slips have no position.
void Motion::values_of_rows(VectorXd& positions, VectorXd& rates) {
  positions.setZero(rows_);
  rates.resize(rows_);
  if (joints_ > 0) {
    positions.head(joints_) = model_.joint_values<0>()(joints_in_use_);
    rates.head(joints_) = model_.joint_values<1>()(joints_in_use_);
  }
  for (std::size_t k = 0; k < closed_.size(); ++k) {
    const int row = row_of_[k], normals = normals_of(k);
    model_.evaluate_contact(closed_[k], kinematics_[k]);
    if (normals > 0) positions[row] = kinematics_[k].gap - levels_[at(closed_[k])];
    rates.segment(row, normals + tangents_of(k)) = rates_of_contact(k);
  }
}

void Motion::settle_velocities(double t, VectorXd& y) {
  if (rows_ == 0) return;
  set(t, y.data());
  gather();
  VectorXd positions, rates;
  values_of_rows(positions, rates);
  MatrixXd columns = R_.transpose() * row_scale_.asDiagonal();
  const MatrixXd rows = columns.transpose();
  model_.divide_by_mass(columns);
  linalg::LeastSquares factor(kDependentRow);
  factor.factor(MatrixXd(rows * columns));
  const VectorXd forces = factor.solve(row_scale_.cwiseProduct(rates));
  y.segment(nq_, nu_) -= columns * forces;
  set(t, y.data());
}

void Motion::constraints(double t, const double* y, double* g) {
  set(t, y);
  VectorXd positions, rates;
  values_of_rows(positions, rates);
  for (const int row : positions_in_use_) *g++ = positions[row];
  for (const int row : rates_in_use_) *g++ = rates[row];
  model_.own_values(g);
  g += model_.own_rows();
  if (energy_row_ != EnergyRow::none) *g = model_.energy() - y[work()] - kept_energy_;
}

// Derivatives of rates by coordinate j, which is changed in the state that is set.
void Motion::differentiate_rates(int j, double step, const VectorXd& rates, int first_rate,
                                 Eigen::Ref<Eigen::Matrix<double, -1, -1, Eigen::RowMajor>> C) {
  const auto put = [&](int row, double now) {
    if (const int place = rate_place_[at(row)]; place >= 0)
      C(first_rate + place, j) = (now - rates[row]) / step;
  };
  if (joints_ > 0) {
    const VectorXd now = model_.joint_values<1>();
    for (int i = 0; i < joints_; ++i) put(i, now[joints_in_use_[at(i)]]);
  }
  const int body = j / 7;
  for (std::size_t k = 0; k < closed_.size(); ++k) {
    const int row = row_of_[k], rows = normals_of(k) + tangents_of(k);
    if (rows == 0 || R_.block(row, 6 * body, rows, 6).isZero(0)) continue;
    model_.evaluate_contact(closed_[k], kinematics_[k]);
    const VectorXd now = rates_of_contact(k);
    for (int r = 0; r < rows; ++r) put(row + r, now[r]);
  }
}

void Motion::constraint_gradient(double t, const double* y,
                                 Eigen::Ref<Eigen::Matrix<double, -1, -1, Eigen::RowMajor>> C) {
  set(t, y);
  gather();
  VectorXd positions, rates;
  values_of_rows(positions, rates);
  int out = 0;
  Eigen::RowVectorXd line(nu_);
  for (const int row : positions_in_use_) {
    line = R_.row(row);
    model_.to_coordinates(line.data(), C.row(out++).data());
  }
  const int first_rate = out;
  for (const int row : rates_in_use_) C.row(out++).segment(nq_, nu_) = R_.row(row);
  for (int k = 0; k < model_.own_rows(); ++k) model_.own_gradient(k, C.row(out++).data());
  if (energy_row_ != EnergyRow::none)
    model_.energy_gradient(C.row(out).data(), C.row(out).data() + nq_);
  if (energy_row_ == EnergyRow::less_work) C(out, work()) = -1;
  if (rates_in_use_.empty() || u_.isZero(0)) return;
  // Rates by coordinates: differences, which Newton's moves onto the rows need not be better than.
  VectorXd near = Eigen::Map<const VectorXd>(y, size());
  for (int j = 0; j < nq_; ++j) {
    const double step = 1e-7 * std::max(1.0, std::abs(y[j]));  // about the root of rounding
    near[j] = y[j] + step;
    set(t, near.data());
    near[j] = y[j];
    differentiate_rates(j, step, rates, first_rate, C);
  }
  set(t, y);
}

}  // namespace tether::scene::event
