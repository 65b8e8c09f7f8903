#!/usr/bin/env python3
"""What a change of the acoustic tracer does to the figures of rooms: heard_difference.py RTSG OTHER_RTSG [SCENE...]

Both programs measure the same places of the same scenes with the same rays. For each scene it prints how many figures
differ by more than half a just noticeable difference, the 95th percentile and the largest, with its place: EDT and T20
(5 %), C80 and G (1 dB), D50 and LF (.05), Ts (10 ms) and early IACC (.075), in octaves from 125 Hz to 4 kHz.
"""
import json
import pathlib
import subprocess
import sys
import tempfile

BANDS = range(2, 8)
NOTICEABLE = {"EDT_s": .05, "T20_s": .05, "C80_db": 1, "G_db": 1, "D50": .05, "LF": .05, "Ts_s": .01, "IACC_early": .075}
RELATIVE = {"EDT_s", "T20_s"}
ROOT = pathlib.Path(__file__).resolve().parent.parent


def look(absorption, diffuse):
    rest = 1 - absorption
    return (f"appearance Appearance {{ material Material {{}} acousticProperties AcousticProperties {{ absorption {absorption} "
            f"diffuse {rest * diffuse:.4f} specular {rest * (1 - diffuse):.4f} }} }}")


def shape(at, geometry, absorption=.3, diffuse=.2, turned=""):
    return f"Transform {{ translation {at[0]} {at[1]} {at[2]} {turned} children Shape {{ {look(absorption, diffuse)} geometry {geometry} }} }}\n"


def box(low, high, absorption=.3, diffuse=.2, solid="TRUE"):
    size = " ".join(f"{b - a:.6g}" for a, b in zip(low, high))
    return shape([(a + b) / 2 for a, b in zip(low, high)], f"Box {{ size {size} solid {solid} }}", absorption, diffuse)


def column(x, y, z, radius, height, turned=""):
    return shape((x, y, z), f"Cylinder {{ radius {radius} height {height} }}", .05, .1, turned)


def sheet(corners, absorption=.3):
    points = ", ".join(" ".join(map(str, corner)) for corner in corners)
    return (f"Shape {{ {look(absorption, .2)} geometry IndexedFaceSet {{ solid FALSE coordIndex [ 0 1 2 3 -1 ] "
            f"coord Coordinate {{ point [ {points} ] }} }} }}\n")


def grid(low, high, n):
    """A box whose faces are n by n quads."""
    numbers, faces = {}, []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for end in (low, high):
            for i in range(n):
                for k in range(n):
                    face = []
                    for di, dk in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        p = [0, 0, 0]
                        p[axis] = end[axis]
                        p[u] = round(low[u] + (high[u] - low[u]) * (i + di) / n, 6)
                        p[v] = round(low[v] + (high[v] - low[v]) * (k + dk) / n, 6)
                        face.append(numbers.setdefault(tuple(p), len(numbers)))
                    faces.append(face if end is high else face[::-1])
    points = ", ".join(" ".join(map(str, p)) for p in numbers)
    indices = " ".join(" ".join(map(str, face)) + " -1" for face in faces)
    return f"Shape {{ {look(.3, .2)} geometry IndexedFaceSet {{ coord Coordinate {{ point [ {points} ] }} coordIndex [ {indices} ] }} }}\n"


def source(name, at):
    return f"Transform {{ translation {at[0]} {at[1]} {at[2]} children DEF {name} SpatialSound {{ children OscillatorSource {{}} }} }}\n"


def office():
    text = box((0, 0, 0), (12, 2.8, 8), .3, .2, "FALSE")
    for x in (3, 6, 9):
        text += box((x - .03, 0, 1), (x + .03, 1.5, 7), .4)
        for z in (2, 4, 6):
            text += box((x + .4, .7, z - .8), (x + 1.2, .74, z + .8), .1, .1)
            for leg in ((.43, -.75), (.43, .7), (1.12, -.75), (1.12, .7)):
                text += box((x + leg[0], 0, z + leg[1]), (x + leg[0] + .05, .7, z + leg[1] + .05), .1, .1)
    return text + source("A", (2, 1.2, 4)) + source("B", (7.9, 1.2, 2)), [
        (2.4, 1.2, 6), (4.9, 1.2, 4), (4.9, 1.2, 2.1), (7.9, 1.2, 4), (10.8, 1.2, 4), (10.8, 1.2, 6), (5.5, 1.7, .5)]


