"""What the NumPy benches share: picture files, capture.toml, the measure of a cell."""
import resource
import sys
import tomllib
from pathlib import Path

import numpy as np
import OpenEXR


def read_exr(path):
    """RGB float32 picture (H, W, 3)."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        return np.stack([channels[c].pixels.astype(np.float32) for c in "RGB"], axis=-1)


def write_exr(path, picture):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    pixels = np.ascontiguousarray(picture, dtype=np.float32)
    OpenEXR.File(header, {"RGB": pixels}).write(str(path))


def read_setup(capture):
    with open(Path(capture) / "capture.toml", "rb") as file:
        setup = tomllib.load(file)
    if "positions_deg" in setup["hemisphere"]:
        sys.exit("this bench knows regular grids only (azimuths, tilts), not positions_deg")
    return setup


def cell_measure(setup):
    """|Omega_i| for every cell: (positions, v, u), docs/MATH.md `Measure, transfer, coefficients`."""
    hemi, m, h = setup["hemisphere"], setup["projector"]["squares"], setup["projector"]["half_width"]
    t = np.linspace(0, np.pi / 2, hemi["tilts"] + 1)
    ring = hemi["radius_m"] ** 2 * 2 * np.pi / hemi["azimuths"] * (np.cos(t[:-1]) - np.cos(t[1:]))
    area = np.repeat(ring, hemi["azimuths"])                         # position = tilt * azimuths + azimuth
    n = 32                                                           # midpoint rule inside each square
    s = ((np.arange(m * n) + 0.5) / (m * n) * 2 - 1) * h
    cos4 = (1 + s[:, None] ** 2 + s**2) ** -2.0
    square = cos4.reshape(m, n, m, n).sum((1, 3)) * (2 * h / (m * n)) ** 2
    return area[:, None, None] * square


def square_flux(setup):
    """Phi_square for unit projected white: (v, u)."""
    p = setup["projector"]
    m = p["squares"]
    relative = np.array(p.get("square_flux", np.ones((m, m))))
    return p.get("intensity_w_sr", 1.0) * (2 * p["half_width"] / m) ** 2 * relative


def mosaic_to_cells(mosaic, setup):
    """Mosaic picture -> coefficients (positions, v, u, 3)."""
    hemi, m = setup["hemisphere"], setup["projector"]["squares"]
    squares = mosaic.reshape(hemi["tilts"], m, hemi["azimuths"], m, 3)
    return squares.transpose(0, 2, 1, 3, 4).reshape(-1, m, m, 3)


def peak_rss_mb():
    return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
