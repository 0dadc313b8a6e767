// Tether: a scene file with other numbers in it. SPDX-License-Identifier: BSD-3-Clause

#include <cmath>
#include <cstdlib>
#include <tether/scene/vary.hpp>

#include "read.hpp"
#include "toml/document.hpp"

namespace tether::scene::files {

namespace {

[[noreturn]] void refuse_path(const std::string& path, const std::string& why) {
  throw std::invalid_argument(fmt::format("\"{}\": {}", path, why));
}

/// Counted from 1; 0: it is no such number.
std::size_t number_of(const std::string& word, std::size_t most) {
  if (word.empty() || word.size() > 9 || word.find_first_not_of("0123456789") != std::string::npos)
    return 0;
  const auto number = static_cast<std::size_t>(std::strtoul(word.c_str(), nullptr, 10));
  return number <= most ? number : 0;
}

bool is_array_of_tables(const Value& value) {
  return value.kind() == Value::Kind::array && !value.items().empty() &&
         value.items().front().kind() == Value::Kind::table;
}

class Path {
 public:
  explicit Path(const std::string& path) : path_(path), words_(split(path, '.')) {}

  void set(Value& root, double value) const {
    if (words_.size() < 2) refuse_path(path_, "names a table only; e.g. stepping.step");
    walk(root, 0, value);
  }

 private:
  void walk(Value& value, std::size_t at, double number) const {
    if (at == words_.size()) return replace(value, number);
    const std::string& word = words_[at];
    if (is_array_of_tables(value))
      return walk_elements(std::get<Value::Items>(value.held), at, number);
    if (auto* items = std::get_if<Value::Items>(&value.held)) {
      const std::size_t component =
          word.size() == 1 && word[0] >= 'x' && word[0] <= 'z' && items->size() == 3
              ? static_cast<std::size_t>(word[0] - 'x') + 1
              : number_of(word, items->size());
      if (component == 0)
        refuse_path(path_,
                    fmt::format("\"{}\" is no component of an array of {}", word, items->size()));
      return walk((*items)[component - 1], at + 1, number);
    }
    auto* entries = std::get_if<Value::Entries>(&value.held);
    if (entries == nullptr)
      refuse_path(path_, fmt::format("nothing is inside of \"{}\"", words_[at - 1]));
    if (Entry* found = find_entry(value, word)) return walk(found->value, at + 1, number);
    const bool options = word == "smooth" || word == "stepping" || word == "event";
    if (at + 1 < words_.size() && !(at == 0 && options))
      refuse_path(path_, fmt::format("the scene has no \"{}\"", word));
    // A field, or a table of options, that has its defaults.
    Entry added;
    added.key = word;
    added.value.line = value.line;
    entries->push_back(added);
    walk(entries->back().value, at + 1, number);
  }

  // Names go before numbers: a body may be called "2".
  void walk_elements(Value::Items& all, std::size_t at, double number) const {
    const std::string& word = words_[at];
    if (word == "*") {
      for (Value& each : all) walk(each, at + 1, number);
      return;
    }
    for (Value& each : all) {
      const Entry* name = find_entry(each, "name");
      if (name != nullptr && name->value.kind() == Value::Kind::text && name->value.text() == word)
        return walk(each, at + 1, number);
    }
    if (const std::size_t k = number_of(word, all.size()); k > 0)
      return walk(all[k - 1], at + 1, number);
    if (all.size() == 1) return walk(all.front(), at, number);
    refuse_path(path_,
                fmt::format("there are {} of \"{}\", and none is called \"{}\": say which by "
                            "its name or its number, or * for all",
                            all.size(), words_[at - 1], word));
  }

  void replace(Value& value, double number) const {
    const bool empty = value.kind() == Value::Kind::table && value.entries().empty();
    if (value.kind() != Value::Kind::number && !empty) refuse_path(path_, "is not a number");
    value.held = Value::Number{number, number == std::floor(number)};
  }

  const std::string& path_;
  std::vector<std::string> words_;
};

}  // namespace

}  // namespace tether::scene::files

namespace tether::scene {

Scene parse_scene_with(std::string_view text, const std::string& name,
                       const std::vector<Setting>& settings) {
  files::Value document = files::parse_document(text, name);
  for (const Setting& each : settings) files::Path(each.path).set(document, each.value);
  return files::read(std::move(document), name);
}

}  // namespace tether::scene
