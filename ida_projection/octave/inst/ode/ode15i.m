## Copyright (C) 2026 The Tether authors. SPDX-License-Identifier: BSD-3-Clause

## -*- texinfo -*-
## @deftypefn {} {[@var{t}, @var{y}] =} ode15i (@var{fcn}, @var{trange}, @var{y0}, @var{yp0}, @var{ode_opt})
## Octave's own @code{ode15i} with the option @code{Constraints}, see @code{tether_constraints}.
##
## Without that option it is Octave's function, whose help is that of the session without this
## package (@code{pkg unload tether}).
## @seealso{tether_constraints, odeset}
## @end deftypefn

function varargout = ode15i (varargin)
  [varargout{1:nargout}] = __tether_run__ ("ode15i", 5, nargout, varargin);
endfunction

%!function r = pendulum (t, y, yp)
%!  tension = y(3)^2 + y(4)^2 - y(2);
%!  r = yp - [y(3); y(4); -y(1)*tension; -y(2)*tension - 1];
%!endfunction

%!testif HAVE_SUNDIALS
%! opt = odeset ("RelTol", 1e-6, "AbsTol", 1e-6);
%! opt.Constraints = @(t, y) [y(1)^2 + y(2)^2 - 1; y(1)*y(3) + y(2)*y(4); (y(3)^2 + y(4)^2)/2 + y(2)];
%! [t, y] = ode15i (@pendulum, [0, 20], [1; 0; 0; 0], [0; 0; 0; -1], opt);
%! assert (max (abs ((y(:,3).^2 + y(:,4).^2) / 2 + y(:,2))) < 1e-9);

%!testif HAVE_SUNDIALS  # without the option: Octave's own results
%! own = __tether_core__ ("ode15i");
%! [t1, y1] = ode15i (@pendulum, [0, 5], [1; 0; 0; 0], [0; 0; 0; -1]);
%! [t2, y2] = own (@pendulum, [0, 5], [1; 0; 0; 0], [0; 0; 0; -1]);
%! assert ({t1, y1}, {t2, y2});
