"""The one table of methods: ids, assumptions, information sets, references.

Docs tables, ``locbounds explain``, verdicts and the command line's choices are all made from it.
"""

import importlib
from typing import Any, NamedTuple

from locbounds.errors import InputError
from locbounds.scenario import Scenario
from locbounds.verdict import KNOWN_SIGHT, LOS_AND_NLOS, SMOOTH_NOISE, Assumption, Verdict, judge

RANGES = frozenset({"ranges"})
RANGES_AND_SIGHT = frozenset({"ranges", "sight"})
PAST_AND_FUTURE_RANGES = frozenset({"ranges", "future-ranges"})
LOS_RANGES_AND_SIGHT = frozenset({"los-ranges", "sight"})


class Method(NamedTuple):
    """A bound or a filter.

    Attributes
    ----------
    id, name, kind
        Id used everywhere, display name, ``"bound"`` or ``"filter"``.
    summary
        One sentence.
    sees
        What the estimators that it speaks of (or it itself) may see.
    function
        ``module:attribute`` of the callable.
    grounds
        Why its number may be quoted when no assumption is violated.
    fails
        When it misleads, in words.
    references
        Citation keys of docs/references.bib.
    assumptions
        Predicates on a scenario.
    conditions
        Under which condition it is valid at all.
    """

    id: str
    name: str
    kind: str
    summary: str
    sees: frozenset[str]
    function: str
    grounds: tuple[str, ...]
    fails: str
    references: tuple[str, ...]
    assumptions: tuple[Assumption, ...] = ()
    conditions: tuple[str, ...] = ()

    def verdict(self, scenario: Scenario, conditions: tuple[str, ...] = ()) -> Verdict:
        """Whether it applies to a scenario."""
        return judge(self.assumptions, scenario, grounds=self.grounds, conditions=self.conditions + conditions)


METHODS: dict[str, Method] = {
    m.id: m
    for m in (
        Method(
            "bcrb",
            "BCRB",
            "bound",
            "Bayesian Cramér-Rao bound of the jump-Markov model: no filter that sees the ranges only has a smaller "
            "mean square error.",
            RANGES,
            "locbounds.bounds.bcrb:bcrb",
            ("Gaussian prior and motion", "smooth noise"),
            "Not a bound for filters that are told the sight, nor for the error along one fixed track; optimistic when "
            "real errors are correlated in time beyond the chain.",
            ("fritsche2013", "louis1982"),
            (SMOOTH_NOISE,),
        ),
        Method(
            "enumer",
            "Enumer-BCRB",
            "bound",
            "Average over sight sequences of the bound for a known sequence: holds even for filters that are told the "
            "sight.",
            RANGES_AND_SIGHT,
            "locbounds.bounds.conditional:enumer",
            ("average over sight sequences", "smooth noise"),
            "Ignores that the sight has to be inferred, hence often loose; neither always above nor always below the "
            "BCRB.",
            ("hernandez2005", "fritsche2013"),
            (SMOOTH_NOISE,),
        ),
        Method(
            "known-sight",
            "Known-sight BCRB",
            "bound",
            "Posterior Cramér-Rao bound for a known sight schedule.",
            RANGES_AND_SIGHT,
            "locbounds.bounds.bcrb:known_sight",
            ("known sight schedule", "smooth noise"),
            "Needs the schedule; along one given track it is a conditional number that bounds no error over random "
            "tracks.",
            ("chen2010", "tichavsky1998"),
            (SMOOTH_NOISE, KNOWN_SIGHT),
        ),
        Method(
            "los-only",
            "LOS-only BCRB",
            "bound",
            "Average over sight sequences of the bound for a filter that knows the sight and throws NLOS ranges away.",
            LOS_RANGES_AND_SIGHT,
            "locbounds.bounds.conditional:los_only",
            (),
            "Not a bound for filters that use NLOS ranges; right where the NLOS excess is unknown and arbitrary.",
            ("qi2006",),
            (SMOOTH_NOISE, LOS_AND_NLOS),
            ("estimators that discard NLOS ranges, or an NLOS excess about which nothing is known",),
        ),
        Method(
            "imm-ekf",
            "IMM-EKF",
            "filter",
            "Interacting multiple model filter over the joint modes of all links, with extended Kalman updates.",
            RANGES,
            "locbounds.filters:ImmEkf",
            (),
            "Costs 2^anchors; close to optimal when ranges are nearly linear over the prediction's spread.",
            ("fritsche2013",),
        ),
        Method(
            "imm-ekf-factorised",
            "IMM-EKF, factorised",
            "filter",
            "Interacting multiple model filter with one two-mode chain per link: cost linear in anchors.",
            RANGES,
            "locbounds.filters:FactorisedImmEkf",
            (),
            "Keeps no correlation between the sights of different links; identical to IMM-EKF for one link.",
            ("fritsche2013",),
        ),
        Method(
            "imm-kf",
            "IMM-KF",
            "filter",
            "Causal range smoothing by a two-mode IMM Kalman filter per link, then least squares for the position.",
            RANGES,
            "locbounds.filters:ImmKf",
            (),
            "Misses the turn of the range near an anchor; ignores the motion across links; least squares is wild "
            "where the geometry is poor, for example heights from anchors of one height.",
            ("liao2006", "fritsche2013"),
        ),
        Method(
            "ekf-banks",
            "EKF banks",
            "filter",
            "Per link one extended Kalman filter for each sight condition, fused over links by their information: "
            "cost linear in anchors.",
            RANGES,
            "locbounds.filters:EkfBanks",
            (),
            "Forgets after every step which sight explained the past; its covariance is too small where a link's modes "
            "disagree.",
            ("chen2009", "chen2010"),
        ),
        Method(
            "rbpf",
            "RBPF",
            "filter",
            "Rao-Blackwellised particle filter: particles for the sight of all links, an extended Kalman filter for "
            "the state of each particle; cost linear in anchors and particles.",
            RANGES,
            "locbounds.filters:Rbpf",
            (),
            "Random: seeds differ a little; needs more particles with more anchors; no better than its linearisation.",
            ("chen2009rbpf", "chen2010"),
        ),
        Method(
            "imm-kf-smoother",
            "IMM-KF smoother",
            "filter",
            "The IMM-KF with ranges smoothed over the whole track, forwards and backwards: no filter, since it uses "
            "ranges after the step.",
            PAST_AND_FUTURE_RANGES,
            "locbounds.filters:ImmKfSmoother",
            (),
            "Sees more than any filtering bound assumes and may be better than all of them; otherwise as imm-kf.",
            ("liao2006", "chen2010"),
        ),
        Method(
            "oracle-ekf",
            "Oracle EKF",
            "filter",
            "Extended Kalman filter that is told the sight of every link: how much knowing the sight is worth.",
            RANGES_AND_SIGHT,
            "locbounds.filters:OracleEkf",
            (),
            "Not a filter one can build; may lie below the BCRB.",
            ("fritsche2013",),
        ),
    )
}


