#!/usr/bin/env python3
"""What Doxygen is given of a header has each class's purpose, threads and source; and the search through a site's text finds what it has.

usage: site.py. Exit status 1 and a line for each fault.
"""
import json
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "docs"))
import doxygen_filter  # noqa: E402

HEADER = """// Lamp: shines on `Thing`s. It does more.
// Threading: one thread switches it; others
// may ask. Source: ISO/IEC 19775-1, 17.4.
#pragma once
class Lamp {
    int inside_;
};
/// Has its own words.
template <class T>
struct Thing {
};
int Lamps();
"""
PAGES = {"classrtsg_1_1Lamp.html": ("RTSG: rtsg::Lamp Class Reference", "shines on &lt;things&gt; <b>at night</b>"), "md_page.html": ("RTSG: Pages", "a lamp"),
         "menu.html": ("RTSG: Menu", "a lamp that is no page")}


def main():
    faults = []
    made = doxygen_filter.header(HEADER)
    lamp, thing = (made.partition(begin)[0].rpartition(end)[2] for begin, end in (("class Lamp", "pragma once"), ("template <class T>", "};")))
    for text, expected in ((lamp, "Lamp: shines on `Thing`s."), (lamp, "Threading: one thread"), (thing, "Has its own words."), (thing, "@par Threading"), (thing, "may ask."),
                           (thing, "@par Source"), (thing, "19775-1, 17.4.")):
        if expected not in text:
            faults.append(f"not in the comment of a class: {expected}: {text}")
    if "@par" in lamp:
        faults.append("a class with the whole comment has parts of it twice")
    if re.search(r"Source", thing.partition("@par Source")[0].partition("@par Threading")[2]):
        faults.append("the paragraph of threads goes on into that of sources")
    with tempfile.TemporaryDirectory() as folder:
        site = pathlib.Path(folder)
        for name, (title, text) in PAGES.items():
            (site / name).write_text(f'<html><head><title>{title}</title></head><body>menu<div class="contents"><script>no</script>{text}</div><!-- contents -->foot')
        (site / "menudata.js").write_text('var menudata={children:[{text:"Files",url:"files.html"}]}')
        for _ in range(2):
            done = subprocess.run([sys.executable, ROOT / "docs/full_text.py", site], capture_output=True, text=True, check=False)
            if done.returncode:
                faults.append(done.stderr)
        texts = json.loads((site / "texts.js").read_text().removeprefix("const TEXTS = ").removesuffix(";\n"))
        if texts != [["classrtsg_1_1Lamp.html", "rtsg::Lamp Class Reference", "shines on <things> at night"], ["md_page.html", "Pages", "a lamp"]]:
            faults.append(f"texts: {texts}")
        if (site / "menudata.js").read_text().count("find.html") != 1:
            faults.append("the menu has another number of entries than one, after two runs")
        empty = subprocess.run([sys.executable, ROOT / "docs/full_text.py", site / "nothing"], capture_output=True, text=True, check=False)
        if empty.returncode != 1 or "no pages" not in empty.stderr:
            faults.append(f"a folder without pages: {empty.returncode}, {empty.stderr}")
    print("\n".join([*faults, f"{len(faults)} faults"]))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
