"""Photographs -> reflectance field, plainly: chain.py CAPTURE OUT.npz"""
import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"
import argparse
import csv
import json
import sys
import time
from collections import defaultdict
from pathlib import Path

import numpy as np
from PIL import Image

from common import cell_measure, peak_rss_mb, read_setup, square_flux


def inverse_response(capture, camera):
    """Table code -> relative exposure, (codes, 3); 1 = clipping."""
    black, white = camera.get("black_level", 0), camera["white_level"]
    if white > 255:
        sys.exit("this bench reads 8-bit PNG only: Pillow cuts 16-bit colour down to 8 bits without a word")
    codes = np.arange(256)
    x = np.clip((codes - black) / (white - black), 0, 1)
    name = camera.get("response", "linear")
    if name == "linear":
        table = np.stack([x] * 3, axis=-1)
    elif name == "srgb":
        table = np.stack([np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)] * 3, axis=-1)
    elif name == "recover":
        sys.exit("this bench does not recover response curves: name a response file in capture.toml")
    else:
        curve = np.loadtxt(capture / name, delimiter=",", skiprows=1)
        table = np.stack([np.interp(x, curve[:, 1 + c], curve[:, 0]) for c in range(3)], axis=-1)
    return table.astype(np.float32)


def merge(codes, exposures, table, camera):
    """HDR radiance of one pattern from its exposures. codes: list of (H, W, 3)."""
    black, white = camera.get("black_level", 0), camera["white_level"]
    order = np.argsort(exposures)
    total = np.zeros(codes[0].shape, np.float32)
    weight = np.zeros_like(total)
    for i in order:
        x = np.stack([table[codes[i][..., c], c] for c in range(3)], axis=-1)
        use = codes[i] < white
        if len(order) > 1:
            use &= codes[i] > black
        total += np.where(use, x, 0)                       # weight t times radiance x/t is x
        weight += np.where(use, np.float32(exposures[i]), 0)
        if i == order[0]:
            shortest = x / np.float32(exposures[i])
    return np.where(weight > 0, total / np.maximum(weight, 1e-30), shortest)   # shortest: 0, or a clipped pixel


def minimum(rows, columns, m, k):
    """Squares (v, u, H, W, 3) from combs rows[v, u % k] and columns[u, v % k]."""
    i = np.arange(m)
    row = rows[:, i % k]                                   # (v, u)
    column = columns[:, i % k].swapaxes(0, 1)              # (u, v) -> (v, u)
    return np.minimum(row, column)


def fit(squares, rows, columns, k, sweeps=30):
    """Iterative proportional fitting: every comb becomes the sum of its squares. Works in place."""
    tiny = np.float32(1e-12)
    rows, columns = np.maximum(rows, 0), np.maximum(columns, 0)
    np.maximum(squares, 0, out=squares)
    for _ in range(sweeps):
        for g in range(k):
            group = squares[:, g::k]
            group *= (rows[:, g] / np.maximum(group.sum(1), tiny))[:, None]
        for g in range(k):
            group = squares[g::k]
            group *= columns[:, g] / np.maximum(group.sum(0), tiny)
    return squares


def main():
    args = argparse.ArgumentParser(description=__doc__)
    args.add_argument("capture", type=Path, nargs="?", default=Path("../shared/data/chess-capture"))
    args.add_argument("out", type=Path)
    args.add_argument("--separation", choices=["minimum", "fitted"], default="minimum")
    args.add_argument("--positions", type=int, help="only the first N positions; the others stay zero")
    args.add_argument("--clip", action="store_true", help="squares below zero become zero (fitted always does)")
    args = args.parse_args()

    setup = read_setup(args.capture)
    camera, m, k = setup["camera"], setup["projector"]["squares"], setup["patterns"].get("spacing", 3)
    combs = setup["patterns"]["scheme"] == "combs"
    positions = setup["hemisphere"]["azimuths"] * setup["hemisphere"]["tilts"]
    wanted = min(args.positions or positions, positions)
    scale = (cell_measure(setup) / square_flux(setup)).astype(np.float32)
    table = inverse_response(args.capture, camera)
    taken = [defaultdict(list) for _ in range(positions)]
    with open(args.capture / "photographs.csv", newline="") as file:
        for row in csv.DictReader(file):
            exposure = float(row["exposure_s"])
            if row["iso"]:
                exposure *= float(row["iso"]) / 100 / float(row["f_number"]) ** 2
            taken[int(row["position"])][row["pattern"]].append((exposure, row["file"]))

    basis = np.zeros((positions, m, m, camera["height"], camera["width"], 3), np.float32)
    blacks, photographs, decoding, separating = [], 0, 0.0, 0.0
    begin = time.perf_counter()
    for p in range(wanted):
        start = time.perf_counter()
        radiance = {}
        for pattern, shots in taken[p].items():
            codes = [np.asarray(Image.open(args.capture / file)) for _, file in shots]
            radiance[pattern] = merge(codes, [e for e, _ in shots], table, camera)
            photographs += len(shots)
        middle = time.perf_counter()
        black = radiance["black"]
        b = float(black.sum(dtype=np.float64) / radiance["white"].sum(dtype=np.float64)) if "white" in radiance else 0.0
        blacks.append(b)
        if combs:
            rows = np.stack([[radiance[f"row-{v}-{g}"] for g in range(k)] for v in range(m)])
            columns = np.stack([[radiance[f"column-{u}-{g}"] for g in range(k)] for u in range(m)])
            for stack in (rows, columns):
                stack -= black
                stack /= 1 - b
            squares = minimum(rows, columns, m, k)
            if args.separation == "fitted":
                squares = fit(squares, rows, columns, k)
        else:
            squares = np.stack([[radiance[f"square-{u}-{v}"] - black for u in range(m)] for v in range(m)]) / (1 - b)
        if args.clip:
            np.maximum(squares, 0, out=squares)
        np.multiply(squares, scale[p][..., None, None, None], out=basis[p])
        decoding += middle - start
        separating += time.perf_counter() - middle
    total = time.perf_counter() - begin

    start = time.perf_counter()
    np.savez(args.out, basis=basis, azimuths=setup["hemisphere"]["azimuths"], tilts=setup["hemisphere"]["tilts"])
    megapixels = camera["width"] * camera["height"] / 1e6
    print(json.dumps({
        "bench": "numpy chain", "separation": args.separation, "clip": args.clip, "positions": wanted,
        "photographs": photographs, "megapixels_per_photograph": megapixels,
        "seconds_decode_merge": round(decoding, 3), "seconds_separation": round(separating, 3),
        "seconds_total": round(total, 3), "seconds_save": round(time.perf_counter() - start, 3),
        "photograph_megapixels_per_second_per_core": round(photographs * megapixels / total, 3),
        "threads": 1, "black_level_mean": float(np.mean(blacks)), "peak_rss_mb": peak_rss_mb(),
    }))


if __name__ == "__main__":
    main()
