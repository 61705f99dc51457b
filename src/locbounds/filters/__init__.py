"""Filters: one algorithm per file, all with the call ``filter(scenario, z, seed=0) -> Estimates``."""

from locbounds.filters.ekf_banks import EkfBanks
from locbounds.filters.estimates import Estimates
from locbounds.filters.horizons import Predicted, Smoothed, with_horizon
from locbounds.filters.imm_ekf import ImmEkf
from locbounds.filters.imm_ekf_factorised import FactorisedImmEkf
from locbounds.filters.imm_kf import ImmKf
from locbounds.filters.imm_kf_smoother import ImmKfSmoother
from locbounds.filters.oracle_ekf import OracleEkf
from locbounds.filters.rbpf import Rbpf

__all__ = [
    "EkfBanks",
    "Estimates",
    "FactorisedImmEkf",
    "ImmEkf",
    "ImmKf",
    "ImmKfSmoother",
    "OracleEkf",
    "Predicted",
    "Rbpf",
    "Smoothed",
    "with_horizon",
]
