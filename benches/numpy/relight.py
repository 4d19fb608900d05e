"""Reflectance field and coefficients -> picture: relight.py BASIS.npz MOSAIC.exr OUT.exr"""
import argparse
import json
import time

import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits

from common import mosaic_to_cells, peak_rss_mb, read_exr, write_exr


def load(path):
    """Three planes (3, cells, pixels), so that each channel is one matrix product; and the shape."""
    with np.load(path) as file:
        basis, azimuths, tilts = file["basis"], int(file["azimuths"]), int(file["tilts"])
    positions, m, _, height, width, _ = basis.shape
    planes = np.empty((3, positions * m * m, height * width), np.float32)
    for c in range(3):
        planes[c] = basis[..., c].reshape(positions * m * m, -1)
    setup = {"hemisphere": {"azimuths": azimuths, "tilts": tilts}, "projector": {"squares": m}}
    return planes, (height, width), setup


def relight(planes, cells, shape):
    """cells: (3, cells) float32."""
    return np.stack([cells[c] @ planes[c] for c in range(3)], axis=-1).reshape(*shape, 3)


def main():
    args = argparse.ArgumentParser(description=__doc__)
    args.add_argument("basis")
    args.add_argument("mosaic")
    args.add_argument("out")
    args.add_argument("--repeat", type=int, default=5)
    args.add_argument("--threads", type=int, help="BLAS threads; default: all")
    args = args.parse_args()

    start = time.perf_counter()
    planes, shape, setup = load(args.basis)
    loaded = time.perf_counter() - start
    coefficients = mosaic_to_cells(read_exr(args.mosaic), setup).reshape(-1, 3)
    coefficients = np.ascontiguousarray(coefficients.T, dtype=np.float32)
    seconds = []
    with threadpool_limits(args.threads, user_api="blas"):
        threads = max(p["num_threads"] for p in threadpool_info() if p["user_api"] == "blas")
        for _ in range(args.repeat):
            start = time.perf_counter()
            picture = relight(planes, coefficients, shape)
            seconds.append(time.perf_counter() - start)
    write_exr(args.out, picture)
    print(json.dumps({
        "bench": "numpy relight", "cells": planes.shape[1], "pixels": planes.shape[2],
        "seconds_load": round(loaded, 3), "seconds_best": round(min(seconds), 5),
        "seconds_median": round(float(np.median(seconds)), 5),
        "gigabytes_per_second": round(planes.nbytes / min(seconds) / 1e9, 2),
        "threads": threads, "peak_rss_mb": peak_rss_mb(),
    }))


if __name__ == "__main__":
    main()
