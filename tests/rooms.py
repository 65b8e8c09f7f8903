#!/usr/bin/env python3
"""Are the sources laid out as docs/rooms.md says?

A room is a folder below LIBRARY/src, or below a program's own folder (app), where headers have names of their own. The first table there names all of them, from the top to the bottom: a file may include what is in
its own room or in one further down, and of other libraries what its own is linked with. Each room has a row, and each row a room. A
public header belongs to the room of the .cpp of its name; the second table has those without one. No units that include each other in a
loop are more than KNOT; a unit is a header with its source. No room has more than FILES. docs/architecture.md has a row for each library, which
says what it may use. Exit status 1 and a line for each fault.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "cmake"))
from libraries import FOLDERS  # noqa: E402

KNOT, FILES = 6, 28
LARGER = {}  # rooms that are yet to be divided
# Outside libraries that only one room of a library may include, or those that are named.
DOORS = {r"^embree[34]/": ("renderers/world", "embree"), r"^tbb/(parallel|task|blocked)": ("renderers/world", "embree"), r"^OpenImageIO/": ("renderers/images", "image_module"),
         r"^lib(av(?!util/tx\.h)|sw)": ("renderers/images", "movie_module"), r"^libavutil/tx\.h": ("audio", "fft_module"), r"^kissfft/": ("audio", "signal"),
         r"^(ft2build|fontconfig/|hb)": ("renderers/geometry", "font_module"), r"^(jsapi\.h|js/)": ("scripts", "engine"), r"^expat\.h": ("documents", "commands"), r"^assimp/": ("documents", "assimp_module"),
         r"^zmq": ("sync", "transport"), r"^boost/": ("sync", "web_module"), r"^AL/": ("audio", "sound_io"), r"^ode/": ("physics", "engine"),
         r"^netcdf\.h": ("audio", "netcdf_module"), r"^(curl/|openssl/evp)": ("fetch", "curl_module"), r"^(mosquitto|mqtt_protocol)\.h": ("feeds", "mqtt_module"), r"^SDL": ("window", "sdl_module"),
         r"^draco/": ("documents", "gltf_module"), r"^meshoptimizer\.h": ("documents", "gltf_module"),
         r"^Ogre\w": ("ogre", "ogre_module"), r"^nats/nats\.h": ("nats", "nats_module")}
# Names of outside libraries that only one room may use, comments aside.
NAMES = {r"\brtc[A-Z]\w*|\bRTC\w*": ("renderers/world", "embree")}


class Rooms:
    """The tables of the page: rooms by their rank, and public headers that have no source of their name."""

    def __init__(self, page):
        self.rank, self.headers = {}, {}
        for line in page.read_text().splitlines():
            cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
            names = re.findall(r"`([^`]+)`", cells[0])
            if len(cells) == 5 and names:
                self.rank[names[0], cells[1].strip("`")] = len(self.rank)
            elif len(cells) == 2 and names:
                self.headers.update({name: cells[1].strip("`") for name in names})
        self.libraries = list(dict.fromkeys(library for library, _ in self.rank))


def depends(library):
    """The libraries that the target of one is linked with by its DEPENDS, by their names; a program is linked with all."""
    called = re.search(r"rtsg_library\(" + library.split("/")[-1] + r"\b([^)]*)\)", (ROOT / library / "CMakeLists.txt").read_text())
    if not called:
        return [folder.split("/")[-1] for folder in FOLDERS]
    found = re.search(r"\bDEPENDS((?: [a-z_]+)*)", called[1])
    return found[1].split() if found else []


def check_page():
    """Faults of the table of folders in docs/architecture.md."""
    page = (ROOT / "docs" / "architecture.md").read_text()
    rows = dict(re.findall(r"^\| `([a-z_/]+)/` \|[^|]*\| ([^|]*) \|$", page, re.M))
    for library in FOLDERS:
        uses = ", ".join(depends(library)) or "no other folder"
        if rows.get(library) != uses:
            yield f"docs/architecture.md: `{library}/` may use {uses}, not {rows.get(library, 'what no row says')}"


def isLibrary(folder):
    return folder in FOLDERS


def inside(folder):
    """Where the rooms of a library are, or those of a program."""
    return ROOT / folder / "src" if isLibrary(folder) else ROOT / folder


class Sources:
    """Every header and source of the libraries and of the program: its room, its unit, and what it includes."""

    def __init__(self, rooms):
        self.rooms, self.faults = rooms, []
        self.room, self.unit = {}, {}
        for library in rooms.libraries:
            for path in sorted(inside(library).rglob("*")):
                if path.suffix in (".cpp", ".h"):
                    self.place(path, library, path.parent.relative_to(inside(library)).as_posix(), path.with_suffix(""))
            for path in sorted((ROOT / library / "include" / "rtsg").glob("*/*.h")):
                self.place_header(path, library)

    def place(self, path, library, room, unit):
        self.room[path], self.unit[path] = (library, room), unit
        if (library, room) not in self.rooms.rank:
            self.faults.append(f"{path.relative_to(ROOT)}: its folder has no row in docs/rooms.md")

    def place_header(self, path, library):
        sources = [source for source in self.room if source.suffix == ".cpp" and self.room[source][0] == library and
                   path.stem in (source.stem, f"{source.parent.name}_{source.stem}")]
        named = self.rooms.headers.get(f"{path.parent.name}/{path.name}")
        if named:
            self.place(path, library, named, sources[0].with_suffix("") if len(sources) == 1 else path.with_suffix(""))
        elif len(sources) == 1:
            self.place(path, library, self.room[sources[0]][1], sources[0].with_suffix(""))
        else:
            self.faults.append(f"{path.relative_to(ROOT)}: a header without a source of its name has a row in docs/rooms.md")

    def find(self, path, included, quoted):
        """The file that an include line names, if it is one of these."""
        library = self.room[path][0]
        candidates = [path.parent / included, *(inside(other) / included for other in (library, *self.rooms.libraries))] if quoted else []
        if quoted and not isLibrary(library):
            candidates += [inside(library) / room / included for of, room in self.rooms.rank if of == library]
        candidates += [ROOT / other / "include" / included for other in self.rooms.libraries]
        return next((file for file in candidates if file in self.room), None)


def knots(arrows):
    """Sets of units that include each other in a loop (Tarjan)."""
    number, low, stack, found = {}, {}, [], []

    def visit(unit):
        number[unit] = low[unit] = len(number)
        stack.append(unit)
        for other in arrows.get(unit, ()):
            if other not in number:
                visit(other)
            if other in stack:
                low[unit] = min(low[unit], low[other])
        if low[unit] == number[unit]:
            loop = stack[stack.index(unit):]
            del stack[stack.index(unit):]
            found.append(loop)

    sys.setrecursionlimit(10_000)
    for unit in list(arrows):
        if unit not in number:
            visit(unit)
    return found


def check_file(path, sources, linked, arrows):
    """Faults in one file; adds what it includes to `arrows`."""
    rooms, (library, room) = sources.rooms, sources.room[path]
    name = path.relative_to(ROOT)
    for number, line in enumerate(path.read_text().splitlines(), 1):
        for pattern, door in NAMES.items():
            if (library, room) != door and (named := re.search(pattern, line.split("//")[0])):
                yield f"{name}:{number}: {named.group()} belongs behind {'/src/'.join(door)}"
        match = re.match(r'\s*#\s*include\s*([<"])([^>"]+)[>"]', line)
        if not match:
            continue
        included = match[2]
        for pattern, door in DOORS.items():
            if re.match(pattern, included) and (library != door[0] or room not in door[1:]):
                yield f"{name}:{number}: {included} belongs behind {'/src/'.join(door[:2])}"
        target = sources.find(path, included, match[1] == '"')
        if not target:
            continue
        arrows.setdefault(sources.unit[path], set()).add(sources.unit[target])
        other = sources.room[target]
        if other[0] not in linked:
            yield f"{name}:{number}: {library} is not linked with {other[0]} ({included})"
        elif rooms.rank.get(other, 0) < rooms.rank.get((library, room), 0):
            yield f"{name}:{number}: {library}/{room} must not use {'/'.join(other)} ({included})"


def check():
    rooms = Rooms(ROOT / "docs" / "rooms.md")
    sources = Sources(rooms)
    faults, arrows, count = sources.faults, {}, {}
    faults += [f"docs/rooms.md: library {library} has no room" for library in FOLDERS if library not in rooms.libraries]
    faults += check_page()
    linked = {library: {library, *(folder for folder in FOLDERS if folder.split("/")[-1] in depends(library))} for library in rooms.libraries}
    for library in rooms.libraries:  # links go on
        for _ in rooms.libraries:
            linked[library] |= {further for other in linked[library] for further in linked[other]}
    for path in sources.room:
        if "include" not in path.relative_to(ROOT).parts:
            count[sources.room[path]] = count.get(sources.room[path], 0) + 1
        faults += check_file(path, sources, linked[sources.room[path][0]], arrows)
    for room in rooms.rank:
        name = "/".join(room)
        if count.get(room, 0) == 0:
            faults.append(f"docs/rooms.md: there is no room {name}")
        elif count[room] > LARGER.get(name, FILES):
            faults.append(f"{name}: {count[room]} files, more than {LARGER.get(name, FILES)}")
    for loop in knots(arrows):
        if len(loop) > KNOT:
            faults.append(f"{len(loop)} units include each other: {', '.join(sorted(unit.name for unit in loop))}")
    return faults, len(sources.room), sum(map(len, arrows.values()))


def main():
    faults, files, arrows = check()
    for fault in faults:
        print(fault)
    print(f"{files} files, {arrows} arrows between units, {len(faults)} wrong")
    return 1 if faults or arrows < 1000 else 0


if __name__ == "__main__":
    sys.exit(main())
