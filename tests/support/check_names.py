"""Rules for names and for the first sentences of docstrings, checked on syntax trees.

    python tests/support/check_names.py [FOLDER ...]    list violations, all or those in folders
    python tests/support/check_names.py --update        rewrite the list of tolerated violations

`test_names.py` fails on a violation that tests/support/data/names_todo.txt does not list, and on
an entry of the list that is no violation any more. `--update` refuses to make the list longer.
"""

import argparse
import ast
import builtins
import re
from collections import Counter, defaultdict
from pathlib import Path
from typing import NamedTuple

from name_lists import (
    BANNED_MODULES,
    BANNED_NAMES,
    BANNED_WORDS,
    OPENINGS,
    PACKAGES,
    SHARED_CLASS_NAMES,
    UNIQUE,
)

ROOT = Path(__file__).resolve().parents[2]
TODO = ROOT / "tests" / "support" / "data" / "names_todo.txt"
BUILTINS = {name for name in dir(builtins) if not name.startswith("_")} - {
    "copyright", "credits", "exit", "help", "license", "quit"}      # the interactive prompt's
RECORD_IDS = {"id"}         # `record.id` shadows nothing: attribute access alone reaches it
SHADOWING = ("parameter", "function", "class", "field", "key", "module", "variable")
CALLED_BY_USERS = ("__init__", "__new__", "__call__")       # dunder methods whose parameters count

Function = ast.FunctionDef | ast.AsyncFunctionDef


class Name(NamedTuple):
    """A public name: its kind, its text alone and qualified, its line and its syntax node."""

    kind: str           # one of SHADOWING, "method", "option", "file key" or "folder"
    name: str
    qualified: str      # with the class or the function that it belongs to
    line: int
    node: ast.AST | None = None


class Violation(NamedTuple):
    """A broken rule; `rule` and `name` identify it within the file."""

    path: str
    line: int
    rule: str
    name: str
    advice: str

    @property
    def key(self):
        """The entry of the list of tolerated violations."""
        return f"{self.path}::{self.rule}::{self.name}"

    def __str__(self):
        return f"{self.path}:{self.line}: {self.rule} {self.name}: {self.advice}"


def is_public(name):
    return not name.startswith("_")


def base_names(node):
    """Names of the base classes of a class, without the modules."""
    return [getattr(base, "attr", getattr(base, "id", "")) for base in node.bases]


def file_records(trees):
    """Names of the classes that derive from msgspec's Struct: their fields are a user's keys."""
    bases = [(node.name, base_names(node)) for tree in trees.values() for node in ast.walk(tree)
             if isinstance(node, ast.ClassDef)]
    records, size = {"Struct"}, 0
    while len(records) > size:
        size = len(records)
        records |= {name for name, above in bases if records & set(above)}
    return records


def parameters(node, prefix):
    """The parameters of a function, without self and cls."""
    a = node.args
    every = [*a.posonlyargs, *a.args, *filter(None, [a.vararg]), *a.kwonlyargs,
             *filter(None, [a.kwarg])]
    for one in every:
        if is_public(one.arg) and one.arg not in ("self", "cls"):
            yield Name("parameter", one.arg, f"{prefix}{node.name}({one.arg})", one.lineno)


def targets(node):
    """The public names that a statement assigns."""
    nodes = node.targets if isinstance(node, ast.Assign) else [node.target]
    return [one.id for one in nodes if isinstance(one, ast.Name) and is_public(one.id)]


def renamed_keys(node, prefix):
    """The keys in a file that a record gives to its fields: class A(Record, rename={...})."""
    for word in node.keywords:
        if word.arg == "rename" and isinstance(word.value, ast.Dict):
            for one in word.value.values:
                yield Name("file key", one.value, f"{prefix}{one.value}", one.lineno)


def definitions(body, records, prefix="", within=None):
    """The public names that statements of a module or of a class define; `within` is its node."""
    for node in body:
        if isinstance(node, Function):
            kind = "function" if within is None else "method"
            if is_public(node.name):
                yield Name(kind, node.name, prefix + node.name, node.lineno, node)
            if is_public(node.name) or node.name in CALLED_BY_USERS:
                yield from parameters(node, prefix)
        elif isinstance(node, ast.ClassDef) and is_public(node.name):
            yield Name("class", node.name, prefix + node.name, node.lineno, node)
            inside = f"{prefix}{node.name}."
            yield from renamed_keys(node, inside)
            yield from definitions(node.body, records, inside, node)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            key = within is not None and records & set(base_names(within))
            kind = "variable" if within is None else "key" if key else "field"
            for name in targets(node):
                if within is not None or name[0].islower():     # no constants, no type aliases
                    yield Name(kind, name, prefix + name, node.lineno)
        elif isinstance(node, ast.If | ast.Try | ast.With):
            for part in ("body", "orelse", "finalbody"):
                yield from definitions(getattr(node, part, []), records, prefix, within)


