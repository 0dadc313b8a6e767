// Tether: elements of a scene that stand for many. SPDX-License-Identifier: BSD-3-Clause
#include "read.hpp"

#include <cmath>

namespace tether::scene::files {

namespace {

constexpr std::array<const char*, 4> kRepeated = {"body", "joint", "spring", "load"};
constexpr std::array<char, 3> kCounters = {'i', 'j', 'k'};
constexpr std::size_t kMostDigits = 6;  // of N in {i+N}

// In values: a long text, or a long key, is as large as several.
std::size_t size_of(const Value& value) {
  std::size_t size = 1 + value.text().size() / kBytesOfValue;
  for (const Value& each : value.items()) size += size_of(each);
  for (const Entry& each : value.entries())
    size += each.key.size() / kBytesOfValue + size_of(each.value);
  return size;
}

/// One direction of a repetition.
struct Row {
  long count = 0;
  std::array<double, 3> step{};
};

class Repetition {
 public:
  Repetition(const Entry& repeat, std::string what, const std::string& file)
      : place_{file, repeat.line, repeat.column}, what_(std::move(what)) {
    const Value& value = repeat.value;
    if (value.kind() == Value::Kind::array && !value.items().empty() &&
        value.items().size() <= kCounters.size())
      for (const Value& each : value.items()) add_row(each);
    else if (value.kind() == Value::Kind::table)
      add_row(value);
    else
      wrong(
          "must be { count = 30, step = [x, y, z] } or an array of up to three of them, for rows "
          "of rows");
    std::size_t all = 1;
    for (const Row& row : rows_) {
      all *= static_cast<std::size_t>(row.count);
      if (all > kMostListed) wrong(fmt::format("makes more than {} elements", kMostListed));
    }
    count_ = all;
  }

  std::size_t count() const { return count_; }

  /// Refuses steps that would move nothing: all copies would be at one place.
  void demand_place(Value& element) const {
    if (find_entry(element, "position") != nullptr || find_entry(element, "at") != nullptr) return;
    for (const Row& row : rows_)
      if (row.step != std::array<double, 3>{})
        wrong("has a step, which moves position or at: give one of them");
  }

  /// The last direction is the fastest.
  Value copy(const Value& element, std::size_t number) const {
    std::array<long, 3> at{};
    for (std::size_t r = rows_.size(); r-- > 0;) {
      at[r] = static_cast<long>(number % static_cast<std::size_t>(rows_[r].count));
      number /= static_cast<std::size_t>(rows_[r].count);
    }
    Value out = element;
    auto& entries = std::get<Value::Entries>(out.held);
    entries.erase(std::remove_if(entries.begin(), entries.end(),
                                 [](const Entry& each) { return each.key == "repeat"; }),
                  entries.end());
    for (const char* key : {"position", "at"})
      if (Entry* found = find_entry(out, key)) shift(found->value, at);
    Entry* entry = find_entry(out, "name");
    auto* name = entry != nullptr ? std::get_if<std::string>(&entry->value.held) : nullptr;
    if (name != nullptr && filled(*name, at) == *name) *name += suffix(at);
    fill(out, at);
    return out;
  }

  [[noreturn]] void wrong(const std::string& why) const {
    refuse(place_, fmt::format("{}: repeat {}", what_, why));
  }

 private:
  void add_row(const Value& table) {
    Row row;
    bool counted = false;
    if (table.kind() != Value::Kind::table) wrong("must be a table { count = ..., step = [...] }");
    for (const Entry& each : table.entries()) {
      const Value& v = each.value;
      if (each.key == "count") {
        counted = v.kind() == Value::Kind::number && v.whole() && v.number() >= 1 &&
                  v.number() <= static_cast<double>(kMostListed);
        if (!counted)
          wrong(fmt::format("count = {}: must be a whole number from 1 to {}", shown(v),
                            kMostListed));
        row.count = static_cast<long>(v.number());
      } else if (each.key == "step") {
        if (!is_numbers(v, 3)) wrong(fmt::format("step = {}: must be [x, y, z], m", shown(v)));
        for (std::size_t i = 0; i < 3; ++i) row.step[i] = v.items()[i].number();
      } else {
        wrong(fmt::format("has no {}; it has count and step", each.key));
      }
    }
    if (!counted) wrong("needs count, a whole number");
    rows_.push_back(row);
  }

