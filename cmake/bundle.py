#!/usr/bin/env python3
"""Makes of this project's Debian packages what runs without them: an archive for any folder, and a wheel.

usage: bundle.py archive|wheel DEBS [-o FOLDER]

DEBS is the folder of packages that `./dev package` has made on this machine. The libraries of others that they need are copied in, with a part of
their hash in their names, and are looked for beside the modules (patchelf). Not copied is what has to be the machine's own: the C and C++ runtime,
and what belongs to drivers, displays and sound cards. The licences of all that is copied stand in a file each. The same packages give the same bytes.
Exit status 1: a library or a licence is missing.
"""
import argparse
import functools
import gzip
import hashlib
import os
import pathlib
import platform
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "python"))
import wheel_backend  # noqa: E402

# Names of libraries, up to ".so", that are the machine's own. Of GL only what GLU is linked with is copied, which draws nothing.
SYSTEM = re.compile(r"^(ld-linux[\w-]*|linux-vdso|lib(c|m|dl|rt|pthread|resolv|util|stdc\+\+|gcc_s|GL|EGL|GLX|GLESv2|drm|gbm|asound"
                    r"|X11|X11-xcb|xcb|wayland-client|wayland-server|wayland-egl))\.so")
# Packages whose modules bring much for few, or need a display's libraries at their own place.
LEFT_OUT = {"rtsg-images": "TIFF, GIF, HDR and KTX2 files", "rtsg-films": "films and packed sounds", "rtsg-sofa": "responses as SOFA files",
            "rtsg-ogre": "pictures by OGRE", "rtsg-modellers": "Collada, FBX, 3DS and OFF files", "rtsg-fetch": "files from the web"}
# Of the libraries for newer processors (x86-64-v3) those that trace: in the others most time goes elsewhere.
TRACING = re.compile(r"^librtsg_(light|audio|world)\.so")
NOT_IN_WHEELS = ("rtsg", "rtsg-window", "rtsg-web", "rtsg-mqtt")
FONTS = pathlib.Path("/usr/share/fonts/truetype/dejavu")
FONTS_CONF = """<?xml version="1.0"?>
<!DOCTYPE fontconfig SYSTEM "urn:fontconfig:fonts.dtd">
<!-- Where the system has no fontconfig of its own. -->
<fontconfig>
  <dir prefix="relative">.</dir>
  <dir>/usr/share/fonts</dir>
  <dir prefix="xdg">fonts</dir>
  <cachedir prefix="xdg">fontconfig</cachedir>
  <alias><family>serif</family><prefer><family>DejaVu Serif</family></prefer></alias>
  <alias><family>sans-serif</family><prefer><family>DejaVu Sans</family></prefer></alias>
  <alias><family>monospace</family><prefer><family>DejaVu Sans Mono</family></prefer></alias>
</fontconfig>
"""


def output(*command):
    return subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True, env={**os.environ, "LC_ALL": "C"}).stdout


def is_elf(file):
    if file.is_symlink() or not file.is_file():
        return False
    with open(file, "rb") as opened:
        return opened.read(4) == b"\x7fELF"


def dynamic(file):
    """The libraries that it needs, and the folders where it looks for them."""
    listed = output("readelf", "-d", file)
    paths = re.findall(r"\((?:RUNPATH|RPATH)\).*\[(.*)\]", listed)
    return re.findall(r"\(NEEDED\).*\[(.*)\]", listed), [item for path in paths for item in path.split(":") if item]


class Machine:
    """Where the libraries of this machine lie, and which packages they are of."""

    def __init__(self):
        kind = {"x86_64": "x86-64", "aarch64": "AArch64"}[platform.machine()]
        self.files = {}
        for name, path in re.findall(rf"^\s*(\S+) \(libc6,{kind}[^)]*\) => (\S+)$", output("/sbin/ldconfig", "-p"), re.M):
            self.files.setdefault(name, path)

    def find(self, name, folders):
        for folder in folders:
            if folder.startswith("/") and os.path.exists(os.path.join(folder, name)):
                return pathlib.Path(folder, name).resolve()
        # Some are needed by another name than the one by which the loader's list has them.
        for path in (self.files.get(name), *(f"{folder}/{platform.machine()}-linux-gnu/{name}" for folder in ("/usr/lib", "/lib"))):
            if path and os.path.exists(path):
                return pathlib.Path(path).resolve()
        sys.exit(f"bundle.py: {name} is not on this machine")

    @functools.cached_property
    def owners(self):
        """The package of each library and font."""
        found = {}
        for listed in pathlib.Path("/var/lib/dpkg/info").glob("*.list"):
            package = listed.name.removesuffix(".list").split(":")[0]
            found.update((line, package) for line in listed.read_text().splitlines() if ".so" in line or line.endswith(".ttf"))
        return found

    def package(self, file):
        for path in (str(file), str(file).removeprefix("/usr"), f"/usr{file}"):
            if path in self.owners:
                return self.owners[path]
        sys.exit(f"bundle.py: {file} is in no package, so that its licence is not known")


