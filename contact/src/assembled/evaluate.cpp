// Tether: residuals of any answer (method, eq. 14). SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/evaluate.hpp>

#include "assembled/search/search.hpp"
#include "law/kernels/exact_error.hpp"

namespace tether::contact {

Residuals evaluate(const Problem& problem, Law law, const linalg::VectorView& impulses) {
  const detail::Packed x = problem.pack(impulses);
  detail::Packed own = x;                // in the units of the system
  if (!impulses.allFinite()) return {};  // nothing can be said of it
  detail::Packed w(x.size()), scratch(x.size());
  detail::System system;
  system.reset(problem, law);
  system.to_own_units(own.data());
  detail::velocities(problem, false, x.data(), w.data());
  Residuals r;
  r.fixed_point = system.judged_fixed_point(own.data());
  r.natural_map = system.natural_map(own.data(), scratch.data());
  r.signorini = r.cone = r.alignment = r.dissipation = r.energy_change = 0;
  for (int i = 0; i < problem.contacts(); ++i) {
    const std::size_t k = detail::at(i);
    double gamma[2];
    system.gamma(i, gamma);
    detail::add_residuals(problem.local(i), system.friction(i), gamma, x[k].v, w[k].v,
                          problem.packed_b()[k].v, r);
  }
  return r;
}

}  // namespace tether::contact
