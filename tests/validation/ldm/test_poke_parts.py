"""What a poke's reduced run is off by: while it is driven, and as it swings free."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.rom.fields.pod import modes
from mpm_ref.rom.study.dataset import simulate_snapshots
from mpm_ref.rom.study.errors import PositionErrors
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import ldm_run
from mpm_ref.scene import build
from validation.common.scenes import with_
from validation.ldm import poke_parts
from validation.ldm.paired_runs import ALL
from validation.ldm.poke_parts import Parts, parts, release_step, swinging_states
from validation.ldm.references import References
from validation.ldm.studies import POKES, poked

STEPS, DRIVEN = 5, 2


@pytest.fixture(scope="module")
def short():
    """`References` of a short poke, and its F."""
    base, poke = poked(0.3).fixed
    scene = with_(poked(0.3), steps=STEPS,
                  fixed=(base, with_(poke, until=DRIVEN * poked(0.3).dt)))
    run = simulate_snapshots([build(scene)], np.zeros((1, 1)), 1)
    return References("poke", (ldm_full_model(scene),), (run.x[0],), 1), run.F[0]


def own(short, r):
    """Modes of the run itself, and their coordinates at rest."""
    tests, F = short
    return modes(tests.X, tests.x[0], F, r), np.zeros(r)


def test_the_patch_lets_go_after_a_quarter_of_a_second():
    assert release_step(ldm_full_model(POKES.scene(0.0))) == 36


def test_the_patch_is_found_wherever_it_stands():
    scene = POKES.scene(0.0)
    base, poke = scene.fixed
    assert release_step(ldm_full_model(with_(scene, fixed=(poke, base)))) == 36
    for count, regions in ((0, (base,)), (2, (base, poke, with_(poke, name="other")))):
        with pytest.raises(ValueError, match=f"{count} prescribed regions let go: expected one"):
            release_step(ldm_full_model(with_(scene, fixed=regions)))


def test_no_part_is_off_on_modes_that_span_the_run(short):
    """Round-off is left: seen 2e-14."""
    found = parts(short[0], *own(short, STEPS), ALL)
    assert max(errors.displacement for errors in found) < 1e-12


def test_a_run_from_the_start_is_told_from_one_that_begins_later(short):
    tests, _ = short
    few = own(short, STEPS - 3)
    found, (x,) = parts(tests, *few, ALL), tests.x
    states = [few[0].place(tests.X, latent.xhat)
              for _, latent, *_ in ldm_run(tests.cases[0], *few[:1], ALL, few[1]).states()]
    later = list(swinging_states(tests.cases[0], *few, ALL, x))
    assert np.sum((states[DRIVEN] - x[DRIVEN]) ** 2) > np.sum((later[0] - x[DRIVEN]) ** 2)
    for errors, seen, true in ((found.total, states, x), (found.driven, states[:DRIVEN + 1], x),
                               (found.swinging, later, x[DRIVEN:])):
        pairs = list(zip(seen, true, strict=False))
        off = sum(np.sum((a - b) ** 2) for a, b in pairs)
        assert errors.origin == pytest.approx((off / sum(np.sum(b**2) for _, b in pairs)) ** 0.5)


def test_the_network_comes_first_and_alone_at_quick(monkeypatch):
    compared = poke_parts.maps()
    assert compared[0][0] == "network"
    assert [len(rest) for _, _, rest, _ in compared] == [6, *poke_parts.DIMENSIONS, 6]
    off = PositionErrors(0.1, 0.2, 0.3)
    monkeypatch.setattr(poke_parts, "parts", lambda *_: Parts(off, off, off))
    monkeypatch.setattr(poke_parts, "references", lambda *_: SimpleNamespace(scale=""))
    rows = []
    run = SimpleNamespace(choose=lambda quick, standard: quick, progress=lambda a, _: a,
                          record=lambda *_, **__: None,
                          table=lambda name, columns, found: rows.extend(found))
    poke_parts.by_part(run)
    assert [row[0] for row in rows] == 3 * ["network"]
