// Tether: fast operations against SUNDIALS' own, bit for bit. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstring>
#include <limits>
#include <nvector/nvector_serial.h>
#include <random>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_band.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <tether/ida_projection/fast.hpp>

#include "host.hpp"
#include "linalg/thrown.hpp"
#include "support/catch.hpp"

using namespace tether::test;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
const double kNone = std::nan("");

/// The same bits, or both no number.
bool same(const double* a, const double* b, sunindextype n) {
  for (sunindextype i = 0; i < n; ++i)
    if (std::memcmp(a + i, b + i, sizeof(double)) != 0 && !(std::isnan(a[i]) && std::isnan(b[i])))
      return false;
  return true;
}
bool same(double a, double b) { return same(&a, &b, 1); }
bool same(N_Vector a, N_Vector b) {
  return same(N_VGetArrayPointer(a), N_VGetArrayPointer(b), N_VGetLength(a));
}

/// Pairs of vectors with the same elements, one of each with SUNDIALS' operations.
class Pairs {
 public:
  Pairs(SUNContext context, sunindextype n, bool hostile, bool fused = false) {
    std::mt19937 random(static_cast<unsigned>(n));
    N_Vector slow = N_VNew_Serial(n, context), fast = N_VNew_Serial(n, context);
    if (fused) {
      N_VEnableFusedOps_Serial(slow, 1);
      N_VEnableFusedOps_Serial(fast, 1);
    }
    tp::fast_vector(fast);
    for (int k = 0; k < kCount; ++k) {
      slow_[k] = N_VClone(slow);
      fast_[k] = N_VClone(fast);
      for (sunindextype i = 0; i < n; ++i) set(k, i, element(random, hostile));
    }
    N_VDestroy(slow);
    N_VDestroy(fast);
  }
  ~Pairs() {
    for (int k = 0; k < kCount; ++k) N_VDestroy(slow_[k]), N_VDestroy(fast_[k]);
  }
  Pairs(const Pairs&) = delete;
  Pairs& operator=(const Pairs&) = delete;

  void set(int k, sunindextype i, double value) {
    N_VGetArrayPointer(slow_[k])[i] = N_VGetArrayPointer(fast_[k])[i] = value;
  }
  N_Vector* slow() { return slow_; }
  N_Vector* fast() { return fast_; }
  bool same_all() const {
    for (int k = 0; k < kCount; ++k)
      if (!same(slow_[k], fast_[k])) return false;
    return true;
  }

  static constexpr int kCount = 8;

 private:
  static double element(std::mt19937& random, bool hostile) {
    static const double odd[] = {0.0, -0.0, kInfinity, -kInfinity, kNone, 5e-324, 1e308, -1e-310};
    std::normal_distribution<double> normal;
    const double value = normal(random) * std::pow(10.0, static_cast<int>(random() % 9) - 4);
    return hostile && random() % 3 == 0 ? odd[random() % 8] : value;
  }
  N_Vector slow_[kCount], fast_[kCount];
};

/// `act` on either side of every length up to 40 and of a long one; all vectors and what it
/// returns must agree.
template <class Act>
void agree(Act act, bool fused = false) {
  Context context;
  for (int n = 1; n <= 41; ++n) {
    const sunindextype length = n <= 40 ? n : 1003;
    for (const bool hostile : {false, true}) {
      INFO("length " << length << (hostile ? ", hostile" : ""));
      Pairs pairs(context, length, hostile, fused);
      const double slow = act(pairs.slow()), fast = act(pairs.fast());
      CHECK(same(slow, fast));
      CHECK(pairs.same_all());
    }
  }
}

const double kFactors[] = {0.0, 1.0, -1.0, 0.3, -0.3, 1e-160, kNone};

}  // namespace

TEST_CASE("Fast linear sums have SUNDIALS' bits for every pair of factors, also in place") {
  for (const double a : kFactors)
    for (const double b : kFactors) {
      INFO("a = " << a << ", b = " << b);
      agree([&](N_Vector* v) {
        N_VLinearSum(a, v[0], b, v[1], v[2]);
        N_VLinearSum(a, v[3], b, v[4], v[3]);
        N_VLinearSum(a, v[5], b, v[6], v[6]);
        N_VLinearSum(a, v[7], b, v[7], v[7]);
        return 0.0;
      });
    }
}

