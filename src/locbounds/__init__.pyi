# The public names: what type checkers see, and what is imported on first use (lazy-loader reads this file).
from . import papers, testing
from .bounds import AlongTrack, Prior, bcrb, bcrb_algorithm1, enumer, known_sight, los_only
from .errors import InputError, LocboundsError, PrecisionError, RefusedError
from .evaluation import evaluate, quantile
from .filters import Estimates, FactorisedImmEkf, ImmEkf, ImmKf, OracleEkf
from .fit.scenario import fit_scenario
from .io.logs import read_log
from .io.scenario_file import load, save
from .measurement import Range
from .motion import ConstantVelocity
from .noise import Gaussian, GaussianMixture
from .priors import GaussianPrior
from .registry import explain
from .report import plot
from .result import Result, tightest
from .scenario import Link, Scenario
from .scoring import Score, score
from .sight import DwellSight, KnownSight, MarkovSight
from .simulation import Draws, simulate
from .times import Times

__version__: str
__all__ = [
    "AlongTrack",
    "ConstantVelocity",
    "Draws",
    "DwellSight",
    "Estimates",
    "FactorisedImmEkf",
    "Gaussian",
    "GaussianMixture",
    "GaussianPrior",
    "ImmEkf",
    "ImmKf",
    "InputError",
    "KnownSight",
    "Link",
    "LocboundsError",
    "MarkovSight",
    "OracleEkf",
    "PrecisionError",
    "Prior",
    "Range",
    "RefusedError",
    "Result",
    "Scenario",
    "Score",
    "Times",
    "bcrb",
    "bcrb_algorithm1",
    "enumer",
    "evaluate",
    "explain",
    "fit_scenario",
    "known_sight",
    "load",
    "los_only",
    "papers",
    "plot",
    "quantile",
    "read_log",
    "save",
    "score",
    "simulate",
    "testing",
    "tightest",
]
