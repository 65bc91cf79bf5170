"""The two kinds of study files: of reduced models, and of learned laws."""

from ..scene import SceneError
from ..scene.toml import read_tables

REDUCED = {"parameter", "map"}          # keys of a study of reduced models alone
LAWS = {"method", "laws", "train"}      # keys of a law study alone


def is_study(path):
    """Return whether a file is a study of reduced models, even one with invalid tables."""
    return bool(REDUCED & keys_of(path))


def is_law_study(path):
    """Return whether a file is a law study, even one with invalid tables."""
    return bool((LAWS | {"scene"}) & keys_of(path))


def keys_of(path):
    """Return the keys of a file's outermost table; none where it is no TOML."""
    try:
        return {*read_tables(path)}
    except SceneError:
        return set()


def require_reduced(name, path):
    """Raise SceneError where the study of a name is a law study."""
    if LAWS & keys_of(path) and not is_study(path):
        raise SceneError(f"{name}: a law study; `mpm-ref law train {name}` trains it, and "
                         "`mpm-ref rom studies` lists those of reduced models")


def require_laws(name, path):
    """Raise SceneError where the study of a name is one of reduced models."""
    if is_study(path) and not LAWS & keys_of(path):
        raise SceneError(f"{name}: a study of reduced models; `mpm-ref rom generate {name}` makes "
                         "its runs, and `mpm-ref law studies` lists those of laws")
