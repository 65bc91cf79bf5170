"""A damaged results file is told before HDF5 reads the damaged bytes, and none crashes a run."""

import json
import subprocess
import sys

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_runs import ENERGY, colliding, frame_of, state_of

from mpm_ref.store import checksums
from mpm_ref.store.checksums import (
    BLOCK,
    HEAD,
    BlockDigests,
    CheckedFile,
    Damaged,
    require_intact,
)
from mpm_ref.store.journal import JournaledFile
from mpm_ref.store.results import BadResults, Results
from mpm_ref.store.writer import StoredFields, create, reopen

pieces = st.tuples(st.integers(HEAD, 3 * BLOCK), st.binary(min_size=1, max_size=BLOCK))


@pytest.fixture
def results(tmp_path):
    problem = colliding()
    writer = create(tmp_path / "run.h5", problem, StoredFields(), {"made": "here"})
    for k in range(3):
        writer.append(frame_of(state_of(problem, k), k), ENERGY)
    writer.close()
    return tmp_path / "run.h5"


def everything(path):
    """Read all that is stored."""
    with Results(path) as r:
        for body in r.bodies:
            for name in ("m", "V0", *r.fields(body)):
                r.field(body, name)
        return json.dumps(r.manifest)


@given(st.lists(pieces, min_size=1, max_size=6))
def test_only_changed_blocks_are_hashed_and_all_fit(writes):
    content, blocks, read_at = bytearray(HEAD), BlockDigests(), []

    def read(at, n):
        read_at.append(at // BLOCK)
        return bytes(content[at:at + n])

    for at, data in writes:
        old = len(content)
        content.extend(bytes(max(at + len(data) - old, 0)))
        content[at:at + len(data)] = data
        read_at.clear()
        blocks.update(read, len(content), [(at, at + len(data))])
        first = min(at, old) // BLOCK
        assert len(read_at) == len(set(read_at)) <= -(-len(content) // BLOCK) - first
    fresh = BlockDigests()
    fresh.update(read, len(content), [])
    assert fresh.digests == blocks.digests
    assert fresh.head() == blocks.head()


def test_every_tool_reads_the_file(results):
    with h5py.File(results) as h5:
        assert h5.userblock_size == HEAD
        assert len(h5["time"]) == 3


def test_every_flipped_bit_is_told(results):
    content, rng = results.read_bytes(), np.random.default_rng(0)
    for at in (0, 60, 5579, 5579 + HEAD, len(content) - 1, *rng.integers(len(content), size=60)):
        bad = bytearray(content)
        bad[at] ^= 1 << rng.integers(8)
        results.write_bytes(bad)
        with pytest.raises(BadResults, match=r"run\.h5"):
            everything(results)
        with pytest.raises(Damaged, match=r"run.h5 is damaged: .*; take a copy"):
            reopen(results, colliding(), 2)
        assert results.read_bytes() == bytes(bad)


def test_every_cut_is_told(results):
    content = results.read_bytes()
    for share in (0.0, 1e-3, 0.01, 0.5, 0.999):
        results.write_bytes(content[:int(share * len(content))])
        with pytest.raises(BadResults, match=r"run\.h5"):
            everything(results)
        with pytest.raises(Damaged):
            reopen(results, colliding(), 2)


def test_blocks_that_are_not_read_do_not_matter(tmp_path):
    """Of a large file, frames before the damage are still read."""
    problem, path = colliding(), tmp_path / "run.h5"
    writer = create(path, problem, StoredFields(), {})
    for k in range(60):
        writer.append(frame_of(state_of(problem, k), k), ENERGY)
    writer.close()
    with Results(path) as r:
        places = [r.h5["bodies/left/x"].id.get_chunk_info(k).byte_offset + HEAD for k in (0, 59)]
        first = r.field("left", "x", 0)
    assert places[1] // BLOCK > places[0] // BLOCK
    content = bytearray(path.read_bytes())
    content[places[1] + 11] ^= 16
    path.write_bytes(content)
    with Results(path) as r:
        np.testing.assert_array_equal(r.field("left", "x", 0), first)
        with pytest.raises(BadResults, match="x of body 'left' is damaged"):
            r.field("left", "x", 59)


def test_a_reader_follows_a_writer(tmp_path):
    problem, path = colliding(), tmp_path / "run.h5"
    writer = create(path, problem, StoredFields(), {})
    writer.append(frame_of(state_of(problem, 0), 0), ENERGY)
    with Results(path) as early:
        for k in range(1, 40):
            writer.append(frame_of(state_of(problem, k), k), ENERGY)
            with Results(path) as late:
                assert len(late) == k + 1
                late.field("left", "tau", k)
        body = state_of(problem, 0).bodies[0]
        np.testing.assert_array_equal(early.field("left", "tau", 0)[body.id], body.particles.tau)
    writer.close()
    with open(path, "rb") as file:
        require_intact(file)


def test_a_block_that_was_written_again_is_read(tmp_path):
    with JournaledFile(tmp_path / "a", new=True, checked=True) as writer:
        writer.seek(HEAD)
        writer.write(bytes(3 * BLOCK))
        writer.commit()
        with CheckedFile(tmp_path / "a") as reader:
            writer.seek(2 * BLOCK + 5)
            writer.write(b"new")
            writer.commit()
            reader.seek(2 * BLOCK + 5)
            assert reader.read(3) == b"new"


def test_resumed_results_have_checksums(results):
    writer = reopen(results, colliding(), 2)
    writer.append(frame_of(state_of(colliding(), 7), 2), ENERGY)
    writer.put_manifest({"parts": [1]})
    writer.close()
    with open(results, "rb") as file:
        blocks = require_intact(file)
    assert results.stat().st_size >= blocks.size + len(blocks.digests)
    assert everything(results) == '{"parts": [1]}'


DAMAGE = """
import sys
from pathlib import Path
from mpm_ref.store.results import BadResults, Results
path, content = Path(sys.argv[1]), Path(sys.argv[1]).read_bytes()
for at in range(%d, len(content), 97):
    bad = bytearray(content)
    bad[at] ^= 255
    path.write_bytes(bad)
    try:
        with Results(path) as r:
            for body in r.bodies:
                [r.field(body, name) for name in r.fields(body)]
    except BadResults:
        continue
    raise SystemExit(f"byte {at} was not noticed")
"""


@pytest.mark.slow
def test_no_damage_crashes_the_process(results):
    done = subprocess.run([sys.executable, "-c", DAMAGE % 512, results], capture_output=True,
                          text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_head_that_does_not_fit_is_damage(results, monkeypatch):
    monkeypatch.setattr(checksums, "PAUSE", 0.0)
    content = bytearray(results.read_bytes())
    content[len(checksums.MAGIC) + 3] ^= 1      # of the size
    results.write_bytes(content)
    with pytest.raises(BadResults, match="its first bytes are not those that were written"):
        Results(results)
