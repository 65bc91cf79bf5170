"""The pages of the papers' figures and tables: none is forgotten, and nothing is named in vain."""

import re
import sys
from fnmatch import fnmatchcase

import pytest

from validation.common.citations import ROOT
from validation.common.targets import load

sys.path.insert(0, str(ROOT / "docs"))

from extensions import paper_figures, results
from extensions.markdown import cell

PRINTED = {         # figures and tables of each paper
    "hot": (20, 3), "ldm": (16, 6), "ldmw": (1, 3), "nsf": (18, 1), "nclaw": (8, 7)}
UNNUMBERED = {"nclaw": ["Inset of Section 4.7"]}
REFERENCE = re.compile(r"\b(Figures?|Tables?) (\d+)")


@pytest.fixture(scope="module")
def targets():
    return load()


@pytest.fixture(scope="module")
def site():
    return results.pages()


def page_of(site, paper, entry):
    return site[f"{paper_figures.FOLDER}/{paper_figures.page_name(paper, entry)}.md"]


def entries():
    return [(paper, entry) for paper in PRINTED for entry in paper_figures.read(paper)]


@pytest.mark.parametrize("paper", PRINTED)
def test_every_figure_and_table_of_a_paper_has_one_entry(paper):
    figures, tables = PRINTED[paper]
    expected = [*(f"Figure {k + 1}" for k in range(figures)),
                *(f"Table {k + 1}" for k in range(tables)), *UNNUMBERED.get(paper, ())]
    assert sorted(entry.place for entry in paper_figures.read(paper)) == sorted(expected)


def test_an_entry_names_experiments_and_patterns_of_numbers_that_exist(targets):
    declared = results.declared()
    for paper, entry in entries():
        assert {*entry.experiments} <= declared.keys(), (paper, entry.place)
        for pattern in entry.numbers:
            assert any(fnmatchcase(id, pattern) and id.startswith(f"{paper}.")
                       for id in targets), (paper, entry.place, pattern)


def test_an_entry_has_something_of_ours_or_says_why_not():
    for paper, entry in entries():
        assert bool(entry.experiments) != bool(entry.absent), (paper, entry.place)
        assert entry.drawn == [] or entry.experiments
        assert 1 <= entry.shows.count(". ") + 1 <= 6


def test_every_drawn_figure_of_a_paper_stands_on_a_page(site):
    shown = {name for _, entry in entries() for name in entry.drawn}
    drawn = {name for name in results.images() if name.split("_")[0] in PRINTED}
    assert drawn - shown == set()
    for paper, entry in entries():
        page = page_of(site, paper, entry)
        for name in entry.drawn:
            assert f"](../numbers/figures/standard/{name}.webp)" in page


def test_a_number_that_names_a_figure_stands_on_its_page(targets, site):
    by_place = {(paper, entry.place): page_of(site, paper, entry) for paper, entry in entries()}
    rows = {row.id: row for one in results.shown_experiments() for row in one.rows}
    checked = 0
    for target in targets.values():
        original = target.again or target.id
        for kind, k in REFERENCE.findall(target.paper_ref):
            page = by_place[target.id.split(".")[0], f"{kind.rstrip('s')} {k}"]
            if original in rows:
                assert f"[{cell(rows[original].what)}](#" in page, target.id
                checked += 1
    assert checked > 400


def test_a_missed_number_has_its_cause_on_the_page(targets, site):
    page = site[f"{paper_figures.FOLDER}/hot-figure-16.md"]
    assert "1 missed" in page
    assert cell(targets.cause("hot.fig16.admm_slowdown").text) in page


def test_an_entry_with_an_unknown_key_is_refused_by_name(tmp_path, monkeypatch):
    text = '[[entry]]\nplace = "Figure 1"\ntitle = "t"\nshows = "s"\nfigures = []\n'
    (tmp_path / "hot.toml").write_text(text)
    monkeypatch.setattr(paper_figures, "TEXTS", tmp_path)
    with pytest.raises(ValueError, match=r"hot\.toml: Object contains unknown field `figures`"):
        paper_figures.read("hot")
