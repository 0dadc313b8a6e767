// Tether: the frames of a page: a bounded number of them over a run of any length.
// SPDX-License-Identifier: BSD-3-Clause
#include "film.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "page_text.hpp"

namespace tether::scene::player {

namespace {

/// Doubles beyond the range of single precision stay at its border.
float single(double x) {
  using Limits = std::numeric_limits<float>;
  return static_cast<float>(std::clamp<double>(x, Limits::lowest(), Limits::max()));
}

void add(const Eigen::Vector3d& v, std::vector<float>& out) {
  for (int i = 0; i < 3; ++i) out.push_back(single(v[i]));
}

}  // namespace

Film::Film(std::vector<std::size_t> moving, const View& view, std::size_t bytes)
    : moving_(std::move(moving)), view_(view), frames_(kMostFrames, bytes) {}

Film::Frame Film::frame(const Engine& engine, const Diagnostics& d) const {
  Frame out;
  out.time = engine.time();
  out.d = d;
  const auto in_view = [&](const Eigen::Vector3d& x) -> Eigen::Vector3d {
    return (x - view_.centre) / view_.length;
  };
  for (const std::size_t b : moving_) {
    const BodyState& body = engine.bodies()[b];
    add(in_view(body.position), out.positions);
    const auto& q = body.orientation;
    for (const double x : {q.w(), q.x(), q.y(), q.z()})
      out.orientations.push_back(
          static_cast<std::int16_t>(std::lround(32767 * std::clamp(x, -1.0, 1.0))));
  }
  const bool events = std::string_view(engine.name()) == "event";
  for (const ContactState& contact : engine.contacts()) {
    add(in_view(contact.point), out.contacts);
    add(events ? contact.force : contact.impulse, out.contacts);
    add(contact.normal, out.contacts);
  }
  return out;
}

void Film::add_to(nlohmann::json& page) const {
  for (const Frame& each : frames_.all()) {
    page["times"].push_back(each.time);
    page["kinetic"].push_back(each.d.kinetic_energy);
    page["potential"].push_back(each.d.potential_energy);
    page["drift"].push_back(each.d.drift);
    page["penetration"].push_back(each.d.penetration);
    page["residual"].push_back(each.d.residual);
    page["contacts"].push_back(each.contacts.size() / 9);
  }
}

template <class T>
std::string Film::joined(std::vector<T> Frame::*part) const {
  std::vector<T> all;
  for (const Frame& each : frames_.all())
    all.insert(all.end(), (each.*part).begin(), (each.*part).end());
  return base64(all);
}

std::string Film::positions() const { return joined(&Frame::positions); }
std::string Film::orientations() const { return joined(&Frame::orientations); }
std::string Film::contacts() const { return joined(&Frame::contacts); }

}  // namespace tether::scene::player
