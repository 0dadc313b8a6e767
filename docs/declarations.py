#!/usr/bin/env python3
"""A header as Doxygen is to read it (its INPUT_FILTER). SPDX-License-Identifier: BSD-3-Clause

    python3 docs/declarations.py HEADER

Doxygen gives the comment of `double a, b;  ///< lengths, m` to one of the two: here each has it. Members that only move,
copy or destroy an object are left out: their declaration says all. Lines keep their numbers. A cited section of a method
links to its paper on the site."""
import pathlib
import re
import sys

sys.dont_write_bytecode = True
from words import PAPERS, ROOT

DECLARATION = re.compile(r"(\s*)((?:(?:const|static|constexpr|inline) )*[\w:]+(?:<[^;(]*>)?(?:::\w+)*[*&]? )(\w[^;]*);\s*(.*)$")
DECLARATOR = re.compile(r"\w+(\[\w+\])?\s*(=.*)?$")
SPECIAL = re.compile(r"\s*(?:(\w+)|\w+& operator=)\((?:const )?(\w*)&{1,2}(?: \w+)?\)(?: noexcept| = delete| = default)*;$")


def declarators(text):
    """The parts between commas that stand in no bracket."""
    parts, depth = [""], 0
    for c in text:
        depth += (c in "([{<") - (c in ")]}>")
        if c == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += c
    return [part.strip() for part in parts]


def split(declaration, above, behind):
    """One declaration for each declarator, each with the comment above or behind all of them."""
    indent, kind, rest = declaration.group(1, 2, 3)
    before = f"/** {' '.join(above)} */ " if above else ""
    after = f" /**< {behind} */" if behind else ""
    parts = [f"{kind}{part};{after}" for part in declarators(rest)]
    return indent + parts[0] + "".join(" " + before + part for part in parts[1:])


def filtered(lines):
    above, number = [], 0
    while number < len(lines):
        line, blank = lines[number], 0
        number += 1
        comment = re.match(r"\s*/// ?([^<@].*|)$", line)
        if comment:
            above.append(comment.group(1))
            yield line
            continue
        special, declaration = SPECIAL.match(line), DECLARATION.match(line)
        if special and special.group(1) in (None, special.group(2)):
            line = ""
        elif declaration and len(declarators(declaration.group(3))) > 1 and all(map(DECLARATOR.match, declarators(declaration.group(3)))):
            behind = re.match(r"///< (.*)$|/\*\*< (.*) \*/$", declaration.group(4))
            behind = (behind.group(1) or behind.group(2)) if behind else ""
            while behind and number < len(lines) and lines[number].strip().startswith("///<"):
                behind += " " + lines[number].strip()[4:].strip()
                number, blank = number + 1, blank + 1
            line = split(declaration, above, behind)
        above = []
        yield line
        yield from [""] * blank


def linked(line, room):
    """A cited paper as a link from the reference to its page. Listings, indented by four, have no links."""
    if "///" not in line or "///     " in line:
        return line
    pages = {"method": PAPERS.get(room), "detection": "detection"}
    return re.sub(r"\b(method|detection)(?=, (?:section|eq)\b)",
                  lambda m: f"[{m.group()}](../docs/method/{pages[m.group()]}.html)", line)


if __name__ == "__main__":
    header = pathlib.Path(sys.argv[1]).resolve()
    lines = filtered(header.read_text().splitlines())
    print("\n".join(linked(line, header.relative_to(ROOT).parts[0]) for line in lines))
