"""Rig descriptions that several benches write."""

# Full well and read noise of a camera without noise, electrons.
NOISELESS = ("1e10", 0)


def board(scene, size, grid, squares, scheme, samples, bounces, exposure_s, electrons):
    """`rig.toml` of a simulated rig about a board: grid AZIMUTHSxTILTS, electrons (full well, read noise)."""
    azimuths, tilts = grid.split("x")
    full_well, read_noise = electrons
    width, height = size.split("x")
    patterns = 'scheme = "combs"\nspacing = 3' if scheme == "combs" else 'scheme = "squares"'
    # A black level above zero, as cameras have it: below zero the noise of dark pixels would be cut off by the camera.
    return f"""format = "relumine-rig/1"

[hemisphere]
radius_m = 4.0
azimuths = {azimuths}
tilts = {tilts}
object_radius_m = 0.89

[projector]
squares = {squares}
half_width = 0.23
intensity_w_sr = 50

[patterns]
{patterns}

[camera]
width = {width}
height = {height}
response = "linear"
black_level = 1024
white_level = 65535
exposures_s = [{exposure_s}]

[drivers]
stage = "simulated"
projector = "simulated"
camera = "simulated"

[simulated]
scene = "{scene}"
samples = {samples}
bounces = {bounces}
seed = 0
projector_black = 0.002

[simulated.sensor]
full_well_e = {full_well}
read_noise_e = {read_noise}
bits = 16
"""
