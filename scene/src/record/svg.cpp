// Tether: a run as a picture: the scene at its start and end with the paths between, its energies
// and its errors over time. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <functional>

#include "bounds.hpp"
#include "formats.hpp"
#include "output/files.hpp"
#include "output/thinned.hpp"
#include "picture/scene_drawing.hpp"

namespace tether::scene::formats {

namespace {

using namespace picture;

constexpr Box kPicture{0, 0, 860, 440}, kScenePanel{12, 36, 432, 404};
constexpr Box kEnergyPanel{506, 76, 846, 182}, kErrorPanel{506, 286, 846, 392};

struct Instant {
  double time;
  Diagnostics d;
  Poses bodies;
  std::size_t bytes() const { return sizeof(bodies[0]) * bodies.size(); }
};

/// A quantity over time.
struct Curve {
  Entry entry;
  std::vector<Vector2d> points;
};

class PictureRecorder : public Recorder {
 public:
  PictureRecorder(const std::string& file, const Beginning& run)
      : scene_(run.scene), file_(file), start_energy_(run.start_energy) {
    check_writable(file);
    bodies_ = std::min(scene_.bodies.size(), kManyBodies);
    for (const Joint& joint : scene_.joints)
      holds_.push_back(!joint.window ||
                       (joint.window->from <= run.now && run.now < joint.window->to));
  }

  void record(const Engine& engine, const Diagnostics& d) override {
    for (; events_ < engine.events().size(); ++events_)
      if (const ContactEvent& each = engine.events()[events_]; is_of_joint(each.kind))
        holds_[static_cast<std::size_t>(each.joint)] = each.kind == ContactEvent::Kind::attach;
    Instant now{engine.time(), d, {}};
    for (std::size_t b = 0; b < bodies_; ++b)
      now.bodies.push_back({engine.bodies()[b].position, engine.bodies()[b].orientation});
    instants_.add(std::move(now));
  }

  void finish(std::vector<std::string>& written, std::vector<std::string>&) override {
    instants_.finish();
    if (instants_.all().empty()) return;
    write_whole(file_, svg());
    written.push_back(file_);
  }

 private:
  std::string svg() const {
    Canvas canvas(kPicture.right, kPicture.bottom);
    const std::string title = scene_.name.empty() ? scene_.file : scene_.name;
    canvas.text(fitted(title, 15, kScenePanel.right - kScenePanel.left),
                {{Vector2d(kScenePanel.left, 22), Anchor::begin}}, kPicture, {15, "#202020"});
    std::vector<const Poses*> motion;
    for (const Instant& now : instants_.all()) motion.push_back(&now.bodies);
    Scene at_end = scene_;
    at_end.joints.clear();
    for (std::size_t j = 0; j < holds_.size(); ++j)
      if (holds_[j]) at_end.joints.push_back(scene_.joints[j]);
    draw_scene(canvas, at_end, motion, instants_.all().back().time, kScenePanel);
    draw_curves(canvas, kEnergyPanel, 34, energies(), false, "energy / J");
    draw_curves(canvas, kErrorPanel, 240, errors(), true, "");
    return canvas.svg(title);
  }

  void draw_curves(Canvas& canvas, const Box& panel, double legend,
                   const std::vector<Curve>& curves, bool logarithmic,
                   const std::string& y_title) const {
    std::vector<Entry> entries;
    std::vector<double> values;
    for (const Curve& curve : curves) {
      entries.push_back(curve.entry);
      for (const Vector2d& p : curve.points) values.push_back(p.y());
    }
    draw_legend(canvas, entries, {panel.left, legend, panel.right, panel.top}, 11);
    Range time{instants_.all().front().time, instants_.all().back().time, false};
    if (!(time.high > time.low)) time.high = time.low + 1;
    Axes axes(canvas, panel, time, range_of(values, logarithmic));
    axes.draw("t / s", y_title);
    canvas.begin_clip({panel.left, panel.top - 1, panel.right, panel.bottom + 1});
    for (const Curve& curve : curves) axes.curve(curve.points, {curve.entry.colour, 1.5, ""});
    canvas.end_clip();
  }

  /// `peaks`: the largest between two points, as errors are told; else the value itself.
  Curve curve(const char* title, const char* colour, bool peaks,
              const std::function<double(const Diagnostics&)>& value) const {
    Curve out{{title, colour}, {}};
    const std::vector<Instant>& all = instants_.all();
    const std::size_t step = 1 + all.size() / 200;
    for (std::size_t i = 0; i < all.size(); i += step) {
      double shown = value(all[i].d);
      if (peaks)
        for (std::size_t k = i; k < std::min(i + step, all.size()); ++k)
          shown = std::max(shown, value(all[k].d));
      out.points.emplace_back(all[i].time, shown);
    }
    return out;
  }

  static double energy(const Diagnostics& d) { return d.kinetic_energy + d.potential_energy; }

  std::vector<Curve> energies() const {
    return {curve("kinetic", "#0072b2", false, &Diagnostics::kinetic_energy),
            curve("potential", "#e69f00", false, &Diagnostics::potential_energy),
            curve("sum", "#202020", false, energy)};
  }

  /// Those that are not zero throughout.
  std::vector<Curve> errors() const {
    const auto change = [this](const Diagnostics& d) {
      return std::abs(energy(d) - start_energy_);
    };
    std::vector<Curve> out;
    for (Curve each : {curve("energy change / J", "#202020", true, change),
                       curve("drift", "#d55e00", true, &Diagnostics::drift),
                       curve("penetration / m", "#009e73", true, &Diagnostics::penetration),
                       curve("residual", "#cc79a7", true, &Diagnostics::residual)}) {
      double most = 0;
      for (Vector2d& p : each.points) {
        most = std::max(most, p.y());
        p.y() = std::max(p.y(), kLeastError);
      }
      if (most > kLeastError) out.push_back(std::move(each));
    }
    return out;
  }

  const Scene& scene_;
  std::string file_;
  double start_energy_;
  std::size_t bodies_ = 0, events_ = 0;  // events of the engine so far
  std::vector<bool> holds_;              // of each joint: it does at the last record
  Thinned<Instant> instants_{1024};
};

}  // namespace

TETHER_FORMAT(svg, ".svg", "Picture: the scene, its energies and errors",
              add_recorder<PictureRecorder>)

}  // namespace tether::scene::formats
