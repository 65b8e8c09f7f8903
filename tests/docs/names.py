#!/usr/bin/env python3
"""Does everything exist that comments and docs name?

Looked for, in the comments of the sources and in the pages (the change log tells of what has been): files, in the tree under
that path; options, in the program; words in backticks, calls such as name(), and words with a capital letter inside, in the
code itself, comments left out. A plural counts as its singular; ELSEWHERE lists what belongs to others. Metrics that the files in
examples/monitoring ask for are those that the program has, and some page leads to each of docs/.
Exit status 1, a line for each that is not there.
"""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
CODE = {".h", ".cpp", ".in", ".py", ".mjs", ".js", ".cmake", ".x3dspec", ".html", ".x3d", ".x3dv", ".wrl", ".scenario", ".json"}
FILE = re.compile(r"(?<![\w.])[\w./-]*\w\.(?:h|cpp|py|md|x3dspec|mjs|cmake|scenario)\b")
# Files that are made, or that stand for any; of others' names what the pages explain or compare with.
MADE = {"x3d.h", "version.h", "pendulum.h", "workshop.h", "workshop.x3dspec", "name.h", "fq.cpp", "mine.cpp"}
ELSEWHERE = set("""WebM PascalCase camelCase snake_case delaySamples levelDb col AnalyserNode AudioBufferSourceNode BiquadFilterNode DelayNode PannerNode
    DynamicsCompressorNode WaveShaperNode SplitMix64 AVX2 CONSTRAINT TAG my_target ENDPOINT NAME_fuzz StereoLithography sffloatValue
    sfint32Value SENSOR alsoftrc concat LINEAR_WHEN_PHYSICAL_MATERIAL inView Nd MyRenderer MySubject KEY npx INDEX CHILD _more set_name
    name_changed W3C SimpleFreeFieldHRIR F8FF T12 cornerStep WebP uomField OpenEXR MurmurHash3 registerFieldInterest registerBrowserInterest
    FourCC BC6H OpenGL BigTIFF QuickTime DRTSG_SCRIPTS DRTSG_IMAGES DRTSG_MOVIES DRTSG_WEB DRTSG_DRACO DRTSG_MESHOPT DRTSG_DELAY_LOAD ae
    OpenInventor H3D SmoothSurface FrictionalSurface TMPDIR SSL_CERT_FILE --dependency --wrap RTSG_0 pthread_once
    --install-extension buf document_symbol code_action --max-age creds""".split())


def texts():
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    names = listed.stdout.split("\n") if listed.returncode == 0 else [str(p.relative_to(ROOT)) for p in ROOT.rglob("*") if p.is_file()]
    result = {}
    for name in filter(None, names):
        path = pathlib.PurePath(name)
        if path.suffix in CODE | {".md", ".txt", ""} and (ROOT / name).is_file():
            result[path] = (ROOT / name).read_text(errors="replace")
    return result, {pathlib.PurePath(name) for name in filter(None, names)}


def is_cpp(path):
    return path.suffix in (".h", ".cpp")


def remarks(path, text):
    """(line number, comment or line of a page)."""
    mark = "//" if is_cpp(path) or path.suffix in (".mjs", ".js") else "#" if path.suffix in (".py", ".x3dspec", ".cmake") else ""
    if path.suffix != ".md" and not mark and path.name != "CMakeLists.txt":
        return
    fenced = False
    for number, line in enumerate(text.splitlines(), 1):
        if path.suffix == ".md":
            fenced ^= line.startswith("```")
            if not fenced:
                yield number, line
        else:
            at = re.search(rf"(?:^|\s){mark or '#'}+/?!?\s(.*)", line)
            if at:
                yield number, at[1]


def candidates(path, line):
    """(kind, name) of what has to be in the code."""
    for quoted in re.findall(r"`([^`]+)`", line):
        for word in re.findall(r"\b[A-Za-z_]\w*", FILE.sub(" ", quoted)):
            yield "word", word
    for option in re.findall(r"(?<![\w-])--[a-z][a-z-]+", line):
        yield "option", option
    if not is_cpp(path):
        return
    line = FILE.sub(" ", re.sub(r"https?://\S+", "", line))
    for name in re.findall(r"\b([A-Za-z_]\w*)\(\)", line):
        yield "function", name
    for name in re.findall(r"::(\w+)", line):
        yield "member", name
    for name in re.findall(r"\b[A-Za-z]+[a-z0-9][A-Z]\w*\b", line):
        yield "word", name


def main():
    sources, files = texts()
    code, words = [], set()
    for path, text in sources.items():
        if path.suffix in CODE or path.suffix in ("", ".txt"):
            code.append(re.sub(r"(?<!:)//[^\n]*", "", text) if is_cpp(path) else text)
    whole = "\n".join(code)
    words.update(re.findall(r"\w+", whole))
    for path in files:
        for part in path.parts:
            words.update(re.findall(r"\w+", part))

    def known(kind, name):
        if kind == "option":
            return name in whole
        singular = [name, name[:-1] if name.endswith("s") else name, name[:-2] if name.endswith("es") else name]
        return any(one in words or one in ELSEWHERE for one in singular)

    faults, count = [], 0
    for path, text in sources.items():
        if path.name == "CHANGELOG.md":
            continue
        for number, line in remarks(path, text):
            for kind, name in candidates(path, line):
                count += 1
                if not known(kind, name):
                    faults.append(f"{path}:{number}: there is no {name}")
            for name in FILE.findall(line):
                count += 1
                named = pathlib.PurePath(name.removeprefix("./").removeprefix("../"))
                if named.name in MADE or re.search(r"[A-Z]{3}", named.stem) or len(named.stem) == 1:
                    continue
                if not any(one.parts[-len(named.parts):] == named.parts for one in files):
                    faults.append(f"{path}:{number}: there is no file {name}")
    health = (ROOT / "session/src/run/health.cpp").read_text()
    for file in sorted((ROOT / "examples/monitoring").iterdir()):
        for name in sorted(set(re.findall(r"\brtsg_\w+", file.read_text()))):
            count += 1
            if f'"{name.removesuffix("_bucket")}"' not in health:
                faults.append(f"{file.relative_to(ROOT)}: there is no metric {name}")
    pages = "\n".join(file.read_text() for file in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")))
    faults += [f"{page.relative_to(ROOT)}: no page leads there" for page in sorted((ROOT / "docs").glob("*.md")) if not re.search(rf"[(/]{page.name}[)#]", pages)]
    if faults:
        faults.append("What is somebody else's belongs into ELSEWHERE, in this script.")
    print("\n".join(dict.fromkeys(faults)) or f"{count} names, all of them there")
    return 1 if faults or count < 3000 else 0


if __name__ == "__main__":
    sys.exit(main())
