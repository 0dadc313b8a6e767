// Tether: one-dimensional laws of joints. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <tether/contact/joints.hpp>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// Laws on a speed s' = sum over bodies of G v of a joint, for one step; the impulse x along it
/// acts on each body as G' x. They are solved with the contacts, in one problem:
///
///     limit     x >= 0,  s' >= -gap / dt,  complementary (struck: s' >= -e s'-, method, section 8)
///     bounded   |x| <= bound dt,  x opposes s' - rate, and is the bound where that is not 0
///     sprung    x = -dt (stiffness (stretch + dt (s' - rate)) + damping (s' - rate)), |x| <= bound
///     dt
///
/// Bounded with rate 0 is Coulomb's friction of a joint, with another one a motor of limited force.
/// Sprung is a spring and a damper, or a controlled drive, with the stretch and the speed of the
/// end of the step: stable for any step and gain.
class JointLaws {
 public:
  /// A law as it was added.
  struct Law {
    /// Which of the three.
    enum class Kind : std::uint8_t { limit, bounded, sprung };
    int joint;                          ///< number, for messages
    Kind kind;                          ///< what was added
    double gap;                         ///< m or rad
    double restitution;                 ///< 0 .. 1
    double rate;                        ///< m/s or rad/s
    double bound;                       ///< N or N m
    double stretch = 0;                 ///< m or rad
    double stiffness = 0, damping = 0;  ///< N/m, N s/m; N m/rad, N m s/rad

    bool is_limit() const { return kind == Kind::limit; }    ///< of add_limit()
    bool is_sprung() const { return kind == Kind::sprung; }  ///< of add_sprung()
  };

  void clear();  ///< removes all laws
  /// `gap`: way to the limit, < 0 beyond it. Throws std::invalid_argument, as the others, on values
  /// that are not finite or out of their range.
  void add_limit(int joint, double gap, double restitution);
  /// bound >= 0.
  void add_bounded(int joint, double rate, double bound);
  /// stiffness, damping >= 0, not both 0; bound >= 0, may be infinite.
  void add_sprung(int joint, double stretch, double stiffness, double damping, double rate,
                  double bound);
  /// Replaces the bound of a bounded law by another one, >= 0.
  void set_bound(int law, double bound);
  /// Adds the term G v of one more body to the law added last; body -1, the world, is ignored.
  void on(int body, const Vector6d& G);

  int count() const { return rows_.count(); }  ///< number of laws
  /// In the order in which they were added, from 0.
  const Law& operator[](int law) const { return laws_[static_cast<std::size_t>(law)]; }
  const JointRows& rows() const { return rows_; }  ///< one for each law

 private:
  JointRows rows_;
  std::vector<Law> laws_;
};

}  // namespace tether::contact
TETHER_EXPORT_END
