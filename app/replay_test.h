// The part of `rtsg replay` that is a test: the scene run afresh on the log's input, and pictures and sound compared
// with those kept beside the log.
#pragma once

#include <optional>
#include <string>

#include <rtsg/sync/replay.h>

#include "outputs.h"

namespace rtsg::app {

struct ReplayTestArguments {
    std::string rerun, expectPicture, expectSound;
    double pictureTolerance = 0.01, soundTolerance = -40;
    bool update = false;

    void addTo(Command& command);
    bool any() const { return update || !rerun.empty() || !expectPicture.empty() || !expectSound.empty(); }
};

/// The exit status. Throws UsageError for options that do not go together.
int runReplayTest(const std::string& log, const ReplayTestArguments& arguments, OutputArguments outputs, bool json);

/// Scene time where a log begins; 0 if nothing in it is intact.
double logStart(const std::string& log);
/// With its time counted from there.
std::optional<Divergence> fromStart(std::optional<Divergence> divergence, double start);

/// {"frame":…,"t":…,"node":…,"field":…,"text":…} or null.
std::string toJson(const std::optional<Divergence>& divergence);

}  // namespace rtsg::app
