// Tether: a run as a table. SPDX-License-Identifier: BSD-3-Clause

#include <filesystem>
#include <fstream>
#include <iterator>

#include "bounds.hpp"
#include "effects/list.hpp"
#include "formats.hpp"
#include "output/files.hpp"

namespace tether::scene::formats {

namespace {

/// Numbers and texts between commas.
template <class... Fields>
void put_fields(std::string& row, const Fields&... fields) {
  const auto put = [&](const auto& field) {
    if constexpr (std::is_same_v<std::decay_t<decltype(field)>, Eigen::Vector3d>)
      fmt::format_to(std::back_inserter(row), ",{},{},{}", field.x(), field.y(), field.z());
    else
      fmt::format_to(std::back_inserter(row), ",{}", field);
  };
  (put(fields), ...);
}

/// Rows that begin with their time. Throws std::runtime_error where the file cannot be written.
class TableRecorder : public Recorder {
 public:
  void keep(const Engine&) override { rows_->keep(); }
  void finish(std::vector<std::string>& written, std::vector<std::string>&) override {
    rows_->flush();
    written.push_back(rows_->name());
  }

 protected:
  explicit TableRecorder(const Beginning& run) : run_(run) {}

  /// `keep(row)`: whether a row of an earlier run of the same head stays; the first one that does
  /// not ends them.
  template <class Keep>
  void open(const std::string& file, const std::string& head, Keep keep) {
    std::size_t kept = 0;
    std::string line;
    std::ifstream in;
    if (run_.resume.time && !is_device(file)) in.open(file, std::ios::binary);
    if (in.is_open() && std::getline(in, line) && line + '\n' == head) {
      kept = head.size();
      while (std::getline(in, line) && !in.eof() && keep(line)) kept += line.size() + 1;
    }
    rows_.emplace(file, kept);
    if (kept == 0) rows_->put(head);
  }

  /// Its name; empty: none.
  template <class Named>
  static std::string name_in(const std::vector<Named>& all, int index) {
    return index < 0 ? std::string() : all[static_cast<std::size_t>(index)].name;
  }
  std::string body(int index) const { return name_in(run_.scene.bodies, index); }

  const Beginning run_;
  std::optional<RowFile> rows_;
};

/// One row for each contact of each record.
class ContactRecorder : public TableRecorder {
 public:
  ContactRecorder(const std::string& file, const Beginning& run) : TableRecorder(run) {
    open(file, kContactsHead,
         [&](const std::string& row) { return number_at(row, 0) <= run_.resume.time; });
  }

  void record(const Engine& engine, const Diagnostics&) override {
    std::string rows;
    for (const ContactState& c : engine.contacts()) {
      rows += fmt::format("{}", engine.time());
      put_fields(rows, body(c.first), body(c.second), c.point, c.normal, c.gap,
                 c.normal.dot(c.force), c.force, c.slip);
      rows += '\n';
    }
    rows_->put(rows);
  }
};

class EventRecorder : public TableRecorder {
 public:
  // Rows of events that were found before the state was saved stay. A `rest` lies ahead of when it
  // was found.
  EventRecorder(const std::string& file, const Beginning& run) : TableRecorder(run) {
    open(file, kEventsHead, [&, left = run.resume.events](const std::string& row) mutable {
      const bool before =
          !(number_at(row, 0) > run_.now) || row.find(",rest,") != std::string::npos;
      return before && left-- > 0;
    });
  }

  void record(const Engine& engine, const Diagnostics&) override { put_found(engine); }
  void keep(const Engine& engine) override {
    put_found(engine);
    TableRecorder::keep(engine);
  }

 private:
  void put_found(const Engine& engine) {
    for (const std::vector<ContactEvent>& all = engine.events(); next_ < all.size(); ++next_) {
      const ContactEvent& e = all[next_];
      std::string row = fmt::format("{}", e.time);
      put_fields(row, name(e.kind), body(e.first), body(e.second), e.before, e.after, e.lost,
                 e.impulse, name_in(run_.scene.joints, e.joint));
      rows_->put(row + '\n');
    }
  }

