// Tether: the fields of a scene, each named once. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fmt/format.h>
#include <tether/scene/words.hpp>

#include "dimensions.hpp"
#include "fields.hpp"

namespace tether::scene::files {

/// Read again, each gives the same bits.
std::string toml(double x);
std::string toml(bool x);
std::string toml(int x);
std::string toml(std::string_view text);
inline std::string toml(const std::string& text) { return toml(std::string_view(text)); }
inline std::string in_brackets(const std::vector<std::string>& items) {
  return "[" + list(items) + "]";
}
template <class T, std::size_t n>
std::string toml(const std::array<T, n>& row) {
  std::vector<std::string> items;
  for (const T& each : row) items.push_back(toml(each));
  return in_brackets(items);
}
inline std::string toml(const Eigen::Vector3d& v) { return toml(std::array{v.x(), v.y(), v.z()}); }
std::string toml(const Eigen::Quaterniond& q);
template <class T>
std::string toml(const std::vector<T>& all) {
  std::vector<std::string> items;
  for (const T& each : all) items.push_back(toml(each));
  return in_brackets(items);
}
template <class E>
std::string toml_word(E value) {
  return toml(word(value));
}

/// Writes tables line by line, or the inside of one in a line.
class Writer {
 public:
  enum class Layout { lines, inside };
  explicit Writer(Layout layout = Layout::lines) : layout_(layout) {}
  void table(std::string_view name) { text_ += fmt::format("\n[{}]\n", name); }
  void item(std::string_view name) { text_ += fmt::format("\n[[{}]]\n", name); }
  template <class T>
  void field(std::string_view key, const T& value, std::string_view comment = "") {
    raw(key, toml(value), comment);
  }
  /// `value` is TOML already.
  void raw(std::string_view key, const std::string& value, std::string_view comment = "");
  std::string take() { return std::move(text_); }

 private:
  Layout layout_;
  std::string text_;
};

/// The names of bodies, -1 being the world: ["a", "world"]
std::string names(const Scene& scene, const std::vector<int>& bodies);

/// One table of a scene whose fields are read from a file, written into one, or divided by units.
/// Who names a field says its key, range and unit, and what it is in all three.
class Form {
 public:
  Form(Fields& in, Reader& reader) : in_(&in), reader_(&reader) {}
  /// `scene`: whose bodies are named.
  Form(Writer& out, const Scene& scene) : out_(&out), scene_(&scene) {}
  explicit Form(const Units& units) : units_(&units) {}

  /// Null unless this is what happens.
  Fields* in() const { return in_; }
  Reader* reader() const { return reader_; }
  Writer* out() const { return out_; }
  const Scene& scene() const { return *scene_; }
  const Units* units() const { return units_; }

