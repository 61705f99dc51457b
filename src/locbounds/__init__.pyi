# The public names: what type checkers see, and what is imported on first use (lazy-loader reads this file).
from . import papers
from .bounds import AlongTrack, Gaussians, Prior, bcrb, bcrb_algorithm1, enumer, known_sight, los_only
from .errors import InputError, LocboundsError, PrecisionError, RefusedError
from .evaluation import evaluate, quantile
from .filters import EkfBanks, Estimates, FactorisedImmEkf, ImmEkf, ImmKf, ImmKfSmoother, OracleEkf, Rbpf
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
from .sight import DwellSight, KnownSight, MarkovSight
from .simulation import Draws, simulate
from .times import Times

__version__: str
__all__ = [
    "AlongTrack",
    "ConstantVelocity",
    "Draws",
    "DwellSight",
    "EkfBanks",
    "Estimates",
    "FactorisedImmEkf",
    "Gaussian",
    "GaussianMixture",
    "GaussianPrior",
    "Gaussians",
    "ImmEkf",
    "ImmKf",
    "ImmKfSmoother",
    "InputError",
    "KnownSight",
    "Link",
    "LocboundsError",
    "MarkovSight",
    "OracleEkf",
    "PrecisionError",
    "Prior",
    "Range",
    "Rbpf",
    "RefusedError",
    "Result",
    "Scenario",
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
    "simulate",
    "tightest",
]
