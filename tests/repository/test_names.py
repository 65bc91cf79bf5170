"""Names and first sentences follow the rules of `check_names`, but for a list that shrinks."""

import ast

import check_names
import pytest
from check_names import (
    PACKAGES,
    Violation,
    banned,
    broken,
    file_records,
    listed,
    main,
    update,
    violations,
    words,
)


@pytest.fixture(scope="module")
def current():
    """The violations of the repository, by the key of the list."""
    return {one.key: one for one in violations()}


def test_no_new_violation(current):
    new = [str(one) for key, one in current.items() if key not in listed()]
    assert not new, "\n".join(new)


def test_list_of_tolerated_violations_is_current(current):
    stale = sorted(listed() - set(current))
    assert not stale, ("remove it from the list, python tests/support/check_names.py --update:\n"
                       + "\n".join(stale))


# The checks themselves.

HEAD = "'''Doc of the module.'''\n"


def rules(text, path="mpm_ref/toy.py"):
    """[(rule, name)] of the violations in the text of one file."""
    tree = ast.parse(text)
    return [(one.rule, one.name) for one in broken(path, tree, file_records({path: tree}))]


def toy(root, **files):
    for name, text in files.items():
        file = root / f"{name}.py"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return root


@pytest.mark.parametrize(("text", "rule", "name"), [
    ("def told(): pass", "banned function", "told"),
    ("def step_of(known_rows): pass", "banned parameter", "step_of(known_rows)"),
    ("async def step(x, *, way=1): pass", "banned parameter", "step(way)"),
    ("def step(x, /, *seen): pass", "banned parameter", "step(seen)"),
    ("class Course: pass", "banned class", "Course"),
    ("class MovedBody: pass", "banned class", "MovedBody"),
    ("class A:\n    def own(self): pass", "banned method", "A.own"),
    ("class A:\n    def __init__(self, at): pass", "banned parameter", "A.__init__(at)"),
    ("class A:\n    class B:\n        held: int = 0", "banned field", "A.B.held"),
    ("class A(Struct):\n    told: int", "banned key", "A.told"),
    ("class A(msgspec.Struct): pass\nclass B(A):\n    told: int", "banned key", "B.told"),
    ("class A(Struct, rename={'x': 'told'}):\n    x: int", "banned file key", "A.told"),
    ("kept = cache()", "banned variable", "kept"),
    ("if fast:\n    def told(): pass", "banned function", "told"),
    ("app.add_argument('--keep-apart')", "banned option", "--keep-apart"),
    ("Out = Annotated[str, typer.Option('--found')]", "banned option", "--found"),
    ("def step(map): pass", "builtin parameter", "step(map)"),
    ("def range(): pass", "builtin function", "range"),
    ("class A:\n    map: int", "builtin field", "A.map"),
    ("class A(Struct):\n    set: dict", "builtin key", "A.set"),
    ("class TimeoutError(Exception): pass", "builtin class", "TimeoutError"),
    ("input = open_file()", "builtin variable", "input"),
    ("def f():\n    'What a step gives.'", "opening", "function f"),
    ("class A:\n    'The same of a body.'", "opening", "class A"),
    ("class A:\n    def f(self):\n        'Whether it is at rest.'", "opening", "method A.f"),
    ("def f():\n    '... of many runs.'", "opening", "function f"),
    ("def f():\n    'Stress.'", "opening", "function f"),
    ("def f():\n    'Return the stress'", "opening", "function f"),
])
def test_violation_is_reported(text, rule, name):
    assert rules(HEAD + text) == [(rule, name)]


@pytest.mark.parametrize("text", [
    "def _told(known): pass",
    "def step(_way): pass",
    "class _Course:\n    kept: int",
    "class A:\n    def __exit__(self, type, value, traceback): pass",
    "class A:\n    def sum(self): pass",                   # hides nothing outside of the class
    "class A(Struct, rename={'sets': 'set'}):\n    sets: dict",      # a user's key may be short
    "def particles_at(x): pass",
    "def number_of_levels(free_nodes): pass",
    "def inner(x): pass",
    "def f():\n    seen = map(len, [])\n    def told(way): pass",    # local names
    "Found = str | None",
    "def f():\n    'Return the stress (dim, dim).'",
    "def f():\n    'Assemble the stress.\\n\\nWhat else'",
    "def f():\n    'tau = F P^T'",
    "def f():\n    'Solve this for x:\\n\\n    A x = b'",
])
def test_allowed_text_passes(text):
    assert rules(HEAD + text) == []


