// Tether: problems over cones in the Siconos .dat format. SPDX-License-Identifier: BSD-3-Clause
//
// dimension (2, 3; 5: with rolling), number of contacts, a matrix; then
//   local:  q, mu (, mu_r)         w = M x + q
//   global: H, q, b, mu (, mu_r)   M v = H x + q, w = H'v + b
#include <tether/contact/files.hpp>

#include "io/dat_matrix.hpp"

namespace tether::contact {

ConeProblem read_cones_dat(const std::string& path) {
  constexpr long kMostContacts = 10'000'000;
  detail::Tokens in(path);
  const long d = in.integer("dimension", 2, 5);
  if (d == 4) in.fail("dimension is 4; 2, 3 or 5 is expected");
  const long n = in.integer("number of contacts", 0, kMostContacts);
  const detail::FileMatrix M = detail::read_matrix(in);
  const long size = d * n, coefficients = d == 5 ? 2 : 1;
  if (M.rows != M.columns)
    in.fail("the matrix is " + std::to_string(M.rows) + " x " + std::to_string(M.columns) +
            ": must be square");
  // Both begin alike; a global file has a matrix more.
  const bool local = M.rows == size && in.words_left() <= size + coefficients * n + 1;
  detail::FileMatrix H;
  if (!local) {
    H = detail::read_matrix(in);
    if (H.rows != M.rows || H.columns != size)
      in.fail("H is " + std::to_string(H.rows) + " x " + std::to_string(H.columns) + ", must be " +
              std::to_string(M.rows) + " x " + std::to_string(size));
  }
  const long words = (local ? 0 : M.rows) + size + coefficients * n;
  if (in.words_left() < words) in.fail("truncated: the file ends in its vectors");
  const auto vector = [&](const char* what, long count) {
    Eigen::VectorXd v(count);
    for (long i = 0; i < count; ++i) v[i] = in.finite(what);
    return v;
  };
  const Eigen::VectorXd q = vector("q", M.rows);
  const Eigen::VectorXd b = local ? q : vector("b", size);
  const Eigen::VectorXd mu = vector("mu", n);
  const Eigen::VectorXd rolling = d == 5 ? vector("mu_r", n) : Eigen::VectorXd();
  if (!in.empty())
    in.integer("trailing number", std::numeric_limits<int>::min(), std::numeric_limits<int>::max());
  if (!in.empty()) in.fail("oversized: data after the friction coefficients");
  std::vector<Cone> cones;
  for (long i = 0; i < n; ++i)
    cones.push_back(d == 2   ? Cone::planar(mu[i])
                    : d == 3 ? Cone::friction(mu[i])
                             : Cone::with_rolling(mu[i], rolling[i]));
  try {
    if (local) return ConeProblem::sparse(M.entries, -b, std::move(cones));
    std::vector<MatrixEntry> J = H.entries;
    for (MatrixEntry& e : J) std::swap(e.row, e.column);
    return ConeProblem::saddle(M.entries, J, q, b, std::move(cones));
  } catch (const std::invalid_argument& e) {
    in.fail(e.what());
  }
}

}  // namespace tether::contact
