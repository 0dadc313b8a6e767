#!/usr/bin/env python3
"""The site: the Markdown of this tree by mkdocs-material, with Doxygen's reference. SPDX-License-Identifier: BSD-3-Clause

    python3 docs/pages.py FOLDER [DOXYGEN_HTML]      # FOLDER/site/index.html; needs no network, neither does the site

Pages are the documents that README.md leads to. Every link and heading of the result is checked."""
import html.parser
import os
import pathlib
import re
import shutil
import subprocess
import sys
import urllib.parse

ROOT = pathlib.Path(__file__).resolve().parent.parent
KATEX = pathlib.Path("/usr/share/javascript/katex")
# Title and pages of each part, in the order of the menu.
PARTS = (
    ("Start", ["README.md", "docs/README.md"]),
    ("Tutorials", ["docs/drop_in.md", "docs/contact.md", "docs/scene.md", "docs/tolerance.md"]),
    ("Guides", ["ida_projection/README.md", "contact/README.md", "scene/README.md", "docs/scene_fields.md",
                "docs/certificate.md", "python/README.md", "linalg/README.md", "examples/README.md", "examples/drop_in/README.md"]),
    ("Methods", ["docs/method/projection.md", "docs/method/contact.md", "docs/method/detection.md",
                 "docs/method/events.md", "docs/glossary.md"]),
    ("Results", ["benchmarks/results/index.md", "benchmarks/README.md"] +
     sorted(str(p.relative_to(ROOT)) for p in (ROOT / "benchmarks" / "results").glob("*.md") if p.stem != "index")),
    ("Project", ["CHANGELOG.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md"]),
)
PAGES = {page for _, pages in PARTS for page in pages}
LINK = re.compile(r"(\]\()([^)\s]+)(\))|((?:src|href)=\")([^\"]+)(\")")
FENCE = re.compile(r"^```.*?^```[ \t]*$", re.M | re.S)
SETTINGS = """site_name: Tether
docs_dir: source
site_dir: site
use_directory_urls: false
theme:
  name: material
  font: false
  features: [navigation.tabs, navigation.top]
plugins: [search]
extra_css: [katex/katex.min.css]
extra_javascript: [katex/katex.min.js, katex/contrib/auto-render.js, formulas.js]
markdown_extensions:
  - tables
  - toc:
      permalink: true
  - pymdownx.highlight
  - pymdownx.superfences
  - pymdownx.arithmatex:
      generic: true
"""
FORMULAS = """for (const e of document.querySelectorAll(".arithmatex"))
  renderMathInElement(e, {throwOnError: false, delimiters: [
    {left: "\\\\(", right: "\\\\)", display: false}, {left: "\\\\[", right: "\\\\]", display: true}]});
"""


def block(match):
    """A fenced block in the words of pymdownx: a formula, or a listing with the name of its file as a title."""
    first, _, rest = match.group().partition("\n")
    language, _, name = first[3:].partition(" ")
    if language == "math":
        return "$$\n" + rest.rstrip().removesuffix("```") + "$$"
    return "```" + language + (f" title=\"{name}\"" if name else "") + "\n" + rest


