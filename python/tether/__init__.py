# SPDX-License-Identifier: BSD-3-Clause
"""Tether keeps a computed motion on the constraints that it must obey.

tether.contact  frictional contact: w = A x - b with impulses x in the friction cones
tether.ida      F(t, y, y') = 0 by SUNDIALS IDA, kept on g(t, y) = 0
tether.scene    rigid bodies in motion, from scene files
"""

import importlib.util
import sys

if importlib.util.find_spec("numpy") is None:
    raise ImportError(f"tether needs NumPy, and {sys.executable} has none: {sys.executable} -m pip install numpy")

from ._tether import __version__, contact, ida, scene

__all__ = ["__version__", "contact", "ida", "scene"]
