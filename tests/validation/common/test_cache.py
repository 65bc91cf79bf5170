"""Parts of a long experiment that outlive it when it is cut off."""

import pytest

from validation.common.registry import Experiment
from validation.common.run import RunSetting, run_all


def run(folder, function, **setting):
    """Run a toy experiment; returns whether it failed."""
    toy = Experiment("verification.toy", "A toy", ("quick",), {"quick": 1.0}, function)
    return run_all([toy], RunSetting("quick", folder, **setting))


def parts(folder):
    return sorted(file.name for file in folder.rglob(".parts/*/*"))


@pytest.mark.parametrize(("commit", "made"), [("abc", 3), ("abc+changes", 4), ("unknown", 4)])
def test_an_experiment_that_was_cut_off_goes_on(tmp_path, commit, made):
    calls = []

    def part(i):
        calls.append(i)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return [i, [0.1, "text"]]

    def long(run):
        for i in range(2):
            assert run.cached(f"part{i}", lambda i=i: part(i)) == [i, [0.1, "text"]]

    with pytest.raises(KeyboardInterrupt):
        run(tmp_path, long, commit=commit)
    assert parts(tmp_path) == (["part0-abc-0.json"] if commit == "abc" else [])
    assert run(tmp_path, long, commit=commit) == []
    assert len(calls) == made
    assert parts(tmp_path) == []


def test_what_was_kept_is_of_one_commit_and_one_seed(tmp_path):
    made = []

    def broken(run):
        run.cached("part", lambda: made.append(run.seed))
        raise RuntimeError("later")

    for of in ("abc", 0), ("abc", 0), ("abc", 1), ("def", 0):
        run(tmp_path, broken, commit=of[0], seed=of[1])
    assert made == [0, 1, 0]
