// Replay tests: run a scene again on a log's input, and compare its states, pictures and sound with those expected.
//
// ReplayTest (rtsg/sync/replay_test.h) compares the states of any scene; this adds files of scenes, and outputs.
// Threading: the calling thread.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include <rtsg/core/resource.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/session/replay_page.h>
#include <rtsg/sync/field_comparison.h>
#include <rtsg/sync/log_check.h>

namespace rtsg {

struct ReplayTestOptions {
    std::string rerun;                       // the scene's file; empty: the log alone is checked
    std::string expectPicture, expectSound;  // files that the last state must give; empty: none
    std::string junit, page, name;           // of the reports; without a name it is the log's
    FieldSelection compared;
    double pictureTolerance = 0.01;  // root mean square error, linear, white is 1
    double soundTolerance = -40;     // level of the difference, dB below the sound
    bool update = false;             // record again: the log, and the expected picture and sound
    bool closed = false;             // the log must be closed, too
};

struct ReplayTestRun {
    ReplayOutcome outcome;              // also of a test that could not run
    std::optional<Diagnostic> failure;  // why it could not run
    bool isReported = false;            // the failure, among the scene's diagnostics
    /// The picture and the sound that were made for comparison; they get their names (actualName()) when this goes.
    std::shared_ptr<const void> files;
};
/// Runs the test. `outputs`: how pictures and sound are made. `resources`: what urls of the scene may open.
ReplayTestRun runReplayTest(const std::string& log, const ReplayTestOptions& options, OutputOptions outputs,
                            const Resources& resources);
/// The outcome of a test that could not run.
ReplayOutcome failedOutcome(const std::string& log, const ReplayTestOptions& options, const std::string& why,
                            const std::string& advice = {});
/// Writes the JUnit XML, and the page if the test has failed; the page of an earlier failure is removed otherwise.
Result<> writeReports(const ReplayTestOptions& options, const ReplayOutcome& outcome, const SessionContext& context);
/// The name of the file that is made for comparison with `reference`: in the current folder, away from the user's own.
std::string actualName(const std::string& reference);

/// The scene time at which a log begins. 0 if nothing in it is intact.
double logStart(const std::string& log);
/// The divergence with its time counted from `start`.
std::optional<Divergence> fromStart(std::optional<Divergence> divergence, double start);

}  // namespace rtsg
