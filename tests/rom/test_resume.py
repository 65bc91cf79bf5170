"""`mpm-ref rom run` that was cut off goes on, and is the run that was not, bit for bit."""

import json
import re
import shutil

import h5py
import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from small_studies import STEPS, ended, modelled, write

from mpm_ref.rom.study import record, reduce, resume
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.generate import one_thread
from mpm_ref.rom.study.run import RunOptions, ldm_run
from mpm_ref.rom.study.study import load
from mpm_ref.store import manifest
from mpm_ref.store.results import Results

WAYS = {"redrawn": "points = 12", "all": "",
        "evolved": 'points = 12\ndeformation_gradient = "evolved"',
        "kept": 'points = 12\nsamples = "kept"',
        "nonlinear": 'points = 12\nprojection = "nonlinear"\nvelocity = "difference"',
        "eulerian": 'points = 20\nquadrature = "eulerian"\nvelocity = "transported"'}

KILLED = (0, None, "not ended")         # first and last step of a part, and why it ended


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with a study, its runs and its map."""
    return modelled(tmp_path_factory.mktemp("made"))


@pytest.fixture
def reduced(made, tmp_path):
    """A function that makes a reduced run in some way with some options: what is answered."""
    def run(name, *options, way=WAYS["redrawn"], g=40):
        study = write(tmp_path, ("[map]", f"[run]\n{way}\n\n[map]"))
        return mpm_ref("rom", "run", study, "--map", made / "map.npz", "--out", tmp_path / name,
                       "--set", f"g={g}", *options)
    return run


@pytest.fixture
def cut(reduced, monkeypatch):
    """A function that interrupts such a run while it writes a frame."""
    def run(name, step, *options, **how):
        show = record._show

        def interrupted(writer, state, problem):
            if state.step == step:
                writer.h5["time"].resize(step + 1, axis=0)
                raise KeyboardInterrupt
            show(writer, state, problem)

        with monkeypatch.context() as patch:
            patch.setattr(record, "_show", interrupted)
            return reduced(name, *options, **how)
    return run


def content(path):
    """{name: bytes} of all that a results file has of a run's states."""
    found = {}
    with h5py.File(path) as h5:
        h5.visititems(lambda name, item: found.update(
            {name: item[()].tobytes()} if hasattr(item, "shape") and name != "manifest" else {}))
    return found


def parts(path):
    with Results(path) as results:
        return [(part["first_step"], part.get("last_step"), part["why"])
                for part in results.manifest["parts"]]


def last_state(path):
    with Results(path) as results:
        return results.manifest["parts"][-1]["state_sha256"]


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS.keys())
def test_a_run_that_was_cut_off_twice_is_the_whole_one(reduced, cut, tmp_path, way):
    whole = reduced("whole.h5", "--json", way=way)
    assert whole.exit_code == 0, whole.output
    for step in (4, 6):
        assert_told_last(cut("cut.h5", step, way=way),
                         f"interrupted at step {step - 1} of {STEPS}; the same command again goes")
        assert ended(tmp_path / "cut.h5") == ("interrupted", step)
    done = reduced("cut.h5", "--json", way=way)
    assert done.exit_code == 0, done.output
    assert parts(tmp_path / "cut.h5") == [
        (0, 3, "interrupted"), (3, 5, "interrupted"), (5, STEPS, "finished")]
    assert content(tmp_path / "cut.h5") == content(tmp_path / "whole.h5")
    assert last_state(tmp_path / "cut.h5") == last_state(tmp_path / "whole.h5")
    found, expected = (json.loads(one.stdout)["out_of_bounds"] for one in (done, whole))
    assert found == expected
    assert min(map(int, found)) < 6             # one of those that were known
    assert done.stderr == whole.stderr
    assert_told_last(reduced("cut.h5", way=way), "exists: add --overwrite")


def test_a_run_that_replaced_another_goes_on_without_the_option(reduced, cut):
    assert reduced("run.h5").exit_code == 0
    assert_told_last(cut("run.h5", 3, "--overwrite"),
                     "at step 2 of 8; the same command without --overwrite goes on")
    assert reduced("run.h5").exit_code == 0


def assert_told_last(done, words):
    """That a command ended with a sentence, whatever it warned of before."""
    assert done.exit_code != 0
    assert words in done.stderr.splitlines()[-1]


def test_what_is_known_of_a_file_are_the_states_of_its_run(made, reduced, tmp_path):
    assert reduced("run.h5", g=2.5).exit_code == 0
    bars = load(tmp_path / "bars.toml")
    model, one = reduce.load(made / "map.npz", bars), ldm_full_model(bars.scene([2.5]))
    with one_thread(), Results(tmp_path / "run.h5") as results:
        run = ldm_run(one, model.field, RunOptions(points=12), model.rest)
        for (latent, report), (_, own, said, _) in zip(resume.stored_states(results), run.states(),
                                                       strict=True):
            assert all(np.array_equal(a, b) for a, b in zip(latent, own, strict=True))
            assert (report and report[:4]) == (said and said[:4])


@pytest.mark.parametrize("step", [0, 4, STEPS])
def test_a_run_that_was_killed_goes_on(reduced, tmp_path, monkeypatch, step):
    """As its file stands after a step: a kill leaves what was committed."""
    def copied(writer, state, problem):
        show(writer, state, problem)
        assert {len(rows) for rows in writer.h5["reduced"].values()} == {len(writer)}
        if state.step == step and writer.path.stem == "whole":
            shutil.copy(writer.path, tmp_path / "killed.h5")

    show = record._show
    monkeypatch.setattr(record, "_show", copied)
    assert reduced("whole.h5").exit_code == 0
    assert parts(tmp_path / "killed.h5") == [KILLED]
    assert re.search(r"^part: from step 0 on, began 20\S+: not ended$",
                     mpm_ref("info", tmp_path / "killed.h5").stdout, re.MULTILINE)
    assert reduced("killed.h5").exit_code == 0
    assert content(tmp_path / "killed.h5") == content(tmp_path / "whole.h5")
    assert parts(tmp_path / "killed.h5") == [KILLED, (min(step, STEPS - 1), STEPS, "finished")]


