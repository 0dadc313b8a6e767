// Tether: IDAS with sensitivities on a problem with parameters. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <idas/idas.h>
#include <nvector/nvector_serial.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <tether/ida_projection/sensitivities.hpp>

#include "host.hpp"

namespace tether::test {

using Complex = std::complex<double>;
constexpr double kStep = 1e-40;  // of complex-step derivatives

/// F(t, y, y', p) and rows g(y, p), both for double and Complex; y'(0), s(0), s'(0) are those
/// given.
struct Parametric {
  int size = 0, rows = 0;
  std::vector<double> p, y0, yp0, id;
  std::vector<std::vector<double>> s0, sp0;
  std::function<void(const Complex* y, const Complex* yp, const Complex* p, Complex* r)> F;
  std::function<void(const Complex* y, const Complex* p, Complex* g)> g;
};

/// The derivative of `of` (n values) along (y, y', p) + (dy, dy', dp), and its value.
template <class Of>
void along(const Of& of, int n, const std::vector<Complex>& at, double* value, double* derivative) {
  std::vector<Complex> r(static_cast<std::size_t>(n));
  of(at.data(), r.data());
  for (std::size_t i = 0; i < r.size(); ++i) {
    if (value != nullptr) value[i] = r[i].real();
    if (derivative != nullptr) derivative[i] = r[i].imag() / kStep;
  }
}

/// IDAS on it, tolerances tol, exact residuals of the sensitivities, dense exact Jacobian.
class Sensitive {
 public:
  enum class Rows { dense, sparse, differences, gradients };

  Sensitive(Parametric what, double tol, double t_end)
      : model(std::move(what)), p(model.p), host_(problem(t_end), tol) {
    host_.problem.residual = [this](double, const double* y, const double* yp, double* r) {
      along(in_F(), model.size, at(y, yp), r, nullptr);
    };
    host_.problem.jacobian = [this](double, double cj, const double* y, const double* yp,
                                    double* J) {
      for (int j = 0; j < model.size; ++j) {
        std::vector<Complex> point = at(y, yp);
        point[index(j)] += Complex(0.0, kStep);
        point[index(model.size + j)] += Complex(0.0, cj * kStep);
        along(in_F(), model.size, point, nullptr, J + j * model.size);
      }
    };
    IDASetJacFn(host_.ida, jacobian);
    for (std::size_t k = 0; k < p.size(); ++k) {
      s.push_back(host_.vector(model.s0[k]));
      sp.push_back(host_.vector(model.sp0[k]));
    }
  }

  /// IDASensInit, staggered; null: IDAS' residuals by differences.
  void begin(bool error_control, IDASensResFn residuals_of_s = residuals) {
    current() = this;
    const int count = static_cast<int>(p.size());
    if (IDASensInit(host_.ida, count, IDA_STAGGERED, residuals_of_s, s.data(), sp.data()) != 0)
      throw std::runtime_error("IDASensInit");
    scales = p;
    IDASetSensParams(host_.ida, p.data(), scales.data(), nullptr);
    IDASensEEtolerances(host_.ida);
    IDASetSensErrCon(host_.ida, error_control);
  }
  tp::Projection& attach(Rows kind = Rows::dense, tp::Options options = {}) {
    return host_.attach(constraints(kind), std::move(options));
  }
  /// dg/dp by the exact function.
  void project(Rows kind = Rows::dense) {
    tp::Sensitivities given = by_differences();
    given.parameters = nullptr;
    if (kind == Rows::gradients)
      given.vector_derivative = [this](double, N_Vector y, int k, double* g) {
        rate(N_VGetArrayPointer(y), k, g);
      };
    else
      given.derivative = [this](double, tp::ConstVector y, int k, tp::Vector g) {
        rate(y.data(), k, g.data());
      };
    tp::project_sensitivities(host_.projection(), given);
  }
  tp::Sensitivities by_differences() {
    tp::Sensitivities given;
    given.count = static_cast<int>(p.size());
    given.parameters = p.data();
    return given;
  }

  /// To the end; the largest |C s + dg/dp| over the steps.
  int run() {
    current() = this;
    int flag = 0;
    drift = 0.0;
    long steps = 0;
    while (host_.t < host_.problem.t_end && flag >= 0 && ++steps < 60000) {
      flag = host_.step();
      if (flag >= 0) look();
    }
    if (flag < 0 || steps == 60000) return std::min(flag, -1);
    host_.t = host_.problem.t_end;
    IDAGetDky(host_.ida, host_.t, 0, host_.y);
    return IDAGetSensDky(host_.ida, host_.t, 0, s.data());
  }
  void look() {
    sunrealtype t;
    IDAGetSens(host_.ida, &t, s.data());
    for (std::size_t k = 0; k < p.size(); ++k) {
      std::vector<Complex> y(index(model.size)), q(p.begin(), p.end()), g(index(model.rows));
      for (std::size_t j = 0; j < y.size(); ++j)
        y[j] = {host_.data()[j], kStep * N_VGetArrayPointer(s[k])[j]};
      q[k] += Complex(0.0, kStep);
      model.g(y.data(), q.data(), g.data());
      for (const Complex& row : g) drift = std::max(drift, std::abs(row.imag() / kStep));
    }
  }
  /// Largest |p_k s_k - p_k expected_k| over the first `components` of y, by the largest |p_k s_k|.
  double error(const std::vector<std::vector<double>>& expected, int components) const {
    double worst = 0.0, size = 0.0;
    for (std::size_t k = 0; k < p.size(); ++k)
      for (std::size_t j = 0; j < index(components); ++j) {
        worst = std::max(worst, p[k] * std::abs(N_VGetArrayPointer(s[k])[j] - expected[k][j]));
        size = std::max(size, p[k] * std::abs(expected[k][j]));
      }
    return worst / size;
  }

