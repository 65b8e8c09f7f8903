"""kill -9 of each verb that writes, at a random moment: what it wrote is absent, complete, or for logs readable and named as partial."""
import json
import os
import pathlib
import random
import re
import shutil
import signal
import struct
import subprocess
import time

from tries_support import PATIENCE, Fault, run, wait_for

SCENE = """#X3D V4.0 utf8
PROFILE Full
DEF CLOCK TimeSensor { cycleInterval 2 loop TRUE }
DEF PATH PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 4 0 0 ] }
DEF BOX Transform { children Shape { appearance Appearance { material Material { diffuseColor 1 0 0 } } geometry Box { } } }
Sound { source AudioClip { url "tone.wav" loop TRUE } }
ROUTE CLOCK.fraction_changed TO PATH.set_fraction
ROUTE PATH.value_changed TO BOX.translation
"""
# A verb with what it writes: the arguments, and the names of the results (a pattern).
RECORD = ["record", "scene.x3dv", "-o", "out.rlog", "--for", "30s"]
VERBS = {
    "record": (RECORD, r"out\.rlog"),
    "run --save": (["run", "scene.x3dv", "--for", "20s", "--save", "out.x3d"], r"out\.x3d"),
    "run --listen": (["run", "scene.x3dv", "--for", "2s", "--listen", "out.wav", "--rays", "500"], r"out\.wav"),
    "run --render": (["run", "scene.x3dv", "--for", "1s", "--fps", "20", "--render", "out%02d.png", "--size", "64x64", "--spp", "1"], r"out\d\d\.png"),
    "render": (["render", "scene.x3dv", "-o", "out.png", "--size", "320x240"], r"out\.png"),
    "render .exr": (["render", "scene.x3dv", "-o", "out.exr", "--size", "200x160", "--layers", "all"], r"out\.exr"),
    "render .mp4": (["render", "scene.x3dv", "-o", "out.mp4", "--frames", "25", "--size", "128x96", "--spp", "1"], r"out\.mp4"),
    "render .gif": (["render", "scene.x3dv", "-o", "out.gif", "--frames", "15", "--size", "128x96", "--spp", "1"], r"out\.gif"),
    "listen": (["listen", "scene.x3dv", "-o", "out.wav", "--for", "3s", "--rays", "500"], r"out\.wav"),
    "listen --ir": (["listen", "scene.x3dv", "--ir", "out.wav", "--rays", "5000"], r"out\.wav"),
    "convert": (["convert", "big.x3dv", "out.x3d"], r"out\.x3d"),
    "convert .rtsgb": (["convert", "big.x3dv", "out.rtsgb"], r"out\.rtsgb"),
    "convert .json.gz": (["convert", "big.x3dv", "out.json.gz"], r"out\.json\.gz"),
    "replay --save": (["replay", "in.rlog", "--save", "out.x3dv"], r"out\.x3dv"),
    "replay --export": (["replay", "in.rlog", "--export", "out.mcap"], r"out\.mcap"),
    "replay --table": (["replay", "in.rlog", "--table", "BOX.translation", "-o", "out.csv"], r"out\.csv"),
    "replay --compact": (["replay", "in.rlog", "--compact", "out.rlog", "--every", "2"], r"out\.rlog"),
    "merge": (["merge", "in.rlog", "in.rlog", "-o", "out.rlog", "--apart", "5"], r"out\.rlog"),
}


