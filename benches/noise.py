#!/usr/bin/env python3
"""What the noise of photographs leaves in relit pictures, by separation, and whether the standard error says so.

    benches/noise.py [--work DIR] [--runs 8x3x8,8x3x16] [--size 72x48] [--samples 256] [--no-documents]

The board of examples/chess on the virtual rig, camera of 20,000 electrons full well and 6 electrons of reading, one exposure,
photographed with each square alone and with combs, and both once more without any noise. The combs are developed with every
separation. All fields are relit under five lights, and every picture is held against the one without noise: of the same
separation (noise alone) and of single squares (noise and crosstalk). For single squares and the fit the error is also held
against `relight --error`. Writes a dated run file in benches/runs/, the tables of docs/noise.md between their markers, and
the figure docs/noise.png.

Needs a build of relumine, numpy, OpenEXR (from PyPI), and pillow for the figure.
"""
import argparse, datetime, hashlib, json, os, pathlib, platform, re, shutil, subprocess, sys, tempfile, time

import numpy, OpenEXR

import rigs

root = pathlib.Path(__file__).resolve().parent.parent
parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--relumine", type=pathlib.Path, default=root / "target/release/relumine")
parser.add_argument("--work", type=pathlib.Path, help="where captures, fields and pictures lie; default: temporary, removed")
parser.add_argument("--runs", default="8x3x8,8x3x16", help="azimuths x tilts x squares a side")
parser.add_argument("--size", default="72x48")
parser.add_argument("--samples", type=int, default=256, help="paths a pixel of the photographs")
parser.add_argument("--threads", type=int, default=2)
parser.add_argument("--commit", help="what the binary was built from, if not from the tree as it is")
parser.add_argument("--no-documents", action="store_true", help="print only; docs/ and benches/runs/ stay as they are")
arguments = parser.parse_args()
work = (arguments.work or pathlib.Path(tempfile.mkdtemp(prefix="relumine-noise-"))).resolve()

LIGHTS = {"uniform": "uniform sky", "lamp": "near lamp (smooth)", "sun": "sun", "spots": "two spots", "shafts": "three shafts"}
METHODS = {"squares": ("squares", None), "minimum, unfiltered": ("combs", "minimum"),
           "minimum, constant threshold": ("combs", "thresholded"), "minimum, bias subtracted": ("combs", "unbiased"),
           "fitted (default)": ("combs", "fitted")}
WITH_ERROR = ("squares", "fitted (default)")


def relumine(*words):
    started = time.perf_counter()
    done = subprocess.run([str(arguments.relumine), "--threads", str(arguments.threads), *map(str, words)],
                          capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"relumine {' '.join(map(str, words))}\nended with {done.returncode}: {done.stderr}")
    return done.stdout, done.stderr, time.perf_counter() - started


def picture(path):
    return numpy.asarray(OpenEXR.File(str(path)).channels()["RGB"].pixels, dtype=float)


def rig(run, scheme, noise):
    grid, squares = run.rsplit("x", 1)
    electrons = ("20_000", 6) if noise else rigs.NOISELESS
    scene = root / "examples/chess/scene.toml"
    return rigs.board(scene, arguments.size, grid, squares, scheme, arguments.samples, 4, 0.5, electrons)


def fields(run):
    """Relit pictures by (method, noise, light), standard errors, what develop said."""
    place = work / run
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    for noise in (True, False):
        for scheme in ("squares", "combs"):
            description = place / f"{scheme}-{noise}.toml"
            description.write_text(rig(run, scheme, noise))
            relumine("plan", description, place / f"{scheme}-{noise}")
            relumine("capture", place / f"{scheme}-{noise}")
    relit, errors, said, seconds = {}, {}, {}, {}
    for method, (scheme, separation) in METHODS.items():
        for noise in (True, False):
            field = place / "field"
            options = ["--separation", separation] if separation else []
            _, words, seconds[method, noise] = relumine("develop", place / f"{scheme}-{noise}", "-o", field, "--force", *options)
            said[method, noise] = words.strip().splitlines()
            lights = []
            with_error = noise and method in WITH_ERROR
            for light in LIGHTS:
                lights += ["--light", root / f"benches/end_to_end/{light}.toml", "-o", place / f"{light}.exr"]
                lights += ["--error", place / f"{light}-error.exr"] if with_error else []
            relumine("relight", field, *lights, "--force")
            for light in LIGHTS:
                relit[method, noise, light] = picture(place / f"{light}.exr")
                if with_error:
                    errors[method, light] = picture(place / f"{light}-error.exr")
    if not arguments.work:
        shutil.rmtree(place)
    return relit, errors, said, seconds


def figures(run, relit, errors):
    rows = []
    for light in LIGHTS:
        true = relit["squares", False, light]
        seen = true.max(-1) > 0
        norm = numpy.sqrt((true[seen] ** 2).sum())
        for method in METHODS:
            noisy, still = relit[method, True, light], relit[method, False, light]
            row = {"run": run, "light": light, "method": method,
                   "noise_l2": round(float(numpy.sqrt(((noisy - still)[seen] ** 2).sum()) / norm), 5),
                   "noise_ratio_of_means": round(float(noisy[seen].sum() / still[seen].sum()), 5),
                   "all_l2": round(float(numpy.sqrt(((noisy - true)[seen] ** 2).sum()) / norm), 5)}
            if (method, light) in errors:
                z = (noisy - still)[seen] / numpy.maximum(errors[method, light][seen], 1e-30)
                row["within_2_sigma"] = round(float((abs(z) < 2).mean()), 4)
                row["within_1_sigma"] = round(float((abs(z) < 1).mean()), 4)
            rows.append(row)
    return rows


def said_run(run):
    azimuths, tilts, squares = run.split("x")
    return f"{azimuths} × {tilts} × {squares}²"


