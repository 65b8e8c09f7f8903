#!/usr/bin/env python3
"""Mirrors across bad links: loss, delay, reordering, little bandwidth, asymmetry, cuts, and processes killed at random.

Server and client run in two network namespaces of their own. Between them is `tc netem` on a veth pair where the kernel
has it; else a TUN device in each, and this program passes packets from one to the other, badly, with a fixed seed.
Afterwards every state hash and number is equal: nothing lost, nothing doubled. Python's standard library only.

Exit status: 0 all well, 1 a check failed, 77 skipped (says why): not root, or no namespaces or TUN devices here.
Nothing leaves the namespaces, which are removed whatever happens.
"""

import argparse
import atexit
import ctypes
import fcntl
import heapq
import json
import os
import random
import select
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time

SKIPPED = 77
SERVER, CLIENT = "10.213.7.1", "10.213.7.2"
PORT = 4711

SCENE = """#X3D V4.0 utf8
PROFILE Immersive
DEF CLOCK TimeSensor {{ cycleInterval 3 loop TRUE }}
DEF FLAG BooleanToggle {{ }}
{movers}
"""
MOVER = """DEF BOX{i} Transform {{ children Shape {{ geometry Box {{ }} }} }}
DEF PATH{i} PositionInterpolator {{ key [ 0 .5 1 ] keyValue [ 0 {i} 0, {i} 1 2, 0 {i} 0 ] }}
DEF SPIN{i} OrientationInterpolator {{ key [ 0 1 ] keyValue [ 0 1 0 0, 0 1 0 3 ] }}
ROUTE CLOCK.fraction_changed TO PATH{i}.set_fraction
ROUTE CLOCK.fraction_changed TO SPIN{i}.set_fraction
ROUTE PATH{i}.value_changed TO BOX{i}.set_translation
ROUTE SPIN{i}.value_changed TO BOX{i}.set_rotation
"""


class Failure(Exception):
    pass


def run(*command):
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


class Way:
    """One direction of a link. Times in seconds, rate in bytes a second, loss as a share."""

    def __init__(self, loss=0.0, delay=0.0, jitter=0.0, rate=0.0):
        self.loss, self.delay, self.jitter, self.rate = loss, delay, jitter, rate

    def netem(self):
        words = ["delay", f"{self.delay * 1e3:.1f}ms", f"{self.jitter * 1e3:.1f}ms", "loss", f"{self.loss * 100:.2f}%"]
        return words + (["rate", f"{int(self.rate * 8)}bit"] if self.rate else [])


