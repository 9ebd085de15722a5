"""Claims about a method: each is a number with a limit, measured on surfaces where it can fail.

The verdict states whether the number is on the right side of the limit. Asperity is judged by the
same numbers as the others. All limits are asperity's.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from asperity._core.data import table_beside
from asperity._core.output import write_whole
from asperity.errors import AsperityError, did_you_mean
from asperity.studies.baselines import Method
from asperity.studies.comparison.measures import Bench, OutOfTimeError
from asperity.studies.stability.measure import Symptoms


class MeasuredClaim(NamedTuple):
    """A measured number, and the limit from which the claim holds."""

    title: str
    what: str
    """Definition of the number."""
    unit: str
    limit: float
    above: bool
    """Whether the claim holds from the limit upwards, or downwards."""

    def holds(self, value: float) -> bool:
        """Return whether a number is on the right side of the limit."""
        return value >= self.limit if self.above else value <= self.limit


CLAIMS = {
    name: MeasuredClaim(**entry) for name, entry in table_beside(__file__, "claims.toml").items()
}
"""In the order of the tables."""
_STORE = Path(__file__).with_name("claims.json")
STEPS = len(CLAIMS) + 1
"""Number of progress reports of `measure_claims` for all claims."""


class Measured(NamedTuple):
    """One claim about one method."""

    value: float | None
    """None if it could not be measured."""
    holds: bool | None
    detail: str
    """The numbers from which it is computed, or why there are none."""


class MethodClaims(NamedTuple):
    """All claims about one method."""

    measured: dict[str, Measured]
    still: Symptoms | None
    """Symptoms felt by a hand at rest; None if it was not, or could not be simulated."""


def choose_claims(names: Iterable[str]) -> tuple[str, ...] | None:
    """Return claims in the order of `CLAIMS`; None if none is named.

    Parameters
    ----------
    names : iterable of str
        Keys of `CLAIMS`, `all`, `none`; or the text of a claim, its title, its definition or both,
        as the page shows them. A part of a text will do if no other claim has it; capitals do not
        count.

    Raises
    ------
    AsperityError
        A name is that of no claim, or fits several.
    """
    wanted = {_claim_named(name) for name in names}
    if not wanted:
        return None
    return tuple(name for name in CLAIMS if name in wanted or "all" in wanted)


def _claim_named(text: str) -> str:
    """Return the key of a claim from its key, its text, or a part of it; also `all` and `none`."""
    others = ("all", "none")
    wanted = _plain(text)
    if wanted in CLAIMS or wanted in others:
        return wanted
    titles = {name: _plain(claim.title) for name, claim in CLAIMS.items()}
    texts = {
        name: (titles[name], _plain(claim.what), _plain(f"{claim.title}: {claim.what}"))
        for name, claim in CLAIMS.items()
    }
    # What is meant is in a title rather than in a definition, where other claims are named too.
    for fitting in (
        [name for name, own in texts.items() if wanted in own],
        [name for name, title in titles.items() if wanted in title],
        [name for name, own in texts.items() if wanted in own[2]],
    ):
        if wanted and len(fitting) == 1:
            return fitting[0]
        if wanted and fitting:
            several = ", ".join(f"{name} ({CLAIMS[name].title})" for name in fitting)
            raise AsperityError(f"claim {text!r} fits {len(fitting)}: {several}; give more of it")
    near = did_you_mean(wanted, (*CLAIMS, *others))
    # Words with a slip are compared with titles, too.
    hint = near or did_you_mean(wanted, titles.values())
    known = ", ".join((*CLAIMS, *others))
    raise AsperityError(
        f"unknown claim {text!r}{hint}; choose from: {known}; or give the text of one in quotes"
    )


def _plain(text: str) -> str:
    """Return a text in small letters with single spaces, without the mark at its end."""
    return " ".join(text.casefold().split()).rstrip(".;:")


def stored_claims() -> dict[str, MethodClaims]:
    """Return the claims about the methods that ship with asperity, as measured for this version.

    They do not depend on a scene of the user's, and some methods take minutes.
    `tools/measure_claims.py` measures them.
    """
    out = {}
    for name, stored in json.loads(_STORE.read_text("utf-8"))["methods"].items():
        measured = {
            claim: Measured(value, None if value is None else CLAIMS[claim].holds(value), detail)
            for claim, (value, detail) in stored["claims"].items()
        }
        still = stored["still"]
        out[name] = MethodClaims(measured, None if still is None else Symptoms(**still))
    return out


def store_claims(claims: Mapping[str, MethodClaims]) -> None:
    """Write what `stored_claims` returns, for methods by name."""
    methods = {
        name: {
            "claims": {claim: [one.value, one.detail] for claim, one in of.measured.items()},
            "still": None if of.still is None else of.still._asdict(),
        }
        for name, of in claims.items()
    }
    text = json.dumps({"schema": 1, "methods": methods}, indent=1, allow_nan=False)
    write_whole(_STORE, text + "\n")


def measure_claims(
    method: Method,
    names: Iterable[str] = tuple(CLAIMS),
    *,
    seconds: float | None = None,
    on_step: Callable[[], None] = lambda: None,
) -> MethodClaims:
    """Measure claims about a method.

    Parameters
    ----------
    method : Method
    names : iterable of str
        Keys of `CLAIMS`. The hand at rest is simulated if all are measured.
    seconds : float, optional
        Processor time after which the remaining claims are left out [s]; by default none is.
    on_step : callable
        Called after each claim, and after the hand at rest.
    """
    names = tuple(names)
    bench = Bench(method, seconds)
    out = {}
    for name in names:
        try:
            value, detail = getattr(bench, name)()
        except OutOfTimeError as late:
            out[name] = Measured(None, None, str(late))
        except AsperityError as error:
            out[name] = Measured(None, None, str(error).rpartition("'stimulus': ")[2])
        else:
            out[name] = Measured(float(value), CLAIMS[name].holds(float(value)), detail)
        on_step()
    still = None
    if set(names) == set(CLAIMS):
        try:
            still = bench.still()
        except AsperityError:
            still = None
    on_step()
    return MethodClaims(out, still)
