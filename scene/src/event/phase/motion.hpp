// Tether: the motion of a model while its closed contacts stay as they are (method, eq. 2).
// SPDX-License-Identifier: BSD-3-Clause
//
// Unknowns y = (q, u, E_w), E_w the work of forces without potential. Each closed contact is stuck
// or slides:
//
//   M u' = h + sum over rows of C lambda,   R u' = -r
//
//   joint    row W            column W'
//   closed   row n            column n' where it sticks, n' - mu T' d where it slides, d = s / |s|
//   stuck    rows T, too      columns T'
//
// A bounded law of a joint has one row and column T where it sticks, else its bound is part of h.
// A moment of rolling or torsional friction has rows T where it sticks; where it slides it adds
// -r T' d to the column of the normal that holds it.
//
// lambda is eliminated: R M^-1 C lambda = -(r + R M^-1 h), in the sense of the shortest lambda
// where rows depend on each other. So y' is a function of (t, y), and so is every force.
#pragma once

#include "event/model/model.hpp"
#include "lists.hpp"
#include "row_islands.hpp"

namespace tether::scene::event {

/// Changes of gaps and contact velocities that the tolerance of coordinates and velocities amounts
/// to (method, eq. 4), by contact, in the units of the model.
struct Bands {
  struct Band {
    double gap, approach, slip;
  };
  double part = 0;  ///< the tolerance; of the largest force
  std::vector<Band> of;

  double of_accelerations() const { return 0.1 * part; }  ///< of the largest
  double gap(int contact) const { return of[static_cast<std::size_t>(contact)].gap; }
  double approach(int contact) const { return of[static_cast<std::size_t>(contact)].approach; }
  double slip(int contact) const { return of[static_cast<std::size_t>(contact)].slip; }
};

/// In bands of its gap: how far beyond the border of its face a contact may be by the error of the
/// motion.
constexpr double kBesideBorder = 30;

enum class Mode : unsigned char { open, stick, slide };

/// Mode of a contact, and where it slides to: a unit vector of its tangents.
struct ContactMode {
  Mode mode = Mode::open;
  VectorXd direction;
};

/// Forces of all rows of joints, and of each closed contact (n, tangents).
struct RowForces {
  VectorXd joints;
  std::vector<VectorXd> contacts;
};

class Motion {
 public:
  /// Sets the model to (t, q, u), where the bands are taken.
  Motion(Model& model, double tolerance, double t, const VectorXd& y);

  Model& model() { return model_; }
  const Bands& bands() const { return bands_; }
  int size() const { return nq_ + nu_ + 1; }
  int coordinates() const { return nq_; }
  int velocities() const { return nu_; }
  int work() const { return nq_ + nu_; }  ///< index of the unknown E_w

  /// The modes from now on, at the state y: rows that others imply are left out of constraints().
  /// A contact that closes keeps the gap that it has: moving bodies would give or take energy.
  void choose(double t, const VectorXd& y, std::vector<ContactMode> modes);
  /// Whether those rows of joints that stand for all would be better chosen anew at (t, y).
  bool other_joint_rows_are_better(double t, const VectorXd& y);
  const std::vector<double>& levels() const { return levels_; }  ///< gaps of closed contacts
  void set_levels(std::vector<double> levels) { levels_ = std::move(levels); }
  /// Takes what closed contacts and joints do not allow from the velocities, as impulses would.
  void settle_velocities(double t, VectorXd& y);
  const std::vector<ContactMode>& modes() const { return modes_; }
  const std::vector<int>& closed() const { return closed_; }
  /// Some closed contacts share their forces in more than one way.
  bool is_hyperstatic() const { return spare_rows_ > 0; }
  /// A sliding contact has turned to this direction.
  void turn(int contact, const VectorXd& direction) { modes_[at(contact)].direction = direction; }

  /// An open contact whose gap closes at the border of its features, at (t, y), which is set, but
  /// that touches nothing: on its way out, or on its way along the border with a closed contact.
  bool passes_border(double t, const VectorXd& y, int contact);
  /// How fast the contact moves into its features at (t, y), which is set, m/s.
  double margin_rate(double t, const VectorXd& y, int contact);
  /// y' at (t, y); afterwards acceleration() and force() are those there.
  void rate(double t, const double* y, double* y_rate);
  const VectorXd& acceleration() const { return a_; }
  double normal_force(int closed) const {  ///< of a bounded law: its bound
    return is_bounded(at(closed)) ? bound(at(closed)) : lambda_[normal_row(at(closed))];
  }
  VectorXd friction_force(int closed) const;  ///< by tangents
  /// Those of the last rate(). Redundant rows of joints share. Contacts that share forces have
  /// forces that Coulomb's law allows, which the shortest ones may not be.
  RowForces row_forces();
  /// Whether the forces of the last rate() hold all rows, and Coulomb's law allows them.
  bool forces_are_lawful() const;
  /// Directions of the closed contacts that slide; empty where they stick.
  std::vector<VectorXd> slides() const;
  const ContactKinematics& kinematics(int closed) const { return kinematics_[at(closed)]; }
  VectorXd slip(int closed) const { return slip_of(kinematics_[at(closed)]); }
  /// At the state of the last rate().
  VectorXd slip_rate(int closed) const {
    const ContactKinematics& kinematics = kinematics_[at(closed)];
    return kinematics.tangents * a_ + kinematics.slip_rest;
  }
  double work_done() const { return work_done_; }  ///< operations, roughly
  /// Slips of the contacts that slide with friction at (t, y), one after the other.
  void slips_with_friction(double t, const double* y, VectorXd& slips);
  /// Least slip of a contact with friction at the last state: forces turn within such a change.
  double smallest_slip() const { return smallest_slip_; }