  std::size_t next_ = 0;
};

/// The table has the first bodies only: a million columns are of no use.
class CsvRecorder : public TableRecorder {
 public:
  CsvRecorder(const std::string& file, const Beginning& run)
      : TableRecorder(run), moving_(run.scene.moving()), bodies_(moving_.size()) {
    moving_.resize(std::min(bodies_, kMostInColumns));
    for (const effects::Effect* each : effects::all()) each->add_columns(run.scene, columns_);
    std::string head = kRecordsHead;
    if (run.plan.then_steps > 0) head += ",in_steps";
    for (const mechanics::Column& column : columns_) head += "," + column.name;
    for (const std::size_t i : moving_)
      for (const char* column :
           {"x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", "vx_m_per_s", "vy_m_per_s", "vz_m_per_s",
            "wx_rad_per_s", "wy_rad_per_s", "wz_rad_per_s"})
        head += fmt::format(",{}.{}", run.scene.bodies[i].name, column);
    lacks_rows_ = run.resume.time.has_value();
    open(file, head + '\n', [&](const std::string& row) {
      const double at = number_at(row, 0);
      if (!(at <= run.resume.time)) return false;
      lacks_rows_ = at != run.resume.time;
      return true;
    });
  }

  void record(const Engine& engine, const Diagnostics& d) override {
    std::string row = fmt::format("{}", engine.time());
    const double energy = d.kinetic_energy + d.potential_energy;
    put_fields(row, d.kinetic_energy, d.potential_energy, energy, energy - run_.start_energy,
               d.momentum, d.angular_momentum, d.drift);
    if (run_.plan.then_steps > 0) put_fields(row, engine.in_steps() ? 1 : 0);
    const Forces forces = run_.scene.output.forces ? total_forces(engine) : Forces();
    for (const mechanics::Column& column : columns_) put_fields(row, column.value(d, forces));
    for (const std::size_t i : moving_) {
      const BodyState& b = engine.bodies()[i];
      const Eigen::Vector3d turn = b.orientation.vec();
      put_fields(row, b.position, b.orientation.w(), turn, b.velocity, b.angular_velocity);
    }
    rows_->put(row + '\n');
  }

  void finish(std::vector<std::string>& written, std::vector<std::string>& remarks) override {
    TableRecorder::finish(written, remarks);
    if (bodies_ > moving_.size())
      remarks.push_back(
          fmt::format("{} has the first {} of {} moving bodies; VTK files have all of them (--vtk)",
                      rows_->name(), moving_.size(), bodies_));
    if (lacks_rows_)
      remarks.push_back(fmt::format(
          "{} lacks rows from before the restart: it was no longer there, or cut", rows_->name()));
  }

 private:
  std::vector<std::size_t> moving_;  // those in the table
  std::size_t bodies_;               // that move
  std::vector<mechanics::Column> columns_;
  bool lacks_rows_ = false;
};

std::string beside(const std::string& csv, const char* ending) {
  return std::filesystem::path(csv).replace_extension(ending).string();
}

void add_tables(const std::string& csv, const Beginning& run, Recorders& out) {
  add_recorder<CsvRecorder>(csv, run, out);
  if (run.plan.engine == EngineKind::event)
    add_recorder<EventRecorder>(beside(csv, ".events.csv"), run, out);
  if (run.scene.output.forces && !run.scene.pairs.empty())
    add_recorder<ContactRecorder>(beside(csv, ".contacts.csv"), run, out);
}

std::vector<std::string> tables_beside(const std::string& csv, bool forces) {
  std::vector<std::string> files = {beside(csv, ".events.csv")};
  if (forces) files.push_back(beside(csv, ".contacts.csv"));
  return files;
}

}  // namespace

TETHER_FORMAT(csv, ".csv", "Table: energies, momenta, errors, states of the bodies", add_tables,
              tables_beside)

}  // namespace tether::scene::formats
