"""The report, the figures in it, and the status table, from toy results."""

import io
import re
from collections import Counter
from types import SimpleNamespace
from uuid import uuid4

import numpy as np
import pytest
from PIL import Image

from figures.frame import Drawn, draw_all
from validation import ProfileResults
from validation.common.registry import Experiment
from validation.common.report import chapters, preview, status_table, write_report
from validation.common.results import RESULTS, ROOT
from validation.common.run import RunSetting, run_all
from validation.common.summary import counted
from validation.common.targets import Cause, Choice, Headline, Target, TargetFile, Targets, load


def target(id, kind="error", **fields):
    fields = {"what": f"the {id.split('.')[-1]}", "confidence": "exact", **fields}
    return Target(id=id, value=1.2, unit="%", paper_ref="Table 1", kind=kind, comparator="<=",
                  **fields)


TARGETS = Targets({t.id: t for t in (
    target("nsf.table1.bread"), target("nsf.table1.cake", confidence="ocr-uncertain"),
    target("nsf.table1.jelly", what="a <b> & c | d"), target("nsf.table1.dt", kind="setting"),
    target("nsf.printed.dt", kind="setting"))})

FIGURE = '''"""Error of the {name} over cells."""

from matplotlib.figure import Figure

NEEDS = ["nsf.{name}"]


def draw(results):
    figure = Figure()
    table = results.table("nsf.{name}", "errors")
    figure.add_subplot().loglog(table["n"], table["error"])
    return figure
'''


def bread(run):
    run.record("nsf.table1.bread", 1.0, scale="1/10 of the particles")
    run.record("nsf.table1.cake", 3.4567, note="the coarse grid <locks>")
    run.record("nsf.table1.jelly.modes", 1.0)
    run.record("nsf.bread.own_number", 7.0, comparator="band", bound=(6, 8), unit="m")
    run.table("errors", ["n", "error"], [(16, 1e-3), (32, 2.5e-4)])


def long_table(run):
    run.table("long", ["n"], [(k,) for k in range(1000)])


@pytest.fixture
def folder(tmp_path):
    """Results of a toy experiment."""
    toys = [Experiment(f"nsf.{f.__name__}", "Bread of NSF", ("quick",), {}, f)
            for f in (bread, long_table)]
    setting = RunSetting("quick", tmp_path / "quick", targets=TARGETS, commit="abc")
    assert run_all(toys, setting) == []
    return tmp_path / "quick"


def text(folder, name, targets=TARGETS):
    write_report(folder, "quick", targets)
    return (folder / name).read_text(encoding="utf-8")


def test_chapter_counts(folder):
    chapter, = chapters(ProfileResults(folder), TARGETS)
    assert chapter.printed == {"pass": 1, "miss": 1, "other": 1}
    assert chapter.counts == {"result": {"pass": 1, "miss": 1}, "setting": {},
                              "variant": {"pass": 1}, "own": {"pass": 1}}
    assert [t.id for t in chapter.missing] == ["nsf.table1.jelly"]
    assert [t.id for t in chapter.settings] == ["nsf.table1.dt"]
    assert chapter.overruled == 1


def test_a_number_that_repeats_another_is_told_beside_it(folder):
    """And neither counts nor is missing."""
    more = {t.id: t for t in (
        target("nsf.bread.again", again="nsf.table1.bread"), target("nsf.jelly.again",
                                                                    again="nsf.table1.jelly"))}
    chapter, = chapters(ProfileResults(folder), Targets({**TARGETS, **more}))
    assert chapter.printed == {"pass": 1, "miss": 1, "other": 1}
    assert [t.id for t in chapter.missing] == ["nsf.table1.jelly"]
    words = [row.what for section in chapter.sections for row in section.rows]
    assert "the bread (Table 1; Table 1: 1.2 %)" in words
    assert "the cake (Table 1)" in words


def test_printed_number_counts_for_its_paper(tmp_path):
    def other(run):
        run.record("nsf.table1.bread", 1.0)
        run.record("trade.other.time", 1.0, comparator="info", unit="s")

    setting = RunSetting("quick", tmp_path, targets=TARGETS)
    run_all([Experiment("trade.other", "Cost", ("quick",), {}, other)], setting)
    trade, nsf = chapters(ProfileResults(tmp_path), TARGETS)
    assert (trade.counts["own"], nsf.counts["result"]) == ({"info": 1}, {"pass": 1})
    assert "nsf.table1.bread" not in [t.id for t in nsf.missing]


