// Tether: what accuracy costs, as a picture and as a page for a browser. SPDX-License-Identifier:
// BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <tether/scene/cost.hpp>

#include "picture/canvas.hpp"
#include "player/page_text.hpp"

namespace tether::scene {

namespace {

using namespace picture;

std::string title_of(const Scene& scene) {
  return (scene.name.empty() ? scene.file : scene.name) + ": what accuracy costs";
}

const char* option_of(CostMethod method) {
  return method == CostMethod::steps      ? "--time-steps"
         : method == CostMethod::accuracy ? "--accuracies"
                                          : "--tolerances";
}

/// One word of a command line.
std::string quoted(const std::string& word) {
  constexpr const char* kPlain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_./+-";
  const bool option = !word.empty() && word.front() == '-';
  if (!word.empty() && !option && word.find_first_not_of(kPlain) == std::string::npos) return word;
  std::string out = "'";
  for (const char c : (option ? "./" : "") + word)
    out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

std::string command_of(const Scene& scene, const CostTable& table, const CostRow& row) {
  std::string out =
      fmt::format("tether cost {} {} {}", quoted(scene.file), option_of(row.method), row.setting);
  if (table.reference_setting) out += fmt::format(" --reference {}", *table.reference_setting);
  return out;
}

constexpr double kWidth = 560, kHeight = 460;

/// Shapes tell methods apart where colours do not.
void draw_mark(Canvas& canvas, CostMethod method, const Vector2d& p) {
  constexpr double r = 4;
  const std::string colour = kColours[static_cast<std::size_t>(method)];
  const Pen edge{"#ffffff", 0.8, ""};
  if (method == CostMethod::steps)
    canvas.polygon(
        {p + Vector2d(-r, -r), p + Vector2d(r, -r), p + Vector2d(r, r), p + Vector2d(-r, r)},
        colour, edge);
  else if (method == CostMethod::accuracy)
    canvas.polygon({p + Vector2d(0, -1.3 * r), p + Vector2d(1.2 * r, r), p + Vector2d(-1.2 * r, r)},
                   colour, edge);
  else
    canvas.circle(p, r, colour, edge);
}

/// Around a point, the nearest to a reader's habit first.
std::vector<Spot> around(const Vector2d& p, double size) {
  constexpr double d = 7;
  const double below = d + 0.6 * size;
  return {{p + Vector2d(d, -d + 2), Anchor::begin},
          {p + Vector2d(d, below), Anchor::begin},
          {p + Vector2d(-d, -d + 2), Anchor::end},
          {p + Vector2d(-d, below), Anchor::end},
          {p + Vector2d(0, -d - 3), Anchor::middle},
          {p + Vector2d(0, below + 5), Anchor::middle},
          {p + Vector2d(d + 4, size / 3), Anchor::begin},
          {p + Vector2d(-d - 4, size / 3), Anchor::end}};
}

void draw_level(Canvas& canvas, const Axes& axes, const Range& x, double error,
                const std::string& text, const std::string& colour) {
  const Vector2d from = axes.at(x.low, error), to = axes.at(x.high, error);
  canvas.line(from, to, {colour, 1.2, "6 4"});
  std::vector<Spot> places;
  for (const double dy : {-4.0, 13.0})
    for (const Spot& each :
         {Spot{to + Vector2d(-4, dy), Anchor::end}, Spot{from + Vector2d(4, dy), Anchor::begin},
          Spot{(from + to) / 2 + Vector2d(0, dy), Anchor::middle}})
      places.push_back(each);
  canvas.text(text, places, axes.inside(), {11, colour});
  canvas.block({from.x(), from.y() - 1, to.x(), to.y() + 1});
}

}  // namespace

std::string cost_picture(const Scene& scene, const CostTable& table, std::optional<double> wanted) {
  const std::string title = title_of(scene);
  std::vector<double> times, errors;
  std::vector<Entry> entries;
  std::array<std::vector<const CostRow*>, 4> curves;
  for (const CostRow& row : table.rows) {
    if (!row.failure.empty()) continue;
    auto& curve = curves[static_cast<std::size_t>(row.method)];
    if (curve.empty())
      entries.push_back({fmt::format("{}: {}", name(row.method), setting_name(row.method)),
                         kColours[static_cast<std::size_t>(row.method)]});
    curve.push_back(&row);
    times.push_back(1e3 * row.seconds);
    errors.push_back(std::max(row.error, kLeastError));
  }
  if (wanted) errors.push_back(*wanted);
  const bool trust = table.reference_error > 1e-16;
  if (trust) errors.push_back(table.reference_error);

  Canvas canvas(kWidth, kHeight);
  canvas.text(fitted(title, 15, kWidth - 20), {{Vector2d(kWidth / 2, 22), Anchor::middle}},
              canvas.whole(), {15, "#202020"});
  const double top = draw_legend(canvas, entries, {16, 34, kWidth - 16, kHeight});
  const Range x = range_of(times, true), y = range_of(errors, true);
  Axes axes(canvas, {64, top + 26, kWidth - 16, kHeight - 46}, x, y);
  axes.draw("processor time / ms", "largest error / m, rad");
  for (const auto& curve : curves)
    for (const CostRow* row : curve) {
      const Vector2d p = axes.at(1e3 * row->seconds, std::max(row->error, kLeastError));
      canvas.block({p.x() - 5, p.y() - 5, p.x() + 5, p.y() + 5});
    }
  for (const auto& curve : curves) {
    if (curve.empty()) continue;
    std::vector<Vector2d> points;
    for (const CostRow* row : curve)
      points.emplace_back(1e3 * row->seconds, std::max(row->error, kLeastError));
    axes.curve(points, {kColours[static_cast<std::size_t>(curve.front()->method)], 1.6, ""});
  }
  if (wanted) draw_level(canvas, axes, x, *wanted, "wanted " + short_number(*wanted), "#b00020");
  if (trust)
    draw_level(canvas, axes, x, table.reference_error, "trust in the reference", "#707070");
  for (const auto& curve : curves)
    for (const CostRow* row : curve) {
      const Vector2d p = axes.at(1e3 * row->seconds, std::max(row->error, kLeastError));
      canvas.begin_note(command_of(scene, table, *row));
      draw_mark(canvas, row->method, p);
      canvas.end_note();
      canvas.text(short_number(row->setting), around(p, 11), axes.inside(), {11, "#404040"});
    }
  if (times.empty())
    canvas.text("no run got through", {{Vector2d(kWidth / 2, kHeight / 2), Anchor::middle}},
                canvas.whole());
  return canvas.svg(title);
}

std::string cost_page(const Scene& scene, const CostTable& table, std::optional<double> wanted) {
  std::string rows;
  for (const CostRow& row : table.rows) {
    rows += fmt::format("<tr><td>{}<td>{:g}", name(row.method), row.setting);
    rows += row.failure.empty()
                ? fmt::format("<td>{:.2e}<td>{:.4g}<td>{}<td>{:.1e}", row.error, 1e3 * row.seconds,
                              row.steps, table.smooth ? row.drift : row.penetration)
                : "<td class=\"why\" colspan=\"4\">fails: " + markup_text(row.failure);
    rows += fmt::format("<td class=\"why\"><code>{}</code></tr>\n",
                        markup_text(command_of(scene, table, row)));
  }
  const std::string picture = cost_picture(scene, table, wanted);
  return player::page_head(title_of(scene), player::kCostStyle) +
         fmt::format(
             "<p>Errors against {}, which may be off by {:.1e}.</p>\n{}<table><thead><tr>"
             "<th>method<th>setting<th>error<th>time / ms<th>steps<th>{}<th>command</tr></thead>\n"
             "<tbody>\n{}</tbody></table>\n</body>\n</html>\n",
             markup_text(table.reference), table.reference_error,
             picture.substr(picture.find("<svg")), table.smooth ? "drift" : "depth / m", rows);
}

}  // namespace tether::scene
