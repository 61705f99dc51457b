"""Bounds: one family per file."""

from locbounds.bounds.algorithm1 import bcrb_algorithm1
from locbounds.bounds.bcrb import bcrb, known_sight
from locbounds.bounds.conditional import enumer, los_only
from locbounds.bounds.corrected import bcrb_block_tridiagonal
from locbounds.bounds.expectation import AlongTrack, Expectation, Prior
from locbounds.bounds.gaussians import Gaussians
from locbounds.bounds.weinstein import wwb_recursive

__all__ = [
    "AlongTrack",
    "Expectation",
    "Gaussians",
    "Prior",
    "bcrb",
    "bcrb_algorithm1",
    "bcrb_block_tridiagonal",
    "enumer",
    "known_sight",
    "los_only",
    "wwb_recursive",
]
