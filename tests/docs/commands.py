#!/usr/bin/env python3
"""Does every `rtsg` command in README, docs and --help run?

Takes each line of a code block in README.md and docs/*.md that begins with `rtsg` or `build/rtsg`, and each "Example:" of each verb's
--help. Runs them one after the other in a scratch folder that holds the scenes they name, shortened (SHORTER), at endpoints of this
run's own. A command that follows a server gets one: that of its page, or one of the hall. What is not run is listed in NOT_RUN with the reason; an entry there that no
text names any more is an error too. Exit status 1, with the command's own words, for each that fails.
"""
import argparse
import os
import pathlib
import re
import shlex
import shutil
import socket
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).parent.parent.parent
NOT_RUN = {
    "bench": "measures for minutes; test_bench_scenes and test_sync run the benches small",
    "chart": "measures for minutes",
    "advise": "measures as long as it is allowed to; app.Advise has it",
    "plan.txt": "is what advise writes; app.Advise has one",
    "nats://": "needs a NATS server; app.NatsOption has one",
    "build/workshop.so": "a plug-in that is built first; test_plugins has it",
    "https://": "is on a network; app.NetworkOptions has a server of its own",
    "http://": "needs a server there; app.NetworkOptions has one",
    "house.rlog": "is the log of such a scene; app.NetworkOptions has one",
    "top": "looks at a program that runs; app.Operating has one",
    "assemble": "joins what jobs have made; app.Jobs has some",
    "--tiles": "needs a program that joins tiles; app.LiveTiles has one",
    "ogre": "needs a display; users.window has one",
    "udp:5571": "waits for a driver; app.Touch has one",
}
# Durations and sizes that show the same in less time.
SHORTER = {"--for": "1s", "--web": "0", "--foxglove": "0", "--seek": "0.5s", "--size": "64x36", "--spp": "2", "--rays": "500", "--frames": "2", "--fps": None}
TIMES = ("--for", "--seek")
SCENES = {"hall.x3dv": "examples/demo/hall.x3dv", "door.x3dv": "examples/door.x3dv", "same_door.x3dv": "examples/door.x3dv", "door.png": "examples/door.png",
          "materials.csv": "examples/demo/materials.csv"}


def commands(program):
    """(where, text) of each."""
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
        for number, line in enumerate(path.read_text().splitlines(), 1):
            match = re.match(r"(?:    )?(?:build/)?(rtsg .*)", line)
            if match:
                yield f"{path.relative_to(ROOT)}:{number}", match.group(1)
    listed = subprocess.run([program, "--help"], capture_output=True, text=True, check=True).stdout
    for verb in re.findall(r"^  ([a-z]+) ", listed[listed.lower().index("subcommands"):], re.MULTILINE):
        text = subprocess.run([program, verb, "--help"], capture_output=True, text=True).stdout
        for example in re.findall(r"^Example: (.*)$", text, re.MULTILINE):
            yield f"rtsg {verb} --help", example


def made_twice(program):
    """Files that README's commands and those of getting started make, where who types one page after the other meets the first one's."""
    made, twice = {}, []
    for where, text in commands(program):
        words = shlex.split(text, comments=True)[1:]
        if not where.startswith(("README.md:", "docs/getting-started.md:")) or not words:
            continue
        files = {after for option, after in zip(words, words[1:]) if option in ("-o", "--save", "--record")} | ({words[2]} if words[0] == "convert" else set())
        twice += [f"{where}: {text}\n  makes {file}, which {made[file]} has made" for file in files if file in made]
        made.update(dict.fromkeys(files, where))
    return twice


def shortened(arguments):
    # A picture that is expected has its size.
    if "--expect-picture" in arguments:
        return arguments
    # An event is not after the end.
    late = any(re.search(r"@([1-9]|\d\d|0?\.[5-9])", a) for a in arguments)
    out, previous = [], ""
    for argument in arguments:
        given = (late and previous in TIMES) or (previous == "--frames" and arguments[0] == "replay")  # numbers of pictures
        out.append(argument if given else SHORTER.get(previous) or argument)
        previous = argument
    # A window closes by itself.
    if arguments[0] == "view" and "--for" not in out:
        out += ["--for", SHORTER["--for"]]
    # So do pictures and sounds of the size, length and rays that they have by themselves.
    for verb, option in (("run", "--size"), ("listen", "--for"), ("listen", "--rays")):
        if arguments[0] == verb and option not in out and (verb == "listen" or "--render" in out):
            out += [option, SHORTER[option]]
    return out


def served(arguments):
    """What a `serve` of a page serves to those who follow it."""
    upstream = ["--upstream", arguments[arguments.index("--upstream") + 1]] if "--upstream" in arguments else []
    return [arguments[1], *upstream]


def free_endpoint():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return f"tcp://127.0.0.1:{s.getsockname()[1]}"


