#!/usr/bin/env python3
"""A field of the paper's size from the virtual rig, and what it takes to relight it, into a dated run file in benches/runs/.

    benches/paper_scale.py [--size WIDTHxHEIGHT] [--samples 16] [--bounces 2] [--error 0.01] [--skip STEP …] [--work DIR]

The rig is benches/paper_scale/rig.toml (32 × 7 positions, 16 × 16 squares, 1440 × 960 pixels), the scene examples/chess, the
lights are those of benches/end_to_end/. Steps:

    generate   the packed field, streamed, and its relit pictures against what the lights show of it before it is packed
    memory     the field in memory: lights that change in many and in few places, a spot that moves, time by pixels and lit
               cells; beside each a plain read of as many bytes on all threads
    disk       lights straight from disk, cold (the page cache is told to forget the field, and asked whether it has) and warm
    numpy      the same relighting as a product of NumPy's with all R in memory, of a window of the picture
    baseline   the window's bytes with the paper's own coding and packed, every light within 1 %
    peaks      the most memory that `relumine pack` and `relumine relight` take

Try --size 96x64 --samples 4 --window 24 --window-samples 64 --pack-size 96x64 first: two minutes on two cores. Of a window of
64 pixels a side numpy holds 2.8 GB, in memory and in DIR (default: temporary, removed), which must be empty, or
of an earlier run: its field is then taken as it is. Needs numpy, Linux,
and
    cargo build --release --bin relumine && cargo build --release -p relumine --example paper_scale --example rle_huffman
Compare figures of one file only.
"""
import argparse, ast, ctypes, datetime, json, math, mmap, os, pathlib, platform, re, resource, shutil, statistics, subprocess, sys, tempfile
import time, tomllib

import numpy

root = pathlib.Path(__file__).resolve().parent.parent
STEPS = ["generate", "memory", "disk", "numpy", "baseline", "peaks"]
LIGHTS = ["uniform", "sky", "lamp", "sun", "spots", "shafts"]
parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--size", help="pixels of the picture, WIDTHxHEIGHT, if not those of the rig")
parser.add_argument("--samples", type=int, default=16, help="paths a pixel of the field")
parser.add_argument("--bounces", type=int, default=2)
parser.add_argument("--error", type=float, default=0.01, help="what the field is packed to")
parser.add_argument("--window", type=int, default=64, help="pixels a side of the window for numpy and baseline")
parser.add_argument("--window-at", default="720,480", metavar="X,Y", help="its middle in a picture of 1440x960")
parser.add_argument("--window-samples", type=int, default=256, help="paths a pixel of the window")
parser.add_argument("--within", type=float, default=0.01, help="the error that the baseline is compared at")
parser.add_argument("--pack-size", default="256x128", help="pixels of the lossless field whose packing is watched")
parser.add_argument("--repeat", type=int, default=11)
parser.add_argument("--rounds", type=int, default=3, help="rounds of numpy, disk")
parser.add_argument("--skip", nargs="*", default=[], choices=STEPS)
parser.add_argument("--work", type=pathlib.Path, help="where fields lie, kept; default: temporary")
parser.add_argument("--binaries", type=pathlib.Path, default=root / "target/release")
parser.add_argument("--runs", type=pathlib.Path, default=root / "benches/runs", help="where the run file goes")
arguments = parser.parse_args()

relumine, program = arguments.binaries / "relumine", arguments.binaries / "examples/paper_scale"
scene, rig = root / "examples/chess/scene.toml", root / "benches/paper_scale/rig.toml"
begun, load_before = time.perf_counter(), os.getloadavg()


def watched(*words):
    """What a command printed, and its wall and CPU seconds and peak memory."""
    started = time.perf_counter()
    with tempfile.TemporaryFile("w+") as said:
        child = subprocess.Popen([str(word) for word in words], stdout=subprocess.PIPE, stderr=said, text=True)
        printed = child.stdout.read()
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode:
            said.seek(0)
            sys.exit(f"{' '.join(str(word) for word in words)}\nended with {child.returncode}: {said.read()}")
    return printed, {"wall_s": round(time.perf_counter() - started, 2), "cpu_s": round(usage.ru_utime + usage.ru_stime, 2),
                     "peak_rss_mb": round(usage.ru_maxrss / 1024)}


