"""`mpm-ref law export`: what it writes suffices to answer as the laws do, in any language."""

import json
from itertools import permutations
from math import erf, sqrt

import numpy as np
import pytest
import rom_toys
from command_line import assert_told, mpm_ref
from small_laws import identified, saved

from mpm_ref.materials import NoFlow
from mpm_ref.materials.learned import response, spline, stretch_network
from mpm_ref.materials.learned.contraction import Contraction
from mpm_ref.materials.learned.energetic import Energetic
from mpm_ref.materials.learned.table import KINDS
from mpm_ref.materials.learned.weights import LawWeights, LearnedLaws
from mpm_ref.nclaw import export

gelu = np.vectorize(lambda z: 0.5 * z * (1.0 + erf(z / sqrt(2.0))))
SIZES = {"Energetic": (4, 6, 1), "Contraction": (3, 6, 2), "StretchStress": (3, 6, 5, 3),
         "ReleasedStretchStress": (3, 6, 5, 3), "PlainStress": (9, 6, 9),
         "PlainCorrection": (9, 6, 9)}      # of others than (13, 8, 6, 9)
KNOTS = spline.knots()
PAIRS = [       # of kinds that are trained together
    (response.Stress(2e4), response.Correction(0.1)),
    (response.SymmetricStress(2e4), response.Correction(0.1)),
    (response.PlainStress(2e4), response.PlainCorrection(0.1)),
    (stretch_network.StretchStress(2e4), NoFlow()),
    (stretch_network.ReleasedStretchStress(2e4), NoFlow()),
    (spline.SplineStress(), NoFlow()), (spline.ReleasedSplineStress(1e3), NoFlow()),
    (Energetic(), Contraction(2e-3))]


def softplus(z):
    return np.log1p(np.exp(z))


def elu(z):
    return np.where(z > 0.0, z, np.expm1(z))


def trained(kind, seed):
    """A law with random layers."""
    if isinstance(kind, NoFlow):
        return LawWeights((), kind)
    if type(kind) in spline.READINGS:
        values = np.random.default_rng(seed).normal(size=(len(KNOTS), 3))
        return LawWeights(((values, np.zeros(3)),), kind)
    layers = rom_toys.layers(SIZES.get(type(kind).__name__, (13, 8, 6, 9)), seed)
    if isinstance(kind, Energetic):
        layers = [(abs(W), b) for W, b in layers]
    return LawWeights(tuple(layers), kind)


def laws_of(elastic, plastic):
    return LearnedLaws(trained(elastic, 1), trained(plastic, 2), {"seed": 1})


# An implementation that knows the file alone.

def svd(F):
    """F = U diag(s) V^T, as the file says."""
    U, s, Vt = np.linalg.svd(F)
    for A in (U, Vt):
        turned = np.linalg.det(A) < 0.0
        s[-1] *= -1.0 if turned else 1.0
        A[:, -1] *= -1.0 if turned and A is U else 1.0
        A[-1] *= -1.0 if turned and A is Vt else 1.0
    return U, s, Vt.T


def layers_of(law):
    depth = sum(name.startswith("W") for name in law)
    return [(law[f"W{k}"], law[f"b{k}"]) for k in range(depth)]


def network(a, law, between):
    *inner, (W, b) = layers_of(law)
    for V, c in inner:
        a = between(a @ V + c)
    return a @ W + b


def read(F, law):
    """What the first layer of a law reads."""
    s, J, one = svd(F)[1], np.linalg.det(F), np.eye(3)
    if law["kind"] == "Energetic":
        cof = J * np.linalg.inv(F).T
        return np.array([(F * F).sum() - 3.0 - 2.0 * np.log(J), (J - 1.0) ** 2, J - 1.0 - np.log(J),
                         (cof * cof).sum() - 3.0 - 4.0 * np.log(J)])[[0, 3, 1, 2]]
    if law["kind"] == "Contraction":
        theta = np.log(s).sum()
        size = np.linalg.norm(np.log(s) - theta / 3.0)
        return np.log(1.0 + np.array([size, max(theta, 0.0), max(-theta, 0.0)]) / law["strain"])
    inputs = {0: (), 3: s - 1.0, 9: (F - one).ravel(),
              13: np.concatenate([s - 1.0, (F.T @ F - one).ravel(), [J - 1.0]])}
    return inputs[len(law["reads"])]


