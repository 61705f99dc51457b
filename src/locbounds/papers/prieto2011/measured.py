"""Real distances: what fitted noises permit at measured points, and what simple estimators reach there.

One link is one distance, measured by a block of samples of both kinds. An error is ``bias + noise``: the noise is drawn
for every sample, the bias stays the same for the block. Both laws are fitted on training points, everything else
happens on test points that the fit has not seen. With Gaussian noise the block mean is sufficient (its density is that
of one sample with the law of :meth:`Sensor.epoch_noise`), and the prior of the distance is that of the training links:
so the posterior mean and its mean square error, which no other estimator undercuts if the laws are right, are sums over
these.
"""

from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError
from locbounds.fit.compare_laws import compare_noise_laws
from locbounds.io.csv_table import CsvTable
from locbounds.noise import Gaussian, Noise
from locbounds.precision import double_precision
from locbounds.ranging import Sensor, Strength, TimeOfArrival

FOLDER = "wifi_rtt_grid"
FAMILIES = ("gaussian", "laplace", "exponentially-modified-gaussian")
LEAST_SAMPLES = 10
DRAWS = 2_000  # of the mean square error that the fitted laws predict
NEAREST_M = 0.5
COLUMNS = ("scene", "measured", "method", "rmse_m", "stderr_m", "links", "note")


class Links(NamedTuple):
    """Blocks of samples, one per point and anchor."""

    point: ndarray
    train: ndarray
    distance_m: ndarray
    range_m: ndarray
    rssi: ndarray
    within_range: ndarray
    within_rssi: ndarray
    samples: ndarray


class Row(NamedTuple):
    """One number of the comparison."""

    scene: str
    measured: str
    method: str
    rmse_m: float
    stderr_m: float
    links: int
    note: str


def _table(path: Path, names: list[str], numbers: list[str]) -> Any:
    """Named columns of a file as a data frame; lines that lack a number are left out."""
    table = CsvTable(path, path.name.partition(".")[0])
    for column in (*names, *numbers):
        if column not in table:
            raise InputError(f"{path.name} has no column {column}", "Give the files of the data set as they are")
    cells: dict[str, ndarray] = {name: table.text(name) for name in names}
    return pd.DataFrame(cells | {name: table.numbers(name, empty=True) for name in numbers}).dropna()


def read(folder: Path) -> dict[str, Links]:
    """The blocks of every scene.

    Raises
    ------
    InputError
        If a file is missing or no such table; if samples name a point or an anchor without a place.
    """
    at, values = ["x_m", "y_m"], ["range_m", "rssi_dbm"]
    samples = _table(folder / "samples.csv.gz", ["scene", "anchor_id"], ["point_id", *values]).astype({"point_id": int})
    blocks = samples.groupby(["scene", "point_id", "anchor_id"], sort=False)[values].agg(["mean", "var", "size"])
    blocks.columns = ["_".join(names) for names in blocks.columns]
    blocks = blocks.reset_index()
    for name, texts, numbers in (("point", ["scene", "split"], ["point_id"]), ("anchor", ["scene", "anchor_id"], [])):
        key = ["scene", f"{name}_id"]
        places = _table(folder / f"{name}s.csv", texts, [*numbers, *at]).drop_duplicates(key, keep="last")
        blocks = blocks.merge(places.rename(columns={axis: f"{axis}_{name}" for axis in at}), "left", on=key)
        for _, lost in blocks[blocks[f"x_m_{name}"].isna()].iterrows():
            raise InputError(
                f"{name}s.csv has no place of {name} {lost[key[1]]} in {lost['scene']}", "Add a line with its place"
            )
    blocks["distance_m"] = np.hypot(*(blocks[f"{axis}_point"] - blocks[f"{axis}_anchor"] for axis in at))
    blocks = blocks[(blocks["range_m_size"] >= LEAST_SAMPLES) & (blocks["distance_m"] > 0)]
    return {
        str(scene): Links(
            point=rows["point_id"].to_numpy(dtype=int),
            train=(rows["split"] == "train").to_numpy(),
            distance_m=rows["distance_m"].to_numpy(),
            range_m=rows["range_m_mean"].to_numpy(),
            rssi=rows["rssi_dbm_mean"].to_numpy(),
            within_range=rows["range_m_var"].to_numpy(),
            within_rssi=rows["rssi_dbm_var"].to_numpy(),
            samples=rows["range_m_size"].to_numpy(),
        )
        for scene, rows in blocks.groupby("scene", sort=False)
    }


