#!/usr/bin/env python3
"""Thousands of tries to break a running program: forged messages, damaged files, wrong calls, kill -9.

usage: tries.py --program RTSG [--tries N] [--kinds REGEX] [--seed N] [--first N] [--keep FOLDER] [--package FOLDER]

Each class of tries attacks a program that runs, or one for each try, while a well-behaved client uses the same program. The attacked program must
end with status 0 or 1 and never by a signal, its memory must stay below 1 GiB, and the client must get right states all the time. Each try has dice
of its own from the seed and its number, so `--first N --tries 1` repeats one. Classes whose broker or package is missing are skipped. Without --tries
it is 10 of each class that needs neither a broker nor a screen; in the long form (RTSG_LONG) 1,000 of each class, and 100 of each verb of `killed`.

Prints the seed, and a line for each class with its tries and faults. Exit status 1, and for each fault a line with its seed and number, and the bytes
that were sent in a file of the folder --keep.
"""
import argparse
import contextlib
import os
import pathlib
import random
import re
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import time
import zlib

from tries_killed import killed
from tries_support import PATIENCE, ROOT, Fault, Nats, Server, WebSocket, connected, free_port, http, mutate, picture_pixels, run, tried, wait_for
from tries_window import drops

SCENE = """#X3D V4.0 utf8
PROFILE Immersive
WorldInfo {{ title "good {}" }}
DEF CLOCK TimeSensor {{ cycleInterval 2 loop TRUE }}
DEF PATH PositionInterpolator {{ key [ 0 1 ] keyValue [ 0 0 0, 4 0 0 ] }}
DEF BOX Transform {{ children Shape {{ geometry Box {{ }} }} }}
DEF MARK Transform {{ }}
ROUTE CLOCK.fraction_changed TO PATH.set_fraction
ROUTE PATH.value_changed TO BOX.translation
"""


def corpus(*kinds):
    """The seeds of fuzz targets of these kinds."""
    return [path.read_bytes() for kind in kinds for path in sorted((ROOT / "tests/fuzz/corpus" / kind).iterdir())]


@contextlib.contextmanager
def served(test, *more):
    """A served scene with a mirror that follows it from begin to end; both must end well, in the same state."""
    (test.folder / "scene.x3dv").write_text(SCENE.format(0))
    server = Server(test, "serve", test.folder / "scene.x3dv", "--bind", f"ipc://{test.folder}/socket", "--json", "--fps", "20", *more)
    follower = Server(test, "mirror", server.started["endpoint"], "--wait", "120s", "--json", is_silent=True)
    try:
        yield server
        mirrored(test, server.started["endpoint"])
        report = server.end()
        followed = follower.wait()
        if not followed.get("equal") or followed.get("divergences"):
            raise Fault(f"the mirror that followed is not in the scene's state: {followed}")
        return report
    finally:
        server.kill(), follower.kill()


def mirrored(test, endpoint, *more):
    """What a new mirror reports; it must have the scene's state."""
    status, out, err = run(test.program, "mirror", endpoint, "--for", "0.1s", "--wait", "120s", "--json", *more)
    if status != 0 or '"equal":true' not in out:
        raise Fault(f"a new mirror: status {status}, {out[-300:]} {err[-300:]}")


def reload(test):
    """The file of a served scene becomes mutated documents of each text format; afterwards the good file is shown."""
    seeds = corpus("classic", "xml", "json", "html", "import", "encodings") + [SCENE.format(1).encode()]
    edited = test.folder / "scene.x3dv"

    def write(data):
        said = len(server.said())
        (test.folder / "edited").write_bytes(data)
        os.replace(test.folder / "edited", edited)
        wait_for(lambda: len(server.said()) > said, .4)

    def shown(text):
        mirrored(test, server.started["endpoint"], "--save", test.folder / "replica.x3dv", "--force")
        return text in (test.folder / "replica.x3dv").read_text()
    with served(test, "--reload") as server:
        for dice in tried(test, server):
            test.sent = [mutate(dice.choice(seeds), dice, seeds)]
            write(test.sent[0])
            if test.number % 10 == 9 or test.is_last():
                title = f"good {test.number + 1}"
                write(SCENE.format(test.number + 1).encode())
                if not wait_for(lambda: shown(title), PATIENCE):
                    raise Fault(f"the good file is not shown: {server.said()[-500:]}")


