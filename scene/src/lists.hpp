// Tether: questions to whole lists. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>

namespace tether::scene {

template <class List, class Is>
bool any_of(const List& list, const Is& is) {
  return std::any_of(std::begin(list), std::end(list), is);
}
template <class List, class Is>
bool all_of(const List& list, const Is& is) {
  return std::all_of(std::begin(list), std::end(list), is);
}
template <class List, class Is>
auto count_if(const List& list, const Is& is) {
  return std::count_if(std::begin(list), std::end(list), is);
}
template <class List, class Value>
bool contains(const List& list, const Value& value) {
  return std::find(std::begin(list), std::end(list), value) != std::end(list);
}
/// In order, each once.
template <class List>
void sort_unique(List& list) {
  std::sort(std::begin(list), std::end(list));
  list.erase(std::unique(std::begin(list), std::end(list)), std::end(list));
}

}  // namespace tether::scene
