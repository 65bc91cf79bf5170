"""Bodies whose names look like something else in a golden file."""

from dataclasses import replace

import pytest
from goldens import kernel_arrays, stretched
from goldens_hot import EPS, problem_of

from mpm_ref import oracle
from mpm_ref.core.boundary import Collider
from mpm_ref.core.levelset import half_space
from mpm_ref.core.surface import SurfaceConditions
from mpm_ref.explicit import Scheme
from mpm_ref.hot.methods import options_of
from mpm_ref.oracle.schema import reserved_names


def named(problem, *names):
    """The problem with its bodies renamed."""
    return replace(problem, bodies=tuple(
        body._replace(name=name) for body, name in zip(problem.bodies, names, strict=True)))


@pytest.mark.parametrize("names", [("bar", "v"), ("report", "x"), ("cycle", "probe1"),
                                   ("nodes of steel", "base")])
def test_names_of_what_stands_elsewhere_are_taken(names, tmp_path):
    problem = named(stretched(), *names)
    golden, other = tmp_path / "golden.h5", tmp_path / "other.h5"
    oracle.record(problem, golden, 2)
    oracle.write(other, kernel_arrays(problem))
    report = oracle.check(golden, other)
    assert (report.agrees, report.compared, report.missing) == (True, 48, ())
    assert oracle.check(golden, golden).compared == 48


@pytest.mark.parametrize("name", sorted(reserved_names("explicit")))
def test_names_that_clash_are_refused(name, tmp_path):
    with pytest.raises(ValueError, match=f"body '{name}': this names an array, or a group, of ev"):
        oracle.record(named(stretched(), name, "metal"), tmp_path / "golden.h5", 1)


def test_averaged_volumes_are_refused(tmp_path):
    problem = replace(stretched(), scheme=Scheme(f_bar=True))
    with pytest.raises(ValueError, match="f_bar = true: golden files have no arrays of averaged"):
        oracle.record(problem, tmp_path / "golden.h5", 1)


def test_single_precision_is_refused(tmp_path):
    problem = replace(stretched(), scheme=Scheme(precision="single"))
    with pytest.raises(ValueError, match="'single': golden files hold arrays of double precision"):
        oracle.record(problem, tmp_path / "golden.h5", 1)


def test_gimp_is_refused(tmp_path):
    problem = replace(stretched(), scheme=Scheme(transfer="pic", gimp=2.0))
    with pytest.raises(ValueError, match=r"gimp = 2.0: golden files have weights of splines"):
        oracle.record(problem, tmp_path / "golden.h5", 1)


@pytest.mark.parametrize(("changes", "message"), [
    ({}, "friction with an implicit integrator: its plain twin"),
    ({"scheme": Scheme()}, "'mls' with an implicit integrator: its plain twin"),
    ({"conditions": None, "scheme": Scheme(transfer="apic", mass_eps=1e-7)}, "mass_eps = 1e-07"),
    ({"conditions": None, "solver": options_of("hot", return_map="implicit")}, "return_map = 'im"),
])
def test_forms_of_implicit_steps_without_twin_are_refused(changes, message, tmp_path):
    implicit = {"integrator": "implicit", "scheme": Scheme(transfer="apic")}
    with pytest.raises(ValueError, match=message):
        oracle.record(replace(stretched(), **(implicit | changes)), tmp_path / "golden.h5", 1)


def test_conditions_at_surfaces_are_refused(tmp_path):
    floor = SurfaceConditions((Collider(half_space((0.0, 0.0), (0.0, 1.0))),))
    with pytest.raises(ValueError, match=r'boundary = "surface": expected "nodes" for adj'):
        oracle.record(replace(stretched(), conditions=floor), tmp_path / "golden.h5", 1)


@pytest.mark.parametrize("name", ["bar", "report", "probe3", "nodes2", "dv", "load", "E_trial"])
def test_implicit_steps_have_more(name, tmp_path):
    with pytest.raises(ValueError, match=f"body '{name}': .* of every implicit step"):
        oracle.record(named(problem_of(2), name, "hard"), tmp_path / "golden.h5", 1)


def test_an_implicit_body_may_be_named_like_a_particle_array(tmp_path):
    problem, golden = named(problem_of(2), "nodes of steel", "v"), tmp_path / "golden.h5"
    oracle.record(problem, golden, 1, eps=EPS)
    assert oracle.check(golden, golden).agrees
