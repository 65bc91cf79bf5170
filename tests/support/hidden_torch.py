"""PyTorch taken away for one test."""

import sys


def hide(monkeypatch):
    """As if PyTorch were not installed; afterwards modules and packages are as they were."""
    monkeypatch.setitem(sys.modules, "torch", None)
    found = {name: module for name, module in sys.modules.items() if ".train." in name}
    for name in found:
        package, _, part = name.rpartition(".")
        monkeypatch.delattr(found.get(package) or sys.modules[package], part, raising=False)
        monkeypatch.delitem(sys.modules, name)