  tp::Constraints constraints(Rows kind) {
    tp::Constraints set;
    set.count = model.rows;
    set.value = [this](double, tp::ConstVector y, tp::Vector g) { value(y.data(), g.data()); };
    const auto fill = [this](double, tp::ConstVector y, tp::Matrix C) {
      std::vector<double> column(index(model.rows));
      for (int j = 0; j < model.size; ++j) {
        slope(y.data(), j, column.data());
        for (int i = 0; i < model.rows; ++i) C(i, j) = column[index(i)];
      }
    };
    if (kind == Rows::gradients) {
      tp::Gradients rows;
      rows.value = [this](double, N_Vector y, double* g) { value(N_VGetArrayPointer(y), g); };
      rows.fill = [this](double, N_Vector y, N_Vector* C) {
        std::vector<double> column(index(model.rows));
        for (int j = 0; j < model.size; ++j) {
          slope(N_VGetArrayPointer(y), j, column.data());
          for (int i = 0; i < model.rows; ++i) N_VGetArrayPointer(C[i])[j] = column[index(i)];
        }
      };
      set.value = nullptr;
      set.jacobian = rows;
      return set;
    }
    if (kind != Rows::differences) set.jacobian = tp::DenseJacobian(fill);
    return kind == Rows::sparse ? as_sparse(set, model.size) : set;
  }

  Host& host() { return host_; }

  Parametric model;
  std::vector<double> p, scales;
  std::vector<N_Vector> s, sp;
  double drift = 0.0;

 private:
  static std::size_t index(int i) { return static_cast<std::size_t>(i); }
  static Sensitive*& current() {
    static Sensitive* one = nullptr;
    return one;
  }
  Problem problem(double t_end) const {
    Problem made;
    made.size = model.size;
    made.t_end = t_end;
    made.y0 = model.y0;
    made.yp0 = model.yp0;
    made.id = model.id;
    return made;
  }
  // (y, y', p) one after the other.
  std::vector<Complex> at(const double* y, const double* yp) const {
    std::vector<Complex> point(y, y + model.size);
    point.insert(point.end(), yp, yp + model.size);
    point.insert(point.end(), p.begin(), p.end());
    return point;
  }
  std::function<void(const Complex*, Complex*)> in_F() const {
    return
        [this](const Complex* v, Complex* r) { model.F(v, v + model.size, v + 2 * model.size, r); };
  }
  std::function<void(const Complex*, Complex*)> in_g() const {
    return [this](const Complex* v, Complex* r) { model.g(v, v + 2 * model.size, r); };
  }
  void value(const double* y, double* g) const { along(in_g(), model.rows, at(y, y), g, nullptr); }
  void slope(const double* y, int j, double* column) const {
    std::vector<Complex> point = at(y, y);
    point[index(j)] += Complex(0.0, kStep);
    along(in_g(), model.rows, point, nullptr, column);
  }
  void rate(const double* y, int k, double* g) const {
    std::vector<Complex> point = at(y, y);
    point[index(2 * model.size + k)] += Complex(0.0, kStep);
    along(in_g(), model.rows, point, nullptr, g);
  }
  static int jacobian(sunrealtype t, sunrealtype cj, N_Vector y, N_Vector yp, N_Vector, SUNMatrix J,
                      void* data, N_Vector, N_Vector, N_Vector) {
    const auto& its = *static_cast<const Problem*>(data);
    its.jacobian(t, cj, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), SUNDenseMatrix_Data(J));
    return 0;
  }
  static int residuals(int count, sunrealtype, N_Vector y, N_Vector yp, N_Vector, N_Vector* s,
                       N_Vector* sp, N_Vector* r, void*, N_Vector, N_Vector, N_Vector) {
    const Sensitive& own = *current();
    for (int k = 0; k < count; ++k) {
      std::vector<Complex> point = own.at(N_VGetArrayPointer(y), N_VGetArrayPointer(yp));
      for (int j = 0; j < own.model.size; ++j) {
        point[index(j)] += Complex(0.0, kStep * N_VGetArrayPointer(s[k])[j]);
        point[index(own.model.size + j)] += Complex(0.0, kStep * N_VGetArrayPointer(sp[k])[j]);
      }
      point[index(2 * own.model.size + k)] += Complex(0.0, kStep);
      along(own.in_F(), own.model.size, point, nullptr, N_VGetArrayPointer(r[k]));
    }
    return 0;
  }

  Host host_;
};

}  // namespace tether::test
