#!/usr/bin/env python3
"""The transfer of every cell of the paper's grid in one pass: time and memory, into a dated run file in benches/runs/.

    benches/one_pass.py [--samples 16] [--bounces 2] [--relumine PATH] [--more SCENE …]

Renders the field of examples/chess (32 × 7 positions, 16 × 16 squares, 360 × 240 pixels) with `relumine render --transfer`
into a temporary directory, and times paths and connections alone on the same scene and on each of --more. Needs
    cargo build --release && cargo build --release --example time_connections -p relumine-tracer
Standard library only.
"""
import argparse, datetime, json, os, pathlib, platform, subprocess, sys, tempfile, time

root = pathlib.Path(__file__).resolve().parent.parent
parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--samples", type=int, default=16)
parser.add_argument("--bounces", type=int, default=2)
parser.add_argument("--relumine", type=pathlib.Path, default=root / "target/release/relumine")
parser.add_argument("--more", type=pathlib.Path, nargs="*", default=[], help="other scenes to time connections on")
arguments = parser.parse_args()
scene, rig = root / "examples/chess/scene.toml", root / "benches/one_pass/rig.toml"
timer = root / "target/release/examples/time_connections"


def watched(words):
    """What a command said on stderr, its wall and CPU seconds, and its peak memory."""
    started = time.perf_counter()
    with tempfile.TemporaryFile("w+") as said:
        child = subprocess.Popen([str(word) for word in words], stderr=said)
        _, status, usage = os.wait4(child.pid, 0)
        said.seek(0)
        text = said.read()
    if status:
        sys.exit(f"{words[0]} failed: {text}")
    return text.strip(), {"wall_s": round(time.perf_counter() - started, 1), "cpu_s": round(usage.ru_utime + usage.ru_stime, 1),
                          "peak_rss_mb": round(usage.ru_maxrss / 1024)}


with tempfile.TemporaryDirectory() as work:
    field = pathlib.Path(work) / "paper.field"
    said, cost = watched([arguments.relumine, "render", scene, "--transfer", rig, "-o", field, "--samples", arguments.samples,
                          "--bounces", arguments.bounces])
    size = sum(path.stat().st_size for path in field.rglob("*") if path.is_file())
# Sixteen times the pixels: paths, connections and bytes grow with them, the scene is read once.
transfer = {**cost, "said": said, "field_mb": round(size / 1e6), "projected_1440x960_wall_min": round(16 * cost["wall_s"] / 60, 1)}
print(json.dumps(transfer, indent=1))

connections = {}
for each in [scene, *arguments.more]:
    words = [str(timer), str(each), "360", str(arguments.samples), str(arguments.bounces), "8"]
    connections[each.name] = json.loads(subprocess.run(words, capture_output=True, text=True, check=True).stdout)
    print(each.name, connections[each.name]["million_connections_a_second"], "million connections a second")

commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=root, capture_output=True, text=True).stdout.strip()
model = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), platform.machine())
report = {"date": datetime.datetime.now().isoformat(timespec="seconds"), "machine": f"{model}, {os.cpu_count()} cores",
          "load_average": os.getloadavg(), "commit": commit,
          "command": "benches/one_pass.py " + " ".join(f"{word}" for word in sys.argv[1:]).replace(str(root.parent), "…"),
          "grid": "32 x 7 positions, 16 x 16 squares", "pixels": "360 x 240", "samples": arguments.samples,
          "bounces": arguments.bounces, "transfer": transfer, "connections": connections}
path = root / f"benches/runs/{report['date'][:10]}-{commit}-one-pass.json"
path.write_text(json.dumps(report, indent=1) + "\n")
print(path)
