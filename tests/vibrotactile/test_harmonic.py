"""Lines locked to position: found where they are, kept, stored, and never found where none are."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal
from texture_models import model_of

from asperity.errors import AsperityError
from asperity.vibrotactile.fit import FitSettings, fit
from asperity.vibrotactile.harmonic import HarmonicModel, as_noise
from asperity.vibrotactile.hatt import read_hatt, write_hatt
from asperity.vibrotactile.lsf import coefficients_of, power_gain, reflections_of
from asperity.vibrotactile.model import TextureModel
from asperity.vibrotactile.model_file import read_model, write_model
from asperity.vibrotactile.rates import at_rate
from asperity.vibrotactile.signals import Exploration
from asperity.vibrotactile.synthesis import Synthesiser, reflect, through_lattice

RATE = 2000.0


def slide(speed, force, parts=(), noise=1.0, tone=0.0, seed=0, seconds=2.0):
    """Return a slide: (wavelength, amplitude) locked to position, noise, a tone of 170 Hz."""
    n, rng = int(seconds * RATE), np.random.default_rng(seed)
    x = rng.uniform(0.0, 1.0) + speed * np.arange(n) / RATE
    signals = [
        force * a * np.cos(2 * np.pi * x / length + i) for i, (length, a) in enumerate(parts)
    ]
    hiss = signal.lfilter([1.0], [1.0, -1.2, 0.6], rng.standard_normal(n))
    hiss *= noise * force / hiss.std()
    hum = tone * np.sin(2 * np.pi * 170.0 * np.arange(n) / RATE)
    return Exploration(
        f"{speed} m/s {force} N", RATE, sum(signals, hiss + hum), np.full(n, speed),
        np.full(n, force), np.full(n, 0.2 * force), np.ones(n, bool),
    )  # fmt: skip


def grid(parts=(), seed=0, speeds=(0.06, 0.12, 0.25), **options):
    pairs = [(v, f) for v in speeds for f in (0.3, 0.9)]
    return [slide(v, f, parts, seed=seed + i, **options) for i, (v, f) in enumerate(pairs)]


def test_periods_and_amplitudes_are_found_from_the_slides():
    parts = ((1.5e-3, 2.0), (0.75e-3, 1.0), (0.9e-3, 0.8))
    model = fit(grid(parts)).model
    assert isinstance(model, HarmonicModel)
    assert sorted(model.periods) == pytest.approx([0.9e-3, 1.5e-3], rel=1e-3)
    lines = dict(zip(np.round(1e3 / model.wavenumbers, 3), range(3), strict=True))
    size = model.amplitudes_at(0.17, 0.6)
    for length, amplitude in parts:
        assert size[lines[round(1e3 * length, 3)]] == pytest.approx(0.6 * amplitude, rel=0.1)
    frequency = np.linspace(0.0, 0.5 * RATE, 20001)
    density = model.filter_at(0.17, 0.6).density(frequency, RATE)
    assert np.sqrt(np.trapezoid(density, frequency)) == pytest.approx(0.6, rel=0.1)


@pytest.mark.parametrize("seed", range(5))
def test_noise_has_no_periods_nor_has_a_tone_of_the_tool(seed):
    assert fit(grid(seed=100 * seed)).model.periods.size == 0
    # A tone of 170 Hz is as clear as a line can be, but it does not move with the speed.
    assert fit(grid(seed=100 * seed, tone=2.0)).model.periods.size == 0


def test_at_one_speed_nothing_can_be_told_from_a_tone():
    assert fit(grid(((2e-3, 2.0),), speeds=(0.1,))).model.periods.size == 0


def test_a_slide_along_one_path_over_a_random_surface_has_no_periods():
    """All slides see the same bumps at the same places, so their spectra scatter alike."""
    rng = np.random.default_rng(5)
    place = np.linspace(0.0, 0.6, 60001)
    height = signal.lfilter([1.0], [1.0, -1.9, 0.905], rng.standard_normal(place.size))
    runs = []
    for speed in (0.06, 0.12, 0.25):
        for force in (0.3, 0.9):
            one = slide(speed, force, noise=1e-3)
            x = speed * np.arange(one.vibration.size) / RATE
            vibration = force * np.interp(x, place, height) / height.std()
            runs.append(replace(one, vibration=vibration + one.vibration))
    assert fit(runs).model.periods.size == 0


def test_the_line_follows_the_travelled_distance():
    model = fit(grid(((2e-3, 2.0),), noise=0.02)).model
    n = 4000
    speeds = 0.15 + 0.08 * np.sin(2 * np.pi * np.arange(n) / n)
    made = Synthesiser(model, seed=1).block(speeds, np.full(n, 0.6))
    x = np.cumsum(speeds) / RATE
    there = 2.0 * np.abs(np.exp(-2j * np.pi * x / 2e-3) @ made) / n
    assert there == pytest.approx(1.2, rel=0.1)
    # Sample by sample is as in a block, and at rest there is silence.
    one = Synthesiser(model, seed=1)
    assert [one.next(v, 0.6) for v in speeds[:50]] == pytest.approx(made[:50])
    rest = Synthesiser(model, seed=1).block(np.zeros(500), np.full(500, 0.6))
    assert np.abs(rest).max() == 0.0
    air = Synthesiser(model, seed=1).block(np.full(500, 0.1), np.zeros(500))
    assert np.abs(air).max() == 0.0


def test_between_models_the_rms_is_between_theirs():
    """Two filters far apart ring differently: a mixed excitation does not keep the RMS."""
    rms = np.array([1.0, 1.0, 2.0, 2.0])
    plain = model_of()
    gains = [
        power_gain(plain.filter_at(v, f).ar)
        for v, f in zip(plain.speeds, plain.forces, strict=True)
    ]
    variance = rms**2 / gains
    fields = {"name": "x", "rate": 1000.0, "speeds": plain.speeds, "forces": plain.forces,
              "ar": plain.ar, "variance": variance}  # fmt: skip
    made = Synthesiser(HarmonicModel(**fields), seed=0)
    y = made.block(np.full(60000, 0.06), np.full(60000, 0.6))
    assert y.std() == pytest.approx(1.5, rel=0.03)
    y = Synthesiser(TextureModel(**fields), seed=0).block(np.full(60000, 0.06), np.full(60000, 0.2))
    assert abs(y.std() - 1.0) > 0.05


@pytest.mark.parametrize("order", [1, 2, 3, 5, 8, 20])
def test_the_kernel_knows_the_reflection_coefficients_of_a_filter(order):
    lsf = (np.arange(order) + 1.0 + 0.3 * np.sin(np.arange(order))) * np.pi / (order + 1.5)
    a = coefficients_of(lsf)
    found = np.empty(order)
    reflect(a, np.empty(order + 1), found)
    np.testing.assert_allclose(found, reflections_of(a), rtol=1e-9, atol=1e-12)
    noise, states = np.random.default_rng(order).standard_normal(2000), np.zeros(order)
    made = [through_lattice(one, found, states) for one in noise]
    plain = signal.lfilter([1.0], a, noise) / np.sqrt(power_gain(a))
    np.testing.assert_allclose(made, plain, atol=1e-9)


def test_a_filter_that_changes_at_every_sample_keeps_its_size():
    """In direct form it grows without bounds: two filters of near-lines, in turn."""
    rng = np.random.default_rng(0)
    lsf = np.sort(rng.uniform(0.0, 0.7 * np.pi, (4, 4)), axis=1)
    lsf[:, 1::2] = lsf[:, 0::2] + 0.01
    lsf = np.sort(lsf, axis=1)
    gains = [power_gain(coefficients_of(row)) for row in lsf]
    model = harmonic(
        ar=lsf, variance=1.0 / np.array(gains), lines=np.zeros((4, 3)), slowest=0.0, lightest=0.0
    )
    n = 40000
    speeds = np.where(np.arange(n) // 15 % 2, model.speeds.min(), model.speeds.max())
    made = Synthesiser(model, seed=0).block(speeds, np.full(n, model.forces.mean()))
    assert made.std() == pytest.approx(1.0, rel=0.1)
    corners = [model.filter_at(v, model.forces.mean()) for v in np.unique(speeds)]
    grown, past = np.zeros(n), np.zeros(4)
    for i in range(2000):
        one = corners[int(speeds[i] == speeds.max())]
        grown[i] = np.sqrt(one.variance) * rng.standard_normal() - one.ar[1:] @ past
        past = np.append(grown[i], past[:-1])
    assert grown[:2000].std() > 3.0


def test_a_tool_that_hops_leaves_a_model_and_a_lost_slide_is_named():
    runs = grid(((2e-3, 2.0),))
    hopping = slide(0.03, 0.5, ((2e-3, 2.0),), seed=50)
    period = int(2e-3 / 0.03 * RATE)
    hopping.touching[np.arange(hopping.touching.size) % period < period // 3] = False
    short = slide(0.2, 0.5, seconds=0.1, seed=51)
    uneven = slide(0.2, 0.6, seed=52)
    uneven.speed[:] = 0.2 * (1.0 + 0.9 * np.sin(np.arange(uneven.speed.size) / 8.0))
    fitted = fit([*runs, hopping, short, uneven])
    assert fitted.recorded == 7
    assert len(fitted.lost) == 2
    assert "0.2 m/s 0.5 N: the tool slides in contact for 0.1 s at most" in fitted.lost[0]
    assert "0.2 m/s 0.6 N: speed or force vary" in fitted.lost[1]


def harmonic(**changes):
    plain = model_of(rate=RATE)
    values = {
        "name": "lines", "rate": RATE, "speeds": plain.speeds, "forces": plain.forces,
        "ar": plain.ar, "variance": plain.variance, "friction": 0.25,
        "periods": np.array([2e-3, 0.7e-3]), "harmonics": np.array([[0, 1], [0, 3], [1, 1]]),
        "lines": plain.forces[:, None] * np.array([1.0, 0.5j, -0.25 + 0.1j]),
        "slowest": 0.02, "lightest": 0.2,
    }  # fmt: skip
    return HarmonicModel(**(values | changes))


@pytest.mark.parametrize("model", [harmonic(), model_of()], ids=["harmonic", "noise"])
def test_a_file_keeps_the_kind_and_every_number(model, tmp_path):
    write_model(model, tmp_path / "model.json")
    back = read_model(tmp_path / "model.json")
    assert type(back) is type(model)
    drive = np.full(300, 0.06), np.linspace(0.1, 1.1, 300)
    np.testing.assert_array_equal(
        Synthesiser(back, seed=3).block(*drive), Synthesiser(model, seed=3).block(*drive)
    )


def test_files_of_the_older_format_are_still_read(tmp_path):
    write_hatt(model_of(), tmp_path / "model.xml")
    assert type(read_model(tmp_path / "model.xml")) is TextureModel


def test_in_files_of_version_1_no_high_pass_stands_behind_the_noise(tmp_path):
    write_model(harmonic(noise_high_pass=20.0), tmp_path / "model.json")
    assert read_model(tmp_path / "model.json").noise_high_pass == 20.0
    old = json.loads((tmp_path / "model.json").read_text())
    del old["noise_high_pass_hz"]
    (tmp_path / "model.json").write_text(json.dumps(old | {"schema": 1}))
    assert read_model(tmp_path / "model.json").noise_high_pass == 0.0
    (tmp_path / "model.json").write_text(json.dumps(old))
    with pytest.raises(AsperityError, match="noise_high_pass_hz must be a finite number"):
        read_model(tmp_path / "model.json")
    with pytest.raises(AsperityError, match="noise_high_pass must lie between 0 and 500 Hz, got"):
        harmonic(noise_high_pass=900.0)


def test_in_hatts_format_it_is_silent_at_rest_and_in_the_air(tmp_path):
    model = fit(grid(((2e-3, 2.0),))).model
    write_hatt(model, tmp_path / "model.xml")
    plain = read_hatt(tmp_path / "model.xml")
    for place in ((0.0, 0.5), (0.1, 0.0)):
        assert plain.filter_at(*place).variance == pytest.approx(0.0, abs=1e-12)
    for speed, force in zip(model.speeds, model.forces, strict=True):
        frequency = np.linspace(0.0, 0.5 * RATE, 20001)
        power = np.trapezoid(model.filter_at(speed, force).density(frequency, RATE), frequency)
        power += 0.5 * np.sum(model.amplitudes_at(speed, force) ** 2)
        there = plain.filter_at(speed, force)
        assert there.variance * power_gain(there.ar) == pytest.approx(power, rel=1e-3)


def test_hatts_format_says_what_it_loses(tmp_path):
    model = harmonic()
    notes = write_hatt(model, tmp_path / "model.xml")
    assert "no periods" in notes[0]
    assert write_hatt(model_of(), tmp_path / "plain.xml") == ()
    plain = read_hatt(tmp_path / "model.xml")
    for speed, force in zip(model.speeds, model.forces, strict=True):
        own, there = model.filter_at(speed, force), plain.filter_at(speed, force)
        power = own.variance * power_gain(own.ar)
        power += 0.5 * np.sum(model.amplitudes_at(speed, force) ** 2)
        assert there.variance * power_gain(there.ar) == pytest.approx(power, rel=1e-6)
    without = as_noise(harmonic(periods=[], harmonics=np.empty((0, 2)), lines=np.empty((4, 0))))
    assert without[1] == 0.0


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("schema", 3, "schema must be 1 to 2, got 3"),
        ("kind", "sines", "kind must be 'harmonic' or 'noise', got 'sines'"),
        ("periods_m", [-1.0, 1.0], "periods must be above 0"),
        ("harmonics", [[0, 1], [0, 3], [2, 1]], "a line names a period from 0 to 1"),
        ("harmonics", [[0, 1], [0, 3]], "lines_real must be 4 x 2"),
        ("lines_real", "x", "lines_real must hold numbers"),
        ("variance", [1.0, 1.0], "variance must be 4"),
        ("rate_hz", None, "rate_hz must be a finite number"),
        ("format", "else", "no vibration model"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(key, value, told, tmp_path):
    path = tmp_path / "model.json"
    write_model(harmonic(), path)
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: value}))
    with pytest.raises(AsperityError) as error:
        read_model(path)
    assert told in str(error.value)
    assert "\n" not in str(error.value)


def test_broken_text_is_refused(tmp_path):
    for text in ("{", "[" * 100000, '{"rate_hz": NaN}', "[]"):
        (tmp_path / "model.json").write_text(text)
        with pytest.raises(AsperityError):
            read_model(tmp_path / "model.json")
    with pytest.raises(AsperityError, match="no such texture model"):
        read_model(tmp_path / "none.json")


def test_at_a_lower_rate_lines_stay_and_those_above_the_band_end():
    model = at_rate(harmonic(), 500.0)
    assert model.rate == 500.0
    # The third harmonic of 2 mm lies at 150 Hz at 0.1 m/s, at 270 Hz, above the band, at 0.18 m/s.
    assert model.amplitudes_at(0.1, 1.0)[1] == pytest.approx(0.5, rel=0.01)
    assert model.amplitudes_at(0.18, 1.0)[1] == 0.0


def test_wrong_settings_are_refused():
    with pytest.raises(AsperityError, match="kind of vibration model"):
        FitSettings(kind="sines")
    with pytest.raises(AsperityError, match="moving-average"):
        harmonic(ma=np.tile(model_of().ar[0], (4, 1)), gain=np.ones(4))
