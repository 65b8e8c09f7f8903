"""Damaged files that are dropped on a window under Xvfb: an X client that speaks as much of the protocol as a drop (XDND) takes."""
import os
import random
import select
import socket
import struct
import subprocess
import time

from tries_support import PATIENCE, ROOT, Fault, Server, mutate, tried, wait_for

GOOD = '#X3D V4.0 utf8\nPROFILE Immersive\nWorldInfo {{ title "good {}" }}\nShape {{ geometry Box {{ }} }}\n'


class Screen:
    """An X server of its own, and a client of it."""

    def __init__(self, test):
        for _ in range(9):  # a number may be another one's
            self.number = random.SystemRandom().randrange(200, 20000)
            self.process = subprocess.Popen(["Xvfb", f":{self.number}", "-screen", "0", "640x480x24", "-nolisten", "tcp", "-noreset"],
                                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            if wait_for(lambda: self.process.poll() is not None or self.connects(), PATIENCE) and self.process.poll() is None:
                break
            self.process.kill()
            self.process.wait()
        else:
            raise Fault("Xvfb does not start")
        setup = self.take(4 * struct.unpack_from("<H", self.head, 6)[0])
        self.base = struct.unpack_from("<I", setup, 4)[0]
        vendor, formats = struct.unpack_from("<H", setup, 16)[0], setup[21]
        self.root = struct.unpack_from("<I", setup, 32 + vendor + -vendor % 4 + 8 * formats)[0]
        self.atoms, self.events, self.own = {}, [], self.base

    def connects(self):
        """A server that has just begun may reset a connection."""
        self.line = socket.socket(socket.AF_UNIX)
        self.line.settimeout(PATIENCE)
        try:
            self.line.connect(f"/tmp/.X11-unix/X{self.number}")
            self.line.sendall(struct.pack("<BxHHHHxx", 0x6C, 11, 0, 0, 0))
            self.head = self.take(8)
        except (OSError, Fault):
            self.line.close()
            return False
        return self.head[0] == 1

    def take(self, count):
        data = b""
        while len(data) < count:
            part = self.line.recv(count - len(data))
            if not part:
                raise Fault("the X server has ended")
            data += part
        return data

    def send(self, code, detail, body):
        body += b"\0" * (-len(body) % 4)
        self.line.sendall(struct.pack("<BBH", code, detail, 1 + len(body) // 4) + body)

    def message(self):
        """The next one: a reply, or an event."""
        data = self.take(32)
        if data[0] == 1:
            data += self.take(4 * struct.unpack_from("<I", data, 4)[0])
        return data

    def reply(self):
        while True:
            data = self.message()
            if data[0] in (0, 1):
                return data if data[0] else None
            self.events.append(data)

    def atom(self, name):
        if name not in self.atoms:
            self.send(16, 0, struct.pack("<Hxx", len(name)) + name.encode())
            self.atoms[name] = struct.unpack_from("<I", self.reply(), 8)[0]
        return self.atoms[name]

    def windows(self, parent):
        self.send(15, 0, struct.pack("<I", parent))
        data = self.reply()
        count = struct.unpack_from("<H", data, 16)[0] if data else 0
        return struct.unpack_from(f"<{count}I", data, 32) if count else ()

    def property(self, window, name):
        self.send(20, 0, struct.pack("<IIIII", window, self.atom(name), 0, 0, 10000))
        data = self.reply()
        return data[32:32 + struct.unpack_from("<I", data, 16)[0] * max(data[1] // 8, 1)] if data else b""

    def aware(self, parent=None):
        """The window that takes drops; 0 if there is none yet."""
        for window in self.windows(parent or self.root):
            if self.property(window, "XdndAware"):
                return window
            if below := self.aware(window):
                return below
        return 0

    def tell(self, window, name, *numbers):
        event = struct.pack("<BBHII5I", 33, 32, 0, window, self.atom(name), *numbers)
        self.send(25, 0, struct.pack("<II", window, 0) + event)

    def drop(self, window, urls, patience=PATIENCE):
        """Drops a list of urls; whether the window has asked for it and said that it is finished."""
        uris, selection = self.atom("text/uri-list"), self.atom("XdndSelection")
        for name in ("XdndEnter", "XdndPosition", "XdndDrop", "XdndFinished", "XdndActionCopy"):
            self.atom(name)
        self.own += 1  # a window for each drop, so that what belongs to another one is known
        self.send(1, 0, struct.pack("<IIhhHHHHII", self.own, self.root, 0, 0, 1, 1, 0, 1, 0, 0))
        self.send(22, 0, struct.pack("<III", self.own, selection, 0))
        self.tell(window, "XdndEnter", self.own, 5 << 24, uris, 0, 0)
        self.tell(window, "XdndPosition", self.own, 0, 20 << 16 | 20, 0, self.atom("XdndActionCopy"))
        self.tell(window, "XdndDrop", self.own, 0, 0, 0, 0)
        end = time.monotonic() + patience
        while time.monotonic() < end:
            if not self.events and not select.select([self.line], [], [], .1)[0]:
                continue
            event = self.events.pop(0) if self.events else self.message()
            if event[0] & 127 == 30:  # SelectionRequest
                at, owner, requestor, chosen, target, name = struct.unpack_from("<6I", event, 4)
                if owner != self.own:
                    continue
                self.send(18, 0, struct.pack("<IIIBxxxI", requestor, name, target, 8, len(urls)) + urls)
                self.send(25, 0, struct.pack("<II", requestor, 0) + struct.pack("<BxHIIIII8x", 31, 0, at, requestor, chosen, target, name))
            if event[0] & 127 == 33 and struct.unpack_from("<II", event, 4) == (self.own, self.atoms["XdndFinished"]):
                return True
        return False

    def end(self):
        self.line.close()
        self.process.terminate()
        self.process.wait()


def title(screen, window):
    return "" if not window else (screen.property(window, "_NET_WM_NAME") + screen.property(window, "WM_NAME")).decode(errors="replace")


def drops(test):
    """Mutated documents, and lists of urls that are none, are dropped on a window; afterwards a good file that is dropped is shown."""
    seeds = [path.read_bytes() for kind in ("classic", "xml", "json", "html", "import", "encodings", "codec")
             for path in sorted((ROOT / "tests/fuzz/corpus" / kind).iterdir())]
    (test.folder / "good0.x3dv").write_text(GOOD.format(0))
    screen = Screen(test)
    view = None
    try:
        environment = dict(os.environ, DISPLAY=f":{screen.number}", SDL_VIDEODRIVER="x11", SDL_AUDIODRIVER="dummy")
        view = Server(test, "view", test.folder / "good0.x3dv", "--size", "160x120", "--mute", "--json", is_silent=True, env=environment)
        window = 0
        if not wait_for(lambda: (view.process.poll() is not None) or screen.aware(), PATIENCE):
            raise Fault("there is no window")
        view.check()
        window = screen.aware()
        for dice in tried(test, view):
            ending = dice.choice([".x3dv", ".x3d", ".wrl", ".json", ".gltf", ".glb", ".stl", ".obj", ".ply", ".urdf", ".dae", ".html", ".rlog", ".rtsgb", ""])
            name = test.folder / f"dropped{test.number}{ending}"
            test.sent = [mutate(dice.choice(seeds), dice, seeds)]
            name.write_bytes(test.sent[0])
            urls = f"file://{name}\r\n".encode()
            if dice.random() < .2:
                urls = mutate(urls, dice, [b"file:///dev/zero\r\n", b"http://127.0.0.1:9/a.x3d\r\n", b"file:///tmp\r\n"])[:100000]
                test.sent.append(urls)
            said, window = len(view.said()), screen.aware() or window
            screen.drop(window, urls, 2)
            wait_for(lambda: len(view.said()) > said or name.name in title(screen, window), .5)
            name.unlink()
            if test.number % 10 == 9 or test.is_last():
                good = test.folder / f"good{test.number + 1}.x3dv"
                good.write_text(GOOD.format(test.number + 1))
                # A scene that was being opened brings a window of its own, and the one before it answers no more.
                if not any(screen.drop(screen.aware(), f"file://{good}\r\n".encode(), 20) for _ in range(9)):
                    raise Fault("the window does not take the good file")
                window = screen.aware()
                if not wait_for(lambda: good.name in title(screen, screen.aware()), PATIENCE):
                    raise Fault(f"the good file is not shown: {title(screen, screen.aware())} {view.said()[-300:]}")
        view.end()
    finally:
        if view:
            view.kill()
        screen.end()


