// Tether: Robertson's kinetics. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <problems/robertson.hpp>
#include <problems/rows.hpp>

namespace tether::problems {

std::vector<std::string> robertson_forms() { return {"index 1", "index 0"}; }

Problem robertson(double t_end, const std::string& form) {
  const bool index0 = form == "index 0";
  if (!index0 && form != "index 1") unknown_form("robertson", form, robertson_forms());
  Problem p;
  p.name = "robertson";
  p.form = form;
  p.index = index0 ? 0 : 1;
  p.size = 3;
  p.t_end = t_end;
  p.y0 = {1.0, 0.0, 0.0};
  p.yp0 = {-0.04, 0.04, 0.0};
  p.id = {1.0, 1.0, index0 ? 1.0 : 0.0};
  p.atol_scale = {1.0, 1e-6, 1.0};
  p.error_components = 3;
  p.residual = [index0](double, const double* y, const double* yp, double* r) {
    const double first = 0.04 * y[0], second = 3e7 * y[1] * y[1], third = 1e4 * y[1] * y[2];
    r[0] = yp[0] + first - third;
    r[1] = yp[1] - first + third + second;
    r[2] = index0 ? yp[2] - second : y[0] + y[1] + y[2] - 1.0;
  };
  p.jacobian = [index0](double, double cj, const double* y, const double*, double* J) {
    J[0] = cj + 0.04;
    J[1] = -0.04;
    J[2] = index0 ? 0.0 : 1.0;
    J[3] = -1e4 * y[2];
    J[4] = cj + 1e4 * y[2] + 6e7 * y[1];
    J[5] = index0 ? -6e7 * y[1] : 1.0;
    J[6] = -1e4 * y[1];
    J[7] = 1e4 * y[1];
    J[8] = index0 ? cj : 1.0;
  };
  p.rows.push_back(make_rows(
      "mass", {"mass"}, [](double, const double* y, double* r) { r[0] = y[0] + y[1] + y[2] - 1.0; },
      [](double, const double*, double* C) { C[0] = C[1] = C[2] = 1.0; }));
  p.recommended = {"mass"};

  // Extrapolation in quadruple precision; y2 at 4e5 from its slow manifold, given y1.
  struct Known {
    double t, y1, y2;
  };
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  p.reference.assign(3, unknown);
  for (const Known& known : {Known{0.4, 0.985172113860990, 3.38639537897490e-5},
                             Known{40.0, 0.715827068719405, 9.18553476455776e-6},
                             Known{4e5, 4.93827452097982e-3, 1.98499408795437723e-8},
                             Known{1e11, 2.08334014970129e-8, 8.33336077033478e-14}})
    if (t_end == known.t) p.reference = {known.y1, known.y2, 1.0 - known.y1 - known.y2};
  return p;
}

}  // namespace tether::problems
