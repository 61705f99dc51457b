from locbounds import papers
from locbounds.bounds import AlongTrack, Prior, bcrb, bcrb_algorithm1, enumer, known_sight, los_only
from locbounds.measurement import Range
from locbounds.motion import ConstantVelocity
from locbounds.noise import Gaussian, GaussianMixture
from locbounds.priors import GaussianPrior
from locbounds.result import Result, tightest
from locbounds.scenario import Link, Scenario
from locbounds.sight import DwellSight, KnownSight, MarkovSight
from locbounds.simulate import simulate
from locbounds.times import Times
__version__="0.1.0"