class Link:
    """Two namespaces and what is between them. `there` is from server to client."""

    def __init__(self, seed):
        self.names = [f"rtsg-{end}-{os.getpid()}" for end in ("s", "c")]
        self.random = random.Random(seed)
        self.ways = [Way(), Way()]
        self.cut = False
        self.passed, self.dropped = 0, 0
        self.stop = threading.Event()
        self.thread = None
        self.files = []
        atexit.register(self.close)
        for name in self.names:
            run("ip", "netns", "add", name)
            run("ip", "-n", name, "link", "set", "lo", "up")
        self.netem = self.try_netem()
        if not self.netem:
            self.make_tuns()

    def try_netem(self):
        veths = [f"rtsgv{end}{os.getpid() % 10000}" for end in "sc"]
        try:
            run("ip", "link", "add", veths[0], "netns", self.names[0], "type", "veth", "peer", "name", veths[1],
                "netns", self.names[1])
            for name, veth, address in zip(self.names, veths, (SERVER, CLIENT)):
                run("ip", "netns", "exec", name, "tc", "qdisc", "add", "dev", veth, "root", "netem", "delay", "0ms")
                run("ip", "-n", name, "addr", "add", f"{address}/24", "dev", veth)
                run("ip", "-n", name, "link", "set", veth, "up")
        except (subprocess.CalledProcessError, FileNotFoundError):
            subprocess.run(["ip", "-n", self.names[0], "link", "del", veths[0]], stderr=subprocess.DEVNULL)
            return False
        self.veths = veths
        return True

    def make_tuns(self):
        libc = ctypes.CDLL(None, use_errno=True)
        home = os.open("/proc/self/ns/net", os.O_RDONLY)
        try:
            for name, address in zip(self.names, (SERVER, CLIENT)):
                there = os.open(f"/run/netns/{name}", os.O_RDONLY)
                if libc.setns(there, 0) != 0:
                    raise OSError(ctypes.get_errno(), "setns")
                os.close(there)
                tun = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
                self.files.append(tun)
                iff_tun, iff_no_pi, tunsetiff = 0x0001, 0x1000, 0x400454CA
                fcntl.ioctl(tun, tunsetiff, struct.pack("16sH22x", b"tun0", iff_tun | iff_no_pi))
                if libc.setns(home, 0) != 0:
                    raise OSError(ctypes.get_errno(), "setns")
                run("ip", "-n", name, "addr", "add", f"{address}/24", "dev", "tun0")
                run("ip", "-n", name, "link", "set", "tun0", "up", "txqueuelen", "1000")
        finally:
            libc.setns(home, 0)
            os.close(home)
        self.thread = threading.Thread(target=self.carry, daemon=True)
        self.thread.start()

    def carry(self):
        """Packets from each end to the other, each at its time; a jitter larger than their distance reorders them."""
        waiting, number = [], 0
        busy = [0.0, 0.0]  # until when each way is sending
        while not self.stop.is_set():
            now = time.monotonic()
            while waiting and waiting[0][0] <= now:
                _, _, way, packet = heapq.heappop(waiting)
                if self.cut:
                    self.dropped += 1
                    continue
                try:
                    os.write(self.files[1 - way], packet)
                    self.passed += 1
                except OSError:
                    self.dropped += 1
            patience = min(0.05, max(0.0, waiting[0][0] - now)) if waiting else 0.05
            for file in select.select(self.files, [], [], patience)[0]:
                way = self.files.index(file)
                for _ in range(64):
                    try:
                        packet = os.read(file, 65536)
                    except OSError:
                        break
                    link, now = self.ways[way], time.monotonic()
                    if self.cut or self.random.random() < link.loss:
                        self.dropped += 1
                        continue
                    due = now
                    if link.rate:
                        if busy[way] - now > 0.3:  # a queue of 300 ms, then the tail is dropped
                            self.dropped += 1
                            continue
                        busy[way] = max(busy[way], now) + len(packet) / link.rate
                        due = busy[way]
                    due += max(0.0, link.delay + self.random.uniform(-link.jitter, link.jitter))
                    number += 1
                    heapq.heappush(waiting, (due, number, way, packet))

    def set(self, there=None, back=None):
        self.ways = [there or Way(), back or there or Way()]
        if self.netem:
            for name, veth, way in zip(self.names, self.veths, self.ways):
                run("ip", "netns", "exec", name, "tc", "qdisc", "change", "dev", veth, "root", "netem", *way.netem())

    def set_cut(self, cut):
        self.cut = cut
        if self.netem:
            for name, veth in zip(self.names, self.veths):
                run("ip", "netns", "exec", name, "tc", "qdisc", "change", "dev", veth, "root", "netem", "loss",
                    "100%" if cut else "0%")

    def close(self):
        if not self.names:
            return
        self.stop.set()
        if self.thread:
            self.thread.join(2)
        for file in self.files:
            os.close(file)
        for name in self.names:
            subprocess.run(["ip", "netns", "del", name], stderr=subprocess.DEVNULL)
        self.names = []


