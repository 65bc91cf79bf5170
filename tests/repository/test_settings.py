"""The advice of "Choose settings" is computed from records: it names no unstable setting, none
below the error of the reference, and none that helps on one scene by chance.
"""

import sys

import pytest

from validation.common.citations import ROOT
from validation.common.results import RESULTS, ProfileResults

sys.path.insert(0, str(ROOT / "docs"))

from extensions import settings


def row(knob, error, cpu, of_bound=0.6, **choice):
    """A row of a table of explicit settings."""
    values = {"transfer": "mls", "flip": 1.0, "degree": 2, "cells": 16, "per": 2,
              "sampling": "lattice", "cfl": 0.5, "storage": "f64"}
    return {"knob": knob, "error": error, "cpu": cpu, "of_bound": of_bound, **values, **choice}


def scenes(*mine, others=()):
    """Rows of a scene, with a default, and of another one."""
    default = row("default", 0.05, 1.0)
    return {"mine": [default, *mine], "other": [row("default", 0.02, 1.0), *others]}


FINE, FLIP = {"cells": 32}, {"transfer": "flip", "flip": 0.95}


def test_the_cheapest_setting_that_keeps_the_limit_is_advised():
    points = scenes(row("dx", 0.005, 3.0, **FINE), row("dx", 0.001, 9.0, cells=64),
                    others=[row("dx", 0.01, 3.0, **FINE), row("dx", 0.01, 3.0, cells=64)])
    assert settings.advised(points, "mine", 0.0)["cells"] == 32


def test_of_settings_as_cheap_the_most_accurate_is_advised():
    """Times of one machine differ by some per cent from run to run."""
    points = scenes(row("dx", 0.008, 3.0, **FINE), row("dx", 0.001, 3.2, cells=64),
                    others=[row("dx", 0.01, 3.0, **FINE), row("dx", 0.01, 3.0, cells=64)])
    assert settings.advised(points, "mine", 0.0)["cells"] == 64


@pytest.mark.parametrize("fault", ["unstable", "reference", "elsewhere", "not tried elsewhere"])
def test_no_setting_of_a_fault_is_advised(fault):
    one = row("dx", 0.005, 3.0, 1.001 if fault == "unstable" else 0.6, **FINE)
    other = [] if fault == "not tried elsewhere" else [
        row("dx", 0.05 if fault == "elsewhere" else 0.01, 3.0, **FINE)]
    floor = 0.006 if fault == "reference" else 0.0
    assert settings.advised(scenes(one, others=other), "mine", floor) is None


def test_what_is_good_on_one_scene_by_chance_is_not_advised():
    points = scenes(row("transfer", 0.0025, 1.0, **FLIP),
                    others=[row("transfer", 0.1, 1.0, **FLIP)])
    assert settings.advised(points, "mine", 0.0) is None


def run(eps, kinetic, rms=0.001, cpu=1.0, converged="True", cells=0.0):
    """A row of a table of whole implicit runs."""
    return {"method": "hot", "eps": eps, "cells": cells, "kinetic": kinetic, "rms": rms, "cpu": cpu,
            "converged": converged}


def test_a_tolerance_is_advised_by_the_whole_run():
    answer = run(1e-12, 1.0)
    rows = [run(1e-7, 2.2), run(1e-8, 1.0, rms=0.1), run(1e-9, 1.001, cpu=4.0),
            run(1e-9, 1.0, cpu=3.0, converged="False"), run(1e-11, 1.0, cpu=9.0)]
    assert settings.advised_run(rows, answer, 0.0)["cpu"] == 4.0
    assert settings.advised_run(rows, answer, 0.0095)["cpu"] == 9.0
    assert settings.advised_run(rows[:2], answer, 0.0) is None


RECORDS = ProfileResults(RESULTS / "standard")


@pytest.mark.parametrize("scene", settings.SCENES)
def test_the_recorded_advice_is_stable_and_resolved(scene):
    name, floor = f"trade.explicit.{scene}", settings.reference_error(RECORDS, scene)
    points = settings.records(RECORDS, name, "points")
    best = settings.advised({one: settings.records(RECORDS, f"trade.explicit.{one}", "points")
                             for one in settings.SCENES}, scene, floor)
    assert best is None or best in points
    assert best is None or (best["of_bound"] <= 1.0 and best["error"] + floor <= settings.LIMIT)


def test_hot_at_the_printed_tolerance_is_no_advice():
    text = "\n".join(settings.implicit_runs(RECORDS))
    assert "| hot | `eps = 1e-7` | 122 % |" in text
    assert "| hot | `displacement_tolerance = 0.01`" not in text or "**" in text
    rows = [line for line in text.splitlines() if line.startswith("| hot |")]
    assert len(rows) == 2
    assert "**" in rows[1]
