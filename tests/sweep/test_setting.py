import numpy as np
import pytest
from sweep_scenes import BOUNCE, FLIGHT, scene_of

from mpm_ref.scene import SceneError, build, digest, loads
from mpm_ref.sweep.setting import in_seconds, scene_at, setting
from mpm_ref.trade.candidates import single_knobs


def particles(scene):
    return len(build(scene).bodies[0].id)


def test_the_empty_setting_is_the_scene():
    scene = scene_of(BOUNCE)
    assert digest(scene_at(scene, setting())) == digest(scene)


def test_a_finer_grid_has_as_many_points_per_cell():
    scene = scene_of(BOUNCE)
    fine = scene_at(scene, setting(dx=0.5))
    assert fine.dx == 0.05
    assert particles(fine) == 4 * particles(scene)


@pytest.mark.parametrize(("sampling", "share"), [
    ('{ type = "lattice", counts = [6, 6] }', 4), ('{ type = "lattice", spacing = 0.1 }', 4),
    ('{ type = "poisson", count = 40 }', 4)])
def test_other_samplings_follow_the_grid(sampling, share):
    scene = loads(BOUNCE.replace("velocity", f"sampling = {sampling}\nvelocity"))
    assert particles(scene_at(scene, setting(dx=0.5))) == pytest.approx(share * particles(scene))
    assert particles(scene_at(scene, setting(particles=2.0))) == pytest.approx(
        share * particles(scene))


@pytest.mark.parametrize(("counts", "factor", "expected"), [
    ("[1, 1]", 0.75, 1), ("[2, 1]", 0.25, 2), ("[1, 1]", 2.0, 4), ("[6, 6]", 0.25, 4)])
def test_fewer_points_of_a_lattice_are_not_more(counts, factor, expected):
    sampling = f'{{ type = "lattice", counts = {counts} }}'
    scene = loads(BOUNCE.replace("velocity", f"sampling = {sampling}\nvelocity"))
    assert particles(scene_at(scene, setting(particles=factor))) == expected


def test_knobs_change_what_they_name():
    scene = scene_of(BOUNCE)
    assert scene_at(scene, setting(cfl=0.9)).cfl == 0.9
    assert scene_at(scene, setting(degree=3)).scheme.degree == 3
    assert scene_at(scene, setting(transfer="flip 0.95")).step_scheme.flip == 0.95
    eps = loads("scheme = { mass_eps = 1e-3 }" + BOUNCE)
    assert scene_at(eps, setting(transfer="apic")).step_scheme.mass_eps == 1e-3
    assert scene_at(eps, setting(transfer="flip 0.95")).step_scheme.mass_eps == 0.0
    assert scene_at(scene, setting(transfer="apic rpic 0.5")).step_scheme.rpic == 0.5
    relaxed = scene_at(eps, setting(transfer="mls relaxation 1e-3"))
    assert (relaxed.step_scheme.relaxation, relaxed.step_scheme.mass_eps) == (1e-3, 0.0)
    assert scene_at(relaxed, setting(transfer="pic")).step_scheme.relaxation == 0.0
    assert scene_at(relaxed, setting(dx=0.5)).step_scheme.relaxation == 0.5e-3
    assert scene_at(scene, setting(sampling="poisson")).body[0].sampling.per_cell == 2
    assert particles(scene_at(scene, setting(particles=1.5))) == particles(scene) * 9 // 4
    averaged = scene_at(scene, setting(f_bar=True))
    assert averaged.scheme.f_bar
    assert not scene_at(averaged, setting(f_bar=False)).scheme.f_bar
    assert not scene_at(averaged, setting(integrator="hot-plus")).scheme.f_bar
    with pytest.raises(SceneError, match="implicit steps average no volumes"):
        scene_at(scene, setting(integrator="hot-plus", f_bar=True))
    smooth = scene_at(scene, setting(transfer="flip 0.95", gimp=2.0))
    assert smooth.step_scheme.gimp == 2.0
    assert scene_at(smooth, setting(particles=1.5)).scheme.gimp == 3.0
    assert scene_at(smooth, setting(particles=0.25)).scheme.gimp == 1.0
    for other in (setting(degree=2), setting(degree=1), setting(transfer="mls"), setting(gimp=0.0),
                  setting(integrator="hot-plus")):
        assert scene_at(smooth, other).scheme.gimp == 0.0
    with pytest.raises(SceneError, match=r"gimp = 2.0 with transfer 'mls'"):
        scene_at(scene, setting(gimp=2.0))
    implicit = scene_at(scene, setting(integrator="hot-plus"))
    assert (implicit.integrator, implicit.step_scheme.transfer) == ("hot-plus", "apic")
    assert scene_at(implicit, setting(eps=1e-3)).solver.eps == 1e-3
    with pytest.raises(SceneError, match="solves nothing"):
        scene_at(scene, setting(eps=1e-3))


