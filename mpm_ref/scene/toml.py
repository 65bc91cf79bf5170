"""Read and write scenes as TOML, and as a canonical JSON text with its hash."""

import hashlib
import json
import tomllib
from pathlib import Path

import msgspec

from ..shapes.quantities import Kind, Record
from ..store.atomic import size_text
from .messages import SceneError, joined
from .validate import validate_scene

FILES = "file", "weights"       # keys that name a file
MANY = "body", "contact", "collider", "fixed", "sink", "quantity"      # lists of tables
LARGEST = 10_000_000            # bytes of a text
DEEPEST = 50                    # tables and lists within each other


def load(path):
    """Return the `Scene` of a TOML file; file names in it are relative to the folder of that file.

    Raises SceneError, which names the file and the key.
    """
    return _scene_of(read_tables(path), str(path), Path(path).parent)


def read_tables(path):
    """Return the plain tables of a file in TOML or JSON. Raises SceneError, which names it."""
    path = Path(path)
    try:
        if path.exists() and not path.is_file():
            raise SceneError(f"{path}: cannot be read (this is no file); expected one in TOML")
        if path.stat().st_size > LARGEST:
            raise SceneError(f"{path}: has {size_text(path.stat().st_size)}, expected a text of at "
                             f"most {size_text(LARGEST)}; put arrays of particles into an NPZ file")
        text = path.read_text(encoding="utf-8")
    except OSError as fault:
        raise SceneError(f"{path}: cannot be read ({fault.strerror})") from None
    except UnicodeDecodeError:
        raise SceneError(f"{path}: not a text file in UTF-8") from None
    return parse(text, str(path))


def parse(text, source=""):
    """Return the plain tables of a text in TOML or JSON. Raises SceneError."""
    try:
        data = json.loads(text) if text.lstrip().startswith("{") else tomllib.loads(text)
    except (ValueError, RecursionError) as fault:
        why = "too deeply nested" if isinstance(fault, RecursionError) else fault
        raise SceneError(f"{source or 'the scene'}: not valid TOML: {why}") from None
    if depth(data) > DEEPEST:
        raise SceneError(f"{source or 'the scene'}: more than {DEEPEST} tables and lists within "
                         "each other; expected at most ten or so")
    return data


def depth(data):
    """Return how many tables and lists lie within each other, at most one more than DEEPEST."""
    level, inside = 0, [data]
    while inside and level <= DEEPEST + 1:
        inside = [item for one in inside if isinstance(one, dict | list)
                  for item in (one.values() if isinstance(one, dict) else one)]
        level += 1
    return level - 1


def loads(text, source="", folder="."):
    """Return the `Scene` of a TOML text, or of JSON as `canonical` writes it.

    source: text with which error messages begin; folder: to which file names are relative. Raises
    SceneError.
    """
    return _scene_of(parse(text, source), source, Path(folder))


def _scene_of(data, source, folder):
    return validate_scene(_located(data, folder), source)


def _located(data, folder):
    """Return plain tables in which the names of files start at a folder."""
    if isinstance(data, list):
        return [_located(item, folder) for item in data]
    if not isinstance(data, dict):
        return data
    located = {key: _located(value, folder) for key, value in data.items()}
    for key in FILES:
        if isinstance(located.get(key), str):
            located[key] = str(folder / located[key])
    return located


def dumps(scene):
    """Return the TOML text of a scene without its defaults, which `loads` reads back."""
    tables = _tables(validate_scene(scene))
    many = {key: tables.pop(key) for key in MANY if key in tables}
    lines = [_pair(key, value) for key, value in tables.items()]
    for key, items in many.items():
        for item in items:
            lines += ["", f"[[{key}]]", *(_pair(k, value) for k, value in item.items())]
    return "\n".join([*lines, ""])


def _pair(key, value):
    return f"{key} = {_toml(value)}"


def _toml(value):
    """Return a value on one line of TOML."""
    if isinstance(value, dict):
        return f"{{{', '.join(_pair(key, item) for key, item in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    # JSON writes numbers, truth values and texts as TOML does, but for the DEL character.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def canonical(scene):
    """Return the canonical JSON text of a scene: sorted keys, no defaults, files by name and hash.

    Scenes whose runs are equal have equal texts, independent of their folder, and of quantities of
    interest, which it leaves out. Raises SceneError.
    """
    tables = _by_content(_tables(validate_scene(scene)))
    tables.pop("quantity", None)
    return json.dumps(tables, sort_keys=True, separators=(",", ":"))


def digest(scene):
    """Return the hash of a scene: the sha256 of its canonical text."""
    return hashlib.sha256(canonical(scene).encode()).hexdigest()


def _tables(record):
    """Return a record as plain tables without the keys that have their default value."""
    tables = {"type": record.__struct_config__.tag} if isinstance(record, Kind) else {}
    for field in msgspec.structs.fields(record):
        value = getattr(record, field.name)
        if value is not None and value != field.default:
            tables[field.encode_name] = _plain_but_defaults(value)
    return tables


def _plain_but_defaults(value):
    if isinstance(value, Record):
        return _tables(value)
    return [_plain_but_defaults(item) for item in value] if isinstance(value, tuple) else value


def _by_content(data, path=""):
    """Return plain tables in which a file is represented by its name and its sha256."""
    if isinstance(data, list | tuple):
        return [_by_content(item, f"{path}[{k}]") for k, item in enumerate(data)]
    if not isinstance(data, dict):
        return data
    tables = {key: _by_content(value, joined(path, key)) for key, value in data.items()}
    for key in FILES:
        if key in data:
            tables[key] = Path(data[key]).name
            tables["sha256"] = _sha256(data[key], joined(path, key))
            if data.get("sha256") not in (None, tables["sha256"]):
                raise SceneError(f"{path}.sha256: the file {data[key]!r} holds something else, "
                                 f"its sha256 is {tables['sha256']}")
    return tables


def _sha256(file, where):
    try:
        with open(file, "rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except (OSError, ValueError) as fault:
        raise SceneError(f"{where} = {file!r}: cannot be read ({fault})") from None
