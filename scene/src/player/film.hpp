// Tether: the frames of a page: a bounded number of them over a run of any length.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <tether/scene/engine.hpp>

#include "output/thinned.hpp"

namespace tether::scene::player {

/// Lengths of the page: (x - centre) / length, so that single precision holds scenes of every size
/// and place.
struct View {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< m
  double length = 1;                                 ///< m
};

class Film {
 public:
  /// `moving`: the bodies whose poses are kept. `bytes`: of poses and contacts together.
  Film(std::vector<std::size_t> moving, const View& view, std::size_t bytes = kMostBytes);
  void record(const Engine& engine, const Diagnostics& d) { frames_.add(frame(engine, d)); }
  void finish() { frames_.finish(); }

  std::size_t size() const { return frames_.all().size(); }
  /// Adds times, energies, errors and contacts a frame to the object of the page.
  void add_to(nlohmann::json& page) const;
  /// In base 64: positions (3 a body, single precision), orientations (w, x, y, z a body, 32767 for
  /// 1), contacts (point in units of the view, impulse on the first body and normal: 9 a contact;
  /// of the event engine, whose closed contacts have no impulses, the force).
  std::string positions() const, orientations() const, contacts() const;

  static constexpr std::size_t kMostFrames = 2000;
  static constexpr std::size_t kMostBytes = std::size_t{12} << 20;

 private:
  struct Frame {
    double time = 0;
    Diagnostics d;
    std::vector<float> positions, contacts;
    std::vector<std::int16_t> orientations;
    std::size_t bytes() const {
      return 4 * (positions.size() + contacts.size()) + 2 * orientations.size();
    }
  };
  Frame frame(const Engine& engine, const Diagnostics& d) const;
  template <class T>
  std::string joined(std::vector<T> Frame::*part) const;

  std::vector<std::size_t> moving_;
  View view_;
  Thinned<Frame> frames_;
};

}  // namespace tether::scene::player
