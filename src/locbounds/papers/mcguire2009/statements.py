"""Which claims of the chapter on Figs. 3 to 6 hold, from the computed numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from locbounds.papers.mcguire2009.simple import CASES, Row, inverse_expected_information

HOLDS, PARTLY, FAILS = "holds", "holds in part", "does not hold"
TIGHT = 0.7  # of the least RMSE: what "fairly tight" is taken to mean
GOOD = 0.85  # and "good"
ALIKE = 0.15  # relative difference: "nearly identical"


def word(each: Iterable[bool]) -> str:
    """Whether a claim holds: everywhere, somewhere, nowhere.

    >>> word([True, True]), word([True, False]), word([False])
    ('holds', 'holds in part', 'does not hold')
    """
    each = list(each)
    return HOLDS if all(each) else PARTLY if any(each) else FAILS


class Statement(NamedTuple):
    """A claim, whether it holds, and why."""

    paper: str
    verdict: str
    why: str


def statements(found: Mapping[str, Iterable[Row]]) -> list[Statement]:
    """The claims on the figures that were computed."""
    values: dict[str, dict[str, dict[float, float]]] = {}
    for rows in found.values():
        for r in rows:
            values.setdefault(r.case, {}).setdefault(r.method, {})[r.sigma] = r.rmse_m
    said = []
    near, far = values.get("ToA R_BS=15 m"), values.get("ToA R_BS=5 m")
    if near:
        said += [
            _order(near, "Fig. 3: the Ziv-Zakai bound is the tightest, above the Weiss-Weinstein bound"),
            _exceeds(near),
            _low_noise(near),
        ]
    if far:
        said.append(_order(far, "Fig. 4: the Ziv-Zakai bound is again tighter than the Weiss-Weinstein bound"))
    if near and far:
        ratio = {s: far["WWB as printed"][s] / v for s, v in near["WWB as printed"].items()}
        most = max(abs(r - 1) for r in ratio.values())
        mmse = max(abs(far["MMSE"][s] / v - 1) for s, v in near["MMSE"].items())
        said.append(
            Statement(
                "Figs. 3 and 4: the Weiss-Weinstein bound is nearly identical for both radii",
                word(abs(r - 1) < ALIKE for r in ratio.values()),
                f"as printed the two differ by at most {most:.0%}, while the least errors differ by up to {mmse:.0%}",
            )
        )
    for kind, number in (("RSS", 5), ("AoA", 6)):
        case = values.get(f"{kind} R_BS=5 m")
        if case:
            said.append(_order(case, f"Fig. {number}: for {kind} the Ziv-Zakai bound is the better one"))
            said.append(_tight(case, f"Fig. {number}: both bounds are fairly tight"))
    return said


def on_maximum_likelihood(*, seed: int = 0) -> Statement:
    """Whether the inverse expected information bounds maximum likelihood in Fig. 3, at its highest noise level.

    The chapter says so of estimators that do not use the prior. With equal deviations least squares is maximum
    likelihood; it is searched in the disc, and in a box three times as wide.
    """
    from locbounds.static.estimators import ls, ml

    case = CASES[0]
    sigma = case.sigmas[-1]
    claimed = sigma * inverse_expected_information(case)
    inside, wide = (f(case.plan(sigma), seed=seed) for f in (ml, ls))
    errors = [(float(r.mean_position_rmse()), r.mean_position_rmse_stderr()) for r in (inside, wide)]
    below = [value + 4 * error < claimed for value, error in errors]
    texts = [f"{value:.2f} ± {error:.2f} m" for value, error in errors]
    return Statement(
        "Fig. 3: the inverse expected information is a lower bound for maximum likelihood, which uses no prior",
        word(not b for b in below),
        f"at {sigma:g} m it is {claimed:.2f} m, the error of maximum likelihood {texts[0]} if searched in the disc, "
        f"{texts[1]} in a box three times as wide: at high noise the estimate is biased",
    )


def _tight(case: dict[str, dict[float, float]], text: str) -> Statement:
    share = {name: [case[name][s] / m for s, m in case["MMSE"].items()] for name in ("EZZB", "WWB")}
    spans = [f"{name} has {min(v):.0%} to {max(v):.0%}" for name, v in share.items()]
    return Statement(
        text,
        word(v >= TIGHT for each in share.values() for v in each),
        f"taken as {TIGHT:.0%} of the least error or more: {', '.join(spans)}",
    )


def _order(case: dict[str, dict[float, float]], text: str) -> Statement:
    forms = {"WWB as printed": "form as printed", "WWB": "with the support"}
    larger = {name: {s: v >= case[name][s] for s, v in case["EZZB"].items()} for name in forms}

    def where(at: dict[float, bool]) -> str:
        if all(at.values()):
            return "at every noise level"
        levels = ", ".join(f"{s:g}" for s, yes in at.items() if not yes)
        return f"not at {levels}" if any(at.values()) else "at no noise level"

    return Statement(
        text,
        word(yes for at in larger.values() for yes in at.values()),
        "; ".join(f"{words}: {where(larger[name])}" for name, words in forms.items()),
    )


def _exceeds(case: dict[str, dict[float, float]]) -> Statement:
    over = [s for s, v in case["BCRB"].items() if v > case["MMSE"][s]]
    return Statement(
        "Fig. 3: the inverse expected information exceeds the least error as the noise grows",
        HOLDS if over else FAILS,
        f"from {min(over):g} m on" if over else "it stays below at every noise level",
    )


def _low_noise(case: dict[str, dict[float, float]]) -> Statement:
    share = {s: case["WWB as printed"][s] / m for s, m in case["MMSE"].items()}
    first, worst = min(share), min(share, key=lambda s: share[s])
    better = max(case["WWB"][s] / case["WWB as printed"][s] for s in share) - 1
    return Statement(
        "Fig. 3: the Weiss-Weinstein bound is good at low noise and becomes loose at high noise",
        word([share[first] > GOOD, share[worst] < share[first]]),
        f"as printed {share[first]:.0%} of the least error at {first:g} m and {share[worst]:.0%} at {worst:g} m; much "
        f"of that is the form: with the support it is up to {better:.0%} larger",
    )
