#!/usr/bin/env python3
"""Does each row of the figures in docs name a line of `rtsg bench`, or a test, that exists?

In docs/accuracy-and-speed.md every table with a column headed "line of `rtsg bench`" is read: each row has to name at least one
line there, as `bench: metric`, or a test, as `Suite.Name`, `Suite` or `tests/FILE`. The benches' sources have to report that metric under
that bench, the tests' sources have to have that test. A metric that is put together, such as "primary rays, {}", counts as what stands
before the first brace. On other pages each paragraph with a measured
time, rate or size names a line in the same way, or a script, `bench/FILE.py`; pages in SETTINGS hold limits that are set, not measured.
Exit status 1, a line for each row or paragraph at fault.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent.parent)
HEADING = "line of `rtsg bench`"
SETTINGS = {"security.md", "charts.md", "diagnostics.md", "accuracy-and-speed.md"}
MEASURED = re.compile(r"\d (?:µs|ns|ms|MB|GB|MB/s|GB/s|Mrays/s|M/s)\b")
NAMED = re.compile(r"`([a-z_]+): ([^`]+)`")
SCRIPT = re.compile(r"`(bench/\w+\.py)`")
TEST = re.compile(r"`([A-Z]\w+(?:\.\w+)?|tests/[\w./]+)`")


def reported():
    """Bench -> the string literals of the sources that report it."""
    benches = {}
    for path in sorted((ROOT / "bench").glob("*.cpp")):
        text = re.sub(r'"\s*\n\s*"', "", path.read_text())  # literals that go on in the next line
        literals = set(re.findall(r'"((?:[^"\\\n]|\\.)*)"', text))
        for bench in re.findall(r'report\(\s*\{\s*"([^"]+)"', text):
            benches.setdefault(bench, set()).update(literals)
    return benches


def tests():
    """Names of suites, of suites with a test, and of files."""
    found = set()
    for path in (ROOT / "tests").rglob("*"):
        found.add(str(path.relative_to(ROOT)))
        if path.suffix == ".cpp":
            for suite, name in re.findall(r"^(?:TYPED_)?TEST(?:_[FP])?\(\s*(\w+),\s*(\w+)", path.read_text(), re.MULTILINE):
                found |= {suite, f"{suite}.{name}"}
    return found


def exists(benches, bench, metric):
    return any(metric == literal or ("{" in literal and literal.split("{")[0] and metric.startswith(literal.split("{")[0]))
               for literal in benches.get(bench, ()))


def rows(path):
    """(line number, text of the last cell) of each row of a table that has the heading."""
    inside = False
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if not line.startswith("|"):
            inside = False
        elif HEADING in line:
            inside = True
        elif inside and not re.fullmatch(r"[|\s:-]+", line):
            yield number, line.rstrip().rstrip("|").rsplit("|", 1)[1].strip()


def paragraphs(path):
    """(line number, text) of each, of pages whose figures are measured; code is none."""
    if path.name in SETTINGS:
        return
    text, begun, code = [], 0, False
    for number, line in enumerate([*path.read_text().splitlines(), ""], 1):
        code ^= line.startswith("```")
        if line.strip() and not code:
            begun = begun if text else number
            text.append(line)
        elif text:
            yield begun, " ".join(text)
            text = []


def main():
    benches, checked, faults, count = reported(), tests(), 0, 0
    page = ROOT / "docs" / "accuracy-and-speed.md"
    for number, cell in rows(page):
        names = NAMED.findall(cell)
        problems = [f"there is no line `{b}: {m}`" for b, m in names if not exists(benches, b, m)]
        problems += [f"there is no test {name}" for name in TEST.findall(cell) if name not in checked]
        if not names and not TEST.search(cell):
            problems = ["names no line of `rtsg bench` and no test"]
        for problem in problems:
            print(f"{page.relative_to(ROOT)}:{number}: {problem}")
        faults += bool(problems)
        count += 1
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
        for number, paragraph in paragraphs(page):
            names = NAMED.findall(paragraph)
            missing = [f"there is no line `{b}: {m}`" for b, m in names if b in benches and not exists(benches, b, m)]
            measures = any(exists(benches, b, m) for b, m in names) or any((ROOT / name).exists() for name in SCRIPT.findall(paragraph))
            if MEASURED.search(paragraph) and not measures:
                missing.append(f"a measured figure ({MEASURED.search(paragraph).group()}) without a line of `rtsg bench`")
            for problem in missing:
                print(f"{page.relative_to(ROOT)}:{number}: {problem}")
            faults += bool(missing)
    print(f"{count} rows, {faults} at fault")
    return 1 if faults or count < 20 else 0


if __name__ == "__main__":
    sys.exit(main())