class Echo:
    """A well-behaved client of feeds: what it sends to a feed comes back as an event of the scene."""

    def __init__(self, server):
        self.events = connected(server.started["published"][0]).makefile("rb")
        self.count = 0

    def check(self, send):
        self.count += 1
        send(f'{{"node":"MARK","field":"translation","value":[{self.count},0,0]}}\n'.encode())
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            line = self.events.readline()
            if not line:
                raise Fault("the connection for events out has ended")
            if f'"value":[{self.count},0,0]'.encode() in line:
                return
        raise Fault(f"the event {self.count} has not come back")


PUBLISHED = ("--publish", "tcp://127.0.0.1:0", "--fields", "MARK.translation")


def feeds(test):
    """Mutated lines to TCP and UDP, some in many packets, some on connections that end or stay."""
    seeds = corpus("feed") + [b'{"node":"BOX","field":"scale","value":[1,2,3]}\n', b"MARK,set_scale,1 2 3\n", b"POST / HTTP/1.1\r\nHost: a\r\n\r\n"]
    with served(test, "--feed", "tcp://127.0.0.1:0", "--feed", "udp://127.0.0.1:0", *PUBLISHED) as server:
        by_tcp, by_udp = server.started["feeds"]
        datagrams, echo = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), Echo(server)
        target, stays, honest = ("127.0.0.1", int(by_udp.rsplit(":", 1)[1])), [], connected(by_tcp)
        for dice in tried(test, server):
            test.sent = [mutate(dice.choice(seeds), dice, seeds) for _ in range(dice.randint(1, 5))]
            for data in test.sent:
                with contextlib.suppress(OSError):
                    if dice.random() < .5:
                        datagrams.sendto(data[:60000], target)
                        continue
                    line = connected(by_tcp)
                    line.sendall(data)
                    stays.append(line)
            if len(stays) > 40:
                for line in stays:
                    line.close()
                stays.clear()
            if test.number % 10 == 9 or test.is_last():
                echo.check(honest.sendall)
                echo.check(lambda data: datagrams.sendto(data, target))


class Broker:
    """A mosquitto of its own, and a bare client of it."""

    def __init__(self, test):
        self.port = free_port()
        (test.folder / "mosquitto.conf").write_text(f"listener {self.port} 127.0.0.1\nallow_anonymous true\n")
        self.process = subprocess.Popen(["mosquitto", "-c", str(test.folder / "mosquitto.conf")], stdout=subprocess.DEVNULL,
                                        stderr=subprocess.DEVNULL)
        if not wait_for(lambda: self.answers(), PATIENCE):
            raise Fault("mosquitto does not answer")
        self.line = connected(f"tcp://127.0.0.1:{self.port}")
        self.line.sendall(b"\x10\x11\x00\x04MQTT\x05\x02\x00\x00\x00\x00\x04test")

    def answers(self):
        try:
            connected(f"tcp://127.0.0.1:{self.port}").close()
            return True
        except OSError:
            return False

    def publish(self, topic, data):
        body = struct.pack(">H", len(topic)) + topic.encode() + b"\0" + data
        size, length = b"", len(body)
        while True:
            size += bytes([length % 128 | (128 if length >= 128 else 0)])
            length //= 128
            if not length:
                break
        self.line.sendall(b"\x30" + size + body)

    def end(self):
        self.process.kill()
        self.process.wait()


