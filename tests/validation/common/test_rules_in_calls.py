"""No experiment gives a rule for a printed number: read from the code, without running it.

`Run.record` refuses such a call when it runs; many experiments run at the standard profile alone.
"""

import ast
import re

import pytest

from validation.common.citations import ROOT
from validation.common.targets import load

RULE = {"comparator", "paper", "bound", "factor", "tolerance"}
PAPER = re.compile(r"(?:hot|ldm|ldmw|nsf|nclaw)\\?\.")
ANY = "[^.]+"
OWN = {     # ids of our own that printed ids could be, for all that the code tells
    rf"ldm\.fig7\.{ANY}\.{ANY}", rf"ldmw\.poke\.{ANY}", rf"nsf\.fig6\.{ANY}"}


def pattern(node):
    """Return the pattern of the texts that a string or an f-string gives, or None."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return re.escape(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(re.escape(part.value) if isinstance(part, ast.Constant) else ANY
                       for part in node.values)
    return None


def gives_rule(call):
    """Return whether a call has a keyword of a rule, or unpacks a constant named INFO."""
    return any(word.arg in RULE or (word.arg is None and getattr(word.value, "id", "") == "INFO")
               for word in call.keywords)


def patterns_with_rule(text):
    """Return (line, pattern of an id) of the calls in a text that give a rule."""
    calls = [node for node in ast.walk(ast.parse(text))
             if isinstance(node, ast.Call) and gives_rule(node)]
    return [(call.lineno, found) for call in calls for found in map(pattern, call.args[:2])
            if found and PAPER.match(found)]


@pytest.fixture(scope="module")
def printed():
    return load()


def test_rules_of_printed_numbers_stand_in_the_target_files_alone(printed):
    found = [(file.relative_to(ROOT).as_posix(), line, ids)
             for file in sorted((ROOT / "validation").rglob("*.py"))
             for line, ids in patterns_with_rule(file.read_text(encoding="utf-8"))
             if ids not in OWN]
    assert len(found) > 50
    assert not [one for one in found if any(re.fullmatch(one[2], id) for id in printed)]


@pytest.mark.parametrize(("call", "is_found"), [
    ('run.record("nsf.bread.error", 1.0, comparator="info")', True),
    ('run.record(f"nsf.{name}.error", 1.0, **INFO)', True),
    ('record_mean(run, f"{name}.error", rows)', False),
    ('run.record("nsf.bread.error", 1.0)', False),
    ('run.record(f"nsf.{name}.error.all", 1.0, comparator="info")', False)])
def test_a_rule_in_a_call_is_found(call, is_found, printed):
    hits = [ids for _, ids in patterns_with_rule(call)
            if any(re.fullmatch(ids, id) for id in printed)]
    assert bool(hits) is is_found
