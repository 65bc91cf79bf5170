"""The two kinds of study files: of reduced models, and of learned laws."""

from ..scene import SceneError
from ..scene.toml import read_tables
from .catalogue import find_study

REDUCED = {"parameter", "map"}          # keys of a study of reduced models alone
LAWS = {"method", "laws", "train"}      # keys of a law study alone


def is_study(path):
    """Return whether a file is a study of reduced models, even one with invalid tables."""
    return bool(REDUCED & keys_of(path))


def is_law_study(path):
    """Return whether a file is a law study, even one with invalid tables."""
    return not is_study(path) and bool((LAWS | {"scene"}) & keys_of(path))


def keys_of(path):
    """Return the keys of a file's outermost table; none where it is no TOML."""
    try:
        return {*read_tables(path)}
    except SceneError:
        return set()


def find_reduced_study(name):
    """Return the path of a study of reduced models, given by its file or a bundled name. Raises
    SceneError, also for a law study.
    """
    path = find_study(name, "studies of reduced models", is_study)
    if LAWS & keys_of(path) and not is_study(path):
        raise SceneError(f"{name}: a law study; `mpm-ref law train {name}` trains it, and "
                         "`mpm-ref rom studies` lists those of reduced models")
    return path


def find_law_study(name):
    """Return the path of a law study, given by its file or a bundled name. Raises SceneError, also
    for one of reduced models.
    """
    path = find_study(name, "studies of laws", is_law_study)
    if is_study(path) and not LAWS & keys_of(path):
        raise SceneError(f"{name}: a study of reduced models; `mpm-ref rom generate {name}` makes "
                         "its runs, and `mpm-ref law studies` lists those of laws")
    return path