TEST_CASE("Fast operations on elements have SUNDIALS' bits") {
  for (const double c : kFactors)
    agree([&](N_Vector* v) {
      N_VScale(c, v[0], v[1]);
      N_VScale(c, v[2], v[2]);
      N_VConst(c, v[3]);
      N_VAddConst(v[4], c, v[5]);
      return 0.0;
    });
  agree([](N_Vector* v) {
    N_VProd(v[0], v[1], v[2]);
    N_VDiv(v[0], v[1], v[3]);
    N_VAbs(v[4], v[4]);
    N_VInv(v[5], v[6]);
    return 0.0;
  });
}

TEST_CASE("Fast norms, products and minima have SUNDIALS' bits") {
  agree([](N_Vector* v) { return N_VDotProd(v[0], v[1]); });
  agree([](N_Vector* v) { return N_VWrmsNorm(v[0], v[1]); });
  agree([](N_Vector* v) { return N_VWrmsNormMask(v[0], v[1], v[2]); });
  agree([](N_Vector* v) { return N_VWL2Norm(v[0], v[1]); });
  agree([](N_Vector* v) { return N_VMin(v[0]); });
}

TEST_CASE("Fast combinations have the bits of SUNDIALS, with its fused operations off and on") {
  for (const bool fused : {false, true})
    for (int count = 1; count <= 6; ++count)
      for (const double first : {1.0, 0.7}) {
        INFO("count " << count << ", first " << first << (fused ? ", fused" : ""));
        sunrealtype c[] = {first, 0.7, -1.0, 1.0, 3e-7, 0.0};
        agree(
            [&](N_Vector* v) {
              N_VLinearCombination(count, c, v, v[7]);
              N_VLinearCombination(count, c, v, v[0]);
              return 0.0;
            },
            fused);
      }
}

TEST_CASE("Fast operations on arrays of vectors have SUNDIALS' bits") {
  for (const bool fused : {false, true})
    for (const double a : {1.0, -1.0, 0.3})
      for (const double b : {1.0, -0.3, 0.3}) {
        sunrealtype c[] = {a, b, 2.0};
        agree(
            [&](N_Vector* v) {
              N_VLinearSumVectorArray(3, a, v, b, v + 3, v);
              N_VLinearSumVectorArray(2, a, v, b, v + 1, v + 5);
              N_VScaleVectorArray(3, c, v, v);
              N_VScaleVectorArray(3, c, v + 1, v + 4);
              return 0.0;
            },
            fused);
      }
}

TEST_CASE("A fast vector stays a serial one, and its clones are fast") {
  Context context;
  N_Vector y = N_VNew_Serial(5, context), plain = N_VNew_Serial(5, context);
  CHECK(tp::fast_vector(y) == y);
  tp::fast_vector(y);  // twice does no harm
  N_Vector clone = N_VClone(y);
  CHECK(N_VGetVectorID(clone) == SUNDIALS_NVEC_SERIAL);
  CHECK(N_VGetLength(clone) == 5);
  CHECK(N_VGetArrayPointer(clone) == NV_DATA_S(clone));
  CHECK(clone->ops->nvlinearsum == y->ops->nvlinearsum);
  CHECK(clone->ops->nvlinearsum != plain->ops->nvlinearsum);
  for (N_Vector v : {y, plain, clone}) N_VDestroy(v);
}

