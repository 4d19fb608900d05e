#!/usr/bin/env python3
"""Relighting as a product of NumPy's, all R in memory: product.py FOLDER, as `paper_scale dense` has written it. Prints JSON.

One product a channel: cells times (cells, pixels). Where few cells are lit, also with these alone, taken out of the whole.
"""
import json, pathlib, sys, time

import numpy

folder = pathlib.Path(sys.argv[1])
weights, pictures = numpy.load(folder / "lights.npy"), numpy.load(folder / "pictures.npy")
basis = numpy.load(folder / "basis.npy")


def timed(job):
    started = time.perf_counter()
    done = numpy.stack([job(channel) for channel in range(3)])
    return 1e3 * (time.perf_counter() - started), done


rows = []
for light, expected in zip(weights, pictures):
    lit = numpy.flatnonzero(light.any(0))
    row = {"lit_cells": len(lit), "all_ms": [], "lit_ms": []}
    for _ in range(4):
        milliseconds, relit = timed(lambda channel: numpy.tensordot(light[channel], basis[channel], 1))
        row["all_ms"].append(milliseconds)
        if len(lit) <= light.shape[1] // 8:
            row["lit_ms"].append(timed(lambda channel: numpy.tensordot(light[channel, lit], basis[channel][lit], 1))[0])
    shown = float(numpy.linalg.norm(expected))
    row["kernel_is_off_by"] = float(numpy.linalg.norm(relit - expected)) / shown if shown else None
    rows.append(row)
print(json.dumps(rows))
