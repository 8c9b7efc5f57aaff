"""Data sheets by EMVA 1288: what is written is read, units are kept, mistakes are told all at once."""

import json

import pytest

from interchange.formats import emva_sheet
from interchange.formats.emva_sheet import DataSheet, Result
from interchange.problems import FileError

RESULTS = {
    "K": Result(0.25, 0.001),
    "eta": Result(0.62),
    "sigma_d": Result(7.1, 0.02),
    "mu_y.dark": Result(32.0),
    "mu_I.mean": Result(3.5),
    "DSNU1288": Result(1.2),
    "PRNU1288": Result(0.0061),
    "mu_e.sat": Result(15800.0),
}
SHEET = DataSheet(RESULTS, 12, "XY-5", "00712", "RGGB", 2448, 2048, 3.45, 532.0, 6.0)


def written(tmp_path, results, name="sheet.json", **head):
    file = tmp_path / name
    file.write_text(json.dumps({"bits": 12, **head, "results": results}))
    return file


@pytest.mark.parametrize("name", ["sheet.json", "sheet.xml"])
def test_a_sheet_survives_writing(tmp_path, name):
    emva_sheet.write(tmp_path / name, SHEET)
    back = emva_sheet.read(tmp_path / name)
    assert back.results.keys() == SHEET.results.keys()
    for symbol, result in SHEET.results.items():
        assert back.results[symbol].value == pytest.approx(result.value, rel=1e-15)
        assert back.results[symbol].sigma == (pytest.approx(result.sigma) if result.sigma else None)
    assert back == DataSheet(back.results, 12, "XY-5", "00712", "RGGB", 2448, 2048, 3.45, 532.0, 6.0)


def test_a_sheet_is_a_sensor():
    """µ_y = K µ_e + µ_dark reaches 4095 DN at full_well electrons, whatever µ_e.sat; at 6 dB the gain is in K."""
    s = SHEET.sensor()
    assert pytest.approx(0.25) == s.K
    assert s.K * s.full_well / 10 ** (6 / 20) == pytest.approx(4095 - 32)
    assert (s.read_noise, s.dsnu, s.prnu, s.dark_current) == (7.1, 1.2, 0.0061, 3.5)
    assert (s.responsivity, s.quantum_efficiency, s.wavelength_nm) == (0, (0.62,) * 3, (532,) * 3)
    assert (s.mosaic, s.serial_number, s.resolution, s.gain_dB) == ("RGGB", "00712", (2448, 2048), 6)
    assert s.pixel_pitch == pytest.approx((3.45e-6,) * 2)


def test_units_are_what_they_say(tmp_path):
    mixed = {
        "eta": 62,  # percent, as data sheets have it
        "PRNU1288": {"value": 0.5, "unit": "%"},
        "mu_e.sat": {"value": 15.8, "unit": "ke-", "sigma": 0.1},
        "sigma_d": 7.1,
    }
    sheet = emva_sheet.read(written(tmp_path, mixed))
    assert sheet.get("eta") == pytest.approx(0.62)
    assert sheet.get("PRNU1288") == pytest.approx(0.005)
    assert sheet.results["mu_e.sat"] == Result(15800.0, 100.0)
    assert sheet.sensor().full_well == 15800  # without K
    share = emva_sheet.read(written(tmp_path, {"eta": {"value": 0.62, "unit": "1"}, "K": 1}))
    assert share.get("eta") == 0.62
    assert emva_sheet.said("PRNU1288", Result(0.005, 0.0001)) == "0.5 ± 0.01 %"


def test_the_reference_implementations_xml_is_read(tmp_path):
    (tmp_path / "r.xml").write_text(
        "<results><sensitivity><K><section>sensitivity</section><value>0.279</value></K><QE><value>45.4</value></QE>"
        "<u_p_min_area><value>None</value></u_p_min_area></sensitivity>"
        "<spatial><DSNU1288><value>nan</value></DSNU1288><PRNU1288><value>0.43</value></PRNU1288></spatial></results>"
    )
    sheet = emva_sheet.read(tmp_path / "r.xml")
    assert {k: v.value for k, v in sheet.results.items()} == pytest.approx(
        {"K": 0.279, "eta": 0.454, "PRNU1288": 0.0043}
    )


def test_every_mistake_is_told_at_once(tmp_path):
    file = written(
        tmp_path,
        {"Q": 1, "K": -2, "sigma_d": {"value": 3, "unit": "DN"}, "eta": "half", "R": {"value": 1, "note": 2}},
        bit_depth=12,
        gain_dB="loud",
        standard="ISO",
    )
    with pytest.raises(FileError) as caught:
        emva_sheet.read(file)
    told = str(caught.value)
    for part in (
        '"Q" is no symbol',
        "K must be above 0; got -2",
        'unit of sigma_d must be e- or ke-; got "DN"',
        "eta must be a number",
        "value, unit and sigma; got note",
        '"bit_depth" is not known.',
        "gain_dB must be a number",
        "EMVA 1288",
    ):
        assert part in told
    assert told.count(str(file)) == 8


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "must be JSON or XML"),
        ("[1]", 'an object "results"'),
        ("<a/>", "root must be emva1288 or results; got a"),
        ("<emva1288><K>1</emva1288>", "not well-formed"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><emva1288><K>&b;</K></emva1288>', "no document type"),
        ('{"results": {"K": NaN}}', "K must be a number"),
    ],
)
def test_what_is_no_data_sheet_is_said(tmp_path, text, message):
    (tmp_path / "x.json").write_text(text)
    with pytest.raises(FileError, match=message):
        emva_sheet.read(tmp_path / "x.json")


def test_a_sheet_without_a_scale_is_no_sensor(tmp_path):
    with pytest.raises(FileError, match=r"K \(DN/e-\) or mu_e.sat"):
        emva_sheet.read(written(tmp_path, {"eta": 60})).sensor()
    with pytest.raises(FileError, match="mosaic must be one of"):
        emva_sheet.read(written(tmp_path, {"K": 0.5}, mosaic="RGBW")).sensor()
