# The public names: what type checkers see, and what is imported on first use (lazy-loader reads this file).
from . import papers
from .bounds import AlongTrack, Prior, bcrb, bcrb_algorithm1, enumer, known_sight, los_only
from .errors import InputError, LocboundsError, PrecisionError, RefusedError
from .evaluation import evaluate, quantile
from .filters import Estimates, FactorisedImmEkf, ImmEkf, ImmKf, OracleEkf
from .fit.scenario import fit_scenario
from .io.logs import read_log
from .io.scenario_file import load, save
from .measurement import Range
from .motion import ConstantVelocity
from .noise import (
    Epoch,
    Exponential,
    ExponentiallyModifiedGaussian,
    FromLogDensity,
    FromNumPyro,
    Gamma,
    Gaussian,
    GaussianMixture,
    Laplace,
    LogNormal,
    Mixture,
    Singularity,
    StudentT,
    TruncatedGaussian,
    Uniform,
    bhattacharyya,
    minimum_error,
)
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
    "Epoch",
    "Estimates",
    "Exponential",
    "ExponentiallyModifiedGaussian",
    "FactorisedImmEkf",
    "FromLogDensity",
    "FromNumPyro",
    "Gamma",
    "Gaussian",
    "GaussianMixture",
    "GaussianPrior",
    "ImmEkf",
    "ImmKf",
    "InputError",
    "KnownSight",
    "Laplace",
    "Link",
    "LocboundsError",
    "LogNormal",
    "MarkovSight",
    "Mixture",
    "OracleEkf",
    "PrecisionError",
    "Prior",
    "Range",
    "RefusedError",
    "Result",
    "Scenario",
    "Singularity",
    "StudentT",
    "Times",
    "TruncatedGaussian",
    "Uniform",
    "bcrb",
    "bcrb_algorithm1",
    "bhattacharyya",
    "enumer",
    "evaluate",
    "explain",
    "fit_scenario",
    "known_sight",
    "load",
    "los_only",
    "minimum_error",
    "papers",
    "plot",
    "quantile",
    "read_log",
    "save",
    "simulate",
    "tightest",
]
