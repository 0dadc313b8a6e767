# SPDX-License-Identifier: BSD-3-Clause
"""What help() says."""

import inspect
import unittest

from tether import contact, ida, scene


def members(name, owner):
    """(name, member) of the public members of a module or class, and of the classes in it."""
    for key, member in vars(owner).items():
        if key.startswith("_") or inspect.ismodule(member):
            continue
        yield f"{name}.{key}", member
        if inspect.isclass(member):
            yield from members(f"{name}.{key}", member)


class Help(unittest.TestCase):
    def test_every_public_member_has_a_docstring(self):
        found = [each for module in (contact, ida, scene) for each in members(module.__name__, module)]
        self.assertGreater(len(found), 90)
        # The last line: pybind11 writes the signature above it.
        without = [name for name, member in found if not (inspect.getdoc(member) or "").strip() or inspect.getdoc(member).endswith("None")]
        self.assertEqual(without, [])


if __name__ == "__main__":
    unittest.main()
