"""The libraries of libraries.txt, for scripts that look at all of them."""
import pathlib

ROOT = pathlib.Path(__file__).resolve().parent.parent
FOLDERS = [line.split()[0] for line in (ROOT / "cmake" / "libraries.txt").read_text().splitlines() if line and line[0] != "#"]


def public_headers():
    return sorted(header for folder in FOLDERS for header in (ROOT / folder).glob("include/rtsg/*/*.h"))
