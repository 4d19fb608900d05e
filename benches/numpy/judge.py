"""Error figures: judge.py pictures A.exr TRUTH.exr [--mask MASK.png]
               judge.py coefficients A.exr EXPECTED.exr --capture CAPTURE"""
import argparse
import json

import numpy as np
from PIL import Image

from common import cell_measure, mosaic_to_cells, read_exr, read_setup


def read_mask(path):
    mask = np.asarray(Image.open(path))
    return (mask if mask.ndim == 2 else mask[..., :3].max(-1)) > 0


def relative_l2(a, b, weight=1.0):
    a, b = np.float64(a), np.float64(b)
    return float(np.sqrt((weight * (a - b) ** 2).sum() / (weight * b**2).sum()))


def ratio_of_means(a, b):
    return float(np.float64(a).mean() / np.float64(b).mean())


def pictures(a, b, mask=None):
    """a relit, b truth."""
    if mask is not None:
        a, b = a[mask], b[mask]
    return {"ratio": ratio_of_means(a, b), "relative_l2": relative_l2(a, b)}


def coefficients(a, expected, setup):
    """Mosaics; flux is the sum of l |Omega| over the cells."""
    a, e = (np.float64(mosaic_to_cells(x, setup)) for x in (a, expected))
    omega = cell_measure(setup)[..., None]
    flux_a, flux_e = ((x * omega).sum((0, 1, 2)) for x in (a, e))
    return {
        "flux_ratio_rgb": (flux_a / flux_e).tolist(), "flux_ratio": float(flux_a.sum() / flux_e.sum()),
        "relative_l2_omega": relative_l2(a, e, omega), "relative_l2": relative_l2(a, e),
    }


def main():
    args = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    args.add_argument("what", choices=["pictures", "coefficients"])
    args.add_argument("a")
    args.add_argument("b")
    args.add_argument("--mask", help="compare only where this PNG is not zero")
    args.add_argument("--capture", default="../shared/data/chess-capture")
    args = args.parse_args()
    a, b = read_exr(args.a), read_exr(args.b)
    if a.shape != b.shape:
        raise SystemExit(f"{args.a} is {a.shape}, {args.b} is {b.shape}: they must be of one size")
    if args.what == "pictures":
        print(json.dumps(pictures(a, b, read_mask(args.mask) if args.mask else None)))
    else:
        print(json.dumps(coefficients(a, b, read_setup(args.capture))))


if __name__ == "__main__":
    main()
