"""Claims about methods: each can fail, and what is stored is what is measured."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.geometry.poses import rotation_of
from asperity.studies.baselines import METHODS, Method, MethodWrench
from asperity.studies.baselines.placement import place_bodies
from asperity.studies.baselines.protocol import NOTHING
from asperity.studies.comparison import stimuli
from asperity.studies.comparison.claims import (
    CLAIMS,
    choose_claims,
    measure_claims,
    stored_claims,
)
from asperity.studies.comparison.measures import tangential_rms
from asperity.studies.comparison.page import _text

DOCS = Path(__file__).parents[3] / "docs"


class Wall:
    """A spring over a level wall at z = 0 under the middle of the tool's lowest face."""

    def __init__(self, scene, fault):
        self.fault, self.last = fault, None
        body = place_bodies(scene).tool.geoms[0]
        self.low = float(body.size[0] if body.kind == "sphere" else body.size[2])
        self.boxes = len(place_bodies(scene).standing[0].body.geoms)
        self.rough = any(body.texture is not None for body in scene.bodies)

    def reset(self):
        self.last = None

    def wrench(self, pose):
        depth = self.low - float(pose[2])
        if depth <= 0.0:
            return NOTHING
        push = stimuli.STIFFNESS * depth
        force, place = np.array([0.0, 0.0, push]), np.array([0.0, 0.0, -self.low])
        moved = np.zeros(3) if self.last is None else pose[:3] - self.last
        self.last = np.array(pose[:3])
        wave = np.sin(2.0 * np.pi * pose[0] / stimuli.WAVELENGTH)
        if self.fault == "a corner":
            place[0] += 1e-4
        elif self.fault == "as many springs as boxes":
            force *= self.boxes
        elif self.fault == "noise":
            force[0] += 0.02 * push * np.sin(1e7 * pose[0])
        elif self.fault == "faster is more":
            force[0] += 0.1 * push * wave * np.linalg.norm(moved) / 1e-4
        elif self.fault == "twice the frequency":
            force[0] += 0.1 * push * np.sin(4.0 * np.pi * pose[0] / stimuli.WAVELENGTH)
        elif self.fault == "drag":
            force[:2] -= 0.05 * push * moved[:2] / max(np.linalg.norm(moved), 1e-12)
        torque = np.cross(rotation_of(pose[3:]) @ place, force)
        if self.fault == "turns on a smooth plate":
            torque[1] += 1e-4 * wave
        return MethodWrench(force, torque, depth, 1)


@dataclass(frozen=True)
class WallMethod(Method):
    """A wall with one fault."""

    fault: str = "none"

    def renderer(self, scene, dt):
        return Wall(scene, self.fault)


def wall(fault="none"):
    return WallMethod("wall", "wall", "test 2026", "nothing that anybody built", fault)


@pytest.mark.parametrize(
    ("claim", "fault"),
    [
        ("centre", "a corner"),
        ("meshing", "as many springs as boxes"),
        ("silence", "noise"),
        ("speed", "faster is more"),
        ("energy", "drag"),
    ],
)
def test_a_claim_that_a_wall_meets_fails_with_a_fault(claim, fault):
    assert measure_claims(wall(), [claim]).measured[claim].holds
    assert not measure_claims(wall(fault), [claim]).measured[claim].holds


@pytest.mark.parametrize("claim", ["offset", "size", "force", "torque", "turning", "tool"])
def test_a_wall_without_texture_meets_no_claim_about_texture(claim):
    assert not measure_claims(wall(), [claim]).measured[claim].holds


def test_twice_the_frequency_is_told_and_no_force_has_none():
    measured = measure_claims(wall("twice the frequency"), ["frequency"]).measured["frequency"]
    assert measured.holds is False
    assert measured.value > 50.0
    nothing = measure_claims(wall(), ["frequency"]).measured["frequency"]
    assert (nothing.value, nothing.detail) == (None, "no tangential force")


def test_what_turns_a_foot_on_a_smooth_plate_too_is_not_the_textures():
    assert not measure_claims(wall("turns on a smooth plate"), ["torque"]).measured["torque"].holds


def test_the_centre_of_pressure_is_that_of_the_fault():
    measured = measure_claims(wall("a corner"), ["centre"]).measured["centre"]
    assert measured.value == pytest.approx(100.0, rel=1e-3)  # um


def test_the_slope_of_the_offset_surface_is_that_of_balls_rolled_over_samples():
    """The highest of spheres about points of the waves, by brute force."""
    radius, step = 0.75e-3, 1e-6
    x = np.arange(-2e-3, 2e-3, step)
    waves = stimuli.AMPLITUDE * np.cos(2.0 * np.pi * x / stimuli.WAVELENGTH)
    places = np.array([-0.8e-3, -0.3e-3, 0.1e-3, 0.55e-3])

    def height(u):
        near = np.abs(x - u) < radius
        return np.max(waves[near] + np.sqrt(radius**2 - (x[near] - u) ** 2))

    slopes = [(height(u + 1e-5) - height(u - 1e-5)) / 2e-5 for u in places]
    np.testing.assert_allclose(stimuli.offset_slope(2.0 * radius, places), slopes, atol=2e-3)


def test_the_closed_path_is_closed_and_smooth():
    poses = stimuli.closed_path(stimuli.foot_on_plate(), turn=0.15)
    np.testing.assert_allclose(poses[0], poses[-1], atol=1e-15)
    assert np.abs(np.diff(poses, axis=0)).max() < 5e-3


