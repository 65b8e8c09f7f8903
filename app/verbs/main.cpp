// rtsg: one program with a verb for each use of the libraries. It is thin: functions that library users need are in a
// library.
#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <string_view>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <fmt/format.h>
#include <malloc.h>
#include <rtsg/core/machine.h>
#include <unistd.h>

#include "cli.h"
#include "command_table.h"
#include "extensions.h"
#include "hints.h"
#include "say.h"
#include "verb_advise.h"
#include "verb_measure.h"
#include "version.h"

namespace rtsg::app {
namespace {

std::vector<Verb> addVerbs(Command& program) {
    std::vector<Verb> verbs{addInfo(program),   addValidate(program), addConvert(program), addRun(program),
                            addRender(program), addListen(program),   addServe(program),   addMirror(program),
                            addRecord(program), addReplay(program),   addPick(program),    addBench(program),
                            addChart(program),  addRelay(program),    addDiff(program),    addMeasure(program),
                            addView(program),   addTouch(program),    addKeys(program),    addMerge(program),
                            addTop(program),    addAssemble(program), addAdvise(program)};
    verbs.push_back(addCompletion(program));
    verbs.push_back(addHelp(program));  // last, because it needs the verbs before
    return verbs;
}

/// A wrong first word gets a better answer than the parser's.
bool isVerbOrOption(const Command& program, const std::string& word) {
    if (word.starts_with("-")) return true;
    std::vector<std::string> names;
    for (const VerbRow& verb : commandTable(program)) {
        if (verb.name == word) return true;
        names.push_back(verb.name);
    }
    std::string meant = hintForVerb(word);
    if (meant.empty()) meant = nearest(word, names);
    printError(fmt::format("there is no verb {}", word));
    reportError("{}rtsg help names them\n", meant.empty() ? "" : "did you mean " + meant + "?\n");
    return false;
}

int wrongUsage(const Command& program, const UsageError& error) {
    printError(error.what());
    if (const std::string meant = suggestion(program, error); !meant.empty()) reportError("did you mean {}?\n", meant);
    const Command* verb = program.parsedVerb();
    if (verb && verb->name() == "help")
        reportError("rtsg help names the verbs\n");
    else
        reportError("rtsg help{} says more\n", verb ? " " + verb->name() : "");
    return kUsage;
}

/// Checks that all output was written. Standard output may be the result, in a file on a full disk.
bool wroteOutput() {
    errno = 0;
    const bool failed = std::ferror(stdout) != 0;
    if (std::fflush(stdout) == 0 && !failed) return true;
    printError(
        fmt::format("cannot write to the standard output{}{}", errno ? ": " : "", errno ? std::strerror(errno) : ""));
    return false;
}

/// Once the allocator has given out a large piece, such as a snapshot, it keeps as much memory for the next one.
/// Servers and mirrors that run for months would hold it for ever. Fixed limits give it back. Smaller limits would cost
/// more than they save: with 2 and 1 MB, reading a log took twice the time, and a script's long list a third more.
void giveLargePiecesBack() {
    constexpr int kLarge = 8 << 20, kAtTheEnd = 16 << 20;
    ::mallopt(M_MMAP_THRESHOLD, kLarge);
    ::mallopt(M_TRIM_THRESHOLD, kAtTheEnd);
}

/// A standard stream that the caller has closed would become the next file that is opened, such as a log, and what is
/// printed would go there. What takes its place here cannot be read, or written, which is an error as it would be.
/// Errors alone are said to nobody.
void keepStandardStreams() {
    for (const auto& [stream, mode] :
         {std::pair{STDIN_FILENO, O_WRONLY}, std::pair{STDOUT_FILENO, O_RDONLY}, std::pair{STDERR_FILENO, O_WRONLY}})
        if (::fcntl(stream, F_GETFD) < 0) (void)::open("/dev/null", mode);  // it gets the lowest free number
}

/// The parser prints the version as soon as it meets that option.
bool asksForVersionAsJson(int argc, char** argv) {
    const std::vector<std::string_view> words(argv + 1, argv + argc);
    const auto has = [&](std::string_view word) { return std::ranges::find(words, word) != words.end(); };
    return words.size() == 2 && has("--json") && (has("--version") || has("-V"));
}

int run(int argc, char** argv) {
    if (asksForVersionAsJson(argc, argv)) {
        fmt::print("{}\n", versionAsJson());
        return kDone;
    }
    Command program("rtsg",
                    "rtsg keeps one X3D scene and any number of subscribers in step: pictures, sound, mirrors, logs.\n"
                    "A SCENE is a file (X3D in XML, ClassicVRML or JSON, VRML97, also gzipped; .rtsgb, glTF, STL,\n"
                    "OBJ, PLY, URDF, Collada), the address of one that --allow lets it fetch, or - for standard input.",
                    RTSG_VERSION);
    const std::vector<Verb> verbs = addVerbs(program);
    if (argc < 2) {
        reportError("{}", program.help());
        return kUsage;
    }
    if (!isVerbOrOption(program, argv[1])) return kUsage;
    try {
        if (!simd::isMaxInstructionSetKnown())
            throw UsageError(
                fmt::format("RTSG_MAX_ISA is \"{}\"; it may be sse2, avx2 or avx512", simd::maxInstructionSetName()));
        if (const auto status = program.parse(argc, argv)) return *status == 0 ? kDone : kUsage;
        for (const Verb& verb : verbs)
            if (verb.command->parsed()) return loadExtensions(*verb.command), verb.run();
    } catch (const UsageError& e) {
        return wrongUsage(program, e);
    }
    return kUsage;
}

}  // namespace
}  // namespace rtsg::app

int main(int argc, char** argv) {
    using namespace rtsg::app;
    keepStandardStreams();
    // A file that may not grow any more shall be an error of that write, and not end the process.
    std::signal(SIGXFSZ, SIG_IGN);
    // Readers get events as they happen, and a signal that ends the program cuts no line.
    std::setvbuf(stdout, nullptr, _IOLBF, 1 << 16);
    giveLargePiecesBack();
    try {
        const int status = statusOf(run(argc, argv));
        return wroteOutput() ? status : status == kDone ? kBad : status;
    } catch (const std::bad_alloc&) {
        printError("there is not enough memory for what was asked");
        return kBad;
    } catch (const std::exception& e) {
        printError(e.what());
        return kBad;
    }
}