class Program:
    """rtsg in one of the namespaces, its output kept in files."""

    def __init__(self, test, end, *arguments):
        test.started += 1
        self.base = os.path.join(test.folder, f"{end}{test.started}")
        self.out, self.err = open(self.base + ".out", "w+"), open(self.base + ".err", "w+")
        name = test.link.names[0 if end == "server" else 1]
        self.process = subprocess.Popen(["ip", "netns", "exec", name, test.program, *arguments], stdout=self.out,
                                        stderr=self.err, stdin=subprocess.DEVNULL)
        test.running.append(self)

    def lines(self):
        with open(self.base + ".out") as file:
            return file.read().splitlines()

    def errors(self):
        with open(self.base + ".err") as file:
            return file.read()[-1500:]

    def kill(self):
        self.process.kill()
        self.process.wait()

    def finish(self, seconds):
        try:
            return self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.kill()
            raise Failure(f"still running after {seconds} s: {' '.join(self.process.args)}\n{self.errors()}")

    def report(self):
        lines = self.lines()
        if not lines:
            raise Failure(f"no report: {' '.join(self.process.args)}\n{self.errors()}")
        return json.loads(lines[-1])


class Test:
    def __init__(self, program, link, movers=20):
        self.program, self.link, self.started, self.running = program, link, 0, []
        self.folder = tempfile.mkdtemp(prefix="rtsg-link-")
        atexit.register(self.close)
        self.scene = self.scene_of(movers)

    def close(self):
        for program in self.running:
            if program.process.poll() is None:
                program.kill()
        shutil.rmtree(self.folder, ignore_errors=True)

    def scene_of(self, movers):
        """A scene of so many movers, some 65 bytes a frame each."""
        scene = os.path.join(self.folder, f"scene{movers}.x3dv")
        with open(scene, "w") as file:
            file.write(SCENE.format(movers="".join(MOVER.format(i=i) for i in range(movers))))
        return scene

    def serve(self, seconds, *more, scene=None):
        server = Program(self, "server", "serve", scene or self.scene, "--bind", f"tcp://{SERVER}:{PORT}", "--insecure", "--fps",
                         "30", "--json", "--linger", "60s", "--upstream", "events", "--for", f"{seconds}s", *more)
        end = time.monotonic() + 60
        while not server.lines():
            if server.process.poll() is not None or time.monotonic() > end:
                raise Failure("the server did not start: " + server.errors())
            time.sleep(0.02)
        return server

    def mirror(self, *more):
        """Its log is there once it has joined."""
        log = os.path.join(self.folder, f"mirror{self.started}.rlog")
        mirror = Program(self, "client", "mirror", f"tcp://{SERVER}:{PORT}", "--wait", "40s", "--json", "--record", log, *more)
        mirror.log = log
        return mirror

    @staticmethod
    def wait_for(mirrors):
        end = time.monotonic() + 60
        while not all(os.path.exists(m.log) for m in mirrors):
            if time.monotonic() > end:
                raise Failure("a mirror did not join: " + " ".join(m.errors() for m in mirrors))
            time.sleep(0.02)

    def compare(self, server, mirrors, seconds):
        """Both end in order, in the same state."""
        results = [(m, m.finish(seconds)) for m in mirrors]
        status = server.finish(seconds)
        origin = server.report()
        if status != 0:
            raise Failure(f"the server ended with {status}: {server.errors()}")
        for mirror, code in results:
            replica = mirror.report()
            # A server that was killed and began anew leaves a hole in the mirror's log, which is named.
            hole = replica["holes"] > 0
            named = hole == (" s of the session" in (replica["missing"] or ""))
            if not (code == (1 if hole else 0) and named and replica["equal"] and replica["hash"] == origin["hash"]
                    and replica["sequence"] == origin["sequence"] and replica["divergences"] == 0):
                raise Failure(f"exit {code}\nreplica {replica}\norigin {origin}\n{mirror.errors()}")
        return origin, [m.report() for m, _ in results]


