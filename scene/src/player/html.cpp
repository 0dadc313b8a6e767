// Tether: a run as a page that plays it in a browser. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "film.hpp"
#include "output/files.hpp"
#include "page_text.hpp"
#include "record/formats.hpp"
#include "scene_data.hpp"

namespace tether::scene {

namespace {

using namespace player;

class PageRecorder : public Recorder {
 public:
  PageRecorder(const std::string& file, const formats::Beginning& run)
      : scene_(run.scene),
        file_(file),
        start_energy_(run.start_energy),
        restarted_(run.resume.restarted),
        moving_(run.scene.moving()),
        view_(view_of(run.scene)),
        film_(moving_, view_) {
    check_writable(file);
  }

  void record(const Engine& engine, const Diagnostics& d) override {
    engine_ = engine.name();
    film_.record(engine, d);
  }

  void finish(std::vector<std::string>& written, std::vector<std::string>& remarks) override {
    film_.finish();
    if (film_.size() == 0) return;
    write_whole(file_, page());
    written.push_back(file_);
    if (restarted_) remarks.push_back(file_ + " shows the motion from the restart on");
  }

 private:
  std::string page() const {
    std::string out =
        page_head(scene_.name.empty() ? "Tether" : scene_.name, kStyle) + std::string(kBody);
    nlohmann::json data = scene_data(scene_, moving_, view_);
    data["engine"] = engine_;
    data["start_energy"] = start_energy_;
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
  double start_energy_;
  bool restarted_;
  std::vector<std::size_t> moving_;
  View view_;
  Film film_;
};

void add_page(const std::string& html, const formats::Beginning& run, formats::Recorders& out) {
  out.push_back(std::make_unique<PageRecorder>(html, run));
}

}  // namespace

namespace formats {

const Format& html_format() {
  static const Format format{"html", ".html", "Page that plays the run in a browser, on its own",
                             add_page};
  return format;
}

}  // namespace formats

}  // namespace tether::scene
