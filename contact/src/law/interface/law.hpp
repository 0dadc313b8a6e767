// Tether: the interface of a friction law, and the list of laws. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <tether/contact/problem.hpp>

#include "kernels/body_contacts.hpp"
#include "law/interface/local_geometry.hpp"

// A law is a struct of static members in a file of this folder:
//
//   kLaw, kName, kFriction       its enumerator, its name in files, whether mu counts at all
//   kKernels                     its kernels, defined in its .cpp file
//   solve(L, bn, b0, b1, x, lambda, evaluations)   one contact, warm-started from x and lambda
//   solve_singular(L, bn, b0, b1, x, regime, evaluations)   the same for a singular block, or false
//   derivative(L, bn, b0, b1, x, regime, out)      dx/db of that solution
//   gamma(L, out)                slip is opposite to x_t/|x_t| + gamma
//   tangent(L, x, w, out)        the relation between changes of x and w (local_geometry.hpp)
//   natural_point(L, x, w, v)    the nearest admissible impulse to x - w under the law, whose
//                                distance from x is the residual `natural_map`
//
// and for four contacts at a time a struct of the members `rare` and `slide` (lanes.hpp). The .cpp
// file of the law instantiates its kernels (define_law.hpp); what is missing does
// not compile. A new law: its file, and a line in `Law` (one_contact.hpp) and in laws.cpp.

namespace tether::contact::detail {

// Arguments of the sweeps over an assembled problem.
struct View {
  int n;
  const int* start;
  const int* columns;
  const PackedBlock* blocks;
  const LocalBlock* local;
  const PackedVector* b;
  const char* rule;  // marks of contacts with another law; only read by rules that have one
  double* lambda;
  const double* weight;
  double tau;
  const PackedVector* anchor;
  const double* share;
  const double* inverse_scale;
};

// The largest error of a contact relative to its island.
struct Test {
  double fixed = 0;
  double least = 0;  // fixed, or less where contacts stick or slide as they do with b changed by it
};
struct Norms {
  double map = 0, x = 0, w = 0;  // of the natural map, of impulses and velocities
};

struct AssembledKernels {
  void (*sweep)(const View&, PackedVector* x);
  double (*blocks)(const View&, const PackedVector* x, PackedVector* out, Regime*,
                   LocalDerivative*);
  Norms (*natural_map)(const View&, const PackedVector* x, PackedVector* w);
  Test (*error)(const View&, const PackedVector* x);
  double (*exact_error)(const View&, const PackedVector* x, double* each);  // exact_error.hpp
};

// Programs that need no kernels need not link them: traits and kernels are apart.
struct LawTraits {
  Law law;
  const char* name;
  bool friction;
};

struct LawKernels : LawTraits {
  Regime (*solve)(const LocalBlock&, const double* b, double* x, double& lambda, int& evaluations);
  void (*gamma)(const LocalBlock&, double* out);
  void (*natural_point)(const LocalBlock&, const double* x, const double* w, double* v);
  void (*tangent)(const LocalBlock&, const double* x, const double* w, LawTangent& out);
  AssembledKernels assembled;
  // As detail::pass (body_kernels.hpp).
  Squares (*pass)(const BodyArrays&, GeneralContact* begin, GeneralContact* end, Coupled);
  Squares (*group_pass)(const BodyArrays&, GeneralGroup* begin, GeneralGroup* end, Coupled);
  // The law that takes over at single contacts where this one has no fixed point, and the kernels
  // of both together; null: none.
  const LawKernels* replacement;
  const AssembledKernels* mixed;
};

const LawTraits& traits(Law law);
const LawKernels& kernels(Law law);

}  // namespace tether::contact::detail
