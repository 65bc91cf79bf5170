"""The source that an experiment runs: the modules that it imports, and one hash of all of them.

Imports are read from the syntax trees, also those inside functions; modules outside `mpm_ref` and
`validation` count by their version alone, which each record has. Docstrings and comments are left
out of the hash, and so is the STORAGE of numbers, which changes none. For scenes, studies and
weights see `input_files`.
"""

import ast
import hashlib
from functools import cache
from pathlib import Path

from mpm_ref.core.jit import syntax

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("mpm_ref", "validation")
STORAGE = {f"validation.common.{name}" for name in (
    "input_files", "judge", "progress", "provenance", "record", "registry", "results", "run",
    "source_digest", "targets", "verdicts")}


def source_digest(module, root=ROOT):
    """Return the hash of a module and of all modules of the repository that it imports.

    Empty where the module is no file of the repository.
    """
    if file_of(module, root) is None:
        return ""
    digest = hashlib.sha256()
    for name in sorted(closure(module, root)):
        digest.update(name.encode())
        digest.update(syntax_of(file_of(name, root)))
    return digest.hexdigest()[:16]


def closure(module, root=ROOT):
    """Return the names of a module and of all that it imports, directly or not, but STORAGE."""
    found, left = set(), [module]
    while left:
        name = left.pop()
        if name not in found | STORAGE:
            found.add(name)
            left += imports(name, root)
    return found


@cache
def syntax_of(file):
    """Return the syntax tree of a file, without docstrings, as bytes."""
    return syntax(file.read_bytes())


@cache
def file_of(name, root):
    """Return the file of a module of the repository, or None."""
    path = root.joinpath(*name.split("."))
    for file in (path / "__init__.py", path.with_suffix(".py")):
        if name.split(".")[0] in PACKAGES and file.is_file():
            return file
    return None


@cache
def imports(name, root):
    """Return the modules of the repository that a module imports, with the packages they are in."""
    file = file_of(name, root)
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    wanted = set()
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            wanted |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = absolute(node, package)
            wanted |= {base, *(f"{base}.{alias.name}" for alias in node.names)}
    return sorted({part for one in wanted for part in ancestors(one) if file_of(part, root)})


def absolute(node, package):
    """Return the module of a `from` import inside a package."""
    if not node.level:
        return node.module
    parts = package.split(".")
    return ".".join([*parts[:len(parts) - node.level + 1], *filter(None, [node.module])])


def ancestors(name):
    """Return a module and the packages it is in."""
    parts = name.split(".")
    return [".".join(parts[:k]) for k in range(1, len(parts) + 1)]
