"""The command `python -m validation mutate`."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from ..common import targets
from ..common.provenance import commit
from ..common.registry import discover, select
from ..common.results import ROOT
from ..common.run import RunSetting
from . import listing, table
from .trial import compare, run_in_new_process

Ids = Annotated[list[str] | None, typer.Argument(help="ids or their leading parts; none: all")]
Table = Annotated[Path, typer.Option("--table", help="CSV file whose rows are replaced")]
Only = Annotated[list[str] | None, typer.Option("--only", help="names of mutations, whose outcomes "
                                                            "are added; none: all")]
Sound = Annotated[Path | None, typer.Option("--sound", help="quick results of this source, made "
                                                            "before; none: run them first")]


def mutate(ids: Ids = None, table_file: Table = table.FILE, only: Only = None,
           sound: Sound = None):
    """Break the subject of experiments on purpose, and list which verdicts change (quick profile).

    The exit code is 1 where an experiment with verdicts survives all its mutations.
    """
    mutations, outcomes, rows = listing.load(), {}, []
    chosen = [e.id for e in select(discover().experiments, ids, "quick")
              if mutations.mutations_of(e.id)]
    with TemporaryDirectory() as folder:
        for found in trials(mutations, chosen, only, Path(folder), sound):
            for one in found:
                outcomes.setdefault(one.experiment, []).append(one)
            rows = store(table_file, outcomes, bool(only))      # also of an interrupted pass
    for row in rows:
        typer.echo(f"{row.experiment}: {row.broken} of {row.checks} checks broken by "
                   f"{row.mutations or 'none'}" + (f"; not: {row.unbroken}" * bool(row.unbroken)))
    raise typer.Exit(int(any(row.checks and not row.broken for row in rows)))


def store(table_file, outcomes, add):
    """Write the rows of experiments' `Outcome`s, by experiment, into a table, and return them; add:
    keep what earlier mutations broke.
    """
    rows, stored = {}, table.read(table_file)
    for id, found in outcomes.items():
        row = table.row_of(found, commit(ROOT))
        rows[id] = table.merged(stored.get(id), row) if add else row
    table.write(table_file, (stored | rows).values())
    return list(rows.values())


def trials(mutations, ids, only, folder, sound=None):
    """Yield the list of `Outcome`s of each mutation: experiments are run broken and, unless the
    results in the folder `sound` are given, as they are.
    """
    setting = RunSetting("quick", sound or folder / "sound", targets=targets.load())
    if sound is None:
        run_in_new_process(ids, setting)
    for k, mutation in enumerate(mutations.mutation):
        some = [id for id in ids if listing.matches(mutation.experiments, id)]
        if some and (not only or mutation.name in only):
            typer.echo(f"{mutation.name}: {mutation.breaks} ({len(some)} experiments)")
            broken = setting._replace(folder=folder / str(k))
            run_in_new_process(some, broken, mutation)
            yield [compare(id, mutation, setting.folder, broken.folder, setting.targets)
                   for id in some]
