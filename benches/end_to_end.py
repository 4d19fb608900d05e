#!/usr/bin/env python3
"""The whole chain on the virtual rig: capture, develop, relight, and the pictures held against `relumine render`.

    benches/end_to_end.py [--work DIR] [--keep] [--grids 8x3,16x4,32x7] [--no-bowl]

Photographs examples/chess with a noisy virtual camera on three grids of projector positions, with each square alone and
with combs, develops the combs twice, relights every field under the lights of benches/end_to_end/, and compares. Then the
same for a white concave bowl, the failure case of combs. Writes a dated run file in benches/runs/, the tables of
docs/end-to-end.md between their markers, and the figure docs/bowl.jpg.

Needs a release build, numpy, and pillow for the figure. Work (captures, fields, pictures; up to 2 GB) lies in a temporary
directory, or in DIR. What a DIR has from an earlier run is used again: truths whatever the binary (delete DIR/truth after a
change of the tracer), all else if the binary is the same. Captures and fields are removed when they are done with, unless
--keep.
"""
import argparse, datetime, hashlib, json, math, os, pathlib, platform, re, resource, shutil, subprocess, sys, tempfile, time

import numpy

import rigs

root = pathlib.Path(__file__).resolve().parent.parent
home = root / "benches/end_to_end"
parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--relumine", type=pathlib.Path, default=root / "target/release/relumine")
parser.add_argument("--work", type=pathlib.Path, help="where captures, fields and pictures lie; default: temporary")
parser.add_argument("--keep", action="store_true", help="keep captures and fields (and the temporary directory)")
parser.add_argument("--grids", default="8x3,16x4,32x7", help="which of 8x3,16x4,32x7")
parser.add_argument("--size", default="72x48", help="pixels of the photographs of the chess board")
parser.add_argument("--samples", type=int, default=256, help="paths a pixel of the chess photographs")
parser.add_argument("--truth-samples", type=int, default=16384, help="paths a pixel of the truth")
parser.add_argument("--bowl-samples", type=int, default=512, help="paths a pixel of the bowl's photographs")
parser.add_argument("--no-bowl", action="store_true")
parser.add_argument("--commit", help="what the binary was built from, if not from the tree as it is")
parser.add_argument("--threads", type=int, default=2)
parser.add_argument("--no-documents", action="store_true", help="print the tables only; docs/ and benches/runs/ stay as they are")
arguments = parser.parse_args()

SQUARES = {"8x3": 8, "16x4": 8, "32x7": 16}
NAMES = {"uniform": "uniform sky", "sky": "sky with a sun in haze", "lamp": "near lamp", "sun": "sun", "spots": "two spots",
         "shafts": "three shafts"}
# column: how it is photographed, how developed
FIELDS = {"squares": ("squares", None), "combs, minimum": ("combs", "minimum"), "combs, fitted": ("combs", "fitted"),
          "no photographs": (None, None)}
binary = hashlib.sha256(arguments.relumine.read_bytes()).hexdigest()[:16]
temporary = None if arguments.work else tempfile.mkdtemp(prefix="relumine-end-to-end-")
work = pathlib.Path(arguments.work or temporary).resolve()


