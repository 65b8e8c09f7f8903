"""Recorded sessions as tests of pytest: the fixture rtsg_replay.

    def test_the_door_opens(rtsg_replay):
        rtsg_replay("door.rlog", fields=["DOOR.*"], tolerance=1e-4)
"""
import os
import pathlib
import shutil
import subprocess

import pytest

from . import Error, replay_test

_KINDS = (".x3dv", ".x3d", ".wrl", ".json")
_SHOWN = 10  # differences in a failure


def pytest_addoption(parser):
    group = parser.getgroup("rtsg")
    group.addoption("--rtsg-update", action="store_true", help="rtsg_replay: write logs anew as the scenes run now, in place of comparing")


def _beside(log):
    """The scene of the log's name beside it."""
    return next((file for kind in _KINDS if (file := log.with_suffix(kind)).is_file()), None)


def _page(log, scene, fields, ignore, tolerance, into, name):
    """The page that the program makes of the failure; None where there is no program, or the scene is a function."""
    program = os.environ.get("RTSG_PROGRAM") or shutil.which("rtsg")
    if not program or scene is None or callable(scene):
        return None
    page = into / "replay.html"
    chosen = [word for field in fields for word in ("--field", field)] + [word for field in ignore for word in ("--ignore", field)]
    try:
        subprocess.run([program, "replay", log, "--rerun", scene, *chosen, "--tolerance", str(tolerance), "--name", name, "--page", page],
                       capture_output=True, timeout=300, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return page if page.is_file() else None


@pytest.fixture
def rtsg_replay(request, tmp_path, record_property):
    """A function that replays a log and fails the test where a frame is not the recorded one.

    rtsg_replay(log, scene=None, *, fields=(), ignore=(), tolerance=0.0, application=None, check=None): paths are relative
    to the test's file. `scene`: a file, or a function that builds the scene it is given; None: the file of the log's name
    beside it, or, where there is none, the log's own hashes are verified. The others are those of rtsg.replay_test(), whose
    report it returns. Where the program rtsg is found, a page shows the failure: it is named in the text, and as the property
    rtsg_page in JUnit's results.
    """
    folder = pathlib.Path(request.path).parent

    def replay(log, scene=None, *, fields=(), ignore=(), tolerance=0.0, application=None, check=None):
        log = folder / log
        scene = scene if callable(scene) else folder / scene if scene is not None else _beside(log)
        update = request.config.getoption("--rtsg-update")
        try:
            report = replay_test(log, scene=scene, application=application, check=check, fields=list(fields), ignore=list(ignore),
                                 tolerance=tolerance, update=update and scene is not None)
        except Error as error:
            pytest.fail(str(error), pytrace=False)
        if report.passed:
            return report
        lines = [f"{log.name}: {report}"]
        lines += [f"  {d.node}.{d.field} from frame {d.frame} (t = {d.time:g} s): {d.text}" for d in report.differences[:_SHOWN]]
        if len(report.differences) > _SHOWN:
            lines.append(f"  and {len(report.differences) - _SHOWN} more fields")
        if page := _page(log, scene, fields, ignore, tolerance, tmp_path, request.node.name):
            record_property("rtsg_page", str(page))
            lines.append(f"  shown in {page}")
        pytest.fail("\n".join(lines), pytrace=False)

    return replay
