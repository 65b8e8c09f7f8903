#!/usr/bin/env python3
"""tests/summary.py on what ctest prints of tests that pass, pass at the second try, fail, are skipped, are slow, and of steps without tests."""
import sys

from summary import Summary

LOG = """== ./dev lint changed
a.cpp:3:1: error: a fault
== ./dev lint changed: FAILED, 19 s
== ./dev asan core
 1/1 Test #2: core.flaky ........................   Passed    0.50 sec
== ./dev asan core: passed, 61 s
== ./dev test
== packages: 12 s
== compile and link: 300 s (jobs: compile 500 s, link 61 s)
Test project /home/ann/rtsg/build
      Start  1: core.good
 1/9 Test  #1: core.good ........................   Passed    0.02 sec
      Start  2: core.flaky
 2/9 Test  #2: core.flaky .......................***Failed    0.25 sec
boo

      Start  2: core.flaky
    Test  #2: core.flaky .......................   Passed    0.25 sec
 3/9 Test  #3: core.bad .........................***Failed    0.02 sec
    Test  #3: core.bad .........................***Failed    0.01 sec
 4/9 Test  #4: core.skipped .....................***Skipped   0.01 sec
 5/9 Test  #5: core.crash .......................***Exception: SegFault  0.02 sec
 6/9 Test  #6: core.none ........................***Not Run   0.00 sec
 7/9 Test  #7: core.disabled ....................***Not Run (Disabled)   0.00 sec
 8/9 Test  #8: core.late ........................***Timeout  61.50 sec
 9/9 Test  #9: core.of/0  # GetParam() = 1 ......   Passed    5.20 sec

56% tests passed, 4 tests failed out of 8
== ./dev test: FAILED, 80 s
"""
TEXT = """Where the time went:
  ./dev lint changed: FAILED, 19 s
  ./dev asan core: passed, 61 s
  packages: 12 s
  compile and link: 300 s (jobs: compile 500 s, link 61 s)
  ./dev test: FAILED, 80 s
   1:01.5  core.late (./dev test)
   0:05.2  core.of/0  # GetParam() = 1 (./dev test)
   0:01.1  8 tests of at most 5 s
Skipped: core.skipped (./dev test), core.disabled (./dev test)
Passed at the second try: core.flaky (./dev test)
Failed: core.bad (./dev test), core.crash (./dev test), core.none (./dev test), core.late (./dev test), ./dev lint changed
4 passed, 5 failed, 2 skipped"""


def main():
    for log, text, status in ((LOG, TEXT, 1), ("1/1 Test #1: a ...   Passed    0.01 sec\n", "1 passed, 0 failed, 0 skipped", 0),
                              ("== packages: 1 s\n", "0 passed, 0 failed, 0 skipped", 1)):
        summary = Summary(log.splitlines(keepends=True))
        said = "\n".join(summary.text())
        if not said.endswith(text) or summary.status != status:
            print(f"said, with status {summary.status}:\n{said}\n\nexpected, with status {status}:\n{text}")
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