def badly(test, name, there, back=None, seconds=4.0):
    """A whole session across a bad link, events sent upstream meanwhile."""
    test.link.set(there, back)
    server = test.serve(seconds)
    mirror = test.mirror("--set", "FLAG.set_boolean=TRUE@0.5", "--set", "FLAG.set_boolean=FALSE@0.7")
    _, [replica] = test.compare(server, [mirror], 120)
    test.link.set()
    if replica["accepted"] + replica["refused"] != replica["sent"] and replica["sent"] == 2:
        print(f"  {name}: an answer did not come before the end", flush=True)
    # What it has recorded is the same session: every state is there once and has its hash.
    verified = subprocess.run([test.program, "replay", mirror.log, "--verify"], stdout=subprocess.PIPE, text=True)
    if verified.returncode != 0:
        raise Failure(f"{name}: the replica's log does not verify: {verified.stdout}")
    return replica


def in_time(test, name, movers, way, most, seconds=8.0):
    """A link that carries less than the scene makes: frames come merged, at most `most` seconds old, and in the end all is equal."""
    test.link.set(way)
    server = test.serve(seconds, scene=test.scene_of(movers))
    mirror = Program(test, "client", "mirror", f"tcp://{SERVER}:{PORT}", "--wait", "40s", "--json")
    origin, [replica] = test.compare(server, [mirror], 120)
    test.link.set()
    if origin["merged"] == 0:
        raise Failure(f"{name}: nothing was merged: {replica}")
    if replica["most_lag_s"] > most:
        raise Failure(f"{name}: {replica['most_lag_s']:.3f} s old, at most {most:.3f} s were asked for: {replica}")
    print(f"  {name}: {replica['frames']} of {origin['frames']} frames, at most {replica['most_lag_s']:.2f} s old", flush=True)


def narrow(test):
    """The most age of a frame: 250 ms, the round trip, what the link takes for one frame (65 bytes a mover), and 3 s for a
    machine that does other things as well: it tells who follows from who falls behind, which takes 6 s or more of these sessions."""
    def age(movers, rate, trip):
        return 0.25 + trip + 65 * movers / rate + 3

    in_time(test, "1 Mbit/s for 6", 400, Way(rate=125e3, delay=0.01), age(400, 125e3, 0.02))
    in_time(test, "64 kbit/s for 300", 20, Way(rate=8e3, delay=0.02), age(20, 8e3, 0.04))
    in_time(test, "1 Mbit/s and 200 ms", 400, Way(rate=125e3, delay=0.1), age(400, 125e3, 0.2))
    in_time(test, "1 Mbit/s and 5 % loss", 400, Way(rate=125e3, delay=0.01, loss=0.05), 4)


def cut(test, length, seconds):
    """The link is gone for a while; afterwards it goes on from where it was."""
    server = test.serve(length + seconds)  # it takes a peer silent for 10 s for gone
    mirror = test.mirror()
    test.wait_for([mirror])
    test.link.set_cut(True)
    time.sleep(length)
    test.link.set_cut(False)
    _, [replica] = test.compare(server, [mirror], 60 + 6 * length + seconds)
    return replica


