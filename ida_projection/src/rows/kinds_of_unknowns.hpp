// Tether: which unknowns are free to move, and which of them are algebraic.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace tether::ida_projection {

/// Whether a row is solved for differential variables although it contains algebraic ones. This is
/// so if the algebraic part (in tolerances, squared) is negligible beside the rest: solving for it
/// would divide by nearly zero. `already`: it was so before.
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
  /// Updates `without` by part(row, squares), which gives the squares of the algebraic and of the
  /// differential entries of a row, in tolerances. Returns whether a row changes its block.
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