def test_precision_is_a_knob_of_explicit_scenes():
    scene = scene_of(BOUNCE)
    rounded = scene_at(scene, setting(precision="single"))
    assert rounded.step_scheme.precision == "single"
    assert scene_at(rounded, setting(precision="double")).step_scheme.precision == "double"
    assert scene_at(rounded, setting(integrator="hot-plus")).step_scheme.precision == "double"
    with pytest.raises(SceneError, match="implicit steps compute in double"):
        scene_at(scene, setting(integrator="hot-plus", precision="single"))


def test_boundary_is_a_knob_of_scenes_with_colliders():
    scene = scene_of(BOUNCE)
    at_surface = scene_at(scene, setting(boundary="surface"))
    assert at_surface.boundary == "surface"
    assert scene_at(at_surface, setting(integrator="hot-plus")).boundary == "nodes"
    assert setting(boundary="surface") in single_knobs(scene)
    with pytest.raises(SceneError, match="has no collider"):
        scene_at(scene_of(FLIGHT), setting(boundary="surface"))
    assert "boundary" not in {name for knob in single_knobs(scene_of(FLIGHT))
                              for name, _ in knob.items}


@pytest.mark.parametrize("text", ["apic 0.5", "mls relaxation", "mls relaxation -1", "flip, 0.9"])
def test_texts_that_are_no_transfer_are_refused(text):
    with pytest.raises(SceneError, match=r"expected a text such as mls, flip 0\.95"):
        scene_at(scene_of(BOUNCE), setting(transfer=text))


@pytest.mark.parametrize(("keys", "factor", "longest"), [
    ("longest = 0.01", 0.5, 0.005), ("longest = 0.01", 2.0, 0.02), ("interval = 0.02", 0.5, 0.01),
    ("interval = 0.02", 2.0, None), ("longest = 0.01\ninterval = 0.004", 0.25, 0.001),
    ("", 0.5, None), ("interval = 0.02", 1.0, None)])
def test_the_bound_of_the_time_step_follows_the_grid(keys, factor, longest):
    scene = scene_at(loads(f"{keys}\n{FLIGHT}"), setting(dx=factor))
    assert scene.longest == longest
    assert scene.interval == loads(f"{keys}\n{FLIGHT}").interval


def test_a_step_by_cfl_has_no_other_bound():
    assert scene_at(loads(f"longest = 0.01\n{FLIGHT}"), setting(cfl=0.9)).longest is None


def test_another_scene_takes_the_same_knobs():
    other = loads(FLIGHT.replace("end = 0.2", "end = 0.2\ntitle = \"other\""))
    changed = scene_at(scene_of(FLIGHT), setting(scene="b", dx=0.5), {"b": other})
    assert (changed.title, changed.dx) == ("other", 0.05)


def test_an_implicit_scene_becomes_explicit():
    scene = loads('integrator = "hot"\nlongest = 0.01\nsolver = { eps = 1e-5 }' + FLIGHT)
    explicit = scene_at(scene, setting(integrator="explicit", cfl=0.5))
    assert (explicit.integrator, explicit.solver, explicit.longest) == ("explicit", None, None)


def test_steps_become_seconds():
    scene = loads(FLIGHT.replace("end = 0.2", "dt = 0.001\nsteps = 200\nevery = 10"))
    tables = in_seconds(scene)
    assert tables["end"] == pytest.approx(0.2)
    assert tables["interval"] == pytest.approx(0.01)
    with pytest.raises(SceneError, match="without dt"):
        in_seconds(loads(FLIGHT.replace("end = 0.2", "steps = 200")))


def test_a_fixed_dt_follows_the_grid_and_ends_with_cfl():
    scene = loads("dt = 0.001" + FLIGHT)
    assert scene_at(scene, setting(dx=0.5)).dt == 0.0005
    assert scene_at(scene, setting(cfl=0.5)).dt is None


def test_walls_stay_in_place():
    scene = loads(FLIGHT + "\n[walls]\nlow = [3, 3]\nhigh = [19, 'open']\n")
    fine, coarse = scene_at(scene, setting(dx=0.5)), scene_at(scene, setting(dx=2.0))
    place = [((w.low[0] - 1) * s.dx, (w.high[0] + 1) * s.dx)
             for s in (scene, fine, coarse) for w in [s.walls]]
    assert place[1] == pytest.approx(place[0])
    assert place[2] == pytest.approx(place[0])
    assert fine.walls.high[1] == "open"
    with pytest.raises(SceneError, match="between two nodes"):
        scene_at(scene, setting(dx=3.0))


def test_bad_settings_get_one_sentence():
    with pytest.raises(ValueError, match="knob 'speed'"):
        setting(speed=1)
    with pytest.raises(SceneError, match="degree"):
        scene_at(scene_of(BOUNCE), setting(degree=4))
    with pytest.raises(SceneError, match="integrator"):
        scene_at(scene_of(BOUNCE), setting(integrator="euler"))


def test_settings_are_values():
    a = setting(cfl=0.9) | setting(dx=0.5)
    assert a == setting(dx=0.5, cfl=0.9)
    assert len({a, setting(cfl=0.9, dx=0.5)}) == 1
    assert a.get("dx") == 0.5
    assert a.text == "dx x 0.5, cfl 0.9"
    assert np.isnan(a.get("particles", np.nan))
