"""Sight and shortest paths in a city: seconds of the visibility graph, growth, and Shapely's sight tests alone beside.

Without the measured city a made-up one of the same size is used (LOCBOUNDS_DATA names the folder that has it).
"""

import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import shapely

import locbounds as lb
from locbounds.propagation import City, street_links

POINTS, ANCHORS, REPEATS, SHAPELY_PAIRS = 10_000, 10, 3, 1_000


def city() -> City:
    data = Path(os.environ.get("LOCBOUNDS_DATA") or Path(__file__).parents[2] / "shared" / "data")
    path = data / "city_munich" / "buildings.geojson"
    return lb.read_city(path) if path.is_file() else made_up(387)


def made_up(count: int) -> City:
    """So many quadrangles with streets between them."""
    rng, side = np.random.default_rng(0), int(np.ceil(np.sqrt(count)))
    blocks = []
    for k in range(count):
        corners = np.array([[0, 0], [24, 0], [24, 20], [0, 20]]) + rng.uniform(-3, 3, (4, 2))
        blocks.append(shapely.Polygon(corners + 32.0 * np.array([k % side, k // side])))
    return City(blocks)


def places(c: City, n: int, seed: int) -> np.ndarray:
    low, high = c.bounds[:2], c.bounds[2:]
    points = np.random.default_rng(seed).uniform(low, high, (6 * n + 100, 2))
    return points[~c.inside(points)][:n]


def seconds(run: Callable[[], object], repeats: int = REPEATS) -> float:
    out = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        out.append(time.perf_counter() - start)
    return float(np.median(out))


def growth(name: str, sizes: list[int], run: Callable[[int], float]) -> None:
    t = np.array([run(n) for n in sizes])
    slope = np.polyfit(np.log(sizes), np.log(t), 1)[0]
    print(f"{name:12s} exponent {slope:.2f}; " + ", ".join(f"{n}: {s:.2f} s" for n, s in zip(sizes, t, strict=True)))


def main() -> None:
    c = city()
    anchors, points = places(c, ANCHORS, 1), places(c, POINTS, 2)
    start = time.perf_counter()
    _ = c.graph.weights
    first = time.perf_counter() - start
    warm = seconds(lambda: street_links(c, anchors, points))
    print(f"{len(c.buildings)} footprints, {len(c.graph.corner)} corners: graph {first:.2f} s, once per city")
    print(f"{POINTS:,} points x {ANCHORS} anchors, sight and shortest paths, warm: {warm:.2f} s")
    pairs = np.random.default_rng(3).integers(0, (POINTS, ANCHORS), (SHAPELY_PAIRS, 2))
    lines = shapely.linestrings(np.stack([points[pairs[:, 0]], anchors[pairs[:, 1]]], axis=1))
    solid = shapely.buffer(c.obstacles, -1e-6, join_style="mitre")
    each = POINTS * ANCHORS / SHAPELY_PAIRS
    plain = seconds(lambda: shapely.intersects(solid, lines), 1) * each
    shapely.prepare(solid)
    prepared = seconds(lambda: shapely.intersects(solid, lines)) * each
    print(f"Shapely, sight alone, from {SHAPELY_PAIRS} pairs: {plain:.0f} s ({plain / warm:.0f} times as long)")
    print(f"Shapely, sight alone, prepared: {prepared:.1f} s")
    growth(
        "points", [2500, 5000, 10_000, 20_000], lambda n: seconds(lambda: street_links(c, anchors, places(c, n, 4)), 1)
    )
    growth("anchors", [5, 10, 20, 40], lambda n: seconds(lambda: street_links(c, places(c, n, 5), points), 1))

    def built(n: int) -> float:
        made = made_up(n)
        return seconds(lambda: street_links(made, places(made, 5, 6), places(made, 2000, 7)), 1)

    growth("buildings", [100, 200, 400, 800], built)


if __name__ == "__main__":
    main()
