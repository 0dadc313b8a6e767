## Copyright (C) 2026 The Tether authors. SPDX-License-Identifier: BSD-3-Clause

## -*- texinfo -*-
## @deftypefn {} {[@var{g}, @var{C}] =} tether_constraints (@var{constraints}, @var{t}, @var{y})
## Check constraints for @code{ode15i} and @code{ode15s} at a point.
##
## @var{constraints} is a function handle @code{g (t, y)} that returns a column of values, zero where
## the constraints hold, or a cell @code{@{g, C@}} with a second one @code{C (t, y)} for the matrix
## dg/dy.  Without it @code{C} is taken by differences.
##
## The package gives @code{ode15i} and @code{ode15s} the option @code{Constraints}:
##
## @example
## @group
## pkg load tether
## opt = odeset ("RelTol", 1e-6, "AbsTol", 1e-6);
## opt.Constraints = @{@@(t, y) y(1)^2 + y(2)^2 - 1, @@(t, y) [2*y(1), 2*y(2), 0, 0]@};
## [t, y] = ode15s (@@(t, y) [y(3); y(4); -y(1); -y(2)], [0, 10], [1; 0; 0; 1], opt);
## @end group
## @end example
##
## Each step is moved onto the constraints by the shortest move in the weights of the error test
## before it is accepted; so is what is returned between steps.  The initial values must satisfy the
## constraints, and the solution must stay on them up to its error: invariants that the equations have.
## @seealso{ode15i, ode15s}
## @end deftypefn

function [g, C] = tether_constraints (constraints, t, y)
  if (nargin != 3)
    print_usage ();
  endif
  C = [];
  if (iscell (constraints) && any (numel (constraints) == [1, 2]))
    g = constraints{1};
    if (numel (constraints) == 2)
      C = constraints{2};
    endif
  else
    g = constraints;
  endif
  if (! is_function_handle (g) || ! (isempty (C) || is_function_handle (C)))
    error ("tether:constraints", 'option "Constraints" must be g or {g, C}, functions of (t, y)');
  endif
  value = g (t, y);
  if (! (isnumeric (value) && isreal (value) && isvector (value)))
    error ("tether:constraints", "g (t, y) must return a real column, it returned %s of %s",
           class (value), mat2str (size (value)));
  endif
  if (! isempty (C))
    matrix = C (t, y);
    if (! (isnumeric (matrix) && isreal (matrix) && isequal (size (matrix), [numel(value), numel(y)])))
      error ("tether:constraints", "C (t, y) must return a real %d x %d matrix, it returned %s of %s",
             numel (value), numel (y), class (matrix), mat2str (size (matrix)));
    endif
  endif
endfunction

%!error <must be g or> tether_constraints (3, 0, 1)
%!error <real 1 x 2 matrix> tether_constraints ({@(t, y) y(1), @(t, y) 1}, 0, [1; 2])
%!test
%! [g, C] = tether_constraints (@(t, y) y(1), 0, [1; 2]);
%! assert (g (0, [3; 4]), 3);
%! assert (C, []);
