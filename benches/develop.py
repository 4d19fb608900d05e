#!/usr/bin/env python3
"""How fast photographs become a field, into a dated run file in benches/runs/.

    benches/develop.py [--size 1440x960] [--samples 16] [--error 0.03] [--work DIR]

The board of examples/chess on the virtual rig, 16 × 16 squares as combs of spacing 3, white and black, 16 bits, a camera of
20,000 electrons full well and 6 electrons of reading: 98 photographs a position. Two captures:

    few       4 positions at the whole size: what a photograph of this size takes to develop, unpacked and packed
    many      the paper's 32 × 7 positions at a fraction of the size (--many-size): what a block of 64 × 64 pixels takes to pack
              when it has all its positions

Packing follows once, when all positions are developed, so a few positions bear a cost that hundreds share: the run file has
both, and what they make for the paper's 224 positions at the whole size. Beside the unpacked field stands what the disk gives a
plain write in the same round: an unpacked field is 20 MB a photograph. The photographs are made anew unless DIR has them.
Needs Linux and `cargo build --release`.
"""
import argparse, datetime, json, os, pathlib, platform, shutil, subprocess, sys, tempfile, threading, time

import rigs

root = pathlib.Path(__file__).resolve().parent.parent
parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--relumine", type=pathlib.Path, default=root / "target/release/relumine")
parser.add_argument("--size", default="1440x960")
parser.add_argument("--many-size", default="192x128")
parser.add_argument("--samples", type=int, default=16, help="paths a pixel of the photographs")
parser.add_argument("--error", type=float, default=0.03, help="what fields are packed to")
parser.add_argument("--rounds", type=int, default=3)
parser.add_argument("--threads", type=int, default=2)
parser.add_argument("--work", type=pathlib.Path, help="where captures lie, kept; default: temporary")
parser.add_argument("--runs", type=pathlib.Path, default=root / "benches/runs", help="where the run file goes")
arguments = parser.parse_args()
work = (arguments.work or pathlib.Path(tempfile.mkdtemp(prefix="relumine-develop-"))).resolve()
work.mkdir(parents=True, exist_ok=True)


def relumine(*words):
    return [str(arguments.relumine), "--quiet", "--threads", str(arguments.threads), *map(str, words)]


def capture(name, size, grid):
    """A capture, taken unless it is there."""
    place = work / name
    if not (place / "done").exists():
        shutil.rmtree(place, ignore_errors=True)
        description = work / f"{name}.toml"
        scene = root / "examples/chess/scene.toml"
        description.write_text(rigs.board(scene, size, grid, 16, "combs", arguments.samples, 2, 20.0, ("20_000", 6)))
        subprocess.run(relumine("plan", description, place), check=True)
        subprocess.run(relumine("capture", place), check=True)
        (place / "done").touch()
    return place


def seconds_of(usage):
    return usage.ru_utime + usage.ru_stime


def developed(place, *options):
    """Wall and CPU seconds, peak memory, bytes, and when all positions were done."""
    field, partial = work / "field", work / "field.partial"
    for old in (field, partial):
        shutil.rmtree(old, ignore_errors=True)
    os.sync()
    started = time.perf_counter()
    child = subprocess.Popen(relumine("develop", place, "-o", field, *options))
    packing = {}

    def watch():
        # The first packed block ends the development of positions.
        blocks = partial / "field/packed"
        while child.returncode is None and not packing:
            if blocks.exists() and any(blocks.rglob("*")):
                # utime and stime, fields 14 and 15.
                try:
                    fields = pathlib.Path(f"/proc/{child.pid}/stat").read_text().rsplit(")", 1)[1].split()
                except OSError:
                    return
                ticks = os.sysconf("SC_CLK_TCK")
                packing.update(wall_s=round(time.perf_counter() - started, 2),
                               cpu_s=round((int(fields[11]) + int(fields[12])) / ticks, 2))
            time.sleep(0.02)

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        sys.exit(f"develop ended with {child.returncode}")
    watcher.join()
    size = sum(path.stat().st_size for path in field.rglob("*") if path.is_file())
    report = {"wall_s": round(time.perf_counter() - started, 2), "cpu_s": round(seconds_of(usage), 2),
              "peak_rss_mb": round(usage.ru_maxrss / 1024), "bytes": size}
    if packing:
        report["positions"] = packing
    shutil.rmtree(field)
    return report


def disk_mb_s():
    """A plain write of 2 GiB that is on disk in the end: what the disk gives a field that is written."""
    block, path = os.urandom(1 << 26), work / "plain"
    started = time.perf_counter()
    with open(path, "wb", buffering=0) as file:
        for _ in range(32):
            file.write(block)
        os.fsync(file.fileno())
    took = time.perf_counter() - started
    path.unlink()
    return round(32 * len(block) / took / 1e6)


few, many = capture("few", arguments.size, "4x1"), capture("many", arguments.many_size, "32x7")
photographs = sum(1 for _ in open(few / "photographs.csv")) - 1
load = os.getloadavg()
rounds = []
for _ in range(arguments.rounds):
    rounds.append({"unpacked": developed(few), "minimum": developed(few, "--separation", "minimum"),
                   "packed": developed(few, "--error", arguments.error)})
    for report in rounds[-1].values():
        report["photographs_per_s"] = round(photographs / report["wall_s"], 2)
    rounds[-1]["unpacked"]["written_mb_s"] = round(rounds[-1]["unpacked"]["bytes"] / rounds[-1]["unpacked"]["wall_s"] / 1e6)
    rounds[-1]["unpacked"]["plain_write_mb_s"] = disk_mb_s()
    print({name: report["photographs_per_s"] for name, report in rounds[-1].items()})
of_many = developed(many, "--error", arguments.error)
blocks = lambda size: [-(-int(side) // 64) for side in size.split("x")]
across, down = blocks(arguments.many_size)
per_block = (of_many["cpu_s"] - of_many["positions"]["cpu_s"]) / (across * down)
across, down = blocks(arguments.size)
best = min(rounds, key=lambda report: report["packed"]["positions"]["wall_s"])["packed"]["positions"]
positions = 32 * 7
# Packing keeps all threads busy: blocks are independent.
whole = {"positions": positions, "photographs": photographs // 4 * positions,
         "develop_s": round(best["wall_s"] / 4 * positions), "pack_s": round(per_block * across * down / arguments.threads)}
whole["photographs_per_s"] = round(whole["photographs"] / (whole["develop_s"] + whole["pack_s"]), 2)

commit = subprocess.run(["git", "-C", root, "describe", "--always", "--dirty"], capture_output=True, text=True).stdout.strip()
cpu = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), platform.processor())
words = [f"--{name.replace('_', '-')} {value}" for name, value in vars(arguments).items()
         if name not in ("relumine", "work", "runs")]
report = {"date": datetime.datetime.now().isoformat(timespec="seconds"), "machine": f"{cpu}, {os.cpu_count()} cores",
          "load_average": load, "commit": commit, "command": " ".join(["benches/develop.py", *words]),
          "photographs": photographs, "rounds": rounds,
          "many": {**of_many, "pack_cpu_s_per_block": round(per_block, 3)}, "whole_from_parts": whole}
arguments.runs.mkdir(exist_ok=True)
path = arguments.runs / f"{datetime.date.today()}-{commit}-develop.json"
path.write_text(json.dumps(report, indent=1) + "\n")
print(json.dumps(report["many"]), json.dumps(whole), path, sep="\n")
if not arguments.work:
    shutil.rmtree(work)
