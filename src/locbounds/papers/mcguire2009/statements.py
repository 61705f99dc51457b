"""Which claims of the chapter on Figs. 3 to 6 hold, from the computed numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from locbounds.papers.mcguire2009.simple import CASES, Row, inverse_expected_information

HOLDS, PARTLY, FAILS = "holds", "holds in part", "does not hold"


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
                HOLDS if most < 0.15 else FAILS,
                f"as printed the two differ by at most {most:.0%}, while the least errors differ by up to {mmse:.0%}",
            )
        )
    for kind, number in (("RSS", 5), ("AoA", 6)):
        case = values.get(f"{kind} R_BS=5 m")
        if case:
            said.append(_order(case, f"Fig. {number}: for {kind} the Ziv-Zakai bound is the better one"))
            tight = [case["EZZB"][s] / m for s, m in case["MMSE"].items()]
            said.append(
                Statement(
                    f"Fig. {number}: both bounds are fairly tight",
                    PARTLY,
                    f"EZZB is {min(tight):.0%} to {max(tight):.0%} of the least error, WWB "
                    f"{min(case['WWB'][s] / m for s, m in case['MMSE'].items()):.0%} to "
                    f"{max(case['WWB'][s] / m for s, m in case['MMSE'].items()):.0%}",
                )
            )
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
        FAILS if all(below) else PARTLY if any(below) else HOLDS,
        f"at {sigma:g} m it is {claimed:.2f} m, the error of maximum likelihood {texts[0]} if searched in the disc, "
        f"{texts[1]} in a box three times as wide: at high noise the estimate is biased",
    )


def _order(case: dict[str, dict[float, float]], text: str) -> Statement:
    above = {name: [s for s, v in case["EZZB"].items() if v < case[name][s]] for name in ("WWB as printed", "WWB")}
    if not above["WWB as printed"] and not above["WWB"]:
        return Statement(text, HOLDS, "at every noise level, for both forms of the Weiss-Weinstein bound")

    def where(levels: list[float]) -> str:
        return f"not at {', '.join(f'{s:g}' for s in levels)}" if levels else "at every noise level"

    verdict = PARTLY if above["WWB as printed"] or above["WWB"] else HOLDS
    return Statement(
        text, verdict, f"form as printed: {where(above['WWB as printed'])}; with the support: {where(above['WWB'])}"
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
        HOLDS if share[first] > 0.85 and share[worst] < share[first] else PARTLY,
        f"as printed {share[first]:.0%} of the least error at {first:g} m and {share[worst]:.0%} at {worst:g} m; much "
        f"of that is the form: with the support it is up to {better:.0%} larger",
    )
