"""The setting of the paper, and what had to be chosen where it is silent.

Printed: ten samples of each kind per second for 85 s, distances from 10 to 30 m, deviations 1.6 and 3 dB (signal
strength), 3.5 cycles and a bias of up to 3 cycles (time of arrival), deviations of the derivatives 0.5 m/s, 0.75 m/s^2
and 1 m/s^3. Silent: the constants of both measurements, the prior of the distance, the trajectory. Chosen: level 0 dB
(a known constant changes nothing), path loss exponent 2.5, the round-trip clock of IEEE 802.11 (44 MHz), a prior
deviation of 2 m, ``d_k = 20 - 10 cos(2 pi k / 85)``.
"""

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.noise import Gaussian, Noise, TruncatedGaussian, Uniform
from locbounds.ranging import DistanceModel, Strength, TimeOfArrival
from locbounds.times import Times

STEPS, SAMPLES = 85, 10
RSS_DB, RSS_BIAS_DB = 1.6, 3.0
TOA_CYCLES, TOA_BIAS_CYCLES = 3.5, 3.0
CUT = 2.0  # deviations
EXPONENT = 2.5
START_STD_M = 2.0
DERIVATIVES_STD = (0.5, 0.75)
DRIVING_STD = 1.0
CASES = {"rss": ("rss",), "toa": ("toa",), "fusion": ("rss", "toa")}


def cut(std: float) -> TruncatedGaussian:
    """Zero-mean Gaussian cut at two deviations, as in eqs. (3), (4) and (7).

    >>> cut(1.6).support()
    ((-3.2, 3.2),)
    """
    return TruncatedGaussian(0.0, std, -CUT * std, CUT * std)


def trajectory(steps: int = STEPS) -> Float[ndarray, " times"]:
    """Distances at steps 0..K, from 10 m to 30 m and back.

    >>> [round(float(d), 1) for d in trajectory()[[0, 42, 85]]]
    [10.0, 30.0, 10.0]
    """
    return 20.0 - 10.0 * np.cos(2 * np.pi * np.arange(steps + 1) / STEPS)


def scenario(
    case: str = "fusion", *, noise: str = "cut", common: bool = False, samples: int = SAMPLES, steps: int = STEPS
) -> DistanceModel:
    """The model of one case.

    Parameters
    ----------
    case
        ``"rss"``, ``"toa"`` or ``"fusion"``.
    noise
        ``"cut"``: as in the paper; ``"regular"``: the Gaussian laws are not cut (another model); ``"believed"``: what
        the paper's filter takes them for, all Gaussian.
    common
        One bias for all samples of a second, instead of one for each.
    samples, steps
        Samples of each kind per second; seconds.

    Examples
    --------
    >>> scenario("toa").sensors[0].error.regularity().status
    'irregular'
    """

    def gaussian(std: float) -> Noise:
        return cut(std) if noise == "cut" else Gaussian(0.0, std)

    gamma = TOA_BIAS_CYCLES
    uniform = Gaussian(gamma / 2, gamma / 4) if noise == "believed" else Uniform(0.0, gamma)
    options = {"samples": samples, "common": common}
    sensors = {
        "rss": Strength(gaussian(RSS_DB), gaussian(RSS_BIAS_DB), exponent=EXPONENT, **options),
        "toa": TimeOfArrival(gaussian(TOA_CYCLES), uniform, **options),
    }
    start = [float(trajectory()[0]), 0.0, 0.0]
    times = Times.uniform(step_s=1.0, steps=steps)
    used = [sensors[name] for name in CASES[case]]
    return DistanceModel(times, start, [START_STD_M, *DERIVATIVES_STD], DRIVING_STD, used)
