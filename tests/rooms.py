#!/usr/bin/env python3
"""Do the arrows between the rooms of a library run one way? Reads every include line.

A room is a folder below LIBRARY/src. The tables below name the rooms of each library from the top to the bottom: a file
may include what is in its own room or in one further down. A public header belongs to the room of the .cpp of the same
name; the few that have none, or whose .cpp has another name, are listed. Exit status 1 and a line for each wrong arrow.
"""
import pathlib
import re
import sys

ROOMS = {
    "core": ["behaviour", "scene", "value"],
    "documents": ["filter", "check", "build", "write", "read", "import", "media", "commands"],
    "scripts": ["engine"],
    "renderers": ["light", "image", "world", "embree", "flatten", "mesh", "text"],
    "sync": ["mirror", "log", "codec"],
    "audio": ["listen", "engine", "scene", "trace", "walls", "signal"],
    "physics": ["engine"],
    "dis": ["nodes", "network"],
}
# Public headers without a .cpp of their name.
HEADERS = {
    "core": {"behaviour": "scene", "scene": "scene", "script_language": "scene", "viewer_pose": "scene", "frame_input": "scene", "script": "scene", "placement": "scene", "x3d": "value", "check": "value"},
    "documents": {"document_handler": "commands", "media_measures": "media", "profile": "commands", "read_document": "read"},
    "scripts": {"run_scripts": "engine"},
    "renderers": {"render_settings": "light", "paged_array": "flatten", "ray": "embree", "shading": "light", "tessellate": "mesh", "text_measure": "mesh"},
    "sync": {"byte_buffer": "codec", "change_codec": "codec", "log": "log", "stream_mode": "codec"},
    "audio": {"acoustic_box": "walls", "acoustic_geometry": "walls", "trace_result": "trace", "paged_array": "walls", "panning": "signal"},
    "physics": {},
    "dis": {"dis_transport": "network"},
}
# Names of outside libraries that only one room may use, comments aside.
NAMES = {r"\brtc[A-Z]\w*|\bRTC\w*": ("renderers", "embree")}
# Outside libraries that only one room may include.
DOORS = {r"^embree[34]/": ("renderers", "embree"), r"^tbb/(parallel|task|blocked)": ("renderers", "embree"), r"^OpenImageIO/": ("renderers", "image_module"),
         r"^lib(av(?!util/tx\.h)|sw)": ("renderers", "movie_module"), r"^libavutil/tx\.h": ("audio", "signal"), r"^kissfft/": ("audio", "signal"),
         r"^(ft2build|fontconfig/|hb)": ("renderers", "font_module"), r"^(jsapi\.h|js/)": ("scripts", "engine"), r"^zmq": ("sync", "mirror"), r"^boost/": ("sync", "web_module"), r"^AL/": ("audio", "signal"), r"^ode/": ("physics", "engine"),
         r"^netcdf\.h": ("audio", "netcdf_module")}


def header_rooms(root, library):
    rooms = dict(HEADERS[library])
    for header in (root / library / "include" / "rtsg" / library).glob("*.h"):
        for room in ROOMS[library]:
            folder = root / library / "src" / room
            stem = header.stem
            if (folder / f"{stem}.cpp").exists() or (
                    stem.startswith(room + "_") and (folder / f"{stem[len(room) + 1:]}.cpp").exists()):
                rooms.setdefault(stem, room)
    return rooms


def check(root):
    wrong, files, arrows = [], 0, 0
    for library, order in ROOMS.items():
        rank = {room: i for i, room in enumerate(order)}
        headers = header_rooms(root, library)
        public = (root / library / "include" / "rtsg" / library).glob("*.h")
        sources = (p for p in (root / library / "src").rglob("*") if p.suffix in (".cpp", ".h"))
        for path in sorted([*public, *sources]):
            files += 1
            name = path.relative_to(root)
            room = headers.get(path.stem) if "include" in path.parts else path.parent.name
            if room not in rank:
                wrong.append(f"{name}: in no room of {library}: {', '.join(order)}")
                continue
            for number, line in enumerate(path.read_text().splitlines(), 1):
                for pattern, door in NAMES.items():
                    if (library, room) != door and (named := re.search(pattern, line.split("//")[0])):
                        wrong.append(f"{name}:{number}: {named.group()} belongs behind {'/src/'.join(door)}")
                match = re.match(r'\s*#\s*include\s*[<"]([^>"]+)[>"]', line)
                if not match:
                    continue
                included = match.group(1)
                for pattern, door in DOORS.items():
                    if re.match(pattern, included) and (library, room) != door:
                        wrong.append(f"{name}:{number}: {included} belongs behind {'/src/'.join(door)}")
                parts = included.split("/")
                if parts[:2] == ["rtsg", library]:
                    target = headers.get(pathlib.PurePath(parts[2]).stem)
                elif len(parts) == 2 and parts[0] in rank and not line.lstrip().startswith("#include <"):
                    target = parts[0]
                else:
                    continue
                arrows += 1
                if target not in rank:
                    wrong.append(f"{name}:{number}: {included} is in no room")
                elif rank[target] < rank[room]:
                    wrong.append(f"{name}:{number}: {room} must not use {target} ({included})")
    return wrong, files, arrows


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent)
    wrong, files, arrows = check(root)
    for line in wrong:
        print(line)
    print(f"{files} files, {arrows} includes between and within rooms, {len(wrong)} wrong")
    return 1 if wrong or arrows < 100 else 0


if __name__ == "__main__":
    sys.exit(main())
