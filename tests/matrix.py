#!/usr/bin/env python3
"""Builds on other distributions, compilers and processors what the state needs, and checks that each state has the same hash.

usage: matrix.py [ROW...] [--leave-out ROW]... [--cache FOLDER] [--jobs N] [--list]

A row is a distribution or processor, a compiler, and options of the build. In each the libraries core, documents, scripts and sync are
built with the program `states`, which verifies the committed logs, runs again what kept its inputs, and compares the hashes of example
scenes; rows without a part build the program rtsg, or all, and run tests/logs/logs.py with it. Roots of other distributions are made by debootstrap,
once, in FOLDER (~/.cache/rtsg/matrix). At the end a table is printed. Exit status 0 if every row went well or was left out by name.
"""
import argparse
import dataclasses
import glob
import os
import pathlib
import platform
import shutil
import subprocess
import sys
import time

import options_off

SOURCE = pathlib.Path(__file__).resolve().parent.parent
LIBRARIES = ["libglm-dev", "libfmt-dev", "nlohmann-json3-dev", "libxxhash-dev", "libexpat1-dev", "zlib1g-dev", "libzmq3-dev", "libzstd-dev"]
TOOLS = ["ca-certificates", "g++", "clang-19", "cmake", "ninja-build", "pkgconf", "python3-minimal"]
SUITES = {"debian12": ("bookworm", "libmozjs-102-dev"), "debian13": ("trixie", "libmozjs-128-dev")}
MIRROR = "http://deb.debian.org/debian"


@dataclasses.dataclass
class Row:
    name: str
    where: str  # a key of SUITES, "here", or "arm64"
    compiler: str = "g++"
    options: tuple = ()
    part: str = "states"  # or "program", or "all" that there is
    emulator: tuple = ()


BASELINE, NATIVE = ("-DRTSG_ARCH=",), ("-DRTSG_ARCH=native",)
ROWS = [
    Row("debian12-gcc", "debian12", options=BASELINE),
    Row("debian12-clang", "debian12", "clang++-19", BASELINE),
    Row("debian12-native", "debian12", options=NATIVE),
    Row("debian13-gcc", "debian13", options=BASELINE),
    Row("debian13-clang", "debian13", "clang++-19", BASELINE),
    Row("debian13-native", "debian13", options=NATIVE),
    Row("arm64", "arm64", options=BASELINE),
    Row("old-processor", "here", options=BASELINE, emulator=("qemu-x86_64-static", "-cpu", "Nehalem")),  # of 2008: SSE4.2 at most
    Row("shared", "here", options=(*BASELINE, "-DBUILD_SHARED_LIBS=ON"), part="program"),
    Row("no-delay-load", "here", options=(*BASELINE, "-DRTSG_DELAY_LOAD=OFF"), part="program"),
    Row("no-pch", "here", options=(*BASELINE, "-DRTSG_PCH=OFF", "-DRTSG_TESTS=ON", "-DRTSG_BENCH=ON"), part="all"),
    # Each part left out that the program has. Logs have scripts in them.
    *(Row(f"no-{name.lower().replace('_', '-')}", "here", options=(*BASELINE, f"-DRTSG_{name}=OFF"), part="states" if name == "SCRIPTS" else "program")
      for name in options_off.options() if name not in ("EXAMPLES", "PYTHON", "BENCH")),
]


class CannotRun(Exception):
    """Why a row did not come to its checks."""