def mqtt(test):
    """Garbage on the topic that a scene is fed from, and on topics beside it."""
    seeds = corpus("feed") + [b'{"node":"BOX","field":"scale","value":[1,2,3]}\n', b"MARK,set_scale,1 2 3\n"]
    broker = Broker(test)
    try:
        with served(test, "--feed", f"mqtt://127.0.0.1:{broker.port}/hall/+", *PUBLISHED) as server:
            echo = Echo(server)
            wait_for(lambda: echo_comes(echo, broker), PATIENCE)
            for dice in tried(test, server):
                test.sent = [mutate(dice.choice(seeds), dice, seeds) for _ in range(dice.randint(1, 5))]
                for data in test.sent:
                    broker.publish(dice.choice(["hall/in", "hall/x", "hall/" + "n" * dice.randint(1, 3000), "hall/\u00e4"][:3]), data)
                if test.number % 10 == 9 or test.is_last():
                    echo.check(lambda data: broker.publish("hall/in", data))
    finally:
        broker.end()


def echo_comes(echo, broker):
    """Whether the scene has subscribed: what is published before that is lost."""
    echo.events.raw._sock.settimeout(.3)
    try:
        echo.check(lambda data: broker.publish("hall/in", data))
    except OSError:
        echo.events = echo.events.raw._sock.makefile("rb")
        return False
    finally:
        echo.events.raw._sock.settimeout(PATIENCE)
    return True


def foxglove(test):
    """Mutated messages of clients, frames that are none, and requests that are none, beside a viewer that follows a field."""
    seeds = corpus("feed") + [b'{"op":"subscribe","subscriptions":[{"id":1,"channelId":1}]}', b'{"op":"unsubscribe","subscriptionIds":[1]}',
                              b'{"op":"advertise","channels":[]}', b'{"op":"getParameters","parameterNames":[],"id":"1"}']
    with served(test, "--foxglove", "0", "--fields", "BOX.translation") as server:
        address = server.started["foxglove"]
        viewer = WebSocket(address)
        viewer.follow("/fields/BOX/translation")
        for dice in tried(test, server):
            kind = dice.random()
            with contextlib.suppress(OSError):
                if kind < .2:
                    test.sent = [mutate(WebSocket.request(address), dice, seeds)]
                    line = connected(address)
                    line.sendall(test.sent[0])
                    line.close()
                else:
                    forger, test.sent = WebSocket(address), []
                    for _ in range(dice.randint(1, 6)):
                        data = mutate(dice.choice(seeds), dice, seeds)
                        frame = WebSocket.frame(data, dice.choice([1, 1, 1, 2, 0, 8, 9, 10, dice.randint(0, 255)]), dice.random() < .9)
                        test.sent.append(mutate(frame, dice, seeds) if dice.random() < .4 else frame)
                        forger.line.sendall(test.sent[-1])
                    forger.line.close()
            if test.number % 10 == 9 or test.is_last():
                viewer.message(), viewer.message()
                another = WebSocket(address)
                another.follow("/fields/BOX/translation")
                another.message()
                another.line.close()


def metrics(test):
    """Requests of HTTP that are mutated, cut, or come in drops."""
    seeds = corpus("metrics") + [b"GET /metrics HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", b"POST / HTTP/1.0\r\nContent-Length: 9999999999\r\n\r\nx"]
    with served(test, "--metrics-port", "0") as server:
        address, stays = "tcp://" + server.started["metrics"], []
        for dice in tried(test, server):
            test.sent = [mutate(dice.choice(seeds), dice, seeds)]
            with contextlib.suppress(OSError):
                line, data = connected(address), test.sent[0]
                cut = dice.randint(0, len(data))
                line.sendall(data[:cut])
                line.sendall(data[cut:])
                stays.append(line)
            if len(stays) > 80:
                for line in stays:
                    line.close()
                stays.clear()
            if test.number % 10 == 9 or test.is_last():
                answer = http(address, "/metrics")
                if not answer.startswith(b"HTTP/1.1 200") or b"\nrtsg_" not in answer:
                    raise Fault(f"no figures: {answer[:200]!r}")


