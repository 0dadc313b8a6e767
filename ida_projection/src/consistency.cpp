#include "impl.hpp"
namespace tether::ida_projection {
ConsistencyReport Projection::Impl::make_consistent(double, N_Vector, N_Vector, const Consistency&) { return {}; }
ConsistencyReport Projection::Impl::project(double, N_Vector, N_Vector) { return {}; }
int Projection::Impl::solve_and_project(double tout, double* tret, N_Vector y, N_Vector yp, int itask) { return IDASolve(ida_mem_, tout, tret, y, yp, itask); }
}
