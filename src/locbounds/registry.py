"""The one table of methods: ids, assumptions, information sets, references.

Docs tables, ``locbounds explain``, verdicts and the command line's choices are all made from it.
"""

import importlib
from typing import Any, NamedTuple

from locbounds.assumptions import COMMON, LINEAR_CHANNELS, LINEAR_MOTION, MODEL
from locbounds.citations import CITATIONS
from locbounds.errors import InputError
from locbounds.model import JumpMarkov
from locbounds.plan import Plan
from locbounds.plan_assumptions import BAYESIAN_PLAN, ONE_UNIT, RESOLVED, WITH_PRIOR
from locbounds.scenario import Scenario
from locbounds.verdict import (
    DETERMINED,
    KNOWN_SIGHT,
    LOS_AND_NLOS,
    REGULAR_PLAN,
    SEPARABLE,
    SMOOTH_NOISE,
    SURVEYED,
    Assumption,
    Verdict,
    judge,
)

RANGES = frozenset({"ranges"})
RANGES_AND_SIGHT = frozenset({"ranges", "sight"})
PAST_AND_FUTURE_RANGES = frozenset({"ranges", "future-ranges"})
LOS_RANGES_AND_SIGHT = frozenset({"los-ranges", "sight"})
FINGERPRINT = frozenset({"fingerprint"})
MEASUREMENT = frozenset({"measurement"})


