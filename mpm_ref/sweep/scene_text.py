"""Text of a scene that a command writes, with comments, for a file in some folder."""

import os

from ..scene.quantity_records import check_quantity
from ..scene.toml import FILES, dumps
from ..scene.validate import plain, validate_scene


def scene_text(comments, scene, folder, quantities=()):
    """Return the TOML text of a scene for a file in a folder, after lines of comments.

    quantities: records of quantities of interest. A comment names those that do not fit the scene,
    such as the impulse of a part that it does not have; the others become tables.
    """
    faults = {one: fault_of(one, scene) for one in quantities}
    lines = [*comments, *(f"No [[quantity]] {one.text}: {fault}" for one, fault in faults.items()
                          if fault)]
    head = "".join(f"# {one_line(line)}".rstrip() + "\n" for line in lines)
    tables = {key: value for key, value in plain(scene).items() if value is not None}
    tables["quantity"] = [plain(one) for one, fault in faults.items() if not fault]
    return head + "\n" + dumps(validate_scene(from_folder(tables, folder)))


def fault_of(quantity, scene):
    """Return why a quantity of interest does not fit a scene; "" where it does."""
    try:
        check_quantity(quantity, scene)
    except ValueError as fault:
        return str(fault)
    return ""


def one_line(text):
    """Return a text without what could end a comment; the spaces at its start stay."""
    indent = text[:len(text) - len(text.lstrip(" "))]
    return indent + " ".join("".join(c if c.isprintable() else " " for c in text).split())


def from_folder(data, folder):
    """Return plain tables in which files are named from a folder, as in a scene's file there."""
    if isinstance(data, list | tuple):
        return [from_folder(item, folder) for item in data]
    if not isinstance(data, dict):
        return data
    tables = {key: from_folder(value, folder) for key, value in data.items()}
    for key in FILES:
        if isinstance(tables.get(key), str):
            tables[key] = os.path.relpath(tables[key], folder)
    return tables
