"""Prints a log or a scene file, read in Python alone, as lines of JSON: the head, each state, damaged places, a summary.

    python3 -m rtsg FILE [--values]
"""
import json
import os
import sys

from . import Error, pure


def print_log(path, shows_values):
    """A line for the head, for each state, for each damaged place, and a summary."""
    log, more = pure.Log(path), True
    if log.head:
        print(json.dumps({"head": log.head.version, "epoch": log.head.epoch, "creator": log.head.creator, "types": log.head.builtin,
                          "mode": ("state", "input", "lossy")[log.head.mode], "error": log.head.error}))
    while more:
        record = log.record
        print(json.dumps({"state": record.to, "from": record.origin, "t": record.time, "hash": log.scene.hash, "as_recorded": log.scene.hash == record.hash,
                          **({"scene": log._decoder.catalogued} if record.kind == pure._SCENE else {}), "blocks": log.counts}))
        try:
            more = log.step()
        except pure.FormatError as error:
            print(json.dumps({"error": str(error)}))
    for place in log.damage:
        print(json.dumps({"damage": place.offset, "length": place.length}))
    scene = log.scene
    summary = {"frames": log.reached, "verified": log.verified, "gaps": log.gaps, "closed": log.was_closed, "nodes": len(scene),
               "routes": sum(len(inside.routes) for inside in scene._nodes.values()), "state": scene.number}
    if shows_values:
        dump = scene.dump()["nodes"]
        summary["values"] = {f"{scene._label(int(n))}.{field}": value for n, node in dump.items() for field, value in node["fields"].items()}
    print(json.dumps(summary))
    return 0 if log.verified == log.reached else 1


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("usage: python3 -m rtsg FILE [--values]")
    try:
        status = print_log(sys.argv[1], "--values" in sys.argv[2:])
        sys.stdout.flush()
        sys.exit(status)
    except Error as error:
        sys.exit(f"{error}")
    except BrokenPipeError:  # whoever read has what it wanted; nothing more may be written, at the end either
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
