// Says that this build has no rtsg bench and rtsg chart.
#include "cli.h"

namespace rtsg::app {

namespace {

Verb absent(Command& program, const char* name, const char* description) {
    auto ignored = std::make_shared<std::vector<std::string>>();
    Command* command = program.addVerb(name, description);
    command->addOption("NAME", *ignored, "not built in");
    return {command, [ignored] {
                printError("this build leaves out rtsg bench and rtsg chart: configure with -DRTSG_BENCH=ON");
                return static_cast<int>(kUsage);
            }};
}

}  // namespace

Verb addBench(Command& program) {
    return absent(program, "bench", "Measure (not built in)");
}

Verb addChart(Command& program) {
    return absent(program, "chart", "Measure and draw (not built in)");
}

}  // namespace rtsg::app
