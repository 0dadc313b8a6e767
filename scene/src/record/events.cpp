// Tether: the events of a run as a table. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include "output/own_files.hpp"
#include "record/number_at.hpp"
#include "record/table_recorder.hpp"

namespace tether::scene {

namespace {

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

}  // namespace

std::unique_ptr<Recorder> make_event_recorder(const std::string& file,
                                              const formats::Beginning& run) {
  return std::make_unique<EventRecorder>(file, run);
}

}  // namespace tether::scene
