// What a replay test leaves for people and for machines: one self-contained HTML page, and JUnit XML.
//
// Invariant: the page needs no other file and no network; all text in it is escaped. Threading: any thread.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <rtsg/sync/replay_test.h>

namespace rtsg::app {

/// One thing that was compared.
struct ReplayCheck {
    std::string name;     // "states", "picture", "sound"
    std::string failure;  // empty: passed
};

struct ReplayOutcome {
    std::string name, log, scene;
    ReplayReport report;  // times counted from the log's start
    std::vector<ReplayCheck> checks;
    std::string expectedPicture, madePicture;  // files; empty: none was compared
    double seconds = 0;                        // that the test took

    bool passed() const;
};

std::string replayPage(const ReplayOutcome& outcome);
std::string junitXml(const ReplayOutcome& outcome);

}  // namespace rtsg::app