def measured(command, *words):
    """The report of one command of the example, its peak memory beside it."""
    printed, usage = watched(program, command, *words)
    return {**json.loads(printed), "process": usage}


def say(text):
    print(f"{time.perf_counter() - begun:6.0f} s  {text}", file=sys.stderr, flush=True)


def bytes_of(field):
    """Of all files, and of those that hold bases, steps and atoms (or halves) alone."""
    files = [file for file in field.rglob("*") if file.is_file()]
    # Chunks are c/… or, where they are one file, c.0.0.
    is_data = lambda parts: parts[0] != "clipped" and ("c" in parts or parts[-1].startswith("c."))
    data = [file for file in files if is_data(file.relative_to(field).parts)]
    return sum(file.stat().st_size for file in files), sum(file.stat().st_size for file in data)


def write_lights(folder):
    """The lights beside each other; the sky's map is drawn as benches/end_to_end.py draws it."""
    home = root / "benches/end_to_end"
    tree = ast.parse((home.parent / "end_to_end.py").read_text())
    drawing = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "draw_sky"]
    names = {"numpy": numpy, "math": math}
    exec(compile(ast.Module(drawing, []), "end_to_end.py", "exec"), names)
    folder.mkdir(exist_ok=True)
    names["draw_sky"](folder / "sky.hdr")
    return [pathlib.Path(shutil.copy(home / f"{name}.toml", folder)) for name in LIGHTS]


def write_rig(path, width, height):
    text = re.sub(r"(?m)^width = .*$", f"width = {width}", rig.read_text())
    path.write_text(re.sub(r"(?m)^height = .*$", f"height = {height}", text))
    return path


def write_window(path):
    """The scene as its camera sees a window of a picture of 1440 × 960 pixels."""
    text = scene.read_text()
    camera = tomllib.loads(text)["camera"]
    position, target = (numpy.array(camera[key], float) for key in ("position", "target"))
    forward = (target - position) / (distance := numpy.linalg.norm(target - position))
    right = numpy.cross(forward, camera.get("up", [0, 0, 1]))
    right /= numpy.linalg.norm(right)
    pixel = 2 * math.tan(math.radians(camera["horizontal_fov_deg"]) / 2) / 1440
    x, y = (float(number) for number in arguments.window_at.split(","))
    direction = forward + right * (x - 720) * pixel - numpy.cross(right, forward) * (y - 480) * pixel
    aim = position + direction / numpy.linalg.norm(direction) * distance
    angle = 2 * math.degrees(math.atan(arguments.window * pixel / 2))
    for key, value in [("target", [round(float(number), 9) for number in aim]), ("horizontal_fov_deg", round(angle, 9)),
                       ("width", arguments.window), ("height", arguments.window)]:
        text = re.sub(rf"(?m)^{key} = .*$", f"{key} = {value}", text, count=1)
    path.write_text(text)
    return path


def forget(field):
    """Tells the page cache to forget a field; files that it still holds some of."""
    files = [file for file in field.rglob("*") if file.is_file()]
    for file in files:
        handle = os.open(file, os.O_RDONLY)
        os.fsync(handle)
        os.posix_fadvise(handle, 0, 0, os.POSIX_FADV_DONTNEED)
        os.close(handle)
    return {"files": len(files), "still_cached": sum(map(is_cached, files))}


