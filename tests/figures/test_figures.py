"""What every figure script must have, and the words on scale that its picture carries."""

import importlib
import json

import matplotlib.pyplot as plt
import pytest
import typer
from matplotlib.transforms import Bbox
from typer.testing import CliRunner

from figures import __main__ as cli
from figures import frame
from figures.common.style import OTHERS, TRANSFERS, scales, shared_scale
from figures.frame import Drawn, draw_all, names
from validation.common.results import RESULTS, ProfileResults

SCALES = {"a.b.order": "8, dx = 0.1 m; twice", "a.b.end": "9, dx = 0.1 m"}
RECORDS = [{"target": target, "value": 1.0, "unit": "1", "paper": None, "comparator": "info",
            "verdict": "info", "scale": scale, "seconds": 1.0, "seed": 0, "command": "",
            "commit": "", "date": "", "cores": 1}
           for target, scale in SCALES.items()]
SCRIPT = '''"""A toy."""
from matplotlib.figure import Figure
NEEDS = ["a.b"]


def scale(results):
    return "8 cells"


def draw(results):
    return Figure(figsize=(6.4, 4.0))
'''


@pytest.fixture
def results(tmp_path):
    (tmp_path / "quick").mkdir()
    (tmp_path / "quick" / "a.b.json").write_text(json.dumps(RECORDS))
    return ProfileResults(tmp_path / "quick")


@pytest.mark.parametrize("name", names())
def test_script_is_whole(name):
    script = importlib.import_module("figures." + name.replace("_", ".", 1))
    assert script.__doc__
    assert script.NEEDS
    assert callable(script.draw)
    assert callable(script.scale), "every figure says at which scale its runs were made"


def test_picture_and_caption_carry_the_scale(results, tmp_path, monkeypatch):
    package = tmp_path / "toy_figures"
    (package / "hot").mkdir(parents=True)
    (package / "hot" / "toy.py").write_text(SCRIPT)
    monkeypatch.syspath_prepend(tmp_path)
    seen = []
    monkeypatch.setattr(frame, "_write", lambda figure, path, about: seen.append(
        (path.suffix, figure.texts[0].get_text(), about.get("Description"))))
    assert draw_all(results, folder=package) == Drawn(["hot_toy"], [], [])
    said = "Scale (quick): 8 cells."
    assert seen == [(".png", said, f"A toy. {said}"), (".pdf", said, None)]


def test_figure_that_is_too_wide_for_a_page_is_refused(results, tmp_path, monkeypatch, capsys):
    package = tmp_path / "wide_figures"
    (package / "hot").mkdir(parents=True)
    (package / "hot" / "toy.py").write_text(SCRIPT.replace("6.4, 4.0", "7.1, 4.0"))
    monkeypatch.syspath_prepend(tmp_path)
    assert draw_all(results, folder=package).failed == ["hot_toy"]
    assert "the figure is 7.1 inches wide; expected at most 7" in capsys.readouterr().err


def test_legend_outside_stays_above_the_note():
    """A tight bounding box moves legends that are anchored to the box of the figure."""
    figure, ax = plt.subplots(layout="constrained")
    ax.plot([1.0, 2.0], label="a")
    figure.legend(loc="outside lower center")
    figure.draw_without_rendering()
    frame._anchor_legends(figure)
    frame._sign(figure, "8 cells")
    before = figure.legends[0].get_window_extent().bounds
    figure.bbox = Bbox.from_bounds(0.0, -50.0, *figure.bbox.size)       # as printing does
    assert figure.legends[0].get_window_extent().bounds == pytest.approx(before)


@pytest.mark.parametrize("name", names())
def test_published_results_say_their_scale(name):
    """A sentence "Scale (standard): ." tells nothing."""
    script = importlib.import_module("figures." + name.replace("_", ".", 1))
    try:
        said = script.scale(ProfileResults(RESULTS / "standard"))
    except FileNotFoundError:
        pytest.skip("its results are not published")
    assert said.strip(" ;:,.")


def test_two_processes_draw_like_one(results, tmp_path, monkeypatch):
    package = tmp_path / "pair_of_figures"
    (package / "hot").mkdir(parents=True)
    for name, text in (("toy", SCRIPT), ("bad", SCRIPT.replace("return Figure(", "raise OSError(")),
                       ("gone", SCRIPT.replace("a.b", "c.d"))):
        (package / "hot" / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)       # a spawned process takes over sys.path
    drawn = [draw_all(results, folder=package, workers=workers) for workers in (1, 2)]
    assert drawn == [Drawn(["hot_toy"], ["hot_gone"], ["hot_bad"])] * 2
    assert (results.folder / "figures" / "hot_toy.pdf").is_file()


def test_scales_are_taken_from_the_records(results):
    assert scales(results, "a.b") == "8, dx = 0.1 m; 9, dx = 0.1 m"
    assert scales(results, "a.b", ".order") == "8, dx = 0.1 m"
    assert shared_scale(results, "a.b") == "dx = 0.1 m"


def test_no_colour_of_a_transfer_stands_for_anything_else():
    assert len(set(TRANSFERS.values())) == len(TRANSFERS)
    assert not set(TRANSFERS.values()) & set(OTHERS)


# The command line

@pytest.fixture
def invoke(tmp_path, monkeypatch):
    """Run the command line; each of its words is what becomes of a figure of that name."""
    app = typer.Typer()
    app.command()(cli.main)
    monkeypatch.setattr(cli, "draw_all", lambda results, names, workers: Drawn(
        *([n for n in names if n == word] for word in ("done", "left", "failed"))))
    return lambda *words: CliRunner().invoke(app, [*words, "--results", str(tmp_path)])


@pytest.mark.parametrize(("words", "code"), [
    ((), 0), (("done",), 0), (("done", "left"), 1), (("done", "failed"), 1)])
def test_named_figure_that_cannot_be_drawn_makes_exit_1(invoke, results, words, code):
    said = invoke(*words)
    assert said.exit_code == code
    assert said.output.count("drew ") == words.count("done")


def test_drawn_figure_says_where_it_is(invoke, results):
    assert str(results.folder / "figures" / "done.png") in invoke("done").output


def test_folder_without_results_is_refused(invoke, tmp_path):
    said = invoke("done")
    assert said.exit_code == 2
    assert said.output.startswith(f"no results in {tmp_path / 'quick'}")
    assert not (tmp_path / "quick").exists()
