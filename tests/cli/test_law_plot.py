"""`mpm-ref law plot`: curves along one-element paths, learned beside true."""

import csv
from collections import defaultdict
from math import isnan

import matplotlib as mpl
import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from matplotlib.figure import Figure
from small_laws import DT, FLOWING, NO_FLOW, NU, E, identified, saved, write_scene

from mpm_ref.materials import FluidProjection, VonMises, make_law
from mpm_ref.materials.learned import learned_flow, learned_law
from mpm_ref.materials.learned.response import Correction
from mpm_ref.materials.learned.strain_range import strain_bounds, within_bounds
from mpm_ref.materials.learned.weights import LawWeights
from mpm_ref.nclaw import paths
from mpm_ref.nclaw.study import curves

mpl.use("Agg")

TAU_Y, STEPS = 2e3, 40
MU, LAM = make_law("fixed_corotated", E=E, nu=NU)


def plot(folder, laws, *options, edits=()):
    scene = write_scene(folder, *edits)
    return mpm_ref("law", "plot", saved(folder, laws), "--against", scene, "--steps", STEPS,
                   *options)


def table(folder, laws, *options, **how):
    """{(path, last strain): columns} of the numbers, and what the command said."""
    done = plot(folder, laws, "--csv", folder / "curves.csv", *options, **how)
    assert done.exit_code == 0, done.output
    found = defaultdict(lambda: defaultdict(list))
    with open(folder / "curves.csv") as file:
        for row in csv.DictReader(file):
            if float(row["t"]) == 0.0:
                started = found[len(found)]
            for name, value in row.items():
                started[name].append(value if name in ("path", "stress") else float(value or -1))
    return [{name: np.array(column) for name, column in rows.items()}
            for rows in found.values()], done


# The paths.

def test_stresses_of_the_true_law_are_those_on_paper(tmp_path):
    """tau = 2 mu (F - R) F^T + lam (J - 1) J I (NCLAW-eq12)."""
    rows, _ = table(tmp_path, identified(0.5 * E))
    assert [rows_of["path"][0] for rows_of in rows] == [
        "uniaxial", "uniaxial", "shear", "volumetric", "volumetric"]
    assert [rows_of["strain"][-1] for rows_of in rows] == pytest.approx([0.1, -0.1, 0.1, 0.1, -0.1])
    expected = {
        "uniaxial": lambda e: 2.0 * MU * e * (1.0 + e) + LAM * e * (1.0 + e),
        "shear": lambda g: 2.0 * MU * (g - g / np.sqrt(4.0 + g**2)),
        "volumetric": lambda e: (2.0 * MU * e * (1.0 + e)
                                 + LAM * ((1.0 + e) ** 3 - 1.0) * (1.0 + e) ** 3)}
    for found in rows:
        stress = expected[found["path"][0]](found["strain"])
        assert found["truth"] == pytest.approx(stress, abs=1e-9 * E)
        assert found["learned"] == pytest.approx(0.5 * stress, abs=1e-9 * E)
        assert found["t"] == pytest.approx(DT * np.arange(STEPS + 1))


def test_how_far_off_is_said_of_the_largest_true_stress(tmp_path):
    said = plot(tmp_path, identified(0.75 * E)).stdout.splitlines()
    assert said[-1] == str(tmp_path / "laws.curves.png")
    assert len(said) == 6
    assert all(line.endswith("off by at most 25 % of it") for line in said[:-1])
    assert said[0].startswith("uniaxial to +0.1: tau_xx up to ")


def test_what_flows_is_also_unloaded(tmp_path):
    """Yield stress TAU_Y bounds |dev tau|; unloading is elastic, and leaves a stress behind."""
    rows, _ = table(tmp_path, identified(name="hencky", flow=VonMises(2.0 * TAU_Y, 0.0)),
                    edits=[FLOWING])
    assert [found["path"][0] for found in rows[-2:]] == ["uniaxial cycle", "shear cycle"]
    cycle, shear = rows[-2:]
    assert cycle["strain"][[0, STEPS, -1]] == pytest.approx([0.0, -0.1, 0.0])
    assert shear["strain"][[0, STEPS, 2 * STEPS, 3 * STEPS, -1]] == pytest.approx(
        [0.0, 0.1, 0.0, -0.1, 0.0], abs=1e-12)
    # In shear dev tau = tau_xy (e1 e2 + e2 e1) nearly, of norm sqrt(2) tau_xy.
    assert shear["truth"].max() == pytest.approx(TAU_Y / np.sqrt(2.0), rel=5e-3)
    assert shear["learned"].max() == pytest.approx(2.0 * TAU_Y / np.sqrt(2.0), rel=2e-2)
    slope = np.diff(shear["truth"]) / np.diff(shear["strain"])
    assert slope[[0, STEPS]] == pytest.approx(MU, rel=2e-2)         # loading, and back again
    assert abs(slope[STEPS - 1]) < 1e-2 * MU
    assert cycle["truth"][-1] > 0.5 * TAU_Y


