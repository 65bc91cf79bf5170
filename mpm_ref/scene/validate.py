"""Validate a scene: convert plain tables to a `Scene`, or raise an error that names the key.

msgspec checks keys, types and bounds; this module checks conditions across tables.
"""

from math import isfinite
from typing import get_args

import msgspec
import numpy as np

from ..shapes import Mesh
from ..shapes.quantities import Coordinate, Vector
from .builder import build_parts
from .messages import SceneError, errors_at, joined, rephrase, shown
from .quantity_records import check_quantity
from .records import Scene


def validate_scene(data, source=""):
    """Return the valid `Scene` of plain tables (dict), or of a Scene built in Python.

    A scene that was validated before is returned unchanged; its `parts` hold the objects built by
    the validation. source: usually a file name, with which the message begins. Raises SceneError.
    """
    if isinstance(data, Scene) and data.parts is not None:
        return data
    try:
        if isinstance(data, Scene):
            data = plain(data)
        check_finite(data)
        scene = msgspec.convert(data, Scene)
        vars(scene)["parts"] = check_scene(scene)
    except msgspec.ValidationError as fault:
        raise _from(source, rephrase(str(fault), data)) from None
    except RecursionError:
        raise _from(source, "the tables are nested too deeply") from None
    except (ValueError, TypeError, OverflowError) as fault:
        raise _from(source, fault) from None
    return scene


def _from(source, message):
    return SceneError(f"{source}: {message}" if source else message)


def plain(record):
    """Return a record as plain tables; NumPy's numbers and arrays become numbers and lists."""
    return msgspec.to_builtins(record, enc_hook=_plain_numpy)


def _plain_numpy(value):
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise ValueError(f"{shown(value)}: expected a number, a text, a list or a table")


def check_finite(data, path=""):
    """Raise SceneError for a NaN or an infinity anywhere in plain tables."""
    if isinstance(data, float) and not isfinite(data):
        raise SceneError(f"{path} = {data}: expected a finite number")
    if isinstance(data, dict):
        for key, value in data.items():
            check_finite(value, joined(path, key))
    elif isinstance(data, list | tuple):
        for k, value in enumerate(data):
            check_finite(value, f"{path}[{k}]")


def check_scene(scene):
    """Return the `SceneParts` of a scene. Raises SceneError for the first inconsistency."""
    check_dimension(scene, scene.dim)
    for k, body in enumerate(scene.body):
        check_body(body, scene.dim, f"body[{k}]")
        if body.material.is_neural and scene.integrator != "explicit":
            raise SceneError(f"body[{k}].material.law = {body.material.law!r}: expected the "
                             f'integrator "explicit"; a learned stress has no energy to minimise')
        if body.name in [other.name for other in scene.body[:k]]:
            raise SceneError(f"body[{k}].name = {body.name!r}: another body has this name")
    if scene.clip and not all(a < b for a, b in zip(scene.clip.lower, scene.clip.upper)):
        raise SceneError("clip: expected lower < upper on every axis")
    parts = build_parts(scene)
    for k, quantity in enumerate(scene.quantity):
        with errors_at(f"quantity[{k}]"):
            check_quantity(quantity, scene)
    return parts


def check_body(body, dim, path):
    """Raise SceneError for a velocity that does not fit the dimension."""
    angular = body.velocity.angular
    if isinstance(angular, tuple) != (dim == 3) and angular != 0.0:
        expected = "a number" if dim == 2 else "3 numbers"
        raise SceneError(f"{path}.velocity.angular = {shown(angular)}: expected {expected} "
                         f"(dim = {dim})")


def check_dimension(record, dim, path=""):
    """Raise SceneError for a vector without `dim` components in a record or its parts."""
    if dim == 2 and isinstance(record, Mesh):
        raise SceneError(f"{path[:-1]}: a mesh of triangles is for dim = 3")
    for field in msgspec.structs.fields(record):
        value, where = getattr(record, field.name), f"{path}{field.name}"
        if isinstance(value, msgspec.Struct):
            check_dimension(value, dim, f"{where}.")
        elif isinstance(value, tuple) and value and isinstance(value[0], msgspec.Struct):
            for k, item in enumerate(value):
                check_dimension(item, dim, f"{where}[{k}].")
        elif isinstance(value, tuple) and Vector in (field.type, *get_args(field.type)):
            if len(value) != dim:
                alone = dim == 2 and Coordinate in get_args(field.type)
                expected = "a number" if alone else f"{dim} numbers"
                raise SceneError(f"{where} = {list(value)}: expected {expected} (dim = {dim})")
