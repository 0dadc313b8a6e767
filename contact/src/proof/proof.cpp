// Tether: proof that an exact solution lies near given impulses. SPDX-License-Identifier:
// BSD-3-Clause
#include <tether/contact/proof.hpp>

#include <cfloat>
#include <cmath>
#include <tether/contact/solver.hpp>

#include "problem/refuse.hpp"
#include "proof/regime_equations.hpp"

namespace tether::contact {
namespace detail {
namespace {

using linalg::VectorX;

Proof without_proof(int contact, const std::string& reason) {
  Proof out;
  out.radius = out.relative_radius = out.change = out.relative_change = kInfinity;
  out.contact = contact;
  out.reason = reason;
  return out;
}

double in_units(double value, int exponent) {
  return std::nextafter(std::ldexp(value, exponent), kInfinity);
}

// The largest distance of a contact of the box from the given impulses.
double distance(const ProofIsland& island, const VectorX& given, const Box& box) {
  double out = 0;
  for (int i = 0; i < island.contacts(); ++i) {
    const int unit = island.impulse[at(i)];
    Eigen::Vector3d off = Eigen::Vector3d::Zero();
    for (int r = 0; r < island.dimension; ++r) {
      const int row = island.dimension * i + r;
      const double x = std::ldexp(given[row], -unit);
      const bool same = box.radius[row] == 0 && box.x[row] == x;
      if (!same || std::ldexp(x, unit) != given[row]) off[r] = (box[row] - x).magnitude();
    }
    const double length = off.stableNorm();  // a few roundings
    if (length > 0) out = std::max(out, in_units(above(length, 8), unit));
  }
  return out;
}

// From the candidate near `start`; the radius is measured from `given`.
Proof prove_from(const Problem& problem, const VectorX& start, const VectorX& given,
                 double allowed) {
  const ProofIsland island = proof_island(problem, start);
  const Candidate candidate = polish(island);
  Proof out;
  out.regimes = candidate.regimes;
  out.reason = "the equations of its island depend on each other, or nearly so";
  out.contact = 0;
  if (const std::optional<Box> box = enclose_root(island, candidate)) {
    out.contact = first_doubt(island, candidate.regimes, *box);
    if (out.contact < 0) {
      out.status = ProofStatus::proven;
      out.reason.clear();
      out.radius = distance(island, given, *box);
      return out;
    }
    out.reason = "it is at the brink of another regime";
  }
  const NearbySolution near = nearby_solution(island, candidate);
  Eigen::Index worst = 0;
  const double largest = near.change.maxCoeff<Eigen::PropagateNaN>(&worst);
  if (!(largest <= 0))  // or no number
    out.relative_change = std::nextafter(largest / island.b.lpNorm<Eigen::Infinity>(), kInfinity);
  if (!(out.relative_change <= allowed))
    return without_proof(static_cast<int>(worst) / island.dimension,
                         "b would have to change by " + shown(out.relative_change) +
                             " of its island's largest b; allowed is " + shown(allowed));
  out.status = ProofStatus::proven_nearby;
  out.regimes = near.regimes;
  out.radius = distance(island, given, near.box);
  for (Eigen::Index r = 0; r < near.change.size(); ++r) {
    const int i = static_cast<int>(r) / island.dimension;
    out.change = std::max(out.change, in_units(near.change[r], island.velocity[at(i)]));
  }
  return out;
}

// Bounds that are no doubles show nothing.
Proof in_range(const Proof& proof) {
  const bool finite = proof.radius < kInfinity && proof.change < kInfinity;
  return finite || proof.status == ProofStatus::not_proven
             ? proof
             : without_proof(0, "the radius or the change leaves the range of doubles");
}

// From the impulses themselves: the nearest solution; else from those of a Solver.
Proof prove_island(const Problem& problem, const VectorX& given, double allowed) {
  try {
    const Proof out = in_range(prove_from(problem, given, given, allowed));
    if (out.status != ProofStatus::not_proven) return out;
    Options options;
    options.law = Law::coulomb;
    options.tolerance = 1e-13;  // near rounding, which ends the solve where it comes first
    const VectorX better = Solver(options).solve(problem, given).impulses;
    return in_range(prove_from(problem, better, given, allowed));
  } catch (const OutOfRange& e) {
    return without_proof(e.contact, e.what());
  }
}

// The weaker of two proofs decides; `contacts` are those of `part`.
void join(Proof& whole, const Proof& part, const std::vector<int>& contacts) {
  if (part.status < whole.status) {
    whole.status = part.status;
    whole.contact = contacts[at(part.contact)];
    whole.reason = part.reason;
  }
  whole.radius = std::max(whole.radius, part.radius);
  whole.change = std::max(whole.change, part.change);
  whole.relative_change = std::max(whole.relative_change, part.relative_change);
  for (std::size_t k = 0; k < part.regimes.size(); ++k)
    whole.regimes[at(contacts[k])] = part.regimes[k];
}

// Also of the program that calls: -ffast-math makes it flush subnormal numbers to zero.
bool arithmetic_is_ieee() {
  const volatile double least = std::numeric_limits<double>::min(), one = 1;
  const bool nearest = one + least == one && one - least == one;
  return std::numeric_limits<double>::is_iec559 && FLT_EVAL_METHOD == 0 && nearest && least / 2 > 0;
}

}  // namespace
}  // namespace detail

const char* name(ProofStatus status) {
  return detail::text(status, {"not_proven", "proven_nearby", "proven"});
}

Proof prove(const Problem& problem, const linalg::VectorView& impulses, double allowed) {
  using linalg::at;
  const int d = problem.dimension(), n = problem.contacts();
  if (impulses.size() != d * n)
    detail::refuse_size("impulses", impulses.size(), d * n, std::to_string(d) + " a contact");
  detail::require(allowed >= 0 && std::isfinite(allowed), "allowed", allowed,
                  "must be >= 0 and finite");
  for (int r = 0; r < d * n; ++r)
    if (!std::isfinite(impulses[r]))
      return detail::without_proof(r / d, "an impulse is " + detail::shown(impulses[r]));
  if (!detail::arithmetic_is_ieee())
    return detail::without_proof(
        -1, "the program does not round to nearest, or flushes subnormal numbers to zero");
  Proof out;
  out.status = ProofStatus::proven;
  out.regimes.resize(at(n));
  double largest = 0;
  std::vector<std::vector<int>> islands;
  for (int i = 0; i < n; ++i) {
    const std::size_t island = at(problem.islands()[at(i)]);
    if (island >= islands.size()) islands.resize(island + 1);
    islands[island].push_back(i);
    largest = std::max(largest, impulses.segment(d * i, d).stableNorm());
  }
  for (const std::vector<int>& contacts : islands) {
    linalg::VectorX given(d * static_cast<int>(contacts.size()));
    for (std::size_t k = 0; k < contacts.size(); ++k)
      given.segment(d * static_cast<int>(k), d) = impulses.segment(d * contacts[k], d);
    detail::join(out, detail::prove_island(problem.part(contacts), given, allowed), contacts);
  }
  if (out.status == ProofStatus::not_proven) out.regimes.clear();
  // At most the largest |x_i|, which has a few roundings.
  largest = std::nextafter(std::min(largest, std::numeric_limits<double>::max()), 0.0);
  out.relative_radius = out.radius > 0 ? detail::above(out.radius / largest, 8) : 0;
  return out;
}

}  // namespace tether::contact
