#!/usr/bin/env python3
"""The C++ of a document as one source, which is compiled and not run. SPDX-License-Identifier: BSD-3-Clause

    python3 docs/code.py DOCUMENT PRELUDE OUTPUT

Each block ```cpp becomes the body of a function; its includes and namespace aliases stand before it. PRELUDE, a header,
declares what the text takes for granted, such as `ida_mem`. Blocks ```cpp with a name are left out: they are files of
their own, or of libraries that may be missing."""
import pathlib
import re
import sys

BLOCK = re.compile(r"^```cpp\n(.*?)^```", re.M | re.S)
BEFORE = re.compile(r"#include|namespace \w+ =")


def main(document, prelude, output):
    parts = [f'#include "{prelude}"\n']
    for number, block in enumerate(BLOCK.findall(pathlib.Path(document).read_text()), 1):
        before = [line for line in block.splitlines() if BEFORE.match(line)]
        body = [line for line in block.splitlines() if not BEFORE.match(line)]
        text = "\n".join(before + [f"void block_{number}();", f"void block_{number}() {{"] + body + ["}"]) + "\n"
        parts.append(f"#if __has_include(<mpi.h>)\n{text}#endif\n" if "_mpi.hpp" in block else text)
    text = "\n".join(parts)
    file = pathlib.Path(output)
    if not file.is_file() or file.read_text() != text:
        file.write_text(text)


if __name__ == "__main__":
    main(*sys.argv[1:])
