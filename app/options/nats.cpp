// Connects verbs to NATS servers, and prints the events of these connections.
#include "nats.h"

#include <cerrno>
#include <chrono>
#include <cstdlib>

#include <fmt/format.h>

#include "cli.h"
#include "hints.h"
#include "say.h"

namespace rtsg::app {

void checkNatsAddress(const std::string& option, const std::string& address) {
    if (const auto parsed = NatsAddress::parse(address); !parsed) throw UsageError(option, parsed.error().text);
}

Result<MirrorOrigin> openOrigin(const std::string& typed, const std::string& key, double patience) {
    if (isNatsAddress(typed)) {
        checkNatsAddress("ENDPOINT", typed);
        if (!key.empty())
            throw UsageError("--key",
                             "is for ZeroMQ: a NATS server gets user, password or token in its address, or TLS");
    } else {
        checkEndpoint("ENDPOINT", typed);
    }
    return MirrorOrigin::open(typed, std::chrono::milliseconds(static_cast<std::int64_t>(1e3 * patience)));
}

std::string shownLog(const std::string& typed) {
    const auto address = isNatsAddress(typed) ? NatsAddress::parse(typed) : Result<NatsAddress>(fail(""));
    return address ? address->shown : typed;
}

void printNews(MirrorOrigin& origin) {
    for (const Diagnostic& d : origin.takeDiagnostics()) say(d);
}

Result<Published> Published::start(const std::string& address, const MirrorServer& server,
                                   const std::optional<MirrorKeys>& keys) {
    Published published;
    if (address.empty()) return published;
    NatsPublisherOptions options;
    options.address = address;
    options.endpoint = server.endpoint();
    options.keys = keys;
    auto publisher = NatsPublisher::start(std::move(options));
    if (!publisher) return std::unexpected(publisher.error());
    published.publisher_ = std::move(*publisher);
    return published;
}

void Published::printNews() {
    if (!publisher_) return;
    for (const Diagnostic& d : publisher_->takeDiagnostics()) {
        failed_ = failed_ || d.severity == Severity::error;
        say(d);
    }
}

Result<PassingFolder> PassingFolder::make() {
    std::error_code problem;
    std::string path = (std::filesystem::temp_directory_path(problem) / "rtsg-nats-XXXXXX").string();
    if (problem || !::mkdtemp(path.data()))
        return fail(fmt::format("no folder for a local log: {}", std::generic_category().message(errno)));
    PassingFolder folder;
    folder.path_ = path;
    return folder;
}

PassingFolder::~PassingFolder() {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
}

Result<StoredLog> StoredLog::start(const std::string& option, std::string& file, NatsLog::Begin begin) {
    StoredLog stored;
    if (!isNatsAddress(file)) return stored;
    checkNatsAddress(option, file);
    auto folder = PassingFolder::make();
    if (!folder) return std::unexpected(folder.error());
    stored.folder_ = std::move(*folder);
    stored.file_ = (stored.folder_.path() / (NatsAddress::parse(file)->name + ".rlog")).string();
    auto log = NatsLog::start(file, stored.file_, begin);
    if (!log) return std::unexpected(log.error());
    stored.log_ = std::move(*log);
    file = stored.file_;
    return stored;
}

int StoredLog::finish(int status) {
    if (!log_) return status;
    if (const auto ok = log_->finish(); !ok) {
        printError(ok.error());
        if (!std::filesystem::exists(file_)) return kBad;
        printError(fmt::format("{} holds the whole log", file_));
        folder_.keep();
        return kBad;
    }
    reportError("stored {} messages, {} bytes, at {}\n", log_->storedMessages(), log_->storedBytes(), log_->address());
    return status;
}

Result<PassingFolder> fetchLog(const std::string& option, std::string& file) {
    if (!isNatsAddress(file)) return PassingFolder();
    checkNatsAddress(option, file);
    auto folder = PassingFolder::make();
    if (!folder) return folder;
    const std::string copy = (folder->path() / (NatsAddress::parse(file)->name + ".rlog")).string();
    const Progress progress = progressBar("fetching " + NatsAddress::parse(file)->shown);
    const auto fetched = NatsLog::fetch(file, copy, [&](std::uint64_t done, std::uint64_t all) {
        if (progress) progress(done, all);
        return !interrupted();
    });
    if (!fetched) return std::unexpected(fetched.error());
    file = copy;
    return folder;
}

}  // namespace rtsg::app