def test_a_return_map_acts_once_a_step():
    """A correction that adds ALPHA e1 e1^T to F, step by step, at rest."""
    W, b, alpha = np.zeros((13, 9)), np.zeros(9), 1e-4
    b[0] = 1.0
    flow = learned_flow(LawWeights(((W, b),), Correction(alpha)))
    law = learned_law(identified().elastic)
    for steps in (3, 6):
        still = paths.path("still", paths.path_families(3)["shear"], (0.0, 0.0), steps)
        found = paths.path_response(law, flow, still, DT)
        assert found.F[-1] == pytest.approx(np.diag([1.0 + steps * alpha, 1.0, 1.0]), abs=1e-14)
        assert found.tau[0] == pytest.approx(np.zeros((3, 3)), abs=1e-9)
        assert found.tau[-1, 0, 0] > 2.0 * MU * steps * alpha


def test_fluids_carry_j_alone():
    """tau = lam J (J - 1) I; a shear changes nothing, and what carries F gives the same."""
    law = make_law("fluid", lam=1e5)
    rows = curves.compare_curves((law, NO_FLOW), (law, FluidProjection()),
                                 paths.monotone(3, 0.1, 5), DT)
    for row in rows:
        assert row.learned == pytest.approx(row.truth, abs=1e-7)
    shear, swollen = rows[2], rows[3]
    assert shear.truth == pytest.approx(np.zeros(6), abs=1e-9)
    assert isnan(shear.error)
    assert swollen.truth[-1] == pytest.approx(1e5 * 1.1**3 * (1.1**3 - 1.0))
    end = paths.path_response(law, NO_FLOW, swollen.path, DT)
    assert end.F[-1] == pytest.approx(1.1 * np.eye(3))
    assert end.tau[-1] == pytest.approx(swollen.truth[-1] * np.eye(3))


def test_a_law_that_breaks_down_is_told_with_the_strain(tmp_path):
    W = np.zeros((13, 9))
    W[12, 0] = 1e3                          # of det F - 1
    endless = LawWeights(((W, np.zeros(9)),), Correction(1e308))
    said = plot(tmp_path, identified()._replace(plastic=endless)).stdout.splitlines()
    assert said[0].endswith(f"the learned law breaks down at strain {0.1 / STEPS:.4g}")
    assert (tmp_path / "laws.curves.png").exists()


# What training saw.

def test_bounds_are_those_of_stretches_and_volumes():
    F = np.array([np.diag([1.2, 1.0, 0.9]), np.diag([1.0, 1.1, 1.0])])
    bounds = strain_bounds(F[:, None])
    assert bounds["low"] == pytest.approx([1.1, 1.0, 0.9, 1.08])
    assert bounds["high"] == pytest.approx([1.2, 1.0, 1.0, 1.1])
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    asked = np.array([turn @ F[0], np.diag([1.15, 1.0, 0.95]), np.diag([1.3, 1.0, 0.9]),
                      np.diag([1.2, 1.0, 1.0]), np.full((3, 3), np.nan)])
    assert within_bounds(asked, bounds).tolist() == [True, True, False, False, False]


def test_what_training_saw_is_marked(tmp_path):
    F = np.eye(3), np.diag([1.05, 1.0, 1.0]), np.diag([1.0, 1.0, 0.9])
    bounds = strain_bounds(np.array(F))
    laws = identified()._replace(about={"seen": bounds})
    (up, down, *_), _ = table(tmp_path, laws)
    assert (up["in_range"] == (up["strain"] < 0.0501)).all()
    assert (down["in_range"] == 1.0).all()
    assert (table(tmp_path, identified())[0][0]["in_range"] == -1.0).all()      # left empty


