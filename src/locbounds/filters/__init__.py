"""Filters: one algorithm per file, all with the call ``filter(scenario, z, seed=0) -> Estimates``."""

from locbounds.filters.estimates import Estimates
from locbounds.filters.imm_ekf import ImmEkf
from locbounds.filters.imm_ekf_factorised import FactorisedImmEkf
from locbounds.filters.imm_kf import ImmKf
from locbounds.filters.oracle_ekf import OracleEkf

__all__ = ["Estimates", "FactorisedImmEkf", "ImmEkf", "ImmKf", "OracleEkf"]
