// Tether: the certificate of a run as a format. SPDX-License-Identifier: BSD-3-Clause
#include "certificate/sheet.hpp"

#include "formats.hpp"

namespace tether::scene {

namespace {

using certificate::Sheet;

class CertificateRecorder : public Recorder {
 public:
  CertificateRecorder(const std::string& file, Sheet& sheet) : sheet_(sheet) { sheet_.open(file); }

  void record(const Engine&, const Diagnostics&) override { sheet_.flush(); }
  void keep(const Engine&) override { sheet_.keep(); }
  void finish(std::vector<std::string>& written, std::vector<std::string>&) override {
    sheet_.end();
    written.push_back(sheet_.name());
  }

 private:
  Sheet& sheet_;
};

void add_certificate(const std::string& file, const formats::Beginning& run,
                     formats::Recorders& out) {
  out.push_back(std::make_unique<CertificateRecorder>(file, *run.scene.certificate));
}

}  // namespace

namespace formats {

const Format& certificate_format() {
  static const Format format{"certificate", ".cert",
                             "Certificate: all that a judge needs (tether verify)",
                             add_certificate};
  return format;
}

}  // namespace formats

}  // namespace tether::scene
