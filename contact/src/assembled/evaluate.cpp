// Tether: residuals of any answer (method, eq. 14). SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/evaluate.hpp>

#include <algorithm>

#include "assembled/search/system.hpp"

namespace tether::contact {

Residuals evaluate(const Problem& problem, Law law, const linalg::VectorView& impulses) {
  const detail::Packed x = problem.pack(impulses);
  detail::Packed own = x;                // in the units of the system
  if (!impulses.allFinite()) return {};  // nothing can be said of it
  detail::Packed w(x.size()), scratch(x.size());
  detail::System system;
  system.reset(problem, law);
  system.to_own_units(own.data());
  detail::velocities(problem, x.data(), w.data());
  Residuals r;
  r.fixed_point = system.judged_fixed_point(own.data());
  r.natural_map = system.natural_map(own.data(), scratch.data());
  r.signorini = r.cone = r.alignment = r.dissipation = r.energy_change = 0;
  for (int i = 0; i < problem.contacts(); ++i) {
    const LocalBlock& L = problem.local(i);
    const double* xi = x[static_cast<std::size_t>(i)].v;
    const double* wi = w[static_cast<std::size_t>(i)].v;
    const double* bi = problem.packed_b()[static_cast<std::size_t>(i)].v;
    const double mu = system.friction(i), t = std::hypot(xi[1], xi[2]);
    r.signorini = std::max(r.signorini, std::abs(std::min(L.a * xi[0], wi[0])));
    r.cone = std::max({r.cone, L.a * (t - mu * xi[0]), -L.a * xi[0]});
    for (int c = 0; c < 3; ++c) {
      r.dissipation += xi[c] * wi[c];
      r.energy_change += 0.5 * xi[c] * (wi[c] - bi[c]);
    }
    if (mu == 0 || !(xi[0] > 0)) continue;
    // Distance of w_t to {0} (strictly inside) or to the ray of the law (on the cone).
    double misfit = std::hypot(wi[1], wi[2]);
    if (t > 0 && t >= mu * xi[0] * (1 - 1e-9)) {
      double gamma[2];
      system.gamma(i, gamma);
      const double d0 = -(xi[1] / t + gamma[0]), d1 = -(xi[2] / t + gamma[1]);
      const double dd = d0 * d0 + d1 * d1;
      const double s = dd > 0 ? std::max(0.0, (wi[1] * d0 + wi[2] * d1) / dd) : 0;
      misfit = std::hypot(wi[1] - s * d0, wi[2] - s * d1);
    }
    r.alignment = std::max(r.alignment, misfit);
  }
  return r;
}

}  // namespace tether::contact
