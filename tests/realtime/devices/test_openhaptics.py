"""OpenHaptics: the package itself on a stand-in for libHD, compiled here; and a stand-in for it."""

import shutil
import subprocess
import sys
import textwrap
import types

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.realtime.devices import openhaptics
from asperity.realtime.devices.openhaptics import OpenHapticsDevice
from asperity.realtime.devices.protocol import Reading

PUSH = np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])


def column_by_column(rotation, place):
    m = np.eye(4)
    m[:3, :3], m[:3, 3] = rotation, place
    return m.T.tolist()


class Stub(types.SimpleNamespace):
    """pyOpenHaptics.hd; the scheduler is the test."""

    HD_CURRENT_TORQUE, HD_CURRENT_VELOCITY, HD_CURRENT_ANGULAR_VELOCITY = 1, 2, 3
    hduVector3Dd = list  # noqa: N815

    def __init__(self):
        super().__init__()
        # To the right, up, towards the user; mm.
        self.matrix = column_by_column(np.eye(3), [20.0, 10.0, -30.0])
        self.forces, self.torques, self.code, self.frames = [], [], 0, 0
        self.values = {2: [100.0, 200.0, 300.0], 3: [4.0, 5.0, 6.0]}
        self.id, self.raises, self.running = 7, None, False

    def init_device(self, name):
        print("Unable to initialize" if self.id is None else "fine")
        return self.id

    def enable_force(self):
        print("Force feedback enabled!")

    def start_scheduler(self):
        self.running = True

    def stop_scheduler(self):
        self.running = False

    def close_device(self, number):
        self.closed = number

    def get_current_device(self):
        return self.id

    def begin_frame(self, number):
        if self.raises:
            raise self.raises
        self.frames += 1

    def end_frame(self, number):
        self.frames -= 1

    def set_force(self, force):
        self.forces.append(force)

    def get_transform(self):
        return self.matrix

    def get_buttons(self):
        return 3

    def _set_doublev(self, code, value, kind):
        self.torques.append(value)

    def _get_doublev(self, code, kind):
        return self.values[code]

    def _get_error(self):
        return types.SimpleNamespace(errorCode=self.code)


@pytest.fixture
def stub(monkeypatch):
    stub = Stub()
    scheduling = types.SimpleNamespace(hdAsyncSheduler=lambda callback: None)
    monkeypatch.setattr(openhaptics, "_import", lambda: (stub, scheduling))
    return stub


@pytest.fixture
def device(stub):
    device = OpenHapticsDevice(model="premium-1.5-6dof")
    device.open()
    yield device
    device.close()


def test_its_axes_and_millimetres_become_ours(stub, device, capsys):
    assert device._callback(None) == 1
    reading = Reading.empty()
    assert device.read(reading)
    np.testing.assert_allclose(reading.pose, [0.02, 0.03, 0.01, 1, 0, 0, 0])
    np.testing.assert_allclose(reading.twist, [0.1, -0.3, 0.2, 4, -6, 5])
    assert reading.buttons == 3
    assert capsys.readouterr().out == ""  # the package prints, a library should not


@pytest.mark.parametrize(("theirs", "ours"), [(0, [1, 0, 0]), (1, [0, 0, 1]), (2, [0, -1, 0])])
def test_a_turn_about_an_axis_of_theirs_is_one_about_that_axis(stub, device, theirs, ours):
    c, s = np.cos(0.6), np.sin(0.6)
    i, j = [(1, 2), (2, 0), (0, 1)][theirs]
    rotation = np.eye(3)
    rotation[i, i] = rotation[j, j] = c
    rotation[i, j], rotation[j, i] = -s, s
    stub.matrix = column_by_column(rotation, [0.0, 0.0, 0.0])
    device._callback(None)
    reading = Reading.empty()
    device.read(reading)
    np.testing.assert_allclose(reading.pose[3:], [np.cos(0.3), *(np.sin(0.3) * np.array(ours))])


def test_the_wrench_goes_out_in_their_axes_and_units(stub, device):
    device.write(PUSH)
    device._callback(None)
    assert stub.forces[-1] == [1.0, 3.0, -2.0]
    np.testing.assert_allclose(stub.torques[-1], [100.0, 300.0, -200.0])  # mN m
    reading = Reading.empty()
    device.read(reading)
    theirs = np.dot(stub.forces[-1], stub.values[2]) * 1e-3
    assert np.dot(PUSH[:3], reading.twist[:3]) == pytest.approx(theirs)


