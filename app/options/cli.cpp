// Helpers for all verbs: diagnostics, progress, interruption, durations, JSON text.
#include "cli.h"

#include <algorithm>
#include <atomic>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>
#include <unistd.h>

#include <rtsg/core/machine.h>
#include <rtsg/core/sandbox.h>
#include <rtsg/core/terminal.h>
#include <rtsg/core/web_address.h>
#include <rtsg/session/moments.h>

#include "extensions.h"
#include "say.h"

namespace rtsg::app {

void print(const Diagnostics& diagnostics, std::string_view said) {
    // The part that reported each text first. A picture need not repeat what the reader of a file has said about a
    // value.
    static std::unordered_map<std::string, DiagnosticCode> reportedBy;
    std::unordered_map<std::string, std::size_t> times;
    std::vector<std::pair<const std::string*, const Diagnostic*>> lines;  // in their order
    for (const Diagnostic& d : diagnostics.all()) {
        constexpr std::string_view kDetached = "detached: ";
        if (d.code == DiagnosticCode("subscriber-failed") && d.text.starts_with(kDetached) &&
            said.find(d.text.substr(kDetached.size())) != said.npos)
            continue;
        Diagnostic anybodys = d;
        anybodys.code = DiagnosticCode("application");
        if (reportedBy.try_emplace(anybodys.format(), d.code).first->second != d.code) continue;
        const auto [line, fresh] = times.try_emplace(terminalText(d.format()), 0);
        if (fresh) lines.emplace_back(&line->first, &d);
        ++line->second;
    }
    for (const auto& [line, diagnostic] : lines) {
        const std::size_t n = times.at(*line);
        say(*diagnostic, n > 1 ? fmt::format("{} ({} times)", *line, n) : *line);
    }
    if (diagnostics.dropped()) say(fmt::format("... and {} more", diagnostics.dropped()), Severity::warning);
}

std::string framesText(std::uint64_t count) {
    return fmt::format("{} frame{}", count, count == 1 ? "" : "s");
}

namespace {

/// True if the text ends in a code, "... [word]".
bool endsInCode(std::string_view text) {
    const std::size_t from = text.rfind(" [");
    if (from == text.npos || !text.ends_with(']')) return false;
    const std::string_view code = text.substr(from + 2, text.size() - from - 3);
    return code.size() > 1 && std::ranges::all_of(code, [](char c) { return c == '-' || (c >= 'a' && c <= 'z'); });
}

}  // namespace

/// The text of a diagnostic already says that it is an error, and of which file.
void printError(const std::string& text, DiagnosticCode code) {
    constexpr std::string_view kError = "error: ";
    const std::string begin = text.starts_with(kError) ? "rtsg: " : text.contains(": error: ") ? "" : "rtsg: error: ";
    const std::string end = endsInCode(text) ? "" : fmt::format(" [{}]", code.text());
    say(Diagnostic{Severity::error, {}, {}, text, code}, begin + terminalText(text) + end);
}

void printError(const Diagnostic& diagnostic) {
    if (diagnostic.file.empty())
        printError(diagnostic.text, diagnostic.code);
    else
        say(diagnostic);
}

Diagnostic namingOptions(Diagnostic why, std::string_view option, const std::string& keys) {
    if (keys.empty() && why.code == DiagnosticCode("keys"))
        why.text += fmt::format(" ({} FILE, or --insecure)", option);
    return why;
}

namespace {
/// Written by the thread that gets the signal, read by all.
std::atomic<bool> signalled = false;
static_assert(std::atomic<bool>::is_always_lock_free, "handlers of signals may use nothing else");
}  // namespace

bool interrupted() {
    static const bool installed = [] {
        struct sigaction action = {};
        action.sa_handler = [](int) { signalled = true; };
        action.sa_flags = static_cast<int>(SA_RESETHAND);
        sigemptyset(&action.sa_mask);
        sigaction(SIGINT, &action, nullptr);
        sigaction(SIGTERM, &action, nullptr);
        // A closed terminal also ends the program, unless the user has excluded that (nohup).
        struct sigaction hangup = {};
        if (sigaction(SIGHUP, nullptr, &hangup) == 0 && hangup.sa_handler != SIG_IGN)
            sigaction(SIGHUP, &action, nullptr);
        return true;
    }();
    return installed && signalled;
}

void sleepUntil(std::chrono::steady_clock::time_point until) {
    using Clock = std::chrono::steady_clock;
    constexpr std::chrono::milliseconds kLongest{2000};
    while (!interrupted() && Clock::now() < until) {
        const auto left = std::min<Clock::duration>(until - Clock::now(), kLongest);
        const auto whole = std::chrono::floor<std::chrono::seconds>(left);
        const timespec maximum = {whole.count(), static_cast<long>(std::chrono::nanoseconds(left - whole).count())};
        (void)::nanosleep(&maximum, nullptr);
    }
}

Progress progressBar(std::string label) {
    const auto set = [](const char* name) { return std::string_view(std::getenv(name) ? std::getenv(name) : ""); };
    if (!isatty(STDERR_FILENO) || !set("NO_COLOR").empty() || set("TERM") == "dumb") return {};
    using Clock = std::chrono::steady_clock;
    struct State {
        std::string label;
        Clock::time_point start = Clock::now(), shown = start;
        bool visible = false;
    };
    auto state = std::make_shared<State>();
    state->label = std::move(label);
    return [state](std::uint64_t done, std::uint64_t total) {
        const auto now = Clock::now();
        const double elapsed = std::chrono::duration<double>(now - state->start).count();
        const bool last = total != 0 && done >= total;
        if (last && std::exchange(state->visible, false)) reportError("\r\033[K");
        if (last || elapsed < 1 || total == 0 || now - state->shown < std::chrono::milliseconds(100)) return;
        state->shown = now;
        state->visible = true;
        const double part = static_cast<double>(done) / static_cast<double>(total);
        const auto width = static_cast<int>(part * 30);
        reportError("\r{} [{:#<{}}{:.<{}}] {:3.0f} %, {:.0f} s left\033[K", state->label, "", width, "", 30 - width,
                    part * 100, part > 0 ? elapsed * (1 - part) / part : 0);
        std::fflush(stderr);
    };
}

namespace {

/// --trust. The program has one command line.
bool trusts = false;

}  // namespace

void ResourceArguments::addTo(Command& command) {
    const Command::Section section(command, "Files and addresses");
    command.addOption("--base", base,
                      "folder (or address) from which relative urls start, and below which they may open files");
    command
        .addOption("--allow", allow,
                   "urls may also open files in and below this folder, or this http or https address (repeatable)")
        ->repeatable();
    command
        .addOption("--allow-network", networks,
                   "servers may be in this private network, such as 10.0.0.0/8 (repeatable)")
        ->repeatable();
    command.addOption("--ca", certificates,
                      "PEM file of the certificate authorities for https, instead of the system's");
    command.addOption("--cache", cache, "folder where fetched files are kept, or none; else ~/.cache/rtsg/web");
    command.addFlag("--offline", offline,
                    "ask no server: files from addresses come from the cache, and a note names each");
    command
        .addOption("--package", packages,
                   "NAME=FOLDER: package://NAME/ urls of a robot's file name files in this folder, which may be opened "
                   "(repeatable)")
        ->repeatable();
    command
        .addOption(
            "--limit", limits,
            "NAME=N sets a limit on documents: bytes of a file, nodes, depth, pixels, samples, instances, seconds; "
            "memory: bytes of the whole process")
        ->repeatable();
    command.addFlag("--trust", trusts,
                    "pictures, films, sounds, fonts and meshes are decoded in this process, and not in one that can do "
                    "nothing else");
    addExtensions(command);
}

void NetworkArguments::addTo(Command& command) {
    const Command::Section section(command, "Files and addresses");
    command
        .addOption("--dis", dis,
                   "nodes of the DIS component may use this address, HOST or HOST:PORT, or any (repeatable); else none")
        ->repeatable();
}

namespace {

/// An address that is to be allowed, with all that is below it.
WebAddress allowedAddress(const char* option, const std::string& text) {
    auto address = WebAddress::parse(text);
    if (!address) throw UsageError(option, fmt::format("{}: {}", text, address.error().text));
    return *address;
}

}  // namespace

std::shared_ptr<UrlFetcher> ResourceArguments::fetcher(const std::string& document) const {
    FetchSettings settings;
    for (const std::string& one : allow)
        if (isWebAddress(one)) settings.rules.allowed.push_back(allowedAddress("--allow", one));
    if (isWebAddress(base)) settings.rules.allowed.push_back(allowedAddress("--base", base));
    if (isWebAddress(document)) {
        WebAddress folder = allowedAddress("SCENE", document);
        const std::string path = folder.path.substr(0, folder.path.find('?'));
        folder.path = path.substr(0, path.rfind('/') + 1);
        settings.rules.allowed.push_back(std::move(folder));
    }
    for (const std::string& one : networks) {
        auto network = IpNetwork::parse(one);
        if (!network) throw UsageError("--allow-network", network.error().text);
        settings.rules.networks.push_back(*network);
    }
    std::error_code ignored;
    if (!certificates.empty() && !std::filesystem::is_regular_file(certificates, ignored))
        throw UsageError("--ca", certificates + " is no file");
    settings.certificates = certificates;
    settings.cache = cache.empty() ? userFetchCache() : std::filesystem::path(cache == "none" ? "" : cache);
    settings.inBackground = inBackground;
    settings.offline = offline;
    settings.fromCache = [](const std::string& address) {
        say(fmt::format("{} is from the cache: its server was not asked", address));
    };
    return std::make_shared<WebFetcher>(std::move(settings));
}

namespace {

void openSandbox() {
    if (isSandboxed()) return;
    const auto started = startSandbox();
    if (started) return;
    Diagnostics diagnostics;
    diagnostics.warning({}, started.error().text + "; --trust accepts that", started.error().code);
    print(diagnostics);
}

}  // namespace

ResourcePolicy ResourceArguments::policy(const std::string& document) const {
    ResourcePolicy policy;
    policy.fetcher = fetcher(document);
    std::error_code ignored;
    if (!base.empty() && !isWebAddress(base) && !std::filesystem::is_directory(base, ignored))
        throw UsageError("--base", base + " is no folder");
    for (const std::string& folder : allow) {
        if (isWebAddress(folder)) continue;
        if (!std::filesystem::is_directory(folder, ignored)) throw UsageError("--allow", folder + " is no folder");
        policy.roots.emplace_back(folder);
    }
    for (const std::string& package : packages) {
        const std::size_t equals = std::min(package.find('='), package.size());
        if (equals == 0 || equals == package.size()) throw UsageError("--package", package + ": expected NAME=FOLDER");
        const std::string folder = package.substr(equals + 1);
        if (!std::filesystem::is_directory(folder, ignored)) throw UsageError("--package", folder + " is no folder");
        policy.packages.emplace_back(package.substr(0, equals), folder);
    }
    std::uint64_t memory = memoryLimit();
    const std::pair<std::string_view, std::uint64_t*> known[] = {{"memory", &memory},
                                                                 {"bytes", &policy.maximumBytes},
                                                                 {"nodes", &policy.maximumNodes},
                                                                 {"depth", &policy.maximumDepth},
                                                                 {"pixels", &policy.maximumPixels},
                                                                 {"samples", &policy.maximumSamples},
                                                                 {"instances", &policy.maximumInstances},
                                                                 {"seconds", &policy.maximumSeconds}};
    for (const std::string& limit : limits) {
        const std::string_view text = limit;
        const auto equals = std::min(text.find('='), text.size());
        const auto* end = text.data() + text.size();
        bool good = false;
        for (const auto& [name, target] : known)
            if (name == text.substr(0, equals) && equals < text.size()) {
                const auto [at, problem] = std::from_chars(text.data() + equals + 1, end, *target);
                good = problem == std::errc() && at == end;
            }
        if (!good)
            throw UsageError(
                "--limit",
                limit +
                    ": expected memory=N, bytes=N, nodes=N, depth=N, pixels=N, samples=N, instances=N or seconds=N");
    }
    setMemoryLimit(memory);
    if (!trusts) openSandbox();
    return policy;
}

Resources ResourceArguments::ofFile(const std::string& file) const {
    ResourcePolicy all = policy(file);
    if (base.empty()) return Resources::ofFile(file, std::move(all));
    if (!isWebAddress(base)) all.roots.emplace_back(base);
    all = Resources::ofFile(file, std::move(all)).policy();
    return {base, std::move(all)};
}

Resources ResourceArguments::ofReplica() const {
    ResourcePolicy all = policy();
    if (!base.empty() && !isWebAddress(base)) all.roots.emplace_back(base);
    return {base, std::move(all)};
}

namespace {

/// The first scene with errors and their number, and whether something else is missing. This is needed for the exit
/// status, and nothing else keeps it.
struct Damage {
    std::string file;
    std::size_t errors = 0;
    bool leftOut = false;
} damage;

}  // namespace

bool load(Scene& scene, const std::string& file, Diagnostics& diagnostics, const Resources& resources,
          const std::string& clip) {
    return loadScene(scene, file, diagnostics, resources, programContext(), clip);
}

void noteDamage(const std::string& file, std::size_t errors) {
    if (damage.errors == 0) damage.file = file;
    if (damage.file == file) damage.errors = std::max(damage.errors, errors);
}

void noteLeftOut() {
    damage.leftOut = true;
}

int statusOf(int status) {
    if (status != kDone) return status;
    if (damage.errors == 0) return damage.leftOut ? kBad : kDone;
    printError(fmt::format("{} had {} error{}: this was made of the rest of it",
                           damage.file == "-" ? "<stdin>" : damage.file, damage.errors, damage.errors == 1 ? "" : "s"));
    return kBad;
}

double parseSeconds(const std::string& text) {
    return orUsageError(secondsIn(text));
}

}  // namespace rtsg::app
