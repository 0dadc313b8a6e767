// Tether: what accuracy costs, as a page for a browser. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <tether/scene/cost.hpp>

#include "player/page_text.hpp"

namespace tether::scene {

namespace {

using namespace player;

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

std::string html_row(const CostTable& table, const CostRow& row) {
  std::string out = fmt::format("<tr><td>{}<td>{:g}", name(row.method), row.setting);
  if (!row.failure.empty())
    return out + "<td class=\"why\" colspan=\"4\">fails: " + html_text(row.failure) + "</tr>\n";
  return out + fmt::format("<td>{:.2e}<td>{:.4g}<td>{}<td>{:.1e}</tr>\n", row.error,
                           1e3 * row.seconds, row.steps,
                           table.smooth ? row.drift : row.penetration);
}

}  // namespace

std::string cost_page(const Scene& scene, const CostTable& table, std::optional<double> wanted) {
  const std::string title =
      (scene.name.empty() ? scene.file : scene.name) + ": what accuracy costs";
  nlohmann::json data;
  data["trust"] = table.reference_error > 1e-16 ? nlohmann::json(table.reference_error) : nullptr;
  data["wanted"] = wanted ? nlohmann::json(*wanted) : nullptr;
  data["methods"] = nlohmann::json::array();
  data["rows"] = nlohmann::json::array();
  std::string rows;
  for (const CostRow& row : table.rows) {
    if (data["methods"].empty() || data["methods"].back() != name(row.method))
      data["methods"].push_back(name(row.method));
    data["rows"].push_back({{"method", name(row.method)},
                            {"setting_name", setting_name(row.method)},
                            {"setting", row.setting},
                            {"error", row.error},
                            {"ms", std::max(1e3 * row.seconds, 1e-6)},
                            {"steps", row.steps},
                            {"failure", row.failure},
                            {"command", command_of(scene, table, row)}});
    rows += html_row(table, row);
  }
  return page_head(title, kCostStyle) +
         fmt::format(
             "<header><h1>{}</h1><p>Errors against {}, which may be off by {:.1e}.</p>"
             "<p id=\"legend\"></p></header>\n"
             "<svg id=\"plot\" tabindex=\"0\" role=\"img\" aria-label=\"error against time; the "
             "table below has its points\"></svg>\n"
             "<div id=\"point\"><p id=\"what\">Point at a setting, or tap it: the command that "
             "repeats it.</p><code id=\"command\" hidden></code></div>\n"
             "<div id=\"rows\"><table><thead><tr><th>method<th>setting<th>error<th>time / "
             "ms<th>steps<th>{}</tr></thead>\n<tbody>\n{}</tbody></table></div>\n",
             html_text(title), html_text(table.reference), table.reference_error,
             table.smooth ? "drift" : "depth / m", rows) +
         data_script("cost-data", data) + page_end(kCostScript);
}

}  // namespace tether::scene
