// CLI: what all verbs share: options, diagnostics on stderr, progress, JSON. A verb is a function that fills a CLI
// subcommand and says what to run.
#pragma once

#include <chrono>
#include <functional>
#include <source_location>
#include <string>
#include <vector>

#include <rtsg/core/bus.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/documents/loader.h>
#include <rtsg/session/labels.h>
#include <rtsg/session/load_scene.h>
#include <rtsg/session/notices.h>

#include "command.h"

namespace rtsg::app {

/// Exit statuses of the program.
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
Verb addMerge(Command& program);
Verb addServe(Command& program);
Verb addMirror(Command& program);
Verb addRelay(Command& program);
Verb addKeys(Command& program);
Verb addTop(Command& program);
Verb addAssemble(Command& program);
Verb addHelp(Command& program);
Verb addCompletion(Command& program);

/// Prints what sessions of the program have to say, ends them by signals, and has the plug-ins that the user named.
const SessionContext& programContext();

/// The value, or a UsageError with the error's text.
template <class T>
T orUsageError(Result<T> result) {
    if (!result) throw UsageError(result.error().text);
    return std::move(*result);
}
inline void orUsageError(const Result<>& result) {
    if (!result) throw UsageError(result.error().text);
}
/// Throws UsageError if the error is the caller's, who is then the user.
template <class T>
Result<T> refusingUsage(Result<T> result) {
    if (!result && result.error().code == kUsageCode) throw UsageError(result.error().text);
    return result;
}

/// Prints `file:line:col: error: text` on stderr, one a line, each once, and then how many were left out. `said` is the
/// failure of a subscriber that the caller reports itself, so it is not repeated.
void print(const Diagnostics& diagnostics, std::string_view said = {});
/// "1 frame", "2 frames".
std::string framesText(std::uint64_t count);
/// Prints `rtsg: error: text [code]` on stderr. A text that is a diagnostic's own is printed as it is.
void printError(const std::string& text, DiagnosticCode code = DiagnosticCode::of(std::source_location::current()));
void printError(const Diagnostic& diagnostic);
/// The reason why nothing can be served. If keys are missing, it names the options that help. `keys` is the value of
/// `option`.
Diagnostic namingOptions(Diagnostic why, std::string_view option, const std::string& keys);

/// After the first call SIGINT, SIGTERM and SIGHUP only make this true, so that a verb can end in order. A second
/// signal kills.
bool interrupted();
/// On the main thread: until then, or until a signal has come. A signal just before is noticed within two seconds.
void sleepUntil(std::chrono::steady_clock::time_point until);

/// A progress bar with the remaining time on stderr. Shown if stderr is a terminal that moves its cursor (no NO_COLOR,
/// no TERM=dumb) and the work takes over a second.
Progress progressBar(std::string label);

/// --base, --allow, --package, --limit and --trust: the files and addresses that the urls of a document may open, their
/// size, and which process decodes them.
struct ResourceArguments {
    std::string base;
    std::vector<std::string> allow, packages, limits, networks;
    std::string certificates, cache;
    /// Whether files from the network are fetched without waiting: see FetchSettings.
    bool inBackground = false;
    /// Whether such files come from the cache alone.
    bool offline = false;

    void addTo(Command& command);
    /// Resources for a scene or log that the user named: files below its own folder, the working folder, --base,
    /// --allow and --package. An address that the user named may be fetched, with what is in its folder. Throws
    /// UsageError.
    Resources ofFile(const std::string& file) const;
    /// Resources for a scene that others send: files below --base and --allow, of packages, and no others.
    Resources ofReplica() const;

  private:
    ResourcePolicy policy(const std::string& document = {}) const;
    std::shared_ptr<UrlFetcher> fetcher(const std::string& document) const;
};

/// --dis: the addresses that DIS nodes of a scene may use; by default none.
struct NetworkArguments {
    std::vector<std::string> dis;

    void addTo(Command& command);
};

/// Loads SCENE ("-" is standard input) and prints its diagnostics. Returns false if nothing in it was usable. A scene
/// with errors is used as far as it can be read: see statusOf(). `clip`: as in ReadOptions.
bool load(Scene& scene, const std::string& file, Diagnostics& diagnostics, const Resources& resources,
          const std::string& clip = {});

/// Notes how many errors a scene's file had so far, with those of its Inlines.
void noteDamage(const std::string& file, std::size_t errors);

/// Notes that something that was asked for is not there, and that this was reported: an event that was refused, an edit
/// of the file that could not be followed.
void noteLeftOut();

/// The exit status of a verb that would end with `status`. It is kBad instead of kDone if something was left out, or if
/// the scene had errors when it was loaded or while it ran; the latter is also said on standard error.
int statusOf(int status);

/// As secondsIn(). Throws UsageError.
double parseSeconds(const std::string& text);

}  // namespace rtsg::app
