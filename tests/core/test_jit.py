"""The folder of compiled kernels is named by the code that shapes them, and by nothing else."""

from typing import NamedTuple

import numpy as np
import pytest

from mpm_ref.core import jit

CODE = '''"""What the file is about."""

FACTOR = 2.0        # of nothing


class Record:
    """A record."""

    x: float


@kernel
def twice(x):
    """2 x."""
    return FACTOR * x
'''


@pytest.fixture
def package(tmp_path):
    """A package with two files in `core`, one in `materials`, a kernel and a file without one."""
    folder = tmp_path / "mpm_ref"
    texts = {"core/tensor.py": CODE, "core/solids.py": CODE, "materials/__init__.py": CODE,
             "hot/transfer.py": "from ..core.jit import kernel\n" + CODE, "scene/toml.py": CODE}
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def edited(package, name, old, new):
    """Hashes of the package before and after an edit of one of its files."""
    root = package.parent / "kernels"
    before = jit._source_hash(package, root)
    assert jit._source_hash(package, root) == before
    file = package / name
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    return before, jit._source_hash(package, root)


@pytest.mark.parametrize("file", ["core/solids.py", "materials/__init__.py", "core/tensor.py",
                                  "hot/transfer.py"])
@pytest.mark.parametrize(("old", "new"), [
    ("2.0 ", "3.0 "), ("FACTOR * x", "x * FACTOR"), ("x: float", "x: int"),
    ("@kernel\n", ""), ("def twice(x)", "def twice(x, y='a')"),
])
def test_every_file_that_shapes_kernels_counts(package, file, old, new):
    before, after = edited(package, file, old, new)
    assert before != after


@pytest.mark.parametrize(("old", "new"), [
    ("What the file is about.", "Its subject."), ("        # of nothing", "  # a factor"),
    ("A record.", "Another.\n\n    With two lines.\n    "), ("2 x.", "Twice x."),
    ("\n\n\n@kernel", "\n\n@kernel"),
])
def test_docstrings_comments_and_empty_lines_do_not_count(package, old, new):
    before, after = edited(package, "core/tensor.py", old, new)
    assert before == after


def test_files_without_kernels_do_not_count(package):
    before, after = edited(package, "scene/toml.py", "2.0 ", "3.0 ")
    assert before == after


def test_texts_that_are_no_docstrings_count(package):
    before, after = edited(package, "core/tensor.py", "    return", "    'b'\n    return")
    assert before != after


def test_half_written_hash_is_found_again(package):
    root = package.parent / "kernels"
    right = jit._source_hash(package, root)
    file, = root.glob("*.syntax")
    file.write_text(right[:5])
    assert jit._source_hash(package, root) == right == file.read_text()


def test_a_folder_that_cannot_be_written_is_no_error(package):
    blocked = package.parent / "file"
    blocked.write_text("")
    assert jit._source_hash(package, blocked) == jit._source_hash(package, package.parent / "other")


# drivers

@jit.kernel
def doubled(x, bounds):
    for i in range(bounds[0], bounds[1]):
        x[i] *= 2.0


@jit.parallel_if_many
def doubled_all(x):
    for c in jit.prange(jit.CHUNKS):
        doubled(x, jit.chunk(c, len(x)))


class Rows(NamedTuple):
    """Two arrays with a row for each item."""

    x: np.ndarray
    y: np.ndarray


def test_few_items_start_no_threads(monkeypatch):
    driver = jit.Driver(doubled_all.py_func)
    few, many = np.ones(jit.few_items - 1), np.ones(jit.few_items)
    driver(few)
    assert (len(driver.serial.signatures), len(driver.threaded.signatures)) == (1, 0)
    monkeypatch.setattr(jit.numba, "get_num_threads", lambda: 1)
    driver(many)
    assert len(driver.threaded.signatures) == 0
    monkeypatch.setattr(jit.numba, "get_num_threads", lambda: 2)
    driver(many)
    assert len(driver.threaded.signatures) == 1
    assert len(driver.signatures) == 1
    assert set(few) == {2.0}
    assert set(many) == {4.0}


def test_items_are_the_rows_of_the_first_array():
    x, y = np.ones((7, 3)), np.ones(2)
    assert jit.item_count(x) == jit.item_count(Rows(x, y)) == jit.item_count((Rows(x, y), y)) == 7
