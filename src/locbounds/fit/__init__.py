"""Noise, sight and motion models from logs of real ranges."""

from locbounds.fit.compare_laws import LawComparison, compare_noise_laws
from locbounds.fit.motion import MotionFit, fit_psd, prior_from_tracks
from locbounds.fit.noise_law import LAWS, LawFit, fit_noise_law
from locbounds.fit.quality import FitQuality, LinkQuality, fit_quality, quality_figure
from locbounds.fit.range_errors import RangeErrors, errors_of_log
from locbounds.fit.range_log import ErrorSequences, RangeLog, Track
from locbounds.fit.scenario import FittedScenario, fit_scenario
from locbounds.fit.sight_noise import SightNoiseFit, fit_sight_noise

__all__ = [
    "LAWS",
    "ErrorSequences",
    "FitQuality",
    "FittedScenario",
    "LawComparison",
    "LawFit",
    "LinkQuality",
    "MotionFit",
    "RangeErrors",
    "RangeLog",
    "SightNoiseFit",
    "Track",
    "compare_noise_laws",
    "errors_of_log",
    "fit_noise_law",
    "fit_psd",
    "fit_quality",
    "fit_scenario",
    "fit_sight_noise",
    "prior_from_tracks",
    "quality_figure",
]
