#!/usr/bin/env python3
"""What ./dev test and .ci/run say at the end, from the log of a run: which tests failed, needed a second try or were skipped; how
long each stage took, and each test above five seconds. The last line counts: "N passed, N failed, N skipped".

Reads what ctest printed, lines "== STAGE: N s", and lines "== ./dev ..." before each of several runs of ctest. A step that failed without a
test that failed counts as one. Exit status 1 if something failed or no test ran.
"""
import re
import sys

RESULT = re.compile(r" *(?:\d+/\d+ +)?Test +#\d+: (.+?) \.*\s*(Passed|\*\*\*\S.*?) +([\d.]+) sec\s*$")
STAGE = re.compile(r"== (.+: .*\b\d+ s\b.*)$")
SLOW = 5.0  # seconds


def minutes(seconds):
    return f"{int(seconds // 60)}:{seconds % 60:04.1f}"


class Summary:
    def __init__(self, lines):
        self.stages, self.tests, step = [], {}, ""
        for line in lines:
            if stage := STAGE.match(line):
                self.stages.append(stage.group(1))
            elif line.startswith("== ./dev "):
                step = f" (./dev {line.removeprefix('== ./dev ').strip()})"
            elif found := RESULT.match(line):
                name, outcome, seconds = found.groups()
                self.tests.setdefault(name + step, []).append((outcome.lstrip("*"), float(seconds)))

    def named(self, condition):
        return [name for name, tries in self.tests.items() if condition([outcome for outcome, _ in tries])]

    def text(self):
        failed = self.named(lambda tries: tries[-1] not in ("Passed", "Skipped", "Not Run (Disabled)"))
        skipped = self.named(lambda tries: tries[-1] in ("Skipped", "Not Run (Disabled)"))
        again = self.named(lambda tries: len(tries) > 1 and tries[-1] == "Passed")
        spent = sorted(((sum(seconds for _, seconds in tries), name) for name, tries in self.tests.items()), reverse=True)
        slow = [(seconds, name) for seconds, name in spent if seconds > SLOW]
        for stage in self.stages:
            if (step := re.match(r"(\./dev .+): FAILED,", stage)) and not any(name.endswith(f" ({step[1]})") for name in failed):
                failed.append(step[1])
        yield "Where the time went:"
        yield from (f"  {stage}" for stage in self.stages)
        yield from (f"  {minutes(seconds):>7}  {name}" for seconds, name in slow)
        yield f"  {minutes(sum(seconds for seconds, _ in spent[len(slow):])):>7}  {len(spent) - len(slow)} tests of at most {SLOW:g} s"
        passed = len(self.named(lambda tries: tries[-1] == "Passed"))
        for what, names in (("Skipped", skipped), ("Passed at the second try", again), ("Failed", failed)):
            if names:
                yield f"{what}: {', '.join(names)}"
        yield f"{passed} passed, {len(failed)} failed, {len(skipped)} skipped"
        self.status = 1 if failed or not self.tests else 0


if __name__ == "__main__":
    with open(sys.argv[1], errors="replace") as log:
        summary = Summary(log)
    print("\n".join(summary.text()), flush=True)
    sys.exit(summary.status)