@pytest.mark.parametrize(("path", "expected"), [
    ("mpm_ref/rom/spanned.py", [("banned module", "spanned")]),
    ("mpm_ref/oracle/inner.py", [("banned module", "inner")]),
    ("mpm_ref/nclaw/range.py", [("builtin module", "range")]),
    ("figures/_way.py", [("banned module", "_way")]),
    ("mpm_ref/kept/__init__.py", [("banned module", "kept")]),
    ("mpm_ref/kept/__main__.py", []),
    ("mpm_ref/rom/pod.py", []),
])
def test_names_of_modules(path, expected):
    assert rules(HEAD, path) == expected


@pytest.mark.parametrize(("name", "expected"), [
    ("known_bodies", ["known", "bodies"]),
    ("LBFGSWay", ["lbfgs", "way"]),
    ("Mls3", ["mls3"]),
    ("F", ["f"]),
    ("_pairs", ["pairs"]),
])
def test_words_of_a_name(name, expected):
    assert words(name) == expected


def test_plural_of_a_banned_word_is_banned():
    assert "'ways'" in banned("function", "hot_ways")
    assert banned("function", "always") is None


def test_folder_without_init_is_checked(tmp_path):
    toy(tmp_path, **{"validation/kept/bar": HEAD})
    assert [one.key for one in violations(tmp_path, {})] == [
        "validation/kept::banned folder::kept"]


CLASS = HEAD + "class Cost:\n    '''A cost in seconds.'''\n"


def test_shared_class_is_reported_in_each_place(tmp_path):
    toy(tmp_path, **{"mpm_ref/a": CLASS, "validation/b": CLASS, "figures/c": CLASS})
    reported = violations(tmp_path, {})
    assert [one.key for one in reported] == ["mpm_ref/a.py::shared class::Cost",
                                             "validation/b.py::shared class::Cost"]
    assert "validation/b.py" in reported[0].advice
    assert violations(tmp_path, {"Cost": "two clocks"}) == []


def test_reason_for_a_unique_class_is_reported(tmp_path):
    toy(tmp_path, **{"mpm_ref/a": CLASS})
    assert [one.rule for one in violations(tmp_path, {"Cost": "two clocks"})] == ["unshared class"]


def test_every_package_is_read(tmp_path):
    toy(tmp_path, **{f"{package}/told": HEAD for package in PACKAGES})
    assert {one.path.split("/")[0] for one in violations(tmp_path, {})} == set(PACKAGES)


def test_update_drops_and_replaces_but_does_not_grow(tmp_path):
    file = tmp_path / "todo.txt"
    file.write_text("# remark\na::rule::x\n\nb::rule::y\n")
    c, d, e = (Violation(path, 1, "rule", "z", "advice") for path in "cde")
    report, is_written = update(file, [c, d, e])
    assert not is_written
    assert "3 violations, 2 listed" in report
    assert listed(file) == {"a::rule::x", "b::rule::y"}
    report, is_written = update(file, [d, c])
    assert is_written
    assert report.splitlines() == ["new: c::rule::z", "new: d::rule::z", "2 entries, 2 before"]
    assert file.read_text().splitlines()[-2:] == ["c::rule::z", "d::rule::z"]


@pytest.fixture
def two(monkeypatch, tmp_path):
    """Two violations instead of the repository's, and a list of tolerated ones with another two."""
    reported = [Violation(f"{folder}/a.py", 3, "opening", "function f", "advice")
                for folder in ("figures", "mpm_ref")]
    todo = tmp_path / "todo.txt"
    todo.write_text("x\ny\n")
    monkeypatch.setattr(check_names, "violations", lambda: reported)
    monkeypatch.setattr(check_names, "TODO", todo)
    return todo


def test_command_lists_the_violations_of_folders(two, capsys):
    assert main(["mpm_ref", "benchmarks"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "mpm_ref/a.py:3: opening function f: advice", "     1 opening"]
    assert main([]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 3


def test_command_updates_the_list(two, capsys):
    assert main(["--update"]) == 0
    assert "2 entries, 2 before" in capsys.readouterr().out
    two.write_text("x\n")
    assert main(["--update"]) == 1
    assert "may not grow" in capsys.readouterr().out
