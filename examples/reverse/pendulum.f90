! Tether: a pendulum in Fortran by reverse communication. SPDX-License-Identifier: BSD-3-Clause
!
! Unknowns x, y, vx, vy and the tension lambda; L = g = m = 1, index 1. IDA asks for F, its Jacobian,
! the constraints (length, velocity, energy) and their gradients; no function is given to it. Stops
! with 1 if length or energy are not kept over 100 periods.
program pendulum
  use tether_reverse_ida
  implicit none
  interface  ! SUNDIALS' own
    integer(c_int) function IDASetMaxNumSteps(ida_mem, steps) bind(c, name="IDASetMaxNumSteps")
      import
      type(c_ptr), value :: ida_mem
      integer(c_long), value :: steps
    end function
    integer(c_int) function SUNDIALSGetVersionNumber(major, minor, patch, label, length) &
        bind(c, name="SUNDIALSGetVersionNumber")
      import
      integer(c_int), intent(out) :: major, minor, patch
      character(kind=c_char), intent(out) :: label(*)
      integer(c_int), value :: length
    end function
  end interface
  integer, parameter :: n = 5, m = 3
  real(c_double), parameter :: period = 7.4162987092054876737d0  ! 4 K(1/2)
  type(tether_sundials_build) :: host
  type(c_ptr) :: ida
  integer(c_int) :: ask, flag
  integer :: periods
  character(kind=c_char) :: label(32)
  real(c_double) :: start(n) = [1d0, 0d0, 0d0, 0d0, 0d0], slope(n) = [0d0, 0d0, 0d0, -1d0, 0d0]
  real(c_double) :: length, energy
  real(c_double), pointer :: y(:), yp(:), F(:), J(:, :), C(:, :)
  real(c_double) :: cj

  flag = SUNDIALSGetVersionNumber(host%major, host%minor, host%patch, label, 32)
  host%index_bits = 64
  ida = tether_reverse_new_for(n, 0d0, start, slope, c_null_ptr, 1d-6, 1d-6, tether_linear_jacobian, m, &
    c_null_ptr, host, flag)
  if (flag /= 0) stop 1
  flag = IDASetMaxNumSteps(tether_reverse_ida_mem(ida), 1000000_c_long)

  print '(a)', "periods   length - 1      energy"
  periods = 1
  do while (periods <= 100)
    ask = tether_reverse_solve(ida, periods * period, 0)
    do while (ask > tether_stopped)
      call c_f_pointer(tether_reverse_y(ida), y, [n])
      select case (ask)
      case (tether_ask_residual)
        call c_f_pointer(tether_reverse_yp(ida), yp, [n])
        call c_f_pointer(tether_reverse_result(ida), F, [n])
        F(1) = yp(1) - y(3)
        F(2) = yp(2) - y(4)
        F(3) = yp(3) + y(1) * y(5)
        F(4) = yp(4) + y(2) * y(5) + 1
        F(5) = y(3)**2 + y(4)**2 - y(2) - y(5)
      case (tether_ask_jacobian)
        call c_f_pointer(tether_reverse_result(ida), J, [n, n])  ! by columns, zero
        cj = tether_reverse_cj(ida)
        J(1, 1) = cj; J(1, 3) = -1
        J(2, 2) = cj; J(2, 4) = -1
        J(3, 1) = y(5); J(3, 3) = cj; J(3, 5) = y(1)
        J(4, 2) = y(5); J(4, 4) = cj; J(4, 5) = y(2)
        J(5, 2) = -1; J(5, 3) = 2 * y(3); J(5, 4) = 2 * y(4); J(5, 5) = -1
      case (tether_ask_constraints)
        call c_f_pointer(tether_reverse_result(ida), F, [m])
        F(1) = (y(1)**2 + y(2)**2 - 1) / 2
        F(2) = y(1) * y(3) + y(2) * y(4)
        F(3) = (y(3)**2 + y(4)**2) / 2 + y(2)
      case (tether_ask_constraint_jacobian)
        call c_f_pointer(tether_reverse_result(ida), C, [n, m])  ! by rows: a gradient a column
        C(1:2, 1) = y(1:2)
        C(1:2, 2) = y(3:4); C(3:4, 2) = y(1:2)
        C(2, 3) = 1; C(3:4, 3) = y(3:4)
      case default
        stop 1
      end select
      ask = tether_reverse_go_on(ida, 0)
    end do
    if (ask /= tether_reached) stop 1
    call c_f_pointer(tether_reverse_y(ida), y, [n])
    length = hypot(y(1), y(2)) - 1
    energy = (y(3)**2 + y(4)**2) / 2 + y(2)
    print '(i7, es13.1, es12.1)', periods, length, energy
    periods = periods * 10
  end do
  call tether_reverse_free(ida)
  if (.not. (abs(length) < 1d-9 .and. abs(energy) < 1d-9)) stop 1
end program
