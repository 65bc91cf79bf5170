"""Files that are written from a template with some of its text replaced."""


def write_edited(path, text, edits):
    """The path of a new file: a text with (old, new) passages of it; each must occur."""
    for old, new in edits:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)
    return path
