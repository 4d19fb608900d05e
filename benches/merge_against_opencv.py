#!/usr/bin/env python3
"""Merges a synthetic bracket of known radiance with Relumine and with OpenCV, in one run, and writes a dated run file.

    python benches/merge_against_opencv.py [--width 3000] [--height 2000] [--seconds 5] [--rounds 3]

Needs numpy, opencv-python-headless and OpenEXR in the Python that runs it, and a release build:
    cargo build --release -p relumine --example time_merge -p relumine-cli
Five photographs of 8 bits three stops apart, with photon noise (20,000 electrons full well), read noise (6 electrons) and a
film's response. Both get the true response for the merging; then each recovers it from the photographs. Throughput is
megapixels times exposures per CPU-second on one thread, reading files not counted; rounds alternate between the two. Compare
figures of one file only.
"""
import argparse, datetime, json, os, pathlib, platform, subprocess, tempfile, time

import cv2
import numpy as np
import OpenEXR

root = pathlib.Path(__file__).resolve().parent.parent
parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--width", type=int, default=3000)
parser.add_argument("--height", type=int, default=2000)
parser.add_argument("--seconds", type=float, default=5.0, help="of every timing")
parser.add_argument("--rounds", type=int, default=3)
arguments = parser.parse_args()
binary, timer = root / "target/release/relumine", root / "target/release/examples/time_merge"
FULL_WELL, READ_NOISE = 20_000.0, 6.0
TIMES = [1 / 32, 1 / 4, 2.0, 16.0, 128.0]
cv2.setNumThreads(1)


def scene(width, height, random):
    """Four decades of radiance, a lamp and a black corner: the scene of crates/radiometry/src/merge/tests.rs."""
    u, v = np.meshgrid(np.arange(width) / width, np.arange(height) / height)
    lamp = np.where(np.hypot(u - 0.7, v - 0.3) < 0.08, 300.0, 0.0)
    base = np.where((u < 0.1) & (v < 0.1), 0.0, 10 ** (-3 + 3.5 * u))
    radiance = base[..., None] * np.array([1.0, 0.8, 0.5]) * (0.7 + 0.6 * v)[..., None] + lamp[..., None]
    return (radiance * random.uniform(0.9, 1.1, radiance.shape)).astype(np.float32)


exposure_rows = np.linspace(0, 1, 1025)
fraction_rows = exposure_rows**0.45 * (1.25 - 0.25 * exposure_rows)


def photograph(radiance, seconds, random):
    exposure = radiance * np.float32(seconds)
    noise = random.standard_normal(exposure.shape, dtype=np.float32)
    exposure = exposure + noise * np.sqrt(exposure / FULL_WELL + (READ_NOISE / FULL_WELL) ** 2)
    fraction = np.interp(np.clip(exposure, 0, 1), exposure_rows, fraction_rows)
    return np.clip(np.round(255 * fraction), 0, 255).astype(np.uint8)


def errors(found, truth, seen):
    """Median and 95th percentile of the relative error of what is seen, after one scale for all."""
    found, truth = found[seen].astype(np.float64), truth[seen].astype(np.float64)
    scale = np.median(truth / np.maximum(found, 1e-30))
    wrong = np.abs(found * scale / truth - 1)
    return {"median_error": round(float(np.median(wrong)), 5), "p95_error": round(float(np.percentile(wrong, 95)), 5),
            "scale": round(float(scale), 5)}


def read_exr(path):
    return np.array(OpenEXR.File(str(path)).channels()["RGB"].pixels)


def cpu_rate(work, megapixels):
    work()
    started, cpu, rounds = time.perf_counter(), time.process_time(), 0
    while time.perf_counter() - started < arguments.seconds:
        work()
        rounds += 1
    return round(megapixels * rounds / (time.process_time() - cpu), 1)


