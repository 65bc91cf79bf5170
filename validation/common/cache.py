"""Parts of a long experiment, kept on disk while it runs: one that is cut off goes on where it was.

A part belongs to a commit and a seed. Source with changes has no name of its own, so that nothing
is kept of it; and all parts are removed once the experiment has ended well.
"""

import json
import shutil

from .record import write_whole


class Kept:
    """The parts of one experiment, in a folder; `commit` and `seed` say of what."""

    def __init__(self, folder, commit, seed):
        self._folder, self._of = folder, f"{commit}-{seed}"
        self._named = commit != "unknown" and not commit.endswith("+changes")

    def get(self, name, make):
        """What make() returned when the part was made: numbers, texts, lists of them."""
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