def unpack(debs, left_out, to):
    """Unpacks the project's packages; returns the version."""
    versions = set()
    for deb in sorted(debs.glob("*.deb")):
        name, version = output("dpkg-deb", "--show", "--showformat=${Package} ${Version}", deb).split()
        if name in left_out or name.endswith(("-dev", "-doc", "-dbgsym")):
            continue
        subprocess.run(["dpkg-deb", "-x", deb, to], check=True)
        versions.add(version)
    for file in to.glob("usr/lib/*/glibc-hwcaps/*/*"):
        if not TRACING.match(file.name):
            file.unlink()
    if len(versions) != 1:
        sys.exit(f"bundle.py: {debs} has packages of {len(versions)} versions: ./dev package makes those of one")
    return versions.pop()


def bring_libraries(tree, folder):
    """Copies what files in `tree` need into `folder` of it, and lets them find it there. Returns the packages that it is of."""
    machine, packages, names = Machine(), {}, {}
    elves = [file for file in sorted(tree.rglob("*")) if is_elf(file)]
    ours = {file.name for file in tree.rglob("*.so*")}
    needs = {file: dynamic(file) for file in elves}
    ahead = [(name, folders) for needed, folders in needs.values() for name in needed]
    folder.mkdir(parents=True, exist_ok=True)
    while ahead:
        name, folders = ahead.pop()
        if name in names or name in ours or SYSTEM.match(name):
            continue
        file = machine.find(name, folders)
        packages.setdefault(machine.package(file), []).append(name)
        stem, end = name.split(".so", 1)
        names[name] = f"{stem}-{hashlib.sha256(file.read_bytes()).hexdigest()[:8]}.so{end}"
        copy = folder / names[name]
        shutil.copy(file, copy)
        copy.chmod(0o755)
        subprocess.run(["patchelf", "--set-soname", copy.name, copy], check=True)
        elves.append(copy)
        needs[copy] = dynamic(copy)
        ahead += [(needed, needs[copy][1]) for needed in needs[copy][0]]
    for file in elves:
        needed, folders = needs[file]
        renamed = [word for name in needed if name in names for word in ("--replace-needed", name, names[name])]
        own = os.path.relpath(folder, file.parent)
        kept = [item for item in folders if item.startswith("$ORIGIN")]
        kept += [item for item in ("$ORIGIN", "$ORIGIN/" + own) if item not in kept and item != "$ORIGIN/."]
        # One after the other: with both at once, patchelf 0.14 writes one over the other.
        if renamed:
            subprocess.run(["patchelf", *renamed, file], check=True)
        subprocess.run(["patchelf", "--set-rpath", ":".join(kept), file], check=True)
        if dynamic(file)[1] != kept:
            sys.exit(f"bundle.py: patchelf has given {file.name} the search path {dynamic(file)[1]} in place of {kept}")
    return packages


def bring_fonts(folder, packages):
    folder.mkdir()
    machine = Machine()
    for file in sorted(FONTS.glob("DejaVu*.ttf")):
        if machine.package(file) == "fonts-dejavu-core":
            shutil.copy(file, folder)
    if not list(folder.iterdir()):
        sys.exit("bundle.py: fonts-dejavu-core is not installed")
    (folder / "fonts.conf").write_text(FONTS_CONF)
    packages["fonts-dejavu-core"] = [file.name for file in sorted(folder.glob("*.ttf"))]


def write_licences(folder, packages):
    """A file for each package, and a page that names what was copied of it and where its source is."""
    folder.mkdir(parents=True)
    lines = ["What this copy of RTSG holds of others, the Debian packages that it was taken from, and their licences in the files beside this one.",
             "Their sources are those of these versions (apt-get source PACKAGE=VERSION, or snapshot.debian.org). RTSG itself: Apache-2.0, in RTSG.txt.", ""]
    shutil.copy(ROOT / "LICENSE", folder / "RTSG.txt")
    for package in sorted(packages):
        text = pathlib.Path("/usr/share/doc", package, "copyright")
        zipped = text.with_suffix(".gz")
        if not text.exists() and not zipped.exists():
            sys.exit(f"bundle.py: {package} has no licence in {text}")
        (folder / f"{package}.txt").write_bytes(text.read_bytes() if text.exists() else gzip.decompress(zipped.read_bytes()))
        source, version = output("dpkg-query", "-W", "-f", "${source:Package} ${source:Version}\n", package).splitlines()[0].split()
        lines.append(f"{package}.txt: {', '.join(sorted(packages[package]))} (source {source} {version})")
    (folder / "README.txt").write_text("\n".join(lines) + "\n")