def test_markdown_is_a_summary(folder):
    """Counts, missed results with their causes, and a line for each experiment."""
    cause = Cause(["nsf.table1.cake"], "The grid is too coarse")
    claim = Headline("Bread and cake are accurate", ["nsf.table1.bread", "nsf.table1.cake"])
    more = TargetFile("nsf", [], cause=[cause], headline=[claim])
    page = text(folder, "report.md", Targets(TARGETS, [more]))
    assert "[NSF: neural stress fields](#nsf) | 3 | 1 | 0 | 1 | 0 | 0 | 0 | 1 | 0 |" in page
    assert "\n| NSF: neural stress fields | 0 | 0 | 0 | 0 | 0 | 0 | 1 |\n" in page
    assert ("| Bread and cake are accurate | 1 reproduced, 1 missed | 0.83 to 2.9 |") in page
    assert ("| [the cake (Table 1)](nsf.bread.json) | 1.2 % (ocr-uncertain); ≤ 1.2 | 3.457 % | "
            "2.88 | The grid is too coarse |") in page
    assert "the bread (Table 1)" not in page
    assert ("| [nsf.bread](nsf.bread.json) | printed: 1 pass, 1 miss; by another method: 1 pass; "
            "our checks: 1 pass |  | [errors](nsf.bread.errors.csv) |") in page
    assert "1 printed result has no record of the paper's own method." in page


def test_a_number_without_credit_is_no_time_on_another_machine():
    rows = [SimpleNamespace(verdict=verdict) for verdict in ("uncredited", "info", "miss")]
    assert counted(rows) == "1 as printed, without credit, 1 another machine, 1 missed"


def test_markdown_marks_a_cause_that_is_not_certain(folder):
    more = TargetFile("nsf", [], cause=[Cause(["nsf.table1.cake"], "Perhaps", certain=False)])
    assert "2.88 | not certain: Perhaps |" in text(folder, "report.md", Targets(TARGETS, [more]))


def test_markdown_lists_what_was_chosen_on_its_own_runs(folder):
    more = TargetFile("nsf", [], chosen=[Choice(["nsf.table1.bread"], "cells of the tests")])
    page = text(folder, "report.md", Targets(TARGETS, [more]))
    assert "| [the bread (Table 1)](nsf.bread.json) | 1.2 %" in page
    assert "| cells of the tests |" in page
    assert "Chosen on the runs" not in text(folder, "report.md")


def test_markdown_counts_the_records_that_are_marked_as_not_current(folder):
    (folder.parent / "stale.toml").write_text(
        '[[marker]]\nprofile = "quick"\nids = ["nsf.bread", "nsf.long_table"]\nreason = "old"\n')
    assert "2 experiments with verdicts have records of an earlier source" in text(
        folder, "report.md")


def test_markdown_names_a_miss_without_a_cause(folder):
    assert "3.457 % | 2.88 | not known |" in text(folder, "report.md")


def test_html_has_the_same_and_escapes(folder):
    said = text(folder, "report.html")
    for part in ("the bread (Table 1)", "0.833", "Bread of NSF", "own number",
                 '<span class="miss">miss</span>', "commit abc",
                 "the coarse grid &lt;locks&gt;", "a &lt;b&gt; &amp; c | d", "<td>0.00025</td>"):
        assert part in said, part
    assert not re.search(r'(src|href)="https?:', said), "the report must stand alone"


@pytest.mark.parametrize(("target", "said"), [
    ("hot.map.body.nu0.45.E1e5.lbfgs-h", "body, nu0.45, E1e5, lbfgs-h"),
    ("hot.map.cheapest.0.003", "cheapest, 0.003"),
    ("hot.map.admm.penalty-0.1.end_error", "admm, penalty-0.1, end error"),
    ("hot.map.a0.5.n8", "a0.5, n8"),
    ("hot.map.mls.2.1.mean", "mls, 2, 1, mean"),
    ("hot.map.disk2.2d.E1e5.time", "disk2, 2d, E1e5, time"),
])
def test_words_of_an_id_are_parted_at_dots_but_not_at_decimal_points(tmp_path, target, said):
    def numbers(run):
        run.record(target, 1.0, comparator="info")

    run_all([Experiment("hot.map", "", ("quick",), {}, numbers)], RunSetting("quick", tmp_path))
    section, = chapters(ProfileResults(tmp_path), Targets({}))[0].sections
    assert [row.what for row in section.rows] == [said]


def test_no_two_printed_numbers_read_alike():
    """The report shows a number's text and its place, not its id."""
    said = Counter((t.id.split(".")[0], t.what, t.paper_ref) for t in load().values())
    assert not [text for text, times in said.items() if times > 1]


def test_long_table_is_linked_not_shown(folder):
    assert '<a href="nsf.long_table.long.csv">long</a>: 1000 rows' in text(folder, "report.html")


def test_report_without_results_lists_what_is_missing(tmp_path):
    said = text(tmp_path / "quick", "report.md", load())
    assert "0 experiments" in said
    assert said.count("have no record of the paper's own method") == 5


