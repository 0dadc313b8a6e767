## Copyright (C) 2026 The Tether authors. SPDX-License-Identifier: BSD-3-Clause

## -*- texinfo -*-
## @deftypefn {} {[@var{t}, @var{y}] =} ode15s (@var{fcn}, @var{trange}, @var{y0}, @var{ode_opt})
## Octave's own @code{ode15s} with the option @code{Constraints}, see @code{tether_constraints}.
##
## Without that option it is Octave's function, whose help is that of the session without this
## package (@code{pkg unload tether}).
## @seealso{tether_constraints, odeset}
## @end deftypefn

function varargout = ode15s (varargin)
  [varargout{1:nargout}] = __tether_run__ ("ode15s", 4, nargout, varargin);
endfunction

%!function rates = pendulum (t, y)
%!  tension = y(3)^2 + y(4)^2 - y(2);
%!  rates = [y(3); y(4); -y(1)*tension; -y(2)*tension - 1];
%!endfunction
%!function [g, C] = on_circle ()
%!  g = @(t, y) [y(1)^2 + y(2)^2 - 1; y(1)*y(3) + y(2)*y(4); (y(3)^2 + y(4)^2)/2 + y(2)];
%!  C = @(t, y) [2*y(1), 2*y(2), 0, 0; y(3), y(4), y(1), y(2); 0, 1, y(3), y(4)];
%!endfunction

%!testif HAVE_SUNDIALS  # steps, points between them, with and without the matrix
%! [g, C] = on_circle ();
%! period = 7.4162987092054876737;
%! opt = odeset ("RelTol", 1e-6, "AbsTol", 1e-6);
%! for constraints = {{{g, C}}, {g}}
%!   opt.Constraints = constraints{1}{1};
%!   for range = {[0, 10*period], linspace(0, 10*period, 1001)}
%!     [t, y] = ode15s (@pendulum, range{1}, [1; 0; 0; 0], opt);
%!     energy = (y(:,3).^2 + y(:,4).^2) / 2 + y(:,2);
%!     assert (max (abs (energy)) < 1e-9);
%!     assert (max (abs (y(:,1).^2 + y(:,2).^2 - 1)) < 1e-9);
%!     assert (norm (y(end,:) - [1, 0, 0, 0]) < 1e-4);
%!   endfor
%! endfor

%!testif HAVE_SUNDIALS  # without the option: Octave's own results
%! own = __tether_core__ ("ode15s");
%! [t1, y1] = ode15s (@pendulum, [0, 10], [1; 0; 0; 0]);
%! [t2, y2] = own (@pendulum, [0, 10], [1; 0; 0; 0]);
%! assert ({t1, y1}, {t2, y2});
%! sol = ode15s (@pendulum, [0, 10], [1; 0; 0; 0]);
%! assert (sol.x(:), t1);

%!testif HAVE_SUNDIALS  # after a run with constraints the next is plain again
%! opt = odeset ("RelTol", 1e-4);
%! [~, plain] = ode15s (@pendulum, [0, 30], [1; 0; 0; 0], opt);
%! projected = opt;
%! projected.Constraints = on_circle ();
%! [~, y] = ode15s (@pendulum, [0, 30], [1; 0; 0; 0], projected);
%! [~, again] = ode15s (@pendulum, [0, 30], [1; 0; 0; 0], opt);
%! assert (plain, again);
%! assert (! isequal (y, plain));

%!function g = fails_later (t, y)
%!  if (t > 0.5)
%!    error ("g has had enough");
%!  endif
%!  g = y(1)^2 + y(2)^2 - 1;
%!endfunction
%!testif HAVE_SUNDIALS  # an error in g is the error of the run
%! opt = odeset ();
%! opt.Constraints = @fails_later;
%! fail ("[t, y] = ode15s (@pendulum, [0, 10], [1; 0; 0; 0], opt)", "g has had enough");

%!testif HAVE_SUNDIALS  # a start off the constraints is named
%! opt = odeset ();
%! opt.Constraints = @(t, y) y(1) + 5;
%! fail ("[t, y] = ode15s (@pendulum, [0, 10], [1; 0; 0; 0], opt)", ".");

%!error <must be g or> opt = odeset (); opt.Constraints = 3; [t, y] = ode15s (@(t, y) -y, [0, 1], 1, opt);
