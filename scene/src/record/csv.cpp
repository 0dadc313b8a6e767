// Tether: a run as a table. SPDX-License-Identifier: BSD-3-Clause

#include <filesystem>
#include <fstream>
#include <iterator>

#include "bounds.hpp"
#include "effects/list.hpp"
#include "formats.hpp"
#include "output/files.hpp"

namespace tether::scene {

namespace {

/// Rows that begin with their time. Throws std::runtime_error where the file cannot be written.
class LongTable {
 public:
  /// `keep(row)`: whether a row of an earlier run of the same head stays; the first one that does
  /// not ends them.
  template <class Keep>
  LongTable(const std::string& file, const std::string& head, bool restarted, Keep keep) {
    std::size_t kept = 0;
    std::string line;
    std::ifstream in;
    if (restarted && !is_device(file)) in.open(file, std::ios::binary);
    if (in.is_open() && std::getline(in, line) && line + '\n' == head) {
      kept = head.size();
      while (std::getline(in, line) && !in.eof() && keep(line)) kept += line.size() + 1;
    }
    rows_ = std::make_unique<RowFile>(file, kept);
    if (kept == 0) put(head);
  }

  void put(const std::string& rows) { rows_->put(rows); }
  void flush() { rows_->flush(); }
  void keep() { rows_->keep(); }
  const std::string& file() const { return rows_->name(); }

 private:
  std::unique_ptr<RowFile> rows_;
};

class TableRecorder : public Recorder {
 public:
  void keep(const Engine&) override { table_.keep(); }
  void finish(std::vector<std::string>& written, std::vector<std::string>&) override {
    table_.flush();
    written.push_back(table_.file());
  }

 protected:
  TableRecorder(const Scene& scene, LongTable table) : table_(std::move(table)), scene_(scene) {}
  /// Its name; empty: none.
  std::string body(int index) const {
    return index < 0 ? std::string() : scene_.bodies[static_cast<std::size_t>(index)].name;
  }
  std::string joint(int index) const {
    return index < 0 ? std::string() : scene_.joints[static_cast<std::size_t>(index)].name;
  }

  LongTable table_;

 private:
  const Scene& scene_;
};

/// One row for each contact of each record.
class ContactRecorder : public TableRecorder {
 public:
  ContactRecorder(const std::string& file, const formats::Beginning& run)
      : TableRecorder(run.scene, LongTable(file, kContactsHead, run.resume.restarted,
                                           [time = run.resume.time](const std::string& row) {
                                             return number_at(row, 0) <= time;
                                           })) {}

  void record(const Engine& engine, const Diagnostics&) override {
    std::string rows;
    const auto add3 = [&](const Eigen::Vector3d& v) {
      rows += fmt::format(",{},{},{}", v.x(), v.y(), v.z());
    };
    for (const ContactState& c : engine.contacts()) {
      rows += fmt::format("{},{},{}", engine.time(), body(c.first), body(c.second));
      add3(c.point), add3(c.normal);
      rows += fmt::format(",{},{}", c.gap, c.normal.dot(c.force));
      add3(c.force), add3(c.slip);
      rows += '\n';
    }
    table_.put(rows);
  }
};

class EventRecorder : public TableRecorder {
 public:
  // Rows of events that were found before the state was saved stay. A `rest` lies ahead of when it
  // was found.
  EventRecorder(const std::string& file, const formats::Beginning& run)
      : TableRecorder(
            run.scene,
            LongTable(file, kEventsHead, run.resume.restarted,
                      [now = run.now, left = run.resume.events](const std::string& row) mutable {
                        const bool before =
                            !(number_at(row, 0) > now) || row.find(",rest,") != std::string::npos;
                        return before && left-- > 0;
                      })) {}

  void record(const Engine& engine, const Diagnostics&) override { put_found(engine); }
  void keep(const Engine& engine) override {
    put_found(engine);
    TableRecorder::keep(engine);
  }

 private:
  void put_found(const Engine& engine) {
    const std::vector<ContactEvent>& all = engine.events();
    for (; next_ < all.size(); ++next_) {
      const ContactEvent& e = all[next_];
      table_.put(fmt::format("{},{},{},{},{},{},{},{},{},{},{}\n", e.time, name(e.kind),
                             body(e.first), body(e.second), e.before, e.after, e.lost,
                             e.impulse.x(), e.impulse.y(), e.impulse.z(), joint(e.joint)));
    }
  }

  std::size_t next_ = 0;
};

/// The table has the first of them: a million columns are of no use.

class CsvRecorder : public Recorder {
 public:
  CsvRecorder(const std::string& file, const formats::Beginning& run)
      : file_(file),
        start_energy_(run.start_energy),
        forces_(run.scene.output.forces),
        has_steps_column_(run.plan.then_steps > 0) {
    const Scene& scene = run.scene;
    moving_ = scene.moving();
    bodies_ = moving_.size();
    moving_.resize(std::min(bodies_, kMostInColumns));
    for (const effects::Effect* each : effects::all()) each->add_columns(scene, columns_);
    const std::string first = header(scene);
    lacks_rows_ = run.resume.restarted;
    out_.emplace(file, first, run.resume.restarted, [&](const std::string& row) {
      const double at = number_at(row, 0);
      if (!(at <= run.resume.time)) return false;
      lacks_rows_ = at != run.resume.time;
      return true;
    });
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
    if (has_steps_column_) add(engine.in_steps() ? 1 : 0);
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
    if (has_steps_column_) text += ",in_steps";
    for (const mechanics::Column& column : columns_) text += "," + column.name;
    for (const std::size_t i : moving_)
      for (const char* column :
           {"x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", "vx_m_per_s", "vy_m_per_s", "vz_m_per_s",
            "wx_rad_per_s", "wy_rad_per_s", "wz_rad_per_s"})
        text += fmt::format(",{}.{}", scene.bodies[i].name, column);
    return text + '\n';
  }

  std::string file_, line_;
  double start_energy_;
  bool forces_, has_steps_column_;
  std::vector<std::size_t> moving_;  // those in the table
  std::size_t bodies_ = 0;           // that move
  std::vector<mechanics::Column> columns_;
  bool lacks_rows_ = false;
  std::optional<LongTable> out_;
};

std::string events_of(const std::string& csv) {
  return std::filesystem::path(csv).replace_extension(".events.csv").string();
}
std::string contacts_of(const std::string& csv) {
  return std::filesystem::path(csv).replace_extension(".contacts.csv").string();
}

void add_tables(const std::string& csv, const formats::Beginning& run, formats::Recorders& out) {
  out.push_back(std::make_unique<CsvRecorder>(csv, run));
  if (run.plan.engine == EngineKind::event)
    out.push_back(std::make_unique<EventRecorder>(events_of(csv), run));
  if (run.scene.output.forces && !run.scene.pairs.empty())
    out.push_back(std::make_unique<ContactRecorder>(contacts_of(csv), run));
}

}  // namespace

namespace formats {

const Format& csv_format() {
  static const Format format{"csv", ".csv",
                             "Table: energies, momenta, errors, states of the bodies", add_tables,
                             [](const std::string& csv, bool forces) {
                               std::vector<std::string> files = {events_of(csv)};
                               if (forces) files.push_back(contacts_of(csv));
                               return files;
                             }};
  return format;
}

}  // namespace formats

}  // namespace tether::scene
