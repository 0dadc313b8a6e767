// Tether: the contacts of a run as a table, with their forces. SPDX-License-Identifier:
// BSD-3-Clause
#include <fmt/format.h>

#include "output/own_files.hpp"
#include "record/number_at.hpp"
#include "record/table_recorder.hpp"

namespace tether::scene {

namespace {

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

}  // namespace

std::unique_ptr<Recorder> make_contact_recorder(const std::string& file,
                                                const formats::Beginning& run) {
  return std::make_unique<ContactRecorder>(file, run);
}

}  // namespace tether::scene
