"""What the situations of the gallery share: running the program, and judging one method in one situation."""
import dataclasses
import json
import pathlib
import subprocess

HEADER = "#X3D V4.0 utf8\nPROFILE Full\n"


@dataclasses.dataclass
class Outcome:
    """What one method gave in one situation, beside the truth."""
    method: str
    value: float | None  # None: it gave none
    truth: float | None  # None: there is none, and the method should give none
    tolerance: float  # relative, or absolute where the unit is dB
    unit: str = ""
    said: str = ""  # in the program's words; empty: nothing
    note: str = ""

    @property
    def error(self):
        if self.value is None or self.truth is None:
            return 0.0 if self.value is self.truth else float("inf")
        difference = abs(self.value - self.truth)
        return difference if self.unit == "dB" else difference / abs(self.truth) if self.truth else difference

    @property
    def verdict(self):
        if self.error <= self.tolerance:
            return "right"
        return "wrong, and says so" if self.said else "wrong, silent"


@dataclasses.dataclass
class Situation:
    sense: str
    name: str
    why: str  # methods fail here
    truth: str  # where it comes from
    outcomes: list[Outcome]
    scene: str | None = None  # for a picture


class Program:
    """The program, in a folder of its own for scenes and what it writes."""

    def __init__(self, path, folder):
        self.path, self.folder, self.count = pathlib.Path(path).resolve(), pathlib.Path(folder), 0

    def scene(self, text, header=HEADER):
        self.count += 1
        path = self.folder / f"scene{self.count}.x3dv"
        path.write_text(header + text)
        return str(path)

    def run(self, *arguments, seconds=300):
        """Status, standard output and standard error."""
        done = subprocess.run([self.path, *map(str, arguments)], cwd=self.folder, capture_output=True, text=True, timeout=seconds, check=False)
        return done.returncode, done.stdout, done.stderr

    def object(self, *arguments, **options):
        """The first JSON object of its output (None if there is none), and what it says beside it on standard error, or its status."""
        status, out, err = self.run(*arguments, **options)
        said = [line.split(": ", 1)[-1] if "warning: " in line or "error: " in line else line for line in err.splitlines()
                if "warning" in line or "error" in line]
        try:
            found = json.JSONDecoder().raw_decode(out[out.index("{"):])[0]
        except ValueError:
            found = None
        return found, said[0] if said else f"status {status}" if status else ""


def short(text, longest=110):
    text = " ".join(text.split())
    return text if len(text) <= longest else text[:longest].rsplit(" ", 1)[0] + " ..."