def test_whatever_happens_the_scheduler_goes_on(stub, device):
    reading = Reading.empty()
    for trouble in (KeyError(0x200), RuntimeError("two\nlines"), ValueError()):
        stub.raises = trouble
        assert device._callback(None) == 1
        device.read(reading)
        assert reading.error
        assert "\n" not in reading.error
    stub.raises = None
    stub.code = 0x0200  # warm motors
    assert device._callback(None) == 1
    assert device.read(reading)
    assert reading.error == "OpenHaptics reports error 0x0200"
    stub.code = 0
    for place in ([np.nan, 0, 0], [1e9, 0, 0]):
        stub.matrix = column_by_column(np.eye(3), place)
        assert device._callback(None) == 1
        assert not device.read(reading)
        assert "out of reach" in reading.error
    device.write(np.full(6, np.inf))
    device._callback(None)
    assert np.isfinite(stub.forces).all()
    assert stub.frames == 0  # every frame that was begun was ended


def test_opening_says_what_is_wrong(stub, monkeypatch):
    stub.id = None
    with pytest.raises(AsperityError, match="cannot open 'Default Device'"):
        OpenHapticsDevice().open()
    monkeypatch.undo()
    monkeypatch.setitem(sys.modules, "pyOpenHaptics", None)
    with pytest.raises(AsperityError, match=r"asperity\[openhaptics\]"):
        OpenHapticsDevice().open()


_LIBRARY = r"""
#include <pthread.h>
#include <string.h>
#include <unistd.h>
typedef struct { unsigned code; int internal; unsigned device; } Error;
typedef unsigned (*Callback)(void *);
double force[3];
int frames, running;
static Callback tick;
static pthread_t thread;
unsigned hdInitDevice(const char *name) { return 5; }
void hdEnable(unsigned what) {}
unsigned hdGetCurrentDevice(void) { return 5; }
void hdBeginFrame(unsigned device) { frames++; }
void hdEndFrame(unsigned device) {}
void hdDisableDevice(unsigned device) {}
void hdSetDoublev(unsigned what, const double *v) { if (what == 0x2700) memcpy(force, v, 24); }
void hdGetIntegerv(unsigned what, int *v) { *v = 2; }
void hdGetDoublev(unsigned what, double *v) {
    static const double m[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 20, 10, -30, 1};
    if (what == 0x2052) memcpy(v, m, sizeof m);
    else { v[0] = 100; v[1] = 200; v[2] = 300; }
}
Error hdGetError(void) { Error e = {0x0200, 0, 5}; return e; }
static void *run(void *unused) {
    while (running) { if (!tick(0)) break; usleep(1000); }
    return 0;
}
unsigned long hdScheduleAsynchronous(Callback f, void *d, unsigned short p) { tick = f; return 1; }
void hdStartScheduler(void) { running = 1; pthread_create(&thread, 0, run, 0); }
void hdStopScheduler(void) { running = 0; pthread_join(thread, 0); }
"""


@pytest.mark.skipif(sys.platform != "linux", reason="libHD.so")
def test_the_package_itself_on_a_stand_in_for_the_library(tmp_path):
    from importlib.util import find_spec

    if find_spec("pyOpenHaptics") is None or shutil.which("cc") is None:
        pytest.skip("pyOpenHaptics is not installed, or there is no C compiler")
    (tmp_path / "hd.c").write_text(_LIBRARY)
    library = tmp_path / "libHD.so"
    command = ["cc", "-shared", "-fPIC", "-Wl,-soname,libHD.so", "-o", library, tmp_path / "hd.c"]
    subprocess.run([*command, "-lpthread"], check=True, timeout=60)
    script = f"""
        import ctypes, time
        import numpy as np
        lib = ctypes.CDLL({str(library)!r}, ctypes.RTLD_GLOBAL)  # found by its name from now on
        from asperity.realtime.devices.openhaptics import OpenHapticsDevice
        from asperity.realtime.devices.protocol import Reading

        def until(condition):
            end = time.monotonic() + 10.0
            while not condition():
                assert time.monotonic() < end
                time.sleep(0.001)

        force = (ctypes.c_double * 3).in_dll(lib, "force")
        frames = ctypes.c_int.in_dll(lib, "frames")
        device, reading = OpenHapticsDevice(), Reading.empty()
        device.open()
        until(lambda: device.read(reading))
        assert np.allclose(reading.pose, [0.02, 0.03, 0.01, 1, 0, 0, 0]), reading
        assert np.allclose(reading.twist[:3], [0.1, -0.3, 0.2]), reading
        assert reading.buttons == 2
        wrench = np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0])
        until(lambda: device.write(wrench) or list(force) == [1.0, 3.0, -2.0])
        # It tells of warm motors in every frame, for which the package has no name, and goes on.
        assert device.read(reading) or True
        since = frames.value
        until(lambda: frames.value > since + 20)
        until(lambda: list(force) == [0.0, 0.0, 0.0])  # writes stopped
        device.close()
        print("fits")
    """
    ended = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert ended.stdout.strip() == "fits", ended.stderr
