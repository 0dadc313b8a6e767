// Tether: Cholesky factors by the envelope, and the places that rows fill.
// SPDX-License-Identifier: BSD-3-Clause
#include "dense_rows/envelope.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>
#include <random>
#include <tether/linalg/filled.hpp>
#include <vector>

#include "support/catch.hpp"

using tether::linalg::Envelope;
using tether::linalg::FilledPlaces;

namespace {

/// A positive definite matrix whose row k is zero before firsts[k].
struct Matrix {
  std::vector<int> firsts;
  Eigen::MatrixXd G;

  Matrix(int size, std::mt19937& random) : G(size, size) {
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    Eigen::MatrixXd L = Eigen::MatrixXd::Zero(size, size);
    for (int k = 0; k < size; ++k) {
      firsts.push_back(std::uniform_int_distribution<int>(std::max(0, k - 11), k)(random));
      for (int j = firsts.back(); j < k; ++j) L(k, j) = uniform(random);
      L(k, k) = 1.5 + uniform(random);
    }
    G = L * L.transpose();
  }

  void load(Envelope* envelope) const {
    const auto size = static_cast<int>(firsts.size());
    envelope->begin();
    for (const int first : firsts) envelope->add_row(first);
    envelope->plan();
    envelope->clear();
    for (int k = 0; k < size; ++k)
      for (int j = firsts[static_cast<std::size_t>(k)]; j <= k; ++j)
        envelope->row(k)[Envelope::kStride * j] = G(k, j);
  }
};

}  // namespace

TEST_CASE("envelope: factors and solutions of every size, whatever was there before") {
  constexpr int kMost = 41;
  std::mt19937 random(5);
  Envelope envelope;
  envelope.resize(kMost);
  for (int round = 0; round < 200; ++round) {
    const int size = round < 2 * kMost ? round % kMost + 1
                                       : std::uniform_int_distribution<int>(1, kMost)(random);
    INFO("size " << size << ", round " << round);
    const Matrix matrix(size, random);
    matrix.load(&envelope);
    REQUIRE(envelope.factor());
    const Eigen::LLT<Eigen::MatrixXd> reference(matrix.G);
    for (int k = 0; k < size; ++k)
      CHECK(std::abs(envelope.diagonal(k) - reference.matrixL()(k, k)) <=
            1e-11 * reference.matrixL()(k, k));
    const Eigen::VectorXd right = Eigen::VectorXd::LinSpaced(size, -1.0, 2.0);
    std::vector<double> x(static_cast<std::size_t>(size) + 3,
                          std::numeric_limits<double>::quiet_NaN());
    std::copy(right.begin(), right.end(), x.begin());
    envelope.solve(x.data());
    const Eigen::VectorXd solution = Eigen::Map<const Eigen::VectorXd>(x.data(), size);
    CHECK((matrix.G * solution - right).norm() <=
          1e-12 * (matrix.G.norm() * solution.norm() + right.norm()));
  }
}

TEST_CASE("envelope: what is not positive definite is refused, in every row") {
  std::mt19937 random(6);
  Envelope envelope;
  envelope.resize(11);
  for (int bad = 0; bad < 11; ++bad)
    for (const double wrong : {-1.0, 0.0, std::numeric_limits<double>::quiet_NaN()}) {
      INFO("row " << bad << ", " << wrong);
      const Matrix matrix(11, random);
      matrix.load(&envelope);
      envelope.row(bad)[Envelope::kStride * bad] = wrong;
      CHECK_FALSE(envelope.factor());
    }
}

TEST_CASE("envelope: rows of which little is left are left out") {
  std::mt19937 random(6);
  for (const int size : {1, 4, 11}) {
    Envelope envelope;
    envelope.resize(size);
    for (int out = 0; out < size; ++out) {
      INFO(size << " rows, without row " << out);
      Matrix matrix(size, random);
      const Eigen::MatrixXd L = Eigen::LLT<Eigen::MatrixXd>(matrix.G).matrixL();
      matrix.G(out, out) -= L(out, out) * L(out, out) * (1.0 - 1e-9);
      matrix.load(&envelope);
      REQUIRE(envelope.factor(1e-6));
      // The same without it.
      Eigen::MatrixXd G = matrix.G;
      G.row(out).setZero();
      G.col(out).setZero();
      G(out, out) = 1.0;
      const Eigen::LLT<Eigen::MatrixXd> reference(G);
      Eigen::VectorXd right = Eigen::VectorXd::LinSpaced(size, -1.0, 2.0);
      std::vector<double> x(right.data(), right.data() + size);
      x.resize(static_cast<std::size_t>(size) + 3);
      envelope.solve(x.data());
      right[out] = 0.0;
      const Eigen::VectorXd expected = reference.solve(right);
      for (int k = 0; k < size; ++k) {
        CHECK(x[static_cast<std::size_t>(k)] ==
              Approx(expected[k]).epsilon(1e-9).margin(1e-10 * expected.norm()));
        CHECK(envelope.diagonal(k) ==
              Approx(k == out ? 0.0 : reference.matrixL()(k, k)).epsilon(1e-9));
      }
    }
  }
}

TEST_CASE("filled places: of all rows at once as of each row by itself") {
  constexpr int kRows = 7, kColumns = 30;
  FilledPlaces all, each;
  all.resize(kRows, kColumns);
  each.resize(kRows, kColumns);
  std::vector<double> c(kRows * kColumns, 0.0);
  std::mt19937 random(7);
  std::uniform_int_distribution<int> place(0, kRows * kColumns - 1);
  // From a few places to all of them; now and then a known place is zero, or holds a NaN.
  for (int round = 0; round < 120; ++round) {
    INFO("round " << round);
    for (int k = 0; k < round / 4; ++k) c[static_cast<std::size_t>(place(random))] = -0.5 - k;
    c[static_cast<std::size_t>(place(random))] = std::numeric_limits<double>::quiet_NaN();
    c[static_cast<std::size_t>(place(random))] = -0.0;
    const std::vector<double> before = c;
    all.note_all(c.data());
    CHECK(std::equal(c.begin(), c.end(), before.begin(),
                     [](double a, double b) { return a == b || (a != a && b != b); }));
    for (int i = 0; i < kRows; ++i) {
      each.note(i, c.data() + i * kColumns);
      REQUIRE(std::equal(all.begin(i), all.end(i), each.begin(i), each.end(i)));
    }
    if (round % 3 != 0) continue;
    all.clear_all(c.data());
    CHECK(std::all_of(c.begin(), c.end(), [](double entry) { return entry == 0.0; }));
  }
}