def rows():
    """Screens as high as heads."""
    text = box((0, 0, 0), (14, 2.8, 8), .4, .2, "FALSE") + box((.01, 2.76, .01), (13.99, 2.79, 7.99), .8, .1)
    for x in (4, 6, 8):
        text += box((x - .02, 0, .5), (x + .02, 1.2, 7.5))
    return text + source("A", (2.5, 1.2, 4)) + source("B", (2.5, 1.3, 3)), [
        (5, 1.2, 4), (7, 1.2, 4), (9.5, 1.2, 4), (9.5, 1.25, 3.2), (7, 1.3, 5), (11, 1.5, 4)]


def screens(kind):
    text = box((0, 0, 0), (12, 2.8, 8), .4, .2, "FALSE")
    for x in (4, 7):
        if kind == "grid":
            text += grid((x - .03, 0, .8), (x + .03, 1.5, 7), 8)
        elif kind == "panels":
            text += "".join(box((x - .03, 0, z), (x + .03, 1.5, min(7, z + 1.02))) for z in range(1, 7))
        else:
            text += sheet([(x, x / 10 - .4, 1), (x, 1.5, 1), (x, 1.5, 7), (x, x / 10 - .4, 7)])
    return text + source("A", (2, 1.2, 4)) + source("B", (4, 1.2, .6)), [
        (5.5, 1.2, 4), (5.5, 1.2, 2), (9, 1.2, 4), (9, 1.3, 6), (4, 1.2, 7.3), (7, 1.2, 7.5), (9, 1.2, .5)]


def aligned():
    """Places in the planes of faces."""
    text = box((0, 0, 0), (12, 3.2, 9), .5, .2, "FALSE") + box((4, 0, 3), (5, 2, 5)) + box((7, 0, 2), (7.5, 1.5, 6))
    return text + source("A", (2, 1.5, 3)) + source("B", (2, 2, 4)), [
        (8, 1.5, 3), (6, 1.5, 3), (9, 2, 4), (9, 1.5, 4), (6, 1.5, 5), (4, 1.5, 7), (7, 1.5, 7)]


def street():
    text = sheet([(-60, 0, -60), (60, 0, -60), (60, 0, 60), (-60, 0, 60)], .05)
    text += box((-30, 0, 6), (-3, 12, 16), .1) + box((3, 0, 6), (30, 12, 16), .1) + box((-30, 0, -16), (30, 9, -6), .1)
    text += box((-2, .3, 1), (2, 1, 2.7), .1, .1) + box((-1, 1, 1.1), (1.2, 1.45, 2.6), .1, .1)  # a car
    for x in (-1.3, 1.3):
        for z in (1.05, 2.65):
            text += column(x, .31, z, .31, .2, "rotation 1 0 0 1.5708")
    text += box((5, 0, -4), (7, 2.4, -2), .1, .1) + box((-9, 0, -5.9), (-8, 2.2, -4.5), .1, .1)
    text += column(-5, 2, 3, .1, 4) + column(8, 1.5, 3.5, .35, 3) + box((12, 0, -2.05), (20, 2, -1.95), .2, .1)
    return text + source("A", (0, 1.5, -1)) + source("B", (-7, 1.2, -3)), [
        (0, 1.5, 4.5), (8.6, 1.6, -3), (0, 1.6, 12), (4.5, 1.6, 9), (9.5, 1.5, 5), (-9.5, 1.5, -5), (16, 1.5, -4), (0, .8, 4)]


