// Tether: reverse communication for programs in C and Fortran. SPDX-License-Identifier:
// BSD-3-Clause
#include <string>
#include <tether/reverse_ida.h>
#include <tether/reverse_ida.hpp>
#include <utility>

#include "c/guarded.hpp"

namespace tr = tether::reverse_ida;
using tether::ida_projection::c::Arguments;
using tether::ida_projection::c::guarded;

struct tether_reverse {
  tr::ReverseIda ida;
  std::string message;
};

static_assert(int(tr::Request::reached) == TETHER_REACHED &&
              int(tr::Request::residual) == TETHER_ASK_RESIDUAL &&
              int(tr::Request::constraint_jacobian) == TETHER_ASK_CONSTRAINT_JACOBIAN &&
              int(tr::Linear::own) == TETHER_LINEAR_OWN);

namespace {

template <class Call>
int request(tether_reverse* reverse, const char* function, Call&& call) {
  return guarded(function, [&](const Arguments& arguments) {
    arguments.require(reverse, "reverse");
    return static_cast<int>(call(reverse->ida));
  });
}

template <class Value>
Value of(const tether_reverse* reverse, Value (tr::ReverseIda::*value)() const) {
  return reverse != nullptr ? (reverse->ida.*value)() : Value();
}

}  // namespace

extern "C" {

tether_reverse* tether_reverse_new_for(int n, double t0, const double* y, const double* yp,
                                       const double* id, double rtol, double atol, int linear,
                                       int constraints, const tether_options* options,
                                       const tether_sundials_build* host, int* flag) {
  tether_reverse* made = nullptr;
  const int result = guarded("tether_reverse_new", [&](const Arguments& arguments) {
    arguments.check(n >= 1, "n", n, ">= 1");
    arguments.require(y, "y");
    arguments.require(yp, "yp");
    arguments.check(linear >= TETHER_LINEAR_DIFFERENCES && linear <= TETHER_LINEAR_OWN, "linear",
                    linear, "TETHER_LINEAR_...");
    arguments.check_build(host);
    tr::Equations equations;
    equations.t0 = t0;
    equations.y.assign(y, y + n);
    equations.yp.assign(yp, yp + n);
    if (id != nullptr) equations.id.assign(id, id + n);
    equations.rtol = rtol;
    equations.atol = {atol};
    equations.linear = static_cast<tr::Linear>(linear);
    equations.constraints = constraints;
    equations.options = tether::ida_projection::c::options_of(options, n);
    made = new tether_reverse{tr::ReverseIda(std::move(equations)), {}};
  });
  if (flag != nullptr) *flag = result;
  return made;
}

void tether_reverse_free(tether_reverse* reverse) { delete reverse; }

int tether_reverse_solve(tether_reverse* reverse, double tout, int one_step) {
  return request(reverse, "tether_reverse_solve",
                 [&](tr::ReverseIda& ida) { return ida.solve(tout, one_step != 0); });
}

int tether_reverse_make_consistent(tether_reverse* reverse) {
  return request(reverse, "tether_reverse_make_consistent",
                 [](tr::ReverseIda& ida) { return ida.make_consistent(); });
}

int tether_reverse_go_on(tether_reverse* reverse, int answer) {
  return request(reverse, "tether_reverse_go_on",
                 [&](tr::ReverseIda& ida) { return ida.go_on(answer); });
}

double tether_reverse_t(const tether_reverse* r) { return of(r, &tr::ReverseIda::t); }
double tether_reverse_cj(const tether_reverse* r) { return of(r, &tr::ReverseIda::cj); }
const double* tether_reverse_y(const tether_reverse* r) { return of(r, &tr::ReverseIda::y); }
const double* tether_reverse_yp(const tether_reverse* r) { return of(r, &tr::ReverseIda::yp); }
const double* tether_reverse_rhs(const tether_reverse* r) { return of(r, &tr::ReverseIda::rhs); }
double* tether_reverse_result(const tether_reverse* r) { return of(r, &tr::ReverseIda::result); }
void* tether_reverse_ida_mem(const tether_reverse* r) { return of(r, &tr::ReverseIda::ida_mem); }

const char* tether_reverse_message(tether_reverse* reverse) {
  const int flag = guarded("tether_reverse_message", [&](const Arguments& arguments) {
    arguments.require(reverse, "reverse");
    reverse->message = reverse->ida.message();
  });
  return flag == 0 ? reverse->message.c_str() : "";
}

const char* tether_reverse_last_error(void) { return tether::ida_projection::c::last_error; }

}  // extern "C"
