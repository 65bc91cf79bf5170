"""Scale all lengths of a scene, or shift all its points, in its plain tables."""

import numpy as np

POINTS = ("lower", "upper", "center", "start", "end", "tip", "point", "about")      # of shapes
LENGTHS = ("radius", "major", "minor", "length", "width", "translate", "size")      # of shapes
PATHS = ("rate", "rates", "values", "amplitude")            # of a schedule of displacements
SPACINGS = ("spacing", "radius")                            # of a sampling


def scale_lengths(tables, factor):
    """Multiply all lengths of plain tables about the world's origin, in place.

    These are shapes, grid, samplings, clip, and the paths on which parts move in the times that
    they have. Velocities of bodies, gravity and all times stay. Walls, which are counted in nodes,
    follow the grid. Raises ValueError for bodies that are arrays.
    """
    if any(body.get("particles") is not None for body in tables["body"]):
        raise ValueError("bodies are arrays of particles, whose lengths stand in a file")
    tables["dx"] *= factor
    for body in tables["body"]:
        body["shape"] = scaled_shape(body["shape"], factor, tables["dim"])
        multiply(body["sampling"], SPACINGS, factor)
        multiply(body["velocity"], ("center",), factor)
    for key in ("collider", "fixed"):
        for part in tables[key]:
            name = "shape" if key == "collider" else "region"
            part[name] = scaled_shape(part[name], factor, tables["dim"])
            multiply(part["motion"], ("center",), factor)
            multiply(part["motion"].get("translation"), PATHS, factor)
    multiply(tables.get("clip"), ("lower", "upper"), factor)


def scaled_shape(shape, factor, dim):
    """Return the tables of a shape scaled about the world's origin."""
    if shape["type"] == "mesh":
        return {"type": "moved", "shape": shape, "scale": factor, "about": [0.0] * dim}
    result = with_parts(shape, lambda part: scaled_shape(part, factor, dim))
    multiply(result, (*POINTS, *LENGTHS), factor)
    return result


def multiply(table, keys, factor):
    """Multiply the values at some keys of a table, in place: numbers and lists of them."""
    for key in keys:
        if table is not None and table.get(key) is not None:
            table[key] = np.multiply(table[key], factor).tolist()


def shift_points(tables, cells):
    """Shift all points of plain tables by whole cells (d,) of the grid, in place.

    The particles keep their places within the cells, so that all but round-off stays.
    """
    offset = np.multiply(cells, tables["dx"])
    for body in tables["body"]:
        if body.get("shape") is not None:
            body["shape"] = shifted_shape(body["shape"], offset)
        else:
            body["particles"]["offset"] = added(body["particles"].get("offset"), offset)
        if body["velocity"].get("center") is not None:
            body["velocity"]["center"] = added(body["velocity"]["center"], offset)
    for part in tables["collider"]:
        part["shape"] = shifted_shape(part["shape"], offset)
        shift_motion(part["motion"], offset)
    for part in tables["fixed"]:
        part["region"] = shifted_shape(part["region"], offset)
        shift_motion(part["motion"], offset)
    shift_box(tables, cells, offset)


def shift_box(tables, cells, offset):
    """Shift the walls by whole nodes, and the box in which positions are clipped."""
    for key in ("lower", "upper") if tables.get("clip") is not None else ():
        tables["clip"][key] = added(tables["clip"][key], offset)
    for key in ("low", "high") if tables.get("walls") is not None else ():
        if tables["walls"].get(key) is not None:
            tables["walls"][key] = [node if node == "open" else node + int(n)
                                    for node, n in zip(tables["walls"][key], cells, strict=True)]


def shifted_shape(shape, offset):
    """Return the tables of a shape shifted by an offset (d,) [m]."""
    if shape["type"] == "mesh":
        return {"type": "moved", "shape": shape, "translate": offset.tolist()}
    result = with_parts(shape, lambda part: shifted_shape(part, offset))
    if shape["type"] == "moved":
        result["about"] = shape.get("about") or [0.0] * len(offset)
    for key in POINTS:
        if result.get(key) is not None:
            result[key] = added(result[key], offset)
    return result


def shift_motion(motion, offset):
    """Shift the centre of a part's rotation, which is the world's origin where none is given."""
    if motion.get("center") is not None or motion.get("rotation") or motion.get("angle"):
        motion["center"] = added(motion.get("center"), offset)


def added(point, offset):
    """Return a point plus an offset as a list; None stands for the world's origin."""
    return (offset if point is None else np.add(point, offset)).tolist()


def with_parts(shape, change):
    """Return the tables of a shape whose inner shapes are changed by a function."""
    result = dict(shape)
    if isinstance(shape.get("shape"), dict):
        result["shape"] = change(shape["shape"])
    for key in ("shapes", "minus"):
        if shape.get(key) is not None:
            result[key] = [change(part) for part in shape[key]]
    return result