def tone():
    samples = struct.pack("<8000h", *(8000 * (1 if i // 20 % 2 else -1) for i in range(8000)))
    return b"RIFF" + struct.pack("<I", 36 + len(samples)) + b"WAVEfmt " + struct.pack("<IHHIIHH", 16, 1, 1, 8000, 16000, 2, 16) + b"data" + \
        struct.pack("<I", len(samples)) + samples


def content(path):
    """What must be equal in two runs: not the times and notes in PNG, GIF or logs."""
    data = path.read_bytes()
    if path.suffix == ".png":
        return re.sub(rb"....iTXt.*?(?=....(?:IDAT|IEND|iTXt))", b"", data, flags=re.DOTALL)
    return data


def children_of(session):
    """The processes that the killed one has left."""
    left = []
    for folder in pathlib.Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                fields = (folder / "stat").read_text().rsplit(")", 1)[1].split()
            except OSError:
                continue
            if int(fields[3]) == session and fields[0] != "Z":
                left.append(int(folder.name))
    return left


class Verb:
    def __init__(self, test, name):
        self.test, self.name, (self.arguments, pattern) = test, name, VERBS[name]
        self.pattern, self.folder = re.compile(pattern), test.folder / "killed"
        begun = time.monotonic()
        self.fresh()
        status, _, err = self.execute()
        if status != 0:
            raise Fault(f"{name}: status {status} without a kill: {err[-300:]}")
        self.seconds = time.monotonic() - begun
        self.whole = {path.name: content(path) for path in self.results()}

    def fresh(self):
        shutil.rmtree(self.folder, ignore_errors=True)
        shutil.copytree(self.test.folder / "inputs", self.folder)

    def execute(self, *more):
        process = subprocess.run([self.test.program, *self.arguments, *more], cwd=self.folder, capture_output=True, text=True, errors="replace",
                                 timeout=PATIENCE, check=False)
        return process.returncode, process.stdout, process.stderr

    def results(self):
        return sorted(path for path in self.folder.iterdir() if self.pattern.fullmatch(path.name))

    def kill(self, seconds, *more):
        process = subprocess.Popen([self.test.program, *self.arguments, *more], cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                   start_new_session=True)
        try:
            process.wait(seconds)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.wait()
        if not wait_for(lambda: not children_of(process.pid), 20):
            for one in children_of(process.pid):
                os.kill(one, signal.SIGKILL)
            raise Fault(f"{self.name}: processes outlive it")
        return process.returncode

    def check(self, was_killed, before):
        """What lies there is whole, or what was there before, or a log that names itself as partial."""
        for path in self.results():
            if content(path) == self.whole.get(path.name):
                continue
            if before.get(path.name) == path.read_bytes():
                continue
            if path.suffix != ".rlog":
                self.test.sent = [path.read_bytes()]
                raise Fault(f"{self.name}: {path.name} is neither whole nor absent")
            status, out, err = run(self.test.program, "replay", path, "--verify", "--json")
            report = json.loads(out.strip().rsplit("\n", 1)[-1]) if out.strip() else {}
            good = status == 0 if report.get("closed") else status == 1 and "error" in err
            if not good or report and (report["frames"] != report["verified"] or report["damaged"]):
                self.test.sent = [path.read_bytes()]
                raise Fault(f"{self.name}: a log that cannot be read to its last record: status {status} {out[-300:]} {err[-300:]}")
        if not was_killed and {path.name for path in self.results()} != set(self.whole):
            raise Fault(f"{self.name}: it ended by itself, and {sorted(self.whole)} are not all there")

    def again(self):
        """The next run makes the whole result, whatever lies about, and leaves nothing else."""
        status, _, err = self.execute("--force") if self.arguments[0] not in ("render", "listen") else self.execute()
        if status != 0:
            raise Fault(f"{self.name}: the next run has status {status}: {err[-300:]}")
        for path in self.results():
            if path.suffix != ".rlog" and content(path) != self.whole.get(path.name):
                raise Fault(f"{self.name}: the next run makes another {path.name}")
        if {path.name for path in self.results()} != set(self.whole):
            raise Fault(f"{self.name}: the next run makes {[path.name for path in self.results()]}")


def killed(test):
    """Each verb that writes is killed at a random moment; a third of the runs replaces results that are there."""
    inputs = test.folder / "inputs"
    inputs.mkdir()
    (inputs / "scene.x3dv").write_text(SCENE)
    (inputs / "tone.wav").write_bytes(tone())
    points = ", ".join(f"{i} {i % 7} {i % 11}" for i in range(60000))
    (inputs / "big.x3dv").write_text("#X3D V4.0 utf8\nPROFILE Full\nShape { geometry PointSet { coord Coordinate { point [ " + points + " ] } } }\n")
    run(test.program, "record", inputs / "scene.x3dv", "-o", inputs / "in.rlog", "--for", "10s")
    count = max(1, test.tries // 10)
    short = test.tries < 100
    for name in (dict.fromkeys(["record", "convert", "render"]) if short else VERBS):
        verb, hit, litter, kept = Verb(test, name), 0, 0, 0
        for test.number in range(test.first, test.first + (count if not short else 2)):
            dice = random.Random(f"{test.seed}/killed/{name}/{test.number}")
            verb.fresh()
            before, more = {}, []
            if dice.random() < .33 and "%" not in " ".join(verb.arguments):
                old = verb.folder / next(iter(verb.whole))
                old.write_bytes((inputs / "in.rlog").read_bytes() if old.suffix == ".rlog" else b"an older one")
                before, more = {old.name: old.read_bytes()}, [] if verb.arguments[0] in ("render", "listen") else ["--force"]
            names = {path.name for path in inputs.iterdir()} | set(verb.whole)
            try:
                status = verb.kill(dice.uniform(0, 1.1 * verb.seconds), *more)
                # Other programs make it slower and faster: most kills shall come before its end.
                verb.seconds *= .6 if status >= 0 else 1.1
                hit += status < 0
                verb.check(status != 0, before)
                kept += bool(verb.results())
                litter += bool({path.name for path in verb.folder.iterdir()} - names)
                if before and not verb.results():
                    raise Fault(f"{name}: what was there is gone")
                if dice.random() < .2:
                    verb.again()
            except Fault as fault:
                test.fault(str(fault))
                if test.faults > 30:
                    return
            test.done += 1
        print(f"killed: {name}: {test.number + 1 - test.first} tries, {hit} killed before the end, {kept} with a result, {litter} with other files left",
              flush=True)


