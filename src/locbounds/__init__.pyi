# The public names: what type checkers see, and what is imported on first use (lazy-loader reads this file).
from . import papers, ranging, testing
from .bounds import (
    AlongTrack,
    Gaussians,
    Prior,
    bcrb,
    bcrb_algorithm1,
    bcrb_block_tridiagonal,
    enumer,
    known_sight,
    los_only,
    wwb_recursive,
)
from .errors import InputError, LocboundsError, PrecisionError, RefusedError
from .evaluation import evaluate, quantile
from .filters import (
    EkfBanks,
    Estimates,
    FactorisedImmEkf,
    ImmEkf,
    ImmKf,
    ImmKfSmoother,
    OracleEkf,
    Predicted,
    Rbpf,
    Smoothed,
)
from .fit.scenario import fit_scenario
from .io.logs import read_log
from .io.scenario_file import load, save
from .io.surveys import read_survey
from .measurement import BySight, Range
from .model import AdditiveChannel, DensityChannel, DensityMotion, JumpMarkov, jump_markov
from .motion import ConstantAcceleration, ConstantVelocity, CoordinatedTurn, LinearMotion, RandomWalk, SwitchingMotion
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
from .priors import DensityPrior, GaussianPrior
from .reference import reference
from .registry import explain
from .report import plot
from .requirement import comply
from .result import Result, tightest
from .scenario import Link, Scenario
from .scoring import Score, score
from .sight import DwellSight, KnownSight, MarkovSight
from .simulation import Draws, simulate
from .survey import Fingerprints, discrete_mmse, survey_bound, survey_model
from .times import Times

__version__: str
__all__ = [
    "AdditiveChannel",
    "AlongTrack",
    "BySight",
    "ConstantAcceleration",
    "ConstantVelocity",
    "CoordinatedTurn",
    "DensityChannel",
    "DensityMotion",
    "DensityPrior",
    "Draws",
    "DwellSight",
    "EkfBanks",
    "Epoch",
    "Estimates",
    "Exponential",
    "ExponentiallyModifiedGaussian",
    "FactorisedImmEkf",
    "Fingerprints",
    "FromLogDensity",
    "FromNumPyro",
    "Gamma",
    "Gaussian",
    "GaussianMixture",
    "GaussianPrior",
    "Gaussians",
    "ImmEkf",
    "ImmKf",
    "ImmKfSmoother",
    "InputError",
    "JumpMarkov",
    "KnownSight",
    "Laplace",
    "LinearMotion",
    "Link",
    "LocboundsError",
    "LogNormal",
    "MarkovSight",
    "Mixture",
    "OracleEkf",
    "PrecisionError",
    "Predicted",
    "Prior",
    "RandomWalk",
    "Range",
    "Rbpf",
    "RefusedError",
    "Result",
    "Scenario",
    "Score",
    "Singularity",
    "Smoothed",
    "StudentT",
    "SwitchingMotion",
    "Times",
    "TruncatedGaussian",
    "Uniform",
    "bcrb",
    "bcrb_algorithm1",
    "bcrb_block_tridiagonal",
    "bhattacharyya",
    "comply",
    "discrete_mmse",
    "enumer",
    "evaluate",
    "explain",
    "fit_scenario",
    "jump_markov",
    "known_sight",
    "load",
    "los_only",
    "minimum_error",
    "papers",
    "plot",
    "quantile",
    "ranging",
    "read_log",
    "read_survey",
    "reference",
    "save",
    "score",
    "simulate",
    "survey_bound",
    "survey_model",
    "testing",
    "tightest",
    "wwb_recursive",
]