random = np.random.default_rng(2003)
truth = scene(arguments.width, arguments.height, random)
accuracy, throughput = [], []
with tempfile.TemporaryDirectory() as work:
    work = pathlib.Path(work)
    shots = [photograph(truth, seconds, random) for seconds in TIMES]
    for index, shot in enumerate(shots):
        cv2.imwrite(str(work / f"{index}.png"), shot[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 1])
    (work / "list.txt").write_text("".join(f"{index}.png {seconds!r}\n" for index, seconds in enumerate(TIMES)))
    rows = (f"{x!r},{f!r},{f!r},{f!r}\n" for x, f in zip(map(float, exposure_rows), map(float, fraction_rows)))
    (work / "film.csv").write_text("relative_exposure,red,green,blue\n" + "".join(rows))
    # f⁻¹ at every code, as OpenCV wants it.
    inverse = np.interp(np.arange(256) / 255, fraction_rows, exposure_rows)
    inverse[0] = inverse[1] / 2
    response = np.repeat(inverse[:, None, None], 3, axis=2).astype(np.float32)
    times = np.array(TIMES, dtype=np.float32)
    debevec = cv2.createMergeDebevec()

    for name, words in (("the true response", ["film.csv"]), ("its own recovery", ["recover"])):
        out, mask = work / "ours.exr", work / "mask.png"
        subprocess.run([binary, "-q", "merge", "--list", work / "list.txt", "--response", *words, "--full-well", str(FULL_WELL),
                        "--read-noise", str(READ_NOISE), "-o", out, "--mask", mask, "--force"], check=True, cwd=work)
        seen = (cv2.imread(str(mask))[..., 0] == 255) & (truth.min(axis=2) > 0)
        accuracy.append({"who": f"relumine, {name}", **errors(read_exr(out), truth, seen), "seen": round(float(seen.mean()), 4)})
        if name == "the true response":
            theirs = debevec.process(shots, times, response)
        else:
            # OpenCV reads BGR for its recovery; the channels are alike here.
            theirs = debevec.process(shots, times, cv2.createCalibrateDebevec(samples=200).process(shots, times))
        accuracy.append({"who": f"OpenCV, {name}", **errors(theirs, truth, seen), "seen": round(float(seen.mean()), 4)})

    megapixels = arguments.width * arguments.height * len(TIMES) / 1e6
    for number in range(arguments.rounds):
        printed = subprocess.run([timer, work / "list.txt", work / "film.csv", str(arguments.seconds)], check=True,
                                 stdout=subprocess.PIPE, text=True).stdout
        figures = json.loads(printed)
        theirs = cpu_rate(lambda: debevec.process(shots, times, response), megapixels)
        throughput.append({"round": number, **figures, "opencv_mpixel_exposures_per_cpu_s": theirs,
                           "ratio": round(figures["fast_mpixel_exposures_per_cpu_s"] / theirs, 3)})

commit = subprocess.run(["git", "-C", root, "describe", "--always", "--dirty"], capture_output=True, text=True).stdout.strip()
cpu = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), platform.processor())
words = [f"--{name} {value:g}" for name, value in vars(arguments).items()]
report = {"date": datetime.datetime.now().isoformat(timespec="seconds"), "machine": f"{cpu}, {os.cpu_count()} cores",
          "load_average": os.getloadavg(), "commit": commit, "opencv": cv2.__version__,
          "command": " ".join(["benches/merge_against_opencv.py", *words]), "accuracy": accuracy, "throughput": throughput}
folder = root / "benches/runs"
folder.mkdir(exist_ok=True)
path = folder / f"{datetime.date.today()}-{commit}-merge.json"
path.write_text(json.dumps(report, indent=1) + "\n")
for row in accuracy:
    print(f"{row['who']:<34} median {100 * row['median_error']:6.2f} %   95th percentile {100 * row['p95_error']:6.2f} %")
for row in throughput:
    print(f"Mpixel·exposures per CPU-second: ours {row['fast_mpixel_exposures_per_cpu_s']:.0f} "
          f"(plain {row['plain_mpixel_exposures_per_cpu_s']:.0f}), OpenCV {row['opencv_mpixel_exposures_per_cpu_s']:.0f}, "
          f"ratio {row['ratio']:.2f}")
print(path.relative_to(root))
