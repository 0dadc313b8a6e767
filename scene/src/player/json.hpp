// Tether: values of a page: JSON that may stand inside HTML, and numbers in base 64.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace tether::scene::player {

/// A string of JSON in quotes. Characters that mean something to HTML, control characters and
/// separators of lines are escaped; bytes that are not UTF-8 become U+FFFD.
std::string json(std::string_view text);
/// null where JSON has no number.
std::string json(double x);
std::string json(const Eigen::Vector3d& v);
/// [w, x, y, z]
std::string json(const Eigen::Quaterniond& q);
std::string json(const std::vector<double>& values);

/// Text of an HTML element.
std::string html(std::string_view text);

/// Little-endian, in base 64.
std::string base64(const std::vector<float>& values);
std::string base64(const std::vector<std::int16_t>& values);

}  // namespace tether::scene::player
