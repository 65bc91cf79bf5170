"""Every source that code or documentation cites stands in REFERENCES.md, in one form."""

import re

import pytest

from validation.common.citations import KEY, LOOSE, ROOT, cited_keys, documentation, files

FOLDERS = ("mpm_ref", "validation", "figures", "benchmarks", "tests")
ENTRY = re.compile(r"^- \*\*\[(\w+)\]\*\* ", re.MULTILINE)


def listed():
    return ENTRY.findall((ROOT / "REFERENCES.md").read_text(encoding="utf-8"))


def unlisted(root, folders, keys):
    hits = [hit for folder in folders for hit in cited_keys(root, folder)]
    return [f"{hit.path}:{hit.line} cites {hit.source}" for hit in hits if hit.source not in keys]


def loose(root, folders):
    """Citations of the five papers that are not ids."""
    lines = [(path, i, line)
             for folder in folders for path in files(root, folder, "*.py")
             for i, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)]
    return [f"{path.name}:{i} {line.strip()}" for path, i, line in lines if LOOSE.search(line)]


def test_keys_are_unique_and_of_the_form_the_scan_knows():
    keys = listed()
    assert len(keys) == len(set(keys)) >= 50
    assert not [key for key in keys if not (KEY.fullmatch(f"[{key}]") or KEY.fullmatch(key))]


def test_every_entry_says_what_we_take_from_it():
    text = (ROOT / "REFERENCES.md").read_text(encoding="utf-8")
    entries = re.split(r"^- \*\*\[", text, flags=re.MULTILINE)[1:]
    here = re.compile(r"^  \*Here:\* \w", re.MULTILINE)
    assert not [entry[:30] for entry in entries if not here.search(entry)]


def test_every_cited_key_is_listed():
    assert unlisted(ROOT, FOLDERS, listed()) == []


def test_every_key_cited_in_the_documentation_is_listed():
    text = "".join(page.read_text(encoding="utf-8") for page in documentation())
    assert {m[1] or m[2] for m in KEY.finditer(text)} <= set(listed())


def test_the_five_papers_are_cited_by_id():
    assert loose(ROOT, FOLDERS) == []


@pytest.fixture
def code(tmp_path):
    folder = tmp_path / "mpm_ref"
    folder.mkdir()
    (folder / "law.py").write_text(
        '"""Sand [Klar2016], units in [Pa] and [MPa]."""\n\n\n'
        'def flow(table, MLS):\n    """As Nobody1999 says."""\n'
        "    return table[MLS]  # [XYZ] eq. 3, NSF eq. 6\n")
    return tmp_path


def test_the_scan_finds_keys_in_text_and_not_in_code(code):
    assert [(c.source, c.link) for c in cited_keys(code, "mpm_ref")] == [
        ("Klar2016", "mpm_ref/law.py"), ("Nobody1999", "mpm_ref/law.py::flow"),
        ("XYZ", "mpm_ref/law.py::flow")]


def test_unlisted_keys_and_loose_citations_are_reported(code):
    assert unlisted(code, ["mpm_ref"], ["Klar2016", "XYZ"]) == ["mpm_ref/law.py:5 cites Nobody1999"]
    assert loose(code, ["mpm_ref"]) == ["law.py:6 return table[MLS]  # [XYZ] eq. 3, NSF eq. 6"]
