"""Every key that a message of the package names exists: in scenes, in studies, or in golden files.

A message writes a key in backticks, `dx`, or with a value, start = "zero".
"""

import ast
import importlib
import re
from dataclasses import fields
from pathlib import Path

import pytest
from msgspec import Struct

from mpm_ref import __file__ as package
from mpm_ref.cli import info
from mpm_ref.hot.methods import SolverOptions
from mpm_ref.oracle.schema import ALL_ARRAYS
from mpm_ref.scene.records import Scene

ROOT = Path(package).parent
TABLES = "scene.records", "rom.study.tables", "nclaw.study.study"
SOLVER = {field.name for field in fields(SolverOptions)}
FUNCTIONS = {"make_nodes": "nclaw/batched_step.py", "nodes_of": "rom/quadrature/node_centric.py"}


def keys_of_tables():
    """Names of the fields of all records of scenes and studies, as files write them."""
    for name in TABLES:
        importlib.import_module(f"mpm_ref.{name}")
    found, left = set(), [Struct]
    while left:
        kind = left.pop()
        left += kind.__subclasses__()
        found |= set(getattr(kind, "__struct_encode_fields__", ()))
    return found


def sentences():
    """(file, text) of every string that is no docstring."""
    for file in sorted(ROOT.rglob("*.py")):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and (
                    id(node) not in docs):
                yield file.relative_to(ROOT).as_posix(), node.value


def named(text):
    """Keys that a text names: whole words in backticks, and those with a quoted value."""
    return {*re.findall(r"`([a-zA-Z_]+)`", text), *re.findall(r'\b([a-z_]+) = "[a-z]', text)}


def test_every_key_in_a_message_exists():
    keys = keys_of_tables() | SOLVER | {array.name for array in ALL_ARRAYS}
    unknown = {(file, key) for file, text in sentences() for key in named(text)
               if key not in keys and FUNCTIONS.get(key) != file}
    assert not unknown


def test_enough_of_them_are_looked_at():
    found = {key for _, text in sentences() for key in named(text)}
    assert len(found) > 30
    assert {"displacement_tolerance", "start", "unstable"} <= found


@pytest.mark.parametrize("advice", [info.unsolved(3), info.stalled(3)])
def test_advice_on_implicit_steps_names_keys_of_the_solver(advice):
    assert named(advice[0]) - {"unstable"} <= SOLVER | set(Scene.__struct_fields__)
    assert not info.unsolved(0)
