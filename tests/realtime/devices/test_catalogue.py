"""Names, options, presets, and what is found of each backend."""

import re
import sys
import types
from pathlib import Path

import numpy as np
import pytest

from asperity.cli.realtime_run import DeviceOptions, servo_spec
from asperity.errors import AsperityError
from asperity.realtime.devices import catalogue, force_dimension
from asperity.realtime.devices.calibration import Calibrated, Calibration, save_calibration
from asperity.realtime.devices.catalogue import ENTRIES, MODELS, backend_statuses, device
from asperity.realtime.devices.haply import service
from asperity.realtime.devices.orientation import TurnRate, quaternion_of, unit_quaternion
from asperity.realtime.devices.presets import PRESETS, limits_of
from asperity.realtime.devices.protocol import finite_wrench
from asperity.scene.builtin import load_scene


@pytest.fixture(autouse=True)
def _config(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))


HARDWARE = [name for name, entry in ENTRIES.items() if not entry.steady]


@pytest.mark.parametrize("name", [*HARDWARE, *MODELS])
def test_every_name_makes_a_device_with_limits_before_it_is_opened(name):
    made = device(name)
    assert made.limits.max_force > 0.0
    assert made.name in ENTRIES


@pytest.mark.parametrize("name", ENTRIES)
def test_every_device_is_in_both_tables_of_its_page(name):
    page = (Path(__file__).parents[3] / "docs" / "devices.md").read_text("utf-8")
    overview, when_writes_stop = page.split("## When writes stop")
    for text in (overview, when_writes_stop.partition("\n## ")[0]):
        assert re.search(rf"^\| [^|]*`{name}[:`]", text, re.M), name


def test_a_device_whose_poses_are_those_of_the_scene_is_not_mapped(tmp_path):
    path = tmp_path / "p.csv"
    path.write_text("0, 0, 0, 0.01, 1, 0, 0, 0\n0.5, 0, 0, 0.01, 1, 0, 0, 0\n")
    scene, options = load_scene("probe-plate"), DeviceOptions()
    replay = servo_spec(scene, f"replay:{path}", options, None, None)
    assert (replay.in_scene, replay.seconds) == (True, 0.5)
    assert not servo_spec(scene, "haply-fake", options, None, None).in_scene


def test_a_model_has_its_own_limits():
    assert device("sigma.7").limits == PRESETS["sigma.7"]
    assert device("touch").limits == PRESETS["touch"]
    assert device("sigma.7", limits=PRESETS["omega.6"]).limits == PRESETS["omega.6"]


def test_the_calibration_is_loaded_by_name():
    assert device("haply").calibration.home == (0.0, -0.12, 0.15)  # the backend's
    save_calibration("touch", Calibration(home=(0.0, 0.0, 0.01)))
    made = device("touch")
    assert isinstance(made, Calibrated)
    assert made.calibration.home == (0.0, 0.0, 0.01)
    assert device("omni").calibration.home == (0.0, 0.0, 0.0)
    assert not isinstance(device("touch", calibrated=False), Calibrated)


def test_unknown_names_and_options_get_the_nearest():
    with pytest.raises(AsperityError, match=r"unknown device 'haply-fak'.*did you mean"):
        device("haply-fak")
    with pytest.raises(AsperityError, match=r"option of the device haply .*did you mean 'uri'"):
        device("haply", url="ws://localhost")
    with pytest.raises(AsperityError, match="replay needs the option source="):
        device("replay")
    with pytest.raises(AsperityError, match=r"no such file of poses: nothing.csv"):
        device("replay:nothing.csv")
    with pytest.raises(AsperityError, match="unknown device preset 'omega6'"):
        limits_of("omega6")


def test_a_file_is_replayed_by_name(tmp_path):
    path = tmp_path / "p.csv"
    path.write_text("0, 0.1, 0, 0, 1, 0, 0, 0\n1, 0.2, 0, 0, 1, 0, 0, 0\n")
    assert device(f"replay:{path}", end="loop").seconds == 1.0


