// Tether: a picture in SVG, and axes in it. SPDX-License-Identifier: BSD-3-Clause
//
// Units are pixels, y goes down. Texts are laid out by boxes of .6 em a character, which the
// letters of common fonts do not fill: two texts whose boxes are apart are apart in every viewer.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <fmt/format.h>
#include <string>
#include <vector>

namespace tether::scene::picture {

using Eigen::Vector2d;

struct Box {
  double left = 0, top = 0, right = 0, bottom = 0;
  bool meets(const Box& o) const {
    return left < o.right && right > o.left && top < o.bottom && bottom > o.top;
  }
  bool holds(const Box& o) const {
    return o.left >= left && o.right <= right && o.top >= top && o.bottom <= bottom;
  }
};

enum class Anchor : std::uint8_t { begin, middle, end };

/// A point of the baseline of a text.
struct Spot {
  Vector2d at;
  Anchor anchor = Anchor::begin;
};

struct Pen {
  std::string colour = "#202020";
  double width = 1;
  std::string dashes;  // as SVG has them; empty: none
};

struct Font {
  double size = 13;
  std::string colour = "#202020";
};

/// Okabe and Ito: safe for colour-blind readers.
inline constexpr std::array<const char*, 7> kColours = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                                        "#e69f00", "#56b4e9", "#999999"};

/// Text of an element of SVG or HTML, in UTF-8: bytes that are not become U+FFFD.
std::string markup_text(const std::string& text);

/// Width of the box of a text.
double width_of(const std::string& text, double size);
/// At most that wide: what does not fit becomes three dots.
std::string fitted(const std::string& text, double size, double width);

class Canvas {
 public:
  Canvas(double width, double height) : whole_{0, 0, width, height} {}
  const Box& whole() const { return whole_; }

  void line(const Vector2d& from, const Vector2d& to, const Pen& pen);
  void path(const std::vector<Vector2d>& points, const Pen& pen);
  /// An empty colour: not filled.
  void polygon(const std::vector<Vector2d>& points, const std::string& fill, const Pen& pen);
  void circle(const Vector2d& centre, double radius, const std::string& fill, const Pen& pen);
  /// Lines over a polygon: what is held fast.
  void hatch(const std::vector<Vector2d>& points);
  /// Drawings between the two calls are seen inside of the box only.
  void begin_clip(const Box& box) {
    drawn_ += fmt::format(
        "<clipPath id=\"clip{0}\"><rect x=\"{1:.1f}\" y=\"{2:.1f}\" width=\"{3:.1f}\" "
        "height=\"{4:.1f}\"/></clipPath>\n<g clip-path=\"url(#clip{0})\">\n",
        clips_++, box.left, box.top, box.right - box.left, box.bottom - box.top);
  }
  void end_clip();
  /// Drawings between the two calls tell the text where they are pointed at.
  void begin_note(const std::string& text) {
    drawn_ += fmt::format("<g><title>{}</title>\n", markup_text(text));
  }
  void end_note() { end_clip(); }

  /// Texts keep off the box.
  void block(const Box& box) { taken_.push_back(box); }
  /// Texts cross the line only where they find no other place.
  void avoid(const Vector2d& from, const Vector2d& to);
  /// Puts the text at the first place inside of the box where nothing is; false: there is none.
  bool text(const std::string& text, const std::vector<Spot>& places, const Box& inside,
            const Font& font = {});

  /// The file.
  std::string svg(const std::string& title) const;

 private:
  Box whole_;
  std::string drawn_, texts_;  // texts lie over all else
  std::vector<Box> taken_, avoided_;
  int clips_ = 0;
};

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
