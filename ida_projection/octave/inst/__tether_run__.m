## Copyright (C) 2026 The Tether authors. SPDX-License-Identifier: BSD-3-Clause
## Undocumented internal function: runs the solver NAME with the arguments of the user, of which the
## one at POSITION holds the options.

function varargout = __tether_run__ (name, position, nout, arguments)
  solver = __tether_core__ (name);
  constraints = [];
  if (numel (arguments) >= position && isstruct (arguments{position})
      && isfield (arguments{position}, "Constraints"))
    constraints = arguments{position}.Constraints;
    arguments{position} = rmfield (arguments{position}, "Constraints");
  endif
  if (isempty (constraints))
    [varargout{1:nout}] = solver (arguments{:});
    return;
  endif
  [g, C] = tether_constraints (constraints, arguments{2}(1), arguments{3}(:));
  __tether__ ("begin", g, C, numel (g (arguments{2}(1), arguments{3}(:))));
  unwind_protect
    try
      [varargout{1:nout}] = solver (arguments{:});
    catch reason
      mine = __tether__ ("error");
      if (! isempty (mine))
        error ("tether:constraints", "%s: %s", name, mine);
      endif
      rethrow (reason);
    end_try_catch
    if (! __tether__ ("attached"))
      error ("tether:constraints", ["%s: the constraints were not attached: IDA is not SUNDIALS' " ...
             "in a shared library, or was loaded before the package"], name);
    endif
  unwind_protect_cleanup
    __tether__ ("end");
  end_unwind_protect
endfunction
