"""The READMEs of packages and CONTRIBUTING as pages, with their names as links to the code.

A name in backticks becomes a link where it leads to one place: a path in the repository, a module
of the package, or a function or class in one, as `multigrid.hierarchy.v_cycle`.
"""

import ast
import re
from functools import cache
from pathlib import PurePosixPath

from validation.common.citations import ROOT, definitions

MAPS = {"hot": "How HOT works: ../../explanation/hot.md",
        "rom": "How LDM works: ../../explanation/ldm.md; "
               "How NSF works: ../../explanation/nsf.md",
        "nclaw": "How NCLaw works: ../../explanation/nclaw.md"}
CODE = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")
KEPT = re.compile(r"(^```.*?^```|^#.*?$)", re.MULTILINE | re.DOTALL)      # code and headings
LINK = re.compile(r"\[`?([^`\]\n]+)`?\]\([\w./-]+\.(?:py|md)\)")     # of a README on a Git host
HEADING = re.compile(r"^# .*\n", re.MULTILINE)


def pages():
    """Return {path: text} of the pages."""
    maps = {f"reference/packages/{name}.md": package_page(name, links)
            for name, links in MAPS.items()}
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    return {**maps, "contributing.md": with_links(text, "", "contributing.md")}


def package_page(name, links):
    """Return the page of a package: its README, after links to the explanation and the modules."""
    page = f"reference/packages/{name}.md"
    text = with_links((ROOT / "mpm_ref" / name / "README.md").read_text(encoding="utf-8"),
                      f"mpm_ref/{name}", page)
    reading = [f"[{title}]({target})" for title, target in
               (link.split(": ") for link in links.split("; "))]
    line = (f"\nSee also {' and '.join(reading)}, and the [list of modules]"
            f"(../api/mpm_ref.{name}.rst) with all signatures.\n")
    return HEADING.sub(lambda match: match[0] + line, text, count=1)


def with_links(text, package, page):
    """Return Markdown with its code spans as links, from a page of the site."""
    parts = KEPT.split(LINK.sub(r"`\1`", text))
    parts[::2] = (CODE.sub(lambda match: linked(match[1], package, page), part)
                  for part in parts[::2])
    return "".join(parts)


def linked(text, package, page):
    """Return a code span as a link where it names one place, otherwise as it is."""
    if text.startswith("docs/") and text.endswith(".md") and (ROOT / text).is_file():
        up = "../" * page.count("/")
        return f"[{text}]({up}{text.removeprefix('docs/')})"
    target = place(text, package)
    return f"{{source}}`{text} <{target}>`" if target else f"`{text}`"


@cache
def place(text, package):
    """Return `path` or `path::name` of what a code span names, None where that is not one place."""
    if not re.fullmatch(r"[\w./]+", text):
        return None
    if text.startswith("mpm_ref."):
        return place(text.replace(".", "/") + ".py", package)
    places = set()
    if "/" not in text and package:
        places = {defined for file in (ROOT / package).rglob("*.py")
                  if (defined := definition(text, file.relative_to(ROOT), package))}
    places = places or set(paths_of(text.removesuffix("/"), package))
    return places.pop() if len(places) == 1 else None


def paths_of(name, package):
    """Yield the files that a path names, from the repository or from the package."""
    for folder in dict.fromkeys(("", package)):
        path = PurePosixPath(folder, name)
        for file in (path, path / "__init__.py"):
            if file.suffix in (".py", ".toml") and (ROOT / file).is_file():
                yield str(file)


def definition(name, file, package):
    """Return the place of a module or of a definition in it, if the dotted name leads there.

    A module may be named by the end of its path, so that `sweep.sweep` is found in
    `multigrid/blocks/sweep.py`.
    """
    module = file.with_suffix("").parts
    if module[-1] == "__init__":
        module = module[:-1]
    parts = tuple(name.split("."))
    for split in range(len(parts), 0, -1):
        head, rest = parts[:split], "::".join(parts[split:])
        if module[-split:] == head and rest in names_of(file):
            return f"{file.as_posix()}::{rest}"
        if module[-split:] == head and (not rest or rest.isupper()):
            return file.as_posix()
    return None


@cache
def names_of(file):
    """Return the names of the functions and classes of a file."""
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    return {name for _, _, name in definitions(tree)}