def nats(test):
    """Forged packets on the subjects of a published session. One half asks as mirrors do, and must disturb nobody; the other half says what only the
    scene may say, which may end mirrors, and after which a new one has the scene's state."""
    broker = Nats(test)
    try:
        address = f"nats://127.0.0.1:{broker.port}/hall"
        with served(test, "--nats", address, "--upstream", "events") as server:
            broker.listen()
            follower = Server(test, "mirror", address, "--wait", "60s", "--json", "--set", "MARK.translation=1 2 3@0.1", is_silent=True)
            wait_for(lambda: broker.heard() > 30 and any(subject.startswith("_INBOX.rtsg") for subject, _ in broker.messages), 20)
            packets = [data for _, data in broker.messages] + corpus("packet")
            inboxes = sorted({subject for subject, _ in broker.messages if subject.startswith("_INBOX")}) or ["_INBOX.rtsg.1"]
            for dice in tried(test, server):
                asks = test.number % 200 < 100
                test.sent = [mutate(dice.choice(packets), dice, packets) for _ in range(dice.randint(1, 20))]
                for data in test.sent:
                    subject = "rtsg.hall.ask" if asks else dice.choice(["rtsg.hall.live", "rtsg.hall.state", "rtsg.hall.log", *inboxes])
                    reply = dice.choice(["", *inboxes, "_INBOX.forged." + str(dice.random())[2:], "rtsg.hall.live", "_INBOX.>"])
                    broker.publish(subject, data[:900000], reply if ">" not in reply else "")
                broker.heard()
                if test.number % 100 == 99 or test.is_last():
                    ended = follower.end()
                    if asks and not ended.get("equal"):
                        raise Fault(f"a mirror that followed while others asked: {ended}")
                    mirrored(test, address)
                    if not test.is_last():
                        follower = Server(test, "mirror", address, "--wait", "60s", "--json", is_silent=True)
                        wait_for(lambda: broker.grown(30), 20)
    finally:
        broker.end()


