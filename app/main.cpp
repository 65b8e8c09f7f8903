// rtsg: one program, a verb for each use of the libraries. Thin: what a library user would miss is in a library.
#include <exception>
#include <vector>

#include "cli.h"

int main(int argc, char** argv) {
    using namespace rtsg::app;
    CLI::App program{
        "rtsg keeps one X3D scene and any number of subscribers in step: pictures, sound, mirrors, logs.\n"
        "A SCENE is a file (X3D XML, ClassicVRML, VRML97, also gzipped) or - for standard input."};
    program.require_subcommand(1);
    program.set_version_flag("--version", "rtsg " RTSG_VERSION);
    std::vector<Verb> verbs{addInfo(program),   addValidate(program), addConvert(program), addRun(program),
                            addRender(program), addListen(program),   addServe(program),   addMirror(program),
                            addRecord(program), addReplay(program),   addPick(program),    addBench(program),
                            addChart(program)};
    try {
        program.parse(argc, argv);
        for (const Verb& verb : verbs)
            if (verb.command->parsed()) return verb.run();
    } catch (const CLI::ParseError& e) {
        return program.exit(e) == 0 ? kDone : kUsage;
    } catch (const std::exception& e) {
        printError(e.what());
        return kBad;
    }
    return kUsage;
}
