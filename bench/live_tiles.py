#!/usr/bin/env python3
"""How many pictures a second do N mirrors make together, each drawing tiles of the same states of a served scene?

Serves a scene, starts rtsg assemble --live and N mirrors of one thread each, for each N, and prints a row: pictures a
second; milliseconds from the first mirror's having a state to the last tile; milliseconds of CPU a picture, of all
mirrors together and of the program that joins them; megabytes of tiles a picture. What mirrors take together grows by
what each does for itself, which no number of mirrors divides; the last line fits a straight line to that.
"""
import argparse
import json
import os
import pathlib
import re
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[1]


class Programs:
    """Those that run; they end with this."""

    def __init__(self, program):
        self.program, self.running = str(program), []

    def start(self, *arguments):
        process = subprocess.Popen([self.program, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.running.append(process)
        return process

    def cpu(self, process):
        """Seconds, once it has ended."""
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        return used.ru_utime + used.ru_stime

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in self.running:
            if process.returncode is None:
                process.kill()
                process.wait()


def measure(program, scene, mirrors, tiles, seconds, looks):
    with Programs(program) as programs:
        server = programs.start("serve", scene, "--bind", "tcp://127.0.0.1:*", "--fps", "30", "--json")
        endpoint = json.loads(server.stdout.readline())["endpoint"]
        assembler = programs.start("assemble", "--live", "tcp://127.0.0.1:0", "--tiles", tiles, "--for", f"{seconds}s", "--json")
        door = json.loads(assembler.stdout.readline())["endpoint"]
        drawing = [programs.start("mirror", endpoint, "--tiles", door, "--threads", "1", *looks) for _ in range(mirrors)]
        report = json.loads(assembler.stdout.read().splitlines()[-1])
        pictures = max(report["pictures"], 1)
        return report | {"joining": programs.cpu(assembler) / pictures, "drawing": sum(map(programs.cpu, drawing)) / pictures}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/rtsg")
    parser.add_argument("--scene", type=pathlib.Path, default=ROOT / "examples/demo/hall.x3dv")
    parser.add_argument("--mirrors", default="1,2,3,4", help="numbers of mirrors")
    parser.add_argument("--tiles", default="4,3")
    parser.add_argument("--for", dest="seconds", type=float, default=10)
    parser.add_argument("--look", default="--size 640x360 --spp 16 --fps 30", help="options of rtsg mirror")
    arguments = parser.parse_args()
    looks = re.split(r"\s+", arguments.look)
    print("mirrors  pictures/s  ms a picture  CPU of mirrors, ms  of joining, ms  MB")
    rows = []
    for mirrors in map(int, arguments.mirrors.split(",")):
        report = measure(arguments.program, arguments.scene, mirrors, arguments.tiles, arguments.seconds, looks)
        rows.append((mirrors, 1e3 * report["drawing"]))
        megabytes = report["bytes"] / max(report["pictures"], 1) / 1e6
        print(f"{mirrors:>7}  {report['fps']:10.2f}  {1e3 * report['delay_s']:12.0f}  {1e3 * report['drawing']:18.1f}  {1e3 * report['joining']:14.2f}  {megabytes:.2f}", flush=True)
    if len(rows) > 1:
        mean = [sum(column) / len(rows) for column in zip(*rows)]
        slope = sum((n - mean[0]) * (ms - mean[1]) for n, ms in rows) / sum((n - mean[0]) ** 2 for n, _ in rows)
        print(f"a picture: {mean[1] - slope * mean[0]:.1f} ms are divided among the mirrors, and each takes {slope:.1f} ms for itself")


if __name__ == "__main__":
    main()
