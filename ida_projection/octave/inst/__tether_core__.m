## Copyright (C) 2026 The Tether authors. SPDX-License-Identifier: BSD-3-Clause
## Undocumented internal function: the solver of Octave itself, e.g. __tether_core__ ("ode15s").

function solver = __tether_core__ (name)
  mlock ();
  persistent solvers = struct ();
  if (! isfield (solvers, name))
    solvers.(name) = str2func (name);
    functions (solvers.(name));  # binds the handle to the file that is found now
  endif
  solver = solvers.(name);
endfunction
