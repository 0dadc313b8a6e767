#!/usr/bin/env python3
"""Are these documents and sources written by the rules of docs/glossary.md? SPDX-License-Identifier: BSD-3-Clause

    python3 docs/words.py FILE_OR_FOLDER...

Markdown: no sentence above 35 words, no paragraph above 120, no link to a file or heading that does not exist, no
section or equation of a method that its paper lacks, no phrase that the glossary replaces, no document above its
length. Sources (a folder: all below it), scripts, scenes and programs in documents: no comment line that begins with
Of, What or Where. Sources: no such phrase in a comment or, outside of tests, a string, and sections and equations of a
method that its paper has; in public headers no sentence above 35 words.
"""
import pathlib
import re
import sys

LONGEST_SENTENCE, LONGEST_PARAGRAPH, MOST_TERMS = 35, 120, 15
# Words of a document, formulas and programs included.
LENGTHS = {"README.md": 900, "benchmarks/README.md": 1500, "docs/method": 4000, "python/README.md": 2500,
           "ida_projection/README.md": 2500, "contact/README.md": 2500, "scene/README.md": 2500}
HERE = pathlib.Path(__file__).resolve()
ROOT = HERE.parent.parent
GLOSSARY = ROOT / "docs" / "glossary.md"
SOURCES = {".cpp", ".hpp", ".h", ".c", ".in", ".py", ".m", ".js", ".cmake", ".sh", ".toml", ".f90", ".gp"}
BLOCK = re.compile(r"^```.*?^```[ \t]*$", re.M | re.S)
REMARK = re.compile(r"//.*|/\*.*|(?:^|\s)#(?!\s*(?:include|define|undef|if|el|end|pragma|error|warning)).*|^\s*\*.*")
# The paper that a comment means by "method", by the folder of its source.
PAPERS = {"linalg": "projection", "ida_projection": "projection", "contact": "contact", "scene": "events"}
REFERENCE = re.compile(r"(\b[Mm]ethod|\b[Dd]etection|(?<=docs/method/)\w+)(?:\.md)?, (section|eq)s?[. ]+(\d+(?:\.\d+)?(?:, \d+)*)")
GUIDE = re.compile(r"(?:\b(\w+)/)?README(?:\.md)?, section (\d+)")
STRING = re.compile(r'"((?:\\.|[^"\\])*)"')
COMMENT = re.compile(r"^\s*(?://+[!<]*|#|!)\s*(Of|What|Where)\b")


def table_column(text, heading, column):
    """Entries of one column of the table below a heading of the glossary."""
    part = text.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    rows = [line.strip().strip("|").split("|") for line in part.splitlines() if line.startswith("|")]
    return [row[column].strip() for row in rows[2:]]


class Replaced:
    """Phrases that the glossary replaces, sought as one pattern."""

    def __init__(self, glossary):
        self.say = {phrase.strip().lower(): say
                    for say, phrases in zip(table_column(glossary, "Say", 0), table_column(glossary, "Say", 1))
                    for phrase in phrases.split(";")}
        longest_first = sorted(self.say, key=len, reverse=True)
        self.pattern = re.compile(rf"\b(?:{'|'.join(map(re.escape, longest_first))})\b", re.I)

    def bad_in(self, words):
        return [f'say "{self.say[phrase.lower()]}", not "{phrase}"' for phrase in self.pattern.findall(words)]


def paragraphs(text):
    """(line, words) of each paragraph, list item and heading; tables and blocks are left out."""
    text = BLOCK.sub(lambda m: "\n" * m.group().count("\n"), text)
    current, start = [], 0
    for number, line in enumerate(text.splitlines() + [""], 1):
        item = re.match(r"\s*(?:[-*+]|\d+\.)\s|#|<|>", line)
        if current and (item or not line.strip() or line.lstrip().startswith("|")):
            yield start, " ".join(current)
            current = []
        if line.strip() and not line.lstrip().startswith(("|", "<")):
            if not current:
                start = number
            current.append(re.sub(r"^\s*(?:[-*+]|\d+\.|#+|>)\s", "", line).strip())


def plain(text):
    """Text in which a formula, a piece of code and a link count as words of their own."""
    text = re.sub(r"!\[[^]]*\]\([^)]*\)", "", text)
    text = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", text)
    return re.sub(r"`[^`]*`|\$[^$]*\$", "X", text)


def sentences(text):
    return re.split(r"(?<=[.!?])[)*_]*\s+(?=[*_(\"]*[A-Z0-9])", text)


