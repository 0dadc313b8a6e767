// Tether: which columns of an unknown sparse matrix are empty. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <functional>
#include <vector>

namespace tether::ida_projection {

/// Finds the variables on which a function of n variables does not depend. Groups of variables are
/// changed together and halved if some row changes. Groups whose parents changed disjoint rows
/// share an evaluation. Variables that few rows share cost about 2 log2(n) probes altogether, n
/// variables that all rows share cost 2 n.
class ColumnSearch {
 public:
  /// Changes these variables at once and sets changed[i] to 1 for each row that changes; `changed`
  /// comes as zeros. False: the function cannot be evaluated there.
  using Probe = std::function<bool(const std::vector<int>& columns, std::vector<char>& changed)>;
  enum class Outcome { found, too_many_probes, refused };

  ColumnSearch(int columns, int rows, Probe probe, long most_probes)
      : n_(columns), m_(rows), probe_(std::move(probe)), left_(most_probes) {}

  /// `filled`: n entries, 1 if some row depends on the variable.
  Outcome run(std::vector<char>* filled);

 private:
  struct Group {
    int begin, end;
    std::vector<int> rows;  // rows that may depend on it
  };
  void take_set();
  Outcome probe_together(const std::vector<std::size_t>& members);
  Outcome probe_alone(Group& group);
  void change(const Group& group);

  int n_, m_;
  Probe probe_;
  long left_;
  std::vector<Group> groups_;
  std::vector<std::size_t> waiting_, set_, rest_;  // groups not yet probed; those of one probe
  std::vector<int> columns_;
  std::vector<char> changed_, taken_;
};

}  // namespace tether::ida_projection
