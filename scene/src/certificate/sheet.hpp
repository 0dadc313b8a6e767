// Tether: the certificate of a run as it is written. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <charconv>
#include <optional>
#include <tether/scene/scene.hpp>

#include "natural_map.hpp"
#include "output/files.hpp"

namespace tether::scene::certificate {

using Eigen::Vector3d;
using linalg::at;

/// One line: a word, then numbers, each with all its digits (docs/certificate.md).
class Line {
 public:
  Line(std::string& out, std::string_view word) : out_(out) { out_ += word; }
  ~Line() { out_ += '\n'; }
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;

  Line& operator<<(double x) { return number(x); }
  Line& operator<<(int n) { return number(n); }
  Line& operator<<(const Vector3d& v) { return *this << v.x() << v.y() << v.z(); }
  Line& operator<<(const linalg::Quaternion& q) {
    return *this << q.w() << q.x() << q.y() << q.z();
  }
  Line& operator<<(const BodyState& s) {
    return *this << s.position << s.orientation << s.velocity << s.angular_velocity;
  }
  Line& operator<<(std::string_view text);

 private:
  template <class T>
  Line& number(T x) {
    char text[32];
    out_ += ' ';
    out_.append(text, std::to_chars(text, text + sizeof text, x).ptr);
    return *this;
  }
  std::string& out_;
};

/// Friction of two bodies by the pairs of the scene and its law, in these places.
Friction friction(const Scene& scene, int first, int second, const std::vector<BodyState>& states);

/// Who has something to write that it does not know whole yet.
class Source {
 public:
  virtual ~Source() = default;
  virtual void flush() = 0;
};

/// The file. Engines write to it as they move; what they say before open() waits.
class Sheet {
 public:
  /// Bodies, pairs and rules; throws nothing.
  explicit Sheet(const Scene& scene);

  /// Throws std::runtime_error, as put() and end() do from then on.
  void open(const std::string& file) {
    file_.emplace(file, 0);
    file_->put(std::exchange(waiting_, {}));
  }
  void put(std::string_view lines) {
    lines_ += static_cast<long>(std::count(lines.begin(), lines.end(), '\n'));
    if (file_)
      file_->put(lines);
    else
      waiting_ += lines;
  }
  void keep() {
    flush();
    file_->keep();
  }
  /// Writes the last line, without which a certificate is cut.
  void end() {
    keep();
    std::string out;
    Line(out, "end") << static_cast<double>(lines_);
    put(out);
    file_->keep();
  }
  const std::string& name() const { return file_->name(); }

  /// Lets the engine write its lines so far.
  void flush() {
    if (source_ != nullptr) source_->flush();
  }
  /// An engine begins, with the joints that hold now; the one before, and its joints, are gone.
  void begin(const Scene& scene, const char* engine, Source& source);
  /// Before a source is gone.
  void leave(Source& source) {
    if (source_ == &source) source_ = nullptr;
  }

 private:
  Source* source_ = nullptr;
  std::string waiting_;
  std::optional<RowFile> file_;
  long lines_ = 0;
};

}  // namespace tether::scene::certificate