class Method(NamedTuple):
    """A bound, a filter, or an estimator of one position.

    Attributes
    ----------
    id, name, kind
        Id used everywhere, display name, ``"bound"``, ``"filter"`` or ``"estimator"``.
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
        Predicates on what it speaks of.
    conditions
        Under which condition it is valid at all.
    subject
        What it speaks of: a ``"scenario"``, a ``"survey"``, a ``"plan"`` or a ``"model"`` built in Python.
    on_plan
        Predicates on a plan, for a bound of scenarios that exists for plans too.
    on_model
        Predicates on a general model, for a bound of scenarios that exists for these too.
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
    subject: str = "scenario"
    on_plan: tuple[Assumption, ...] = ()
    on_model: tuple[Assumption, ...] = ()

    def verdict(self, subject: Any, conditions: tuple[str, ...] = ()) -> Verdict:
        """Whether it applies to a scenario (or to a survey, a plan, or a general model)."""
        grounds = ON_PLAN if self.on_plan and isinstance(subject, Plan) else self.grounds
        return judge(self.assumed(subject), subject, grounds=grounds, conditions=self.conditions + conditions)

    def check(self, subject: Any) -> list[tuple[str, str | None]]:
        """Every assumption in words, and why a scenario or plan violates it (None where it does not)."""
        return [(a.text, a.violated(subject)) for a in self.assumed(subject)]

    def assumed(self, subject: Any) -> tuple[Assumption, ...]:
        """The assumptions that concern a subject."""
        if self.on_plan and isinstance(subject, Plan):
            return self.on_plan
        return self.on_model if self.on_model and isinstance(subject, JumpMarkov) else self.assumptions


ON_PLAN = ("regular prior", "smooth noise")


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
            "real errors are correlated in time beyond the chain. Chains that links share and motion that switches "
            "take a JumpMarkov model.",
            ("fritsche2013", "louis1982"),
            (*COMMON, SMOOTH_NOISE),
            on_plan=BAYESIAN_PLAN,
            on_model=MODEL,
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
            (*COMMON, SMOOTH_NOISE, SEPARABLE),
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
            (*COMMON, SMOOTH_NOISE, KNOWN_SIGHT, SEPARABLE),
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
            (*COMMON, SMOOTH_NOISE, LOS_AND_NLOS, SEPARABLE),
            ("estimators that discard NLOS ranges, or an NLOS excess about which nothing is known",),
        ),
        Method(
            "survey",
            "Survey bound",
            "bound",
            "Discrete Ziv-Zakai bound of a fingerprint survey: no estimator that sees one fingerprint has a smaller "
            "mean square error over the surveyed points.",
            FINGERPRINT,
            "locbounds.survey:survey_bound",
            (),
            "Goes to zero with the noise, while the error between surveyed points does not; a survey of few noisy "
            "samples makes points look more different than they are.",
            ("mcguire2009", "bell1997"),
            (SURVEYED,),
            (
                "a device at one of the surveyed points, all equally likely",
                "Gaussian noise, the same everywhere, around the mean fingerprints of the survey",
            ),
            "survey",
        ),
        Method(
            "wwb",
            "WWB",
            "bound",
            "Weiss-Weinstein bound of a static position with a prior: no estimator has a smaller mean square error, "
            "whatever the prior's support and the noise.",
            MEASUREMENT,
            "locbounds.static.weiss_weinstein:wwb",
            ("any prior", "any measurement"),
            "Loose at high noise with few test points; neither always above nor always below the EZZB.",
            ("weinstein1988", "mcguire2009"),
            (WITH_PRIOR, RESOLVED),
            subject="plan",
        ),
        Method(
            "ezzb",
            "EZZB",
            "bound",
            "Extended Ziv-Zakai bound of a static position with a prior: no estimator has a smaller mean square error, "
            "whatever the prior's support and the noise.",
            MEASUREMENT,
            "locbounds.static.ziv_zakai:ezzb",
            ("any prior", "any measurement"),
            "Bounds one direction at a time, so that its sum over axes is not tight at low noise where the accuracy "
            "differs from place to place.",
            ("bell1997", "mcguire2009"),
            (WITH_PRIOR,),
            subject="plan",
        ),
        Method(
            "barankin",
            "Barankin bound",
            "bound",
            "Barankin bound at given places, in the form with several test points: no unbiased estimator has a smaller "
            "variance there.",
            MEASUREMENT,
            "locbounds.static.barankin:barankin",
            (),
            "Says nothing about biased estimators, and every estimator that uses a prior or an edge is biased.",
            ("rife1975", "mcguire2009"),
            (),
            ("estimators without bias at the place and at all test points",),
            subject="plan",
        ),
        Method(
            "crlb",
            "CRLB",
            "bound",
            "Cramér-Rao bound at a point: no estimator that is unbiased around it has a smaller mean square error.",
            MEASUREMENT,
            "locbounds.static.crlb:crlb",
            ("smooth noise", "estimators unbiased around the point, without prior knowledge"),
            "Says nothing of estimators that know the area, which may be better where it is large, nor of the large "
            "errors of ambiguous geometry, where it is far too small; infinite where the geometry is singular.",
            ("mcguire2009", "torrieri1984", "qi2002"),
            (DETERMINED, REGULAR_PLAN),
            subject="plan",
        ),
        Method(
            "wwb-recursive",
            "Recursive WWB",
            "bound",
            "Weiss-Weinstein bound of a state that moves, for noises without a Fisher information too.",
            RANGES,
            "locbounds.bounds.weinstein:wwb_recursive",
            ("any noise",),
            "Loose for noises with hard edges, by some per cent to a third in the root; where modes remember, it is "
            "that of estimators that are told them.",
            ("weiss1985", "rapoport2004"),
            (LINEAR_MOTION, LINEAR_CHANNELS),
            subject="model",
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
        Method(
            "mmse",
            "MMSE",
            "estimator",
            "Posterior mean by quadrature: the least mean square error that is possible, with its standard error.",
            MEASUREMENT,
            "locbounds.static.mmse:mmse",
            (),
            "Costs draws times places; it needs the prior and the noise to be right.",
            ("mcguire2009",),
            (WITH_PRIOR,),
            subject="plan",
        ),
        Method(
            "ml",
            "ML",
            "estimator",
            "Most likely place within the support of the prior, whose density it does not use.",
            MEASUREMENT,
            "locbounds.static.estimators:ml",
            (),
            "Far from the least error at high noise, where it sits on the edge of the support.",
            ("mcguire2009",),
            (WITH_PRIOR,),
            subject="plan",
        ),
        Method(
            "ls",
            "Least squares",
            "estimator",
            "Place with the least sum of squared differences, not weighted, in a box three times as wide as "
            "the support.",
            MEASUREMENT,
            "locbounds.static.estimators:ls",
            (),
            "Knows neither prior nor noise; wild where the geometry is poor.",
            ("mcguire2009",),
            (WITH_PRIOR, ONE_UNIT),
            subject="plan",
        ),
    )
}


TOPICS: dict[str, str] = {
    "regularity": """Regularity (regularity), when a Cramér-Rao bound exists
All Cramér-Rao bounds need a noise whose Fisher information about a shift, E[score^2], is finite. That is so exactly
where the root of the density has a square integrable derivative. Near a place x0, with t the distance from it:

jump     p is not continuous (uniform, exponential, cut laws)             infinite
edge     p ~ t^a at an end of the support, or at a zero inside            finite only for a > 1
pole     p ~ t^a with a < 0                                               infinite
cusp     p(x0) > 0 and p changes like t^b                                 finite only for b > 1/2
kink     p(x0) > 0 and its slope jumps (Laplace)                          finite, but only as E[score^2]

A sum of independent noises has no more information than each of them, so that any excess on top of Gaussian noise is
regular. Exponents of a sum follow from those of its parts, a + b + 1: the sum of two cut laws (jumps, a = 0) vanishes
linearly at its ends, and has no finite information either.

Where the information is infinite the bound is zero, and a Monte Carlo value grows with the logarithm of the number of
draws: bounds are refused, and the verdict names place and exponent. Weiss-Weinstein and Ziv-Zakai bounds apply.
A law given as a function is examined: regular, irregular, or undecided. An undecided bound may be computed, but is
never called valid nor compared with; declare the singularities of the density to decide it.