def tables(rows, runs):
    def row_of(run, light, method):
        return next(r for r in rows if (r["run"], r["light"], r["method"]) == (run, light, method))
    lines = ["Noise alone, relative L2 (ratio of means):", "", "| light | squares | " + " | ".join(
        method for method in METHODS if method != "squares") + " |", "|---|---|" + "---|" * (len(METHODS) - 1)]
    for run in runs:
        for light, name in LIGHTS.items():
            cells = [row_of(run, light, method) for method in METHODS]
            lines.append(f"| {said_run(run)}, {name} | " + " | ".join(
                f"{cell['noise_l2']:.4f} ({cell['noise_ratio_of_means']:.3f})" for cell in cells) + " |")
    lines += ["", "Noise and crosstalk of combs, against single squares without noise, relative L2:", ""] + lines[2:4]
    for run in runs:
        for light, name in LIGHTS.items():
            lines.append(f"| {said_run(run)}, {name} | " + " | ".join(
                f"{row_of(run, light, method)['all_l2']:.4f}" for method in METHODS) + " |")
    lines += ["", "Pixels whose error is within two (one) of the reported standard error, %:", "",
              "| light | " + " | ".join(WITH_ERROR) + " |", "|---|" + "---|" * len(WITH_ERROR)]
    for run in runs:
        for light, name in LIGHTS.items():
            cells = [row_of(run, light, method) for method in WITH_ERROR]
            lines.append(f"| {said_run(run)}, {name} | " + " | ".join(
                f"{100 * cell['within_2_sigma']:.1f} ({100 * cell['within_1_sigma']:.1f})" for cell in cells) + " |")
    return "\n".join(lines)


def figure(relit, errors):
    from PIL import Image, ImageDraw, ImageFont
    font = ImageFont.load_default(12)
    shown = [method for method in METHODS if method != "minimum, bias subtracted"]
    height, width = relit["squares", False, "uniform"].shape[:2]
    w, h, gap, line = 3 * width, 3 * height, 6, 17
    sheet = Image.new("RGB", (gap + (len(shown) + 1) * (w + gap), 2 * (h + line) + 2 * gap), "white")
    draw = ImageDraw.Draw(sheet)
    for row, light in enumerate(("uniform", "spots")):
        y = gap + row * (h + line)
        true = relit["squares", False, light]
        largest = 0.1 * numpy.sqrt((true ** 2).mean())
        for column, method in enumerate([*shown, None]):
            x = gap + column * (w + gap)
            if method is None:
                size = numpy.clip(errors["fitted (default)", light].mean(-1) / largest, 0, 1)
                colour, caption = numpy.stack([1 - size] * 3, -1), "standard error of fitted"
            else:
                off = numpy.clip((relit[method, True, light] - relit[method, False, light]).mean(-1) / largest, -1, 1)
                colour = numpy.stack([1 - numpy.maximum(-off, 0), 1 - abs(off), 1 - numpy.maximum(off, 0)], -1)
                caption = f"{LIGHTS[light]}: {method.replace('minimum, constant ', '')}"
            tile = Image.fromarray((colour * 255 + 0.5).astype(numpy.uint8)).resize((w, h), Image.Resampling.NEAREST)
            sheet.paste(tile, (x, y))
            draw.text((x, y + h + 1), caption, "black", font)
    sheet.save(root / "docs/noise.png", optimize=True)


runs = arguments.runs.split(",")
rows, said, seconds, last = [], {}, {}, None
for run in runs:
    relit, errors, words, took = fields(run)
    rows += figures(run, relit, errors)
    said[run] = {f"{method}, {'noise' if noise else 'no noise'}": text for (method, noise), text in words.items()}
    seconds[run] = {f"{method}, {'noise' if noise else 'no noise'}": round(s, 2) for (method, noise), s in took.items()}
    last = (relit, errors)
text = tables(rows, runs)
print(text)
worst = [r for r in rows if r["method"] == "fitted (default)" and any(
    o["noise_l2"] < r["noise_l2"] for o in rows
    if (o["run"], o["light"]) == (r["run"], r["light"]) and o["method"] not in ("squares", r["method"]))]
print("the fit is the best of the comb methods on every light" if not worst else f"NOT the best: {worst}")
if not arguments.no_documents:
    described = subprocess.run(["git", "-C", root, "describe", "--always", "--dirty"], capture_output=True, text=True)
    commit = arguments.commit or described.stdout.strip()
    models = (line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name"))
    report = {"date": datetime.datetime.now().isoformat(timespec="seconds"),
              "machine": f"{next(models, platform.processor())}, {os.cpu_count()} cores", "load_average": os.getloadavg(),
              "commit": commit, "binary_sha256": hashlib.sha256(arguments.relumine.read_bytes()).hexdigest()[:16],
              "command": "benches/noise.py", "options": {"runs": runs, "size": arguments.size, "samples": arguments.samples},
              "figures": rows, "develop_s": seconds,
              "develop_said": {run: {name: [re.sub(r"\S*/\S+", "…", line) for line in lines] for name, lines in all_.items()}
                               for run, all_ in said.items()}}
    path = root / f"benches/runs/{datetime.date.today()}-{commit}-noise.json"
    path.write_text(json.dumps(report, indent=1) + "\n")
    print(path.relative_to(root))
    document = root / "docs/noise.md"
    begin, end = "<!-- tables: written by benches/noise.py -->", "<!-- end of tables -->"
    before, found, rest = document.read_text().partition(begin)
    if found:
        document.write_text(f"{before}{begin}\n\n{text}\n\n{end}{rest.partition(end)[2]}")
    figure(*last)
if not arguments.work:
    shutil.rmtree(work, ignore_errors=True)