TEST_CASE("The fast dense solver has the pivots, factors and solutions of SUNLinSol_Dense") {
  Context context;
  for (int n = 1; n <= tp::kLargestFastDense; ++n) {
    INFO("n = " << n);
    N_Vector b = N_VNew_Serial(n, context), x = N_VClone(b), expected = N_VClone(b);
    SUNMatrix A = SUNDenseMatrix(n, n, context), B = SUNDenseMatrix(n, n, context);
    std::mt19937 random(static_cast<unsigned>(n));
    std::normal_distribution<double> normal;
    SUNLinearSolver fast = tp::fast_dense_solver(b, A), own = SUNLinSol_Dense(b, B, context);
    CHECK(SUNLinSolGetType(fast) == SUNLINEARSOLVER_DIRECT);
    CHECK(SUNLinSolInitialize(fast) == 0);
    for (const bool singular : {false, true, false}) {
      for (int k = 0; k < n * n; ++k) SM_DATA_D(A)
      [k] = SM_DATA_D(B)[k] =
          random() % 4 == 0 && k % (n + 1) ? 0.0 : std::exp(9.0 * normal(random));
      for (int i = 0; i < n; ++i) NV_DATA_S(b)[i] = normal(random);
      if (singular)
        for (int i = 0; i < n; ++i) SM_ELEMENT_D(A, i, n - 1) = SM_ELEMENT_D(B, i, n - 1) = 0.0;
      CHECK(SUNLinSolSetup(fast, A) == SUNLinSolSetup(own, B));
      CHECK(SUNLinSolLastFlag(fast) == SUNLinSolLastFlag(own));
      CHECK(same(SM_DATA_D(A), SM_DATA_D(B), n * n));
      if (singular) continue;
      CHECK(SUNLinSolSolve(fast, A, x, b, 0.0) == 0);
      CHECK(SUNLinSolSolve(own, B, expected, b, 0.0) == 0);
      CHECK(same(x, expected));
      CHECK(SUNLinSolSolve(fast, A, b, b, 0.0) == 0);
      CHECK(same(b, expected));
    }
    SUNLinSolFree(fast);
    SUNLinSolFree(own);
    SUNMatDestroy(A);
    SUNMatDestroy(B);
    for (N_Vector v : {b, x, expected}) N_VDestroy(v);
  }
}

TEST_CASE("What cannot be made fast is refused by name") {
  Context context;
  N_Vector y = N_VNew_Serial(4, context), long_y = N_VNew_Serial(65, context);
  N_Vector custom = N_VNewEmpty(context);
  SUNMatrix A = SUNDenseMatrix(4, 4, context), wide = SUNDenseMatrix(4, 5, context);
  SUNMatrix large = SUNDenseMatrix(65, 65, context), other = SUNDenseMatrix(3, 3, context);
  SUNMatrix band = SUNBandMatrix(4, 1, 1, context);
  CHECK(contains(thrown([&] { tp::fast_vector(nullptr); }), "fast_vector: y is null"));
  CHECK(contains(thrown([&] { tp::fast_vector(custom); }), "not a serial vector"));
  const auto operation = y->ops->nvlinearsum;
  CHECK(contains(thrown([&] { tp::fast_vector(y, nullptr); }), "fast_vector: yp is null"));
  CHECK(contains(thrown([&] { tp::fast_vector(nullptr, y); }), "fast_vector: y is null"));
  CHECK(y->ops->nvlinearsum == operation);
  const auto solver = [](N_Vector v, SUNMatrix M) {
    return thrown([&] { tp::fast_dense_solver(v, M); });
  };
  CHECK(contains(solver(nullptr, A), "fast_dense_solver: y is null"));
  CHECK(contains(solver(custom, A), "not a serial vector"));
  CHECK(contains(solver(y, nullptr), "A is null"));
  CHECK(contains(solver(y, band), "not a dense matrix"));
  CHECK(contains(solver(y, wide), "A is 4 x 5; want a square matrix"));
  CHECK(contains(solver(y, other), "A is 3 x 3, but y has 4 elements"));
  CHECK(contains(solver(long_y, large), "A is 65 x 65; want 1 to 64 rows"));
  SUNLinearSolver made = tp::fast_dense_solver(y, A);
  CHECK(SUNLinSolSetup(made, band) < 0);
  CHECK(SUNLinSolSetup(made, other) < 0);
  SUNLinSolFree(made);
  for (SUNMatrix M : {A, wide, large, other, band}) SUNMatDestroy(M);
  for (N_Vector v : {y, long_y}) N_VDestroy(v);
  N_VFreeEmpty(custom);
}
