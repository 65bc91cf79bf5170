"""The text that names a scheduler."""

import sys

import pytest

from mpm_ref.executor import open_executor


@pytest.mark.parametrize("text", ["", "local", "local:", "local:0", "local:-1", "local:2.5", "host",
                                  "host:8786", "tcp://host", "tcp://:", "http://host:80",
                                  "local:2 ", "tcp://host:8786/x"])
def test_bad_texts_are_refused(text):
    with pytest.raises(ValueError, match=r"expected local:N .* as in tcp://host:8786") as refusal, \
            open_executor(text):
        pass
    assert str(refusal.value).startswith(f"scheduler {text!r}: ")


@pytest.mark.parametrize("text", ["local:2", "tcp://127.0.0.1:9"])
def test_missing_package_is_named(text, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ValueError, match=r"need dask: pip install 'mpm_ref\[sweep\]'"), \
            open_executor(text):
        pass
