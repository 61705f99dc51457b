# The public names: what type checkers see, and what is imported on first use (lazy-loader reads this file).
from . import papers
from .bounds import AlongTrack, Prior, bcrb, bcrb_algorithm1, bcrb_block_tridiagonal, enumer, known_sight, los_only
from .errors import InputError, LocboundsError, PrecisionError, RefusedError
from .evaluation import evaluate, quantile
from .filters import Estimates, FactorisedImmEkf, ImmEkf, ImmKf, OracleEkf
from .fit.scenario import fit_scenario
from .io.logs import read_log
from .io.scenario_file import load, save
from .measurement import BySight, Range
from .model import AdditiveChannel, DensityChannel, DensityMotion, JumpMarkov, jump_markov
from .motion import ConstantAcceleration, ConstantVelocity, CoordinatedTurn, LinearMotion, RandomWalk, SwitchingMotion
from .noise import Gaussian, GaussianMixture
from .priors import DensityPrior, GaussianPrior
from .registry import explain
from .report import plot
from .result import Result, tightest
from .scenario import Link, Scenario
from .sight import DwellSight, KnownSight, MarkovSight
from .simulation import Draws, simulate
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
    "Estimates",
    "FactorisedImmEkf",
    "Gaussian",
    "GaussianMixture",
    "GaussianPrior",
    "ImmEkf",
    "ImmKf",
    "InputError",
    "JumpMarkov",
    "KnownSight",
    "LinearMotion",
    "Link",
    "LocboundsError",
    "MarkovSight",
    "OracleEkf",
    "PrecisionError",
    "Prior",
    "RandomWalk",
    "Range",
    "RefusedError",
    "Result",
    "Scenario",
    "SwitchingMotion",
    "Times",
    "bcrb",
    "bcrb_algorithm1",
    "bcrb_block_tridiagonal",
    "enumer",
    "evaluate",
    "explain",
    "fit_scenario",
    "jump_markov",
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
