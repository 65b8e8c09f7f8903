// Replay page: writes the results of a replay test as a self-contained HTML page for people and as JUnit XML for
// machines.
//
// Invariant: the page needs no other file and no network, and all text in it is escaped.
// Threading: any thread.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/renderers/picture.h>
#include <rtsg/sync/replay_test.h>

namespace rtsg {

/// One thing that was compared.
struct ReplayCheck {
    std::string name;     // "states", "picture", "sound"
    std::string failure;  // empty: passed
    std::string advice;   // what to do about it, in lines; may be empty
};

/// The state in which the two scenes first differed, as a picture of each.
struct DifferingPictures {
    std::uint64_t state = 0;  // number in the log
    Result<Picture> expected, rendered;
    ToneMap toneMap;
};

struct ReplayOutcome {
    std::string name, log, scene;
    ReplayReport report;  // times are counted from the log's start
    std::vector<ReplayCheck> checks;
    std::string expectedPicture, createdPicture;  // files; empty: no picture was compared
    std::optional<DifferingPictures> differing;   // otherwise
    double seconds = 0;                           // duration of the test

    bool passed() const;
};

std::string replayPage(const ReplayOutcome& outcome);
std::string junitXml(const ReplayOutcome& outcome);

}  // namespace rtsg