  void number(std::string_view key, double& x, const Range& range, const Unit& unit = {}) const {
    if (in_) x = in_->number(key, x, range, unit.words);
    put(key, x, unit);
  }
  void number(std::string_view key, double& x, const Range& range, std::string_view words) const {
    number(key, x, range, Unit{words});
  }
  void number(std::string_view key, std::optional<double>& x, const Range& range,
              const Unit& unit) const {
    if (in_ && in_->has(key)) x = 1;  // stands for what is wrong
    if (x) number(key, *x, range, unit);
  }
  void vector(std::string_view key, Eigen::Vector3d& v, const Unit& unit) const {
    if (in_) v = in_->vector(key, v, kAny, unit.words);
    put(key, v, unit);
  }
  void vector(std::string_view key, std::optional<Eigen::Vector3d>& v, const Unit& unit) const {
    if (in_ && in_->has(key)) v = Eigen::Vector3d::Zero();
    if (v) vector(key, *v, unit);
  }
  /// By the unit in its key, <stem>deg or <stem>rad, and over time with `end` = "/s".
  void angle(const std::string& stem, double& x, std::string_view end = "") const {
    if (in_) x = in_->angle(stem, x, end);
    put(stem + "rad", x, {"", 0, 0, end.empty() ? 0 : -1});
  }
  /// Along the coordinate of a joint: an angle, or a length in the unit, over time where that is.
  void along(bool angle, const std::string& key, double& x, const Unit& unit) const {
    if (angle)
      this->angle(key + "_", x, unit.time < 0 ? "/s" : "");
    else
      number(key, x, kAny, unit);
  }
  void direction(std::string_view key, Eigen::Vector3d& v) const {
    if (in_) v = in_->direction(key, v);
    put(key, v, {});
  }
  void direction(std::string_view key, std::optional<Eigen::Vector3d>& v) const {
    if (in_ && in_->has(key)) v = Eigen::Vector3d::UnitX();
    if (v) direction(key, *v);
  }
  void flag(std::string_view key, bool& x) const {
    if (in_) x = in_->flag(key, x);
    if (out_) out_->field(key, x);
  }
  void count(std::string_view key, int& x, int low, int high) const {
    if (in_) x = in_->count(key, x, low, high);
    if (out_) out_->field(key, x);
  }
  template <class E>
  void word(std::string_view key, E& x) const {
    if (in_) x = in_->word(key, x);
    if (out_) out_->raw(key, toml_word(x));
  }
  /// The name of an element of [[kind]], by which messages call it from here on.
  void name(const char* kind, std::string& name) const {
    if (in_) name = in_->name("name", in_->path());
    if (in_ && in_->has("name")) in_->rename(fmt::format("{} \"{}\"", kind, name));
    if (out_) out_->field("name", name);
  }
  void body(std::string_view key, int& body) const {
    if (in_) body = reader_->named(*in_, key, "body", reader_->bodies);
    if (out_) out_->field(key, scene_->bodies[linalg::at(body)].name);
  }
  void bodies(int& first, int& second) const {
    if (out_) out_->raw("bodies", names(*scene_, {first, second}));
    if (!in_) return;
    const std::vector<int> both =
        reader_->several_bodies(*in_, 2, 2, "two names of bodies; \"world\" is the ground");
    if (both.empty()) return;
    first = both[0];
    second = both[1];
    if (first == second) in_->wrong("bodies", "must be two different bodies");
  }
  /// At = [[x, y, z], [x, y, z]]: on the first and on the second body.
  void points(Eigen::Vector3d& first, Eigen::Vector3d& second) const {
    require("at", "the two points [[x, y, z], [x, y, z]], world, m");
    const std::vector<Eigen::Vector3d> read =
        in_ ? in_->points("at", 2, 2) : std::vector<Eigen::Vector3d>();
    if (!read.empty()) first = read[0], second = read[1];
    if (out_) out_->raw("at", toml(std::vector<Eigen::Vector3d>{first, second}), "m");
    if (units_) first /= units_->length, second /= units_->length;
  }
  /// Rows [a, b], up to `most`; written where there are some.
  void rows(std::string_view key, std::vector<std::array<double, 2>>& rows, std::size_t most,
            const Unit& a, const Unit& b) const {
    if (in_) rows = in_->pairs(key, most);
    if (out_ && !rows.empty()) out_->raw(key, toml(rows));
    for (std::array<double, 2>& row : rows)
      if (units_) row = {row[0] / units_->of(a), row[1] / units_->of(b)};
  }

  /// Says what is missing where the field is not in the file.
  void require(std::string_view key, const char* what) const {
    if (in_ && !in_->has(key)) in_->missing(key, what);
  }
  void require_one(std::string_view key, std::string_view other, const char* what) const {
    if (in_ && !in_->has(other)) require(key, what);
  }

  /// A table inside: f(its form, its values).
  template <class T, class F>
  void table(std::string_view key, std::optional<T>& values, const F& f) const {
    if (in_) {
      const Value* table = in_->table(key);
      if (table == nullptr) return;
      Fields fields = reader_->fields(table, in_->field(key));
      f(Form(fields, *reader_), values.emplace());
      fields.finish();
    } else if (values && out_) {
      Writer inside(Writer::Layout::inside);
      f(Form(inside, *scene_), *values);
      out_->raw(key, "{ " + inside.take() + " }");
    } else if (values) {
      f(*this, *values);
    }
  }
  /// The elements of [[key]], those of a list that are so: f(the form of one, its values), true
  /// where what is read is kept.
  template <class T, class F, class Is>
  void each(const char* key, std::vector<T>& all, const F& f, const Is& is) const {
    if (in_) {
      reader_->each(*in_, key, [&](Fields& fields) {
        T one;
        one.place = fields.place();
        if (f(Form(fields, *reader_), one)) all.push_back(std::move(one));
      });
      return;
    }
    for (T& one : all) {
      if (!is(one)) continue;
      if (out_) out_->item(key);
      f(*this, one);
    }
  }
  template <class T, class F>
  void each(const char* key, std::vector<T>& all, const F& f) const {
    each(key, all, f, [](const T&) { return true; });
  }

 private:
  template <class T>
  void put(std::string_view key, T& x, const Unit& unit) const {
    if (out_) out_->field(key, x, unit.words);
    if (units_) x /= units_->of(unit);
  }

  Fields* in_ = nullptr;
  Reader* reader_ = nullptr;
  Writer* out_ = nullptr;
  const Scene* scene_ = nullptr;
  const Units* units_ = nullptr;
};

}  // namespace tether::scene::files
