#!/usr/bin/env python3
"""The examples in public headers, as one source that is compiled.

    header_examples.py OUT.cpp HEADER...

Each block of comment lines that begins with "// Example:" becomes a function; its #include lines go to the top. The headers of the
classes that are used most must have one (NEEDED). Exit status 1, and nothing is written, if one has none.
"""
import pathlib
import re
import sys

NEEDED = ["core/value.h", "core/scene.h", "core/bus.h", "core/behaviour.h", "documents/loader.h", "renderers/shared_world.h",
          "renderers/light_renderer.h", "audio/sound_renderer.h", "sync/mirror_server.h", "sync/mirror_client.h", "sync/log.h",
          "sync/replay.h", "session/output_maker.h"]


def example(text):
    """The lines of the example and the number of the first; none if there is no example."""
    match = re.search(r"^// Example:\n((?://.*\n)+)", text, re.MULTILINE)
    if not match:
        return [], 0
    lines = [line[2:].removeprefix("     ") for line in match.group(1).splitlines()]
    return lines, text.count("\n", 0, match.start(1)) + 1


def main(out, headers):
    includes, functions, found = {"#include <iostream>"}, [], set()
    for header in headers:
        lines, first = example(pathlib.Path(header).read_text())
        if not lines:
            continue
        found.add("/".join(pathlib.Path(header).parts[-2:]))
        name = re.sub(r"\W", "_", "_".join(pathlib.Path(header).parts[-2:])[:-2])
        body = ["" if line.startswith("#include") else line for line in lines]
        includes.update(line for line in lines if line.startswith("#include"))
        functions += [f"void {name}();", f"void {name}() {{", f'#line {first} "{header}"', *body, "}"]
    missing = [name for name in NEEDED if name not in found]
    for name in missing:
        print(f"{name}: has no \"// Example:\" after its opening comment")
    if missing:
        return 1
    text = "\n".join(["// Generated from the examples in public headers.", *sorted(includes), *functions, "int main() {}", ""])
    path = pathlib.Path(out)
    if not path.exists() or path.read_text() != text:
        path.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