  /// The constraints of the phase on y: joints and gaps, their rates, slips of stuck contacts, own
  /// rows of the model, energy.
  int constraint_count() const {
    return static_cast<int>(positions_in_use_.size() + rates_in_use_.size()) + model_.own_rows() +
           (energy_row_ != EnergyRow::none ? 1 : 0);
  }
  void constraints(double t, const double* y, double* g);
  void constraint_gradient(double t, const double* y,
                           Eigen::Ref<Eigen::Matrix<double, -1, -1, Eigen::RowMajor>> C);
  /// Energy less work is that of this state from now on.
  void keep_energy_of(double t, const VectorXd& y) {
    set(t, y.data());
    kept_energy_ = model_.energy() - y[work()];
  }
  void leave_energy_free() { energy_row_ = EnergyRow::none; }  ///< until modes are chosen again
  void keep_energy(double value) { kept_energy_ = value; }
  double kept_energy() const { return kept_energy_; }
  double energy() const { return model_.energy(); }  ///< of the state that was evaluated last

 private:
  VectorXd slip_of(const ContactKinematics& kinematics) const {
    return kinematics.tangents * u_ + kinematics.slip_rate;
  }
  // Slip that ends passes through zero within a step: its direction stays.
  VectorXd held_slip(int closed) const {
    const int contact = closed_[at(closed)];
    const VectorXd& direction = modes_[at(contact)].direction;
    VectorXd s = slip_of(kinematics_[at(closed)]);
    const double along = s.dot(direction), least = bands_.slip(contact);
    if (along < least) s += (least - along) * direction;
    return s;
  }
  bool is_bounded(std::size_t closed) const { return model_.law(closed_[closed]).is_bounded(); }
  bool sticks(std::size_t closed) const { return modes_[at(closed_[closed])].mode == Mode::stick; }
  double friction(std::size_t closed) const {
    return sticks(closed) ? model_.holding(closed_[closed]) : model_.law(closed_[closed]).friction;
  }
  /// Its rows: from row_of_ on the normal, then the tangents where it sticks.
  int normals_of(std::size_t closed) const {
    return model_.law(closed_[closed]).has_normal() ? 1 : 0;
  }
  int tangents_of(std::size_t closed) const {
    return !sticks(closed) ? 0 : model_.law(closed_[closed]).is_line() ? 1 : kTangents;
  }
  /// Its own, or that which holds it.
  int normal_row(std::size_t closed) const { return row_of_[holder_[closed]]; }
  double bound(std::size_t closed) const {
    const int contact = closed_[closed];
    return contains(sharing_, closed) ? bounds_[at(contact)] : model_.law(contact).bound;
  }
  void share_bounds();
  // With all forces.
  void find_bounds() {
    for (const std::size_t k : sharing_)
      if (sticks(k)) shared_[at(closed_[k])].held = lambda_[row_of_[k]];
    model_.share_bounds(1, shared_, bounds_);
  }
  void set(double t, const double* y) {
    model_.set(t, y);
    u_ = Eigen::Map<const VectorXd>(y + nq_, nu_);
  }
  void find_holders() {
    holder_.resize(closed_.size());
    for (std::size_t k = 0; k < closed_.size(); ++k) {
      const int by = model_.law(closed_[k]).held_by;
      const auto from = by < 0 ? closed_.begin() + static_cast<std::ptrdiff_t>(k)
                               : std::lower_bound(closed_.begin(), closed_.end(), by);
      holder_[k] = static_cast<std::size_t>(from - closed_.begin());
    }
  }
  void prepare(double t, const double* y);
  /// Makes forces of contacts lawful where they are not; what joints take over, on velocities.
  VectorXd find_lawful(std::vector<VectorXd>& forces);
  void finish_rate(double* y_rate);
  void gather();
  void values_of_rows(VectorXd& positions, VectorXd& rates);
  VectorXd rates_of_contact(std::size_t closed) const;
  void differentiate_rates(int j, double step, const VectorXd& rates, int first_rate,
                           Eigen::Ref<Eigen::Matrix<double, -1, -1, Eigen::RowMajor>> C);
  int choose_rows();
  void choose_energy_row(int rank);
  void choose_joints();
  void evaluate_joints();

  Model& model_;
  Bands bands_;
  int nq_, nu_;
  std::vector<ContactMode> modes_;  // of all contacts
  std::vector<double> levels_;
  std::vector<int> closed_, row_of_;
  std::vector<std::size_t> holder_;            // place of the contact whose normal force it has
  std::vector<ContactKinematics> kinematics_;  // of the closed ones
  int rows_ = 0, joints_ = 0;
  std::vector<int> joints_in_use_;
  double least_joint_row_ = 1;  // what a row in use added to the others, of its length
  std::vector<int> positions_in_use_, rates_in_use_;  // rows of the projection
  std::vector<int> rate_place_;                       // of each row in rates_in_use_, or -1
  int spare_rows_ = 0;  // of closed contacts: those that the others imply
  double kept_energy_ = 0;
  enum class EnergyRow : unsigned char { none, energy, less_work } energy_row_ = EnergyRow::energy;

  VectorXd u_, h_, a_, lambda_, r_;
  VectorXd joint_rate_, joint_rest_, row_scale_;
  MatrixXd joint_W_, R_, C_, MC_;
  RowIslands islands_;
  std::vector<std::size_t> sharing_;           // closed laws that share their bounds
  std::vector<LawForce> shared_;               // by contact
  std::vector<double> bounds_, bounds_moved_;  // by contact: of these
  double work_done_ = 0;
  double smallest_slip_ = 0;
};

}  // namespace tether::scene::event
