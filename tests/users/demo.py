#!/usr/bin/env python3
"""What a newcomer runs first: the demonstration, shortened. Its proofs hold, and its report is one page that stands alone."""
import html.parser
import json
import os
import subprocess
import sys

from harness import *


class Page(html.parser.HTMLParser):
    """What a page loads (it must be within it), what it links to, and its text."""

    def __init__(self):
        super().__init__()
        self.loaded, self.linked, self.text, self.tags = [], [], "", []

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        for name, value in attributes:
            if name in ("src", "srcset", "data", "poster") or name == "href" and tag != "a":
                self.loaded.append((tag, value))
            elif name == "href":
                self.linked.append(value)

    def handle_data(self, data):
        self.text += data


def demo(user, **settings):
    out = user.path("out")
    ran = subprocess.run([ROOT / "examples" / "demo" / "run", out], capture_output=True, text=True, timeout=300,
                         env={**os.environ, "RTSG": str(user.program), "NO_COLOR": "1", **settings})
    return out, ran


def test_its_proofs_hold_and_its_page_stands_alone(user):
    out, ran = demo(user, SECONDS_TO_RUN="3", FPS="30")
    equal(ran.returncode, 0, f"status of the demonstration, which said {ran.stdout}{ran.stderr}")
    equal(ran.stdout.count("proved"), 10, "proofs on the terminal")
    page = Page()
    page.feed((out / "report.html").read_text())
    check(page.loaded, "the page shows something")
    for tag, source in page.loaded:
        check(source.startswith("data:"), f"<{tag}> loads {source[:60]!r}, which is not within the page")
    for link in page.linked:
        check((out / link).is_file(), f"the page links to {link}, which is not there")
    check("FAILED" not in page.text, "a proof failed")
    said = [line for line in ran.stderr.splitlines() if not line.startswith(("1/4", "2/4", "3/4", "4/4", "note: the sound exceeded"))]
    equal(said, [], "what a good run says on standard error besides")
    version = subprocess.run([user.program, "--version"], capture_output=True, text=True).stdout.strip()
    check(version in page.text, f"the page names the version, {version}")


def test_its_page_is_for_people(user):
    out, ran = demo(user, SECONDS_TO_RUN="3", FPS="30")
    text = (out / "report.html").read_text()
    page = Page()
    page.feed(text)
    # A page of the 12 s that the demonstration has by default is 5 MB at most: pictures, film and sound take four times as much there.
    check(len(text) < 2_000_000, f"the page has {len(text)} bytes")
    named = lambda tag: [attributes for name, attributes in page.tags if name == tag]
    equal(len(named("figure")), 5, "figures: the large picture, three small ones, the film")
    equal(len(named("figcaption")), 5, "captions")
    check(named("video")[0].get("poster", "").startswith("data:image/"), "the film has a poster")
    check("±" in page.text, "figures have their intervals")
    check(any("below" in attributes.get("class", "") for attributes in named("td")), "octaves below the Schroeder frequency are grey")
    serve = json.loads((out / "serve.jsonl").read_text().splitlines()[-1])
    check(f"Why {serve['frames']:,}" in page.text and f"number {serve['sequence']:,}" in page.text, "frames, states and their numbers are told apart")
    equal(serve["lost"], 0, "mirrors that the server lost")


def test_what_others_made_is_left_alone(user):
    mine = user.path("out")
    mine.mkdir()
    (mine / "thesis.txt").write_text("years of work")
    out, ran = demo(user)
    equal(ran.returncode, 1, "status")
    check("was not made by the demo" in ran.stderr, f"it says why: {ran.stderr}")
    equal((mine / "thesis.txt").read_text(), "years of work", "what was there")


if __name__ == "__main__":
    sys.exit(run(sys.modules[__name__]))
