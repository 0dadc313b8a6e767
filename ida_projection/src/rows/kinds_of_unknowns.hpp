// Tether: which unknowns are free to move, and which of them are algebraic.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace tether::ida_projection {

/// Is a row one for the differential variables although it contains algebraic ones? Where their
/// part (in tolerances, squared) is nothing beside the rest, solving for them would divide by
/// nothing; what it leaves is then as small. `already`: it was so before.
inline bool loses_algebraic_part(double algebraic, double differential, bool already) {
  constexpr double kLost = 1e-3, kBack = 1e-2;
  const double share = already ? kBack : kLost;
  return algebraic <= share * share * differential;
}

/// The kinds of n unknowns, and the rows that contain unknowns of both kinds.
struct KindsOfUnknowns {
  std::vector<char> held;     ///< of each unknown: it does not move
  std::vector<int> mixed;     ///< rows whose algebraic part can be filled
  std::vector<char> without;  ///< of each row: that part is next to nothing at present

  /// `id`: n entries, 1 differential, 0 algebraic; null: none is algebraic.
  void begin(int n, int rows, const std::vector<bool>& hold, const double* id) {
    held.assign(static_cast<std::size_t>(n), 0);
    for (std::size_t j = 0; j < hold.size(); ++j) held[j] = hold[j] ? 1 : 0;
    id_.assign(id, id != nullptr ? id + n : id);
    without.assign(static_cast<std::size_t>(rows), 0);
  }
  bool any_algebraic() const { return !id_.empty(); }
  bool algebraic(int j) const { return !id_.empty() && id_[static_cast<std::size_t>(j)] == 0.0; }
  /// Looks at the mixed rows with part(row, squares): the squares of their algebraic and of their
  /// differential entries, in tolerances. Does a row belong to another block than before?
  template <class Part>
  bool changed(Part part) {
    bool other = false;
    for (const int i : mixed) {
      char& before = without[static_cast<std::size_t>(i)];
      double squares[2] = {0.0, 0.0};
      part(i, squares);
      const char now = loses_algebraic_part(squares[0], squares[1], before != 0) ? 1 : 0;
      other |= now != before;
      before = now;
    }
    return other;
  }

 private:
  std::vector<double> id_;  // empty: none algebraic
};

}  // namespace tether::ida_projection
