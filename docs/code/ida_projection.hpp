// Tether: what the guide's code takes for granted in a program for IDA. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <ida/ida.h>
#include <iostream>
#include <tether/ida_projection.hpp>
#include <tether/ida_projection/sensitivities.hpp>

extern void* ida_mem;
extern N_Vector yy, yp, y;
extern N_Vector *s, *sp;
extern SUNMatrix A;
extern double t0, tout, t;
extern double* p;
extern int Ns;
extern tether::ida_projection::Projection projection;

// As in idas/idas.h, which cannot be included beside ida/ida.h.
#define IDA_STAGGERED 2
using Residuals = int (*)(int, double, N_Vector, N_Vector, N_Vector, N_Vector*, N_Vector*,
                          N_Vector*, void*, N_Vector, N_Vector, N_Vector);
int IDASensInit(void* ida_mem, int Ns, int ism, Residuals residuals, N_Vector* s, N_Vector* sp);
extern Residuals residuals;