def relumine(*words):
    """Runs the command; its output, what it said, and what it cost."""
    before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run([str(arguments.relumine), "--threads", str(arguments.threads), *map(str, words)], capture_output=True,
                          text=True)
    if done.returncode:
        sys.exit(f"relumine {' '.join(map(str, words))}\nended with {done.returncode}: {done.stderr}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return done.stdout, done.stderr, {"wall_s": round(time.perf_counter() - started, 2), "cpu_s": round(cpu, 2)}


def once(name, inputs, job, made=None):
    """The result of `job` (JSON), from an earlier run if `inputs` are the same and what it `made` is there."""
    note = work / f"{name}.json"
    note.parent.mkdir(parents=True, exist_ok=True)
    key = hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()
    if note.exists() and (made is None or made.exists()) and (found := json.loads(note.read_text()))["key"] == key:
        return found["result"]
    print(f"{datetime.datetime.now():%H:%M:%S} {name}", file=sys.stderr, flush=True)
    result = job()
    note.write_text(json.dumps({"key": key, "result": result}))
    return result


def draw_sky(path):
    """A Radiance picture of a sky: blue, paler towards the horizon, with a broad glow about a hazy sun; nothing below."""
    height, width = 128, 256
    tilt = (numpy.arange(height) + 0.5)[:, None] * math.pi / height
    # The middle column is +x, azimuth grows to the left.
    azimuth = (0.5 - (numpy.arange(width) + 0.5) / width)[None] * 2 * math.pi
    towards = numpy.stack([numpy.sin(tilt) * numpy.cos(azimuth), numpy.sin(tilt) * numpy.sin(azimuth),
                           numpy.cos(tilt) * numpy.ones_like(azimuth)], -1)
    a, t = math.radians(300), math.radians(50)
    sun = numpy.array([math.sin(t) * math.cos(a), math.sin(t) * math.sin(a), math.cos(t)])
    degrees = numpy.degrees(numpy.arccos(numpy.clip(towards @ sun, -1, 1)))[..., None]
    pale = (1 - numpy.cos(tilt))[..., None] ** 2
    sky = (1 - pale) * numpy.array([0.25, 0.4, 0.8]) + pale * numpy.array([0.7, 0.75, 0.8])
    sky = sky + numpy.exp(-(degrees / 20) ** 2) * numpy.array([2.0, 1.7, 1.3]) + numpy.exp(-(degrees / 4) ** 2) * numpy.array(
        [40.0, 34.0, 24.0])
    sky[height // 2:] = 0
    mantissa, exponent = numpy.frexp(sky.max(-1))
    rgbe = numpy.zeros((height, width, 4), numpy.uint8)
    rgbe[..., :3] = numpy.minimum(sky * 256 / numpy.exp2(exponent)[..., None] + 0.5, 255)
    rgbe[..., 3] = numpy.where(sky.max(-1) > 0, exponent + 128, 0)
    path.write_bytes(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode() + rgbe.tobytes())


def read_hdr(path):
    """What `relumine` writes as .hdr: RGBE in the new run lengths."""
    head, _, data = path.read_bytes().partition(b"\n\n")
    line, _, data = data.partition(b"\n")
    height, width = int(line.split()[1]), int(line.split()[3])
    rows, at = [], 0
    for _ in range(height):
        at += 4
        row = bytearray()
        while len(row) < 4 * width:
            count = data[at]
            if count > 128:
                row += data[at + 1:at + 2] * (count - 128)
                at += 2
            else:
                row += data[at + 1:at + 1 + count]
                at += 1 + count
        rows.append(numpy.frombuffer(row, numpy.uint8).reshape(4, width).T)
    rgbe = numpy.stack(rows).astype(float)
    return rgbe[..., :3] * numpy.where(rgbe[..., 3] > 0, numpy.exp2(rgbe[..., 3] - 136), 0)[..., None]


def rig(scene, size, grid, scheme, samples, bounces, exposure_s, noise):
    electrons = ("60_000", 5) if noise else rigs.NOISELESS
    return rigs.board(scene, size, grid, SQUARES[grid], scheme, samples, bounces, exposure_s, electrons)


def described(scene):
    """The text of a scene but for the size of its picture, which is given anyway."""
    return re.sub(r"(?m)^(width|height) = .*\n", "", scene.read_text())


def truth(scene, light, size, samples, bounces, extension="exr"):
    """Renders a light directly, as work/truth/NAME.exr or .hdr."""
    name = f"{scene.stem if scene.stem != 'scene' else scene.parent.name}-{light.stem}"
    out = work / f"truth/{name}.{extension}"
    out.parent.mkdir(parents=True, exist_ok=True)

    def job():
        _, said, cost = relumine("render", scene, "--light", light, "--size", size, "--samples", samples, "--bounces", bounces,
                                 "-o", out, "--mask", out.with_suffix(".png"), "--force")
        return {"light": light.stem, "samples": samples, "standard_error_percent": float(re.search(r"error ([\d.]+) %", said)[1]),
                "binary_sha256": binary, "digest": hashlib.sha256(out.read_bytes()).hexdigest()[:16],
                "picture": str(out), "mask": str(out.with_suffix(".png")), **cost}
    map_bytes = (light.parent / "sky.hdr").read_bytes() if light.stem == "sky" else b""
    texts = [described(scene), light.read_text(), hashlib.sha256(map_bytes).hexdigest(), size, samples, bounces]
    return once(f"truth/{name}", texts, job, out)


def folder_bytes(path):
    return sum(file.stat().st_size for file in path.rglob("*") if file.is_file())


def fields(name, scene, size, grid, samples, bounces, exposure_s, lights, truths, seeds=(0,), noise=True):
    """Captures, develops and relights one grid in all ways. Rows of figures, and what the steps cost."""
    rows, costs = [], []
    place = work / name
    pictures = place / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    ways = [way for way in FIELDS.items() if noise or way[1][0]]
    ways += [("no photographs, other paths", (None, None))] * (len(seeds) > 1)
    for column, (scheme, separation) in ways:
        text = rig(scene, size, grid, scheme, samples, bounces, exposure_s, noise)
        seed = seeds[-1] if column.endswith("other paths") else seeds[0]
        label = re.sub(r"\W+", "-", column)
        capture, field = place / f"{scheme}.capture", place / f"{label}.field"

        def photograph():
            shutil.rmtree(capture, ignore_errors=True)
            rig_file = place / f"{scheme}.toml"
            rig_file.write_text(text)
            relumine("plan", rig_file, capture)
            _, said, cost = relumine("capture", capture)
            return {"step": "capture", "grid": name, "way": scheme, "photographs": int(said.split()[0]),
                    "bytes": folder_bytes(capture), **cost}

        def develop():
            if scheme is None:
                rig_file = place / "transfer.toml"
                rig_file.write_text(text)
                _, said, cost = relumine("render", scene, "--transfer", rig_file, "--samples", samples, "--bounces", bounces,
                                         "--seed", seed, "-o", field, "--force")
            else:
                method = ["--separation", separation] if separation else []
                _, said, cost = relumine("develop", capture, "-o", field, "--force", *method)
            return {"step": "develop" if scheme else "transfer", "grid": name, "way": column, "bytes": folder_bytes(field),
                    "said": said.strip().splitlines(), **cost}

        def all_steps():
            steps = []
            if scheme:
                steps.append(once(f"{name}/{scheme}-capture", [text, described(scene), binary], photograph, capture))
            steps.append(develop())
            figures = []
            for between in ("box", "linear"):
                words, outs = [], []
                for light in lights:
                    outs.append(pictures / f"{label}-{light.stem}-{between}.exr")
                    words += ["--light", light, "-o", outs[-1]]
                    if scene.stem == "bowl":
                        words += ["--light", light, "-o", outs[-1].with_suffix(".hdr")]
                _, said, cost = relumine("relight", field, *words, "--between", between, "--force")
                uncertain = dict(re.findall(r"([^/\s]+)\.toml: .*standard error of the coefficients ([\d.]+) %", said))
                steps.append({"step": "relight", "grid": name, "way": column, "between": between, "lights": len(words) // 4,
                              **cost})
                for light, out in zip(lights, outs):
                    true = truths[light.stem]
                    found = json.loads(relumine("compare", out, true["picture"], "--mask", true["mask"], "--json")[0])
                    figures.append({"grid": name, "way": column, "light": light.stem, "between": between,
                                    "relative_l2": round(found["relative_l2"], 5),
                                    "ratio_of_means": round(found["ratio_of_means"], 5), "pixels": found["pixels"],
                                    "coefficients_error_percent": json.loads(uncertain.get(light.stem, "null"))})
            if not arguments.keep:
                shutil.rmtree(field, ignore_errors=True)
            return {"steps": steps, "figures": figures}
        done = once(f"{name}/{label}", [text, binary, seed, described(scene), [light.read_text() for light in lights],
                                        [truths[light.stem]["digest"] for light in lights]], all_steps)
        rows += done["figures"]
        costs += [step for step in done["steps"] if step not in costs]
    if len(seeds) > 1:
        for light in lights:
            a, b = (pictures / f"no-photographs{other}-{light.stem}-linear.exr" for other in ("", "-other-paths"))
            found = json.loads(relumine("compare", b, a, "--mask", truths[light.stem]["mask"], "--json")[0])
            rows.append({"grid": name, "way": "noise of paths", "light": light.stem,
                         "relative_l2": round(found["relative_l2"] / 2**0.5, 5)})
    if not arguments.keep:
        for capture in place.glob("*.capture"):
            shutil.rmtree(capture)
    return rows, costs


def number(value):
    return f"{value:.3f}".removeprefix("0") if value < 1 else f"{value:.3f}"


def cell(rows, grid, way, light, between):
    row = next(r for r in rows if (r["grid"], r["way"], r["light"], r.get("between")) == (grid, way, light, between))
    return f"{number(row['ratio_of_means'])} / {number(row['relative_l2'])}"


def said_grid(grid):
    return f"{grid.replace('x', ' × ')} × {SQUARES[grid]}²"


def chess_tables(rows, costs, truths, grids):
    lines = ["Truth, from `relumine render`, and what the paths of the photographs leave uncertain:", "",
             "| light | paths a pixel | standard error, relative L2 | paths of the photographs |", "|---|---|---|---|"]
    floor = {row["light"]: row["relative_l2"] for row in rows if row["way"] == "noise of paths"}
    for light, name in NAMES.items():
        found = truths[light]
        error = found["standard_error_percent"] / 100
        lines.append(f"| {name} | {found['samples']} | {number(error)} | {number(floor[light])} |")
    for between in ("linear", "box"):
        lines += ["", f"`--between {between}`, ratio of means / relative L2:", "",
                  "| light | grid | " + " | ".join(FIELDS) + " |", "|---|---|" + "---|" * len(FIELDS)]
        for light, name in NAMES.items():
            for grid in grids:
                cells = [cell(rows, grid, way, light, between) for way in FIELDS]
                lines.append(f"| {name} | {said_grid(grid)} | " + " | ".join(cells) + " |")
    photographed = [way for way, (scheme, _) in FIELDS.items() if scheme]
    lines += ["", "Uniform sky again, `--between linear`, from photographs without noise of the camera:", "",
              "| grid | " + " | ".join(photographed) + " |", "|---|" + "---|" * len(photographed)]
    for grid in grids:
        cells = [cell(rows, f"{grid}, no noise", way, "uniform", "linear") for way in photographed]
        lines.append(f"| {said_grid(grid)} | " + " | ".join(cells) + " |")
    lines += ["", "What it costs, in seconds of one core:", "",
              "| grid | patterns | photographs | capture | develop | field |", "|---|---|---|---|---|---|"]
    for grid in grids:
        for scheme in ("squares", "combs"):
            taken = next(c for c in costs if (c["step"], c["grid"], c["way"]) == ("capture", grid, scheme))
            developed = [c for c in costs if c["step"] == "develop" and c["grid"] == grid and c["way"].startswith(scheme)]
            seconds = " / ".join(f"{c['cpu_s']:.1f} s" for c in developed)
            size = " / ".join(f"{c['bytes'] / 1e6:.0f} MB" for c in developed)
            lines.append(f"| {said_grid(grid)} | {scheme} | {taken['photographs']:,} | {taken['cpu_s']:.0f} s, "
                         f"{taken['bytes'] / 1e6:.0f} MB | {seconds} | {size} |")
    return "\n".join(lines)


def bowl_table(rows, truths):
    lines = ["| light | between | paths a pixel | " + " | ".join(FIELDS) + " | truth's standard error |",
             "|---|---|---|" + "---|" * (len(FIELDS) + 1)]
    for light, name in (("uniform", "uniform sky"), ("bowl-spot", "one spot")):
        for between, grid, samples in (("linear", "bowl", arguments.bowl_samples), ("box", "bowl", arguments.bowl_samples),
                                       ("linear", "bowl, few paths", FEW)):
            cells = [cell(rows, grid, way, light, between) for way in FIELDS]
            error = number(truths[light]["standard_error_percent"] / 100)
            lines.append(f"| {name} | {between} | {samples} | " + " | ".join(cells) + f" | {error} |")
    return "\n".join(lines)


def put(path, marker, text):
    """Replaces what stands between the markers of a document."""
    begin, end = f"<!-- {marker}: written by benches/end_to_end.py -->", f"<!-- end of {marker} -->"
    if not path.exists() or begin not in (document := path.read_text()):
        print(f"{path} has no place for {marker}", file=sys.stderr)
        return
    before, _, rest = document.partition(begin)
    path.write_text(f"{before}{begin}\n\n{text}\n\n{end}{rest.partition(end)[2]}")


def bowl_figure(rows):
    try:
        from PIL import Image, ImageDraw, ImageFont
    except ImportError:
        sys.exit("the figure docs/bowl.jpg needs pillow: pip install pillow, or run with --no-bowl")
    ways = ["squares", "combs, minimum", "combs, fitted"]
    scale, gap, line = 2, 6, 17
    font = ImageFont.load_default(12)
    made = []
    for light, name in (("uniform", "uniform sky"), ("bowl-spot", "one spot")):
        true = read_hdr(work / f"truth/bowl-{light}.hdr")
        pictures = [read_hdr(work / f"bowl/pictures/{re.sub(chr(92) + 'W+', '-', way)}-{light}-linear.hdr") for way in ways]
        made.append((name, light, true, pictures))
    height, width = made[0][2].shape[:2]
    w, h = width * scale, height * scale
    sheet = Image.new("RGB", (4 * w + 5 * gap, 2 * (2 * (h + line) + gap) + gap + line), "white")
    draw = ImageDraw.Draw(sheet)
    y = gap
    for name, light, true, pictures in made:
        white = 0.6 / numpy.percentile(true, 99)
        for column, picture in enumerate([true, *pictures]):
            x = gap + column * (w + gap)
            shown = numpy.clip(picture * white, 0, 1)
            shown = numpy.where(shown <= 0.0031308, 12.92 * shown, 1.055 * shown ** (1 / 2.4) - 0.055)
            sheet.paste(Image.fromarray((shown * 255 + 0.5).astype(numpy.uint8)).resize((w, h), Image.Resampling.BICUBIC), (x, y))
            if column:
                caption = f"{ways[column - 1]}: {cell(rows, 'bowl', ways[column - 1], light, 'linear')}"
                # Signed, of the truth's mean: red too bright, blue too dark, white the same.
                off = numpy.clip((picture - true).mean(-1) / true.mean() / SCALE, -1, 1)
                colour = numpy.stack([1 - numpy.maximum(-off, 0), 1 - abs(off), 1 - numpy.maximum(off, 0)], -1)
                below = y + h + line
                coloured = Image.fromarray((colour * 255 + 0.5).astype(numpy.uint8))
                sheet.paste(coloured.resize((w, h), Image.Resampling.NEAREST), (x, below))
                draw.text((x, below + h + 1), f"{ways[column - 1]} - truth", "black", font)
            else:
                caption = f"{name}: truth"
                ramp = numpy.linspace(1, -1, h)[:, None].repeat(24, 1)
                colour = numpy.stack([1 - numpy.maximum(-ramp, 0), 1 - abs(ramp), 1 - numpy.maximum(ramp, 0)], -1)
                below = y + h + line
                sheet.paste(Image.fromarray((colour * 255 + 0.5).astype(numpy.uint8)), (x + w - 24, below))
                marks = {0: f"+{100 * SCALE:.0f} % of the truth's mean", h // 2 - 8: "as bright as the truth",
                         h - 16: f"-{100 * SCALE:.0f} %"}
                for at, text in marks.items():
                    draw.text((x + w - 30 - draw.textlength(text, font), below + at), text, "black", font)
            draw.text((x, y + h + 1), caption, "black", font)
        y += 2 * (h + line) + gap
    draw.text((gap, y), "captions: ratio of means / relative L2, linear between positions", "black", font)
    sheet.save(root / "docs/bowl.jpg", quality=88)
    print(f"docs/bowl.jpg {(root / 'docs/bowl.jpg').stat().st_size} bytes")


BOWL_SIZE, BOWL_BOUNCES, FEW, SCALE = "96x64", 8, 16, 0.4
grids = arguments.grids.split(",")
if unknown := [grid for grid in grids if grid not in SQUARES]:
    parser.error(f"--grids: {unknown[0]}: expected some of {', '.join(SQUARES)}")
lights = work / "lights"
lights.mkdir(parents=True, exist_ok=True)
for file in home.glob("*.toml"):
    if file.name != "bowl.toml":
        shutil.copy(file, lights)
draw_sky(lights / "sky.hdr")

chess = root / "examples/chess/scene.toml"
truths = {light: truth(chess, lights / f"{light}.toml", arguments.size, arguments.truth_samples, 4) for light in NAMES}
rows, costs = [], []
for grid in grids:
    # What the photographs' own paths are uncertain by hardly depends on the grid: it is measured on the first.
    seeds = (0, 1) if grid == grids[0] else (0,)
    more_rows, more_costs = fields(grid, chess, arguments.size, grid, arguments.samples, 4, 0.5,
                                   [lights / f"{light}.toml" for light in NAMES], truths, seeds)
    rows, costs = rows + more_rows, costs + more_costs
    more_rows, _ = fields(f"{grid}, no noise", chess, arguments.size, grid, arguments.samples, 4, 0.5, [lights / "uniform.toml"],
                          truths, noise=False)
    rows += more_rows
    print(f"\n{said_grid(grid)}")
    for light in NAMES:
        for between in ("linear", "box"):
            cells = "   ".join(f"{way}: {cell(rows, grid, way, light, between)}" for way in FIELDS)
            print(f"  {NAMES[light]:<24} {between:<7} {cells}", flush=True)

bowl_rows, bowl_truths = [], {}
if not arguments.no_bowl:
    bowl = home / "bowl.toml"
    bowl_truths = {light: truth(bowl, lights / f"{light}.toml", BOWL_SIZE, arguments.truth_samples // 4, BOWL_BOUNCES, "hdr")
                   for light in ("uniform", "bowl-spot")}
    for name, samples in (("bowl", arguments.bowl_samples), ("bowl, few paths", FEW)):
        more_rows, more_costs = fields(name, bowl, BOWL_SIZE, "8x3", samples, BOWL_BOUNCES, 0.3,
                                       [lights / "uniform.toml", lights / "bowl-spot.toml"], bowl_truths)
        bowl_rows, costs = bowl_rows + more_rows, costs + more_costs
    print("\n" + bowl_table(bowl_rows, bowl_truths))

tables = chess_tables(rows, costs, truths, grids)
print("\n" + tables)
if not arguments.no_documents:
    described_by_git = subprocess.run(["git", "-C", root, "describe", "--always", "--dirty"], capture_output=True, text=True)
    commit = arguments.commit or described_by_git.stdout.strip()
    models = (line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name"))
    cpu = next(models, platform.processor())
    for found in [*truths.values(), *bowl_truths.values()]:
        found.pop("picture"), found.pop("mask")
    report = {"date": datetime.datetime.now().isoformat(timespec="seconds"), "machine": f"{cpu}, {os.cpu_count()} cores",
              "load_average": os.getloadavg(), "commit": commit, "binary_sha256": binary,
              "command": "benches/end_to_end.py",
              "options": {name: value for name, value in vars(arguments).items() if name not in ("relumine", "work", "commit", "keep")},
              "chess": {"truth": list(truths.values()), "figures": rows},
              "bowl": {"truth": list(bowl_truths.values()), "figures": bowl_rows},
              "costs": costs}
    folder = root / "benches/runs"
    folder.mkdir(exist_ok=True)
    path = folder / f"{datetime.date.today()}-{commit}-end-to-end.json"
    path.write_text(json.dumps(report, indent=1) + "\n")
    print(path.relative_to(root))
    put(root / "docs/end-to-end.md", "tables", tables)
    if not arguments.no_bowl:
        put(root / "docs/end-to-end.md", "bowl", bowl_table(bowl_rows, bowl_truths))
        bowl_figure(bowl_rows)
if temporary and not arguments.keep:
    shutil.rmtree(work)
