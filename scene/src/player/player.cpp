// Tether: a page that plays a run in a browser. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <tether/scene/player.hpp>

#include "film.hpp"
#include "output/output_lock.hpp"
#include "output/output_names.hpp"
#include "output/whole_file.hpp"
#include "page_parts.hpp"
#include "page_text.hpp"
#include "scene_data.hpp"

namespace tether::scene {

namespace {

namespace fs = std::filesystem;

using namespace player;

std::vector<std::size_t> moving_bodies(const Scene& scene) {
  std::vector<std::size_t> out;
  for (std::size_t b = 0; b < scene.bodies.size(); ++b)
    if (!scene.bodies[b].fixed) out.push_back(b);
  return out;
}

void check_name(const Scene& scene, const std::string& file) {
  const fs::path name = fs::path(file).filename();
  if (name.empty() || name == "." || name == "..")
    throw std::invalid_argument(fmt::format("html = \"{}\": must name a file", file));
  if (is_device(file)) return;
  std::vector<std::string> others = names(scene.output);
  others.push_back(scene.file);
  for (const std::string& each : others)
    for (const char* with : {"", ".new", ".lock"})
      if (!each.empty() &&
          (one_name(each + with) == one_name(file) || one_name(file + with) == one_name(each)))
        throw std::invalid_argument(
            fmt::format("html = \"{}\": this file is an input or another output", file));
}

}  // namespace

class Player::Implementation {
 public:
  Implementation(const Scene& scene, const std::string& file)
      : scene_(scene),
        file_(file),
        moving_(moving_bodies(scene)),
        view_(view_of(scene)),
        film_(moving_, view_) {
    check_name(scene, file);
    make_folder_of(file);
    lock_.take(file);
    check_writable(file);
  }

  // Steps may be longer than the time between records: no state is shown twice.
  void record(const Engine& engine) {
    if (last_ && *last_ == engine.time()) return;
    last_ = engine.time();
    engine_ = engine.name();
    const Diagnostics d = engine.diagnostics();
    if (!start_energy_) start_energy_ = d.kinetic_energy + d.potential_energy;
    film_.record(engine, d);
  }

  void write() {
    film_.finish();
    write_whole(file_, page());
  }

 private:
  // The policy lets the page load nothing and send nothing, whatever its texts say.
  std::string page() const {
    std::string out = fmt::format(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src "
        "'unsafe-inline'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'\">\n"
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
        "<title>{}</title>\n<style>\n{}</style>\n</head>\n<body>\n{}",
        html_text(scene_.name.empty() ? "Tether" : scene_.name), kStyle, kBody);
    nlohmann::json data = scene_data(scene_, moving_, view_);
    data["engine"] = engine_;
    data["start_energy"] = start_energy_.value_or(0);
    film_.add_to(data);
    out += fmt::format("<script id=\"film-data\" type=\"application/json\">{}</script>\n",
                       script_text(data));
    const auto numbers = [&](const char* id, const std::string& base64) {
      out += fmt::format("<script id=\"{}\" type=\"text/plain\">{}</script>\n", id, base64);
    };
    numbers("film-positions", film_.positions());
    numbers("film-orientations", film_.orientations());
    numbers("film-contacts", film_.contacts());
    out += "<script>\n";
    out += kScript;
    return out + "</script>\n</body>\n</html>\n";
  }

  const Scene& scene_;
  std::string file_, engine_;
  OutputLock lock_;
  std::optional<double> last_, start_energy_;
  std::vector<std::size_t> moving_;
  View view_;
  Film film_;
};

Player::Player(const Scene& scene, const std::string& file)
    : implementation_(std::make_unique<Implementation>(scene, file)) {}
Player::~Player() = default;
void Player::record(const Engine& engine) { implementation_->record(engine); }
void Player::write() { implementation_->write(); }

}  // namespace tether::scene
