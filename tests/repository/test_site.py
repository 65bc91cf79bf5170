"""The parts of the documentation site that need no Sphinx: pages, docstrings, links."""

import re
import sys

import pytest

from validation.common import change_table
from validation.common.change_table import ReasonFile
from validation.common.citations import ROOT, documentation, exists
from validation.common.compare import ChangedRecord
from validation.common.targets import load
from validation.common.verdicts import VARIANTS

sys.path.insert(0, str(ROOT / "docs"))

from check_links import main as check
from extensions import atlas, change_page, docstrings, generate, packages, results

SOURCE = re.compile(r"\{source\}`(?:[^`<]*<)?([^`>]+)>?`")


def test_sources_that_pages_link_to_exist():
    links = [(page.name, m[1]) for page in documentation()
             for m in SOURCE.finditer(page.read_text(encoding="utf-8"))]
    assert len(links) > 10
    assert not [link for link in links if not exists(ROOT, link[1])]


def test_every_module_has_a_page_and_every_package_leads_to_its_modules():
    pages = generate.api_pages()
    assert ".. automodule:: mpm_ref.core.transfer" in pages[
        "reference/api/mpm_ref.core.transfer.rst"]
    assert "\n   mpm_ref.core.transfer\n" in pages["reference/api/mpm_ref.core.rst"]
    assert "(mpm_ref.core.transfer.rst)" in pages["reference/api/index.md"]


def test_the_command_line_page_has_every_command():
    page = generate.cli_page()
    for command in ("run", "info", "oracle record", "rom train", "law export"):
        assert f"`mpm-ref {command}`" in page
    assert not [line for line in page.splitlines() if line.endswith(("…", "..."))
                and line.startswith("* `")]


@pytest.fixture(scope="module")
def result_pages():
    return results.pages()


def test_results_show_printed_and_measured_numbers(result_pages):
    for paper in results.PAPERS:
        page = result_pages[f"results/numbers/{paper}.md"]
        assert page.count("| pass |") + page.count("| miss |") > 10
        assert "| converged |" not in page


def test_every_experiment_has_a_title_a_link_to_its_numbers_and_its_code(result_pages):
    table = result_pages["results/generated/experiments.md"]
    for experiment, (page, name) in results.experiment_places().items():
        assert f"](#{name})" in table
        assert name == f"numbers.{experiment}"
        assert f"({name})=" in result_pages[f"{page}.md"]
    links = SOURCE.findall(table)
    assert len(links) > 100
    assert not [link for link in links if not exists(ROOT, link)]


def test_the_atlas_has_every_extreme_once_with_its_worst_verdict(result_pages):
    page = result_pages["results/generated/atlas.md"]
    names = [name for name in results.experiment_places() if name.startswith("extremes.")]
    listed = [f"extremes.{name}" for ids in atlas.KINDS.values() for name in ids]
    assert sorted(listed) == sorted(names)
    for name in names:
        assert page.count(f"](#numbers.{name}):") == 1
    assert ('<span class="atlas-pass">[Multiples of the stable time step]'
            "(#numbers.extremes.explicit.cfl_ladder): 12 pass</span>") in page
    assert page.count('"atlas-miss"') == sum(
        any(row.verdict == "miss" for row in one.rows) for one in results.shown_experiments()
        if one.section.id.startswith("extremes.") and one.profile == "standard")
    css = (ROOT / "docs/_static/site.css").read_text(encoding="utf-8")
    for kind in ("pass", "miss", "info"):
        assert f"span.atlas-{kind} {{" in css
        assert f'"atlas-{kind}"' in page


def test_settings_for_one_per_cent_come_from_the_records(result_pages):
    tables = {name: result_pages[f"results/generated/settings-{name}.md"]
              for name in ("explicit", "implicit", "implicit-runs", "ldm", "nsf", "nclaw")}
    assert re.search(r"\| grid \| 64 cells \| \*\*0\.15 %\*\* \| [\d.]+ \| \*\*0\.75 %\*\* \| ",
                     tables["explicit"])
    assert "c dt/dx = 1.2; above the stable step" in tables["explicit"]
    assert "on the cantilever: 96 cells" in tables["explicit"]
    assert "with at most 1 % on the manufactured solution: 16 cells" in tables["explicit"]
    assert re.search(r"\| bar, middle of 1e9 Pa \| 1e-8, [\d.]+ s \| not run \| 1e-8, [\d.]+ s \|",
                     tables["implicit"])
    assert re.search(r"\| the displacement \| modes \| \d \| all \| 1 dt \| \*\*0\.\d+ %\*\*",
                     tables["ldm"])
    assert "| metal | random | 200 | 0.13 % |" in tables["nsf"]
    assert "**0.73 %**" in tables["nclaw"]


def test_maps_of_packages_link_to_the_code():
    page = packages.pages()["reference/packages/hot.md"]
    assert "<mpm_ref/hot/multigrid/hierarchy.py::v_cycle>`" in page
    assert "(../../howto/implicit-steps.md)" in page
    for text in packages.pages().values():
        links = SOURCE.findall(text)
        assert len(links) > 10
        assert not [link for link in links if not exists(ROOT, link)]


