// Declares the options of requests.
#include "request_arguments.h"

namespace rtsg::app {

void RequestArguments::addTo(Command& command) {
    const Command::Section section(command, "Acting on the scene");
    command.addOption(
        "--set", set,
        "send an event to the origin: DEF.field=VALUE@TIME or pointer=...@TIME, in scene time since joining");
    command.addOption("--edit", edit, "change a field at the origin, DEF.field=VALUE@TIME; undo can take it back");
    command.addOption("--undo", undo, "TIME at which to take back the last request of edits by --name")->repeatable();
    command.addOption("--redo", redo, "TIME at which to do again what was taken back last")->repeatable();
    command.addOption("--lock", lock,
                      "lock nodes for --name, DEF[,DEF...]=LEASE@TIME: nobody else may change them for this time, 60s "
                      "at most; LEASE 0 unlocks");
}

}  // namespace rtsg::app