def columns():
    text = box((0, 0, 0), (20, 7, 14), .1, .2, "FALSE") + box((7, 0, 5), (9, 1, 9), .2, .3)
    text += "".join(column(x, 3.5, z, .4, 7) for x in (4, 8, 12, 16) for z in (3, 11))
    text += shape((14, 2, 7), "Sphere { radius .5 }", .1, .1)
    return text + source("A", (2, 1.6, 2.9)), [
        (6, 1.6, 3.1), (10, 1.6, 3.1), (14, 1.6, 2), (18, 1.6, 11), (10, 1.2, 7), (15, 1.9, 9.5), (18, 1.6, 3)]


def small_room():
    text = box((0, 0, 0), (8, 3.5, 6), .25, .1, "FALSE") + column(4, 1.75, 3, .3, 3.5) + column(2.5, 1.75, 1.2, .15, 3.5)
    return text + box((5.5, 0, .8), (6.1, 2, 1.4), .1, .1) + source("A", (2, 1.5, 3.1)), [
        (6, 1.5, 2.9), (6, 1.5, 3.4), (5, 1.5, 2.5), (4.6, 1.3, 3.05), (3.2, 1.5, .4), (7, 1.2, .9), (6, 1.5, 4)]


def doorway():
    text = box((0, 0, 0), (8, 2.8, 5), .15, .2, "FALSE") + box((6, .7, 1), (7.4, .74, 1.8), .1, .1)
    text += box((3.95, 0, 0), (4.05, 2.8, 2)) + box((3.95, 0, 2.9), (4.05, 2.8, 5)) + box((3.95, 2.1, 2), (4.05, 2.8, 2.9))
    return text + source("A", (1.5, 1.5, 1)), [(5, 1.5, .8), (6, 1.5, 4), (7, 1.2, 1.4), (4.8, 1.5, 2.5), (2.5, 1.2, 4)]


SCENES = {"office": office, "screens at head's height": rows, "screens of many quads": lambda: screens("grid"),
          "screens of panels": lambda: screens("panels"), "sheets": lambda: screens("sheets"), "in planes of faces": aligned,
          "street": street, "hall with columns": columns, "room with a column": small_room, "doorway": doorway,
          "demo hall": lambda: (None, [(1.7, 1.95, 5.6), (-4.6, 1.7, 2), (0, 1.2, 3), (-2, 1.6, -4.5), (4.5, 1.6, -2), (1, .5, -1.2)])}


def measured(program, scene, places, out):
    command = [program, "listen", str(scene), "--report", str(out), "--rays", "20000"]
    for place in places:
        command += ["--place", "%g %g %g" % place]
    subprocess.run(command, check=True, capture_output=True)
    return {(pair["source"], tuple(pair["listener_position"])): pair for pair in json.loads(out.read_text())["pairs"]}


def differences(a, b):
    for pair, one in a.items():
        for figure, noticeable in NOTICEABLE.items():
            for band in BANDS:
                x, y = one[figure][band], b[pair][figure][band]
                if x is None and y is None:
                    continue
                off = 99.0 if x is None or y is None else abs(x - y) / noticeable / (abs(x) if figure in RELATIVE else 1)
                yield off, f"{figure} in octave {band} of {pair[0]} at {pair[1]}: {x} and {y}"


def main(arguments):
    if len(arguments) < 2 or not set(arguments[2:]) <= set(SCENES):
        sys.exit(f"{__doc__}\nScenes: {', '.join(SCENES)}")
    print(f"{'scene':26}{'figures':>8}{'over .5':>9}{'p95':>7}{'worst':>7}")
    with tempfile.TemporaryDirectory() as folder:
        for name in arguments[2:] or SCENES:
            text, places = SCENES[name]()
            scene = pathlib.Path(folder) / "scene.x3dv" if text else ROOT / "examples/demo/hall.x3dv"
            if text:
                scene.write_text("#X3D V4.0 utf8\nPROFILE Full\n" + text)
            out = pathlib.Path(folder) / "report.json"
            off = sorted(differences(*(measured(program, scene, places, out) for program in arguments[:2])), reverse=True)
            over = sum(one[0] > .5 for one in off)
            print(f"{name:26}{len(off):8}{over:9}{off[len(off) // 20][0]:7.2f}{off[0][0]:7.2f}  {off[0][1]}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
