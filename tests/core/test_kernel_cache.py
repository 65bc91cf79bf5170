"""No file in the folder of compiled kernels ends a run or changes its results."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest
from numba import njit

from mpm_ref.core import kernel_cache
from mpm_ref.core.kernel_cache import KernelCache

ROOT = Path(__file__).resolve().parents[2]
FUNCTION = '''
def f(x):
    return x + 1.0
'''
OF_ROWS = "from mpm_ref.core.tensor import det\nprint(det(%s))\n"
MINE = '''
from typing import NamedTuple


class Rows(NamedTuple):
    a: tuple
    b: tuple
'''


@pytest.fixture(autouse=True)
def no_earlier_report(monkeypatch):
    """As in a new process."""
    monkeypatch.setattr(kernel_cache, "_reported", set())
    monkeypatch.setattr(kernel_cache, "_altered", set())


def new_process(folder, text=FUNCTION, module="mpm_ref.toy"):
    """A dispatcher of the function of a text, as a process has that did not compile it."""
    names = {"__name__": module}
    exec(text, names)
    dispatcher = njit(names["f"])
    dispatcher._cache = KernelCache(names["f"], folder)
    return dispatcher


def hits(dispatcher):
    return sum(dispatcher.stats.cache_hits.values())


def files(folder):
    return sorted(folder.glob("*.kernel"))


def run(code, **environment):
    """(output, errors) of a program in a new process."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300,
                          env=os.environ | {"PYTHONPATH": str(ROOT)} | environment, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


def test_a_second_process_loads_what_the_first_compiled(tmp_path, capfd):
    assert new_process(tmp_path)(1.0) == 2.0
    assert len(files(tmp_path)) == 1
    second = new_process(tmp_path)
    assert second(2.0) == 3.0
    assert hits(second) == 1
    assert second(1) == 2.0             # another signature
    assert len(files(tmp_path)) == 2
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("edit", [("1.0", "3.0"), ("x + 1.0", "x * 1.0"),
                                  ("def f", "f = 0\ndef f")])
def test_a_function_of_the_same_name_is_another_one(tmp_path, edit):
    new_process(tmp_path)(1.0)
    other = new_process(tmp_path, FUNCTION.replace(*edit))
    other(1.0)
    assert hits(other) == (edit[0] == "def f")      # its line in the file does not matter


def test_values_that_a_function_encloses_count(tmp_path):
    text = "def make(k):\n    def f(x):\n        return k * x\n    return f\nf = make(%d)"
    assert [new_process(tmp_path, text % k)(1.0) for k in (2, 3, 2)] == [2.0, 3.0, 2.0]
    assert len(files(tmp_path)) == 2


@pytest.mark.parametrize("damage", [
    lambda c: b"", lambda c: c[:20], lambda c: c[:len(c) // 2], lambda c: c + b"1",
    lambda c: c[:40] + bytes([c[40] ^ 1]) + c[41:], lambda c: c[:-9] + bytes([c[-9] ^ 64]) + c[-8:],
    lambda c: b"\0" * len(c), lambda c: b"no kernel",
], ids=["empty", "short", "half", "long", "begin", "end", "zeros", "text"])
def test_a_damaged_file_is_made_again(tmp_path, capfd, damage):
    new_process(tmp_path)(1.0)
    file, = files(tmp_path)
    whole = file.read_bytes()
    file.write_bytes(damage(whole))
    second = new_process(tmp_path)
    assert second(1.0) == 2.0
    assert hits(second) == 0
    err = capfd.readouterr().err
    assert str(tmp_path) in err
    assert err.startswith("mpm-ref: compiled kernels cannot be read in")
    assert err.count("\n") == 1
    third = new_process(tmp_path)
    assert third(1.0) == 2.0
    assert hits(third) == 1


def test_every_flipped_bit_is_noticed(tmp_path):
    """Bits in machine code too, which Numba would run."""
    compiled = new_process(tmp_path)
    compiled(1.0)
    file, = files(tmp_path)
    key = compiled._cache._key(compiled.signatures[0], compiled.targetctx.codegen())
    whole = file.read_bytes()
    assert kernel_cache.unsealed(file, key) == whole[kernel_cache.CHECKSUM:]
    code = whole.index(b"\x7fELF")
    for at in (0, 31, 32, code, code + 500, len(whole) - 1):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 4]) + whole[at + 1:])
        with pytest.raises(ValueError, match="damaged"):
            kernel_cache.unsealed(file, key)


def test_a_file_of_another_kernel_is_not_run(tmp_path, capfd):
    new_process(tmp_path)(1.0)
    mine, = files(tmp_path)
    new_process(tmp_path, FUNCTION.replace("1.0", "5.0"))(1.0)
    other, = set(files(tmp_path)) - {mine}
    mine.write_bytes(other.read_bytes())
    assert new_process(tmp_path)(1.0) == 2.0
    assert "cannot be read" in capfd.readouterr().err


