"""One distance over time, from signal strengths and times of arrival: model, bounds, filters."""

from locbounds.ranging.bounds import distance_bcrb, distance_wwb, information
from locbounds.ranging.draws import measure
from locbounds.ranging.ekf import DistanceEkf
from locbounds.ranging.evaluate import evaluate_distance
from locbounds.ranging.model import DistanceModel
from locbounds.ranging.particles import DistanceParticles
from locbounds.ranging.sensors import Sensor, Strength, TimeOfArrival

__all__ = [
    "DistanceEkf",
    "DistanceModel",
    "DistanceParticles",
    "Sensor",
    "Strength",
    "TimeOfArrival",
    "distance_bcrb",
    "distance_wwb",
    "evaluate_distance",
    "information",
    "measure",
]
