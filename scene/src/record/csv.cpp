// Tether: a run as a table. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <optional>
#include <tether/scene/plan.hpp>

#include "effects/list.hpp"
#include "output/output_names.hpp"
#include "output/own_files.hpp"
#include "output/row_file.hpp"
#include "record/number_at.hpp"
#include "recorder.hpp"

namespace tether::scene {

namespace {

/// The table has the first of them: a million columns are of no use.
constexpr std::size_t kMostBodies = 200;

class CsvRecorder : public Recorder {
 public:
  CsvRecorder(const Scene& scene, const std::string& file, double start_energy,
              const Resume& resume)
      : file_(file), start_energy_(start_energy), forces_(scene.output.forces) {
    tells_steps_ = make_plan(scene).then_steps > 0;
    for (std::size_t i = 0; i < scene.bodies.size(); ++i)
      if (!scene.bodies[i].fixed) moving_.push_back(i);
    bodies_ = moving_.size();
    moving_.resize(std::min(bodies_, kMostBodies));
    for (const effects::Effect* each : effects::all()) each->add_columns(scene, columns_);
    const std::string first = header(scene);
    const std::size_t kept = resume.restarted ? length_up_to(resume.time, first) : 0;
    out_.emplace(file, kept);
    if (kept == 0) out_->put(first);
  }

  void record(const Engine& engine, const Diagnostics& d) override {
    line_.clear();
    const auto add = [&](double x) { fmt::format_to(std::back_inserter(line_), ",{}", x); };
    const auto add3 = [&](const Eigen::Vector3d& v) { add(v.x()), add(v.y()), add(v.z()); };
    fmt::format_to(std::back_inserter(line_), "{}", engine.time());
    const double energy = d.kinetic_energy + d.potential_energy;
    add(d.kinetic_energy), add(d.potential_energy), add(energy), add(energy - start_energy_);
    add3(d.momentum), add3(d.angular_momentum);
    add(d.drift);
    if (tells_steps_) add(engine.in_steps() ? 1 : 0);
    const Forces forces = forces_ ? total_forces(engine) : Forces();
    for (const mechanics::Column& column : columns_) add(column.value(d, forces));
    for (const std::size_t i : moving_) {
      const BodyState& b = engine.bodies()[i];
      add3(b.position);
      add(b.orientation.w()), add3(b.orientation.vec());
      add3(b.velocity), add3(b.angular_velocity);
    }
    line_ += '\n';
    out_->put(line_);
  }

  void keep(const Engine&) override { out_->keep(); }

  void finish(std::vector<std::string>& written, std::vector<std::string>& remarks) override {
    out_->flush();
    written.push_back(file_);
    if (bodies_ > moving_.size())
      remarks.push_back(
          fmt::format("{} has the first {} of {} moving bodies; VTK files have all of them (--vtk)",
                      file_, moving_.size(), bodies_));
    if (lacks_rows_)
      remarks.push_back(fmt::format(
          "{} lacks rows from before the restart: it was no longer there, or cut", file_));
  }

 private:
  std::string header(const Scene& scene) const {
    std::string text = kRecordsHead;
    if (tells_steps_) text += ",in_steps";
    for (const mechanics::Column& column : columns_) text += "," + column.name;
    for (const std::size_t i : moving_)
      for (const char* column :
           {"x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", "vx_m_per_s", "vy_m_per_s", "vz_m_per_s",
            "wx_rad_per_s", "wy_rad_per_s", "wz_rad_per_s"})
        text += fmt::format(",{}.{}", scene.bodies[i].name, column);
    return text + '\n';
  }

  /// Bytes of the rows of an earlier run that are kept, so that a run in two parts leaves the table
  /// of one; 0: there is no such table.
  std::size_t length_up_to(double time, const std::string& first) {
    lacks_rows_ = true;
    if (is_device(file_)) return 0;
    std::ifstream in(file_, std::ios::binary);
    std::string line;
    if (!std::getline(in, line) || line + '\n' != first) return 0;
    std::size_t length = first.size();
    while (std::getline(in, line) && !in.eof()) {  // a row without its end is cut
      const double at = number_at(line, 0);
      if (!(at <= time)) break;
      lacks_rows_ = at != time;
      length += line.size() + 1;
    }
    return length;
  }

  std::string file_, line_;
  double start_energy_;
  bool forces_, tells_steps_ = false;
  std::vector<std::size_t> moving_;  // those in the table
  std::size_t bodies_ = 0;           // that move
  std::vector<mechanics::Column> columns_;
  bool lacks_rows_ = false;
  std::optional<RowFile> out_;
};

}  // namespace

std::unique_ptr<Recorder> make_csv_recorder(const Scene& scene, const std::string& file,
                                            double start_energy, const Resume& resume) {
  return std::make_unique<CsvRecorder>(scene, file, start_energy, resume);
}

}  // namespace tether::scene
