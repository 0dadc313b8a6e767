// Tether: a recorder whose rows go to a table of their own. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "record/formats.hpp"
#include "record/long_table.hpp"

namespace tether::scene {

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

std::unique_ptr<Recorder> make_event_recorder(const std::string& file,
                                              const formats::Beginning& run);
std::unique_ptr<Recorder> make_contact_recorder(const std::string& file,
                                                const formats::Beginning& run);

}  // namespace tether::scene