def anchors(path):
    found = set()
    for heading in re.findall(r"^#+ (.*)$", BLOCK.sub("", path.read_text()), re.M):
        heading = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading)
        found.add(re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", heading.lower().strip())))
    return found


def bad_links(path, text):
    text = re.sub(r"`[^`\n]*`", "", BLOCK.sub("", text))
    for target in re.findall(r"\]\(([^)\s]+)\)", text) + re.findall(r"(?:src|href)=\"([^\"]+)\"", text):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        file = (path.parent / name).resolve() if name else path
        if not file.exists():
            yield f"no such file: {target}"
        elif anchor and file.suffix == ".md" and anchor not in anchors(file):
            yield f"no such heading: {target}"


def check_document(path, replaced):
    text = path.read_text()
    name = str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else path.name
    longest = LENGTHS.get(name) or LENGTHS.get(str(pathlib.PurePath(name).parent))
    if longest and len(text.split()) > longest:
        yield f"{path}: {len(text.split())} words, {longest} are allowed"
    for line, paragraph in paragraphs(text):
        words = plain(paragraph)
        if len(words.split()) > LONGEST_PARAGRAPH:
            yield f"{path}:{line}: a paragraph of {len(words.split())} words"
        for sentence in sentences(words):
            if len(sentence.split()) > LONGEST_SENTENCE:
                yield f"{path}:{line}: a sentence of {len(sentence.split())} words: {sentence[:60]}..."
        if path != GLOSSARY:
            yield from (f"{path}:{line}: {problem}" for problem in replaced.bad_in(words))
    for block in BLOCK.finditer(text):
        for number, line in enumerate(block.group().splitlines(), text.count("\n", 0, block.start()) + 1):
            if COMMENT.match(line):
                yield f"{path}:{number}: a comment that begins with {COMMENT.match(line).group(1)}"
    for problem in [*bad_links(path, text), *bad_citations(path, text)]:
        yield f"{path}: {problem}"


def paper(name, known={}):
    """Numbers of the sections and of the equations of a method paper."""
    if name not in known:
        text = (ROOT / "docs" / "method" / f"{name}.md").read_text()
        known[name] = {"section": set(re.findall(r"^##+ (\d+(?:\.\d+)?)", text, re.M)), "eq": set(re.findall(r"\\tag\{(\d+)\}", text))}
    return known[name]


def bad_citations(path, text):
    """Sections and equations that a document cites, of a paper that it links to or of itself."""
    words = BLOCK.sub("", text)
    cited = re.findall(r"\]\([\w./]*?(\w+)\.md[^)]*\), (eq|section)(?:uation)? \(?(\d+(?:\.\d+)?)", words)
    if path.parent.name == "method":
        cited += [(path.stem, "eq", number) for number in re.findall(r"(?<!equation )\((\d\d?)\)", re.sub(r"\$[^$]*\$", "", words))]
    for name, kind, number in cited:
        if (ROOT / "docs" / "method" / f"{name}.md").is_file() and number not in paper(name)[kind]:
            yield f"docs/method/{name}.md has no {kind} {number}"


def docstrings(text):
    """(line, words) of each documenting comment of a header; its listings, indented by four, are left out."""
    current, start = [], 0
    for number, line in enumerate(text.splitlines() + [""], 1):
        found = re.match(r"\s*/// ?(.*)$", line)
        if found and not current:
            start = number
        if found and not found.group(1).startswith("    "):
            current.append(found.group(1).strip() or "\0")
        elif current:
            yield start, " ".join(current)
            current = []


def check_source(path, replaced):
    if "include" in path.parts and path.suffix == ".hpp":
        for line, words in docstrings(path.read_text()):
            for sentence in [s for part in plain(words).split("\0") for s in sentences(part)]:
                if len(sentence.split()) > LONGEST_SENTENCE:
                    yield f"{path}:{line}: a sentence of {len(sentence.split())} words: {sentence[:60]}..."
    room = path.relative_to(ROOT).parts[0] if path.is_relative_to(ROOT) else ""
    lines = path.read_text(errors="replace").splitlines()
    for number, line in enumerate(lines, 1):
        if COMMENT.match(line):
            yield f"{path}:{number}: a comment that begins with {COMMENT.match(line).group(1)}"
        if path == HERE:
            break
        remark = REMARK.search(line)
        said = " ".join([remark.group() if remark else ""] + (STRING.findall(line) if room != "tests" else []))
        yield from (f"{path}:{number}: {problem}" for problem in replaced.bad_in(said))
        if not remark:
            continue
        more = re.match(r"\s*//+ (.*)", lines[number]) if remark.group().endswith(",") and number < len(lines) else None
        cited = remark.group() + (" " + more.group(1) if more else "")
        for place, kind, numbers in REFERENCE.findall(cited):
            named = PAPERS.get(room) if place.lower() == "method" else place.lower()
            for which in set(numbers.split(", ")) - paper(named)[kind] if named else ():
                yield f"{path}:{number}: docs/method/{named}.md has no {kind} {which}"
        for folder, section in GUIDE.findall(cited):
            guide = ROOT / (folder or room) / "README.md"
            if not guide.is_file() or not re.search(rf"^## {section}\.", guide.read_text(), re.M):
                yield f"{path}:{number}: {folder or room}/README.md has no section {section}"


def main(names):
    glossary = GLOSSARY.read_text()
    terms = table_column(glossary, "Terms", 0)
    replaced = Replaced(glossary)
    problems = [f"{GLOSSARY}: {len(terms)} terms, {MOST_TERMS} are allowed"] if len(terms) > MOST_TERMS else []
    count = 0
    for name in names:
        path = pathlib.Path(name).resolve()
        if not path.exists():
            problems.append(f"{name}: no such file")
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            if file.suffix == ".md":
                problems += check_document(file, replaced)
            elif (file.suffix in SOURCES or file.name == "CMakeLists.txt") and file.is_file():
                problems += check_source(file, replaced)
            else:
                continue
            count += 1
    for problem in problems:
        print(problem.replace(f"{ROOT}/", ""))
    print(f"{count} files, {len(problems)} problems")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
