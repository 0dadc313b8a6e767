// Tether: axes of a picture. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "canvas.hpp"

namespace tether::scene::picture {

constexpr double kLeastError = 1e-17;  // what is below, and zero, lies on the edge of a picture

struct Range {
  double low = 0, high = 1;
  bool logarithmic = false;  // low > 0 then
};

/// The value in four digits, without zeros that say nothing: 1e-6.
std::string short_number(double value);

/// A little more than the values; logarithmic: without those that have no logarithm.
Range range_of(const std::vector<double>& values, bool logarithmic);

/// Name and colour of a curve.
struct Entry {
  std::string name, colour;
};

/// Rows of entries from the left; returns where they end.
double draw_legend(Canvas& canvas, const std::vector<Entry>& entries, const Box& inside,
                   double size = 12);

class Axes {
 public:
  /// `inside`: the panel without its texts.
  Axes(Canvas& canvas, const Box& inside, const Range& x, const Range& y)
      : canvas_(canvas), inside_(inside), x_(x), y_(y) {}

  Vector2d at(double x, double y) const;
  const Box& inside() const { return inside_; }
  /// Lines and numbers, as many as have room, and titles: that of x below, that of y above.
  void draw(const std::string& x_title, const std::string& y_title);
  /// A line through the points, which texts avoid.
  void curve(const std::vector<Vector2d>& points, const Pen& pen);

 private:
  Canvas& canvas_;
  Box inside_;
  Range x_, y_;
};

}  // namespace tether::scene::picture
