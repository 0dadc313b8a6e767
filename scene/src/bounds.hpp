// Tether: bounds that several rooms share. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <limits>

namespace tether::scene {

/// Elements of a scene by repetition, knots of a load, points of a surface, runs of a sweep.
constexpr std::size_t kMostListed = 100000;
/// Bytes of a scene, and of a surface or an XML file.
constexpr std::size_t kLargestScene = std::size_t{256} << 20, kLargestPart = std::size_t{64} << 20;
/// Bytes of a wrong value that its message shows, and of a wrong key that gets a suggestion.
constexpr std::size_t kLongestShown = 64;
/// Names that a message suggests.
constexpr std::size_t kMostSuggested = 30;
/// Things of one kind that are told one by one.
constexpr std::size_t kMostNamed = 5;
/// Bodies that have columns in a table.
constexpr std::size_t kMostInColumns = 200;
/// Bodies beyond which pictures leave something out.
constexpr std::size_t kManyBodies = 300;

/// Rows of unit length of which those before them leave no more than this depend on these.
constexpr double kDependentRow = 1e-10;
/// Figures of a scene that differ by no more are the same but for rounding: relative to their size,
/// in m or rad, or in steps.
constexpr double kSameFigure = 1e-9;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace tether::scene
