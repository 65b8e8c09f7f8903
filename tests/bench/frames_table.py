#!/usr/bin/env python3
"""The table of docs/accuracy-and-speed.md from what `rtsg chart frames -o DIR` wrote: frames_table.py DIR"""
import csv
import pathlib
import sys

folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "docs/charts")
MAPPINGS = ["hybrid", "merged", "perShape"]


def load(name):
    rows = {}
    with open(folder / f"frames-{name}.csv", newline="") as file:
        for series, scene, value, _ in list(csv.reader(file))[1:]:
            rows.setdefault(scene, {})[series] = float(value)
    return rows


def number(value, form="{:.3g}"):
    return "–" if value is None else f"{value:,.0f}" if value >= 1000 else form.format(value)


update, rays, total = load("update"), load("rays"), load("total")
print("| scene | follow a frame, hybrid (µs) | full traversal (µs) | bare commit or refit (µs) "
      "| rays, hybrid / merged / per Shape (1 = `rtcIntersect16`, one flat scene) "
      "| follow and trace, hybrid / merged / per Shape / full traversal (ms) |")
print("|---|---|---|---|---|---|")
for scene, frame in total.items():
    follow = update.get(scene, {})
    cells = [scene, number(follow.get("hybrid")) if follow else "still",
             number(follow.get("full traversal")), number(follow.get("bare Embree")),
             " / ".join(number(rays.get(scene, {}).get(m), "{:.2f}") for m in MAPPINGS),
             " / ".join(number(frame.get(m), "{:.1f}") for m in MAPPINGS + ["full traversal"])]
    print("| " + " | ".join(cells) + " |")
