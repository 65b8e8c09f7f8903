// --at and --clip, and what is typed as a moment.
#include "start_time.h"

#include "cli.h"

namespace rtsg::app {

double parseDate(const std::string& text) {
    return orUsageError(dateIn(text));
}

double parseMoment(const std::string& text, double start) {
    return orUsageError(momentIn(text, start));
}

void StartTime::addTo(Command& command) {
    command.addOption("--at", at,
                      kind == Kind::live ? "the scene's time at the start: seconds since 1970 or a date; else now"
                                         : "the scene's time at the start: seconds since 1970, a date, or now; else "
                                           "2000-01-01, always the same");
    addClip(command, clip);
}

void addClip(Command& command, std::string& clip) {
    command.addOption("--clip", clip, "the animation of a glTF file that plays, by its name; else the first");
}

SceneStart StartTime::options() const {
    const bool isGiven = !at.empty();
    const double time = isGiven ? parseDate(at) : kind == Kind::live ? systemTime() : kSimulatedStart;
    return {.time = time, .isGiven = isGiven, .clip = clip};
}

}  // namespace rtsg::app
