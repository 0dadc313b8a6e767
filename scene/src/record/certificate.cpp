// Tether: the certificate of a run as a format. SPDX-License-Identifier: BSD-3-Clause
#include "certificate/sheet.hpp"

#include "formats.hpp"

namespace tether::scene::formats {

namespace {

class CertificateRecorder : public Recorder {
 public:
  CertificateRecorder(const std::string& file, const Beginning& run)
      : sheet_(*run.scene.certificate) {
    sheet_.open(file);
  }

  void record(const Engine&, const Diagnostics&) override { sheet_.flush(); }
  void keep(const Engine&) override { sheet_.keep(); }
  void finish(std::vector<std::string>& written, std::vector<std::string>&) override {
    sheet_.end();
    written.push_back(sheet_.name());
  }

 private:
  certificate::Sheet& sheet_;
};

}  // namespace

TETHER_FORMAT(certificate, ".cert", "Certificate: all that a judge needs (tether verify)",
              add_recorder<CertificateRecorder>)

}  // namespace tether::scene::formats
