// Tether: a picture in SVG. SPDX-License-Identifier: BSD-3-Clause
#include "canvas.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "output/files.hpp"
#include "toml/report.hpp"

namespace tether::scene::picture {

namespace {

constexpr double kCharacter = 0.6;                 // em
constexpr double kAscent = 0.85, kDescent = 0.25;  // em

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

std::string escaped(const std::string& text) {
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

}  // namespace

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
  hatched_ = true;
  drawn_ += fmt::format("<polygon points=\"{}\" fill=\"url(#hatch)\"/>\n", corners(points));
}

void Canvas::begin_clip(const Box& box) {
  drawn_ += fmt::format(
      "<clipPath id=\"clip{0}\"><rect x=\"{1:.1f}\" y=\"{2:.1f}\" width=\"{3:.1f}\" "
      "height=\"{4:.1f}\"/></clipPath>\n<g clip-path=\"url(#clip{0})\">\n",
      clips_++, box.left, box.top, box.right - box.left, box.bottom - box.top);
}

void Canvas::end_clip() { drawn_ += "</g>\n"; }

void Canvas::begin_note(const std::string& text) {
  drawn_ += fmt::format("<g><title>{}</title>\n", escaped(text));
}

void Canvas::avoid(const Vector2d& from, const Vector2d& to) {
  constexpr double kPart = 4;
  if (!drawable({from, to})) return;
  const int parts = std::max(1, static_cast<int>(std::min((to - from).norm() / kPart, 1000.0)));
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
      const Box box{left, place.at.y() - kAscent * font.size, left + width,
                    place.at.y() + kDescent * font.size};
      if (!inside.holds(box) || !is_free(box, taken_)) continue;
      if (!crossing && !is_free(box, avoided_)) continue;
      taken_.push_back(box);
      texts_ += fmt::format(
          "<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{:.4g}\" text-anchor=\"{}\" "
          "fill=\"{}\">{}</text>\n",
          place.at.x(), place.at.y(), font.size, kAnchors[static_cast<int>(place.anchor)],
          font.colour, escaped(text));
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
             whole_.right, whole_.bottom, escaped(title), kMarkup) +
         (hatched_ ? kHatch : "") + drawn_ +
         "<g stroke=\"#ffffff\" stroke-width=\"3\" stroke-linejoin=\"round\" "
         "paint-order=\"stroke\">\n" +
         texts_ + "</g>\n</svg>\n";
}

}  // namespace tether::scene::picture