def test_a_folder_in_place_of_a_file(tmp_path, capfd):
    new_process(tmp_path)(1.0)
    file, = files(tmp_path)
    file.unlink()
    file.mkdir()
    assert new_process(tmp_path)(1.0) == 2.0
    assert capfd.readouterr().err.count("\n") == 2      # neither read nor stored


def test_a_full_disk_is_told_once_and_leaves_nothing(tmp_path, capfd, monkeypatch):
    def full(self, content):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", full)
    compiled = new_process(tmp_path)
    assert (compiled(1.0), compiled(1)) == (2.0, 2.0)
    err = capfd.readouterr().err
    assert f"stored in {tmp_path} (No space left on device): every start compiles anew" in err
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_removed_folder_is_made_again(tmp_path, capfd):
    folder = tmp_path / "kernels"
    new_process(folder)(1.0)
    assert len(files(folder)) == 1
    assert capfd.readouterr().err == ""


def test_two_processes_that_store_do_not_disturb_each_other(tmp_path):
    first, second = new_process(tmp_path), new_process(tmp_path)
    first(1.0), second(1), second(1.0)
    third = new_process(tmp_path)
    assert (third(1.0), third(1)) == (2.0, 2.0)
    assert hits(third) == 2


def test_functions_and_types_of_others_are_not_stored(tmp_path):
    assert new_process(tmp_path, module="theirs")(1.0) == 2.0
    mine = {"__name__": "theirs"}
    exec(MINE, mine)
    rows = new_process(tmp_path, "def f(x):\n    return x[0][0]")
    assert rows(mine["Rows"]((1.0,), (2.0,))) == 1.0
    assert rows((mine["Rows"]((1.0,), (2.0,)),))[0] == 1.0      # within a tuple
    passed = new_process(tmp_path, "def f(g):\n    return g(1.0)")
    assert passed(njit(lambda x: x)) == 1.0                     # a kernel, known by its address
    assert not files(tmp_path)


def test_a_class_with_methods_of_others_is_not_stored(tmp_path):
    ours = {"__name__": "mpm_ref.toy"}
    exec(MINE, ours)
    x = ours["Rows"]((1.0,), (2.0,))
    kernel_cache.mark_altered(ours["Rows"], kernel_cache.seal)
    new_process(tmp_path, "def f(x):\n    return x[0][0]")(x)
    assert len(files(tmp_path)) == 1
    kernel_cache.mark_altered(ours["Rows"], new_process)
    new_process(tmp_path, "def f(x):\n    return x[1][0]")(x)
    assert len(files(tmp_path)) == 1


def test_flags_of_the_compiler_count(tmp_path, monkeypatch):
    new_process(tmp_path)(1.0)
    monkeypatch.setattr(kernel_cache.config, "BOUNDSCHECK", 1)
    other = new_process(tmp_path)
    assert other(1.0) == 2.0
    assert hits(other) == 0


def test_listeners_hear_of_compilations_alone(tmp_path, monkeypatch):
    heard = []
    monkeypatch.setattr(kernel_cache, "compilations", [lambda: heard.append(1)])
    new_process(tmp_path)(1.0)
    assert heard == [1]
    new_process(tmp_path)(1.0)
    assert heard == [1]


def test_a_module_that_is_gone_does_not_matter(tmp_path):
    """A type of a user's module was in the index of each of Numba's caches, and broke it."""
    (tmp_path / "mine.py").write_text(MINE)
    here = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    code = OF_ROWS % "Rows((2.0, 0.0), (0.0, 3.0))"
    there = os.pathsep.join([str(ROOT), str(tmp_path)])
    assert run("from mine import Rows\n" + code, PYTHONPATH=there, **here) == ("6.0\n", "")
    assert run(OF_ROWS % "((2.0, 0.0), (0.0, 3.0))", **here) == ("6.0\n", "")
    (tmp_path / "mine.py").write_text(MINE.replace("Rows", "Lines"))
    assert run(OF_ROWS % "((2.0, 0.0), (0.0, 3.0))", PYTHONPATH=there, **here) == ("6.0\n", "")


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="a folder in which nothing can be created")
def test_without_a_folder_kernels_are_compiled_in_memory():
    """Not in __pycache__, by the file of each function alone."""
    code = ("from mpm_ref.core import jit\nprint(jit.chunk(0, 64))\n"
            "print(jit.CACHE_DIR, jit.chunk._entry.stats.cache_path)")
    out, err = run(code, XDG_CACHE_HOME="/proc/none", NUMBA_CACHE_DIR="")
    assert out == "(0, 1)\nNone None\n"
    assert "mpm-ref: compiled kernels cannot be stored in /proc/none" in err
    assert err.count("\n") == 1