def test_what_lacks_is_said_with_how_to_get_it(monkeypatch):
    monkeypatch.setattr(catalogue, "is_installed", lambda entry: entry.package != "pyOpenHaptics")
    monkeypatch.setattr(service, "attached", lambda: [])
    found = {finding.entry.name: finding for finding in backend_statuses()}
    assert list(found) == list(ENTRIES)
    assert found["openhaptics"].advice.startswith("pip install 'asperity[openhaptics]'; and Open")
    assert found["haply"].advice == "needs Haply Hub or the Inverse service"
    assert found["haply-fake"].advice == ""
    assert found["replay"].advice == ""


def test_packages_that_fail_or_chatter_do_not_spoil_the_list(monkeypatch, capfd):
    api = types.ModuleType("HaplyHardwareAPI")
    api.detect_inverse3s = lambda: print("chatter") or ["/dev/ttyACM0"]
    monkeypatch.setitem(sys.modules, "HaplyHardwareAPI", api)

    def broken():
        raise OSError("libdrd")

    monkeypatch.setattr(catalogue, "is_installed", lambda entry: True)
    monkeypatch.setattr(force_dimension, "attached", broken)
    monkeypatch.setattr(service, "attached", lambda: ["049D"])
    found = {finding.entry.name: finding for finding in backend_statuses()}
    assert found["haply-serial"].attached == "Inverse3 on /dev/ttyACM0"
    assert (found["haply"].attached, found["haply"].advice) == ("Inverse3 049D", "")
    assert found["force-dimension"].attached == "unknown (OSError)"
    assert "SDK" in found["force-dimension"].advice
    assert capfd.readouterr().out == ""


def test_presets_are_the_published_software_limits():
    table = {
        "touch": (3.3, 0.0, 400.0, 4.0), "omni": (3.3, 0.0, 700.0, 5.0),
        "premium-1.5-6dof": (8.5, 0.188, 800.0, 5.0), "omega.6": (12.0, 0.0, 5000.0, 30.0),
        "sigma.7": (12.0, 0.2, 4000.0, 30.0), "lambda.7": (12.0, 0.2, 8000.0, 30.0),
    }  # fmt: skip
    for name, row in table.items():
        limits = PRESETS[name]
        found = (limits.max_force, limits.max_torque, limits.max_stiffness, limits.max_damping)
        assert found == row
    for limits in PRESETS.values():
        assert (limits.torque_dof > 0) == (limits.max_torque > 0.0)
        assert (limits.max_rotational_stiffness > 0.0) == (limits.max_torque > 0.0)


def test_orientations_and_their_rate():
    rng = np.random.default_rng(1)
    from scipy.spatial.transform import Rotation

    for vector in rng.normal(size=(50, 3)) * 3.0:
        rotation = Rotation.from_rotvec(vector)
        w, x, y, z = quaternion_of(rotation.as_matrix().tolist())
        assert (Rotation.from_quat([x, y, z, w]) * rotation.inv()).magnitude() < 1e-7
    for matrix in (np.zeros((3, 3)), np.full((3, 3), np.nan), 3.0 * np.eye(3)):
        with pytest.raises(ValueError, match="orientation"):
            quaternion_of(matrix.tolist())
    with pytest.raises(ValueError, match="norm nan"):
        unit_quaternion(float("nan"), 0.0, 0.0, 0.0)
    rate, omega = TurnRate(), np.array([1.0, -2.0, 0.5])
    for i in range(200):
        x, y, z, w = Rotation.from_rotvec(omega * i * 1e-3).as_quat()
        rate.add(i * 1e-3, (w, x, y, z) if i % 2 else (-w, -x, -y, -z))  # either sign is the same
    np.testing.assert_allclose(rate.rate, omega, rtol=1e-4)
    rate.add(5.0, (1.0, 0.0, 0.0, 0.0))  # after a gap nothing is known
    assert rate.rate == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("wrench", [None, "six", [1, 2], [[1.0]] * 6, [1, 2, 3, 4, 5, "x"], {}, 6])
def test_what_is_no_wrench_is_none(wrench):
    assert finite_wrench(wrench) is None
    assert finite_wrench(np.arange(6.0)) == (0, 1, 2, 3, 4, 5)
