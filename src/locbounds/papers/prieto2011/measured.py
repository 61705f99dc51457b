"""Real distances: what fitted noises permit at measured points, and what simple estimators reach there.

One link is one distance, measured by a block of samples of both kinds. An error is ``offset + bias + noise``: the noise
is drawn for every sample, the bias stays the same for the block. Both are fitted on training points, everything else
happens on test points that the fit has not seen.
"""

import csv
import gzip
from pathlib import Path
from typing import NamedTuple

import numpy as np

from locbounds.axes import Float, ndarray
from locbounds.errors import InputError
from locbounds.fit.compare_laws import compare_noise_laws
from locbounds.noise import Gaussian, Noise
from locbounds.ranging import Strength, TimeOfArrival

FOLDER = "wifi_rtt_grid"
FAMILIES = ("gaussian", "laplace", "exponentially-modified-gaussian")
LEAST_SAMPLES = 10
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


def _table(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        raise InputError(f"there is no {path}", "Give the folder of the data set")
    with gzip.open(path, "rt") if path.suffix == ".gz" else path.open() as file:
        return list(csv.DictReader(file))


def read(folder: Path) -> dict[str, Links]:
    """The blocks of every scene.

    Raises
    ------
    InputError
        If a file is missing.
    """
    anchors = {(r["scene"], r["anchor_id"]): (float(r["x_m"]), float(r["y_m"])) for r in _table(folder / "anchors.csv")}
    points = {(r["scene"], r["point_id"]): r for r in _table(folder / "points.csv")}
    blocks: dict[tuple[str, str, str], list[tuple[float, float]]] = {}
    for r in _table(folder / "samples.csv.gz"):
        if r["range_m"] and r["rssi_dbm"]:
            key = r["scene"], r["point_id"], r["anchor_id"]
            blocks.setdefault(key, []).append((float(r["range_m"]), float(r["rssi_dbm"])))
    rows: dict[str, list[tuple]] = {}
    for (scene, point, anchor), values in blocks.items():
        place, z = points[scene, point], np.array(values)
        here = np.array([float(place["x_m"]), float(place["y_m"])])
        distance = float(np.linalg.norm(here - anchors[scene, anchor]))
        if len(z) >= LEAST_SAMPLES and distance > 0:
            spread = z.var(axis=0, ddof=1)
            rows.setdefault(scene, []).append(
                (int(point), place["split"] == "train", distance, *z.mean(axis=0), *spread, len(z))
            )
    return {scene: Links(*(np.array(column) for column in zip(*r, strict=True))) for scene, r in rows.items()}


def compare(folder: Path) -> list[Row]:
    """Fit on the training points of every scene, compare on its test points.

    Parameters
    ----------
    folder
        That of ``wifi_rtt_grid``.

    Returns
    -------
    list of Row
        RMSE of the distance in metres. Bounds are Cramér-Rao numbers at the true distances of the test links, rooted
        means over links: with the fitted bias common to a block (what the data are like) and, optimistically, drawn
        anew for every sample. Standard errors are over points.
    """
    return [row for scene, links in read(folder).items() for row in _scene(scene, links)]


def _scene(scene: str, links: Links) -> list[Row]:
    train, test = links.train, ~links.train
    d = links.distance_m
    X = np.stack([np.ones(train.sum()), -10 * np.log10(d[train])], 1)
    (level, exponent), *_ = np.linalg.lstsq(X, links.rssi[train], rcond=None)
    errors = {"toa": links.range_m - d, "rss": links.rssi - level + 10 * exponent * np.log10(d)}
    within = {"toa": links.within_range, "rss": links.within_rssi}
    M = int(np.median(links.samples))
    informations: dict[str, dict[bool, float]] = {}
    notes, offsets, spreads = {}, {}, {}
    half = links.point % 2 == 0  # of the training points one half fits the law of the bias, the other chooses it
    for kind, e in errors.items():
        std = float(np.sqrt(within[kind][train].mean()))
        rows = compare_noise_laws(
            e[train & half], e[train & ~half], groups=links.point[train & ~half], families=FAMILIES
        )
        best = next(row for row in rows if row.fit is not None)
        assert best.fit is not None
        bias: Noise = compare_noise_laws(e[train], e[train], families=(best.family,))[0].fit.noise  # type: ignore[union-attr]
        offsets[kind], spreads[kind] = float(np.mean(e[train])), float(np.std(e[train]))
        informations[kind] = {}
        for common in (True, False):
            options = {"samples": M, "common": common}
            noise = Gaussian(0.0, std)
            sensor = (
                TimeOfArrival(noise, bias, cycles_per_m=1.0, **options)
                if kind == "toa"
                else Strength(noise, bias, exponent=exponent, level=level, **options)
            )
            informations[kind][common] = float(sensor.information())
        unit = "m" if kind == "toa" else "dB"
        notes[kind] = f"bias: {best.family}, deviation {spreads[kind]:.2f} {unit}; noise {std:.2f} {unit}"
        if kind == "rss":
            notes[kind] += f"; exponent {exponent:.2f}"
    slope = {"toa": np.ones_like(d), "rss": 10 * exponent / np.log(10) / d}
    estimates = {
        "toa": links.range_m - offsets["toa"],
        "rss": 10 ** ((level - links.rssi) / (10 * exponent)),
    }
    seen = np.maximum(estimates["toa"], 0.5)  # where the strength is linearised
    residual = links.rssi - level + 10 * exponent * np.log10(seen)
    weight = {"toa": spreads["toa"] ** -2.0, "rss": (10 * exponent / np.log(10) / seen / spreads["rss"]) ** 2}
    step = -residual / (10 * exponent / np.log(10) / seen)
    moved = seen + step
    estimates["fusion"] = (weight["toa"] * estimates["toa"] + weight["rss"] * moved) / (weight["toa"] + weight["rss"])
    out = []
    for measured in ("rss", "toa", "fusion"):
        kinds = ("toa", "rss") if measured == "fusion" else (measured,)
        note = "" if measured == "fusion" else notes[measured]
        for common, name in ((False, "bound, bias drawn for every sample"), (True, "bound, bias common to the block")):
            J = sum(informations[kind][common] * slope[kind] ** 2 for kind in kinds)
            out.append(Row(scene, measured, name, float(np.sqrt(np.mean(1 / J[test]))), 0.0, int(test.sum()), note))
        error = (estimates[measured] - d)[test]
        value, stderr = _rmse(error, links.point[test])
        label = {"rss": "inverted path loss", "toa": "mean range less offset", "fusion": "weighted mean"}[measured]
        out.append(Row(scene, measured, label, value, stderr, int(test.sum()), ""))
        if measured != "toa":  # few links with huge errors make the RMSE of what is inverted
            central = float(np.median(np.abs(error)) / 0.6745)
            out.append(Row(scene, measured, f"{label}, robust spread", central, float("nan"), int(test.sum()), ""))
    return out


def _rmse(error: Float[ndarray, " n"], point: ndarray) -> tuple[float, float]:
    """RMSE, and its standard error by a jackknife over points."""
    value = float(np.sqrt(np.mean(error**2)))
    names = np.unique(point)
    without = np.array([np.sqrt(np.mean(error[point != p] ** 2)) for p in names])
    return value, float(np.sqrt((len(names) - 1) * np.var(without)))


WHY = (
    "Samples of one block share their bias: bounds that draw it anew for every sample promise what no estimator can reach.",
    "With the common bias the time-of-arrival bound and the mean range agree within what the misfit of one law for all "
    "places explains; averaging more samples does not help.",
    "Inverting the path loss multiplies the distance by a random factor: its error grows with the distance and is biased "
    "upwards, which a Cramér-Rao number at the true distance, for unbiased estimators and small errors, leaves out.",
    "Cramér-Rao numbers at given distances hold for unbiased estimators; they are no bounds for estimators that shrink.",
)
