"""The facts that bits depend on: versions of libraries, and the processor."""

import platform
from importlib.metadata import version
from pathlib import Path

from llvmlite import binding

LIBRARIES = ("numpy", "scipy", "numba", "llvmlite")
CPU_INFO = Path("/proc/cpuinfo")


def machine():
    """Return {fact: text} of the interpreter, the libraries and the processor."""
    return {
        "python": platform.python_version(),
        **{name: version(name) for name in LIBRARIES},
        "system": f"{platform.system()} {platform.machine()}",
        "processor": processor(),
        "target": binding.get_host_cpu_name(),
        "features": binding.get_host_cpu_features().flatten(),
    }


def processor():
    """Return the name of the processor as the system gives it."""
    if CPU_INFO.exists():
        for line in CPU_INFO.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor()
