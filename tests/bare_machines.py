#!/usr/bin/env python3
"""Does what is given to users run on bare machines: minimal roots of Debian 12 and 13, without a network where none is needed?

usage: bare_machines.py packages FOLDER | archive FOLDER | wheel FOLDER    [--suite NAME] [--cache FOLDER]

packages: `rtsg` and `librtsg-sync0.2` without recommends bring at most LIMITS; what README shows is run; what that lacks is named with the package
that has it; then the rest is installed and used, and everything is purged without a trace. Packages are tried on the distribution that they were
made on. archive: of rtsg-*.tar.zst, in two folders one after the other, without apt. wheel: of rtsg-*.whl, in an empty venv beside Debian's NumPy.
Needs root and debootstrap; roots are kept in FOLDER (~/.cache/rtsg/bare). Exit status 1 and a line for each fault.
"""
import argparse
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
MIRROR = "http://deb.debian.org/debian"
SUITES = ("bookworm", "trixie")
LIMITS = {"librtsg-sync0.2": 25, "rtsg": 210}  # MB with all that they bring, without recommends
ARCHIVE_LIMIT = 150  # MB unpacked
# What README and getting started show, but for windows, browsers and films, in less time. The program is rtsg, and examples/ is here.
USES = """
rtsg info examples/demo/hall.x3dv
rtsg validate examples/door.x3dv
rtsg convert examples/door.x3dv door.x3d
rtsg render examples/demo/hall.x3dv -o hall.png --size 96x54
rtsg render examples/hud.x3dv -o hud.jpg --size 96x54
rtsg render examples/room.x3dv -o room.exr --size 64x36 --integrator path --spp 2
rtsg listen examples/demo/hall.x3dv -o hall.wav --for 1s --metrics --binaural
rtsg run examples/door.x3dv --for 1s --fps 10 --watch DOOR.rotation --set PRESSED.set_boolean=TRUE@0.5
rtsg run examples/bodies.x3dv --for 1s --fps 10 --hash
rtsg record examples/demo/hall.x3dv -o hall.rlog --for 1s
rtsg replay hall.rlog --verify
rtsg replay hall.rlog --seek 0.5s --render then.png --size 64x36 --base examples/demo
rtsg record examples/door.x3dv -o door.rlog --for 1s --set PRESSED.set_boolean=TRUE@0.5
rtsg replay door.rlog --rerun examples/door.x3dv
(rtsg serve examples/demo/hall.x3dv --bind tcp://127.0.0.1:5570 --for 20s & server=$!; rtsg mirror tcp://127.0.0.1:5570 --for 2s --save replica.x3d; status=$?; kill $server; exit $status)
"""
# Commands that need a module of a package that is only recommended or suggested.
LACKS = {"rtsg view examples/door.x3dv --for 1s": "rtsg-window", "rtsg serve examples/door.x3dv --web 0 --for 1s": "rtsg-web",
         "rtsg render examples/door.x3dv -o door.tif --size 32x18": "rtsg-images",
         "rtsg render examples/door.x3dv -o door.mp4 --frames 2 --size 32x18": "rtsg-films"}
IN_PYTHON = """
import threading
import rtsg
scene = rtsg.load("examples/demo/hall.x3dv")
assert scene.render(width=96, height=54).any()
assert rtsg.load("examples/hud.x3dv").render(width=96, height=54).any()
assert scene.listen(0.5).samples.any()
with scene.record("python.rlog"):
    for frame in range(30):
        scene.frame(10 + frame / 30)
report = rtsg.Log("python.rlog").verify()
assert report["first_divergence"] is None and report["verified"] > 29, report

def origin():
    global ended
    served = rtsg.load("examples/door.x3dv")
    with served.serve() as server:
        address.append(server.endpoint)
        there.set()
        while server.statistics["peers"] == 0:
            server.wait(.01)
            server.service()
        for frame in range(30):
            served.frame(frame / 30)
            server.wait(1 / 30)
        server.drain()
        ended = served.hash

address, there = [], threading.Event()
thread = threading.Thread(target=origin)
thread.start()
there.wait()
follower = rtsg.follow(address[0])
assert len([changes.number for changes in follower]) > 20
thread.join()
assert follower.scene.hash == ended
"""