  /// Points of the world: [x, y, z] or an array of them. What is wrong is left to the reader.
  void shift(Value& value, const std::array<long, 3>& at) const {
    auto* items = std::get_if<Value::Items>(&value.held);
    if (items == nullptr) return;
    if (!is_numbers(value, 3)) {
      for (Value& each : *items)
        if (is_numbers(each, 3)) shift(each, at);
      return;
    }
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t r = 0; r < rows_.size(); ++r)
        std::get<Value::Number>((*items)[i].held).value +=
            static_cast<double>(at[r]) * rows_[r].step[i];
  }

  std::string suffix(const std::array<long, 3>& at) const {
    std::string out;
    for (std::size_t r = 0; r < rows_.size(); ++r)
      out += fmt::format("{}{}", r == 0 ? ' ' : '.', at[r] + 1);
    return out;
  }

  /// {i}, {i+1}, {j-2}: numbers from 1 in the first, second, third direction. Other braces stay.
  std::string filled(const std::string& text, const std::array<long, 3>& at) const {
    std::string out;
    for (std::size_t k = 0; k < text.size(); ++k) {
      // A word of two letters and digits: the end of a brace is not looked for beyond it.
      const std::string_view word = std::string_view(text).substr(k + 1, kMostDigits + 3);
      const std::size_t end = text[k] == '{' ? word.find('}') : std::string_view::npos;
      const auto number =
          end == std::string_view::npos ? std::nullopt : counted(word.substr(0, end), at);
      if (!number) {
        out += text[k];
        continue;
      }
      out += fmt::format("{}", *number);
      k += 1 + end;
    }
    return out;
  }
  std::optional<long> counted(std::string_view word, const std::array<long, 3>& at) const {
    for (std::size_t r = 0; r < rows_.size(); ++r) {
      if (word.empty() || word[0] != kCounters[r]) continue;
      if (word.size() == 1) return at[r] + 1;
      const std::string digits(word.substr(2));
      const bool sign = word[1] == '+' || word[1] == '-';
      if (!sign || digits.empty() || digits.size() > kMostDigits ||
          digits.find_first_not_of("0123456789") != std::string::npos)
        return std::nullopt;
      return at[r] + 1 + (word[1] == '+' ? 1 : -1) * std::stol(digits);
    }
    return std::nullopt;
  }

  // The depth of a document is bounded.
  void fill(Value& value, const std::array<long, 3>& at) const {
    if (auto* text = std::get_if<std::string>(&value.held)) *text = filled(*text, at);
    if (auto* items = std::get_if<Value::Items>(&value.held))
      for (Value& each : *items) fill(each, at);
    if (auto* entries = std::get_if<Value::Entries>(&value.held))
      for (Entry& each : *entries) fill(each.value, at);
  }

  Place place_;
  std::string what_;
  std::vector<Row> rows_;
  std::size_t count_ = 0;
};

}  // namespace

void repeat_elements(Value& document, const std::string& file) {
  std::size_t made = 0, copied = 0;
  for (const char* kind : kRepeated) {
    Entry* entry = find_entry(document, kind);
    auto* all = entry != nullptr ? std::get_if<Value::Items>(&entry->value.held) : nullptr;
    if (all == nullptr) continue;
    Value::Items items;
    for (std::size_t k = 0; k < all->size(); ++k) {
      Value& item = (*all)[k];
      const Entry* repeat = find_entry(item, "repeat");
      if (repeat == nullptr) {
        items.push_back(std::move(item));
        continue;
      }
      const Repetition repetition(*repeat, fmt::format("{} {}", kind, k + 1), file);
      repetition.demand_place(item);
      made += repetition.count();
      copied += repetition.count() * size_of(item);
      if (made > kMostListed || copied > kMostCopied)
        repetition.wrong(
            fmt::format("makes more than {} elements of the scene, or {} numbers and "
                        "texts in them",
                        kMostListed, kMostCopied));
      for (std::size_t n = 0; n < repetition.count(); ++n)
        items.push_back(repetition.copy(item, n));
    }
    *all = std::move(items);
  }
}

}  // namespace tether::scene::files
