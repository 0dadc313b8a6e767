// Tether: the frames of a page: a bounded number of them over a run of any length.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <tether/scene/engine.hpp>

namespace tether::scene::player {

/// Lengths of the page: (x - centre) / length, so that single precision holds scenes of every size
/// and place.
struct View {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< m
  double length = 1;                                 ///< m
};

/// Keeps records. Where there are more than fit, every second one goes; the errors of a record that
/// goes count for the one before it.
class Film {
 public:
  /// `moving`: the bodies whose poses are kept. `bytes`: of poses and contacts together.
  Film(std::vector<std::size_t> moving, const View& view, std::size_t bytes = kMostBytes);
  void record(const Engine& engine, const Diagnostics& d);
  /// The last record is kept, whatever went before.
  void finish();

  std::size_t size() const { return frames_.size(); }
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
    double kinetic = 0, potential = 0;
    double drift = 0, penetration = 0, residual = 0;
    std::vector<float> positions, contacts;
    std::vector<std::int16_t> orientations;
    std::size_t bytes() const {
      return 4 * (positions.size() + contacts.size()) + 2 * orientations.size();
    }
    void take_errors(const Frame& other);
  };
  Frame frame(const Engine& engine, const Diagnostics& d) const;
  void halve();
  template <class T>
  std::string joined(std::vector<T> Frame::*part) const;

  std::vector<std::size_t> moving_;
  View view_;
  std::size_t most_bytes_, bytes_ = 0, stride_ = 1, seen_ = 0;
  std::vector<Frame> frames_;
  Frame last_;
  bool last_kept_ = true;
};

}  // namespace tether::scene::player
