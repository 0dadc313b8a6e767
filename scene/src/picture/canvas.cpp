// Tether: a picture in SVG, and axes in it. SPDX-License-Identifier: BSD-3-Clause
#include "canvas.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "bounds.hpp"
#include "output/files.hpp"
#include "toml/report.hpp"

namespace tether::scene::picture {

namespace {

constexpr double kCharacter = 0.6;  // em

constexpr const char* kHatch =
    "<defs><pattern id=\"hatch\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\" "
    "patternTransform=\"rotate(45)\"><line x1=\"0\" y1=\"0\" x2=\"0\" y2=\"6\" "
    "stroke=\"#909090\" stroke-width=\"1.6\"/></pattern></defs>\n";

/// Its characters; what is none becomes the sign for that.
std::vector<std::string> characters(std::string_view text) {
  std::vector<std::string> out;
  while (!text.empty()) {
    const std::size_t count = files::character_at(text);
    out.emplace_back(count > 0 ? std::string(text.substr(0, count)) : "\xef\xbf\xbd");
    text.remove_prefix(std::max<std::size_t>(count, 1));
  }
  return out;
}

std::string stroke(const Pen& pen) {
  return fmt::format(" stroke=\"{}\" stroke-width=\"{:.3g}\"{}", pen.colour, pen.width,
                     pen.dashes.empty() ? "" : fmt::format(" stroke-dasharray=\"{}\"", pen.dashes));
}

std::string corners(const std::vector<Vector2d>& points) {
  std::string out;
  for (const Vector2d& p : points)
    out += fmt::format("{}{:.1f},{:.1f}", out.empty() ? "" : " ", p.x(), p.y());
  return out;
}

/// Viewers reckon in 32 bits: what is far outside is left out.
bool drawable(const std::vector<Vector2d>& points) {
  return all_of(points,
                [](const Vector2d& p) { return p.allFinite() && p.cwiseAbs().maxCoeff() < 1e6; });
}

bool is_free(const Box& box, const std::vector<Box>& of) {
  return !any_of(of, [&](const Box& each) { return each.meets(box); });
}

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

std::string markup_text(const std::string& text) {
  std::string out;
  for (const std::string& c : characters(text)) {
    const auto first = static_cast<unsigned char>(c.front());
    if (c == "<" || c == ">" || c == "&" || c == "\"" || c == "'")
      out += fmt::format("&#{};", first);
    else
      out += first < 0x20 || first == 0x7f ? std::string(" ") : c;
  }
  return out;
}

double width_of(const std::string& text, double size) {
  return kCharacter * size * static_cast<double>(characters(text).size());
}

std::string fitted(const std::string& text, double size, double width) {
  if (width_of(text, size) <= width) return text;
  const std::vector<std::string> all = characters(text);
  const double room = width / (kCharacter * size) - 1;
  std::string out;
  for (std::size_t k = 0; k < all.size() && static_cast<double>(k + 1) <= room; ++k) out += all[k];
  return out + "\xe2\x80\xa6";
}

void Canvas::line(const Vector2d& from, const Vector2d& to, const Pen& pen) {
  if (!drawable({from, to})) return;
  drawn_ += fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\"{}/>\n",
                        from.x(), from.y(), to.x(), to.y(), stroke(pen));
}

void Canvas::path(const std::vector<Vector2d>& points, const Pen& pen) {
  if (points.size() < 2 || !drawable(points)) return;
  drawn_ += fmt::format("<polyline points=\"{}\" fill=\"none\" stroke-linejoin=\"round\"{}/>\n",
                        corners(points), stroke(pen));
}

void Canvas::polygon(const std::vector<Vector2d>& points, const std::string& fill, const Pen& pen) {
  if (points.size() < 2 || !drawable(points)) return;
  drawn_ += fmt::format("<polygon points=\"{}\" fill=\"{}\" stroke-linejoin=\"round\"{}/>\n",
                        corners(points), fill.empty() ? "none" : fill, stroke(pen));
}

void Canvas::circle(const Vector2d& centre, double radius, const std::string& fill,
                    const Pen& pen) {
  if (!drawable({centre})) return;
  drawn_ += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" fill=\"{}\"{}/>\n",
                        centre.x(), centre.y(), radius, fill.empty() ? "none" : fill, stroke(pen));
}

void Canvas::hatch(const std::vector<Vector2d>& points) {
  if (points.size() < 3 || !drawable(points)) return;
  drawn_ += fmt::format("<polygon points=\"{}\" fill=\"url(#hatch)\"/>\n", corners(points));
}

void Canvas::end_clip() { drawn_ += "</g>\n"; }

void Canvas::avoid(const Vector2d& from, const Vector2d& to) {
  if (!drawable({from, to})) return;
  const int parts = std::max(1, static_cast<int>(std::min((to - from).norm() / 4, 1000.0)));
  for (int k = 0; k <= parts; ++k) {
    const Vector2d p = from + (to - from) * k / parts;
    avoided_.push_back({p.x() - 1.5, p.y() - 1.5, p.x() + 1.5, p.y() + 1.5});
  }
}

bool Canvas::text(const std::string& text, const std::vector<Spot>& places, const Box& inside,
                  const Font& font) {
  constexpr const char* kAnchors[] = {"start", "middle", "end"};
  const double width = width_of(text, font.size);
  for (const bool crossing : {false, true})
    for (const Spot& place : places) {
      const double left = place.at.x() - 0.5 * width * static_cast<int>(place.anchor);
      // Its letters reach so far above and below the line.
      const Box box{left, place.at.y() - 0.85 * font.size, left + width,
                    place.at.y() + 0.25 * font.size};
      if (!inside.holds(box) || !is_free(box, taken_)) continue;
      if (!crossing && !is_free(box, avoided_)) continue;
      taken_.push_back(box);
      texts_ += fmt::format(
          "<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{:.4g}\" text-anchor=\"{}\" "
          "fill=\"{}\">{}</text>\n",
          place.at.x(), place.at.y(), font.size, kAnchors[static_cast<int>(place.anchor)],
          font.colour, markup_text(text));
      return true;
    }
  return false;
}

std::string Canvas::svg(const std::string& title) const {
  return fmt::format(
             "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{3}<svg "
             "xmlns=\"http://www.w3.org/2000/svg\" "
             "width=\"{0:g}\" height=\"{1:g}\" viewBox=\"0 0 {0:g} {1:g}\" "
             "font-family=\"Helvetica, Arial, sans-serif\">\n<title>{2}</title>\n"
             "<rect width=\"{0:g}\" height=\"{1:g}\" fill=\"#ffffff\"/>\n",
             whole_.right, whole_.bottom, markup_text(title), kMarkup) +
         (drawn_.find("url(#hatch)") == std::string::npos ? "" : kHatch) + drawn_ +
         "<g stroke=\"#ffffff\" stroke-width=\"3\" stroke-linejoin=\"round\" "
         "paint-order=\"stroke\">\n" +
         texts_ + "</g>\n</svg>\n";
}

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
