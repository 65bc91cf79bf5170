"""What every figure script must have, and the words on scale that its picture carries."""

import importlib
import json

import pytest

from figures import frame
from figures._orders import OTHERS, TRANSFERS, scales, shared
from figures.frame import draw_all, names
from validation.results import Results

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
    return Figure()
'''


@pytest.fixture
def results(tmp_path):
    (tmp_path / "quick").mkdir()
    (tmp_path / "quick" / "a.b.json").write_text(json.dumps(RECORDS))
    return Results(tmp_path / "quick")


@pytest.mark.parametrize("name", names())
def test_script_is_whole(name):
    script = importlib.import_module(f"figures.{name}")
    assert script.__doc__
    assert script.NEEDS
    assert callable(script.draw)
    assert callable(script.scale), "every figure says at which scale its runs were made"


def test_picture_and_caption_carry_the_scale(results, tmp_path, monkeypatch):
    package = tmp_path / "toy_figures"
    package.mkdir()
    (package / "toy.py").write_text(SCRIPT)
    monkeypatch.syspath_prepend(tmp_path)
    seen = []
    monkeypatch.setattr(frame, "_write", lambda figure, path, about: seen.append(
        (path.suffix, figure.texts[0].get_text(), about.get("Description"))))
    assert draw_all(results, folder=package) == []
    said = "Scale (quick): 8 cells."
    assert seen == [(".png", said, f"A toy. {said}"), (".pdf", said, None)]


def test_scales_are_taken_from_the_records(results):
    assert scales(results, "a.b") == "8, dx = 0.1 m; 9, dx = 0.1 m"
    assert scales(results, "a.b", ".order") == "8, dx = 0.1 m"
    assert shared(results, "a.b") == "dx = 0.1 m"


def test_no_colour_of_a_transfer_stands_for_anything_else():
    assert len(set(TRANSFERS.values())) == len(TRANSFERS)
    assert not set(TRANSFERS.values()) & set(OTHERS)