def stress(F, law):
    """tau of an elastic law."""
    kind, a = law["kind"], read(F, law)
    U, s, V = svd(F)
    R, J = U @ V.T, np.linalg.det(F)
    if kind in ("Stress", "SymmetricStress", "PlainStress"):
        Y = network(a, law, gelu).reshape(3, 3)
        T = 0.5 * (Y + Y.T)
        answers = {"Stress": R @ T @ F.T, "SymmetricStress": R @ T @ R.T, "PlainStress": Y @ F.T}
        return law["unit"] * answers[kind]
    if kind == "Energetic":
        b, one = F @ F.T, np.eye(3)
        T = (2.0 * (b - one), 2.0 * (np.trace(b) * b - b @ b) - 4.0 * one,
             2.0 * J * (J - 1.0) * one, (J - 1.0) * one)
        h = 1e-6 * np.eye(4)
        slopes = [(network(a + d, law, softplus) - network(a - d, law, softplus))[0] / 2e-6
                  for d in h]
        return law["unit"] * sum(g * A for g, A in zip(slopes, T, strict=True))
    y = {"StretchStress": averaged, "ReleasedStretchStress": lambda s, law: law["unit"] * network(
        s - 1.0, law, elu)}.get(kind, splined)(s, law)
    return U @ np.diag(y * s) @ U.T


def averaged(s, law):
    """y as the mean over the orders in which s is read."""
    y, orders = np.zeros(3), [list(order) for order in permutations(range(3))]
    for order in orders:
        y[order] += law["unit"] * network(s[order] - 1.0, law, elu) / len(orders)
    return y


def splined(s, law):
    """y of splines."""
    def at(k, x):
        p = int((law["breaks"] < x).sum())
        return sum(c * (x - law["origins"][p]) ** (3 - m)
                   for m, c in enumerate(law["tables"][k][p]))
    J = s.prod()
    return np.array([at(0, s[i]) + at(2, J) * J / s[i]
                     + sum(at(1, s[i] * s[j]) * s[j] for j in range(3) if j != i)
                     for i in range(3)])


def returned(F, law):
    """F after the return map of a plastic law."""
    if law["kind"] == "NoFlow":
        return F
    U, s, V = svd(F)
    y = network(read(F, law), law, gelu)
    if law["kind"] == "Contraction":
        a, b = softplus(y)
        theta = np.log(s).sum()
        left = np.exp(-b) * theta if theta > 0.0 else theta
        return U @ np.diag(np.exp(np.exp(-a) * (np.log(s) - theta / 3.0) + left / 3.0)) @ V.T
    Y = y.reshape(3, 3)
    turned = U @ V.T @ (0.5 * (Y + Y.T)) if law["kind"] == "Correction" else Y
    return F + law["alpha"] * turned


# The command.

def exported(folder, laws, ending):
    """Tables of the file that the command writes: {"elastic", "plastic", "check"}."""
    out = folder / f"laws.layers{ending}"
    done = mpm_ref("law", "export", saved(folder, laws), "--out", out, "--overwrite")
    assert done.exit_code == 0, done.output
    if ending == ".json":
        return {name: {key: np.array(value) if isinstance(value, list) else value
                       for key, value in table.items()} if isinstance(table, dict) else table
                for name, table in json.loads(out.read_text()).items()}
    with np.load(out) as file:
        flat = dict(file)
    return {name: {key.removeprefix(f"{name}_"): a[()] for key, a in flat.items()
                   if key.startswith(f"{name}_")} for name in ("elastic", "plastic", "check")}


@pytest.mark.parametrize("ending", [".npz", ".json"])
@pytest.mark.parametrize("kinds", PAIRS, ids=lambda kinds: type(kinds[0]).__name__)
def test_the_file_alone_suffices_to_answer(tmp_path, kinds, ending):
    found = exported(tmp_path, laws_of(*kinds), ending)
    elastic, plastic, check = (found[name] for name in ("elastic", "plastic", "check"))
    assert (elastic["kind"], plastic["kind"]) == tuple(type(kind).__name__ for kind in kinds)
    tau = np.array([stress(F, elastic) for F in check["F"]])
    size = np.abs(check["tau"]).max()
    assert size > 10.0
    if elastic["kind"] == "ReleasedStretchStress":      # axes are not determined of equal stretches
        apart = np.diff(np.linalg.svd(check["F"], compute_uv=False)).max(axis=1) < -1e-3
        assert apart.sum() == export.RANDOM + 1         # and where there is shear
        tau[~apart] = check["tau"][~apart]
    # Slopes of the energy are taken by differences here, with an error of about 1e-16/1e-6.
    close = 1e-8 if elastic["kind"] == "Energetic" else 1e-13
    assert np.abs(tau - check["tau"]).max() < close * size
    F = np.array([returned(F, plastic) for F in check["F"]])
    assert np.abs(F - check["returned"]).max() < 1e-13
    for law, name in ((elastic, "elastic_read"), (plastic, "plastic_read")):
        a = np.array([read(F, law) for F in check["F"]])
        assert check[name].shape == (len(check["F"]), len(law["reads"]))
        assert np.abs(a - check[name]).max(initial=0.0) < 1e-12


