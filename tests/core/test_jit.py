"""The folder of compiled kernels is named by the code that shapes them, and by nothing else."""

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
