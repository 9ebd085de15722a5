"""In-place access to MuJoCo's contacts as records for kernels.

`MjData.contact` is a view of structures in MuJoCo's arena. Here the whole arena is mapped as an
array of such structures, so that a kernel reads and writes them in one call. The offsets of the
fields are measured, since they change between versions.
"""

from __future__ import annotations

import ctypes
import functools
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

_PROBE = """<mujoco><worldbody>
  <geom type="plane" size="1 1 1" margin="{margin}" gap="{gap}"/>
  <body pos="0 0 .0105"><freejoint/><geom size=".01" margin="{margin}" gap="{gap}"/></body>
  <body pos="1 0 .0105"><freejoint/><geom size=".01" margin="{margin}" gap="{gap}"/></body>
</worldbody></mujoco>"""


class Margins(NamedTuple):
    """Meaning of margins and gaps in a version of MuJoCo."""

    adds: bool
    """Whether the margins of two geoms are added; else the larger one is used."""
    gap_reaches_out: bool
    """Whether the gap is outside the margin; else it is the outer part of the margin."""


@functools.cache
def margins() -> Margins:
    """Return the meaning of margins and gaps in this version of MuJoCo."""
    found = _probe(0.001, 0.0)
    return Margins(float(found.contact.includemargin[0]) > 0.0015, _probe(0.0, 0.001).ncon > 0)


def _probe(margin: float, gap: float) -> Any:
    model = mujoco.MjModel.from_xml_string(_PROBE.format(margin=margin, gap=gap))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


@functools.cache
def contact_type() -> np.dtype[Any]:
    """Return the measured type of MuJoCo's contact records."""
    contact = _probe(0.01, 0.0).contact
    names = [name for name in dir(contact) if not name.startswith("_")]
    views = {name: view for name in names if isinstance(view := getattr(contact, name), np.ndarray)}
    base = int(views["dist"].__array_interface__["data"][0])
    size = int(views["dist"].strides[0])
    known: dict[str, tuple[Any, int]] = {}
    for name, view in views.items():
        start = int(view.__array_interface__["data"][0]) - base
        if 0 <= start < size:
            known[name] = ((view.dtype, view.shape[1:]), start)
    return np.dtype(
        {
            "names": list(known),
            "formats": [kind for kind, _ in known.values()],
            "offsets": [start for _, start in known.values()],
            "itemsize": size,
        }
    )


def contact_records(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.void]:
    """Return the arena of `data` as contact records, of which the first `data.ncon` are contacts.

    It is valid as long as `data` is.
    """
    if data.ncon == 0:
        blank = mujoco.MjContact()
        mujoco.mj_addContact(model, data, blank)
        start = int(data.contact.dist.__array_interface__["data"][0])
        data.ncon = 0
    else:
        start = int(data.contact.dist.__array_interface__["data"][0])
    kind = contact_type()
    count = int(data.narena) // kind.itemsize
    memory = (ctypes.c_byte * (count * kind.itemsize)).from_address(start)
    return np.ndarray((count,), kind, memoryview(memory))
