"""The simulation of many workers of one scheduler."""

import pytest

from benchmarks import many_workers
from benchmarks.many_workers import simulated_rows, wall_time


def test_one_worker_waits_for_the_scheduler_before_each_task():
    assert wall_time([1.0, 2.0, 3.0], 1, 0.5) == 7.5


def test_idle_workers_take_the_next_task():
    assert wall_time([3.0, 1.0, 1.0, 1.0], 2, 0.0) == 3.0


def test_scheduler_limits_the_rate_of_short_tasks():
    assert wall_time([0.001] * 1000, 1000, 0.01) == pytest.approx(10.001)


def test_efficiency_beside_free_scheduling():
    rows = simulated_rows("toy", [1.0] * 1000, 0.0)
    assert [row["efficiency"] for row in rows if row["workers"] in (1, 2, 8, 1000)] == [1.0] * 4
    assert rows[-1]["wall_s"] == 1.0


def test_all_runs_of_the_study_are_timed(monkeypatch):
    def generate(study, folder, k):
        made.append(k)
        many_workers.file_of(folder, k).write_bytes(b"")

    made = []
    monkeypatch.setattr(many_workers, "generate_run", generate)
    seconds = many_workers.run_seconds()
    assert made == [0, *range(len(seconds))]    # the first one compiles
    assert len(seconds) > 1