def lines_of(monkeypatch, folder, laws, **how):
    """{panel: [(style, strains drawn)] of the learned law} and the texts of the legend."""
    shown = []
    monkeypatch.setattr(Figure, "savefig", lambda self, file: (
        shown.append(self), open(file, "wb").close()))
    assert plot(folder, laws, **how).exit_code == 0
    figure = shown[0]
    drawn = {axes.get_title(): [(line.get_linestyle(), line.get_xdata()[np.isfinite(
        line.get_ydata())]) for line in axes.lines if line.get_color() == curves.LEARNED]
        for axes in figure.axes}
    return drawn, [text.get_text() for text in figure.legends[0].get_texts()], figure


def test_lines_are_dotted_beyond_what_training_saw(tmp_path, monkeypatch):
    F = np.eye(3), np.diag([1.05, 1.0, 1.0]), np.diag([1.0, 1.0, 0.9])
    bounds = strain_bounds(np.array(F))
    laws = identified()._replace(about={"seen": bounds})
    drawn, words, _ = lines_of(monkeypatch, tmp_path, laws)
    (solid, inside), (dotted, outside), (_, down), (_, beyond) = drawn["uniaxial"]
    assert (solid, dotted) == ("-", ":")
    assert (inside[0], inside[-1]) == pytest.approx((0.0, 0.05))
    assert (outside[0], outside[-1]) == pytest.approx((0.05, 0.1))
    assert (down[-1], len(beyond)) == (pytest.approx(-0.1), 0)
    assert words == ["truth", "learned", "learned, beyond the strains of training"]


def test_lines_say_where_strains_of_training_end(tmp_path):
    """Strains are whole steps of 0.1 / STEPS; stretches were seen up to 1.05 and down to 0.9."""
    F = np.eye(3), np.diag([1.05, 1.0, 1.0]), np.diag([1.0, 1.0, 0.9])
    bounds = strain_bounds(np.array(F))
    stretched, pressed, *_ = plot(tmp_path, identified()._replace(about={"seen": bounds})
                                  ).stdout.splitlines()
    assert stretched.startswith("uniaxial to +0.1")
    assert stretched.endswith("; at 0.0525 beyond the strains of training")
    assert pressed.startswith("uniaxial to -0.1")
    assert "beyond" not in pressed


def test_weights_that_do_not_know_are_drawn_without(tmp_path, monkeypatch):
    drawn, words, figure = lines_of(monkeypatch, tmp_path, identified())
    assert set(drawn) == {"uniaxial", "shear", "volumetric"}
    assert [len(x) for style, x in drawn["shear"]] == [STEPS + 1, 0]
    assert words == ["truth", "learned"]
    assert figure.legends[0].get_title().get_text() == (
        "the weights do not say which strains training saw")


# Files.

@pytest.mark.parametrize(("ending", "begins"), [
    (".png", b"\x89PNG"), (".pdf", b"%PDF"), (".svg", b"<?xml")])
def test_pictures_are_what_their_names_say(tmp_path, ending, begins):
    out = tmp_path / f"curves{ending}"
    assert plot(tmp_path, identified(), "--out", out).exit_code == 0
    assert out.read_bytes().startswith(begins)


@pytest.mark.parametrize(("options", "status", "words"), [
    (("--strain", 1), 2, "--strain 1: expected a number above 0 and below 1"),
    (("--strain", 0), 2, "--strain 0: expected a number above 0 and below 1"),
    (("--strain", "nan"), 2, "--strain nan: expected"),
    (("--out", "curves.csv"), 2, "ends in .png or .pdf or .svg"),
    (("--csv", "curves.png"), 2, "--csv curves.png: expected a name that ends in .csv"),
    (("--out", "none/curves.png"), 4, "there is no folder"),
    (("--csv", "none/curves.csv"), 4, "there is no folder"),
])
def test_what_a_picture_needs_is_said_first(tmp_path, monkeypatch, options, status, words):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("mpm_ref.cli.law.compare_with_truth", None)
    assert_told(plot(tmp_path, identified(), *options), status, words)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["cube.toml", "laws.npz"]
