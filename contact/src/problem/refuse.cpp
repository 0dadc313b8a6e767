// Tether: bad input is refused. SPDX-License-Identifier: BSD-3-Clause
#include "problem/refuse.hpp"

#include <charconv>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace tether::contact::detail {

std::string shown(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value, std::chars_format::general, 9).ptr};
}

void refuse(const std::string& argument, double value, const char* wanted) {
  throw std::invalid_argument(argument + " = " + shown(value) + ": " + wanted);
}

void refuse_size(const std::string& argument, Eigen::Index entries, Eigen::Index needed,
                 const std::string& why) {
  throw std::invalid_argument(argument + " has " + std::to_string(entries) +
                              " entries: " + std::to_string(needed) + " are needed, " + why);
}

void require_finite(const char* argument, const Eigen::Ref<const Eigen::MatrixXd>& values,
                    const std::string& where) {
  if (values.allFinite()) return;
  for (Eigen::Index c = 0; c < values.cols(); ++c) {
    for (Eigen::Index r = 0; r < values.rows(); ++r) {
      if (std::isfinite(values(r, c))) continue;
      std::string name = where + argument;
      if (values.size() > 1) {
        name += "(" + std::to_string(r);
        if (values.cols() > 1) name += ", " + std::to_string(c);
        name += ")";
      }
      refuse(name, values(r, c), "must be finite");
    }
  }
}

void check(std::size_t k, const RigidBody& b) {
  const auto where = [k] { return "body " + std::to_string(k) + ": "; };
  if (!(b.inverse_mass >= 0) || !std::isfinite(b.inverse_mass))
    refuse(where() + "inverse_mass", b.inverse_mass, "must be finite and >= 0 (0: fixed)");
  if (!b.inverse_inertia.allFinite()) require_finite("inverse_inertia", b.inverse_inertia, where());
  if (!b.inverse_inertia.isZero(0))
    require_semidefinite("inverse_inertia", b.inverse_inertia, where);
  if (!b.velocity.allFinite()) require_finite("velocity", b.velocity, where());
  if (!b.angular_velocity.allFinite())
    require_finite("angular_velocity", b.angular_velocity, where());
}

void check(std::size_t i, const PointContact& c, int count) {
  const auto where = [i] { return "contact " + std::to_string(i) + ": "; };
  if (c.first < 0 || c.first >= count) {
    throw std::invalid_argument(where() + "first = " + std::to_string(c.first) +
                                ": must be one of " + std::to_string(count) + " bodies");
  }
  if (c.second < -1 || c.second >= count || c.second == c.first) {
    throw std::invalid_argument(where() + "second = " + std::to_string(c.second) +
                                ": must be another one of " + std::to_string(count) +
                                " bodies than first = " + std::to_string(c.first) +
                                ", or -1 for the world");
  }
  if (!c.r1.allFinite()) require_finite("r1", c.r1, where());
  if (!c.r2.allFinite()) require_finite("r2", c.r2, where());
  // A holds the squares of the lever arms.
  for (const auto& [name, r] : {std::pair("r1", &c.r1), std::pair("r2", &c.r2)})
    if (!std::isfinite(r->squaredNorm()))
      refuse(where() + "square of " + name, r->squaredNorm(), "must be finite");
  if (!(c.mu >= 0) || !std::isfinite(c.mu)) refuse(where() + "mu", c.mu, "must be finite and >= 0");
  if (!std::isfinite(c.bias)) refuse(where() + "bias", c.bias, "must be finite");
  if (!c.slip.allFinite()) require_finite("slip", c.slip, where());
  if (!(std::abs(c.normal.squaredNorm() - 1) < 2e-6))
    refuse(where() + "length of normal", c.normal.norm(), "must be 1 (to 1e-6)");
}

void refuse_fixed(std::size_t i) {
  throw std::invalid_argument("contact " + std::to_string(i) +
                              " joins fixed bodies: one of the two must be able to move");
}

}  // namespace tether::contact::detail
