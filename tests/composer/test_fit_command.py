"""`brightfield fit` end to end: a goniometer file becomes a report, a record and a material that a scene can bind."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from composer.cli import main
from interchange.brdf.lafortune import Lafortune
from interchange.formats.document import open_scene

GARNET = Path(__file__).parents[2] / "assets" / "measurements" / "garnet_red_60.brdf"

SCENE = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "World" {
    def Material "Paint" (prepend references = @material.usda@) {}
    def Sphere "Ball" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        rel material:binding = </World/Paint>
    }
}
"""


def table(path, brdf, noise=0.02):
    """A CSV goniometer table in the plane of incidence and beside it, σ included."""
    rng = np.random.default_rng(0)
    lines = ["theta_i (deg),theta_s (deg),delta_phi (deg),R,G,B,sigma R,sigma G,sigma B"]
    for i in (10, 25, 40, 55, 70):
        for s in range(0, 80, 5):
            for d in (0, 90, 150, 180):
                ti, ts, dp = np.radians([i, s, d])
                wi = np.array([np.sin(ti), 0, np.cos(ti)])
                wo = np.array([np.sin(ts) * np.cos(dp), np.sin(ts) * np.sin(dp), np.cos(ts)])
                f = brdf.evaluate(wi, wo)
                sigma = noise * (f + 0.005)
                values = ",".join(f"{x:.8g}" for x in [*(f + sigma * rng.normal(size=3)), *sigma])
                lines.append(f"{i},{s},{d},{values}")
    path.write_text("\n".join(lines) + "\n")


def test_a_fit_writes_a_report_a_record_and_a_material_to_bind(tmp_path, capsys):
    truth = Lafortune((0.3, 0.2, 0.1), [(0.5, 0.4, 0.3)], [(-1, -1, 0.9)], [12])
    table(tmp_path / "paint.csv", truth)
    out = tmp_path / "out"
    words = ["fit", str(tmp_path / "paint.csv"), "--brdf", "lafortune", "--lobes", "1", "--weight", "sigma"]
    assert main([*words, "--out", str(out)]) == 0
    assert "n[0]" in capsys.readouterr().out

    made = json.loads((out / "fit.json").read_text())
    inside = {e["name"]: e["interval_95"] for e in made["estimates"]}
    assert inside["n[0]"][0] - 0.5 < 12 < inside["n[0]"][1] + 0.5
    assert made["measurement"]["samples"] == made["measurement"]["used"] == 320
    assert len(made["measurement"]["sha256"]) == 64
    assert made["chi2_per_degree_of_freedom"] == pytest.approx(
        1, abs=0.15
    )  # 960 readings: 4 standard deviations
    assert made["options"]["held_out"] == ["10°", "25°", "40°", "55°", "70°"]

    (out / "scene.usda").write_text(SCENE)
    (body,) = open_scene(out / "scene.usda").scene().bodies
    assert isinstance(body.material.brdf, Lafortune)
    assert body.material.brdf.n == pytest.approx(
        made["model"]["parameters"]["n"], rel=1e-6
    )  # single precision
    assert body.material.brdf.C[0] == pytest.approx((-1, -1, 0.9), abs=0.02)

    page = (out / "report.html").read_text()
    assert len(re.findall("<svg", page)) >= 3
    assert page.count("<img ") == 2  # the spheres
    assert not re.search(r'(src|href)="(?!data:|#)', page)  # nothing from elsewhere


def test_a_ranking_puts_the_truth_first_and_a_matte_surface_last(tmp_path, monkeypatch, capsys):
    from analysis.fit import fit as fitting
    from interchange.brdf.blinn_phong import BlinnPhong
    from interchange.brdf.lambert import Lambert
    from interchange.brdf.ward import Ward

    few = {m.__name__: m for m in (BlinnPhong, Lambert, Ward)}
    monkeypatch.setattr("analysis.fit.rank.fittable", lambda: few)
    table(tmp_path / "paint.csv", Ward((0.3, 0.2, 0.1), 0.1, 0.2))
    assert main(["fit", str(tmp_path / "paint.csv"), "--brdf", "ward", "--rank", "--json"]) == 0
    made = json.loads(capsys.readouterr().out)
    assert [r["model"] for r in made["ranking"]] == ["Ward", "BlinnPhong", "Lambert"]
    assert fitting.fittable() is not few


def test_spectra_are_fitted_in_three_bands(capsys):
    assert main(["fit", str(GARNET), "--brdf", "ward", "--json"]) == 0
    made = json.loads(capsys.readouterr().out)
    assert made["measurement"]["bands"] == ["R", "G", "B"]
    red, green, _ = made["model"]["parameters"]["diffuse"]
    assert red > 3 * green > 0  # garnet
    assert len(made["measurement"]["columns"]) == 31


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--brdf", "lafortun"], 'No BRDF is called "lafortun". Did you mean "Lafortune"?'),
        (["--brdf", "ward", "--fix", "alpha"], "--fix must be NAME=NUMBER, k=0 say; got alpha."),
        (["--brdf", "ward", "--fix", "alpa=1"], "Ward has no parameter alpa. Did you mean"),
        (["--brdf", "ward", "--weight", "sigma"], "Weights by sigma need a positive standard deviation"),
        (["--brdf", "kurt", "--lobes", "3", "--samples", "5"], "must have more readings than"),
        (["--brdf", "ward", "--max-angle", "100"], "--max-angle must lie in (0, 90] degrees"),
    ],
)
def test_errors_are_one_sentence(words, message, capsys):
    assert main(["fit", str(GARNET), *words]) == 2
    assert message in capsys.readouterr().err


def test_another_file_is_refused(tmp_path, capsys):
    spectrum = GARNET.parent / "cie.stdillum.A.spd"
    assert main(["fit", str(spectrum), "--brdf", "ward"]) == 2
    assert "A BRDF was expected; this is a spectrum." in capsys.readouterr().err