def stopped(test, length, seconds, count=4):
    """Half of the mirrors are stopped (SIGSTOP) for a while: the others do not wait, and they end like these."""
    test.link.set()
    server = test.serve(length + seconds)  # it takes a peer silent for 10 s for gone
    mirrors = [test.mirror() for _ in range(count)]
    test.wait_for(mirrors)
    for mirror in mirrors[: count // 2]:
        mirror.process.send_signal(signal.SIGSTOP)
    time.sleep(length)
    for mirror in mirrors[: count // 2]:
        mirror.process.send_signal(signal.SIGCONT)
    test.compare(server, mirrors, 60 + length + seconds)


def killed(test, seed, seconds):
    """Server and client are killed at random; the last ones end in order."""
    dice = random.Random(seed)
    test.link.set(Way(delay=0.002, jitter=0.001, loss=0.005))
    server, mirrors = test.serve(3600), [test.mirror(), test.mirror()]
    end, kills = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        time.sleep(dice.uniform(0.2, 1.2))
        kills += 1
        which = dice.randrange(3)
        if which == 2:
            server.kill()
            time.sleep(dice.uniform(0, 0.5))
            server = test.serve(3600)
        else:
            mirrors[which].kill()
            mirrors[which] = test.mirror()
    test.wait_for(mirrors)
    server.kill()
    server = test.serve(3)
    _, replicas = test.compare(server, mirrors, 120)
    if not all(r["holes"] > 0 for r in replicas):
        raise Failure(f"a server that began anew left no hole: {replicas}")
    test.link.set()
    return kills


def short(test, seed):
    print("  loss 3 %, 20 ms +- 15 ms, reordered:", end=" ", flush=True)
    r = badly(test, "loss", Way(loss=0.03, delay=0.02, jitter=0.015))
    print(f"{r['frames']} frames, {r['gaps']} gaps, jitter {r['jitter_s'] * 1e3:.1f} ms", flush=True)
    print("  1 Mbit/s:", end=" ", flush=True)
    r = badly(test, "narrow", Way(rate=125e3, delay=0.01))
    print(f"{r['frames']} frames, {r['bytes']} bytes", flush=True)
    narrow(test)
    print("  asymmetric, 80 ms and 5 % there, 2 ms back:", end=" ", flush=True)
    r = badly(test, "asymmetric", Way(delay=0.08, loss=0.05), Way(delay=0.002))
    print(f"{r['frames']} frames, offset {r['clock_offset_s'] * 1e3:.1f} ms", flush=True)
    print("  cut for 1 s:", end=" ", flush=True)
    r = cut(test, 1, 4)
    print(f"{r['frames']} frames, {r['snapshots']} snapshots", flush=True)
    print("  half of the mirrors stopped for 1 s:", end=" ", flush=True)
    stopped(test, 1, 5)
    print("equal", flush=True)
    print("  killed at random:", end=" ", flush=True)
    print(f"{killed(test, seed, 4)} times", flush=True)


def soak(test, seed, seconds):
    dice = random.Random(seed)
    end = time.monotonic() + seconds
    rounds = 0
    while rounds == 0 or time.monotonic() < end:
        rounds += 1
        left = max(5.0, end - time.monotonic())
        there = Way(dice.uniform(0, 0.05), dice.uniform(0, 0.15), dice.uniform(0, 0.03), dice.choice([0, 125e3, 1e6]))
        back = Way(dice.uniform(0, 0.05), dice.uniform(0, 0.15), dice.uniform(0, 0.03))
        print(f"  {rounds}: {vars(there)} {vars(back)}", flush=True)
        badly(test, f"soak{rounds}", there, back, seconds=5)
        length = dice.uniform(1, min(60, left / 3))
        print(f"  {rounds}: cut for {length:.1f} s", flush=True)
        cut(test, length, 4)
        stopped(test, dice.uniform(1, min(15, left / 4)), 5, 8)
        print(f"  {rounds}: killed {killed(test, dice.random(), min(120, left / 3))} times", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True, help="the rtsg to test")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--soak", type=float, metavar="SECONDS", help="the long form")
    arguments = parser.parse_args()
    if os.geteuid() != 0:
        print("skipped: network namespaces need root")
        return SKIPPED
    if not shutil.which("ip"):
        print("skipped: there is no ip (iproute2)")
        return SKIPPED
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that what was made is removed
    try:
        link = Link(arguments.seed)
    except (OSError, subprocess.CalledProcessError) as problem:
        detail = problem.stderr.decode().strip() if isinstance(problem, subprocess.CalledProcessError) else problem
        print(f"skipped: no network namespaces or TUN devices here: {detail}")
        return SKIPPED
    print(f"seed {arguments.seed}, by {'tc netem' if link.netem else 'packets passed between TUN devices'}", flush=True)
    test = Test(os.path.abspath(arguments.program), link)
    try:
        if arguments.soak:
            soak(test, arguments.seed, arguments.soak)
        else:
            short(test, arguments.seed)
    except Failure as failure:
        print(f"FAILED: {failure}")
        return 1
    finally:
        test.close()
        link.close()
    print(f"all equal ({link.passed} packets passed, {link.dropped} dropped)" if not link.netem else "all equal")
    return 0


if __name__ == "__main__":
    sys.exit(main())
