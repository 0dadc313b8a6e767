// Tether: pictures and tables of a comparison as text. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace tether::bench {

using Json = nlohmann::ordered_json;

/// A line of a picture; both axes are logarithmic.
struct Line {
  std::string name;  ///< by colour
  std::string form;  ///< by dashes, where there are several
  std::vector<double> x, y;
  bool points_only = false;
};

/// An SVG picture that needs nothing from outside. Names in `order` have the same colour in all.
std::string svg(const std::string& title, const std::string& x_label, const std::string& y_label,
                const std::vector<Line>& lines, const std::vector<std::string>& order = {});

/// A table; printed aligned, as HTML, and kept as strings so that all outputs agree.
struct Table {
  std::vector<std::string> head;
  std::vector<std::vector<std::string>> rows;
  std::string text() const;
  std::string html() const;
};

std::string html_escape(const std::string& text);
/// Throws std::runtime_error naming the file.
void write_file(const std::string& path, const std::string& text);
/// NaN and infinities are null.
void write_json(const std::string& path, const Json& value);

}  // namespace tether::bench
