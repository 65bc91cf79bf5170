"""The equation index lists every id of the papers; links in the documentation lead somewhere."""

import re
from collections import Counter

import pytest

from validation.common import equations
from validation.common.citations import ID, LINK, ROOT, documentation, exists
from validation.common.equations import Citations, Entry, Source

# formulas, algorithms, rules and defaults; issues
COUNTS = {"LDM": (60, 17), "LDMW": (16, 8), "NSF": (35, 18), "NCLAW": (57, 17), "HOT": (27, 18),
          "X": (0, 15)}
# numbered without a gap up to
LAST = {"LDM-eq": 24, "LDM-alg": 7, "LDMW-eq": 8, "LDMW-alg": 2, "NSF-eq": 13, "NCLAW-eq": 37,
        "NCLAW-alg": 4, "HOT-eq": 9, "HOT-alg": 3, "LDM-X": 17, "LDMW-X": 8, "NSF-X": 18,
        "NCLAW-X": 17, "HOT-X": 18, "X-cross-": 15}


@pytest.fixture(scope="module")
def source():
    return equations.read()


@pytest.fixture(scope="module")
def cited():
    return equations.scan()


def test_no_id_is_missing(source):
    found = Counter((i.split("-")[0], e.by == "ruling") for i, e in source.entries.items())
    assert {p: (found[p, False], found[p, True]) for p in COUNTS} == COUNTS
    expected = {f"{prefix}{n}" for prefix, last in LAST.items() for n in range(1, last + 1)}
    assert expected <= source.entries.keys()


def test_issues_and_only_issues_have_rulings(source):
    assert not [i for i, e in source.entries.items()
                if (e.by == "ruling") != bool(re.search(r"-X\d|^X-", i))]


def test_statements_are_short_and_plain(source):
    assert not [i for i, e in source.entries.items()
                if not e.says.isascii() or "|" in e.says or not 5 <= len(e.says) <= 200]


def test_statements_refer_to_ids_that_exist(source):
    known = {*source.entries, *source.not_ids}
    assert not [(i, m[0]) for i, e in source.entries.items()
                for m in ID.finditer(e.says) if m[0] not in known]


def test_code_and_tests_cite_only_known_ids(source, cited):
    assert equations.unknown(source, cited) == []


def test_the_page_lists_every_id_with_links_to_what_cites_it(source, cited):
    page = equations.render(source, cited)
    assert not [i for i in source.entries if f"</span>{i} |" not in page]
    links = set(re.findall(r"\{source\}`[^`<]+ <([^`>]+)>`", page))
    assert links == {c.link for c in (*cited.carried, *cited.checked)
                     if c.source in source.entries}


def test_links_and_ids_in_the_documentation_lead_somewhere(source):
    pages = [*documentation(), ROOT / "REFERENCES.md"]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    assert not [m[0] for m in LINK.finditer(text) if not exists(ROOT, m[0])]
    assert {m[0] for m in ID.finditer(text)} <= {*source.entries, *source.not_ids}


def test_the_notation_says_where_every_ruling_between_papers_enters(source):
    text = (ROOT / "docs/explanation/notation.md").read_text(encoding="utf-8")
    entries = re.split(r"^- \*\*(?=X-cross)", text, flags=re.MULTILINE)[1:]
    assert [i for i in source.entries if i.startswith("X-")] == [e.split(",")[0] for e in entries]
    assert not [e[:12] for e in entries if "Enters:" not in e]


@pytest.mark.parametrize("milestone", ["A", "B"])
def test_what_is_done_is_carried_by_code_and_tests(source, cited, milestone):
    lacking = equations.uncarried(source, cited, milestone)
    assert not lacking, "\n".join(lacking)


@pytest.fixture
def toy(tmp_path):
    """A repository with one formula in code, one in a scene, and one wrong id in a test."""
    method = '    def add(self):\n        """NSF-eq6, and NSF-sec5.1."""\n'
    for name, text in {
        "mpm_ref/force.py": f'"""Forces."""\n\n\nclass Grid:\n{method}',
        "scenes/cube.toml": "# NCLAW-sim\ntitle = 'cube'\n",
        "tests/test_force.py": "def test_sign():\n    assert True  # NSF-eq66\n",
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_a_citation_belongs_to_the_innermost_definition(toy):
    carried, checked = equations.scan(toy)
    assert [(c.source, c.link) for c in carried] == [
        ("NSF-eq6", "mpm_ref/force.py::Grid::add"), ("NSF-sec5.1", "mpm_ref/force.py::Grid::add"),
        ("NCLAW-sim", "scenes/cube.toml")]
    assert [(c.source, c.link) for c in checked] == [("NSF-eq66", "tests/test_force.py::test_sign")]


def test_unknown_ids_and_dead_links_are_found(toy):
    known = Source({i: Entry("A", "a") for i in ("NSF-eq6", "NSF-sec5.1", "NCLAW-sim")}, {}, [])
    assert equations.unknown(known, equations.scan(toy)) == [
        "tests/test_force.py:2 cites NSF-eq66: not in docs/equations.toml; "
        "correct it, or list it there"]
    assert exists(toy, "mpm_ref/force.py::Grid::add")
    assert exists(toy, "scenes/cube.toml")
    assert not exists(toy, "mpm_ref/force.py::Grid::subtract")
    assert not exists(toy, "mpm_ref/gone.py")


def test_what_a_milestone_lacks_is_named(toy):
    entries = {"NSF-eq6": Entry("A", "a"), "NSF-eq8": Entry("A", "b"), "NSF-eq9": Entry("E", "c")}
    assert equations.uncarried(Source(entries, {}, []), equations.scan(toy), "A") == [
        "NSF-eq6 is cited by no test", "NSF-eq8 is cited by no code and no test"]


def test_a_citation_counts_for_the_id_that_says_the_same(toy):
    pair = {"NSF-eq6": Entry("A", "force"), "NSF-F9": Entry("A", "the same", same_as="NSF-eq6")}
    carried = equations.scan(toy).carried
    assert equations.covered(Source(pair, {}, []), carried) == {"NSF-eq6", "NSF-F9"}


def test_same_as_names_an_id(source):
    assert {e.same_as for e in source.entries.values()} - {""} <= source.entries.keys()


def test_a_malformed_entry_is_refused_by_name():
    with pytest.raises(ValueError, match=r"NSF-eq1: Invalid enum value 'F'"):
        equations.entry_of("NSF-eq1", {"by": "F", "says": "text"})


def test_a_row_shows_links_or_who_will_bring_it():
    source = Source({"HOT-eq1": Entry("B", "E(dv)")}, {"B": "B: HOT"}, [])
    assert "HOT-eq1 | E(dv) | B: HOT |  |" in equations.render(source, Citations([], []))
