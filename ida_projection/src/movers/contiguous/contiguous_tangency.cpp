// Tether: how far y' points out of the constraints, on contiguous vectors.
// SPDX-License-Identifier: BSD-3-Clause
#include "contiguous_mover.hpp"

#include <algorithm>
#include <cmath>

namespace tether::ida_projection {

template <class Rows>
bool ContiguousMover<Rows>::tangency(const std::vector<double>& yp, const double* id,
                                     Tangency& out) {
  // C of an earlier candidate says nothing about y' here.
  if (!rows_.blocks.structured() || !rows_.factors.there || kept_.age > 0) return false;
  const auto rows = static_cast<std::size_t>(rows_.reported());
  const double* w = rows_.at.w;
  out.rate.resize(rows);
  out.terms.resize(rows);
  out.tolerance.resize(rows);
  out.size.resize(rows);
  for (std::size_t i = 0; i < rows; ++i) {
    double rate = 0.0, terms = 0.0, square = 0.0, size = 0.0;
    bool algebraic = false;
    rows_.blocks.visit_row(static_cast<int>(i), [&](int j, double c) {
      const auto k = static_cast<std::size_t>(j);
      const bool differential = id == nullptr || id[j] != 0.0;
      algebraic = algebraic || (c != 0.0 && !differential);
      rate += c * yp[k];
      terms += std::abs(c * yp[k]);
      if (differential) size += std::abs(c) * std::max(1.0, std::abs(rows_.at.y[k]));
      const double moved = w[k] > 0.0 ? c / w[k] : 0.0;
      square += moved * moved;
    });
    out.rate[i] = rate;
    out.size[i] = size;
    out.terms[i] = algebraic ? -1.0 : terms;
    out.tolerance[i] = std::sqrt(square);
  }
  return true;
}

template bool ContiguousMover<DenseRows>::tangency(const std::vector<double>&, const double*,
                                                   Tangency&);
template bool ContiguousMover<SparseRows>::tangency(const std::vector<double>&, const double*,
                                                    Tangency&);
}  // namespace tether::ida_projection
