! Tether: IDA by reverse communication, for programs in Fortran; <tether/reverse_ida.h> describes the
! functions. Compile this file with the program: modules belong to one compiler.
! SPDX-License-Identifier: BSD-3-Clause
module tether_reverse_ida
  use, intrinsic :: iso_c_binding
  implicit none

  ! Why a call has returned.
  integer(c_int), parameter :: tether_reached = 0, tether_stopped = 1, tether_ask_residual = 2, &
    tether_ask_jacobian = 3, tether_ask_setup = 4, tether_ask_solve = 5, tether_ask_constraints = 6, &
    tether_ask_constraint_jacobian = 7
  ! Who solves the linear systems.
  integer(c_int), parameter :: tether_linear_differences = 0, tether_linear_jacobian = 1, &
    tether_linear_own = 2

  ! The SUNDIALS of this program: SUNDIALSGetVersionNumber, and 64 or 32 as it was built.
  type, bind(c) :: tether_sundials_build
    integer(c_int) :: major, minor, patch, index_bits
  end type

  interface
    type(c_ptr) function tether_reverse_new_for(n, t0, y, yp, id, rtol, atol, linear, constraints, &
        options, host, flag) bind(c)
      import
      integer(c_int), value :: n, linear, constraints
      real(c_double), value :: t0, rtol, atol
      real(c_double), intent(in) :: y(*), yp(*)
      type(c_ptr), value :: id, options
      type(tether_sundials_build), intent(in) :: host
      integer(c_int), intent(out) :: flag
    end function
    subroutine tether_reverse_free(reverse) bind(c)
      import
      type(c_ptr), value :: reverse
    end subroutine
    integer(c_int) function tether_reverse_solve(reverse, tout, one_step) bind(c)
      import
      type(c_ptr), value :: reverse
      real(c_double), value :: tout
      integer(c_int), value :: one_step
    end function
    integer(c_int) function tether_reverse_go_on(reverse, answer) bind(c)
      import
      type(c_ptr), value :: reverse
      integer(c_int), value :: answer
    end function
    integer(c_int) function tether_reverse_make_consistent(reverse) bind(c)
      import
      type(c_ptr), value :: reverse
    end function
    real(c_double) function tether_reverse_t(reverse) bind(c)
      import
      type(c_ptr), value :: reverse
    end function
    real(c_double) function tether_reverse_cj(reverse) bind(c)
      import
      type(c_ptr), value :: reverse
    end function
    type(c_ptr) function tether_reverse_y(reverse) bind(c)
      import
      type(c_ptr), value :: reverse
    end function
    type(c_ptr) function tether_reverse_yp(reverse) bind(c)
      import
      type(c_ptr), value :: reverse
    end function
    type(c_ptr) function tether_reverse_rhs(reverse) bind(c)
      import
      type(c_ptr), value :: reverse
    end function
    type(c_ptr) function tether_reverse_result(reverse) bind(c)
      import
      type(c_ptr), value :: reverse
    end function
    type(c_ptr) function tether_reverse_message(reverse) bind(c)
      import
      type(c_ptr), value :: reverse
    end function
    type(c_ptr) function tether_reverse_ida_mem(reverse) bind(c)
      import
      type(c_ptr), value :: reverse
    end function
    type(c_ptr) function tether_reverse_last_error() bind(c)
      import
    end function
  end interface
end module
