"""Draw figures from the results of experiments.

Figure ``<paper>_<name>`` is the module ``figures/<paper>/<name>.py``. Its docstring is the caption,
``NEEDS`` lists the ids of the experiments whose results it reads (the report shows it under the
first), ``draw(results)`` returns a matplotlib Figure and ``scale(results)`` says how large the runs
were, which is written under the figure and its caption. It computes nothing that an experiment did
not record.
"""

import importlib
import io
import sys
import textwrap
import traceback
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import matplotlib.pyplot as plt
from tqdm import tqdm

from validation.common.record import write_whole

HERE = Path(__file__).parent
LETTERS = 18         # of the note on the scale, per inch
WIDTH = 7.0          # of a figure, at most, without its margins [inch]: text is legible in a page
STYLE = {
    "figure.figsize": (6.4, 4.0), "figure.dpi": 100, "savefig.dpi": 180, "savefig.bbox": "tight",
    "font.size": 9, "axes.titlesize": 9, "legend.fontsize": 8,
    "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True,
    "grid.color": "#e6e6e6", "lines.linewidth": 1.4, "legend.frameon": False,
}


class Drawn(NamedTuple):
    """Names of the figures that were drawn, left out and failed."""

    done: list
    left: list          # their results, or unpublished states, are not here
    failed: list        # their script raised an error


def names(folder=HERE):
    """Return the names of all figures."""
    files = (file for file in folder.glob("*/*.py") if not file.stem.startswith("_"))
    return sorted(f"{file.parent.name}_{file.stem}" for file in files
                  if file.parent.name != "common")


def draw_all(results, names=(), about=(), folder=HERE, workers=1):
    """Draw figures into ``<results>/figures/<name>.png`` and ``.pdf``.

    Args:
        results: the `Results` of a profile.
        names: figures to draw, or experiments that they need; empty for all.
        about: only those which need one of these experiments; empty for all.
        folder: the package of the scripts.
        workers: number of processes that draw.

    Prints which figures are left out, and why. Returns `Drawn`.
    Raises ValueError for a name that does not exist.
    """
    chosen = _choose(names, folder)
    draw = partial(_draw, folder=folder, results=results, about=frozenset(about))
    drawn = Drawn([], [], [])
    with _mapping(min(workers, len(chosen))) as mapping:
        for name, (state, message) in tqdm(zip(chosen, mapping(draw, chosen)), "figures",
                                           len(chosen), leave=False, disable=None,
                                           file=sys.stderr):
            if state:
                getattr(drawn, state).append(name)
            if message:
                tqdm.write(message, file=sys.stderr)
    return drawn


@contextmanager
def _mapping(workers):
    """`map`, or that of a pool of processes."""
    if workers < 2:
        yield map
    else:
        with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
            yield pool.map


def _draw(name, folder, results, about):
    """Draw a figure. Return the field of `Drawn` that it belongs to, if any, and a message."""
    mpl.use("Agg")
    try:
        script = _script(name, folder)
        if about and about.isdisjoint(script.NEEDS):
            return None, None
        _check_results(script, results)
        _save(script, name, results)
    except FileNotFoundError as error:
        return "left", f"figure {name} is left out: {error}"
    except Exception:
        return "failed", traceback.format_exc()
    return "done", None


def _script(name, folder):
    paper, _, stem = name.partition("_")
    return importlib.import_module(f"{folder.name}.{paper}.{stem}")


def _choose(wanted, folder):
    existing = names(folder)
    chosen = [name for word in wanted for name in _matching(word, existing, folder)]
    return list(dict.fromkeys(chosen)) or existing


def _matching(word, existing, folder):
    """Return the figure of that name, or those which need the experiment of that id."""
    if word in existing:
        return [word]
    matches = [name for name in existing if word in _script(name, folder).NEEDS]
    if not matches:
        raise ValueError(f"no figure {word!r}; there are: {', '.join(existing) or 'none'}")
    return matches


def _check_results(script, results):
    """Raise FileNotFoundError where an experiment that a script needs has no results."""
    for id in script.NEEDS:
        results.records(id)


def _save(script, name, results):
    """Write the PNG, which carries its owner and caption for the report, and the PDF."""
    with mpl.rc_context(STYLE):
        figure = script.draw(results)
        _check_width(figure)
        scale = _scale(script, results)
        _anchor_legends(figure)
        _sign(figure, scale)
        caption = " ".join([*script.__doc__.split(), *scale.split()])
        about = {"Source": script.NEEDS[0], "Description": caption, "Software": None}
        _write(figure, results.folder / "figures" / f"{name}.png", about)
        _write(figure, results.folder / "figures" / f"{name}.pdf", {"CreationDate": None})
    plt.close(figure)


def _check_width(figure):
    """Raise ValueError for a figure whose text would be too small in a page."""
    wide = figure.get_figwidth()
    if wide > WIDTH:
        raise ValueError(f"the figure is {wide:g} inches wide; expected at most {WIDTH:g}, so that "
                         "its text is legible in a page: stack its panels")


def _scale(script, results):
    """Return the sentence on the scale, of a script that has one."""
    if not hasattr(script, "scale"):
        return ""
    return f"Scale ({results.folder.name}): {script.scale(results)}."


def _anchor_legends(figure):
    """Tie legends to the figure: else a tight bounding box, which has the note, moves them."""
    for legend in figure.legends:
        if legend._bbox_to_anchor is None:
            legend.set_bbox_to_anchor((0.0, 0.0, 1.0, 1.0), figure.transFigure)


def _sign(figure, text):
    """Write small grey lines under all that was drawn."""
    if text:
        box = figure.get_tightbbox()
        width, height = figure.get_size_inches()
        lines = textwrap.fill(text, int(LETTERS * (box.x1 - box.x0)))
        figure.text(box.x0 / width, box.y0 / height - 0.02, lines, fontsize=7, color="0.4",
                    va="top")


def _write(figure, path, metadata):
    buffer = io.BytesIO()
    figure.savefig(buffer, format=path.suffix[1:], metadata=metadata)
    write_whole(path, buffer.getvalue())