def options(tree):
    """Long options that a command line declares by typer.Option or argparse."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and (getattr(node.func, "attr", getattr(node.func, "id", ""))
                                           in ("Option", "add_argument")):
            for one in node.args:
                text = getattr(one, "value", None)
                if isinstance(text, str) and text.startswith("--"):
                    yield Name("option", text[2:].replace("-", "_"), text, one.lineno)


def names(path, tree, records):
    """Every public name of one file, its module first."""
    stem = Path(path).stem
    folder = Path(path).parent.name
    if stem == "__init__":
        yield Name("module", folder, folder, 1, tree)
    elif stem == "__main__":
        yield Name("module", "", "__main__", 1, tree)
    else:
        yield Name("module", stem, stem, 1, tree)
    yield from definitions(tree.body, records)
    yield from options(tree)


def words(name):
    """The words of a name in lower case: of snake_case and of CamelCase."""
    return [word.lower() for part in name.split("_")
            for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[^A-Z]+", part)]


def banned(kind, name):
    """The advice on a name that is banned, or None."""
    for word in words(name):
        for one in (word, word.removesuffix("s")):
            if one in BANNED_WORDS:
                return f"'{word}': {BANNED_WORDS[one]}"
    entire = "_".join(words(name))
    alone = BANNED_NAMES | (BANNED_MODULES if kind in ("module", "folder") else {})
    return alone.get(entire)


def bad_opening(text):
    """The advice on the first paragraph of a docstring that is no sentence, or None."""
    first = text.split("\n\n")[0].strip()
    for opening, advice in OPENINGS.items():
        if first.startswith(opening) and not first[len(opening):len(opening) + 1].isalnum():
            return f"'{opening}': {advice}"
    if len(first.split()) < 3:
        return "fewer than three words: write a sentence"
    is_formula = " = " in first or "->" in first
    if not (first.endswith((".", ":")) or is_formula):
        return "end the sentence with a full stop"
    return None


def broken(path, tree, records):
    """The violations of one file, each by itself."""
    for one in names(path, tree, records):
        advice = banned(one.kind, one.name)
        if advice:
            yield Violation(path, one.line, f"banned {one.kind}", one.qualified, advice)
        exempt = one.kind in ("field", "key") and one.name in RECORD_IDS
        if one.name in BUILTINS and one.kind in SHADOWING and not exempt:
            yield Violation(path, one.line, f"builtin {one.kind}", one.qualified,
                            "it shadows a builtin")
        text = ast.get_docstring(one.node) if one.node is not None else None
        advice = text and bad_opening(text)
        if advice:
            yield Violation(path, one.line, "opening", f"{one.kind} {one.qualified}", advice)


def banned_folders(paths):
    """Folders without an __init__.py whose names are banned; others are modules."""
    packages = {Path(path).parent for path in paths if Path(path).name == "__init__.py"}
    for folder in sorted({parent for path in paths for parent in Path(path).parents} - packages):
        advice = banned("folder", folder.name)
        if advice:
            yield Violation(folder.as_posix(), 1, "banned folder", folder.name, advice)


def shared_classes(trees, reasons):
    """Classes of one name in several places, without a reason; and reasons that nothing needs."""
    places = defaultdict(list)
    for path, tree in trees.items():
        for one in definitions(tree.body, set()) if path.startswith(UNIQUE) else ():
            if one.kind == "class":
                places[one.name].append((path, one))
    for name, uses in sorted(places.items()):
        for path, one in uses if len(uses) > 1 and name not in reasons else ():
            others = sorted({other for other, _ in uses} - {path}) or [path]
            yield Violation(path, one.line, "shared class", one.qualified,
                            f"also in {', '.join(others)}; rename it, or give the reason in "
                            "SHARED_CLASS_NAMES")
    for name in reasons:
        if len(places[name]) < 2:
            yield Violation("tests/support/name_lists.py", 1, "unshared class", name,
                            "remove it from SHARED_CLASS_NAMES")


def violations(root=ROOT, reasons=SHARED_CLASS_NAMES):
    """All violations below a folder, sorted by place."""
    trees = {file.relative_to(root).as_posix(): ast.parse(file.read_text(encoding="utf-8"))
             for package in PACKAGES for file in sorted((root / package).rglob("*.py"))}
    records = file_records(trees)
    single = [one for path, tree in trees.items() for one in broken(path, tree, records)]
    return sorted([*single, *banned_folders(trees), *shared_classes(trees, reasons)])


def listed(file=TODO):
    """The entries of a list of tolerated violations; lines with # are remarks."""
    lines = file.read_text(encoding="utf-8").splitlines()
    return {line for line in lines if line and not line.startswith("#")}


HEAD = """\
# Tolerated violations of the rules in tests/support/check_names.py; the list ends empty.
# Written by: python tests/support/check_names.py --update
"""


def update(file, current):
    """Write the list anew unless it would grow; return a report, and whether it was written."""
    old, new = listed(file), {one.key for one in current}
    lines = [f"new: {key}" for key in sorted(new - old)]
    if len(new) > len(old):
        return "\n".join([*lines, f"{len(new)} violations, {len(old)} listed: fix the new ones; "
                          "the list may not grow"]), False
    file.write_text(HEAD + "".join(f"{key}\n" for key in sorted(new)), encoding="utf-8")
    return "\n".join([*lines, f"{len(new)} entries, {len(old)} before"]), True


def main(arguments=None):
    """Run the command; return the exit status."""
    parser = argparse.ArgumentParser(prog="python tests/support/check_names.py")
    parser.add_argument("folders", nargs="*", metavar="FOLDER", help="such as mpm_ref/rom")
    parser.add_argument("--update", action="store_true", help="rewrite the tolerated list")
    choice = parser.parse_args(arguments)
    current = violations()
    if choice.update:
        report, is_written = update(TODO, current)
        print(report)
        return 0 if is_written else 1
    chosen = [one for one in current if one.path.startswith(tuple(choice.folders) or "")]
    for one in chosen:
        print(one)
    for rule, count in sorted(Counter(one.rule for one in chosen).items()):
        print(f"{count:6d} {rule}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
