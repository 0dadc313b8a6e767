// Tether: a page that plays a run in a browser. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <tether/scene/player.hpp>

#include "film.hpp"
#include "output/files.hpp"
#include "output/names.hpp"
#include "page_text.hpp"
#include "record/formats.hpp"
#include "scene_data.hpp"

namespace tether::scene {

namespace {

using namespace player;

std::vector<std::size_t> moving_bodies(const Scene& scene) {
  std::vector<std::size_t> out;
  for (std::size_t b = 0; b < scene.bodies.size(); ++b)
    if (!scene.bodies[b].fixed) out.push_back(b);
  return out;
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
    std::vector<std::string> others = formats::names(scene.output);
    for (const std::string& each : inputs_of(scene)) others.push_back(each);
    check_page_name(file, others);
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
  std::string page() const {
    std::string out =
        page_head(scene_.name.empty() ? "Tether" : scene_.name, kStyle) + std::string(kBody);
    nlohmann::json data = scene_data(scene_, moving_, view_);
    data["engine"] = engine_;
    data["start_energy"] = start_energy_.value_or(0);
    film_.add_to(data);
    out += data_script("film-data", data);
    const auto numbers = [&](const char* id, const std::string& base64) {
      out += fmt::format("<script id=\"{}\" type=\"text/plain\">{}</script>\n", id, base64);
    };
    numbers("film-positions", film_.positions());
    numbers("film-orientations", film_.orientations());
    numbers("film-contacts", film_.contacts());
    return out + page_end(kScript);
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
