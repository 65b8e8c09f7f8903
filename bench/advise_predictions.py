#!/usr/bin/env python3
"""Are what `rtsg advise` says of pictures true? advise_predictions.py RTSG SCENE... [--size 240x135] [--time 8]

For each scene every setting that is not beaten is run by `rtsg render` with another seed. Its CPU time, less that of a picture of one pixel, is
compared with the cost that was predicted; its error against two long pictures by path with the predicted one and its interval. Prints a line for each
setting and the shares of costs within 30 %, of errors within 25 %, and of errors within their intervals.
"""
import argparse
import json
import math
import os
import pathlib
import re
import struct
import subprocess
import sys
import tempfile

import numpy as np


def cpu_of(arguments):
    """CPU seconds of a child, and whether it ended well."""
    child = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    return used.ru_utime + used.ru_stime, child.returncode == 0


def pixels(picture):
    """Red, green and blue of an .exr, by way of a TIFF without compression (Adobe, TIFF 6.0, section 2)."""
    tiff = picture.with_suffix(".tif")
    subprocess.run(["oiiotool", str(picture), "--ch", "R,G,B", "--compression", "none", "-o", str(tiff)], check=True, capture_output=True)
    data = tiff.read_bytes()
    order = "<" if data[:2] == b"II" else ">"
    place, = struct.unpack_from(order + "I", data, 4)
    count, = struct.unpack_from(order + "H", data, place)
    tags = {}
    for i in range(count):
        tag, kind, number = struct.unpack_from(order + "HHI", data, place + 2 + 12 * i)
        at = place + 10 + 12 * i
        code, size = {3: ("H", 2), 4: ("I", 4)}.get(kind, ("B", 1))
        if number * size > 4:
            at, = struct.unpack_from(order + "I", data, at)
        tags[tag] = struct.unpack_from(f"{order}{number}{code}", data, at) if kind in (3, 4) else ()
    width, height = tags[256][0], tags[257][0]
    bytes_ = b"".join(data[at:at + size] for at, size in zip(tags[273], tags[279]))
    return np.frombuffer(bytes_, order + "f4").reshape(height, width, 3).astype(float)


class Judge:
    def __init__(self, program, scene, size, folder):
        self.program, self.scene, self.size, self.folder = program, scene, size, pathlib.Path(folder)

    def render(self, options, seed):
        out = self.folder / "picture.exr"
        out.unlink(missing_ok=True)
        used, _ = cpu_of([self.program, "render", self.scene, "-o", str(out), "--size", self.size, "--seed", str(seed), *options])
        return (pixels(out), used) if out.exists() else (None, used)

    def start(self):
        """What a picture costs beside its pixels."""
        return min(cpu_of([self.program, "render", self.scene, "-o", str(self.folder / "one.exr"), "--size", "1x1", "--spp", "1"])[0] for _ in range(3))

    def lines(self, trials):
        longest = max([int(found[1]) for one in trials if (found := re.search(r"path --spp (\d+)", one["setting"]))] or [64])
        samples = str(min(4 * longest, 1024))
        a, b = (self.render(["--integrator", "path", "--spp", samples], seed)[0] for seed in (1001, 1002))
        if a is None or b is None:
            return
        start, mean = self.start(), float((a + b).mean()) / 2
        for one in trials:
            picture, used = self.render(one["setting"].split(), 7)
            if picture is None or one["error"] is None or not mean > 0:
                continue
            square = float(((picture - a) * (picture - b)).mean())
            yield one, max(used - start, 1e-9), math.sqrt(max(square, 0)) / mean


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--size", default="240x135")
    parser.add_argument("--time", default="8")
    arguments = parser.parse_args()
    costs, errors, held, spent = [], [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for scene in arguments.scenes:
            done = subprocess.run([arguments.program, "advise", scene, "--for", "pictures", "--size", arguments.size, "--time", f"{arguments.time}s", "--json"],
                                  capture_output=True, text=True, check=False)
            try:
                advice = json.loads(done.stdout)
            except ValueError:
                print(f"{scene}: no advice (status {done.returncode}): {done.stderr.strip()[:120]}", flush=True)
                continue
            spent.append(advice["seconds"])
            trials = [one for table in advice["tables"] for one in table["trials"] if not one["beaten"]]
            for one, cost, error in Judge(arguments.program, scene, arguments.size, folder).lines(trials):
                said = one["costs"][0]
                if max(said, cost) > .05:  # below that the start of a program hides it
                    costs.append(cost / said)
                if one["error"] > 1e-4:
                    errors.append(error / one["error"])
                    if one["ci95"]:
                        held.append(abs(error - one["error"]) <= one["ci95"])
                print(f"{pathlib.Path(scene).name:28} {one['setting']:52} {'predicted' if one['predicted'] else 'measured':9} cost {said:8.4f} {cost:8.4f} "
                      f"error {one['error']:8.4f} {error:8.4f} +- {one['ci95'] or 0:.4f}", flush=True)
    within = lambda ratios, part: sum(1 / (1 + part) <= r <= 1 + part for r in ratios)
    print(f"{len(spent)} scenes; measuring took at most {max(spent, default=0):.1f} s of {arguments.time}")
    print(f"costs within 30 %: {within(costs, .3)} of {len(costs)}; errors within 25 %: {within(errors, .25)} of {len(errors)}; in their intervals: {sum(held)} of {len(held)}")


if __name__ == "__main__":
    sys.exit(main())
