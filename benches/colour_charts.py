#!/usr/bin/env python3
"""Calibrates on the two real chart photographs in every way there is, and fits plain least squares to the same patches.

    benches/colour_charts.py DATA [--relumine PATH] [--commit COMMIT]

DATA holds cc_charts/ and cc_reference/. Writes a dated run file in benches/runs/ and prints its figures as the table of
docs/colour.md. The reference in the last column is a 3 x 3 matrix by linear least squares in XYZ with numpy, exposure fitted,
its colour differences by colour-science (`pip install numpy colour-science`).
"""
import argparse, datetime, hashlib, json, os, pathlib, platform, subprocess, tempfile

import colour, numpy

here = pathlib.Path(__file__).parent
parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("data", type=pathlib.Path)
parser.add_argument("--relumine", type=pathlib.Path, default=here.parent / "target/release/relumine")
parser.add_argument("--commit", help="what the binary was built from, if not from the tree as it is")
arguments = parser.parse_args()
charts, references = arguments.data / "cc_charts", arguments.data / "cc_reference"
WHITE = [0.9642, 1.0, 0.8249]


def xyz_of_lab(lab):
    f = (lab[0] + 16) / 116
    f = numpy.array([f + lab[1] / 500, f, f - lab[2] / 200])
    return WHITE * numpy.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29))


def lab_of_xyz(xyz):
    ratio = xyz / WHITE
    f = numpy.where(ratio > (6 / 29) ** 3, numpy.cbrt(ratio), ratio / (3 * (6 / 29) ** 2) + 4 / 29)
    return numpy.stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], 1)


def least_squares(patches):
    """Mean delta E 2000 of the plain fit to what relumine measured."""
    camera = numpy.array([patch["camera"] for patch in patches])
    labs = numpy.array([patch["reference_lab"] for patch in patches])
    xyz = numpy.array([xyz_of_lab(lab) for lab in labs])
    matrix = numpy.linalg.lstsq(camera, xyz, rcond=None)[0]
    return float(numpy.mean(colour.delta_E(lab_of_xyz(camera @ matrix), labs, method="CIE 2000")))


def sg_table(work, name):
    patches = json.loads((references / "colour_science_colourcheckers.json").read_text())[name]["patches"]
    rows = "".join(f"{patch} {x * 100:.6f} {y * 100:.6f} {z * 100:.6f}\n" for patch, ((x, y, z)) in
                   ((patch, values["XYZ"]) for patch, values in patches.items()))
    path = work / (name.replace(" ", "_") + ".cie")
    path.write_text("BEGIN_DATA_FORMAT\nSAMPLE_ID XYZ_X XYZ_Y XYZ_Z\nEND_DATA_FORMAT\nBEGIN_DATA\n" + rows + "END_DATA\n")
    return path


runs = []
with tempfile.TemporaryDirectory() as work:
    work = pathlib.Path(work)
    sg = ["--chart", "sg", "--reference"]
    cases = [
        ("passport.jpg", "24", "X-Rite, built in", []),
        ("passport.jpg", "24", "ColorCheckerPassport.cie", ["--reference", references / "ColorCheckerPassport.cie"]),
        ("dsg.png", "24", "X-Rite, built in", []),
        ("dsg.png", "SG", "before November 2014", [*sg, sg_table(work, "ColorCheckerSG - Before November 2014")]),
        ("dsg.png", "SG", "after November 2014", [*sg, sg_table(work, "ColorCheckerSG - After November 2014")]),
        ("dsg.png", "SG", "ColorCheckerSG.ti2, lightest patch white",
         [*sg, references / "ColorCheckerSG.ti2", "--illuminant", "lightest-patch"]),
    ]
    print("| photograph | chart | reference | model | patches | before | after | held out | largest after | least squares |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for photograph, chart, reference, words in cases:
        for model in ("matrix", "root-polynomial"):
            done = subprocess.run([str(arguments.relumine), "calibrate", "colour", str(charts / photograph), "--response", "srgb",
                                   "-o", str(work / "c.toml"), "--force", "--json", "--model", model, *map(str, words)],
                                  check=True, capture_output=True, text=True)
            report = json.loads(done.stdout)
            errors = report["delta_e_2000"]
            plain = least_squares(report["patches"])
            runs.append({"photograph": photograph, "chart": chart, "reference": reference, "model": model,
                         "corners": report["corners"], "found": report["found"], "left_out": report["left_out"],
                         "delta_e_2000": errors, "delta_e_2000_of_least_squares": plain,
                         "said": [line for line in done.stderr.splitlines() if " found: " in line]})
            figures = [f"{errors[name][kind]:.2f}" for name, kind in
                       (("before", "mean"), ("after", "mean"), ("held_out", "mean"), ("after", "max"))]
            print("|", " | ".join([photograph, chart, reference, model, str(len(report["patches"])), *figures,
                                   f"{plain:.2f}" if model == "matrix" else ""]), "|")

git = subprocess.run(["git", "-C", str(here), "describe", "--always", "--dirty"], capture_output=True, text=True)
commit = arguments.commit or git.stdout.strip()
cpu = next((line.split(":")[1].strip() for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines()
            if line.startswith("model name")), platform.processor())
report = {"date": datetime.datetime.now().isoformat(timespec="seconds"), "machine": f"{cpu}, {os.cpu_count()} cores",
          "load_average": os.getloadavg(), "commit": commit,
          "binary_sha256": hashlib.sha256(arguments.relumine.read_bytes()).hexdigest()[:16],
          "command": "benches/colour_charts.py", "colour_science": colour.__version__, "runs": runs}
path = here / "runs" / f"{datetime.date.today()}-{commit}-colour-charts.json"
path.write_text(json.dumps(report, indent=1) + "\n")
