// Glocker's woodpecker toy as a model of the event engine. SPDX-License-Identifier: BSD-3-Clause
//
// C. Glocker, "Set-valued force laws" (2001), section 13: coordinates (y, phi_M, phi_S), the sleeve
// on the pole and the bird on its spring. Contact 0: the beak; 1 and 2: the lower and the upper
// edge of the sleeve.
#pragma once

#include <Eigen/LU>
#include <algorithm>

#include "event/model/model.hpp"

namespace woodpecker {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using tether::scene::event::ContactKinematics;
using tether::scene::event::ContactLaw;

class Woodpecker : public tether::scene::event::Model {
 public:
  Woodpecker() {
    M_ << mS + mM, mS * lM, mS * lG,               //
        mS * lM, JM + mS * lM * lM, mS * lM * lG,  //
        mS * lG, mS * lM * lG, JS + mS * lG * lG;
    inverse_ = M_.inverse();
  }
  int coordinates() const override { return 3; }
  int velocities() const override { return 3; }
  int joint_rows() const override { return 0; }
  int contacts() const override { return 3; }
  int tangents() const override { return 1; }
  ContactLaw law(int contact) const override { return {0.3, contact == 0 ? 0.5 : 0.0}; }

  // Places, speeds and the energy of its motion: tolerances are parts of them.
  VectorXd sizes() const override {
    VectorXd s(7);
    s << 0.01, 0.2, 0.2, 1, 1, 1, 1e-3;
    return s;
  }

  void set(double, const double* y) override {
    q_ = Eigen::Map<const Eigen::Vector3d>(y);
    u_ = Eigen::Map<const Eigen::Vector3d>(y + 3);
  }
  void rates(double* q_rate) const override { std::copy_n(u_.data(), 3, q_rate); }
  void divide_by_mass(Eigen::Ref<MatrixXd> X) const override { X = (inverse_ * X).eval(); }
  void forces(VectorXd& h) override {
    h.resize(3);
    h << -(mS + mM) * g, -c * (q_[1] - q_[2]) - mS * g * lM, -c * (q_[2] - q_[1]) - mS * g * lG;
  }
  void joints(VectorXd& a, MatrixXd& W, VectorXd& b, VectorXd& d) override {
    a.resize(0);
    W.resize(0, 3);
    b.resize(0);
    d.resize(0);
  }
  double gap(int contact, double& rate) override {
    rate = contact == 0 ? -hS * u_[2] : contact == 1 ? hM * u_[1] : -hM * u_[1];
    return contact == 0   ? lM + lG - lS - r0 - hS * q_[2]
           : contact == 1 ? rM - r0 + hM * q_[1]
                          : rM - r0 - hM * q_[1];
  }
  void evaluate_contact(int contact, ContactKinematics& out) override {
    double rate = 0;
    out.gap = gap(contact, rate);
    out.normal.setZero(3);
    out.normal[contact == 0 ? 2 : 1] = contact == 0 ? -hS : contact == 1 ? hM : -hM;
    out.tangents.setZero(1, 3);
    if (contact == 0)
      out.tangents << 1, lM, lG - lS;
    else
      out.tangents << 1, rM, 0;
    out.normal_rate = out.normal_rest = 0;
    out.slip_rate.setZero(1);
    out.slip_rest.setZero(1);
  }
  void to_coordinates(const double* row, double* gradient) const override {
    std::copy_n(row, 3, gradient);
  }
  double energy() const override {
    const double twist = q_[1] - q_[2];
    return 0.5 * u_.dot(M_ * u_) + g * ((mS + mM) * q_[0] + mS * lM * q_[1] + mS * lG * q_[2]) +
           0.5 * c * twist * twist;
  }
  void energy_gradient(double* by_q, double* by_u) const override {
    const double pull = c * (q_[1] - q_[2]);
    by_q[0] = g * (mS + mM);
    by_q[1] = g * mS * lM + pull;
    by_q[2] = g * mS * lG - pull;
    Eigen::Map<Eigen::Vector3d>{by_u} = M_ * u_;
  }

  static VectorXd start() {
    VectorXd y(6);
    y << 0, -.0006 / .0058, -.2788, -.3411, 0, -7.4583;
    return y;
  }

 private:
  static constexpr double mS = 4.5e-3, JS = 7e-7, mM = 3e-4, JM = 5e-9;
  static constexpr double r0 = 0.0025, rM = 0.0031, hM = 0.0058, lM = 0.010, lG = 0.015, hS = 0.02,
                          lS = 0.0201, c = 0.0056, g = 9.81;
  Eigen::Matrix3d M_, inverse_;
  Eigen::Vector3d q_ = Eigen::Vector3d::Zero(), u_ = Eigen::Vector3d::Zero();
};

}  // namespace woodpecker
