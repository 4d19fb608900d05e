#!/usr/bin/env python3
"""Develops and relights the chess capture with Relumine and with plain NumPy, in one run, and writes a dated run file.

    python benches/compare_with_numpy.py DATA/chess-capture [--rounds 3]

Needs numpy, pillow and OpenEXR in the Python that runs it (for benches/numpy), and a release build:
    cargo build --release --examples --bin relumine
Rounds alternate between the two, so that both meet the same neighbours on a shared machine. The run file lies in
benches/runs/. Compare figures of one file only.
"""
import argparse, datetime, json, os, pathlib, platform, resource, subprocess, sys, tempfile, time

root = pathlib.Path(__file__).resolve().parent.parent
parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("capture", type=pathlib.Path)
parser.add_argument("--rounds", type=int, default=3)
arguments = parser.parse_args()
binary, timer = root / "target/release/relumine", root / "target/release/examples/time_relight"


def run(*words, **environment):
    """Wall and CPU seconds and peak memory of a command, and what it printed."""
    started = time.perf_counter()
    child = subprocess.Popen([str(word) for word in words], stdout=subprocess.PIPE, text=True, env={**os.environ, **environment})
    printed = child.stdout.read()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        sys.exit(f"{words[0]} ended with {child.returncode}")
    return {"wall_s": round(time.perf_counter() - started, 3), "cpu_s": round(usage.ru_utime + usage.ru_stime, 3),
            "peak_rss_mb": round(usage.ru_maxrss / 1024)}, printed


def last_json(text):
    return json.loads(text.strip().splitlines()[-1])


rows = []
with tempfile.TemporaryDirectory() as work:
    work = pathlib.Path(work)
    photographs = sum(1 for line in (arguments.capture / "photographs.csv").read_text().splitlines()[1:] if line)
    for name in ("minimum", "fitted"):
        for number in range(arguments.rounds):
            usage, printed = run(sys.executable, root / "benches/numpy/chain.py", arguments.capture, work / f"{name}.npz",
                                 "--separation", name, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
            figures = last_json(printed)
            rows.append({"job": f"develop, {name}", "who": "numpy, 1 thread", "round": number, **usage,
                         "seconds": figures["seconds_total"],
                         "photographs_megapixels_per_s_per_core": figures["photograph_megapixels_per_second_per_core"]})
            megapixels = figures["megapixels_per_photograph"] * photographs
            for threads in (1, 2):
                usage, _ = run(binary, "-q", "--threads", threads, "develop", arguments.capture, "-o", work / f"{name}.field",
                               "--separation", name, "--force")
                rows.append({"job": f"develop, {name}", "who": f"relumine, {threads} threads", "round": number, **usage,
                             "seconds": usage["wall_s"],
                             "photographs_megapixels_per_s_per_core": round(megapixels / usage["cpu_s"], 2)})
    light = arguments.capture / "truth/env_sky.toml"
    run(binary, "-q", "light", light, "--for", work / "fitted.field", "-o", work / "sky.exr")
    for number in range(arguments.rounds):
        usage, printed = run(sys.executable, root / "benches/numpy/relight.py", work / "fitted.npz", work / "sky.exr", work / "np.exr")
        figures = last_json(printed)
        rows.append({"job": "relight, sky", "who": "numpy, dense basis in memory", "round": number, **usage,
                     "seconds": figures["seconds_best"], "median_s": figures["seconds_median"]})
        usage, printed = run(timer, work / "fitted.field", work / "sky.exr")
        figures = last_json(printed)
        for where in ("memory", "disk"):
            seconds = figures[f"from_{where}_seconds"]
            rows.append({"job": "relight, sky", "who": f"relumine, field from {where}", "round": number,
                         "peak_rss_mb": usage["peak_rss_mb"], "seconds": seconds["best"], "median_s": seconds["median"]})
        usage, _ = run(binary, "-q", "relight", work / "fitted.field", "--light", work / "sky.exr", "-o", work / "out.exr", "--force")
        rows.append({"job": "relight, sky", "who": "relumine, the whole command", "round": number, **usage, "seconds": usage["wall_s"]})
    field_bytes = sum(file.stat().st_size for file in (work / "fitted.field").rglob("*") if file.is_file())

commit = subprocess.run(["git", "-C", root, "describe", "--always", "--dirty"], capture_output=True, text=True).stdout.strip()
cpu = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), platform.processor())
report = {"date": datetime.datetime.now().isoformat(timespec="seconds"), "machine": f"{cpu}, {os.cpu_count()} cores",
          "load_average": os.getloadavg(), "commit": commit, "command": " ".join(["benches/compare_with_numpy.py", arguments.capture.name, *sys.argv[2:]]),
          "field_bytes": field_bytes, "rows": rows}
folder = root / "benches/runs"
folder.mkdir(exist_ok=True)
path = folder / f"{datetime.date.today()}-{commit}-numpy.json"
path.write_text(json.dumps(report, indent=1) + "\n")
for row in rows:
    print(f"{row['job']:<18} {row['who']:<30} {row['seconds']:>8.3f} s  {row['peak_rss_mb']:>5} MB  "
          f"{row.get('photographs_megapixels_per_s_per_core', '')}")
print(path.relative_to(root))