def test_questions_are_about_more_than_rest():
    F = export.questions(3)
    assert np.array_equal(F[0], np.eye(3))
    assert (np.linalg.det(F) > 0.3).all()
    s = np.linalg.svd(F, compute_uv=False)
    assert (s.max(), s.min()) == pytest.approx((1.3, 0.7), abs=0.1)
    assert np.abs(np.linalg.det(F) - 1.0).max() > 0.2
    assert np.abs(F[5:] - np.eye(3)).max(axis=(1, 2)).min() > 0.3       # turned


def test_every_kind_is_put_into_words():
    assert set(export.ANSWERS) == set(KINDS.values())


def test_words_name_each_number_in_its_order(tmp_path):
    found = exported(tmp_path, laws_of(*PAIRS[0]), ".json")["elastic"]
    assert list(found["reads"][[0, 3, 4, 11, 12]]) == [
        "s_0 - 1", "(F^T F)_00 - 1", "(F^T F)_01", "(F^T F)_22 - 1", "det F - 1"]
    assert "tau = unit R T F^T" in found["answers"]
    plain = exported(tmp_path, laws_of(*PAIRS[2]), ".npz")["elastic"]
    assert list(plain["reads"][:2]) == ["F_00 - 1", "F_01"]


def test_identified_laws_say_their_constants(tmp_path):
    found = exported(tmp_path, identified(), ".json")
    mu, lam = identified().elastic.kind
    assert (found["elastic"]["mu"], found["elastic"]["lam"]) == (mu, lam)
    tau = found["check"]["tau"][2]
    J = 1.0 + export.SPREAD
    assert tau[0, 0] == pytest.approx(2.0 * mu * (J - 1.0) * J + lam * (J - 1.0) * J)


def test_the_usual_name_is_that_of_the_weights(tmp_path):
    file = saved(tmp_path, laws_of(*PAIRS[0]))
    done = mpm_ref("law", "export", file)
    assert done.stdout == (f"{tmp_path / 'laws.layers.npz'}: elastic Stress 13-8-6-9, plastic "
                           f"Correction 13-8-6-9; {len(export.questions(3))} questions with "
                           "answers\n")


def test_files_that_stand_are_kept(tmp_path):
    file = saved(tmp_path, laws_of(*PAIRS[0]))
    before = file.read_bytes()
    assert_told(mpm_ref("law", "export", file, "--out", file, "--overwrite"), 2,
                "these are the weights; name another file")
    assert file.read_bytes() == before
    assert mpm_ref("law", "export", file).exit_code == 0
    assert_told(mpm_ref("law", "export", file), 2, "laws.layers.npz exists: add --overwrite")
    assert mpm_ref("law", "export", file, "--overwrite").exit_code == 0


@pytest.mark.parametrize(("options", "status", "words"), [
    (("--out", "laws.txt"), 2, "ends in .npz or .json"),
    (("--out", "none/laws.json"), 4, "there is no folder"),
])
def test_what_an_export_needs_is_said_first(tmp_path, monkeypatch, options, status, words):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("mpm_ref.cli.law.export_tables", None)
    assert_told(mpm_ref("law", "export", saved(tmp_path, identified()), *options), status, words)


@pytest.mark.parametrize("content", [b"", b"x", b"PK"])
def test_files_that_hold_no_laws_are_refused(tmp_path, content):
    (tmp_path / "laws.npz").write_bytes(content)
    assert_told(mpm_ref("law", "export", tmp_path / "laws.npz"), 2, "laws.npz is ")
    assert [file.name for file in tmp_path.iterdir()] == ["laws.npz"]
