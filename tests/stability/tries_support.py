"""What classes of tries share: programs that are attacked, mutated bytes, and bare clients of the protocols. Standard library only."""
import base64
import json
import os
import pathlib
import random
import signal
import socket
import struct
import subprocess
import time
import zlib

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
PATIENCE = 240  # seconds; only a fault ever waits this long
MEMORY = 1 << 30


class Fault(Exception):
    """What a try has found."""


def wait_for(condition, seconds):
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(.01)
    return True


def run(program, *arguments):
    """Status and what it says; a signal is a fault."""
    process = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, errors="replace", stdin=subprocess.DEVNULL,
                             timeout=PATIENCE, check=False)
    if process.returncode < 0:
        raise Fault(f"{arguments[0]} was ended by signal {-process.returncode}: {process.stderr[-300:]}")
    return process.returncode, process.stdout, process.stderr


class Server:
    """A program that runs on, with its output in files."""

    def __init__(self, test, *arguments, is_silent=False, **more):
        self.name = f"{arguments[0]}-{time.monotonic_ns()}"
        self.out, self.err = test.folder / f"{self.name}.out", test.folder / f"{self.name}.err"
        with open(self.out, "wb") as out, open(self.err, "wb") as err:
            self.process = subprocess.Popen([test.program, *map(str, arguments)], stdin=subprocess.DEVNULL, stdout=out, stderr=err,
                                            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL), **more)
        self.started = {}
        if not is_silent:
            wait_for(lambda: b"\n" in self.out.read_bytes() or self.process.poll() is not None, PATIENCE)
            if b"\n" not in self.out.read_bytes():
                raise Fault(f"{arguments[0]} does not start: {self.said()[-500:]}")
            self.started = json.loads(self.out.read_text().splitlines()[0])

    def said(self):
        return self.err.read_text(errors="replace")

    def check(self):
        """It runs, and holds little memory."""
        status = self.process.poll()
        if status is not None:
            raise Fault(f"{self.name} ended with {status}: {self.said()[-500:]}")
        for line in pathlib.Path(f"/proc/{self.process.pid}/status").read_text().splitlines():
            if line.startswith("VmHWM:") and int(line.split()[1]) << 10 > MEMORY:
                raise Fault(f"{self.name} has held {line.split()[1]} kB")

    def wait(self):
        """The last line of its output, if that is JSON; it must have ended by itself with status 0 or 1."""
        try:
            self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.kill()
            raise Fault(f"{self.name} does not end: {self.said()[-500:]}") from None
        if self.process.returncode not in (0, 1):
            raise Fault(f"{self.name} ended with {self.process.returncode}: {self.said()[-500:]}")
        try:
            return json.loads(self.out.read_text(errors="replace").strip().rsplit("\n", 1)[-1])
        except ValueError:
            return {}

    def end(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        return self.wait()

    def kill(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()


def tried(test, server):
    """Dice for each try; afterwards the attacked program must still run."""
    for test.number in range(test.first, test.first + test.tries):
        yield random.Random(f"{test.seed}/{test.kind}/{test.number}")
        test.done += 1
        if server:
            server.check()


WORDS = [b"\0", b"\xff", b"\n", b"\r\n\r\n", b'"', b"'", b"{", b"}", b"[", b"]", b"<", b">", b"&", b"-1", b"1e39", b"nan", b"2147483648", b"1e400",
         b"99999999999999999999", b"\xc3", b"\xed\xa0\x80", b"DEF ", b"USE ", b"ROUTE ", b"IS ", b"NULL", b"TRUE", b"]]>", b"<!--", b"Group{", b"\x80\0\0\0"]


def changed(data, dice, seeds):
    at, length = dice.randrange(len(data) + 1), dice.choice([1, 2, 4, 16, 200])
    kind = dice.randrange(9)
    if kind == 0 and data:
        at = min(at, len(data) - 1)
        return data[:at] + bytes([data[at] ^ 1 << dice.randrange(8)]) + data[at + 1:]
    if kind == 1:
        return data[:at] + dice.randbytes(length) + data[at:]
    if kind == 2:
        return data[:at] + dice.randbytes(length) + data[at + length:]
    if kind == 3:
        return data[:at] + data[at + length:]
    if kind == 4:
        return data[:at] + data[at:at + length] * dice.choice([2, 3, 50]) + data[at + length:]
    if kind == 5:
        return data[:at] if dice.random() < .5 else data
    if kind in (6, 7):
        return data[:at] + dice.choice(WORDS) * dice.choice([1, 1, 1, 30]) + data[at:]
    other = dice.choice(seeds)
    start = dice.randrange(len(other) + 1)
    return data[:at] + other[start:start + dice.choice([20, 200, 20000])] + data[at:]


def mutate(data, dice, seeds):
    """Some bytes changed, put in, taken away, doubled, or taken from another seed."""
    for _ in range(dice.choice([1, 1, 2, 3, 8])):
        data = changed(data, dice, seeds)
    return data[:1 << 20]


def free_port():
    with socket.socket() as line:
        line.bind(("127.0.0.1", 0))
        return line.getsockname()[1]


def connected(address):
    """A connection to ...://127.0.0.1:PORT."""
    return socket.create_connection(("127.0.0.1", int(address.rstrip("/").rsplit(":", 1)[1])), timeout=PATIENCE)


def http(address, path):
    with connected(address) as line:
        line.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n".encode())
        answer = b""
        while part := line.recv(65536):
            answer += part
        return answer


class WebSocket:
    """A viewer of Foxglove's protocol."""

    def __init__(self, address):
        self.line, self.rest, self.topics = connected(address), b"", {}
        self.line.sendall(self.request(address))
        while b"\r\n\r\n" not in self.rest:
            self.more()
        head, self.rest = self.rest.split(b"\r\n\r\n", 1)
        if not head.startswith(b"HTTP/1.1 101"):
            raise OSError(f"no WebSocket: {head[:100]!r}")

    @staticmethod
    def request(address):
        key = base64.b64encode(os.urandom(16)).decode()
        return (f"GET / HTTP/1.1\r\nHost: {address.split('://')[1]}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: {key}\r\n"
                "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: foxglove.websocket.v1\r\n\r\n").encode()

    @staticmethod
    def frame(data, kind, masked=True):
        head = bytes([128 | kind if kind < 16 else kind])
        size = len(data)
        mask = 128 if masked else 0
        head += bytes([mask | size]) if size < 126 else bytes([mask | 126]) + struct.pack(">H", size) if size < 65536 else bytes([mask | 127]) + struct.pack(">Q", size)
        return head + (b"\0\0\0\0" if masked else b"") + data

    def more(self):
        part = self.line.recv(65536)
        if not part:
            raise OSError("the connection has ended")
        self.rest += part

    def next(self):
        """Kind and content of the next frame."""
        def take(count):
            while len(self.rest) < count:
                self.more()
            part, self.rest = self.rest[:count], self.rest[count:]
            return part
        kind, size = take(2)
        size = struct.unpack(">H", take(2))[0] if size == 126 else struct.unpack(">Q", take(8))[0] if size == 127 else size
        return kind & 15, take(size)

    def follow(self, topic):
        while topic not in self.topics:
            kind, data = self.next()
            if kind == 1 and data.startswith(b'{"op":"advertise"'):
                self.topics.update({channel["topic"]: channel["id"] for channel in json.loads(data)["channels"]})
        self.line.sendall(self.frame(json.dumps({"op": "subscribe", "subscriptions": [{"id": 7, "channelId": self.topics[topic]}]}).encode(), 1))

    def message(self):
        """The next message of what it follows."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            kind, data = self.next()
            if kind == 9:
                self.line.sendall(self.frame(data, 10))
            if kind == 2 and data[:5] == b"\x01\x07\0\0\0":
                return json.loads(data[13:])
        raise Fault("a viewer gets no messages")


class Nats:
    """A nats-server of its own, and a bare client of it that hears everything."""

    def __init__(self, test):
        self.port, self.messages, self.rest, self.count = free_port(), [], b"", 0
        self.process = subprocess.Popen(["nats-server", "-a", "127.0.0.1", "-p", str(self.port), "-js", "-sd", str(test.folder / "store")],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        if not wait_for(self.connects, PATIENCE):
            raise Fault("nats-server does not answer")

    def connects(self):
        try:
            self.line = connected(f"tcp://127.0.0.1:{self.port}")
        except OSError:
            return False
        self.line.sendall(b'CONNECT {"verbose":false,"pedantic":false}\r\nPING\r\n')
        return True

    def listen(self):
        self.line.sendall(b"SUB rtsg.> 1\r\nSUB _INBOX.> 2\r\n")

    def publish(self, subject, data, reply=""):
        self.line.sendall(f"PUB {subject} {reply} {len(data)}\r\n".encode() + data + b"\r\n")

    def grown(self, count):
        """Whether that many more messages have come since it was asked first."""
        self.mark = getattr(self, "mark", None) or self.count
        self.heard()
        if self.count - self.mark < count:
            return False
        self.mark = None
        return True

    def heard(self):
        """Reads what is there; the number of messages. The first 500 are kept."""
        self.line.settimeout(.005)
        try:
            while True:
                part = self.line.recv(1 << 20)
                if not part:
                    raise Fault("nats-server has ended the connection")
                self.rest += part
        except TimeoutError:
            pass
        finally:
            self.line.settimeout(PATIENCE)
        while b"\r\n" in self.rest:
            head, body = self.rest.split(b"\r\n", 1)
            if head.startswith(b"MSG "):
                size = int(head.split()[-1])
                if len(body) < size + 2:
                    break
                self.count += 1
                if len(self.messages) < 500:
                    self.messages.append((head.split()[1].decode(errors="replace"), body[:size]))
                body = body[size + 2:]
            elif head == b"PING":
                self.line.sendall(b"PONG\r\n")
            elif head.startswith(b"-ERR"):
                raise Fault(f"nats-server: {head!r}")
            self.rest = body
        return self.count

    def end(self):
        self.process.kill()
        self.process.wait()


def picture_pixels(path):
    """Size and unpacked rows of a PNG, whose checksums must be right."""
    data = pathlib.Path(path).read_bytes()
    if data[:8] != b"\x89PNG\r\n\x1a\n":
        raise Fault(f"{path} is no PNG")
    at, head, packed, ended = 8, b"", b"", False
    while at + 12 <= len(data) and not ended:
        size = int.from_bytes(data[at:at + 4], "big")
        chunk = data[at + 4:at + 8 + size]
        if int.from_bytes(data[at + 8 + size:at + 12 + size], "big") != zlib.crc32(chunk):
            raise Fault(f"{path} has a wrong checksum")
        head = chunk[4:] if chunk.startswith(b"IHDR") else head
        packed += chunk[4:] if chunk.startswith(b"IDAT") else b""
        ended = chunk.startswith(b"IEND")
        at += 12 + size
    if not ended:
        raise Fault(f"{path} is cut short")
    return head + zlib.decompress(packed)