def test_links_in_the_readmes_of_packages_lead_to_files_and_to_pages():
    for name in packages.MAPS:
        folder = ROOT / "mpm_ref" / name
        links = re.findall(r"\]\(([^)]+)\)", (folder / "README.md").read_text(encoding="utf-8"))
        assert len(links) > 10
        assert not [link for link in links if not (folder / link).is_file()]
        page = packages.pages()[f"reference/packages/{name}.md"]
        assert ".py)" not in page
        assert "../docs/" not in page


def test_ids_of_equations_become_links():
    pytest.importorskip("sphinx")
    from docutils import nodes
    from extensions.cross_links import linked
    parts = linked(nodes.Text("by HOT-eq1 alone"), "equations.html#")
    assert [part.astext() for part in parts] == ["by ", "HOT-eq1", " alone"]
    assert parts[1]["refuri"] == "equations.html#HOT-eq1"


def test_formulas_keep_their_lines_and_signs():
    text = docstrings.to_rest("Sums.\n\nm_i += sum_p w_ip m_p\nv_i = p_i/m_i * 2  # NSF-eq6")
    assert text.split("\n\n")[:3] == [
        "Sums.", "::", "   m_i += sum_p w_ip m_p\n   v_i = p_i/m_i * 2  # NSF-eq6"]


def test_text_is_escaped_and_code_is_marked():
    assert docstrings.to_rest("Weights w_ip of `dx`, |v| * 2.").strip() == (
        "Weights w\\_ip of \\ ``dx``\\ , \\|v\\| \\* 2.")


def test_lists_become_lists():
    assert docstrings.to_rest("- one\n  more\n- two").split() == ["-", "one", "more", "-", "two"]


def test_fields_are_listed_with_their_comments():
    from mpm_ref.core.state import Particles
    names = [name for name, _, comment in docstrings.fields(Particles) if comment]
    assert names[:2] == ["x", "v"]


@pytest.fixture
def site(tmp_path):
    """A page with a dead link, a dead anchor and an address of another host."""
    (tmp_path / "a.html").write_text('<h1 id="top"></h1><a href="b.html">b</a>'
                                     '<a href="#top">top</a><a href="https://x.org">x</a>')
    return tmp_path


def test_links_that_lead_somewhere_pass(site):
    (site / "b.html").write_text("<p>")
    assert not check(site)


@pytest.mark.parametrize(("addition", "problem"), [
    ('<a href="c.html">c</a>', "c.html: no such file"),
    ('<a href="a.html#none">c</a>', "no such anchor"),
    ('<script src="https://x.org/a.js"></script>', "fetches https://x.org/a.js"),
    ('<link rel="stylesheet" href="//x.org/a.css">', "fetches //x.org/a.css"),
])
def test_dead_links_and_requests_are_named(site, capsys, addition, problem):
    (site / "b.html").write_text(addition)
    assert check(site)
    assert problem in capsys.readouterr().out


# Verdicts on pages

def test_every_headline_and_every_miss_stands_on_a_page(result_pages):
    numbers = load()
    page = result_pages["results/generated/headlines.md"]
    assert page.count("\n| ") - page.count("\n| claim") - page.count("\n| word |") == sum(
        map(len, numbers.headlines.values())) + len(VARIANTS)
    rows = [row for one in results.shown_experiments() for row in one.rows
            if row.verdict == "miss" and row.kind != "own"]
    misses = result_pages["results/generated/misses.md"]
    assert misses.count("](#numbers.") >= len(rows) > 100
    assert "cause not known" not in misses


def test_printed_results_settings_and_our_own_numbers_are_on_pages_of_their_own(result_pages):
    assert "| miss |" in result_pages["results/numbers/hot.md"]
    for one in results.shown_experiments():
        kinds = {row.kind for row in one.rows}
        if one.page in results.PAPERS:
            assert kinds <= {"result", "variant"}
        elif one.page.endswith("-settings"):
            assert kinds == {"setting"}
        elif one.page.endswith("-more"):
            assert kinds == {"own"}


def test_links_to_numbers_lead_to_places_that_exist(result_pages):
    text = "\n".join(page for page in result_pages.values() if isinstance(page, str))
    places = re.findall(r"^\((numbers[^)]*)\)=", text, re.MULTILINE)
    assert len(places) == len(set(places))
    assert set(re.findall(r"\(#(numbers[^)]*)\)", text)) <= set(places)


def test_the_page_of_changes_has_the_reason_of_each_worse_verdict(result_pages):
    page = result_pages["results/generated/changes.md"]
    row, = [line for line in page.splitlines() if "`ldm.fig16.realtime`" in line]
    assert "| pass → miss | Before, options that the paper does not have were judged" in row
    assert page.count("→ miss | ") == sum(
        one.kind == "worse" and one.verdicts[1] == "miss" for one in change_table.read())
    assert "| not known |" not in page


def test_new_numbers_are_counted_by_verdict_and_a_verdict_that_is_missing_has_a_word():
    rows = [ChangedRecord("worse", "a", "a", (None, None), 0.0, (None, "miss"), (None, "b")),
            *(ChangedRecord("new", "a", f"a.{k}", (None, 1.0), 0.0, (None, word), (None, "b"))
              for k, word in enumerate(("miss", "pass", "miss")))]
    text = "\n".join(change_page.lines(rows, ReasonFile("abc")))
    assert "| 3 | new numbers: 2 miss, 1 pass |" in text
    assert "| none → miss | not known |" in text
