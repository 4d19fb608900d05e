#!/usr/bin/env python3
"""Leaves lamps 4, 12, 20, … of an RTI set out, relights the rest with a sun from each, and compares with the photographs.

    benches/rti_leave_out.py DATA/rti_lion240/dirs.lp [--relumine PATH]

Prints the mean relative L2 on raw values for box and linear reconstruction, with one global scale for all pictures
(fitted over all left-out photographs together), and without. Standard library only.
"""
import argparse, json, math, os, pathlib, subprocess, tempfile

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("lp", type=pathlib.Path)
parser.add_argument("--relumine", default=pathlib.Path(__file__).parent.parent / "target/release/relumine")
parser.add_argument("--first", type=int, default=4)
parser.add_argument("--every", type=int, default=8)
arguments = parser.parse_args()

lines = [line.rsplit(maxsplit=3) for line in arguments.lp.read_text().splitlines()[1:] if line.strip()]
photograph = lambda name: (arguments.lp.parent / name).resolve()
left_out = [i for i in range(len(lines)) if i % arguments.every == arguments.first]

def relumine(*words):
    return subprocess.run([str(arguments.relumine), "--quiet", *map(str, words)], check=True, capture_output=True, text=True).stdout

with tempfile.TemporaryDirectory() as work:
    work = pathlib.Path(work)
    kept = [line for i, line in enumerate(lines) if i not in left_out]
    for i, (name, *_) in enumerate(kept):
        os.symlink(photograph(name), work / f"{i:04d}{pathlib.Path(name).suffix}")
    rows = [f"{i:04d}{pathlib.Path(line[0]).suffix} {' '.join(line[1:])}" for i, line in enumerate(kept)]
    (work / "kept.lp").write_text(f"{len(rows)}\n" + "\n".join(rows) + "\n")
    relumine("import", work / "kept.lp", "-o", work / "field", "--response", "linear")
    for between in ("box", "linear"):
        words = ["relight", work / "field", "--between", between, "--force"]
        for i in left_out:
            x, y, z = map(float, lines[i][1:])
            length = math.hypot(x, y, z)
            (work / f"{i}.toml").write_text(
                'format = "relumine-light/1"\n[[sun]]\n'
                f"direction = [{-x / length}, {-y / length}, {-z / length}]\nirradiance_w_m2 = [1, 1, 1]\n")
            words += ["--light", work / f"{i}.toml", "-o", work / f"{i}.exr"]
        relumine(*words)
        figures, fitted = [], []
        for i in left_out:
            pair = (work / f"{i}.exr", photograph(lines[i][0]), "--raw", "--json")
            figures.append(json.loads(relumine("compare", *pair)))
            fitted.append(json.loads(relumine("compare", *pair, "--fit-scale")))
        # ‖sA − B‖² of one scale for all, from the figures of each picture with its own best scale.
        def error(scale):
            total = 0.0
            for own in fitted:
                aa = (1 - own["relative_l2"] ** 2) / own["scale"] ** 2  # ‖A‖²/‖B‖² at the best scale
                total += math.sqrt(max(0.0, own["relative_l2"] ** 2 + (scale - own["scale"]) ** 2 * aa))
            return total / len(fitted)
        scale = min((0.8 + 0.0005 * k for k in range(801)), key=error)
        plain = sum(figure["relative_l2"] for figure in figures) / len(figures)
        print(json.dumps({"set": arguments.lp.parent.name, "between": between, "left_out": len(left_out),
                          "mean_relative_l2": round(plain, 4), "with_one_global_scale": round(error(scale), 4),
                          "scale": round(scale, 4)}))