def compare(folder: Path, *, seed: int = 0) -> list[Row]:
    """Fit on the training points of every scene, compare on its test points.

    Parameters
    ----------
    folder
        That of ``wifi_rtt_grid``.
    seed
        Of the draws of the predicted mean square error.

    Returns
    -------
    list of Row
        RMSE of the distance in metres. Cramér-Rao numbers are at the true distances of the test links, rooted means
        over links: with the fitted bias common to a block (what the data are like) and, optimistically, drawn anew for
        every sample. Standard errors of estimators are over points, those of predictions over draws.
    """
    return [row for scene, links in read(folder).items() for row in _scene(scene, links, seed)]


class Fitted(NamedTuple):
    """One kind of measurement, fitted on the training links: ``mean = sensor().mean(d) + bias + noise``."""

    kind: str
    level: float
    exponent: float
    bias: Noise
    noise_std: float
    family: str
    spread: float

    def sensor(self, samples: int = 1, *, common: bool = True) -> Sensor:
        """What measures blocks of so many samples, with one bias for a block or one for each sample."""
        noise, options = Gaussian(0.0, self.noise_std), {"samples": samples, "common": common}
        if self.kind == "toa":
            return TimeOfArrival(noise, self.bias, cycles_per_m=1.0, **options)
        return Strength(noise, self.bias, exponent=self.exponent, level=self.level, **options)


def fit(kind: str, links: Links) -> Fitted:
    """Fit one kind, ``"toa"`` or ``"rss"``, to the training links.

    The family of the bias is the one that says most about the second half of the training points, from a fit to the
    first half.
    """
    train, half = links.train, links.point % 2 == 0
    d, level, exponent = links.distance_m, 0.0, 1.0
    if kind == "rss":
        X = np.stack([np.ones(train.sum()), -10 * np.log10(d[train])], 1)
        level, exponent = (float(x) for x in np.linalg.lstsq(X, links.rssi[train], rcond=None)[0])
        e = links.rssi - level + 10 * exponent * np.log10(d)
    else:
        e = links.range_m - d
    within = links.within_range if kind == "toa" else links.within_rssi
    rows = compare_noise_laws(e[train & half], e[train & ~half], groups=links.point[train & ~half], families=FAMILIES)
    best = next(row for row in rows if row.fit is not None)
    bias = compare_noise_laws(e[train], e[train], families=(best.family,))[0].fit
    assert bias is not None
    std = float(np.sqrt(within[train].mean()))
    return Fitted(kind, level, exponent, bias.noise, std, best.family, float(np.std(e[train])))


@double_precision
def _log_density(law: Noise, e: ndarray) -> ndarray:
    return np.asarray(law.log_prob(jnp.asarray(e)))


@double_precision
def _draw(law: Noise, count: int, seed: int) -> ndarray:
    return np.asarray(law.sample(jax.random.key(seed), (count,)))


def posterior_mean(
    fitted: tuple[Fitted, ...], values: tuple[ndarray, ...], prior: Float[ndarray, " places"], samples: int
) -> Float[ndarray, " n"]:
    """Posterior means of distances from block means, with equal prior weights on some places.

    Parameters
    ----------
    fitted
        The kinds that are used.
    values
        Block means of each kind, [n].
    prior
        Distances.
    samples
        Samples per block.
    """
    total = np.zeros((len(values[0]), len(prior)))
    for f, z in zip(fitted, values, strict=True):
        sensor = f.sensor(samples)
        total = total + _log_density(sensor.epoch_noise()[0], z[:, None] - np.asarray(sensor.mean(prior)))
    weight = np.exp(total - total.max(1, keepdims=True))
    return weight @ prior / weight.sum(1)