def test_a_part_that_was_killed_tells_the_code_that_made_it(reduced, cut, tmp_path, monkeypatch):
    def copied(writer, state, problem):
        show(writer, state, problem)
        if state.step == 5:
            shutil.copy(writer.path, tmp_path / "killed.h5")

    show = record._show
    cut("run.h5", 3, g=2)
    with monkeypatch.context() as patch:
        patch.setattr(manifest, "source_hash", lambda: "other")
        patch.setattr(record, "_show", copied)
        assert reduced("run.h5", g=2).exit_code == 0
    assert parts(tmp_path / "killed.h5") == [(0, 2, "interrupted"), (2, None, "not ended")]
    done = reduced("killed.h5", g=2)
    assert done.exit_code == 0
    assert "by another version of the code, or of NumPy, SciPy or Numba: it goes on" in done.stderr


def test_a_run_that_was_interrupted_at_its_first_state_goes_on(reduced, cut, tmp_path):
    assert reduced("whole.h5").exit_code == 0
    cut("run.h5", 0)
    assert ended(tmp_path / "run.h5") == ("interrupted", 0)
    assert "part: from step 0 on, began " in mpm_ref("info", tmp_path / "run.h5").stdout
    assert reduced("run.h5").exit_code == 0
    assert content(tmp_path / "run.h5") == content(tmp_path / "whole.h5")


def test_a_part_that_breaks_down_at_once_says_why(reduced, tmp_path, monkeypatch):
    """In step 3 of a run that was killed after step 2."""
    def copied(writer, state, problem):
        show(writer, state, problem)
        shutil.copy(writer.path, tmp_path / "killed.h5")

    show = record._show
    with monkeypatch.context() as patch:
        patch.setattr(record, "_show", copied)
        assert reduced("whole.h5", g=500).exit_code == 3
    why, frames = ended(tmp_path / "whole.h5")
    assert (why[:38], frames) == ("the reduced run broke down in step 3: ", 3)
    assert parts(tmp_path / "killed.h5") == [KILLED]
    assert reduced("killed.h5", g=500).exit_code == 3
    assert parts(tmp_path / "killed.h5") == [KILLED, (2, None, why)]
    assert_told_last(reduced("killed.h5", g=500), "exists: add --overwrite")


def test_a_fault_of_ours_leaves_no_finished_run(reduced, tmp_path, monkeypatch):
    def broken(writer, state, problem):
        if state.step == 2:
            raise ZeroDivisionError
        show(writer, state, problem)

    show = record._show
    with monkeypatch.context() as patch:
        patch.setattr(record, "_show", broken)
        with pytest.raises(ZeroDivisionError):
            reduced("run.h5")
    assert parts(tmp_path / "run.h5") == [KILLED]
    assert reduced("run.h5").exit_code == 0
    assert ended(tmp_path / "run.h5") == ("finished", STEPS + 1)


def test_another_run_does_not_go_on(reduced, cut, tmp_path):
    cut("run.h5", 3, g=2)
    before = (tmp_path / "run.h5").read_bytes()
    for options, how in (((), {"g": 3}), (("--points-out", 500), {"g": 2}),
                         ((), {"g": 2, "way": "points = 13"})):
        assert_told(reduced("run.h5", *options, **how), 2, "holds another reduced run",
                    "cut off after 3 frames", "--overwrite to replace it")
    assert (tmp_path / "run.h5").read_bytes() == before
    assert reduced("run.h5", "--overwrite", g=3).exit_code == 0
    assert parts(tmp_path / "run.h5") == [(0, STEPS, "finished")]


@pytest.mark.parametrize("others", [[True], [False, True]])
def test_a_run_of_other_code_goes_on_with_a_warning(reduced, cut, tmp_path, monkeypatch, others):
    """Whether it began the run or made a part in its middle."""
    for step, other in zip((3, 4), others):
        with monkeypatch.context() as patch:
            if other:
                patch.setattr(manifest, "source_hash", lambda: "other")
            cut("run.h5", step, g=2)
    done = reduced("run.h5", g=2)
    assert done.exit_code == 0
    assert "by another version of the code, or of NumPy, SciPy or Numba: it goes on" in done.stderr
    assert ended(tmp_path / "run.h5") == ("finished", STEPS + 1)


def test_what_made_a_run_is_known_of_all_its_parts():
    now = manifest.code()
    other = now | {"source_sha256": "other"}
    older = now | {"versions": now["versions"] | {"numba": "0.1"}}
    unrelated = now | {"versions": now["versions"] | {"h5py": "0.1"}}
    assert resume.is_same_code(now | {"parts": []})
    assert resume.is_same_code(now | {"parts": [now, unrelated]})
    for part in (other, older, {}):
        assert not resume.is_same_code(now | {"parts": [now, part, now]})
    assert not resume.is_same_code(other | {"parts": [now]})


def test_a_run_that_was_killed_is_cut_off_too():
    rows = {"finished": [{"why": "finished"}], "killed": [{"why": "not ended"}], "older": [],
            "stopped": [{"why": "interrupted"}],
            "broken": [{"why": "the reduced run broke down in step 3"}]}
    found = {name: resume.was_cut_off({"reduced": {}, "parts": own}) for name, own in rows.items()}
    assert found == {"finished": False, "killed": True, "older": True, "stopped": True,
                     "broken": False}
    assert not resume.was_cut_off({"parts": []})
