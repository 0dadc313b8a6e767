// A consumer of the installed library: y' = -y by reverse communication.
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdio>
#include <tether/reverse_ida.h>
#include <tether/reverse_ida.hpp>

bool use_reverse_ida() {
  using tether::reverse_ida::Request;
  tether::reverse_ida::Equations equations;
  equations.y = {1.0};
  equations.yp = {-1.0};
  tether::reverse_ida::ReverseIda ida(equations);
  Request request = ida.solve(1.0);
  while (request == Request::residual) {
    ida.result()[0] = ida.yp()[0] + ida.y()[0];
    request = ida.go_on();
  }
  const double error = std::abs(ida.y()[0] - std::exp(-1.0));
  std::printf("%s, error %.1e\n", tether::reverse_ida::to_string(request), error);
  return request == Request::reached && error < 1e-4 && *tether_reverse_last_error() == 0;
}