def _scene(scene: str, links: Links, seed: int) -> list[Row]:
    train, test, d = links.train, ~links.train, links.distance_m
    toa, rss = fit("toa", links), fit("rss", links)
    M = int(np.median(links.samples))
    block = {"toa": links.range_m, "rss": links.rssi}
    rng = np.random.default_rng(seed)
    prior = np.sort(d[train])
    drawn = prior[rng.integers(len(prior), size=DRAWS)]
    simple = _simple(toa, rss, links)
    out = []
    for measured, used in (("rss", (rss,)), ("toa", (toa,)), ("fusion", (toa, rss))):
        note = "" if measured == "fusion" else _note(used[0])
        for common, name in ((False, "Cramér-Rao, bias drawn per sample"), (True, "Cramér-Rao, bias of the block")):
            sensors = [f.sensor(M, common=common) for f in used]
            J = sum(float(s.information()) * np.asarray(s.slope(d[test])) ** 2 for s in sensors)
            out.append(Row(scene, measured, name, float(np.sqrt(np.mean(1 / J))), 0.0, int(test.sum()), note))
        sensors = [f.sensor(M) for f in used]
        laws = [s.epoch_noise()[0] for s in sensors]
        errors = [_draw(law, DRAWS, seed + i) for i, law in enumerate(laws)]
        z = tuple(np.asarray(s.mean(drawn)) + e for s, e in zip(sensors, errors, strict=True))
        squares = (posterior_mean(used, z, prior, M) - drawn) ** 2
        root = float(np.sqrt(squares.mean()))
        error = float(squares.std() / np.sqrt(DRAWS) / (2 * root))
        out.append(Row(scene, measured, "posterior mean, as the laws predict", root, error, DRAWS, ""))
        found = posterior_mean(used, tuple(block[f.kind][test] for f in used), prior, M)
        names = {"posterior mean, measured": found, **simple[measured]}
        for name, estimate in names.items():
            value, stderr = _rmse((estimate if len(estimate) < len(d) else estimate[test]) - d[test], links.point[test])
            out.append(Row(scene, measured, name, value, stderr, int(test.sum()), ""))
    return out


def _note(f: Fitted) -> str:
    unit = "m" if f.kind == "toa" else "dB"
    note = f"bias {SHORT.get(f.family, f.family)}, {f.spread:.2f} {unit}; noise {f.noise_std:.2f} {unit}"
    return note if f.kind == "toa" else f"{note}; exponent {f.exponent:.2f}"


SHORT = {"exponentially-modified-gaussian": "Gaussian + exponential"}


def _simple(toa: Fitted, rss: Fitted, links: Links) -> dict[str, dict[str, ndarray]]:
    """Estimates of all links, by kind and name."""
    mean = links.range_m - float(np.mean((links.range_m - links.distance_m)[links.train]))
    sensor = rss.sensor()
    near = np.maximum(mean, NEAREST_M)  # where the strength is linearised
    slope = np.asarray(sensor.slope(near))
    moved = near + (links.rssi - np.asarray(sensor.mean(near))) / slope
    a, b = toa.spread**-2.0, (slope / rss.spread) ** 2
    return {
        "rss": {"inverted path loss": np.asarray(sensor.inverse(links.rssi))},
        "toa": {"mean range less offset": mean},
        "fusion": {"weighted mean": (a * mean + b * moved) / (a + b)},
    }


def _rmse(error: Float[ndarray, " n"], point: ndarray) -> tuple[float, float]:
    """RMSE, and its standard error by a jackknife over points."""
    value = float(np.sqrt(np.mean(error**2)))
    names = np.unique(point)
    without = np.array([np.sqrt(np.mean(error[point != p] ** 2)) for p in names])
    return value, float(np.sqrt((len(names) - 1) * np.var(without)))


WHY = (
    "Samples of one block share their bias. A Cramér-Rao number that draws it anew for every sample promises what no "
    "estimator reaches, and averaging more samples does not help.",
    "With the bias of the block, one block is one observation. The Cramér-Rao number is attained for Gaussian laws "
    "only: where the bias is skewed it asks for many blocks, and an estimator that follows shifts has at best the "
    "deviation of the law.",
    "The posterior mean is the best estimator if laws and prior (the training distances) are right. What it reaches "
    "on test points differs from what they predict because one law stands for all places and anchors.",
    "It beats the Cramér-Rao number where strengths say little: that number is for unbiased estimators at a given "
    "distance, and a prior shrinks. Inverting the path loss multiplies the distance by a random factor, and pays for "
    "it: its error grows with the distance.",
)