def tiff(width, dice):
    """A TIFF of tiles of 64 x 64, deflated."""
    tiles = [zlib.compress(bytes(dice.randrange(256) if i % 7 == 0 else i % 256 for i in range(64 * 64 * 3)), 1) for _ in range((width // 64) ** 2)]
    offsets, at = [], 8
    for tile in tiles:
        offsets.append(at)
        at += len(tile) + len(tile) % 2
    body = b"".join(tile + b"\0" * (len(tile) % 2) for tile in tiles)
    lists = at
    body += struct.pack(f"<{len(tiles)}I", *offsets) + struct.pack(f"<{len(tiles)}I", *map(len, tiles)) + struct.pack("<3H", 8, 8, 8) + b"\0\0"
    entries = [(256, 4, 1, width), (257, 4, 1, width), (258, 3, 3, lists + 8 * len(tiles)), (259, 3, 1, 8), (262, 3, 1, 2), (277, 3, 1, 3),
               (284, 3, 1, 1), (322, 4, 1, 64), (323, 4, 1, 64), (324, 4, len(tiles), lists), (325, 4, len(tiles), lists + 4 * len(tiles))]
    folder = struct.pack("<H", len(entries)) + b"".join(struct.pack("<HHII", *entry) for entry in entries) + struct.pack("<I", 0)
    return b"II*\0" + struct.pack("<I", 8 + len(body)) + body + folder


def assembled(test, dice, tiles, whole):
    """Damaged tiles are joined to the picture that they were of, or refused."""
    for old in test.folder.glob("p*.png"):
        old.unlink()
    test.sent = []
    hit = dice.sample(sorted(tiles), dice.randint(1, 2))
    for name, data in tiles.items():
        damaged = mutate(data, dice, list(tiles.values())) if name in hit else data
        test.sent.append(damaged)
        (test.folder / name).write_bytes(damaged)
    status, _, err = run(test.program, "assemble", test.folder / "p.png", "--tiles", "2,2")
    there = (test.folder / "p.png").exists()
    if status == 0 and (not there or picture_pixels(test.folder / "p.png") != whole):
        raise Fault("status 0, and the joined picture is another one")
    if status not in (0, 1) or status == 1 and (there or "error" not in err):
        raise Fault(f"assemble: status {status}, {err[-300:]}")


def tiles(test):
    """Damaged tiles that `assemble` joins; forged mirrors of `assemble --live`; damaged pictures of tiles as textures."""
    (test.folder / "scene.x3dv").write_text(SCENE.format(0))
    for tile in ("0,0", "0,1", "1,0", "1,1"):
        run(test.program, "render", test.folder / "scene.x3dv", "-o", test.folder / "p.png", "--size", "64x64", "--spp", "1", "--tile", f"{tile}/2,2")
    parts = {path.name: path.read_bytes() for path in test.folder.glob("p.tile*.png")}
    run(test.program, "assemble", test.folder / "p.png", "--tiles", "2,2")
    whole, texture = picture_pixels(test.folder / "p.png"), tiff(256, random.Random(1))
    (test.folder / "textured.x3dv").write_text('#X3D V4.0 utf8\nPROFILE Full\nShape { appearance Appearance { texture ImageTexture { url "t.tif" } } '
                                               "geometry Box { } }\n")
    messages = corpus("tiles") + [b"hello 1 48 16 10 looks\nhave 5 6\n", b"tile 5 0 0 7 aa 0.5 4\nabcd", b"gone 5 0 0\n"]
    joiner = stays = None
    for dice in tried(test, None):
        if test.number % 3 == 0:
            assembled(test, dice, parts, whole)
        elif test.number % 3 == 1:
            test.sent = [mutate(texture, dice, [texture])]
            (test.folder / "t.tif").write_bytes(test.sent[0])
            status, _, err = run(test.program, "render", test.folder / "textured.x3dv", "-o", test.folder / "t.png", "--size", "16x16",
                                 "--spp", "1", *(["--limit", "pixels=4096"] if dice.random() < .5 else []))
            if status not in (0, 1):
                raise Fault(f"render: status {status}, {err[-300:]}")
        else:
            if joiner is None or joiner.process.poll() is not None:
                joiner = Server(test, "assemble", "--live", "tcp://127.0.0.1:0", "--tiles", "3,1", "--json")
                stays = connected(joiner.started["endpoint"])  # without mirrors it would end
                stays.sendall(b"hello 1 48 16 10 looks\n")
            test.sent = [mutate(b"".join(dice.choices(messages, k=3)), dice, messages)]
            with contextlib.suppress(OSError):
                line = connected(joiner.started["endpoint"])
                line.sendall(test.sent[0])
                line.close()
            joiner.check()
            stays.sendall(b"have %d %d\n" % (1000000 + test.number, 1000001 + test.number))
            said = b""
            while b"draw %d " % (1000000 + test.number) not in said:
                part = stays.recv(1000)
                if not part:
                    raise Fault(f"an honest mirror is sent away: {said[-200:]} {joiner.said()[-300:]}")
                said += part
                for picture, column in re.findall(rb"draw (\d+) (\d+) 0 3 1\n", part):
                    stays.sendall(b"tile %s %s 0 7 aa 0.5 1024\n" % (picture, column) + b"x" * 1024)
    if joiner:
        stays.close()
        joiner.end()


def python(test):
    """Random calls of the Python package with random arguments, each try in a process of its own."""
    command = [sys.executable, str(ROOT / "tests/stability/tries_python.py"), "--seed", str(test.seed), "--first", str(test.first), "--tries",
               str(test.tries)]
    process = subprocess.run(command, env=dict(os.environ, PYTHONPATH=test.package), stdout=subprocess.PIPE, text=True, cwd=test.folder, check=False)
    last = re.match(r"(\d+) tries, (\d+) faults", process.stdout.strip().rsplit("\n", 1)[-1])
    print(process.stdout.strip(), flush=True)
    test.faults += int(last[2]) if last else 1
    test.done = int(last[1]) if last else 0


def missing(kind, options):
    """Why a class cannot be tried here; empty if it can."""
    needs = {"nats": ["nats-server"], "mqtt": ["mosquitto"], "drops": ["Xvfb"]}
    lacks = [program for program in needs.get(kind, []) if not shutil.which(program)]
    if kind == "python" and not options.package:
        lacks = ["--package"]
    return f"needs {', '.join(lacks)}" if lacks else ""


class Test:
    """One class of tries: its dice, its folder, what was sent last, and its faults."""

    def __init__(self, kind, options, folder):
        self.kind, self.program, self.folder, self.package = kind, options.program, pathlib.Path(folder), options.package
        self.seed, self.tries, self.first, self.keep = options.seed, options.tries, options.first, options.keep
        self.number, self.done, self.faults, self.sent = self.first, 0, 0, []

    def is_last(self):
        return self.number + 1 >= self.first + self.tries

    def fault(self, text):
        self.faults += 1
        self.keep.mkdir(parents=True, exist_ok=True)
        names = []
        for index, data in enumerate(self.sent):
            names.append(self.keep / f"{self.kind}-{self.seed}-{self.number}-{index}")
            names[-1].write_bytes(data)
        print(f"FAULT: {self.kind}: seed {self.seed}, try {self.number}: {text} (sent: {', '.join(map(str, names)) or 'nothing'})", flush=True)


KINDS = {function.__name__: function for function in (reload, feeds, foxglove, metrics, tiles, nats, mqtt, python, killed, drops)}
QUICK = ("reload", "feeds", "foxglove", "metrics", "tiles", "killed")


def attempt(kind, options):
    """Runs a class; after a fault the next tries go on with a new program."""
    faults = done = 0
    begun, first, tries = time.monotonic(), options.first, options.tries
    while tries > 0 and faults < 20:
        with tempfile.TemporaryDirectory(prefix="rtsg-tries-") as folder:
            now = argparse.Namespace(**{**vars(options), "first": first, "tries": tries})
            test = Test(kind, now, folder)
            try:
                KINDS[kind](test)
                first, tries = first + tries, 0
            except (Fault, OSError, subprocess.TimeoutExpired) as fault:
                test.fault(str(fault) or repr(fault))
                tries -= test.number + 1 - first
                first = test.number + 1
            faults += test.faults
            done += test.done
    print(f"{kind}: {done} tries, {faults} faults, {time.monotonic() - begun:.0f} s", flush=True)
    return faults


def main():
    is_long = bool(os.environ.get("RTSG_LONG"))
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", required=True, type=lambda path: str(pathlib.Path(path).resolve()))
    parser.add_argument("--tries", type=int, default=1000 if is_long else 10)
    parser.add_argument("--kinds", type=re.compile, default=re.compile("" if is_long else "|".join(QUICK)))
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(1 << 30))
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--keep", type=pathlib.Path, default=pathlib.Path(tempfile.gettempdir()) / "rtsg-tries")
    parser.add_argument("--package", default="", help="the folder that holds the Python package")
    options = parser.parse_args()
    print(f"seed {options.seed}", flush=True)
    faults = 0
    for kind in KINDS:
        if not options.kinds.search(kind):
            continue
        lacks = missing(kind, options)
        if lacks:
            print(f"{kind}: skipped, {lacks}", flush=True)
            continue
        faults += attempt(kind, options)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.stdout.reconfigure(line_buffering=True)
    sys.exit(main())
