// Tether's engines in the comparison. SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <tether/scene.hpp>

#include "peer.hpp"

namespace {

class Tether {
 public:
  Tether(const peers::Scene& told, const std::string& setting, double value) {
    namespace scene = tether::scene;
    scene::Scene s = scene::read_scene(told.file);
    if (setting == "event") {
      s.engine = scene::EngineKind::event;
      s.event.emplace().tolerance = value;
    } else if (setting == "smooth" || setting == "smooth, energy kept") {
      s.engine = scene::EngineKind::smooth;
      s.smooth.emplace().tolerance = value;
      if (setting != "smooth") s.invariants.emplace_back();  // the energy
    } else {
      s.engine = scene::EngineKind::stepping;
      // Sub-steps may be as long as a quarter of a sample: where a body turns by more than a
      // radian, no error is seen.
      s.stepping.emplace().step = s.end / peers::kSamples / (setting == "steps" ? value : 4);
      if (setting == "sub-steps by accuracy") s.stepping->accuracy = value;
    }
    engine_ = scene::make_engine(s);
  }
  void advance(double t) { engine_->advance(t); }
  peers::Pose pose(int body) const {
    const auto& b = engine_->bodies()[static_cast<std::size_t>(body)];
    return {b.position,
            {b.orientation.w(), b.orientation.x(), b.orientation.y(), b.orientation.z()}};
  }

 private:
  std::unique_ptr<tether::scene::Engine> engine_;
};

}  // namespace

int main(int argc, char** argv) { return peers::main<Tether>(argc, argv); }