class Source:
    """The folder that mkdocs reads: pages, and what they link to."""

    def __init__(self, folder):
        self.folder, self.done = folder, set()
        for page in sorted(PAGES):
            self.page(page)

    def write(self, name, text):
        target = self.folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text)

    def page(self, name):
        text = (ROOT / name).read_text()
        blocks = FENCE.findall(text)
        text = FENCE.sub("\0", text)
        text = LINK.sub(lambda m: self.link(name, m), text)
        # Markdown's lists and tables begin after an empty line.
        text = re.sub(r"^([^\s|#*\-\d\0].*)\n(?=(?:[-*] |1\. |\|))", r"\1\n\n", text, flags=re.M)
        for each in blocks:
            text = text.replace("\0", FENCE.sub(block, each), 1)
        self.write(name, text)

    def link(self, page, match):
        before, target, after = [x for x in match.groups() if x is not None]
        if re.match(r"[a-z]+:", target) or target.startswith("#"):
            return match.group()
        path, _, anchor = target.partition("#")
        place = ROOT / pathlib.Path(page).parent
        file = pathlib.Path(os.path.normpath(place / path))
        name = str(file.relative_to(ROOT))
        if file.is_dir():
            path = path.rstrip("/") + ("/README.md" if (file / "README.md").is_file() else "/index.md")
            self.listing(name)
        elif name not in PAGES:
            self.copy(name)
        return before + path + ("#" + anchor if anchor else "") + after

    def copy(self, name):
        (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, self.folder / name)

    def listing(self, name):
        """A folder is a page that lists its files."""
        if name in self.done or name + "/README.md" in PAGES:
            return
        self.done.add(name)
        files = sorted(str(f.relative_to(ROOT)) for f in (ROOT / name).rglob("*") if f.is_file() and f.suffix != ".pyc")
        for file in files:
            self.copy(file)
        listed = "\n".join(f"- [{os.path.relpath(f, name)}]({os.path.relpath(f, name)})" for f in files if not f.endswith(".md"))
        self.write(name + "/index.md", f"# {name}\n\n{listed}\n")


def title(page):
    if page == "README.md":
        return "Tether"
    return re.search(r"^# (.*)$", (ROOT / page).read_text(), re.M).group(1)


def menu(reference):
    lines = ["nav:"]
    for name, pages in PARTS:
        lines.append(f"  - {name}:")
        lines += [f"    - \"{title(page)}\": {page}" for page in pages]
        if name == "Guides" and reference:
            lines.append("    - Classes and functions: reference.md")
    return "\n".join(lines) + "\n"


class Links(html.parser.HTMLParser):
    def __init__(self):
        super().__init__()
        self.targets, self.names = [], set()

    def handle_starttag(self, tag, attributes):
        for key, value in attributes:
            if key in ("id", "name") and value:
                self.names.add(value)
            if key in ("href", "src") and value:
                self.targets.append(value)


def read(file, known):
    if file not in known:
        known[file] = Links()
        known[file].feed(file.read_text(errors="replace"))
    return known[file]


def broken(site):
    """(page, target) of links that lead nowhere."""
    known = {}
    for file in sorted(site.rglob("*.html")):
        if "reference" in file.relative_to(site).parts or file.name == "404.html":
            continue
        for target in read(file, known).targets:
            url = urllib.parse.urlsplit(target)
            if url.scheme or url.netloc:
                continue
            other = pathlib.Path(os.path.normpath(file.parent / urllib.parse.unquote(url.path))) if url.path else file
            if not other.exists():
                yield file.relative_to(site), target
            elif url.fragment and other.suffix == ".html" and "reference" not in other.parts:
                if urllib.parse.unquote(url.fragment) not in read(other, known).names | {"__skip", "__drawer", "__search"}:
                    yield file.relative_to(site), target


def main(folder, reference=None):
    folder = pathlib.Path(folder).resolve()
    for part in ("source", "site"):
        shutil.rmtree(folder / part, ignore_errors=True)
    source = folder / "source"
    pages = Source(source)
    if reference:
        pages.write("reference.md",
                    "# Classes and functions\n\n<a href=\"reference/index.html\">Reference of all public headers</a>, by Doxygen.\n")
    shutil.copytree(KATEX, source / "katex", ignore=shutil.ignore_patterns("*.mjs", "katex.js", "katex.css", "mhchem.js", "*a11y*", "copy-tex.js", "mathtex*"))
    (source / "formulas.js").write_text(FORMULAS)
    (folder / "mkdocs.yml").write_text(SETTINGS + menu(reference))
    run = subprocess.run(["mkdocs", "build", "--strict", "--quiet", "--config-file", str(folder / "mkdocs.yml")], check=False)
    if run.returncode:
        return run.returncode
    if reference:
        shutil.copytree(reference, folder / "site" / "reference")
    problems = list(broken(folder / "site"))
    for page, target in problems:
        print(f"{page}: leads nowhere: {target}")
    print(f"{folder}/site/index.html: {len(list((folder / 'site').rglob('*.html')))} pages, {len(problems)} broken links")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
