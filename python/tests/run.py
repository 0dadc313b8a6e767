# SPDX-License-Identifier: BSD-3-Clause
"""Tests of the Python package: run.py <source tree>; exit 77 where NumPy is absent."""

import importlib.util
import os
import sys
import unittest

if importlib.util.find_spec("numpy") is None:
    print("skipped: no NumPy for", sys.executable)
    sys.exit(77)
SOURCE = os.path.abspath(sys.argv[1])
os.environ["TETHER_SOURCE"] = SOURCE
suite = unittest.TestLoader().discover(os.path.dirname(os.path.abspath(__file__)))
sys.exit(not unittest.TextTestRunner(verbosity=1).run(suite).wasSuccessful())
