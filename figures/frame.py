"""The frame of all figures.

A figure is a module ``figures/<name>.py``. Its docstring is the caption, ``NEEDS`` lists the ids of
the experiments whose results it reads (the report shows it under the first), ``draw(results)``
returns a matplotlib Figure and ``scale(results)`` says how large the runs were, which is written
under the figure and its caption. It computes nothing that an experiment did not record.
"""

import importlib
import io
import sys
import textwrap
import traceback
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
from tqdm import tqdm

from validation.record import write_whole

HERE = Path(__file__).parent
LETTERS = 18         # of the note on the scale, per inch
STYLE = {
    "figure.figsize": (6.4, 4.0), "figure.dpi": 100, "savefig.dpi": 130, "savefig.bbox": "tight",
    "font.size": 10, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True,
    "grid.color": "#e6e6e6", "lines.linewidth": 1.4, "legend.frameon": False,
}


def names(folder=HERE):
    """Names of all figures."""
    files = (file.stem for file in folder.glob("*.py"))
    return sorted(name for name in files if name != "frame" and not name.startswith("_"))


def draw_all(results, names=(), about=(), folder=HERE):
    """Draw figures into ``<results>/figures/<name>.png`` and ``.pdf``.

    Args:
        results: the `Results` of a profile.
        names: figures to draw; empty for all.
        about: only those which need one of these experiments; empty for all.
        folder: the package of the scripts.

    Figures whose experiments have no results are left out, and those that need unpublished states
    which are not here. Returns the names of those that raised.
    Raises ValueError for a name that does not exist.
    """
    chosen = _choose(names, folder)
    failed = []
    mpl.use("Agg")
    for name in tqdm(chosen, desc="figures", leave=False, disable=None, file=sys.stderr):
        try:
            script = importlib.import_module(f"{folder.name}.{name}")
            if _wanted(script, set(results.ids()), about):
                _save(script, name, results)
        except FileNotFoundError as gone:
            tqdm.write(f"figure {name} is left out: {gone}", file=sys.stderr)
        except Exception:
            failed.append(f"figure {name}")
            tqdm.write(traceback.format_exc(), file=sys.stderr)
    return failed


def _choose(wanted, folder):
    known = names(folder)
    for name in wanted:
        if name not in known:
            raise ValueError(f"no figure {name!r}; there are: {', '.join(known) or 'none'}")
    return list(wanted) or known


def _wanted(script, done, about):
    return done.issuperset(script.NEEDS) and (not about or not set(about).isdisjoint(script.NEEDS))


def _save(script, name, results):
    """Write the PNG, which carries its owner and caption for the report, and the PDF."""
    with mpl.rc_context(STYLE):
        figure = script.draw(results)
        scale = _scale(script, results)
        _sign(figure, scale)
        caption = " ".join([*script.__doc__.split(), *scale.split()])
        about = {"Source": script.NEEDS[0], "Description": caption, "Software": None}
        _write(figure, results.folder / "figures" / f"{name}.png", about)
        _write(figure, results.folder / "figures" / f"{name}.pdf", {"CreationDate": None})
    plt.close(figure)


def _scale(script, results):
    """The sentence on the scale, of a script that has one."""
    if not hasattr(script, "scale"):
        return ""
    return f"Scale ({results.folder.name}): {script.scale(results)}."


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
