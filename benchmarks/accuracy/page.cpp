// Tether: pictures and tables of a comparison as text. SPDX-License-Identifier: BSD-3-Clause
#include "page.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <stdexcept>

namespace tether::bench {

namespace {

// Colour-blind safe (Okabe, Ito).
constexpr std::array<const char*, 12> kColours = {"#000000", "#7f7f7f", "#d55e00", "#e69f00",
                                                  "#0072b2", "#009e73", "#cc79a7", "#56b4e9",
                                                  "#f0e442", "#8c564b", "#4b0082", "#7a9a01"};

constexpr std::array<const char*, 4> kDashes = {"", "7 3", "2 3", "7 3 2 3"};

// Position of a text in a list, at whose end it is put if it is new.
std::size_t place_of(std::vector<std::string>& list, const std::string& text) {
  const auto found = std::find(list.begin(), list.end(), text);
  if (found != list.end()) return static_cast<std::size_t>(found - list.begin());
  list.push_back(text);
  return list.size() - 1;
}

std::string stroke(const std::string& path, const char* colour, const char* dashes, double width) {
  return fmt::format(
      "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-dasharray=\"{}\"/>",
      path, colour, width, dashes);
}

constexpr double kWidth = 640, kHeight = 400, kLeft = 64, kRight = 150, kTop = 30, kBottom = 46;
constexpr double kInner = kWidth - kLeft - kRight, kTall = kHeight - kTop - kBottom;

// A logarithmic axis; its ends are powers of ten.
struct Axis {
  double low = 1e300, high = -1e300;
  void add(double value) {
    if (!(value > 0.0) || !std::isfinite(value)) return;
    low = std::min(low, std::log10(value));
    high = std::max(high, std::log10(value));
  }
  void round() {
    if (low > high) low = -1.0, high = 0.0;
    low = std::floor(low);
    high = std::max(low + 1.0, std::ceil(high));
  }
  double share(double value) const { return (std::log10(value) - low) / (high - low); }
};

class Picture {
 public:
  explicit Picture(const std::vector<Line>& lines) {
    for (const Line& line : lines) {
      for (const double x : line.x) x_.add(x);
      for (const double y : line.y) y_.add(y);
    }
    x_.round();
    y_.round();
  }

  std::string grid(bool vertical) const {
    std::string out;
    const Axis& axis = vertical ? x_ : y_;
    const int stride = axis.high - axis.low > 9.0 ? 2 : 1;
    for (int k = static_cast<int>(axis.low); k <= static_cast<int>(axis.high); k += stride) {
      const double value = std::pow(10.0, k);
      const double x1 = vertical ? px(value) : kLeft, x2 = vertical ? x1 : kLeft + kInner;
      const double y1 = vertical ? kTop : py(value), y2 = vertical ? kTop + kTall : y1;
      out += fmt::format(
          "<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"#ddd\"/><text x=\"{:.1f}\" "
          "y=\"{:.1f}\" text-anchor=\"{}\">1e{}</text>\n",
          x1, y1, x2, y2, vertical ? x1 : kLeft - 6, vertical ? kTop + kTall + 16 : y1 + 4,
          vertical ? "middle" : "end", k);
    }
    return out;
  }

  std::string curve(const Line& line, const char* colour, const char* dashes) const {
    std::string out = fmt::format("<g fill=\"{}\"><title>{}, {}</title>", colour,
                                  html_escape(line.name), html_escape(line.form));
    std::string path;
    for (std::size_t i = 0; i < line.x.size(); ++i) {
      if (!(line.x[i] > 0.0) || !(line.y[i] > 0.0)) continue;
      const double x = px(line.x[i]), y = py(line.y[i]);
      path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x, y);
      out += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\"/>", x, y,
                         line.points_only ? 1.6 : 2.6);
    }
    if (!line.points_only) out += stroke(path, colour, dashes, 1.2);
    return out + "</g>\n";
  }

 private:
  double px(double x) const { return kLeft + kInner * x_.share(x); }
  double py(double y) const { return kTop + kTall * (1.0 - y_.share(y)); }
  Axis x_, y_;
};

}  // namespace

std::string svg(const std::string& title, const std::string& x_label, const std::string& y_label,
                const std::vector<Line>& lines, const std::vector<std::string>& order) {
  const Picture picture(lines);
  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" "
      "font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" "
      "fill=\"white\"/>\n<text x=\"{2}\" y=\"18\" font-size=\"14\">{3}</text>\n",
      kWidth, kHeight, kLeft, html_escape(title));
  out += picture.grid(true) + picture.grid(false);
  out += fmt::format(
      "<text x=\"{:.0f}\" y=\"{:.0f}\" text-anchor=\"middle\">{}</text><text "
      "text-anchor=\"middle\" transform=\"translate(16 {:.0f}) rotate(-90)\">{}</text>\n",
      kLeft + kInner / 2, kHeight - 8, html_escape(x_label), kTop + kTall / 2,
      html_escape(y_label));

  std::vector<std::string> names = order, forms;
  for (const Line& line : lines)
    out += picture.curve(line, kColours[place_of(names, line.name) % kColours.size()],
                         kDashes[place_of(forms, line.form) % kDashes.size()]);
  double row = kTop + 12;
  const auto legend = [&](const std::string& name, const char* colour, const char* dashes,
                          double width) {
    out +=
        stroke(fmt::format("M{:.0f} {:.0f}h18", kLeft + kInner + 8, row), colour, dashes, width) +
        fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\">{}</text>\n", kLeft + kInner + 32, row + 4,
                    html_escape(name));
    row += 18;
  };
  for (std::size_t k = 0; k < names.size(); ++k)
    if (std::any_of(lines.begin(), lines.end(), [&](const Line& l) { return l.name == names[k]; }))
      legend(names[k], kColours[k % kColours.size()], "", 4);
  for (std::size_t k = 0; forms.size() > 1 && k < forms.size(); ++k)
    legend(forms[k], kColours[0], kDashes[k % kDashes.size()], 1.2);
  return out + "</svg>\n";
}

std::string Table::text() const {
  std::vector<std::size_t> width(head.size(), 0);
  const auto widen = [&](const std::vector<std::string>& row) {
    for (std::size_t k = 0; k < row.size() && k < width.size(); ++k)
      width[k] = std::max(width[k], row[k].size());
  };
  widen(head);
  for (const auto& row : rows) widen(row);
  std::string out;
  const auto line = [&](const std::vector<std::string>& row) {
    std::string one;
    for (std::size_t k = 0; k < row.size(); ++k) {
      const bool sentence = k + 1 == row.size() && head[k] == "status";
      one += k == 0     ? fmt::format("{:<{}}", row[k], width[k])
             : sentence ? "  " + row[k]
                        : fmt::format("  {:>{}}", row[k], width[k]);
    }
    out += one + "\n";
  };
  line(head);
  for (const auto& row : rows) line(row);
  return out;
}

std::string Table::html() const {
  std::string out = "<table><tr>";
  for (const std::string& cell : head) out += "<th>" + html_escape(cell) + "</th>";
  out += "</tr>\n";
  for (const auto& row : rows) {
    out += "<tr>";
    for (const std::string& cell : row) out += "<td>" + html_escape(cell) + "</td>";
    out += "</tr>\n";
  }
  return out + "</table>\n";
}

std::string html_escape(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else
      out += c;
  }
  return out;
}

void write_file(const std::string& path, const std::string& text) {
  std::ofstream file(path);
  file << text;
  file.flush();
  if (!file) throw std::runtime_error("cannot write " + path);
}

void write_json(const std::string& path, const Json& value) {
  write_file(path, value.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace tether::bench
