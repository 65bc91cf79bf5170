"""Which experiments there are, how they are found and chosen."""

from uuid import uuid4

import pytest

from validation.common import registry
from validation.common.registry import Experiment, discover, select


@pytest.mark.parametrize(("fields", "said"), [
    ({"experiment_id": "elsewhere.toy", "title": ""}, "groups are"),
    ({"experiment_id": "verification", "title": ""}, "expected <group>.<name>"),
    ({"experiment_id": "verification.toy", "title": "", "profiles": ("fast",)},
     "unknown profile 'fast'"),
    ({"experiment_id": "verification.toy", "title": "", "budget": {"fast": 1}},
     "unknown profile 'fast'"),
])
def test_bad_declaration_is_refused(fields, said):
    with pytest.raises(ValueError, match=said):
        registry.experiment(**fields)


@pytest.fixture
def suite(tmp_path, monkeypatch):
    """A folder of experiment modules, importable under a name of its own."""
    root = tmp_path / f"suite_{uuid4().hex}"
    (root / "verification").mkdir(parents=True)
    monkeypatch.syspath_prepend(tmp_path)

    def module(name, id):
        (root / "verification" / f"{name}.py").write_text(
            "from validation import experiment\n"
            f"@experiment('{id}', title='A toy')\ndef toy(run):\n    pass\n")
        return root

    return module


def test_discovery_finds_experiments_and_survives_a_broken_module(suite):
    suite("fall", "verification.fall")
    root = suite("slide", "verification.slide")
    (root / "verification" / "bad.py").write_text("import no_such_package\n")
    catalogue = discover(root)
    assert list(catalogue.experiments) == ["verification.fall", "verification.slide"]
    assert list(catalogue.broken) == [f"{root.name}.verification.bad"]


def test_same_id_twice_is_refused(suite):
    suite("fall", "verification.fall")
    error, = discover(suite("slide", "verification.fall")).broken.values()
    assert "verification.fall is declared again" in str(error)


def test_id_must_match_its_folder(suite):
    error, = discover(suite("fall", "trade.fall")).broken.values()
    assert "stands in folder verification" in str(error)


def test_own_experiments_load():
    catalogue = discover()
    assert catalogue.broken == {}


KNOWN = {id: Experiment(id, "", (profile,), {}, None) for id, profile in (
    ("hot.fig20", "paper"), ("nclaw.table1.a", "quick"), ("nclaw.table10.b", "quick"))}


@pytest.mark.parametrize(("ids", "chosen"), [
    ([], ["nclaw.table1.a", "nclaw.table10.b"]),
    (["nclaw"], ["nclaw.table1.a", "nclaw.table10.b"]),
    (["nclaw.table1"], ["nclaw.table1.a"]),
    (["nclaw.table10.b", "nclaw.table1.a"], ["nclaw.table1.a", "nclaw.table10.b"]),
])
def test_selection_by_leading_part(ids, chosen):
    assert [e.id for e in select(KNOWN, ids, "quick")] == chosen


@pytest.mark.parametrize(("id", "said"), [
    ("hot", "hot has no quick profile; it has: paper"),
    ("nclaw.table", r"no experiment 'nclaw\.table'; near it: nclaw\.table1\.a, nclaw\.table10\.b"),
    ("nowhere", "no experiment 'nowhere'; near it: none"),
])
def test_unknown_id_is_refused(id, said):
    with pytest.raises(ValueError, match=said):
        select(KNOWN, [id], "quick")
