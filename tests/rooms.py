#!/usr/bin/env python3
"""Are the sources laid out as docs/rooms.md says?

A library is a folder with a target of the last part of its name, and a room a folder below LIBRARY/src. The first table there names all of them, from the top to the bottom: a file may include what is in
its own room or in one further down, and of other libraries what its own is linked with. Each room has a row, and each row a room. A
public header belongs to the room of the .cpp of its name; the second table has those without one. No units that include each other in a
loop are more than KNOT; a unit is a header with its source. No room has more than FILES. Exit status 1 and a line for each fault.
"""
import pathlib
import re
import sys

KNOT, FILES = 6, 28
LARGER = {}  # rooms that are yet to be divided
# Outside libraries that only one room of a library may include, or those that are named.
DOORS = {r"^embree[34]/": ("renderers/world", "embree"), r"^tbb/(parallel|task|blocked)": ("renderers/world", "embree"), r"^OpenImageIO/": ("renderers/images", "image_module"),
         r"^lib(av(?!util/tx\.h)|sw)": ("renderers/images", "movie_module"), r"^libavutil/tx\.h": ("audio", "fft_module"), r"^kissfft/": ("audio", "signal"),
         r"^(ft2build|fontconfig/|hb)": ("renderers/geometry", "font_module"), r"^(jsapi\.h|js/)": ("scripts", "engine"), r"^expat\.h": ("documents", "read", "models"), r"^assimp/": ("documents", "assimp_module"),
         r"^zmq": ("sync", "sockets"), r"^boost/": ("sync", "web_module"), r"^AL/": ("audio", "sound_io"), r"^ode/": ("physics", "engine"),
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


def links(root, library, libraries):
    """What the library's target depends on, itself included."""
    made = re.search(r"rtsg_library\(" + library.split("/")[-1] + r"\b([^)]*)\)", (root / library / "CMakeLists.txt").read_text())
    depends = re.search(r"\bDEPENDS((?: [a-z]+)*)", made[1])
    names = depends[1].split() if depends else ()
    return {library, *(other for other in libraries if other.split("/")[-1] in names)}


class Sources:
    """Every header and source of the libraries: its room, its unit, and what it includes."""

    def __init__(self, root, rooms):
        self.root, self.rooms, self.faults = root, rooms, []
        self.room, self.unit = {}, {}
        for library in rooms.libraries:
            for path in sorted((root / library / "src").rglob("*")):
                if path.suffix in (".cpp", ".h"):
                    self.place(path, library, path.parent.relative_to(root / library / "src").as_posix(), path.with_suffix(""))
            for path in sorted((root / library / "include" / "rtsg").glob("*/*.h")):
                self.place_header(path, library)

    def place(self, path, library, room, unit):
        self.room[path], self.unit[path] = (library, room), unit
        if (library, room) not in self.rooms.rank:
            self.faults.append(f"{path.relative_to(self.root)}: {library}/src/{room} has no row in docs/rooms.md")

    def place_header(self, path, library):
        sources = [source for source in self.room if source.suffix == ".cpp" and self.room[source][0] == library and
                   path.stem in (source.stem, f"{source.parent.name}_{source.stem}")]
        named = self.rooms.headers.get(f"{path.parent.name}/{path.name}")
        if named:
            self.place(path, library, named, sources[0].with_suffix("") if len(sources) == 1 else path.with_suffix(""))
        elif len(sources) == 1:
            self.place(path, library, self.room[sources[0]][1], sources[0].with_suffix(""))
        else:
            self.faults.append(f"{path.relative_to(self.root)}: a header without a source of its name has a row in docs/rooms.md")

    def find(self, path, included, quoted):
        """The file that an include line names, if it is one of these."""
        library = self.room[path][0]
        places = [path.parent / included, self.root / library / "src" / included,
                  *(self.root / other / "src" / included for other in self.rooms.libraries)] if quoted else []
        if included.startswith("rtsg/"):
            places += (self.root / other / "include" / included for other in self.rooms.libraries)
        return next((place for place in places if place in self.room), None)


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
    name = path.relative_to(sources.root)
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


def check(root):
    rooms = Rooms(root / "docs" / "rooms.md")
    sources = Sources(root, rooms)
    faults, arrows, count = sources.faults, {}, {}
    linked = {library: links(root, library, rooms.libraries) for library in rooms.libraries}
    for library in rooms.libraries:  # links go on
        for _ in rooms.libraries:
            linked[library] |= {further for other in linked[library] for further in linked[other]}
    for path in sources.room:
        if "src" in path.relative_to(root).parts:
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
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent).resolve()
    faults, files, arrows = check(root)
    for fault in faults:
        print(fault)
    print(f"{files} files, {arrows} arrows between units, {len(faults)} wrong")
    return 1 if faults or arrows < 1000 else 0


if __name__ == "__main__":
    sys.exit(main())