class Machine:
    """A root of its own, gone at the end. Its processes see a process table of their own."""

    def __init__(self, suite, cache, faults):
        self.suite, self.cache, self.faults = suite, cache, faults

    def __enter__(self):
        base = self.cache / self.suite
        if not base.exists():
            begun = self.cache / f"{self.suite}.begun"
            shutil.rmtree(begun, ignore_errors=True)
            self.cache.mkdir(parents=True, exist_ok=True)
            subprocess.run(["debootstrap", "--variant=minbase", self.suite, begun, MIRROR], check=True, stdout=subprocess.DEVNULL)
            begun.rename(base)
        self.scratch = tempfile.mkdtemp(dir=self.cache)
        self.root = pathlib.Path(self.scratch) / self.suite
        subprocess.run(["cp", "-a", base, self.root], check=True)
        return self

    def __exit__(self, *_):
        shutil.rmtree(self.scratch)

    def run(self, command, home="/root", path="", network=False):
        """Its output and status."""
        words = ["unshare", "--mount", "--pid", "--fork", *([] if network else ["--net"]), "sh", "-c",
                 'mount -t proc proc "$0/proc" && { ip link set lo up 2>/dev/null || true; } && exec chroot "$0" sh -c "$1"', self.root, f"cd {home} && {command}"]
        environment = {"PATH": f"{path}/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/root", "LC_ALL": "C.UTF-8",
                       "DEBIAN_FRONTEND": "noninteractive"}
        return subprocess.run(list(map(str, words)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", check=False, timeout=900, env=environment)

    def check(self, command, said="", status=(0,), **how):
        done = self.run(command, **how)
        if done.returncode not in status or said not in done.stdout:
            self.faults.append(f"{self.suite}: {command}\n  status {done.returncode}{f', not said: {said}' if said not in done.stdout else ''}: {done.stdout.strip()[-800:]}")
        return done.stdout

    def put_examples(self, home):
        shutil.copytree(ROOT / "examples", self.root / home.lstrip("/") / "examples")

    def use(self, home, path=""):
        for command in USES.strip().splitlines():
            self.check(command, home=home, path=path)


def installed(machine):
    """The packages and their MB."""
    rows = machine.run("dpkg-query -W -f='${Package} ${Installed-Size} ${db:Status-Abbrev}\n'").stdout.split("\n")
    sizes = [int(size) for _, size, status in (row.split() for row in rows if len(row.split()) == 3) if status == "ii"]
    return len(sizes), sum(sizes) / 1024


def files_of(machine):
    kept = re.compile(r"^(var/(cache|log|lib/(apt|dpkg))|root|debs|tmp|proc|run|etc/(apt|ld\.so\.cache|passwd|group|g?shadow)|usr/share/mime)")
    listed = set()
    for place, _, names in os.walk(machine.root):
        folder = os.path.relpath(place, machine.root)
        listed |= {path for name in names if not kept.match(path := os.path.normpath(os.path.join(folder, name)))}
    return listed


def try_packages(folder, cache, faults, suites):
    host = re.search(r"^VERSION_CODENAME=(\w+)", pathlib.Path("/etc/os-release").read_text(), re.M)[1]
    for suite in suites or [host]:
        for package, limit in LIMITS.items():
            with Machine(suite, cache, faults) as machine:
                shutil.copytree(folder, machine.root / "debs")
                listed = subprocess.run(["dpkg-scanpackages", "-m", "."], cwd=machine.root / "debs", capture_output=True, text=True, check=True).stdout
                (machine.root / "debs/Packages").write_text(listed)
                (machine.root / "etc/apt/sources.list.d/rtsg.list").write_text("deb [trusted=yes] file:/debs ./\n")
                machine.check("apt-get update -qq", network=True)
                before, (count, size) = files_of(machine), installed(machine)
                machine.check(f"apt-get install -y -qq --no-install-recommends {package}", network=True)
                now, larger = installed(machine)
                print(f"{suite}: {package} without recommends: {now - count} packages, {larger - size:.0f} MB", flush=True)
                if larger - size > limit:
                    faults.append(f"{suite}: {package} brings more than {limit} MB")
                if package == "rtsg":
                    use_packages(machine, listed)
                ours = " ".join(re.findall(r"^Package: (\S+)", listed, re.M))
                machine.check(f"apt-get purge -y -qq --autoremove {ours} g++ make cmake fonts-dejavu-core '?automatic'", network=True)
                faults += [f"{suite}: left after the purge of {package}: {path}" for path in sorted(files_of(machine) - before)[:20]]


def use_packages(machine, listed):
    machine.put_examples("/root")
    machine.use("/root")
    for command, package in LACKS.items():
        machine.check(command, said=f"(Debian package {package})", status=(0, 1))
    rest = " ".join(name for name in re.findall(r"^Package: (\S+)", listed, re.M) if not name.endswith("-dbgsym"))
    machine.check(f"apt-get install -y -qq --no-install-recommends {rest} fonts-dejavu-core", network=True)
    about = json.loads(machine.check("rtsg --version --json"))
    machine.faults += [f"{machine.suite}: module {name} does not load, with all packages installed" for name, there in about["modules"].items() if not there]
    machine.check("rtsg render examples/door.x3dv -o door.gif --frames 2 --size 32x18 && rtsg render examples/door.x3dv -o door.mp4 --frames 2 --size 32x18")
    (machine.root / "root/try.py").write_text(IN_PYTHON)
    machine.check("python3 try.py")
    # The tests that a distribution runs of installed packages.
    shutil.copytree(ROOT / "debian/tests", machine.root / "root/tests")
    machine.check("apt-get install -y -qq --no-install-recommends g++ make cmake", network=True)
    for test in re.findall(r"^Tests: (\S+)", (ROOT / "debian/tests/control").read_text(), re.M):
        machine.check(f"mkdir /tmp/{test} && AUTOPKGTEST_TMP=/tmp/{test} tests/{test}")


def try_archive(folder, cache, faults, suites):
    for suite in suites or SUITES:
        with Machine(suite, cache, faults) as machine:
            archive = max(folder.glob("rtsg-*-linux-*.tar.zst"), key=os.path.getmtime)
            for home in ("/opt", "/a folder/of mine"):
                # A folder that is moved has to go on working: the first one is gone.
                place = machine.root / home.lstrip("/")
                place.mkdir(parents=True, exist_ok=True)
                if home == "/opt":
                    subprocess.run(["tar", "--zstd", "-xf", archive, "-C", place], check=True)
                    size = sum(file.stat().st_size for file in place.rglob("*") if file.is_file() and not file.is_symlink()) / 1e6
                    if size > ARCHIVE_LIMIT:
                        faults.append(f"{suite}: {archive.name} has {size:.0f} MB unpacked, and may have {ARCHIVE_LIMIT}")
                else:
                    (machine.root / "opt" / archive.name.removesuffix(".tar.zst")).rename(place / archive.name.removesuffix(".tar.zst"))
                    (machine.root / "root").chmod(0o700)
                work = f"/root/{len(home)}"
                machine.put_examples(work)
                machine.use(work, path=f"{home}/{archive.name.removesuffix('.tar.zst')}/bin:")
            print(f"{suite}: {archive.name} used in two folders", flush=True)


def try_wheel(folder, cache, faults, suites):
    for suite in suites or [re.search(r"^VERSION_CODENAME=(\w+)", pathlib.Path("/etc/os-release").read_text(), re.M)[1]]:
        with Machine(suite, cache, faults) as machine:
            wheel = max(folder.glob("rtsg-*-manylinux_*.whl"), key=os.path.getmtime)
            machine.check("apt-get update -qq && apt-get install -y -qq --no-install-recommends python3-venv python3-numpy python3-pytest", network=True)
            shutil.copy(wheel, machine.root / "root")
            machine.put_examples("/root")
            (machine.root / "root/try.py").write_text(IN_PYTHON)
            machine.check(f"python3 -m venv --system-site-packages venv && venv/bin/pip install --no-index --no-deps {wheel.name}")
            machine.check("venv/bin/python try.py")
            machine.check("venv/bin/python -m pip check")
            print(f"{suite}: {wheel.name} installed and used", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("packages", "archive", "wheel"))
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--suite", action="append", choices=SUITES)
    parser.add_argument("--cache", type=pathlib.Path, default=pathlib.Path.home() / ".cache/rtsg/bare")
    options = parser.parse_args()
    if os.geteuid() != 0:
        sys.exit("bare_machines.py: chroot needs root")
    faults = []
    {"packages": try_packages, "archive": try_archive, "wheel": try_wheel}[options.what](options.folder, options.cache, faults, options.suite)
    print("\n".join([*faults, f"{len(faults)} faults"]))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
