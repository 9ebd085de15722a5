"""The single contact of a soft body: the sum of all its taxels."""

from __future__ import annotations

import math

from asperity._core.arrays import Array
from asperity.contact.contacts import Contacts


def fill_summed(contacts: Contacts, push: Array, force: Array, friction: Array) -> bool:
    """Fill the first contact, at the centre of pressure; return whether there is contact.

    Parameters
    ----------
    contacts : Contacts
    push : (6,) array
        As in `contact.soft.taxel_sums.SkinOutput`; the point stays in its axes.
    force, friction : (3,) array
        Total force on the tool, and friction, world axes [N].
    """
    total = float(push[0])
    contacts.count[0] = int(total > 0.0)
    if total == 0.0:
        return False
    normal = force - friction
    normal /= max(math.hypot(*normal.tolist()), 1e-30)
    contacts.point[0] = push[1:4] / total
    contacts.normal[0] = contacts.slope_normal[0] = normal
    contacts.depth[0] = push[4]
    contacts.weight[0] = 1.0
    contacts.force[0] = force
    return True
