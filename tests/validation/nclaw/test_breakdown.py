"""The frame of a breakdown that a printed error implies, found again for a known breakdown."""

import numpy as np
import pytest

from mpm_ref.materials import Fluid, NoFlow
from validation.common.scenes import with_
from validation.nclaw.breakdown import agreeing, ends, errors_by_breakdown
from validation.nclaw.evaluate import body_with_laws, compare
from validation.nclaw.tasks import reconstruction


def wild(body):
    return body_with_laws(body, Fluid(1e15), NoFlow())


def test_a_run_that_breaks_down_has_the_error_of_its_frame():
    scene = with_(reconstruction("water"), steps=40)
    errors = errors_by_breakdown(scene)
    assert len(errors) == 9
    found, = compare(scene, [wild], goes_on=True)
    assert 0 < found.step <= 5
    assert found.error == pytest.approx(errors[1], rel=1e-3)


def test_frames_whose_error_rounds_to_the_printed_one():
    errors = np.array([0.3, 0.2449, 0.2351, 0.2349, 0.1])
    assert ends(agreeing(errors, 0.24)) == (1, 2)
    assert ends(agreeing(errors, 0.017)) == (None, None)
