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
from .io.footprints import read_city
from .io.link_table import read_links
from .io.logs import read_log
from .io.plans import read_plan
from .io.scenario_file import load, save
from .io.surveys import read_survey
from .measurement import Bearing, BySight, Elevation, Function, PathLoss, Range, RangeDifference
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
from .plan import Observations, Plan, aoa, observe, rss, tdoa, toa
from .priors import DensityPrior, GaussianPrior, PriorMixture, Prism, UniformBox, UniformDisc, UniformPolygon
from .propagation import (
    Building,
    City,
    Links,
    LinkTable,
    StreetCell,
    StreetRanges,
    street_cells,
    street_links,
    uniform_on,
)
from .reference import reference
from .registry import explain
from .report import plot
from .requirement import comply
from .result import Result
from .scenario import Link, Scenario
from .scoring import Score, score
from .sight import DwellSight, KnownSight, MarkovSight
from .simulation import Draws, simulate
from .static import merit
from .static.barankin import barankin
from .static.crlb import crlb
from .static.dop import dop
from .static.estimators import ls, ml
from .static.maps import AccuracyMap
from .static.mmse import mmse
from .static.noise_levels import bounds_over_noise
from .static.street_map import cell_bounds, street_map, table_bounds
from .static.street_raster import raster_ezzb, raster_mmse, raster_wwb, street_raster
from .static.tightest import Tightest, tightest
from .static.weiss_weinstein import wwb
from .static.ziv_zakai import ezzb
from .street_walk import Walk, street_walk
from .survey import Fingerprints, discrete_mmse, survey_bound, survey_model
from .times import Times

__version__: str
__all__ = [
    "AccuracyMap",
    "AdditiveChannel",
    "AlongTrack",
    "Bearing",
    "Building",
    "BySight",
    "City",
    "ConstantAcceleration",
    "ConstantVelocity",
    "CoordinatedTurn",
    "DensityChannel",
    "DensityMotion",
    "DensityPrior",
    "Draws",
    "DwellSight",
    "EkfBanks",
    "Elevation",
    "Epoch",
    "Estimates",
    "Exponential",
    "ExponentiallyModifiedGaussian",
    "FactorisedImmEkf",
    "Fingerprints",
    "FromLogDensity",
    "FromNumPyro",
    "Function",
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
    "LinkTable",
    "Links",
    "LocboundsError",
    "LogNormal",
    "MarkovSight",
    "Mixture",
    "Observations",
    "OracleEkf",
    "PathLoss",
    "Plan",
    "PrecisionError",
    "Predicted",
    "Prior",
    "PriorMixture",
    "Prism",
    "RandomWalk",
    "Range",
    "RangeDifference",
    "Rbpf",
    "RefusedError",
    "Result",
    "Scenario",
    "Score",
    "Singularity",
    "Smoothed",
    "StreetCell",
    "StreetRanges",
    "StudentT",
    "SwitchingMotion",
    "Tightest",
    "Times",
    "TruncatedGaussian",
    "Uniform",
    "UniformBox",
    "UniformDisc",
    "UniformPolygon",
    "Walk",
    "aoa",
    "barankin",
    "bcrb",
    "bcrb_algorithm1",
    "bcrb_block_tridiagonal",
    "bhattacharyya",
    "bounds_over_noise",
    "cell_bounds",
    "comply",
    "crlb",
    "discrete_mmse",
    "dop",
    "enumer",
    "evaluate",
    "explain",
    "ezzb",
    "fit_scenario",
    "jump_markov",
    "known_sight",
    "load",
    "los_only",
    "ls",
    "merit",
    "minimum_error",
    "ml",
    "mmse",
    "observe",
    "papers",
    "plot",
    "quantile",
    "ranging",
    "raster_ezzb",
    "raster_mmse",
    "raster_wwb",
    "read_city",
    "read_links",
    "read_log",
    "read_plan",
    "read_survey",
    "reference",
    "rss",
    "save",
    "score",
    "simulate",
    "street_cells",
    "street_links",
    "street_map",
    "street_raster",
    "street_walk",
    "survey_bound",
    "survey_model",
    "table_bounds",
    "tdoa",
    "testing",
    "tightest",
    "toa",
    "uniform_on",
    "wwb",
    "wwb_recursive",
]