def test_a_claim_is_left_out_when_time_is_up():
    measured = measure_claims(METHODS["asperity"], ["offset", "energy"], seconds=0.0).measured
    assert [one.value for one in measured.values()] == [None, None]
    assert measured["energy"].detail == "not measured within 0 s"


def test_claims_are_chosen_by_name():
    assert choose_claims([]) is None
    assert choose_claims(["all"]) == tuple(CLAIMS)
    assert choose_claims(["none"]) == ()
    assert choose_claims(["energy", "offset"]) == ("offset", "energy")
    with pytest.raises(AsperityError, match="did you mean 'offset'"):
        choose_claims(["ofset"])


@pytest.mark.parametrize("name", CLAIMS)
def test_a_claim_is_chosen_by_its_text_too(name):
    claim = CLAIMS[name]
    line = f"{claim.title}: {claim.what}"  # as the page has it
    for text in (claim.title, claim.what, line, f" {line.upper()}.", claim.what[:60]):
        assert choose_claims([text]) == (name,), text


@pytest.mark.parametrize(
    ("part", "name"),
    [("round a loop", "energy"), ("4 and as 16 boxes", "meshing"), ("probe", "size")],
)
def test_a_part_that_one_claim_has_will_do(part, name):
    assert choose_claims([part]) == (name,)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "texture",
            r"'texture' fits 2: torque \(torque by texture\), tool \(texture of the tool\)",
        ),
        ("wavelength, at 43", "unknown claim"),
        ("no work round the lop", "did you mean 'no work round a loop'"),
        ("  ", "unknown claim '  '; choose from: offset, size"),
        ("nane", "did you mean 'none'"),
    ],
)
def test_a_text_of_no_claim_or_of_several_is_refused(text, said):
    with pytest.raises(AsperityError, match=said) as caught:
        choose_claims([text])
    assert "\n" not in str(caught.value)


def test_all_methods_have_stored_claims():
    assert set(stored_claims()) == set(METHODS)


QUICK = ["asperity", "minsky", "low-resolution", "offset-sphere"]


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in METHODS],
)
def test_what_is_stored_is_what_is_measured(name):
    if name == "full-meshes":
        pytest.importorskip("fcl")
    stored, fresh = stored_claims()[name], measure_claims(METHODS[name])
    for claim, one in fresh.measured.items():
        other = stored.measured[claim]
        assert one.holds == other.holds, claim
        assert (one.value is None) == (other.value is None)
        if one.value is not None:
            limit = CLAIMS[claim].limit
            assert one.value == pytest.approx(other.value, rel=0.05, abs=0.05 * limit), claim


def test_the_page_of_the_documentation_shows_what_is_stored():
    """Each verdict of docs/comparison.md is that of the stored number, and no row is missing."""
    text = (DOCS / "comparison.md").read_text("utf-8")
    table = text.partition("## Claims, measured")[2].partition("\n## ")[0]
    rows = [line.strip("|").split("|") for line in table.splitlines() if line.startswith("|")]
    assert [cell.strip() for cell in rows[0][1:]] == [one.title for one in CLAIMS.values()]
    found = {row[0].strip(): row[1:] for row in rows[2:]}
    stored = stored_claims()
    assert set(found) == {METHODS[name].label for name in stored}
    for name, claims in stored.items():
        for cell, claim in zip(found[METHODS[name].label], CLAIMS, strict=True):
            verdict = re.match(r"\s*\*\*(yes|no)\*\*", cell)
            expected = claims.measured[claim].holds
            assert (None if verdict is None else verdict[1] == "yes") == expected, (name, claim)


def test_every_text_of_the_page_is_that_of_this_version():
    """What docs/comparison.md says beside its numbers: definitions, sources, differences."""
    page = (DOCS / "comparison.md").read_text("utf-8")
    texts = [_text(part) for part in ("lead", "claims", "better", "rest")]
    texts += [claim.what for claim in CLAIMS.values()]
    texts += [method.what_it_is_not for method in METHODS.values()]
    texts += [method.source for method in METHODS.values()]
    assert [text for text in texts if text not in page] == []


def test_every_method_has_a_page():
    """Under docs/methods/, with its row, what of the source was read, and what is left out."""
    pages = [path.read_text("utf-8") for path in (DOCS / "methods").glob("*.md")]
    missing = [
        name
        for name in METHODS
        if name not in ("asperity", "low-resolution")
        and not any(f"`{name}`" in page and re.search("[Ss]ource|[Rr]ead", page) for page in pages)
    ]
    assert missing == []


def test_every_row_stands_in_the_table_of_systems_with_a_test_that_exists():
    """Of docs/methods/systems.md: system, rows, tests, figure."""
    text = (DOCS / "methods/systems.md").read_text("utf-8")
    table = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("|")][2:]
    assert {len(cells) for cells in table} == {4}
    rows = [name for cells in table for name in re.findall(r"`([^`]+)`", cells[1])]
    later = ["recorded-vibration", "recorded-harmonic"]
    assert sorted(rows + later) == sorted(METHODS)
    assert all(f"`{name}`" in text for name in later)
    tests = {path.name for path in (DOCS.parent / "tests").rglob("test_*.py")}
    for cells in table:
        named = re.findall(r"`(test_\w+\.py)`", cells[2])
        assert named
        assert set(named) <= tests


def test_the_tangential_rms_is_that_of_a_sine():
    force = np.zeros((1000, 3))
    force[:, 2] = 0.5
    force[:, 0] = 0.1 * np.sin(np.linspace(0.0, 20.0 * np.pi, 1000, endpoint=False))
    assert tangential_rms(force) == pytest.approx(0.1 / np.sqrt(2.0), rel=1e-6)
