"""Small distance models that the tests of bounds and filters share."""

import numpy as np

import locbounds as lb
from locbounds.ranging import DistanceModel, Strength, TimeOfArrival

STEPS = 12
START, STD = (20.0, 0.0, 0.0), (2.0, 0.5, 0.75)
TIMES = lb.Times.uniform(step_s=1.0, steps=STEPS)


def cut(std):
    return lb.TruncatedGaussian(0.0, std, -2 * std, 2 * std)


def toa(**changes):
    return TimeOfArrival(**({"noise": lb.Gaussian(0.0, 3.5), "bias": lb.Uniform(0.0, 3.0), "samples": 10} | changes))


def rss(**changes):
    return Strength(**({"noise": lb.Gaussian(0.0, 1.6), "bias": lb.Gaussian(0.0, 3.0), "samples": 10} | changes))


def model(*sensors, times=TIMES):
    return DistanceModel(times, START, STD, 1.0, sensors)


def track(steps=STEPS):
    return 20.0 + 4.0 * np.sin(np.arange(steps + 1) / 4)