see      locbounds check scenario.toml, which prints the verdict for every bound
cite     hajek1972, ibragimov1981, stam1959, weiss1985""",
}
"""What ``explain`` tells beside the methods."""


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


def bounds_of(subject: str) -> list[Method]:
    """The bounds that speak of a scenario, of a survey, or of a plan.

    >>> [m.id for m in bounds_of("survey")]
    ['survey']
    """
    return [m for m in METHODS.values() if m.kind == "bound" and m.subject == subject]


def load(entry: Method) -> Any:
    """The callable of an entry, imported now.

    >>> load(method("bcrb")).__name__
    'bcrb'
    """
    module, _, name = entry.function.partition(":")
    return getattr(importlib.import_module(module), name)


REMEDIES = {
    "plan": "Give a plan file (locbounds new plan.toml --like plan makes one); numbers: locbounds map PLAN.toml",
    "scenario": "Give a scenario file (locbounds new scenario.toml makes one)",
    "survey": "Run locbounds survey",
    "model": "Call it from Python on a JumpMarkov model",
}
"""What to do with a method, by what it speaks of."""


def check_subject(entry: Method, subject: Any) -> None:
    """Raise an InputError if a method speaks of something else than the scenario or plan that is given.

    >>> import locbounds as lb
    >>> check_subject(method("crlb"), lb.papers.fritsche2013.scenario())
    Traceback (most recent call last):
    ...
    locbounds.errors.InputError: crlb speaks of a plan, not of a scenario. Give a plan file ...
    """
    given = _kind(subject)
    too = {"plan": entry.on_plan, "model": entry.on_model}
    if given in (None, entry.subject) or too.get(given):
        return
    raise InputError(f"{entry.id} speaks of a {entry.subject}, not of a {given}", REMEDIES[entry.subject])


def _kind(subject: Any) -> str | None:
    kinds = {"plan": Plan, "scenario": Scenario, "model": JumpMarkov}
    return next((kind for kind, of in kinds.items() if isinstance(subject, of)), None)


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
        "on_plan": [a.text for a in entry.on_plan],
        "on_model": [a.text for a in entry.on_model if a.text not in {b.text for b in entry.assumptions}],
        "fails": entry.fails,
        "cite": list(entry.references),
        "references": [CITATIONS[key] for key in entry.references],
    }


def _cite(keys: list[str]) -> list[str]:
    return [f"cite     {key}: {CITATIONS[key]}" for key in keys]


def _checked(assumption: Assumption, subject: Any) -> str:
    why = assumption.violated(subject)
    if why is not None:
        return f"violated {assumption.text}: {why}"
    trusted = assumption.trusted(subject)
    return f"holds    {assumption.text}" if trusted is None else f"trusted  {assumption.text}: {trusted}"


def explain(id: str, scenario: "Scenario | Plan | JumpMarkov | None" = None) -> str:
    """What a bound or filter assumes, when it misleads, and whom to cite; made from the table of methods.

    Parameters
    ----------
    id
        Id of a method, for example ``bcrb``, or the topic ``regularity``.
    scenario
        If given, every assumption is checked for it, and the verdict added; a plan or a general model for methods that
        speak of these.

    Raises
    ------
    InputError
        If the id is unknown (the nearest known one is named), or the method speaks of something else.

    Examples
    --------
    >>> print(explain("bcrb").splitlines()[0])
    BCRB (bcrb), a bound
    >>> import locbounds as lb
    >>> print(explain("known-sight", lb.papers.fritsche2013.scenario()).splitlines()[-3][:60])
    violated the sight of every link is known at every step: the
    """
    if id in TOPICS:
        text, _, keys = TOPICS[id].rpartition("cite     ")
        return text + "\n".join(_cite(keys.split(", ")))
    check_subject(method(id), scenario)
    entry = describe(method(id))
    article = "an" if entry["kind"][0] in "aeiou" else "a"
    lines = [f"{entry['name']} ({entry['id']}), {article} {entry['kind']}", entry["summary"], ""]
    lines += [f"sees     {', '.join(entry['sees'])}", *(f"assumes  {text}" for text in entry["assumes"])]
    lines += [f"assumes  of a plan (one position): {text}" for text in entry["on_plan"]]
    lines += [f"assumes  of a general model: {text}" for text in entry["on_model"]]
    lines += [f"careful  {entry['fails']}", *_cite(entry["cite"])]
    if scenario is not None:
        lines += ["", f"for      {scenario.title or f'this {_kind(scenario)}'}"]
        lines += [_checked(a, scenario) for a in method(id).assumed(scenario)]
        lines += [f"verdict  {method(id).verdict(scenario)}"]
    return "\n".join(lines)
