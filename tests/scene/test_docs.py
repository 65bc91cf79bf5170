import re
from pathlib import Path

import msgspec
import pytest

from mpm_ref import materials, scene
from mpm_ref.scene import build, loads
from mpm_ref.shapes.quantities import Record

TEXT = (Path(__file__).parents[2] / "docs/reference/scenes.md").read_text()
RECORDS = [record for record in vars(scene).values()
           if isinstance(record, type) and issubclass(record, Record)]
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: record.__name__)
def test_every_key_is_documented(record):
    missing = [key for key in record.__struct_encode_fields__ if f"`{key}`" not in TEXT]
    assert not missing
    tag = record.__struct_config__.tag
    assert tag is None or f'"{tag}"' in TEXT


def test_every_law_and_flow_is_documented():
    assert not [name for name in (*materials.LAWS, *materials.FLOWS) if f'"{name}"' not in TEXT]


def tables(base):
    """Names of the records of tables: those that no other record extends."""
    parts = base.__subclasses__()
    return [name for part in parts for name in tables(part)] if parts else [base.__name__]


def test_every_record_is_exported():
    assert set(tables(Record)) == {record.__name__ for record in RECORDS}
    assert {record.__name__ for record in RECORDS} <= set(scene.__all__)


@pytest.mark.parametrize("text", [text for kind, text in BLOCKS if kind == "toml"])
def test_examples_build(text):
    assert len(build(loads(text)).bodies[0].id) > 0


def test_python_example_is_the_first_toml_example():
    names = {}
    exec(next(text for kind, text in BLOCKS if kind == "python"), names)
    assert names["scene"] == loads(next(text for kind, text in BLOCKS if kind == "toml"))
    assert len(names["problem"].bodies[0].id) > 0


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: record.__name__)
def test_defaults_in_tables_are_those_of_the_records(record):
    """Rows are | key | unit | default | text | or | key | default | text |."""
    rows = re.findall(r"^\| `(\w+)` \|(?:[^|]*\|)? (-?\d[\d.]*|true|false) \|", TEXT, re.MULTILINE)
    for field in msgspec.structs.fields(record):
        documented = [default for key, default in rows if key == field.name]
        if documented and isinstance(field.default, bool | int | float):
            assert str(field.default).lower() in documented
