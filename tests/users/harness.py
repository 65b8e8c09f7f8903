"""What the three users' tests share: the program, scratch folders, load on the machine, and checks that say what differs.

Every test is a function named test_*; run() calls those of a module, each in a folder of its own, prints a line for
each and a last line that counts them. RTSG_LONG=1 in the environment takes the long form: tests on a loaded machine as well
(@only_long), and longer sessions. Threading: one thread; programs that are still running at the end are killed.
"""
import argparse
import contextlib
import json
import os
import pathlib
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import traceback

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
PATIENCE = 240  # seconds; only a failing test ever waits this long
LONG = "RTSG_LONG" in os.environ


class Skipped(Exception):
    """The test cannot be run here; its text says why."""


def only_long(test):
    """Marks a test that loads the machine for minutes."""
    test.is_only_long = True
    return test


def check(condition, text):
    if not condition:
        raise AssertionError(text)


def equal(actual, expected, what):
    check(actual == expected, f"{what}: {actual!r}, expected {expected!r}")


class Program:
    """One run of rtsg; its streams are kept in files, so that nothing ever waits for a pipe."""

    def __init__(self, user, arguments):
        self.name = f"{len(user.programs):02d}-{arguments[0]}"
        self.out_path, self.err_path = user.folder / f"{self.name}.out", user.folder / f"{self.name}.err"
        with open(self.out_path, "wb") as out, open(self.err_path, "wb") as err:
            self.process = subprocess.Popen([str(user.program), *map(str, arguments)], stdin=subprocess.DEVNULL, stdout=out,
                                            stderr=err, cwd=user.folder)

    @property
    def out(self):
        return self.out_path.read_text(errors="replace")

    @property
    def err(self):
        return self.err_path.read_text(errors="replace")

    def wait(self):
        try:
            self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise AssertionError(f"{self.name} is still running after {PATIENCE} s; it said {self.err!r}") from None
        return self.process.returncode

    def done(self, status=0):
        """Waits; the last line of its output as JSON, if it is some."""
        returned = self.wait()
        check(returned == status, f"{self.name} ended with {returned}, expected {status}: {self.out[-600:]!r} {self.err[-600:]!r}")
        lines = self.out.strip().splitlines()
        with contextlib.suppress(ValueError, IndexError):
            return json.loads(lines[-1])
        return None

    def first_line(self):
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            text = self.out
            if "\n" in text:
                return json.loads(text.splitlines()[0])
            check(self.process.poll() is None, f"{self.name} ended: {self.err!r}")
            time.sleep(0.02)
        raise AssertionError(f"{self.name} printed nothing")

    def signal(self, number):
        self.process.send_signal(number)


class User:
    """A user at work in a folder."""

    def __init__(self, program, folder):
        self.program, self.folder, self.programs, self.burners = program, pathlib.Path(folder), [], []

    def start(self, *arguments):
        self.programs.append(Program(self, arguments))
        return self.programs[-1]

    def run(self, *arguments, status=0):
        return self.start(*arguments).done(status)

    def path(self, name):
        return self.folder / name

    def serve(self, scene, *more):
        server = self.start("serve", scene, "--bind", f"ipc://{self.folder}/socket", "--json", *more)
        return server, server.first_line()["endpoint"]

    @contextlib.contextmanager
    def load(self):
        """Twice as many busy processes as cores."""
        burners = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2 * (os.cpu_count() or 1))]
        try:
            yield
        finally:
            for burner in burners:
                burner.kill()
                burner.wait()

    def close(self):
        for program in self.programs:
            if program.process.poll() is None:
                program.process.kill()
                program.process.wait()


def wav_samples(path):
    """(channels, sample rate, samples of a channel) of a WAV; its sizes must agree with the file's."""
    data = pathlib.Path(path).read_bytes()
    check(data[:4] == b"RIFF" and data[8:12] == b"WAVE", f"{path} is no WAV")
    at, channels, rate, width = 12, 0, 0, 0
    while at + 8 <= len(data):
        name, size = data[at:at + 4], struct.unpack_from("<I", data, at + 4)[0]
        if name == b"fmt ":
            channels, rate = struct.unpack_from("<HI", data, at + 10)
            width = struct.unpack_from("<H", data, at + 22)[0] // 8
        if name == b"data":
            check(at + 8 + size <= len(data), f"{path} is cut short")
            return channels, rate, size // (channels * width)
        at += 8 + size + size % 2
    raise AssertionError(f"{path} has no samples")


def is_whole_png(path):
    data = pathlib.Path(path).read_bytes()
    return data[:8] == b"\x89PNG\r\n\x1a\n" and data[-12:-4] == b"\0\0\0\0IEND"


def without_notes(path):
    """A file's bytes, of a .png without the notes that say what it was made of."""
    data = pathlib.Path(path).read_bytes()
    if not data.startswith(b"\x89PNG"):
        return data
    kept, at = data[:8], 8
    while at < len(data):
        end = at + 12 + int.from_bytes(data[at:at + 4], "big")
        if data[at + 4:at + 8] != b"iTXt":
            kept += data[at:end]
        at = end
    return kept


def pictures(folder, pattern):
    return sorted(p.name for p in pathlib.Path(folder).iterdir() if re.fullmatch(pattern, p.name))


def only(folder, allowed):
    """Nothing half made lies about."""
    left = [p.name for p in pathlib.Path(folder).iterdir() if p.name.endswith((".tmp", ".part", ".new")) or p.name.startswith(".")]
    check(not left, f"left behind: {left} (allowed: {allowed})")


@contextlib.contextmanager
def small_disk(folder, kilobytes):
    """A file system of that size at `folder`; needs root."""
    folder.mkdir()
    mounted = os.geteuid() == 0 and subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(folder)], capture_output=True).returncode == 0
    if not mounted:
        raise Skipped("a small file system cannot be mounted here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=False)


def run(module):
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--program", default=ROOT / "build" / "rtsg", type=pathlib.Path)
    arguments.add_argument("--only", default="", help="part of a test's name")
    arguments.add_argument("--keep", action="store_true", help="leave the scratch folders")
    options = arguments.parse_args()
    passed = failed = skipped = 0
    for name, test in sorted(vars(module).items()):
        if not name.startswith("test_") or options.only not in name or not LONG and hasattr(test, "is_only_long"):
            continue
        folder = tempfile.mkdtemp(prefix="rtsg-user-")
        user, begun = User(options.program.resolve(), folder), time.monotonic()
        try:
            test(user)
            passed += 1
            print(f"ok      {name}  {time.monotonic() - begun:.1f} s", flush=True)
        except Skipped as why:
            skipped += 1
            print(f"skipped {name}: {why}", flush=True)
        except Exception:  # a test that fails must not hide the others
            failed += 1
            print(f"FAILED  {name}\n{traceback.format_exc()}", flush=True)
        finally:
            user.close()
            if not options.keep:
                shutil.rmtree(folder, ignore_errors=True)
    print(f"{passed} passed, {failed} failed, {skipped} skipped")
    return 1 if failed or not passed + skipped else 0


__all__ = ["LONG", "ROOT", "Skipped", "User", "check", "equal", "is_whole_png", "only", "only_long", "pictures", "run", "signal", "small_disk", "time",
           "wav_samples", "without_notes"]
