"""What a machine can hold of the house style: sizes, parameters, docstrings."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("mpm_ref", "validation", "figures", "benchmarks", "examples", "tests")
FILES = sorted(file for folder in FOLDERS for file in (ROOT / folder).rglob("*.py"))

FILE_LINES = 400
FUNCTION_LINES = 60         # without the docstring
PARAMETERS = 6              # without self and cls

# More parameters than six, each with its reason.
MANY_PARAMETERS: dict[str, str] = {
    "mpm_ref/cli/run.py::run": "typer: one parameter per option",
    "mpm_ref/cli/limits.py::measure": "typer: one parameter per option",
    "mpm_ref/cli/oracle.py::record": "typer: one parameter per option",
    "mpm_ref/cli/rom.py::run": "typer: one parameter per option",
    "mpm_ref/cli/rom_play.py::play": "typer: one parameter per option",
    "mpm_ref/cli/law_train.py::train": "typer: one parameter per option",
    "mpm_ref/cli/trade.py::measure": "typer: one parameter per option",
    "mpm_ref/cli/needs.py::find": "typer: one parameter per option",
}

Function = ast.FunctionDef | ast.AsyncFunctionDef


def functions(tree):
    """(qualified name, node, whether it stands at module or class level) of every function."""
    def walk(node, prefix, open_):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, Function):
                yield prefix + child.name, child, open_
                yield from walk(child, f"{prefix}{child.name}.", False)
            elif isinstance(child, ast.ClassDef):
                yield from walk(child, f"{prefix}{child.name}.", open_)
            else:
                yield from walk(child, prefix, open_)
    return list(walk(tree, "", True))


def length(node):
    """Lines of a function without its docstring."""
    lines = node.end_lineno - node.lineno + 1
    if ast.get_docstring(node) is not None:
        first = node.body[0]
        lines -= first.end_lineno - first.lineno + 1
    return lines


def parameters(node):
    """Names of the parameters of a function, without self and cls."""
    a = node.args
    names = [p.arg for p in (*a.posonlyargs, *a.args, *a.kwonlyargs)]
    return [name for name in names if name not in ("self", "cls")]


def is_public(qualified):
    return not any(part.startswith("_") for part in qualified.split("."))


def too_large(file, text):
    """Complaints about the sizes of one file."""
    if text.count("\n") > FILE_LINES:
        yield f"{file}: {text.count(chr(10))} lines, at most {FILE_LINES}; a file is one idea"
    for name, node, _ in functions(ast.parse(text)):
        if length(node) > FUNCTION_LINES:
            yield f"{file}::{name}: {length(node)} lines, at most {FUNCTION_LINES}"
        if len(parameters(node)) > PARAMETERS and f"{file}::{name}" not in MANY_PARAMETERS:
            yield f"{file}::{name}: {len(parameters(node))} parameters, at most {PARAMETERS}"


def undocumented(file, text):
    """Public functions and classes, and modules, without a docstring."""
    tree = ast.parse(text)
    if tree.body and ast.get_docstring(tree) is None:
        yield f"{file}: the module has no docstring"
    for name, node, open_ in functions(tree):
        if open_ and is_public(name) and ast.get_docstring(node) is None:
            yield f"{file}::{name} has no docstring"
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and is_public(node.name) and not ast.get_docstring(node):
            yield f"{file}::{node.name} has no docstring"


def named(files):
    for file in files:
        yield file.relative_to(ROOT).as_posix(), file.read_text(encoding="utf-8")


def test_files_and_functions_are_small():
    found = [said for name, text in named(FILES) for said in too_large(name, text)]
    assert not found, "\n".join(found)


def test_public_names_have_docstrings():
    library = [file for file in FILES if "tests" not in file.relative_to(ROOT).parts
               and "figures" not in file.relative_to(ROOT).parts]
    found = [said for name, text in named(library) for said in undocumented(name, text)]
    assert not found, "\n".join(found)


def test_list_of_many_parameters_is_current():
    known = {f"{file}::{name}": len(parameters(node)) for file, text in named(FILES)
             for name, node, _ in functions(ast.parse(text))}
    stale = [name for name in MANY_PARAMETERS if known.get(name, 0) <= PARAMETERS]
    assert not stale, f"remove from MANY_PARAMETERS: {stale}"


# The checks themselves.

@pytest.mark.parametrize(("text", "said"), [
    ("\n" * 401, "401 lines"),
    ("def f():\n" + "    x = 1\n" * 60, "61 lines"),
    ("def f(a, b, c, d, *, e, g, h):\n    pass\n", "7 parameters"),
    ("def f():\n    def g(a, b, c, d, e, f, g):\n        pass\n", "f.g: 7 parameters"),
])
def test_excess_is_found(text, said):
    found = list(too_large("toy.py", text))
    assert len(found) == 1
    assert said in found[0]


def test_limits_themselves_pass():
    head = "class A:\n    def f(self, a, b, c, d, e, g):\n        '''Doc.'''\n"
    text = head + "        x = 1\n" * 59
    assert list(too_large("toy.py", text)) == []


@pytest.mark.parametrize(("text", "said"), [
    ("x = 1\n", "the module"),
    ("'''Doc.'''\ndef f():\n    pass\n", "f has no"),
    ("'''Doc.'''\nclass A:\n    '''Doc.'''\n    def f(self):\n        pass\n", "A.f has no"),
    ("'''Doc.'''\nclass A:\n    pass\n", "A has no"),
])
def test_missing_docstring_is_found(text, said):
    found = list(undocumented("toy.py", text))
    assert len(found) == 1
    assert said in found[0]


def test_private_and_inner_functions_need_no_docstring():
    text = "'''Doc.'''\ndef _f():\n    pass\ndef g():\n    '''Doc.'''\n    def h():\n        pass\n"
    assert list(undocumented("toy.py", text)) == []
