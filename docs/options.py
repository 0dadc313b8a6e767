#!/usr/bin/env python3
"""Do the tables of options agree with the headers? SPDX-License-Identifier: BSD-3-Clause

    python3 docs/options.py

Each public field of these structures stands in a table of its guide whose first column is "option", with its default,
and each option of such a table is a field. Tables of docs/scene_fields.md have what scene/src/files reads, that of
linalg/README.md each header."""
import pathlib
import re
import sys

sys.dont_write_bytecode = True
from declarations import filtered

ROOT = pathlib.Path(__file__).resolve().parent.parent
GUIDES = {
    "ida_projection/README.md": (("ida_projection/include/tether/ida_projection/options.hpp", "Options", {"advanced"}),
                                 ("ida_projection/include/tether/ida_projection/options.hpp", "Advanced", set())),
    "contact/README.md": (("contact/include/tether/contact/solver.hpp", "Options", set()),
                          ("contact/include/tether/contact/body_solver.hpp", "BodyOptions", set()),
                          ("contact/include/tether/contact/stepping.hpp", "SteppingOptions", set())),
}
FIELD = re.compile(r"\s*(?!using|static|return)[\w:]+(?:<.*?>+)?[*&]? (\w+)(?: = ([^;]+))?;")


def fields(header, name):
    """Names and defaults of the fields of a structure, in the order of the header."""
    text = "\n".join(filtered((ROOT / header).read_text().splitlines()))
    body = re.search(rf"^struct {name} [^;]*?{{\n(.*?)^}};", text, re.M | re.S).group(1)
    return {m.group(1): m.group(2) for line in body.splitlines() for m in FIELD.finditer(re.sub(r"//.*|/\*.*?\*/", "", line))}


def tables(text, first):
    """Rows of tables whose first column has this title."""
    for table in re.findall(r"((?:^\|.*\n)+)", text, re.M):
        rows = [[cell.strip() for cell in row.strip("|").split("|")] for row in table.splitlines()]
        if rows[0][0] == first:
            yield from rows[2:]


def same(written, default):
    """A default as a table writes it, with units, and as C++ does. Classes begin empty, which is said in words."""
    if default is None or written in ("none", "absent", "null"):
        return default in (None, "nullptr", "{}")
    default = default.split("::")[-1]
    written = written.strip("`").split(" ")[0]
    try:
        return float(written) == float(default)
    except ValueError:
        return written == default


def problems():
    for guide, structures in GUIDES.items():
        known, told = {}, set()
        for header, name, apart in structures:
            for field, default in fields(header, name).items():
                if field not in apart:
                    known.setdefault(field, []).append((name, default))
        for row in tables((ROOT / guide).read_text(), "option"):
            names = re.findall(r"`(\w+)`", row[0])
            defaults = [d.strip() for d in row[1].split(",")]
            told.update(names)
            for k, name in enumerate(names):
                written = defaults[min(k, len(defaults) - 1)]
                if name not in known:
                    yield f"{guide}: there is no option {name}"
                elif not any(same(written, default) for _, default in known[name]):
                    yield f"{guide}: {name} is {known[name]}, not {written}"
        for name in sorted(known.keys() - told):
            yield f"{guide}: no table has {known[name][0][0]}::{name}"
    linalg = {name for row in tables((ROOT / "linalg" / "README.md").read_text(), "header") for name in re.findall(r"`([\w.]+)`", row[0])}
    for name in sorted(linalg ^ {p.name for p in (ROOT / "linalg" / "include" / "tether" / "linalg").glob("*.hpp")}):
        yield f"linalg/README.md: {name} is " + ("no header" if name in linalg else "not told")
    page = (ROOT / "docs" / "scene_fields.md").read_text()
    source = (ROOT / "scene" / "src" / "files" / "read.cpp").read_text()
    parts = "".join(part for part in page.split("\n## ") if re.match(r"\[(?:smooth|stepping|event)\]", part))
    told = {name for row in tables(parts, "field") for name in re.findall(r"`(\w+)`", row[0])}
    read = set(re.findall(r"io\.\w+\(\s*\"(\w+)\"", source))
    for name in sorted(read ^ told):
        yield f"docs/scene_fields.md: {name} is " + ("not told" if name in read else "not read")


def main():
    found = list(problems())
    print("\n".join(found) if found else "tables of options: as the headers")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
