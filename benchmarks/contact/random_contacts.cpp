// Tether: random one-contact problems and an independent reference. SPDX-License-Identifier:
// BSD-3-Clause
#include "random_contacts.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>

namespace tether::contact::random {

Eigen::Matrix3d Generator::rotation() {
  Eigen::Vector4d q(normal(), normal(), normal(), normal());
  q.normalize();
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
}

Eigen::Matrix3d Generator::spectrum(double condition) {
  const Eigen::Vector3d d(1, std::pow(condition, -uniform(0, 1)), 1 / condition);
  const Eigen::Matrix3d R = rotation(), A = R * d.asDiagonal() * R.transpose();
  return 0.5 * (A + A.transpose());
}

Eigen::Matrix3d Generator::body(const Eigen::Vector3d& h, double m) {
  Eigen::Vector3d r(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
  r[static_cast<int>(uniform(0, 3))] = uniform(0, 1) < 0.5 ? -1 : 1;
  r = r.cwiseProduct(h);
  const Eigen::Vector3d s = h.cwiseProduct(h) * (m / 3);
  const Eigen::Vector3d inertia(s[1] + s[2], s[0] + s[2], s[0] + s[1]);
  Eigen::Matrix3d X;
  X << 0, -r[2], r[1], r[2], 0, -r[0], -r[1], r[0], 0;
  const Eigen::Matrix3d A =
      Eigen::Matrix3d::Identity() / m - X * inertia.cwiseInverse().asDiagonal() * X;
  const Eigen::Matrix3d R = rotation(), B = R * A * R.transpose();
  return 0.5 * (B + B.transpose());
}

Contact Generator::operator()(const std::string& kind) {
  Contact c;
  c.mu = uniform(0, 1.5);
  if (kind.rfind("condition_", 0) == 0) {
    c.A = spectrum(std::stod(kind.substr(10)));
  } else if (kind == "boxes") {
    const auto size = [&] {
      return Eigen::Vector3d(uniform(0.2, 1), uniform(0.2, 1), uniform(0.2, 1));
    };
    c.A = body(size(), uniform(0.1, 10)) + body(size(), uniform(0.1, 10));
  } else if (kind == "rods") {
    c.A = body({1, 0.02, 0.02}, 1);
  } else if (kind == "hyperbolic") {
    c.A = spectrum(std::pow(10, uniform(1, 4)));
    const double t = std::hypot(c.A(0, 1), c.A(0, 2));
    c.mu = c.A(0, 0) / t * std::pow(10, uniform(-1e-9, uniform(0, 1)));
    if (uniform(0, 1) < 0.1) c.mu = c.A(0, 0) / t * (1 + uniform(-1e-6, 1e-6));
    if (!(c.mu < 1e6)) c.mu = 1e6;
  } else if (kind == "bn_to_zero") {
    c.A = spectrum(std::pow(10, uniform(0, 6)));
    c.mu = uniform(0, 5);
  } else if (kind == "mu_zero" || kind == "mu_1000") {
    c.A = spectrum(std::pow(10, uniform(0, 6)));
    c.mu = kind == "mu_zero" ? 0 : 1000;
  } else {
    // Rank 1 or 2, b in the range of A.
    const Eigen::Vector3d p = vector(), q = vector();
    c.A = p * p.transpose();
    if (uniform(0, 1) < 0.7) c.A += q * q.transpose();
    c.b = c.A * vector();
    if (!(c.A(0, 0) > 1e-3)) return (*this)(kind);
    return c;
  }
  c.b = vector();
  if (uniform(0, 1) < 0.5) c.b = c.A * c.b;
  if (kind == "bn_to_zero") c.b[0] = (uniform(0, 1) < 0.5 ? -1 : 1) * std::pow(10, -uniform(1, 18));
  return c;
}

Reduced::Reduced(const Contact& p) {
  a = p.A(0, 0);
  bn = p.b[0];
  mu = p.mu;
  c << p.A(0, 1), p.A(0, 2);
  const Vector2 wc = c.cast<Wide>();
  wide_B = p.A.bottomRightCorner<2, 2>().cast<Wide>() - wc * wc.transpose() / Wide(a);
  wide_h = p.b.tail<2>().cast<Wide>() - wc * (Wide(bn) / Wide(a));
  // Singular blocks: b lies in the range of A, what is left of it across is round-off.
  const Eigen::SelfAdjointEigenSolver<Matrix2> eigen(wide_B);
  if (eigen.eigenvalues()[0] < 1e-14L * p.A.trace()) {
    Vector2 values = eigen.eigenvalues(), part = eigen.eigenvectors().transpose() * wide_h;
    for (int i = 0; i < 2; ++i) {
      if (values[i] < 1e-14L * p.A.trace()) values[i] = part[i] = 0;
    }
    wide_B = eigen.eigenvectors() * values.asDiagonal() * eigen.eigenvectors().transpose();
    wide_h = eigen.eigenvectors() * part;
  }
  B = wide_B.cast<double>();
  h = wide_h.cast<double>();
}

double Reduced::energy(const Eigen::Vector2d& y) const {
  const Vector2 w = y.cast<Wide>();
  return static_cast<double>(0.5L * w.dot(wide_B * w) - wide_h.dot(w));
}

double Reduced::scale(const Eigen::Vector2d& y) const {
  return 0.5 * std::abs(y.dot(B * y)) + std::abs(h.dot(y)) + 0.5 * bn * bn / a;
}

bool Reduced::boundary(double angle, Eigen::Vector2d& y) const {
  const Eigen::Vector2d u(std::cos(angle), std::sin(angle));
  const double q = a + mu * c.dot(u);
  if (!(q > 0)) return false;
  y = mu * bn / q * u;
  return true;
}

double Reduced::value(double angle) const {
  Eigen::Vector2d y;
  if (!boundary(angle, y)) return std::numeric_limits<double>::infinity();
  return 0.5 * y.dot(B * y) - h.dot(y);
}

double Reduced::reference(int points) const {
  const double step = 6.283185307179586 / points;
  double best = std::numeric_limits<double>::infinity();
  int best_k = 0;
  for (int k = 0; k < points; ++k) {
    const double e = value(k * step);
    if (e < best) {
      best = e;
      best_k = k;
    }
  }
  double lo = (best_k - 1) * step, hi = (best_k + 1) * step;
  const double r = 0.6180339887498949;
  double p = hi - r * (hi - lo), q = lo + r * (hi - lo), fp = value(p), fq = value(q);
  for (int k = 0; k < 60; ++k) {
    if (fp < fq) {
      hi = q;
      q = p;
      fq = fp;
      p = hi - r * (hi - lo);
      fp = value(p);
    } else {
      lo = p;
      p = q;
      fp = fq;
      q = lo + r * (hi - lo);
      fq = value(q);
    }
  }
  best = std::numeric_limits<double>::infinity();
  Eigen::Vector2d y;
  for (double angle : {p, q, best_k * step})
    if (boundary(angle, y)) best = std::min(best, energy(y));
  const Wide det = wide_B.determinant(), trace = wide_B.trace();
  if (det > 1e-16L * trace * trace) {
    y = (wide_B.inverse() * wide_h).cast<double>();
    if (y.norm() <= mu * (bn - c.dot(y)) / a) best = std::min(best, energy(y));
  }
  return best;
}

const char* failure(const Contact& p, const Eigen::Vector3d& x, int points) {
  if (!x.allFinite()) return "not finite";
  if (!(p.b[0] > 0)) return x.isZero(0) ? nullptr : "impulse at a separating contact";
  const Reduced r(p);
  const Eigen::Vector2d y = x.tail<2>();
  const double scale =
      r.a * std::abs(x[0]) + std::abs(r.c[0] * y[0]) + std::abs(r.c[1] * y[1]) + p.b[0];
  if (!(x[0] >= 0)) return "pulls";
  if (std::abs(r.a * x[0] + r.c.dot(y) - p.b[0]) > 1e-12 * scale) return "plane";
  if (std::hypot(y[0], y[1]) > p.mu * x[0] * (1 + 1e-12)) return "cone";
  if (p.mu == 0) return y.isZero(0) ? nullptr : "friction at mu = 0";
  const double e = r.energy(y), reference = r.reference(points);
  if (e > reference + 1e-9 * std::max(r.scale(y), std::abs(reference)) + 1e-300) return "energy";
  return nullptr;
}

}  // namespace tether::contact::random
