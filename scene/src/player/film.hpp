// Tether: the frames of a page: a bounded number of them over a run of any length.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <tether/scene/engine.hpp>

#include "output/thinned.hpp"
#include "page_text.hpp"

namespace tether::scene::player {

/// Lengths of the page: (x - centre) / length, so that single precision holds scenes of every size
/// and place.
struct View {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< m
  double length = 1;                                 ///< m
};

class Film {
 public:
  static constexpr std::size_t kMostFrames = 2000;
  static constexpr std::size_t kMostBytes = std::size_t{12} << 20;

  /// Adds to `out` in single precision, in which doubles beyond the range stay at its border.
  static void add(const Eigen::Vector3d& v, std::vector<float>& out) {
    using Limits = std::numeric_limits<float>;
    for (const double x : v)
      out.push_back(static_cast<float>(std::clamp<double>(x, Limits::lowest(), Limits::max())));
  }
  struct Frame {
    double time = 0;
    Diagnostics d;
    /// 3 a body; of a contact the point in units of the view, the impulse on the first body (of the
    /// event engine, whose closed contacts have no impulses, the force) and the normal: 9.
    std::vector<float> positions, contacts;
    std::vector<std::int16_t> orientations;  ///< w, x, y, z a body, 32767 for 1
    std::size_t bytes() const {
      return 4 * (positions.size() + contacts.size()) + 2 * orientations.size();
    }
  };

  /// `moving`: the bodies whose poses are kept. `bytes`: of poses and contacts together.
  Film(std::vector<std::size_t> moving, const View& view, std::size_t bytes = kMostBytes)
      : moving_(std::move(moving)), view_(view), frames_(kMostFrames, bytes) {}

  void record(const Engine& engine, const Diagnostics& d) {
    Frame now;
    now.time = engine.time();
    now.d = d;
    const auto in_view = [&](const Eigen::Vector3d& x) -> Eigen::Vector3d {
      return (x - view_.centre) / view_.length;
    };
    for (const std::size_t b : moving_) {
      const BodyState& body = engine.bodies()[b];
      add(in_view(body.position), now.positions);
      const auto& q = body.orientation;
      for (const double x : {q.w(), q.x(), q.y(), q.z()})
        now.orientations.push_back(
            static_cast<std::int16_t>(std::lround(32767 * std::clamp(x, -1.0, 1.0))));
    }
    const bool events = std::string_view(engine.name()) == "event";
    for (const ContactState& contact : engine.contacts()) {
      add(in_view(contact.point), now.contacts);
      add(events ? contact.force : contact.impulse, now.contacts);
      add(contact.normal, now.contacts);
    }
    frames_.add(std::move(now));
  }
  void finish() { frames_.finish(); }

  const std::vector<Frame>& frames() const { return frames_.all(); }
  /// A part of all frames in base 64.
  template <class T>
  std::string joined(std::vector<T> Frame::*part) const {
    std::vector<T> all;
    for (const Frame& each : frames())
      all.insert(all.end(), (each.*part).begin(), (each.*part).end());
    return base64(all);
  }

 private:
  std::vector<std::size_t> moving_;
  View view_;
  Thinned<Frame> frames_;
};

}  // namespace tether::scene::player
