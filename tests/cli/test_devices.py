"""`asperity devices`: the list fits a terminal, and a check leaves a calibration or a reason."""

import pytest

from asperity.cli import main
from asperity.realtime.devices import catalogue
from asperity.realtime.devices.calibration import load_calibration
from asperity.realtime.devices.haply import service as haply_service
from asperity.realtime.devices.haply.fake_service import FakeService, still_hand
from asperity.realtime.devices.haply.service import HaplyServiceDevice
from asperity.realtime.servo import device_check


@pytest.fixture(autouse=True)
def _config(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))


@pytest.fixture
def _brief(monkeypatch):
    """Check in a third of the time."""
    for name, seconds in (("_LISTEN", 0.3), ("_RISE", 0.3), ("_STAY", 0.15), ("_FALL", 0.1)):
        monkeypatch.setattr(device_check, name, seconds)


def test_the_list_fits_80_columns_and_names_every_backend(capsys, monkeypatch):
    monkeypatch.setattr(haply_service, "attached", lambda: ["049D", "049E", "04A0", "04A1"])
    assert main(["devices"]) == 0
    told = capsys.readouterr().out
    assert max(map(len, told.splitlines()[:9])) <= 80
    for name in catalogue.ENTRIES:
        assert f"\n{name} " in told


@pytest.mark.usefixtures("_brief")
def test_a_check_of_the_fake_moves_it_and_saves_nothing(capsys, tmp_path):
    assert main(["devices", "check", "haply-fake", "--yes"]) == 0
    told = capsys.readouterr().out
    assert "it gave way by " in told
    assert "no calibration is saved" in told
    assert list(tmp_path.rglob("*.toml")) == []


@pytest.mark.usefixtures("_brief")
def test_a_check_saves_what_it_found(capsys, monkeypatch):
    with FakeService(still_hand) as service:
        monkeypatch.setattr(
            "asperity.realtime.devices.haply.service.HaplyServiceDevice.__init__.__kwdefaults__",
            {**HaplyServiceDevice.__init__.__kwdefaults__, "uri": service.uri},
        )
        assert main(["devices", "check", "haply", "--yes"]) == 0
    assert "saved" in capsys.readouterr().out
    assert load_calibration("haply").checked_force == 0.5
    main(["devices"])
    assert "calibrated: haply" in capsys.readouterr().out


@pytest.mark.usefixtures("_brief")
@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["devices", "chek"], "did you mean 'check'"),
        (["devices", "check"], "name of the device is missing"),
        (["devices", "list", "haply"], "takes no name"),
        (["devices", "check", "hapl"], "did you mean 'haply'"),
        (["devices", "check", "replay"], "cannot be checked"),
        (["devices", "check", "haply-fake"], "--yes"),
    ],
)
def test_what_cannot_be_done_is_one_line(arguments, told, capsys, monkeypatch):
    monkeypatch.setattr("builtins.input", lambda _: (_ for _ in ()).throw(EOFError))
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1


def test_doctor_counts_the_backends(capsys):
    from asperity.cli.doctor import _devices

    assert "haply-fake" in _devices()
    assert "asperity devices" in _devices()
