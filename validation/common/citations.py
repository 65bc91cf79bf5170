"""Find citations in the code: formulas by id (`NSF-eq6`), other works by key (`[MLS]`).

The convention stands at the top of REFERENCES.md. A citation belongs to the innermost function or
class around it, or to the file, and is written as a link: `path`, `path::function` or
`path::Class::method`.
"""

import ast
import io
import re
import tokenize
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
ID = re.compile(r"\b(?:LDMW|LDM|NSF|NCLAW|HOT)(?:-[A-Za-z0-9]+(?:\.[0-9]+)*)+|\bX-cross-\d+")
KEY = re.compile(r"\[([A-Z]{3,})\]|\b((?:de)?[A-Z][A-Za-z]{2,}(?:18|19|20)\d\d[a-z]?)\b")
LOOSE = re.compile(r"\b(?:LDMW|LDM|NSF|NCLAW|HOT)\]?,? (?:eq|alg|algorithm|equation|F)\.? ?\d")
LINK = re.compile(r"\b(?:mpm_ref|validation|figures|tests|scenes)/[\w/.-]+\.(?:py|toml)(?:::\w+)*")

# files whose subject is ids and keys: they name some without using their formulas
ABOUT = {
    "validation/common/citations.py", "validation/common/equations.py",
    "validation/common/targets.py",
    "tests/repository/test_equations.py", "tests/repository/test_references.py",
    "tests/validation/common/test_targets.py",
}


class Citation(NamedTuple):
    """One mention of `source` (an id or a key) at path:line, inside the definition `name`."""

    source: str
    path: str       # relative to the repository, with forward slashes
    name: str       # "function", "Class::method", or "" for the file itself
    line: int

    @property
    def link(self) -> str:
        """Return path::name, or the path alone."""
        return f"{self.path}::{self.name}" if self.name else self.path


def cited_ids(root: Path, folder: str, pattern: str = "*.py") -> list[Citation]:
    """Return every equation id named in the files below root/folder that match the pattern."""
    return [hit for path in files(root, folder, pattern) for hit in ids_of(root, path)]


def cited_keys(root: Path, folder: str) -> list[Citation]:
    """Return every KEY in docstrings, strings and comments of Python files below root/folder."""
    return [hit for path in files(root, folder, "*.py") for hit in keys_of(root, path)]


def files(root: Path, folder: str, pattern: str) -> list[Path]:
    """Return the files below root/folder that match the pattern, sorted, without those of ABOUT."""
    paths = sorted((root / folder).rglob(pattern))
    return [path for path in paths if path.relative_to(root).as_posix() not in ABOUT]


def documentation(root: Path = ROOT) -> list[Path]:
    """Return the pages of the documentation that people write: those that git tracks."""
    generated = {"_build", "api", "generated", "numbers", "packages"}
    names = {"cli.md", "contributing.md", "equations.md"}
    return [page for page in sorted((root / "docs").rglob("*.md"))
            if page.name not in names and generated.isdisjoint(page.relative_to(root).parts)]


def ids_of(root: Path, path: Path) -> list[Citation]:
    """Return the ids that one file names."""
    text = path.read_text(encoding="utf-8")
    mentions = [(i, m[0]) for i, line in enumerate(text.splitlines(), 1) for m in ID.finditer(line)]
    return attributed(root, path, text, mentions)


def keys_of(root: Path, path: Path) -> list[Citation]:
    """Return the keys that one Python file names; code is left out, where brackets index arrays."""
    text = path.read_text(encoding="utf-8")
    mentions = []
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in (tokenize.STRING, tokenize.COMMENT):
            for i, line in enumerate(token.string.splitlines(), token.start[0]):
                mentions += [(i, m[1] or m[2]) for m in KEY.finditer(line)]
    return attributed(root, path, text, mentions)


def attributed(root: Path, path: Path, text: str,
               mentions: list[tuple[int, str]]) -> list[Citation]:
    """Return citations of the (line, source) pairs of a file, each with its definition's name."""
    spans = definitions(ast.parse(text, str(path))) if path.suffix == ".py" else []
    relative = path.relative_to(root).as_posix()
    return [Citation(source, relative, owner(spans, line), line) for line, source in mentions]


def definitions(tree: ast.AST, prefix: str = "") -> list[tuple[int, int, str]]:
    """Return (first line, last line, name) of every function and class, outer ones first."""
    spans = []
    for node in ast.iter_child_nodes(tree):
        name = prefix
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            name = f"{prefix}::{node.name}" if prefix else node.name
            first = min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])
            spans.append((first, node.end_lineno, name))
        spans += definitions(node, name)
    return spans


def owner(spans: list[tuple[int, int, str]], line: int) -> str:
    """Return the name of the innermost definition around a line, or ""."""
    names = [name for first, last, name in spans if first <= line <= last]
    return names[-1] if names else ""


def exists(root: Path, link: str) -> bool:
    """Return whether the file of a link exists and defines the name the link gives."""
    file, _, name = link.partition("::")
    path = root / file
    if not path.is_file() or not name:
        return path.is_file()
    spans = definitions(ast.parse(path.read_text(encoding="utf-8")))
    return name in {defined for _, _, defined in spans}
