"""Scenes with other values at some places.

A place is a path into the scene's tables, such as "dx", "gravity[2]" or
"fixed.top.motion.rotation.rate"; items of a list go by their number or their name.
"""

import re
from difflib import get_close_matches

import msgspec

from .messages import SceneError
from .validate import validate_scene

STEP = re.compile(r"\[([^\[\]]+)\]|([^.\[\]]+)")


def varied(scene, values):
    """The scene with values {path: value} put into it. Raises SceneError for a path that leads
    nowhere, and for a value that does not fit.
    """
    tables = msgspec.json.decode(msgspec.json.encode(scene))
    for path, value in values.items():
        put(tables, path, value)
    return validate_scene(tables)


def put(tables, path, value):
    """Set what a path leads to in nested dicts and lists."""
    *before, last = steps(path)
    for step in before:
        tables = tables[place(tables, step, path)]
    tables[place(tables, last, path)] = value


def steps(path):
    """The steps of a path."""
    found = [a or b for a, b in STEP.findall(path)]
    if not found or STEP.sub("", path).strip("."):
        raise SceneError(f"{path!r} is no path into a scene: expected one such as gravity[2] or "
                         "fixed.top.motion.rotation.rate")
    return found


def place(tables, step, path):
    """Key of a table, or number in a list, that a step of a path stands for."""
    known = []
    if isinstance(tables, dict):
        known = list(tables)
        if step in known:
            return step
    elif isinstance(tables, list):
        known = [str(item.get("name", k)) if isinstance(item, dict) else str(k)
                 for k, item in enumerate(tables)]
        if step in known:
            return known.index(step)
        if step.isdigit() and int(step) < len(tables):
            return int(step)
    raise SceneError(f"{path!r} leads nowhere in the scene: there is no `{step}`; "
                     + _hint(step, known))


def _hint(step, known):
    near = get_close_matches(step, known, 1)
    if near:
        return f"did you mean `{near[0]}`?"
    return f"there are {', '.join(known)}" if known else "the scene does not give what is before it"


def flat(tables, path=""):
    """{path: value} of nested tables."""
    found = {}
    for key, value in tables.items():
        where = f"{path}.{key}" if path else key
        found |= flat(value, where) if isinstance(value, dict) else {where: value}
    return found
