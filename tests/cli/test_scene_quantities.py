"""Commands measure the quantities of interest that a scene file names, and write them on."""

import json

import pytest
from command_line import assert_told, mpm_ref
from needs_toys import DROP
from sweep_scenes import BOUNCE, FLIGHT

import mpm_ref.cli.limits as limits_command
import mpm_ref.cli.needs as needs_command
import mpm_ref.cli.trade as trade_command
from mpm_ref.scene import load, loads
from mpm_ref.sweep.scene_text import scene_text

FRONT = '\n[[quantity]]\ntype = "front"\nside = "x+"\nat_end = true\n'
KINETIC = '\n[[quantity]]\ntype = "kinetic"\n'
ROOF = '\n[[quantity]]\ntype = "impulse"\npart = "roof"\n'
SMALL = "--workers", "1", "--quiet"


class Asked(Exception):
    """A command has come to its runs; it holds the quantities that it asks for."""


@pytest.mark.parametrize("command", ["trade", "limits", "needs"])
@pytest.mark.parametrize(("tables", "options", "texts"), [
    ("", (), ("positions",)),
    (FRONT + KINETIC + KINETIC, (), ("front:x+@end", "kinetic")),
    (FRONT, ("--quantity", "energy"), ("energy",))])
def test_tables_of_the_scene_are_measured_unless_the_command_line_names_some(
        tmp_path, monkeypatch, command, tables, options, texts):
    def stop(*arguments):
        request = next(one for one in arguments if hasattr(one, "quantities")
                       and hasattr(one, "budget"))
        raise Asked(request.quantities)
    for module, name in ((trade_command, "run_search"), (limits_command, "run_search"),
                         (needs_command, "answer_of")):
        monkeypatch.setattr(module, name, stop)
    (tmp_path / "flight.toml").write_text(FLIGHT + tables)
    with pytest.raises(Asked) as asked:
        mpm_ref(command, tmp_path / "flight.toml", "--out", tmp_path, *options, *SMALL)
    assert asked.value.args == (texts,)


def test_a_recommended_scene_keeps_the_tables(tmp_path):
    (tmp_path / "flight.toml").write_text(FLIGHT + FRONT)
    done = mpm_ref("trade", tmp_path / "flight.toml", "--error", "10%", "--budget", "5min", "--out",
                   tmp_path, *SMALL)
    assert done.exit_code == 0, done.output
    facts = json.loads((tmp_path / "flight.trade.json").read_text())
    assert facts["quantities"] == ["front:x+@end"]
    best = load(tmp_path / "flight.best.toml")
    assert [one.text for one in best.quantity] == ["front:x+@end"]
    assert best.dx != 0.1       # so that what changes the scene did not lose them
    (tmp_path / "larger.toml").write_text(FLIGHT.replace("radius = 0.25", "radius = 0.3") + FRONT)
    done = mpm_ref("trade", tmp_path / "larger.toml", "--like", "flight", "--error", "10%", "--out",
                   tmp_path)
    assert done.stdout.splitlines()[-1] == f"wrote {tmp_path / 'larger.best.toml'}"
    assert load(tmp_path / "larger.best.toml").quantity == best.quantity


def test_a_lean_scene_keeps_the_tables_that_fit_it(tmp_path):
    scene = tmp_path / "drop.toml"
    scene.write_text(DROP + KINETIC + ROOF)
    done = mpm_ref("needs", scene, "--budget", "5min", "--out", tmp_path, "--quantity", "positions",
                   *SMALL)
    assert done.exit_code == 0, done.output
    text = (tmp_path / "drop.lean.toml").read_text()
    lean = load(tmp_path / "drop.lean.toml")
    assert [part.name for part in lean.collider] == ["floor"]
    assert [one.text for one in lean.quantity] == ["kinetic"]
    assert "# No [[quantity]] impulse:roof: part = 'roof': expected one of floor" in text


def test_a_part_whose_impulse_is_asked_stays(tmp_path):
    scene = tmp_path / "drop.toml"
    scene.write_text(DROP + ROOF.replace("roof", "floor").replace("impulse", "force"))
    done = mpm_ref("needs", scene, "--budget", "5min", "--out", tmp_path, *SMALL)
    assert done.exit_code == 0, done.output
    assert "collider floor: cannot be removed (quantity 'force:floor': part" in done.stdout
    lean = load(tmp_path / "drop.lean.toml")
    assert [one.text for one in lean.quantity] == ["force:floor"]


def test_an_implicit_scene_has_no_table_of_an_impulse():
    scene = loads(BOUNCE + ROOF.replace("roof", "floor") + KINETIC)
    implicit = loads('integrator = "hot-plus"\n' + BOUNCE)
    text = scene_text([], implicit, ".", scene.quantity)
    assert "# No [[quantity]] impulse:floor: part = 'floor': implicit steps state no" in text
    assert [one.text for one in loads(text).quantity] == ["kinetic"]


def test_run_ignores_them_and_info_names_them(tmp_path):
    states = []
    for name, tables in (("plain", ""), ("asked", FRONT + KINETIC)):
        scene = tmp_path / f"{name}.toml"
        scene.write_text(FLIGHT + tables)
        assert mpm_ref("run", scene, "--out", tmp_path / f"{name}.h5", "--quiet").exit_code == 0
        facts = json.loads(mpm_ref("info", tmp_path / f"{name}.h5", "--json").stdout)
        part, = facts["manifest"]["parts"]
        states.append((part["state_sha256"], facts["manifest"]["scene_sha256"]))
    assert states[0] == states[1]
    done = mpm_ref("info", tmp_path / "asked.toml")
    assert done.stdout.splitlines()[-1] == "quantities of interest: front:x+@end, kinetic"
    assert "quantities" not in mpm_ref("info", tmp_path / "plain.toml").stdout
    facts = json.loads(mpm_ref("info", tmp_path / "asked.toml", "--json").stdout)
    assert facts["quantities"] == ["front:x+@end", "kinetic"]


@pytest.mark.parametrize("command", ["trade", "limits", "needs", "run", "info"])
def test_a_table_that_does_not_fit_is_told_when_the_scene_is_read(tmp_path, command):
    (tmp_path / "flight.toml").write_text(FLIGHT + ROOF)
    done = mpm_ref(command, tmp_path / "flight.toml")
    assert_told(done, 2, "flight.toml: quantity[0].part = 'roof': expected a quantity without it")


def test_a_text_that_does_not_fit_has_the_sentence_of_the_table(tmp_path):
    (tmp_path / "flight.toml").write_text(FLIGHT)
    done = mpm_ref("trade", tmp_path / "flight.toml", "--quantity", "impulse:roof", "--out",
                   tmp_path, *SMALL)
    assert_told(done, 2, "quantity 'impulse:roof': part = 'roof': expected a quantity without it")