def newest_glibc(tree):
    versions = {tuple(map(int, version)) for file in tree.rglob("*") if is_elf(file) for version in re.findall(r"GLIBC_(\d+)\.(\d+)", output("readelf", "-V", file))}
    return max(versions)


def reset(entry):
    entry.uid = entry.gid = 0
    entry.uname = entry.gname = "root"
    entry.mtime = int(os.environ.get("SOURCE_DATE_EPOCH", "315532800"))
    entry.mode = 0o755 if entry.isdir() or entry.mode & 0o100 else 0o644
    return entry


def make_archive(debs, to, scratch):
    version = unpack(debs, {*LEFT_OUT, "python3-rtsg"}, scratch / "unpacked")
    name = f"rtsg-{version}-linux-{platform.machine()}"
    tree = scratch / name
    (scratch / "unpacked/usr").rename(tree)
    for part in ("doc", "lintian"):
        shutil.rmtree(tree / "share" / part, ignore_errors=True)
    modules = next(tree.glob("lib/*/rtsg"))
    packages = bring_libraries(tree, modules)
    bring_fonts(modules / "fonts", packages)
    write_licences(tree / "licences", packages)
    (tree / "README.txt").write_text(
        f"RTSG {version}: bin/rtsg runs from wherever this folder lies. It needs glibc {'.'.join(map(str, newest_glibc(tree)))} and the C++ runtime of GCC 12, or newer ones;\n"
        "`rtsg view` the libraries of the display (X11 or Wayland, GL), and sound devices ALSA. The licences of what it holds are in licences/.\n"
        f"Left out for its size: {'; '.join(LEFT_OUT.values())}. The Debian packages {', '.join(LEFT_OUT)} have it.\n")
    with tempfile.TemporaryFile() as plain:
        with tarfile.open(fileobj=plain, mode="w", format=tarfile.GNU_FORMAT) as tar:
            tar.add(tree, name, recursive=False, filter=reset)
            for file in sorted(tree.rglob("*")):
                tar.add(file, f"{name}/{file.relative_to(tree)}", recursive=False, filter=reset)
        plain.seek(0)
        with open(to / f"{name}.tar.zst", "wb") as packed:
            subprocess.run(["zstd", "-q", "-19", "-T1", "-c"], stdin=plain, stdout=packed, check=True)
    return to / f"{name}.tar.zst", tree


def make_wheel(debs, to, scratch):
    unpack(debs, {*LEFT_OUT, *NOT_IN_WHEELS}, scratch / "unpacked")
    package = scratch / "wheel/rtsg"
    shutil.copytree(next((scratch / "unpacked").glob("usr/lib/python3/dist-packages/rtsg")), package)
    libraries = next((scratch / "unpacked").glob("usr/lib/*/librtsg_core.so.*")).parent
    for file in [*libraries.glob("librtsg_*.so.*.*.*"), *libraries.glob("glibc-hwcaps/*/librtsg_*.so.*.*.*"), *libraries.glob("rtsg/*.so")]:
        # By the name that others look for: a wheel holds no links.
        found = re.search(r"\(SONAME\).*\[(.*)\]", output("readelf", "-d", file))
        part = file.parent.relative_to(libraries)
        target = package / ("" if part == pathlib.Path("rtsg") else part) / (found[1] if found else file.name)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, target)
    packages = bring_libraries(scratch / "wheel", package)
    bring_fonts(package / "fonts", packages)
    write_licences(package / "licences", packages)
    files = {file.relative_to(scratch / "wheel").as_posix(): file.read_bytes() for file in sorted((scratch / "wheel").rglob("*")) if file.is_file()}
    major, minor = newest_glibc(scratch / "wheel")
    tags = {re.search(r"cpython-(\d+)", file.name)[1] for file in package.glob("_rtsg*.so")}
    if len(tags) != 1:
        sys.exit(f"bundle.py: extensions for {len(tags)} versions of Python")
    name = wheel_backend.write_wheel(to, wheel_backend.project(), files, f"cp{tags.pop()}", f"manylinux_{major}_{minor}_{platform.machine()}")
    return to / name, scratch / "wheel"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("archive", "wheel"))
    parser.add_argument("debs", type=pathlib.Path)
    parser.add_argument("-o", "--output", type=pathlib.Path, default=pathlib.Path("."))
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        file, tree = {"archive": make_archive, "wheel": make_wheel}[options.what](options.debs.resolve(), options.output, pathlib.Path(folder))
        unpacked = sum(path.stat().st_size for path in tree.rglob("*") if path.is_file() and not path.is_symlink())
        print(f"{file}: {file.stat().st_size / 1e6:.1f} MB, {unpacked / 1e6:.1f} MB unpacked")


if __name__ == "__main__":
    main()
