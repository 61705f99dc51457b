"""Fingerprint surveys: the rigorous bound, the least error of the discretised problem, and what estimators reach."""

from locbounds.survey.bound import SurveyBound, survey_bound, survey_candidates
from locbounds.survey.fingerprints import Fingerprints
from locbounds.survey.mmse import DiscreteMmse, discrete_mmse
from locbounds.survey.model import SurveyModel, survey_model
from locbounds.survey.noise import Noise, estimate_noise
from locbounds.survey.printed import printed_mse

__all__ = [
    "DiscreteMmse",
    "Fingerprints",
    "Noise",
    "SurveyBound",
    "SurveyModel",
    "discrete_mmse",
    "estimate_noise",
    "printed_mse",
    "survey_bound",
    "survey_candidates",
    "survey_model",
]
