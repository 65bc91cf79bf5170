"""The cache of a long experiment: finished parts stay on disk for an interrupted run.

A part belongs to a commit and a seed. Nothing is cached for a working tree with changes, which no
commit names. All parts are removed once the experiment has ended well.
"""

import json
import shutil

from .record import write_whole


class Cache:
    """The finished parts of one experiment, in a folder; they belong to a commit and a seed."""

    def __init__(self, folder, commit, seed):
        self._folder, self._of = folder, f"{commit}-{seed}"
        self._named = commit != "unknown" and not commit.endswith("+changes")

    def get(self, name, make):
        """Return the cached part, or make(): numbers, texts, lists of them."""
        path = self._folder / f"{name}-{self._of}.json"
        if not self._named:
            return make()
        try:
            return json.loads(path.read_text())
        except (OSError, ValueError):
            text = json.dumps(make())
        write_whole(path, text.encode())
        return json.loads(text)

    def clear(self):
        """Remove all parts."""
        shutil.rmtree(self._folder, ignore_errors=True)
