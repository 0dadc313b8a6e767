// Tether: axes of a picture. SPDX-License-Identifier: BSD-3-Clause
#include "axes.hpp"
#include "bounds.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace tether::scene::picture {

namespace {

constexpr double kSize = 12;  // of numbers
// Powers of ten that an axis reaches to: its ends, and what lies between them, are numbers.
constexpr double kMostPower = 300;

double share(const Range& range, double value) {
  if (!range.logarithmic) return (value - range.low) / (range.high - range.low);
  const double low = std::log10(range.low), high = std::log10(range.high);
  return (std::log10(std::max(value, range.low)) - low) / (high - low);
}

struct Tick {
  double value;
  std::string text;
};

/// 1, 2, 5 times powers of ten, at least that far apart.
std::vector<Tick> linear_ticks(const Range& range, double least) {
  const double raw = least * (range.high - range.low);
  const double power = std::pow(10, std::floor(std::log10(raw)));
  double step = 10 * power;
  for (const double k : {5.0, 2.0, 1.0})
    if (k * power >= raw) step = k * power;
  std::vector<Tick> out;
  for (double k = std::ceil(range.low / step - 1e-9); k * step <= range.high + 1e-9 * step; ++k) {
    // Steps, not sums of them: 0.30000000000000004 is 0.3.
    const double value = std::abs(k) < 0.5 ? 0 : k * step;
    out.push_back({value, short_number(value)});
    if (out.size() > 100) break;  // beyond the digits of the range
  }
  return out;
}

/// Powers of ten; between them 2 and 5 times these where there are few.
std::vector<Tick> logarithmic_ticks(const Range& range, double least) {
  const double low = std::log10(range.low), high = std::log10(range.high);
  const int stride = std::max(1, static_cast<int>(std::ceil(least * (high - low))));
  std::vector<Tick> out;
  // The powers come first: 2 and 5 take the room that they leave.
  for (const int factor : {1, 2, 5}) {
    if (factor > 1 && high - low >= 2) break;
    for (int power = static_cast<int>(std::floor(low)); power <= high; ++power) {
      const double value = factor * std::pow(10, power);
      if (power % stride == 0 && value >= 0.999 * range.low && value <= 1.001 * range.high)
        out.push_back({value, short_number(value)});
    }
  }
  return out;
}

std::vector<Tick> ticks(const Range& range, double least) {
  return range.logarithmic ? logarithmic_ticks(range, least) : linear_ticks(range, least);
}

}  // namespace

std::string short_number(double value) {
  std::string out = fmt::format("{:.4g}", value);
  const std::size_t e = out.find('e');
  if (e == std::string::npos) return out;
  if (out[e + 1] == '+') out.erase(e + 1, 1);
  const std::size_t digits = out.find_first_of("0123456789", e);
  while (out[digits] == '0' && digits + 1 < out.size()) out.erase(digits, 1);
  return out;
}

Range range_of(const std::vector<double>& values, bool logarithmic) {
  double low = kInfinity, high = -low;
  for (const double value : values) {
    if (!std::isfinite(value) || (logarithmic && !(value > 0))) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  if (!(low <= high)) low = high = 1;
  if (logarithmic) {
    const double from = std::log10(low), to = std::log10(high);
    const double margin = std::max(0.15, 0.06 * (to - from));
    return {std::pow(10, std::clamp(from - margin, -kMostPower, kMostPower - 1)),
            std::pow(10, std::clamp(to + margin, 1 - kMostPower, kMostPower)), true};
  }
  const double most = std::pow(10, kMostPower);
  low = std::clamp(low, -most, most);
  high = std::clamp(high, -most, most);
  const double margin = high > low ? 0.06 * (high - low) : std::max(1e-3 * std::abs(high), 1e-12);
  return {low - margin, high + margin, false};
}

double draw_legend(Canvas& canvas, const std::vector<Entry>& entries, const Box& inside,
                   double size) {
  const double sign = 1.6 * size, gap = 1.2 * size, row = 1.4 * size;
  double x = inside.left, y = inside.top;
  for (const Entry& entry : entries) {
    const std::string text = fitted(entry.name, size, inside.right - inside.left - sign - 4);
    const double width = sign + 4 + width_of(text, size);
    if (x > inside.left && x + width > inside.right) x = inside.left, y += row;
    const Vector2d at(x, y + 0.7 * size);
    canvas.line(at, at + Vector2d(sign, 0), {entry.colour, 2.5, ""});
    canvas.block({x, y, x + sign, y + size});
    canvas.text(text, {{Vector2d(x + sign + 4, y + size), Anchor::begin}}, canvas.whole(),
                {size, "#202020"});
    x += width + gap;
  }
  return entries.empty() ? y : y + row;
}

Vector2d Axes::at(double x, double y) const {
  return {inside_.left + share(x_, x) * (inside_.right - inside_.left),
          inside_.bottom - share(y_, y) * (inside_.bottom - inside_.top)};
}

void Axes::draw(const std::string& x_title, const std::string& y_title) {
  const Pen grid{"#e4e4e4", 0.8, ""}, border{"#404040", 1, ""};
  const double width = inside_.right - inside_.left, height = inside_.bottom - inside_.top;
  const Box whole = canvas_.whole();
  canvas_.text(x_title,
               {{Vector2d(inside_.left + width / 2, inside_.bottom + 2.8 * kSize), Anchor::middle}},
               whole, {13, "#202020"});
  canvas_.text(
      y_title,
      {{Vector2d(std::max(inside_.left - 4 * kSize, whole.left + 4), inside_.top - 0.7 * kSize),
        Anchor::begin}},
      whole, {13, "#202020"});
  for (const Tick& tick : ticks(x_, 5.5 * kSize * 0.8 / width)) {
    const Vector2d p = at(tick.value, y_.low);
    if (!canvas_.text(tick.text, {{p + Vector2d(0, 1.35 * kSize), Anchor::middle}}, whole,
                      {kSize, "#202020"}))
      continue;
    canvas_.line(p, {p.x(), inside_.top}, grid);
    canvas_.line(p, p + Vector2d(0, 4), border);
  }
  for (const Tick& tick : ticks(y_, 1.8 * kSize / height)) {
    const Vector2d p = at(x_.low, tick.value);
    if (!canvas_.text(tick.text, {{p + Vector2d(-6, 0.35 * kSize), Anchor::end}}, whole,
                      {kSize, "#202020"}))
      continue;
    canvas_.line(p, {inside_.right, p.y()}, grid);
    canvas_.line(p, p - Vector2d(4, 0), border);
  }
  canvas_.path({{inside_.left, inside_.top},
                {inside_.left, inside_.bottom},
                {inside_.right, inside_.bottom}},
               border);
}

void Axes::curve(const std::vector<Vector2d>& points, const Pen& pen) {
  std::vector<Vector2d> pixels;
  for (const Vector2d& p : points) pixels.push_back(at(p.x(), p.y()));
  for (std::size_t k = 1; k < pixels.size(); ++k) canvas_.avoid(pixels[k - 1], pixels[k]);
  canvas_.path(pixels, pen);
}

}  // namespace tether::scene::picture
