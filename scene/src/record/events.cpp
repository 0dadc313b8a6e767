// Tether: the events of a run as a table. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

#include "output/whole_file.hpp"
#include "record/number_at.hpp"
#include "recorder.hpp"

namespace tether::scene {

namespace {

class EventRecorder : public Recorder {
 public:
  EventRecorder(const Scene& scene, std::string file, const Resume& resume, double now)
      : scene_(scene), file_(std::move(file)) {
    const std::string head =
        "time_s,kind,first,second,normal_speed_before_m_per_s,normal_speed_after_m_per_s,"
        "energy_lost_J\n";
    const std::string kept = resume.restarted ? rows_up_to(now) : "";
    make_folder_of(file_);
    out_.open(file_, std::ios::binary | std::ios::trunc);
    out_ << head << kept;
    demand_good();
  }

  void record(const Engine& engine, const Diagnostics&) override {
    const std::vector<ContactEvent>& all = engine.events();
    for (; next_ < all.size(); ++next_) {
      const ContactEvent& e = all[next_];
      out_ << fmt::format("{},{},{},{},{},{},{}\n", e.time, name(e.kind), body(e.first),
                          body(e.second), e.before, e.after, e.lost);
    }
    demand_good();
  }
  void keep() override {
    out_.flush();
    demand_good();
  }
  void finish(std::vector<std::string>& written, std::vector<std::string>&) override {
    keep();
    written.push_back(file_);
  }

 private:
  const std::string& body(int index) const {
    return scene_.bodies[static_cast<std::size_t>(index)].name;
  }
  /// Rows of an earlier run from before its state. A `rest` lies ahead of when it was found.
  std::string rows_up_to(double now) const {
    std::ifstream in(file_, std::ios::binary);
    std::string line, kept;
    std::getline(in, line);
    while (std::getline(in, line) && !in.eof()) {
      if (number_at(line, 0) > now && line.find(",rest,") == std::string::npos) break;
      kept += line + '\n';
    }
    return kept;
  }
  void demand_good() const {
    if (!out_)
      throw std::runtime_error(fmt::format("cannot write {}: {}", file_, std::strerror(errno)));
  }

  const Scene& scene_;
  std::string file_;
  std::ofstream out_;
  std::size_t next_ = 0;
};

}  // namespace

std::unique_ptr<Recorder> make_event_recorder(const Scene& scene, const std::string& file,
                                              const Resume& resume, double now) {
  return std::make_unique<EventRecorder>(scene, file, resume, now);
}

}  // namespace tether::scene
