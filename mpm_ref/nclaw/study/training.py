"""Laws of a study, trained on a run of its scene, and what is to be known of them."""

from dataclasses import asdict

from ... import scene
from ...materials.learned.strain_range import strain_bounds
from ...store.manifest import source_hash, versions
from ...training import part


def drive():
    """The part of the package that trains laws. Raises ValueError without PyTorch."""
    return part("nclaw.train.train", "laws are trained",
                "laws that were trained run, export and plot without it")


def trained(study, observed, checkpoint=None, on_epoch=None, **about):
    """`LearnedLaws` of a study from its run, `Observed`.

    checkpoint and on_epoch: as for `nclaw.train.fit.train`; about: what else is to be known, with
    the `threads` of PyTorch. Raises ValueError without PyTorch and for a checkpoint of another
    training, and `Diverged` of `drive`.
    """
    how, recipe, problem = drive(), study.tables.train, study.problem()
    how.use_threads(about["threads"])
    laws = how.begun(study.tables.method, recipe.seed, study.tables.records, study.material)
    done = how.taught(study.tables.method, recipe, laws, (problem, observed), checkpoint, on_epoch)
    took = {f"{clock}_seconds": round(s, 1) for clock, s in done.meter.total._asdict().items()}
    return how.stored(laws, {
        **about, **identity(study), **took, **done.known, "seen": strain_bounds(observed.F),
        "torch": how.version()})


def identity(study):
    """What laws are of and how they were made: plain values."""
    return {"scene_sha256": scene.digest(study.scene), "title": study.scene.title,
            "dt": study.scene.dt, "method": study.tables.method,
            "recipe": asdict(study.tables.train), "source_sha256": source_hash(),
            "versions": versions()}
