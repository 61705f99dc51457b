"""Accuracy bounds for locating a mobile over radio links that switch between line of sight and non-line of sight."""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submodules=["papers"],
    submod_attrs={
        "bounds": ["AlongTrack", "Prior", "bcrb", "bcrb_algorithm1", "enumer", "known_sight", "los_only"],
        "errors": ["InputError", "LocboundsError", "PrecisionError", "RefusedError"],
        "evaluation": ["evaluate", "quantile"],
        "io.scenario_file": ["load", "save"],
        "measurement": ["Range"],
        "motion": ["ConstantVelocity"],
        "noise": ["Gaussian", "GaussianMixture"],
        "priors": ["GaussianPrior"],
        "report": ["plot"],
        "result": ["Result", "tightest"],
        "scenario": ["Link", "Scenario"],
        "sight": ["DwellSight", "KnownSight", "MarkovSight"],
        "simulation": ["Draws", "simulate"],
        "times": ["Times"],
    },
)