def is_cached(file):
    """Whether the page cache holds some of a file. Asked of mincore: reading a byte, even without waiting, begins to read ahead."""
    libc = ctypes.CDLL(None, use_errno=True)
    libc.mmap.restype = ctypes.c_void_p
    libc.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_long]
    length, handle = file.stat().st_size, os.open(file, os.O_RDONLY)
    try:
        address = libc.mmap(None, length, mmap.PROT_READ, mmap.MAP_SHARED, handle, 0)
        held = (ctypes.c_ubyte * -(-length // mmap.PAGESIZE))()
        asked = libc.mincore(ctypes.c_void_p(address), ctypes.c_size_t(length), held)
        libc.munmap(ctypes.c_void_p(address), ctypes.c_size_t(length))
    finally:
        os.close(handle)
    if asked:
        raise OSError(ctypes.get_errno(), f"mincore cannot be asked about {file}")
    return any(page & 1 for page in held)


def disk_step(field, lights):
    """Light from a few positions and from all of them from disk, a few times cold and each time warm after it."""
    rows = []
    for light in lights:
        if light.stem not in ("spots", "uniform"):
            continue
        colds, found = [], None
        for _ in range(arguments.rounds):
            forgotten = forget(field)
            found = measured("disk", field, "--light", light, "--repeat", arguments.repeat)
            colds.append({**found["first"], **forgotten})
        times = sorted(cold["ms"] for cold in colds)
        rows.append({"light": found["light"], "lit_positions": found["lit_positions"], "lit_cells": found["lit_cells"],
                     "cold_ms": {"min": times[0], "median": statistics.median(times)}, "warm_ms": found["again_ms"],
                     "colds": colds})
    return rows


def numpy_step(field, lights, work):
    """All R in memory as float32: one product a channel, in turn with the kernel of the same field and lights."""
    folder = work / "dense"
    report = {key: value for key, value in measured("dense", field, folder, "--light", *lights).items() if key != "process"}
    rows = {name: {"numpy_ms": [], "numpy_lit_cells_ms": [], "kernel_ms": []} for name in report["lights"]}
    for _ in range(arguments.rounds):
        # In a process of its own: what a process holds counts as the peak of those that it starts.
        printed, _ = watched(sys.executable, root / "benches/paper_scale/product.py", folder)
        for row, product in zip(rows.values(), json.loads(printed)):
            row["numpy_ms"] += product["all_ms"]
            row["numpy_lit_cells_ms"] += product["lit_ms"]
            row.update({key: product[key] for key in ("lit_cells", "kernel_is_off_by")})
        kernel = measured("time", field, "--light", *lights, "--repeat", arguments.repeat, "--brief")
        for row, case in zip(rows.values(), kernel["lights"]):
            row["kernel_ms"].append(case["ms"]["min"])
    shutil.rmtree(folder)
    for row in rows.values():
        for key in ("numpy_ms", "numpy_lit_cells_ms", "kernel_ms"):
            row[key] = {"min": round(min(row[key]), 3), "median": round(statistics.median(row[key]), 3)} if row[key] else None
        row["numpy_best_ms"] = min(row[key]["min"] for key in ("numpy_ms", "numpy_lit_cells_ms") if row[key])
        row["ratio"] = round(row["numpy_best_ms"] / row["kernel_ms"]["min"], 2)
    return {**report, "numpy": numpy.__version__, "resident_bytes": kernel["resident_bytes"], "lights": rows}


def errors_of(field, reference_pictures, lights, work):
    """Relative L2 by light against pictures relit before; none where these are black."""
    words = [word for light in lights for word in ("--light", light, "-o", work / f"found-{light.stem}.exr")]
    watched(relumine, "-q", "relight", field, *words, "--force")
    found = {}
    for light in lights:
        reference = reference_pictures / f"{light.stem}.exr"
        compared = subprocess.run([relumine, "compare", work / f"found-{light.stem}.exr", reference, "--json"],
                                  capture_output=True, text=True)
        found[light.stem] = json.loads(compared.stdout)["relative_l2"] if compared.returncode == 0 else None
    return found


def baseline_step(lossless, lights, work):
    """Bytes of a lossless field with the paper's coding and packed, each at the largest error that keeps every light within."""
    within = arguments.within
    reference = work / "reference"
    reference.mkdir(exist_ok=True)
    words = [word for light in lights for word in ("--light", light, "-o", reference / f"{light.stem}.exr")]
    watched(relumine, "-q", "relight", lossless, *words, "--force")
    say("baseline: the paper's coding")
    printed, usage = watched(arguments.binaries / "examples/rle_huffman", lossless, "--light", *lights, "--error", within)
    paper = json.loads(printed)["within"][0]["best"]
    packed, tried = work / "tried.field", []

    def pack(error):
        _, usage = watched(relumine, "-q", "pack", lossless, "-o", packed, "--error", f"{error:.6f}", "--force")
        errors = errors_of(packed, reference, lights, work)
        every, data = bytes_of(packed)
        worst = max((found for found in errors.values() if found is not None), default=0)
        tried.append({"error": round(error, 6), "bytes": every, "bytes_of_blocks": data, "errors": errors, "worst": worst, **usage})
        return worst <= within

    say("baseline: packed")
    # The largest error to 9 %: first by halves, as long as that helps, then between the last two.
    low, high = 1e-4, 8 * within
    while not pack(high) and high / 2 >= low and (len(tried) < 2 or tried[-1]["worst"] <= tried[-2]["worst"]):
        high /= 2
    if tried[-1]["worst"] <= within and len(tried) > 1:
        low, high = high, 2 * high
        for _ in range(3):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if pack(middle) else (low, middle)
    shutil.rmtree(packed)
    best = max((row for row in tried if row["worst"] <= within), key=lambda row: row["error"], default=None)
    ratio = paper and best and round(paper["rle_huffman_bytes"] / best["bytes_of_blocks"], 2)
    return {"within": within, "lossless_bytes": bytes_of(lossless)[0], "paper": paper, "paper_took": usage, "packed": best,
            "tried": tried, "paper_over_packed_bytes": ratio}


def peaks_step(field, lights, work):
    """The most memory of the commands: a lossless field packed, and the packed field relit from disk under all lights."""
    width, height = arguments.pack_size.split("x")
    lossless, packed = work / "lossless.field", work / "packed.field"
    watched(relumine, "-q", "render", scene, "--transfer", write_rig(work / "pack.toml", width, height), "-o", lossless,
            "--samples", arguments.samples, "--bounces", arguments.bounces, "--force")
    _, pack = watched(relumine, "-q", "pack", lossless, "-o", packed, "--error", arguments.error, "--force")
    sizes = {"picture": arguments.pack_size, "lossless_bytes": bytes_of(lossless)[0], "packed_bytes": bytes_of(packed)[0]}
    shutil.rmtree(lossless)
    words = [word for light in lights for word in ("--light", light, "-o", work / f"relit-{light.stem}.exr")]
    _, all_lights = watched(relumine, "-q", "relight", field, *words, "--force")
    spots = [light for light in lights if light.stem == "spots"]
    words = [word for light in spots for word in ("--light", light, "-o", work / f"relit-{light.stem}.exr")]
    _, two_spots = watched(relumine, "-q", "relight", field, *words, "--force")
    return {"pack": {**sizes, **pack}, f"relight, {len(lights)} lights": all_lights, "relight, spots": two_spots}


def generate(field, lights, work):
    """The packed field of the scene, and what it lost."""
    options = ["--samples", arguments.samples, "--bounces", arguments.bounces, "--error", arguments.error,
               "--pictures", work / "witnessed", *(["--size", arguments.size] if arguments.size else [])]
    report = measured("generate", scene, rig, field, "--light", *lights, *options)
    return {**report, "date": datetime.datetime.now().isoformat(timespec="seconds"), "commit": commit_of_tree(),
            "load_average": os.getloadavg()}


def commit_of_tree():
    return subprocess.run(["git", "describe", "--always", "--dirty"], cwd=root, capture_output=True, text=True).stdout.strip()


def run(work):
    report, lights = {}, write_lights(work / "lights")
    field = work / "paper.field"
    wanted = lambda step: step not in arguments.skip
    if any(wanted(step) for step in ("generate", "memory", "disk", "peaks")):
        made = work / "generate.json"
        if made.exists():
            # Of an earlier run in the same folder: its own date and commit are in it.
            report["generate"] = json.loads(made.read_text())
        else:
            say("generate")
            report["generate"] = generate(field, lights, work)
            made.write_text(json.dumps(report["generate"]))
    if wanted("memory"):
        say("memory")
        report["memory"] = measured("time", field, "--light", *lights, "--repeat", arguments.repeat)
    if wanted("disk"):
        say("disk")
        report["disk"] = disk_step(field, lights)
    if wanted("numpy") or wanted("baseline"):
        say("window")
        lossless, packed = work / "window-lossless.field", work / "window.field"
        window = write_window(work / "window.toml")
        cells = write_rig(work / "window-rig.toml", arguments.window, arguments.window)
        _, usage = watched(relumine, "-q", "render", window, "--transfer", cells, "-o", lossless, "--samples",
                           arguments.window_samples, "--bounces", arguments.bounces, "--force")
        watched(relumine, "-q", "pack", lossless, "-o", packed, "--error", arguments.error, "--force")
        report["window"] = {"pixels": arguments.window, "at": arguments.window_at, "samples": arguments.window_samples,
                            "lossless_bytes": bytes_of(lossless)[0], "packed_bytes": bytes_of(packed)[0], **usage}
        if wanted("numpy"):
            say("numpy")
            report["numpy"] = numpy_step(packed, lights, work)
        if wanted("baseline"):
            report["baseline"] = baseline_step(lossless, lights, work)
    if wanted("peaks"):
        say("peaks")
        report["peaks"] = peaks_step(field, lights, work)
        # What a process is started from counts as its peak: no figure can be below this script's own.
        report["peaks_seen_from_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    return report


def table(report):
    """The figures that matter, a line each."""
    if found := report.get("generate"):
        width, height = found["picture"]
        yield (f"generated {width} x {height} in {found['seconds']} s: {found['connections_per_s'] / 1e6:.2f} million "
               f"connections/s, {found['photographs_equivalent_per_s']} photographs' worth/s, peak {found['peak_rss_mb']} MB")
        yield (f"  {found['bytes'] / 1e6:.1f} MB on disk, {found['bytes_per_pixel_and_position']} bytes a pixel and position; "
               f"worst light off by {found['against_unpacked']['worst_relative_l2']:.4f}")
    if found := report.get("memory"):
        yield f"in memory: loaded in {found['load_s']} s, {found['resident_bytes'] / 1e6:.1f} MB"
        for case in found["lights"]:
            yield (f"  {case['light']:<28} {case['lit_positions']:>4} positions  {case['ms']['median']:>9.2f} ms, least "
                   f"{case['ms']['min']:.2f}, a plain read {case['plain_read_ms']['min']:.2f}")
        for case in found["moving"]:
            yield (f"  {case['light']:<28} {case['positions_changed']:>4.1f} changed    {case['update_ms']['median']:>9.2f} ms, "
                   f"anew {case['relit_anew_ms']['median']:.2f}")
        curve = found["curve"]
        yield (f"  time = pixels x ({curve['ns_per_pixel']} ns + cells x {curve['ps_per_pixel_and_cell']} ps), off by "
               f"{curve['largest_deviation_of_line']:.0%} at most")
    for case in report.get("disk", []):
        yield (f"from disk: {case['light']:<17} {case['lit_positions']:>4} positions  cold {case['cold_ms']['median']:.1f} ms, "
               f"warm {case['warm_ms']['median']:.1f} ms")
    for name, case in report.get("numpy", {}).get("lights", {}).items():
        yield f"numpy: {name:<12} {case['numpy_best_ms']:.2f} ms, kernel {case['kernel_ms']['min']:.3f} ms: {case['ratio']} times"
    if found := report.get("baseline"):
        paper, packed = found["paper"], found["packed"]
        if paper and packed:
            yield (f"within {found['within']}: the paper's coding {paper['rle_huffman_bytes'] / 1e6:.2f} MB, packed to "
                   f"{packed['error']} {packed['bytes_of_blocks'] / 1e6:.2f} MB: {found['paper_over_packed_bytes']} times")
        else:
            nearest = min(found["tried"], key=lambda row: row["worst"])
            yield (f"within {found['within']}: not reached; packed to {nearest['error']} the worst light is off by "
                   f"{nearest['worst']:.4f}")
    for name, usage in report.get("peaks", {}).items():
        yield f"peak of {name}: {usage['peak_rss_mb']} MB, {usage['wall_s']} s"


if arguments.work:
    arguments.work.mkdir(parents=True, exist_ok=True)
    if any(arguments.work.iterdir()) and not (arguments.work / "generate.json").exists():
        sys.exit(f"{arguments.work} is neither empty nor of an earlier run")
    results = run(arguments.work.resolve())
else:
    with tempfile.TemporaryDirectory(prefix="relumine-paper-scale-") as temporary:
        results = run(pathlib.Path(temporary))
model = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), platform.machine())
# Where things lay is nobody's business but this machine's.
command = re.sub(r" --(work|binaries|runs)[ =]\S+", "", " ".join(["benches/paper_scale.py", *sys.argv[1:]]))
report = {"date": datetime.datetime.now().isoformat(timespec="seconds"), "machine": f"{model}, {os.cpu_count()} cores",
          "load_average": {"before": load_before, "after": os.getloadavg()}, "commit": commit_of_tree(), "command": command,
          "seconds": round(time.perf_counter() - begun), **results}
arguments.runs.mkdir(exist_ok=True)
path = arguments.runs / f"{report['date'][:10]}-{report['commit']}-paper-scale.json"
path.write_text(json.dumps(report, indent=1) + "\n")
print("\n".join(table(report)))
print(path)