@pytest.fixture
def scripts(tmp_path, monkeypatch):
    """A package of figure scripts with a name of its own."""
    package = tmp_path / f"drawn_{uuid4().hex}"
    (package / "nsf").mkdir(parents=True)
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("bread", "unmade"):
        (package / "nsf" / f"{name}.py").write_text(FIGURE.format(name=name))
    return package


def test_figure_is_drawn_and_shown_under_its_experiment(folder, scripts):
    drawn = draw_all(ProfileResults(folder), folder=scripts)
    assert drawn == Drawn(["nsf_bread"], ["nsf_unmade"], [])
    names = sorted(f.name for f in (folder / "figures").iterdir())
    assert names == ["nsf_bread.pdf", "nsf_bread.png"]
    section = chapters(ProfileResults(folder), TARGETS)[0].sections[0]
    assert section.figures[0].caption == "Error of the bread over cells."
    page = text(folder, "report.html")
    assert '<a href="figures/nsf_bread.png"><img src="data:image/webp;base64,UklGR' in page
    assert "| [nsf_bread](figures/nsf_bread.png) |" in text(folder, "report.md")


def test_preview_of_a_large_figure_is_small_and_keeps_its_shape():
    noise = np.random.default_rng(0).integers(0, 255, (600, 1920, 3), dtype=np.uint8)
    with Image.open(io.BytesIO(preview(Image.fromarray(noise)))) as image:
        assert (image.format, image.size) == ("WEBP", (960, 300))
    with Image.open(io.BytesIO(preview(Image.new("RGBA", (300, 200))))) as image:
        assert image.size == (300, 200)


def test_rows_carry_what_the_filter_reads(folder):
    page = text(folder, "report.html")
    assert '<div class="chapter" data-group="nsf">' in page
    assert '<option value="nsf">NSF</option>' in page
    assert Counter(re.findall(r'<tr data-verdict="(\w+)">', page)) == {"pass": 3, "miss": 1}
    assert '<a href="#nsf.bread">nsf.bread</a>' in page


def test_figure_is_drawn_again_with_the_same_bytes(folder, scripts):
    def drawn():
        draw_all(ProfileResults(folder), folder=scripts)
        return {f.name: f.read_bytes() for f in (folder / "figures").iterdir()}

    first = drawn()
    assert b"CreationDate" not in first["nsf_bread.pdf"]
    assert drawn() == first


def test_figure_that_raises_is_named(folder, scripts, capsys):
    script = FIGURE.format(name="bread").replace("Figure()", "1 / 0")
    (scripts / "nsf" / "bad.py").write_text(script)
    assert draw_all(ProfileResults(folder), folder=scripts).failed == ["nsf_bad"]
    assert (folder / "figures" / "nsf_bread.png").exists()
    assert "ZeroDivisionError" in capsys.readouterr().err


def test_figures_about_other_experiments_are_left(folder, scripts):
    drawn = draw_all(ProfileResults(folder), about=["nsf.long_table"], folder=scripts)
    assert drawn == Drawn([], [], [])
    assert not (folder / "figures").exists()


def test_figure_without_results_is_left_out_and_says_why(folder, scripts, capsys):
    drawn = draw_all(ProfileResults(folder), names=["nsf_unmade"], folder=scripts)
    assert drawn.left == ["nsf_unmade"]
    assert "figure nsf_unmade is left out: no results of nsf.unmade" in capsys.readouterr().err


def test_figure_answers_to_its_experiment(folder, scripts):
    (scripts / "nsf" / "butter.py").write_text(FIGURE.format(name="bread"))
    drawn = draw_all(ProfileResults(folder), names=["nsf_bread", "nsf.bread"], folder=scripts)
    assert drawn.done == ["nsf_bread", "nsf_butter"]


def test_unknown_figure_is_refused(folder, scripts):
    with pytest.raises(ValueError, match="no figure 'cake'; there are: nsf_bread, nsf_unmade"):
        draw_all(ProfileResults(folder), names=["cake"], folder=scripts)


def test_status_table(folder):
    assert status_table(ProfileResults(folder), TARGETS).splitlines()[2:] == [
        "| NSF | 3 | 1 | 0 | 1 | 0 | 0 | 0 | 1 | 0 |"]


def test_the_readme_has_the_counts_of_the_published_records():
    """Of each paper: printed results, and how many are reproduced, better, missed, not compared."""
    told = [[int(cell) for cell in row.split("|")[2:7]] for row in
            (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
            if row.endswith(".md) |") and "docs/results" in row]
    found = {c.key: c.printed for c in chapters(ProfileResults(RESULTS / "standard"), load())}
    papers = [found[key] for key in ("hot", "ldm", "ldmw", "nsf", "nclaw")]
    assert told == [[sum(p.values()), p["pass"], p["better"], p["miss"],
                     sum(p[state] for state in ("chosen", "uncredited", "info", "other", "absent"))]
                    for p in papers]
