"""The equation index: every formula of the papers, with the function and the test that carry it.

    python -m validation.common.equations

The list of ids is docs/equations.toml; the links are the citations found in the code. `make docs`
writes the page too.
"""

import tomllib
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec

from .citations import ROOT, Citation, cited_ids

SOURCE, PAGE = "docs/equations.toml", "docs/reference/equations.md"
PAPERS = ("LDM", "LDMW", "NSF", "NCLAW", "HOT", "X")
FORMULAS = "| id | in short | carried by | checked by |"
ISSUES = "| issue | ruling | enters at | checked by |"
TITLES = {
    "LDM": "LDM: model reduction by a learned deformation map (journal)",
    "LDMW": "LDMW: its workshop version",
    "NSF": "NSF: neural stress fields",
    "NCLAW": "NCLAW: neural constitutive laws",
    "HOT": "HOT: hierarchical optimization time integration",
    "X": "Where the papers disagree",
}
INTRO = """\
# Equation index

This page lists every formula, algorithm and printed setting of the papers with the function that
computes it and the tests that check it. Ids follow the papers' numbering (`eq`, `alg`, `sec`,
`tab`, `app`); `X` ids are issues with the print, each with the reading used here. Docstrings and
tests cite these ids, so that a search for an id in the code finds the same places.
See [notation](../explanation/notation.md) for the symbols and [references](references.md) for the
papers.
"""


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One id: its carrier, and a summary in our words."""

    by: Literal["definition", "ruling", "A", "B", "C", "D", "E"]
    says: str
    same_as: str = ""


class Source(NamedTuple):
    """The content of docs/equations.toml."""

    entries: dict[str, Entry]      # by id, in the order of the file
    milestones: dict[str, str]     # letter -> title
    not_ids: list[str]             # look like ids and are none


class Citations(NamedTuple):
    """The citations of ids: in code that computes with them, and in its checks."""

    carried: list[Citation]     # kernels and scenes; for issues also the tables of printed numbers
    checked: list[Citation]     # tests and experiments


def read(root: Path = ROOT) -> Source:
    """Return the source file; ValueError names the id of a malformed entry."""
    data = tomllib.loads((root / SOURCE).read_text(encoding="utf-8"))
    entries = {i: entry_of(i, e) for paper in PAPERS for i, e in data.get(paper, {}).items()}
    return Source(entries, data["milestones"], data["not_ids"])


def entry_of(identifier: str, data: dict) -> Entry:
    """Return one entry, strictly validated."""
    try:
        return msgspec.convert(data, Entry)
    except msgspec.ValidationError as error:
        raise ValueError(f"{SOURCE}, {identifier}: {error}") from None


def scan(root: Path = ROOT) -> Citations:
    """Return all citations of ids in the repository."""
    printed = [c for c in cited_ids(root, "validation/targets", "*.toml") if "-X" in c.source]
    carried = [*cited_ids(root, "mpm_ref"), *cited_ids(root, "scenes", "*.toml"), *printed]
    return Citations(carried, [*cited_ids(root, "tests"), *cited_ids(root, "validation")])


def unknown(source: Source, citations: Citations) -> list[str]:
    """Return a sentence for every cited id that the source does not list."""
    listed = {*source.entries, *source.not_ids}
    return [f"{c.path}:{c.line} cites {c.source}: not in {SOURCE}; correct it, or list it there"
            for c in (*citations.carried, *citations.checked) if c.source not in listed]


def uncarried(source: Source, citations: Citations, milestone: str) -> list[str]:
    """Return a sentence for every id of a milestone that no code, or no test, cites."""
    code = covered(source, citations.carried)
    tests = covered(source, [c for c in citations.checked if c.path.startswith("tests/")])
    lacks = {i: [kind for kind, ids in (("code", code), ("test", tests)) if i not in ids]
             for i, entry in source.entries.items() if entry.by == milestone}
    return [f"{i} is cited by no {' and no '.join(kinds)}" for i, kinds in lacks.items() if kinds]


def covered(source: Source, citations: list[Citation]) -> set[str]:
    """Return the cited ids, with those of equal meaning."""
    cited = {c.source for c in citations}
    return {i for i in source.entries if cited & names(source, i)}


def names(source: Source, identifier: str) -> set[str]:
    """Return the id, and the ids of equal meaning."""
    same = {i for i, entry in source.entries.items() if entry.same_as == identifier}
    return {identifier, source.entries[identifier].same_as, *same}


def render(source: Source, citations: Citations) -> str:
    """Return the page."""
    parts = [INTRO, summary(source, citations)]
    for paper in PAPERS:
        parts.append(f"## {TITLES[paper]}\n")
        mine = {i: e for i, e in source.entries.items() if i.startswith(paper + "-")}
        formulas = {i: e for i, e in mine.items() if e.by != "ruling"}
        if formulas:
            parts.append(table(FORMULAS, formulas, source, citations))
        issues = {i: e for i, e in mine.items() if e.by == "ruling"}
        parts.append(table(ISSUES, issues, source, citations))
    return "\n".join(parts)


def summary(source: Source, citations: Citations) -> str:
    """Count the ids of each carrier, and those that code and tests cite."""
    carried, checked = (covered(source, one) for one in citations)
    names = {"definition": "definition only", **source.milestones, "ruling": "issue and ruling"}
    rows = ["| carrier | ids | cited by code | by tests or experiments |", "|---|---|---|---|"]
    for by, name in names.items():
        ids = {i for i, entry in source.entries.items() if entry.by == by}
        rows.append(f"| {name} | {len(ids)} | {len(ids & carried)} | {len(ids & checked)} |")
    return "\n".join(rows) + "\n"


def table(head: str, entries: dict[str, Entry], source: Source, citations: Citations) -> str:
    """Return one table of entries."""
    rows = ["```{table}", ":class: equations", "", head, "|---|---|---|---|"]
    for i, entry in entries.items():
        code, tests = (links(one, names(source, i)) for one in citations)
        rows.append(f'| <span id="{i}"></span>{i} | {escaped(entry.says)} '
                    f"| {code or pending(entry, source)} | {tests} |")
    return "\n".join((*rows, "```")) + "\n"


def escaped(text: str) -> str:
    """Return a text with the markup of Markdown escaped."""
    return "".join(f"\\{c}" if c in "\\*_<>[]{}$`" else c for c in text)


def pending(entry: Entry, source: Source) -> str:
    """Return the text for an id that no code cites."""
    return {"definition": "definition only", "ruling": "", **source.milestones}[entry.by]


def links(citations: list[Citation], ids: set[str]) -> str:
    """Return links to all that cite one of the ids, as the role `source` of the site."""
    cited = sorted({c.link for c in citations if c.source in ids})
    return "<br>".join(f"{{source}}`{short(link)} <{link}>`" for link in cited)


def short(link: str) -> str:
    """Return the dotted name of a citation, without the package and the folder of tests."""
    file, _, name = link.partition("::")
    stem = file.removesuffix(".py").removeprefix("mpm_ref/").removeprefix("tests/")
    return ".".join(filter(None, (*stem.split("/"), *name.split("::"))))


def main() -> None:
    """Write the page, and print wrong citations."""
    source, citations = read(), scan()
    (ROOT / PAGE).write_text(render(source, citations), encoding="utf-8")
    problems = unknown(source, citations)
    print(f"{PAGE}: {len(source.entries)} ids, {len(problems)} unknown citations")
    print(*problems, sep="\n", end="\n" if problems else "")


if __name__ == "__main__":
    main()