def prepare(folder):
    shutil.copytree(ROOT / "examples", folder / "examples", dirs_exist_ok=True)
    for name, source in SCENES.items():
        shutil.copy(ROOT / source, folder / name)
    for asset in (ROOT / "examples" / "demo").iterdir():
        if asset.is_file() and not (folder / asset.name).exists():
            shutil.copy(asset, folder / asset.name)
    (folder / "out").mkdir()
    (folder / "models").mkdir()
    (folder / "days").mkdir()


def run(program, arguments, folder, timeout=120):
    return subprocess.run([program, *arguments], cwd=folder, capture_output=True, text=True, timeout=timeout)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    program = str(pathlib.Path(parser.parse_args().program).resolve())
    os.environ["SDL_VIDEODRIVER"] = "offscreen"  # windows
    failed, ran, unused, known = made_twice(program), 0, set(NOT_RUN), set()
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch) / "now"
        pristine = pathlib.Path(scratch) / "given"
        folder.mkdir()
        prepare(folder)
        # What the texts take for granted: files made earlier, by the commands that make them.
        for given in (["convert", "door.x3dv", "models/door.x3d"], ["convert", "door.x3dv", "old.wrl"], ["convert", "door.x3dv", "hall.wrl"],
                      ["record", "hall.x3dv", "-o", "hall.rlog", "--for", "2s", "--fps", "10"],
                      ["record", "hall.x3dv", "-o", "days/hall.rlog", "--for", "4s", "--fps", "10", "--rotate", "1s"],
                      ["keys", "hall.key", "--client", "laptop.key"],
                      ["record", "door.x3dv", "-o", "door.rlog", "--for", "3s", "--fps", "30", "--set", "PRESSED.set_boolean=TRUE@0.5"]):
            made = run(program, given, folder)
            if made.returncode != 0:
                sys.exit(f"rtsg {' '.join(given)}: {made.stderr}")
        shutil.copy(folder / "door.rlog", folder / "other.rlog")
        shutil.copy(folder / "hall.rlog", folder / "visit.rlog")
        shutil.copytree(folder, pristine)
        page, scene = "", []
        for where, text in commands(program):
            if where.partition(":")[0] != page:
                page, scene = where.partition(":")[0], ["hall.x3dv"]
            arguments = shlex.split(text, comments=True)[1:]
            if arguments and arguments[-1] == "&":
                arguments.pop()
            if ">" in arguments:  # into a file, as a shell does
                arguments = arguments[:arguments.index(">")]
            key = next((name for name in NOT_RUN if text.startswith(f"rtsg {name}") or name in arguments or
                        (name.endswith("://") and any(a.startswith(name) for a in arguments))), None)
            if key:
                unused.discard(key)
                continue
            arguments = shortened([a for given in arguments for a in ((sorted(map(str, folder.glob(given))) or [given]) if "*" in given and "//" not in given else [given])])
            same = (*arguments, "of", *scene)  # it would find the same files, and the same server where it follows one
            if arguments[0] == "serve" and "--upstream" in arguments and not arguments[1].endswith(".rlog"):
                scene = served(arguments)
            if same in known:
                continue
            known.add(same)
            endpoint, server = free_endpoint(), None
            arguments = [endpoint if a.startswith("tcp://") else a for a in arguments]
            shutil.rmtree(folder, ignore_errors=True)  # each command finds what the texts take for granted, no more
            shutil.copytree(pristine, folder)
            if arguments[0] == "record" or "--record" in arguments:
                made = arguments[arguments.index("-o" if arguments[0] == "record" else "--record") + 1]
                for piece in (folder / made).parent.glob(pathlib.Path(made).stem + ".*"):
                    if piece.suffix == ".rlog":
                        piece.unlink()
            if arguments[0] == "keys":
                for made in arguments[1], arguments[arguments.index("--client") + 1]:
                    (folder / made).unlink(missing_ok=True)
            if "--update" in arguments:
                (folder / arguments[1]).unlink(missing_ok=True)
            if arguments[0] == "serve" and "--for" not in arguments:
                arguments += ["--for", "1s"]
            if arguments[0] == "relay":
                arguments[arguments.index("--bind") + 1] = free_endpoint()
            if arguments[0] in ("mirror", "relay") or (arguments[0] == "view" and endpoint in arguments):
                secret = ["--key", "hall.key"] if "--key" in arguments else []
                server = subprocess.Popen([program, "serve", *scene, *secret, "--bind", endpoint, "--for", "20s", "--fps", "10"], cwd=folder,
                                          stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            try:
                done = run(program, arguments, folder)
                if done.returncode != 0:
                    failed.append(f"{where}: {text}\n  as: rtsg {' '.join(arguments)}\n  status {done.returncode}: {done.stderr.strip()[-600:]}")
            except subprocess.TimeoutExpired:
                failed.append(f"{where}: {text}\n  does not end")
            finally:
                if server:
                    server.kill()
                    server.wait()
            ran += 1
    failed += [f"NOT_RUN names {name}, which no text does" for name in unused]
    for line in failed:
        print(line)
    print(f"{ran} commands run, {len(failed)} wrong")
    return 1 if failed or ran < 20 else 0


if __name__ == "__main__":
    sys.exit(main())