def method(id: str, kind: str | None = None) -> Method:
    """The entry of an id, or an InputError with the nearest known id.

    >>> method("bcrb").name
    'BCRB'
    """
    known = [m for m in METHODS.values() if kind in (None, m.kind)]
    for m in known:
        if id in (m.id, m.name):
            return m
    import difflib

    near = difflib.get_close_matches(id, [m.id for m in known], n=1, cutoff=0.4)
    hint = f"Did you mean {near[0]}? " if near else ""
    raise InputError(f"unknown {kind or 'method'} {id!r}", f"{hint}Known: {', '.join(m.id for m in known)}")


def load(entry: Method) -> Any:
    """The callable of an entry, imported now.

    >>> load(method("bcrb")).__name__
    'bcrb'
    """
    module, _, name = entry.function.partition(":")
    return getattr(importlib.import_module(module), name)


def describe(entry: Method) -> dict[str, Any]:
    """What a method is, sees and assumes, when it fails and whom to cite, as plain data.

    >>> describe(method("enumer"))["sees"]
    ['ranges', 'sight']
    """
    return {
        "id": entry.id,
        "name": entry.name,
        "kind": entry.kind,
        "summary": entry.summary,
        "sees": sorted(entry.sees),
        "assumes": [*entry.conditions, *entry.grounds, *(a.text for a in entry.assumptions)],
        "fails": entry.fails,
        "cite": list(entry.references),
    }


def explain(id: str) -> str:
    """What a bound or filter assumes, when it misleads, and whom to cite.

    Parameters
    ----------
    id
        Id of a method, for example ``bcrb``.

    Raises
    ------
    InputError
        If the id is unknown; the nearest known one is named.

    Examples
    --------
    >>> print(explain("bcrb").splitlines()[0])
    BCRB (bcrb), a bound
    """
    entry = describe(method(id))
    lines = [f"{entry['name']} ({entry['id']}), a {entry['kind']}", entry["summary"], ""]
    lines += [f"sees     {', '.join(entry['sees'])}", *(f"assumes  {text}" for text in entry["assumes"])]
    return "\n".join([*lines, f"careful  {entry['fails']}", f"cite     {', '.join(entry['cite'])}"])
