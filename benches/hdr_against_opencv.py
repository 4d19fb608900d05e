#!/usr/bin/env python3
"""Recovers responses and merges two real brackets with Relumine and with OpenCV, in one run, and writes a dated run file.

    python benches/hdr_against_opencv.py [--data ../shared/data]

Needs numpy and opencv-python-headless in the Python that runs it, and a release build: cargo build --release -p relumine-cli

hdr_memorial: 16 scanned photographs by P. Debevec and his own radiance map of them. Their blue alignment borders are cropped.
Figure: root mean square of log₂(found / reference) over all pixels that the reference and both programs give a positive value,
after one global scale. Colour balance is a convention: Debevec (and OpenCV) call a pixel of code 128 in every channel grey,
Relumine one that just clips. So ours is brought to their convention by its own curve (each channel divided by its exposure at
code 128) for the figure with one scale; the figure with one scale a channel needs no convention.

hdr_frobisher: three JPEGs by colour-science, and their curves of the same method (natural log exposure, 0 at code 128, without
the outermost codes, which carry no weight). Figure: root mean square and largest difference of ln exposure, codes 13 to 242 (5 % to
95 %), after one shift a channel. Radiance has no reference there.
"""
import argparse, datetime, json, os, pathlib, platform, subprocess, tempfile

import cv2
import numpy as np

root = pathlib.Path(__file__).resolve().parent.parent
parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--data", type=pathlib.Path, default=root / "../shared/data")
parser.add_argument("--binary", type=pathlib.Path, default=root / "target/release/relumine")
arguments = parser.parse_args()
# Rows and columns of the memorial photographs that no blue border touches, with a margin.
INSIDE = (slice(34, 734), slice(8, 504))
CODES = np.arange(13, 243)


def relumine(*words):
    subprocess.run([arguments.binary, "-q", *map(str, words)], check=True, stdout=subprocess.DEVNULL)


def read_rgb(path):
    picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert picture is not None, path
    return picture[..., 2::-1].astype(np.float64)


def exposures_of(csv):
    """Exposure of each of 256 codes, a column a channel, from a response file."""
    rows = np.loadtxt(csv, delimiter=",", skiprows=1)
    codes = np.arange(256) / 255
    columns = []
    for channel in range(3):
        fractions, first = np.unique(rows[:, 1 + channel], return_index=True)
        columns.append(np.interp(codes, fractions, rows[first, 0]))
    return np.stack(columns, axis=1)


def opencv(photographs, times):
    """Radiance (RGB) and curve (256 × 3) by each of OpenCV's methods; it wants BGR, bytes and seconds."""
    times = np.array(times, dtype=np.float32)
    pairs = {"Debevec": (cv2.createCalibrateDebevec(), cv2.createMergeDebevec()),
             "Robertson": (cv2.createCalibrateRobertson(), cv2.createMergeRobertson())}
    for name, (calibrate, merge) in pairs.items():
        curve = calibrate.process(photographs, times)
        yield name, merge.process(photographs, times, curve)[..., ::-1].astype(np.float64), curve[:, 0, ::-1]


def differences(found, reference, valid):
    logs = np.log2(found[valid] / reference[valid])
    middled = logs - np.median(logs)
    one = logs - logs.mean()
    each = logs - logs.mean(axis=0)
    rms = lambda values: round(float(np.sqrt(np.mean(values**2))), 4)
    return {"rms_log2": rms(one), "rms_log2_one_scale_a_channel": rms(each),
            "median_abs_log2": round(float(np.median(np.abs(middled))), 4)}


def curve_differences(found, reference):
    """Of ln exposure, after one shift a channel; codes without exposure count as the lowest there is."""
    difference = np.log(np.maximum(found, 1e-6))[CODES] - reference[CODES]
    difference -= difference.mean(axis=0)
    return {"rms_ln": round(float(np.sqrt(np.mean(difference**2))), 4), "largest_ln": round(float(np.abs(difference).max()), 4)}


def memorial(work):
    folder = arguments.data / "hdr_memorial"
    lines = [line.split() for line in (folder / "memorial.hdr_image_list.txt").read_text().splitlines()]
    listed = [(words[0], float(words[1])) for words in lines if len(words) > 2 and words[0].endswith(".png")]
    photographs = []
    for name, _ in listed:
        photographs.append(np.ascontiguousarray(cv2.imread(str(folder / name))[INSIDE]))
        cv2.imwrite(str(work / name), photographs[-1])
    (work / "list.txt").write_text("".join(f"{name} {reciprocal!r}\n" for name, reciprocal in listed))
    reference = read_rgb(folder / "memorial_debevec_reference.hdr")[INSIDE]
    curve, out = work / "memorial.csv", work / "memorial.hdr"
    relumine("calibrate", "response", "--list", work / "list.txt", "--reciprocal", "-o", curve)
    relumine("merge", "--list", work / "list.txt", "--reciprocal", "--response", curve, "-o", out)
    ours = read_rgb(out) / exposures_of(curve)[128]
    theirs = {name: radiance for name, radiance, _ in opencv(photographs, [1 / reciprocal for _, reciprocal in listed])}
    pictures = {"relumine": ours, **{f"OpenCV {name}": radiance for name, radiance in theirs.items()}}
    valid = np.all([(picture > 0).all(axis=2) & np.isfinite(picture).all(axis=2) for picture in [reference, *pictures.values()]], axis=0)
    return [{"set": "hdr_memorial", "who": who, "pixels": int(valid.sum()), **differences(picture, reference, valid)}
            for who, picture in pictures.items()]


def frobisher(work):
    folder = arguments.data / "hdr_frobisher"
    files = sorted(folder.glob("*.jpg"))
    times = [1 / 8, 1.0, 8.0]
    reference = np.stack([np.load(folder / f"test_g_solve_g_{channel}.npy") for channel in range(3)], axis=1)
    curve = work / "frobisher.csv"
    relumine("calibrate", "response", *files, "-o", curve)
    photographs = [cv2.imread(str(file)) for file in files]
    middles = [photograph.mean() for photograph in photographs]
    photographs = [photographs[index] for index in np.argsort(middles)]
    rows = [{"set": "hdr_frobisher", "who": "relumine", **curve_differences(exposures_of(curve), reference)}]
    for name, _, theirs in opencv(photographs, times):
        rows.append({"set": "hdr_frobisher", "who": f"OpenCV {name}", **curve_differences(theirs, reference)})
    return rows


with tempfile.TemporaryDirectory() as work:
    results = memorial(pathlib.Path(work)) + frobisher(pathlib.Path(work))

commit = subprocess.run(["git", "-C", root, "describe", "--always", "--dirty"], capture_output=True, text=True).stdout.strip()
cpu = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), platform.processor())
report = {"date": datetime.datetime.now().isoformat(timespec="seconds"), "machine": f"{cpu}, {os.cpu_count()} cores",
          "commit": commit, "opencv": cv2.__version__, "command": "benches/hdr_against_opencv.py", "results": results}
folder = root / "benches/runs"
folder.mkdir(exist_ok=True)
path = folder / f"{datetime.date.today()}-{commit}-hdr.json"
path.write_text(json.dumps(report, indent=1) + "\n")
for row in results:
    print(", ".join(f"{key} {value}" for key, value in row.items()))
print(path.relative_to(root))
