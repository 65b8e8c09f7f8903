// Shared by all verbs: options, diagnostics on stderr, progress, JSON. A verb is a function that fills a CLI subcommand
// and says what to run.
#pragma once

#include <functional>
#include <source_location>
#include <string>
#include <vector>

#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/documents/loader.h>

#include "command.h"
#include "export/labels.h"

namespace rtsg::app {

/// Exit statuses of design and shell alike.
enum ExitStatus { kDone = 0, kBad = 1, kUsage = 2 };

struct Verb {
    Command* command = nullptr;
    std::function<int()> run;
};

Verb addInfo(Command& program);
Verb addValidate(Command& program);
Verb addConvert(Command& program);
Verb addRun(Command& program);
Verb addView(Command& program);
Verb addTouch(Command& program);
Verb addRender(Command& program);
Verb addPick(Command& program);
Verb addBench(Command& program);
Verb addChart(Command& program);
Verb addListen(Command& program);
Verb addRecord(Command& program);
Verb addReplay(Command& program);
Verb addDiff(Command& program);
Verb addServe(Command& program);
Verb addMirror(Command& program);
Verb addRelay(Command& program);
Verb addKeys(Command& program);
Verb addHelp(Command& program);
Verb addCompletion(Command& program);

/// `file:line:col: error: text`, one a line, on stderr, each once; then how many were left out. The failure of a
/// subscriber that the caller reports itself (`said`) is not repeated.
void print(const Diagnostics& diagnostics, std::string_view said = {});
/// "1 frame", "2 frames".
std::string framesText(std::uint64_t count);
/// `rtsg: error: text [code]` on stderr; a text that is a diagnostic's own, as it is.
void printError(const std::string& text, DiagnosticCode code = DiagnosticCode::of(std::source_location::current()));
void printError(const Diagnostic& diagnostic);
/// Why nothing can be served: where it is for want of keys, with the options that say what to do; `keys` is what
/// `option` was given.
Diagnostic namingOptions(Diagnostic why, std::string_view option, const std::string& keys);

/// From the first call on, SIGINT, SIGTERM and SIGHUP only make this true, so that a verb can end in order; a second
/// one kills.
bool interrupted();

/// A bar with an ETA on stderr, if that is a terminal that moves its cursor (no NO_COLOR, no TERM=dumb) and the work
/// takes over a second.
Progress progressBar(std::string label);

/// --base, --allow and --limit: what the urls of a document may open, and how much of it.
struct ResourceArguments {
    std::string base;
    std::vector<std::string> allow, limits;

    void addTo(Command& command);
    /// The resources of a scene or log that the user named: files below its own folder, the working folder, --base and
    /// --allow. Throws UsageError.
    Resources ofFile(const std::string& file) const;
    /// The resources of a scene that others send: files below --base and --allow, and nothing else.
    Resources ofReplica() const;

  private:
    ResourcePolicy policy() const;
};

/// --dis: which addresses the DIS nodes of a scene may use; none unless it says so.
struct NetworkArguments {
    std::vector<std::string> dis;

    void addTo(Command& command);
};

/// Subscribers of the scene that fail are told of with its diagnostics, which the verb prints, and not before.
void tellOfFailuresInTheEnd(Scene& scene);

/// Loads SCENE ("-" is standard input) and prints its diagnostics. False if nothing usable was in it. A scene with
/// errors is used as far as it can be read: see statusOf(). `clip`: as ReadOptions.
bool load(Scene& scene, const std::string& file, Diagnostics& diagnostics, const Resources& resources,
          const std::string& clip = {});

/// Errors of files that a running scene loaded later count like those of load(). `file` is the scene's.
void noteDamage(const std::string& file, std::size_t errors);

/// An event that was asked for has been refused, and that was said.
void noteUnsent();

/// The exit status of a verb that would end with `status`: kBad instead of kDone if an event was refused, or, with a
/// line on standard error, if what it was made of had errors when it was loaded, then or while it ran.
int statusOf(int status);

/// The time of a scene that is still empty: what is loaded into it is there from then on.
void setClock(Scene& scene, double secondsSince1970);

/// "2s", "500ms", "1.5" (seconds). Throws UsageError.
double parseSeconds(const std::string& text);

}  // namespace rtsg::app
