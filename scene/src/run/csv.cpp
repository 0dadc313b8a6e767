// Tether: a run as a table. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "recorder.hpp"

namespace tether::scene {

namespace {

/// Beyond it only VTK files hold the bodies: a table of a million columns serves nobody.
constexpr std::size_t kMostBodies = 200;

class CsvRecorder : public Recorder {
 public:
  CsvRecorder(const Scene& scene, const std::string& file, double start_energy,
              const Resume& resume)
      : file_(file), start_energy_(start_energy) {
    for (std::size_t i = 0; i < scene.bodies.size(); ++i)
      if (!scene.bodies[i].fixed) moving_.push_back(i);
    all_ = moving_.size() <= kMostBodies;
    if (!all_) moving_.clear();

    const std::string kept = resume.restarted ? rows_up_to(resume.time) : "";
    make_folder_of(file);
    out_.open(file, std::ios::binary | std::ios::trunc);
    if (!out_) throw std::runtime_error("cannot write " + file);
    out_ << header(scene) << kept;
  }

  void record(const Engine& engine, const Diagnostics& d) override {
    line_.clear();
    const auto add = [&](double x) { fmt::format_to(std::back_inserter(line_), ",{}", x); };
    const auto add3 = [&](const Eigen::Vector3d& v) { add(v.x()), add(v.y()), add(v.z()); };
    fmt::format_to(std::back_inserter(line_), "{}", engine.time());
    const double energy = d.kinetic_energy + d.potential_energy;
    add(d.kinetic_energy), add(d.potential_energy), add(energy), add(energy - start_energy_);
    add3(d.momentum), add3(d.angular_momentum);
    add(d.drift), add(d.contacts), add(d.penetration), add(d.residual);
    for (const std::size_t i : moving_) {
      const BodyState& b = engine.bodies()[i];
      add3(b.position);
      add(b.orientation.w()), add3(b.orientation.vec());
      add3(b.velocity), add3(b.angular_velocity);
    }
    line_ += '\n';
    out_ << line_;
  }

  void finish(std::vector<std::string>& written, std::vector<std::string>& remarks) override {
    out_.flush();
    if (!out_) throw std::runtime_error("cannot write " + file_);
    written.push_back(file_);
    if (!all_)
      remarks.push_back(fmt::format(
          "{}: more than {} bodies, so their states are only in VTK files", file_, kMostBodies));
  }

 private:
  std::string header(const Scene& scene) const {
    std::string text =
        "time_s,kinetic_energy_J,potential_energy_J,energy_J,energy_change_J,momentum_x,momentum_y,"
        "momentum_z,angular_momentum_x,angular_momentum_y,angular_momentum_z,drift,contacts,"
        "penetration_m,residual";
    for (const std::size_t i : moving_)
      for (const char* column :
           {"x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", "vx_m_per_s", "vy_m_per_s", "vz_m_per_s",
            "wx_rad_per_s", "wy_rad_per_s", "wz_rad_per_s"})
        text += fmt::format(",{}.{}", scene.bodies[i].name, column);
    return text + '\n';
  }

  /// The rows of an earlier run, so that a run in two parts leaves the table of one.
  std::string rows_up_to(double time) const {
    std::ifstream in(file_, std::ios::binary);
    std::string kept, line;
    std::getline(in, line);  // the header
    while (std::getline(in, line) && std::strtod(line.c_str(), nullptr) <= time)
      kept += line + '\n';
    return kept;
  }

  std::string file_, line_;
  double start_energy_;
  std::vector<std::size_t> moving_;
  bool all_ = true;
  std::ofstream out_;
};

}  // namespace

void make_folder_of(const std::string& file) {
  const std::filesystem::path folder = std::filesystem::path(file).parent_path();
  if (folder.empty()) return;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error)
    throw std::runtime_error(fmt::format("cannot make {}: {}", folder.string(), error.message()));
}

std::unique_ptr<Recorder> make_csv_recorder(const Scene& scene, const std::string& file,
                                            double start_energy, const Resume& resume) {
  return std::make_unique<CsvRecorder>(scene, file, start_energy, resume);
}

}  // namespace tether::scene
