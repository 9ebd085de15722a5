"""Files of the toolkit: written and read to the last digit, and bad ones refused in one line."""

import numpy as np
import pytest
from texture_models import model_of

from asperity.errors import AsperityError
from asperity.vibrotactile.hatt import read_hatt, write_hatt
from asperity.vibrotactile.lsf import frequencies_of


def arma():
    ma = np.tile(frequencies_of([1.0, 0.5, 0.2]), (4, 1))
    return model_of(ma=ma, gain=np.array([1.0, 2.0, 3.0, 4.0]) / 3.0)


@pytest.mark.parametrize("model", [model_of(), arma()], ids=["ar", "arma"])
def test_a_model_round_trips(tmp_path, model):
    write_hatt(model, tmp_path / "model.xml")
    back = read_hatt(tmp_path / "model.xml")
    assert (back.name, back.rate, back.friction) == (model.name, model.rate, model.friction)
    for name in ("speeds", "forces", "ar", "ma", "variance", "gain"):
        assert getattr(back, name) == pytest.approx(getattr(model, name), rel=1e-12, abs=1e-15)
    assert (back.mesh.triangles == model.mesh.triangles).all()
    for place in ((0.03, 0.3), (0.09, 0.9), (0.2, 0.1)):
        assert back.filter_at(*place).ar == pytest.approx(model.filter_at(*place).ar, abs=1e-9)


# As the files of the toolkit are laid out, with the fields that asperity has no use for; numbers
# are made up, in the toolkit's six digits.
_LIKE_PENN = """<?xml version="1.0" encoding="utf-8"?>
<modelSet texture="0">
   <material>Made Up</material>
   <AccelUnits>m/s^2</AccelUnits><SpeedUnits>mm/s</SpeedUnits><ForceUnits>N</ForceUnits>
   <SampleRate>1000</SampleRate>
   <mu>0.205881</mu>
   <htmlPicture>..\\..\\x.bmp</htmlPicture>
   <renderPicture>./images/x.bmp</renderPicture>
   <numMod>3</numMod><numTri>1</numTri>
   <maxSpeed>200.000000</maxSpeed><maxForce>2.000000</maxForce>
   <speedList type="array"><value>0.000000</value><value>200.000000</value>
      <value>100.000000</value></speedList>
   <forceList type="array"><value>0.000000</value><value>0.500000</value>
      <value>2.000000</value></forceList>
   <tri type="array"><value>3</value><value>1</value><value>2</value></tri>
   <DTpicture>..\\x.png</DTpicture>
   <numARCoeff>2</numARCoeff><numMACoeff>1</numMACoeff>
   {models}
</modelSet>
"""
_MODEL = """<model><modNum>{i}</modNum>
   <ARcoeff><value>1.0</value><value>-0.5</value><value>0.2</value></ARcoeff>
   <ARlsf><value>{a}</value><value>1.900000</value></ARlsf>
   <MAcoeff><value>1.0</value><value>0.0</value></MAcoeff>
   <MAlsf><value>1.570796</value></MAlsf>
   <var>{i}.000000</var><gain>2.500000</gain>
   <speedMod>{v}</speedMod><forceMod>{f}</forceMod></model>"""


def like_penn():
    rows = [(1, 0.9, 0, 0), (2, 0.8, 200, 0.5), (3, 0.7, 100, 2)]
    return _LIKE_PENN.format(
        models="\n".join(_MODEL.format(i=i, a=a, v=v, f=f) for i, a, v, f in rows)
    )


def test_the_toolkits_own_layout_is_read(tmp_path):
    (tmp_path / "Models_Made Up.xml").write_text(like_penn())
    model = read_hatt(tmp_path / "Models_Made Up.xml")
    assert (model.name, model.rate, model.friction, model.order) == ("Made Up", 1000, 0.205881, 2)
    assert model.speeds == pytest.approx([0.0, 0.2, 0.1])
    assert model.mesh.triangles.tolist() == [[2, 0, 1]]
    middle = model.filter_at(0.1, 2.5 / 3)
    assert middle.variance == pytest.approx(2.0)
    assert frequencies_of(middle.ar) == pytest.approx([0.8, 1.9])
    assert middle.ma[0] == pytest.approx(2.5)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("<modelSet", "<!DOCTYPE x [<!ENTITY a 'b'>]><modelSet", "declares a document type"),
        ("<modelSet texture", "<other texture", "not XML"),
        ("</modelSet>", "", "not XML"),
        ("<numMod>3", "<numMod>4", "speedList> holds 3 values; valid: 4"),
        ("<numTri>1", "<numTri>7", "1 <tri> where <numTri> is 7"),
        ("<value>0.9</value>", "<value>2.0</value>", "model 1: AR line spectral"),
        ("<value>0.9</value>", "<value>nan</value>", "ARlsf>, value 1, must be a finite"),
        ("<var>2.000000", "<var>-2", "model 2: variance must be 0 or above"),
        ("<value>3</value><value>1", "<value>9</value><value>1", "whole numbers from 1 to 3"),
        ("<SampleRate>1000</SampleRate>", "", "<SampleRate> is missing"),
        ("<SpeedUnits>mm/s", "<SpeedUnits>m/s", "SpeedUnits> is 'm/s'; valid: 'mm/s'"),
        ("<speedMod>200", "<speedMod>150", "model 2: <speedMod> is 150, but its list has 200"),
        ("<numARCoeff>2", "<numARCoeff>1000000", "from 1 to 128"),
        ("<gain>2.500000</gain>", "", "model 1: <gain> is missing"),
    ],
)  # fmt: skip
def test_bad_files_are_one_clear_line(tmp_path, old, new, told):
    text = like_penn()
    assert old in text
    (tmp_path / "bad.xml").write_text(text.replace(old, new))
    with pytest.raises(AsperityError) as error:
        read_hatt(tmp_path / "bad.xml")
    assert told in str(error.value)
    assert "\n" not in str(error.value)
    assert "bad.xml" in str(error.value)


def test_entities_are_never_expanded(tmp_path):
    bomb = "<!DOCTYPE m [<!ENTITY a 'ha'>" + "".join(
        f"<!ENTITY {chr(98 + i)} '{f'&{chr(97 + i)};' * 10}'>" for i in range(9)
    )
    (tmp_path / "bomb.xml").write_text(bomb + "]><modelSet>&j;</modelSet>")
    with pytest.raises(AsperityError, match="declares a document type"):
        read_hatt(tmp_path / "bomb.xml")


def test_what_is_no_file_or_no_model(tmp_path):
    with pytest.raises(AsperityError, match="no such texture model"):
        read_hatt(tmp_path / "none.xml")
    (tmp_path / "deep.xml").write_text("<a>" * 5000 + "</a>" * 5000)
    with pytest.raises(AsperityError, match="17 deep"):
        read_hatt(tmp_path / "deep.xml")
    (tmp_path / "x.xml").write_bytes(b"\x00\xff\x00")
    with pytest.raises(AsperityError, match="not XML"):
        read_hatt(tmp_path / "x.xml")
    (tmp_path / "tap.xml").write_text("<tapSet/>")
    with pytest.raises(AsperityError, match="instead of <modelSet>"):
        read_hatt(tmp_path / "tap.xml")