def run(words, log, what, **how):
    """Its output; raises CannotRun with the last line of it."""
    log.write(f"$ {' '.join(map(str, words))}\n")
    log.flush()
    done = subprocess.run(list(map(str, words)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", check=False, **how)
    log.write(done.stdout)
    log.flush()
    if done.returncode != 0:
        last = [line for line in done.stdout.splitlines() if line.strip()][-1:]
        raise CannotRun(f"{what}: {last[0].strip() if last else f'status {done.returncode}'} (see {log.name})")
    return done.stdout


def need(*programs):
    for program in programs:
        if not shutil.which(program):
            raise CannotRun(f"there is no {program} here")


def distribution():
    with open("/etc/os-release", encoding="utf-8") as file:
        return dict(line.rstrip().split("=", 1) for line in file if "=" in line).get("VERSION_CODENAME")


def root_of(where, cache, log):
    """The distribution's root, made if need be, and anew for other packages; whole, as what was begun has another name."""
    need("debootstrap")
    if os.geteuid() != 0:
        raise CannotRun("debootstrap and chroot need root")
    suite, scripts = SUITES[where]
    packages = ",".join([*TOOLS, scripts, *LIBRARIES])
    root, made_of = cache / where, cache / f"{where}.packages"
    if root.exists() and made_of.exists() and made_of.read_text() == packages:
        return root
    begun = cache / f"{where}.begun"
    for old in (root, begun):
        shutil.rmtree(old, ignore_errors=True)
    run(["debootstrap", "--variant=minbase", f"--include={packages}", suite, begun, MIRROR], log, "debootstrap")
    begun.rename(root)
    made_of.write_text(packages)
    return root


def arm64_root(cache, log):
    """Headers and libraries alone: nothing in it is run but by the emulator."""
    need("debootstrap", "dpkg-deb", "tar")
    root = cache / "arm64"
    if root.exists():
        return root
    begun = cache / "arm64.begun"
    shutil.rmtree(begun, ignore_errors=True)
    suite, scripts = SUITES["debian12"]
    packages = ["libc6-dev", "libstdc++-12-dev", scripts, *LIBRARIES]
    run(["debootstrap", "--foreign", "--arch=arm64", "--variant=minbase", f"--include={','.join(packages)}", suite, begun, MIRROR], log, "debootstrap")
    for package in sorted(begun.glob("var/cache/apt/archives/*.deb")):
        run(["sh", "-c", 'dpkg-deb --fsys-tarfile "$0" | tar -xk -C "$1" 2>/dev/null || true', package, begun], log, package.name)
    for link in begun.glob("usr/lib/aarch64-linux-gnu/*"):  # a linker would follow them out of the root
        if link.is_symlink() and os.readlink(link).startswith("/"):
            aim = begun / os.readlink(link).lstrip("/")
            link.unlink()
            link.symlink_to(os.path.relpath(aim.parent.resolve() / aim.name, link.parent.resolve()))
    begun.rename(root)
    return root


def toolchain(root, build):
    compilers = sorted(glob.glob("/usr/bin/aarch64-linux-gnu-g++*"))
    if not compilers:
        raise CannotRun("there is no compiler for arm64 here (g++-aarch64-linux-gnu)")
    need("qemu-aarch64-static")
    file = build / "arm64.cmake"
    file.write_text(f"""set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER {compilers[-1]})
set(CMAKE_NM aarch64-linux-gnu-nm)
set(CMAKE_AR aarch64-linux-gnu-ar)
set(CMAKE_RANLIB aarch64-linux-gnu-ranlib)
set(CMAKE_SYSROOT {root})
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(CMAKE_FIND_ROOT_PATH {root})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64-static;-L;{root})
""")
    return file


def check(row, cache, jobs):
    """What the row's checks say; raises CannotRun."""
    build = cache / "build" / row.name
    build.mkdir(parents=True, exist_ok=True)
    with open(cache / f"{row.name}.log", "w", encoding="utf-8") as log:
        source, folder, before = SOURCE, build, []
        options = ["-DCMAKE_BUILD_TYPE=Release", "-DRTSG_PCH=ON", "-DRTSG_TESTS=OFF", "-DRTSG_EXAMPLES=OFF", "-DRTSG_BENCH=OFF", "-DRTSG_WEB=OFF", *row.options]
        if row.part == "states":
            options.append("-DRTSG_STATE_ALONE=ON")
        emulator = list(row.emulator)
        if emulator:
            need(emulator[0])
        if row.where == "arm64":
            root = arm64_root(cache, log)
            options.append(f"-DCMAKE_TOOLCHAIN_FILE={toolchain(root, build)}")
            emulator = ["qemu-aarch64-static", "-L", root]
        else:
            options.append(f"-DCMAKE_CXX_COMPILER={row.compiler}")
            if row.where != "here" and distribution() != SUITES[row.where][0]:
                root = root_of(row.where, cache, log)
                # The sources are only read there, and what is mounted goes with the process.
                script = 'mkdir -p "$0/source" "$0/build" && mount --bind -o ro "$1" "$0/source" && mount --bind "$2" "$0/build" && shift 2 && exec chroot "$0" "$@"'
                before = ["unshare", "-m", "sh", "-c", script, root, SOURCE, build]
                source, folder = "/source", "/build"
        made_of = build / "CMakeCache.txt"
        if made_of.exists() and f"CMAKE_HOME_DIRECTORY:INTERNAL={source}\n" not in made_of.read_text():  # of a clone elsewhere
            for old in build.iterdir():
                if old.name != "arm64.cmake":
                    shutil.rmtree(old) if old.is_dir() else old.unlink()
        run([*before, "cmake", "-G", "Ninja", "-S", source, "-B", folder, *options], log, "configure")
        run([*before, "cmake", "--build", folder, "--parallel", jobs, "--target", {"program": "rtsg"}.get(row.part, row.part)], log, "build")
        if row.part == "states":
            said = run([*before, *emulator, f"{folder}/states", f"{source}/tests/logs"], log, "states differ")
        else:
            said = run([sys.executable, SOURCE / "tests/logs/logs.py", "--program", build / "rtsg"], log, "logs differ")
        return said.strip().splitlines()[-1]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", nargs="*", metavar="ROW")
    parser.add_argument("--leave-out", action="append", default=[], metavar="ROW")
    parser.add_argument("--cache", type=pathlib.Path, default=pathlib.Path.home() / ".cache/rtsg/matrix")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--list", action="store_true")
    arguments = parser.parse_args()
    names = [row.name for row in ROWS]
    for name in (*arguments.rows, *arguments.leave_out):
        if name not in names:
            parser.error(f"there is no row {name}; there are: {' '.join(names)}")
    if arguments.list:
        print("\n".join(names))
        return 0
    cache = arguments.cache.resolve()
    cache.mkdir(parents=True, exist_ok=True)
    table, failed = [], False
    for row in ROWS:
        start, outcome = time.monotonic(), "left out"
        if row.name not in arguments.leave_out and (not arguments.rows or row.name in arguments.rows):
            try:
                outcome = "same: " + check(row, cache, arguments.jobs)
            except CannotRun as reason:
                failed, outcome = True, f"FAILED: {reason}"
        table.append((row.name, row.where, row.compiler, " ".join(row.options), f"{time.monotonic() - start:.0f} s", outcome))
        print(f"{row.name}: {outcome}", file=sys.stderr, flush=True)
    widths = [max(len(cells[i]) for cells in table) for i in range(5)]
    print(f"matrix on {platform.machine()}, {distribution()}")
    for cells in table:
        print("  ".join([*(cell.ljust(width) for cell, width in zip(cells, widths)), cells[5]]))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
