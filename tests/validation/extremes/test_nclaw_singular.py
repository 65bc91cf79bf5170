"""What learned laws answer to degenerate and inverted F, and the judge of it."""

import numpy as np
import pytest
from neural_toys import UNIT
from neural_toys import trained as law
from small_toys import Records

from mpm_ref.materials.learned import network, response
from mpm_ref.nclaw.bodies import body_maker
from mpm_ref.scene import build
from validation.extremes import nclaw_singular as singular
from validation.nclaw.environments import environment
from validation.nclaw.trained_laws import trained


@pytest.fixture(scope="module")
def jelly():
    """(law, flow) of jelly's weights."""
    body = body_maker(trained("jelly"))(build(environment("jelly")).bodies[0])
    return body.law, body.flow


def test_kinds_are_what_they_are_called(rng):
    for name, s in singular.KINDS.items():
        F = singular.random_gradients(s, rng)
        J = np.linalg.det(F)
        assert np.linalg.svd(F)[1] == pytest.approx(np.abs(np.array([s] * len(F))), abs=1e-9 *
                                                    (1.0 + max(s)))
        assert (J < -1e-3).all() == ("inverted" in name or name == "mirrored")
    undetermined = {name for name, s in singular.KINDS.items()
                    if not singular.polar_is_determined(singular.random_gradients(s, rng))}
    assert undetermined == {"a line", "a point", "all inverted"}


@pytest.mark.parametrize("name", [name for name in singular.KINDS
                                  if name not in ("a line", "a point", "all inverted")])
def test_answers_are_finite_and_turn_with_the_body(jelly, rng, name):
    F = singular.random_gradients(singular.KINDS[name], rng)
    answers = singular.evaluate_laws(jelly, F)
    assert all(np.isfinite(a).all() for a in answers)
    assert max(singular.rotation_error(jelly, F, rng)) < singular.EQUAL_WITHIN


def test_answers_that_do_not_turn_are_noticed(jelly, rng):
    """Those of a network that reads F as it is; and all of them where R is anything."""
    plain = network.build_law(law(response.PlainStress(UNIT), 3))
    F = singular.random_gradients((1.1, 1.0, 0.9), rng)
    assert max(singular.rotation_error(jelly, F, rng)) < singular.EQUAL_WITHIN
    assert singular.rotation_error((plain, jelly[1]), F, rng)[0] > 1e-3
    line = singular.random_gradients(singular.KINDS["a line"], rng)
    assert max(singular.rotation_error(jelly, line, rng)) > 1e-3


def test_differences_are_of_the_answer_or_the_unit():
    one = np.diag([2.0, 0.0, 0.0])[None]
    assert singular.relative_difference(1.5 * one, one, 1.0) == pytest.approx(0.5)
    assert singular.relative_difference(1.5 * one, one, 10.0) == pytest.approx(0.1)
    assert singular.relative_difference(np.nan * one, one, 1.0) == np.inf


def test_records_of_answers_name_the_worst():
    sound = dict.fromkeys(singular.COLUMNS[2:], 0.0) | {"determined": 1, "finite": 1}
    found = {"rest": sound, "flat": {**sound, "finite": 0, "turns": 0.1, "beyond": np.inf,
                                     "stress": 7.0, "true_stress": 3.0},
             "a line": {**sound, "determined": 0, "returned_turns": 0.5}}
    records = Records()
    singular.record_answers(records, "jelly", found)
    name = "extremes.nclaw.singular.jelly"
    assert records[f"{name}.finite"] == (pytest.approx(2.0 / 3.0), "share of kinds; not: flat")
    assert records[f"{name}.turns"][0] == 0.1
    assert records[f"{name}.turns"][1].endswith("over the latter: flat")
    assert records[f"{name}.turns_undetermined"][0] == 0.5
    assert records[f"{name}.guesses"][0] == 1
    assert records[f"{name}.guesses"][1].endswith("stress is 7 Pa, the true one 3 Pa: flat")
