"""Trainings that go on where they were cut off: from a sealed checkpoint of the same training.

Sessions, which know how weights become bytes, share what is here. A session has a `history` with an
entry for each epoch, `epoch()`, `save(path)` and `load(path)`.
"""

from pathlib import Path

from .sealed import SEAL, intact, seal, write_whole


def write(path, content):
    """Write the bytes of a checkpoint, whole or not at all."""
    write_whole(path, content + seal(content))


def read(path):
    """The bytes of a checkpoint. Raises ValueError where it is damaged."""
    content = path.read_bytes()
    if not intact(content):
        raise ValueError(f"{path} is damaged or no checkpoint: its checksum does not fit; remove "
                         "it to train from the start, or name another file")
    return content[:-SEAL]


def require_same(path, kept, named):
    """Raise ValueError unless a checkpoint is of the training that goes on; both as text."""
    if kept != named:
        raise ValueError(f"{path} is a checkpoint of the training {kept}, not of {named}; remove "
                         "it or give another folder")


def finished(session, epochs, every, checkpoint=None, on_epoch=None):
    """The session, trained up to so many epochs.

    checkpoint: a file to go on from, and to save to when so many epochs are over (`every`);
    on_epoch(history) is called after each epoch.
    """
    path = None if checkpoint is None else Path(checkpoint)
    if path is not None and not path.parent.is_dir():
        raise ValueError(f"{path}: there is no folder {path.parent}; create it or name another one")
    if path is not None and path.exists():
        session.load(path)
    while len(session.history) < epochs:
        session.epoch()
        if path is not None and len(session.history) % every == 0:
            session.save(path)
        if on_epoch is not None:
            on_epoch(session.history)
    return session
