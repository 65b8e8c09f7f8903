// Says what can be done with a log by the store in which it lies, and stores and fetches those in JetStream.
#include "log_store.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <system_error>

#include <fmt/format.h>

#include <rtsg/nats/nats_address.h>
#include <rtsg/sync/log.h>

#include "cli.h"
#include "nats.h"
#include "say.h"

namespace rtsg::app {

namespace {

namespace fs = std::filesystem;

enum class Store : std::uint8_t { file, files, folder, pipe, jetStream };

Store storeOf(const std::string& log) {
    if (isNatsAddress(log)) return Store::jetStream;
    std::error_code error;
    const fs::file_status status = fs::status(log, error);
    if (fs::is_directory(status)) return Store::folder;
    if (fs::exists(status)) return fs::is_regular_file(status) ? Store::file : Store::pipe;
    const auto files = filesOfLog(log);
    return files && files->size() > 1 ? Store::files : Store::file;
}

// How a sentence goes on that begins with the log's name.
constexpr const char* kOneFile = ": a log is written to one file, whose name has no comma";
constexpr const char* kInFolder = " is a folder: name the file to write in it";
constexpr const char* kNewest = ": name the newest file of the log";
constexpr const char* kNewestInFolder = " is a folder: name the newest file of the log that is in it";
constexpr const char* kPipe = " is no regular file, which could be divided into pieces";
constexpr const char* kNoEnd = " is no regular file, so there is nothing to continue";
constexpr const char* kStream = ": a log at a NATS server cannot be divided into pieces";
constexpr const char* kAgain = ": only a log in one file can be recorded again";

/// Why not, by LogUse and Store; null: it can be done.
constexpr std::array<std::array<const char*, 5>, 5> kTable{{
    //  file     files      folder           pipe     jetStream
    {{nullptr, kOneFile, kInFolder, nullptr, nullptr}},      // write
    {{nullptr, kOneFile, kInFolder, kPipe, kStream}},        // rotate
    {{nullptr, kNewest, kNewestInFolder, kNoEnd, nullptr}},  // goOn
    {{nullptr, kNewest, kNewestInFolder, kNoEnd, kStream}},  // goOnRotating
    {{nullptr, kAgain, kAgain, kAgain, kAgain}},             // recordAgain
}};

/// A log without its beginning is read from its first keyframe on, and counts as one that was cut.
void reportMissing(const std::string& log, const NatsLog::Missing& missing) {
    if (missing.empty()) return;
    std::string numbers;
    for (const auto& [first, last] : missing)
        numbers +=
            fmt::format("{}{}{}", numbers.empty() ? "" : ", ", first, last > first ? fmt::format(" to {}", last) : "");
    printError(fmt::format("{}: the store has let go of messages {}: what is left is read from keyframe to keyframe",
                           log, numbers));
    noteLeftOut();
}

}  // namespace

void checkLogUse(const std::string& option, const std::string& log, LogUse use) {
    if (log.empty()) return;
    const Store store = storeOf(log);
    const char* const why = kTable[static_cast<std::size_t>(use)][static_cast<std::size_t>(store)];
    if (why) throw UsageError(option, shownLog(log) + why);
}

std::string shownLog(const std::string& typed) {
    const auto address = isNatsAddress(typed) ? NatsAddress::parse(typed) : Result<NatsAddress>(fail(""));
    return address ? address->shown : typed;
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

Result<StoredLog> StoredLog::start(const std::string& option, std::string& file, LogUse use, bool force) {
    checkLogUse(option, file, use);
    StoredLog stored;
    if (!isNatsAddress(file)) return stored;
    checkNatsAddress(option, file);
    auto folder = PassingFolder::make();
    if (!folder) return std::unexpected(folder.error());
    stored.folder_ = std::move(*folder);
    stored.file_ = (stored.folder_.path() / (NatsAddress::parse(file)->name + ".rlog")).string();
    const bool goesOn = use == LogUse::goOn || use == LogUse::goOnRotating;
    auto log = NatsLog::start(file, stored.file_,
                              goesOn  ? NatsLog::Begin::goOn
                              : force ? NatsLog::Begin::replace
                                      : NatsLog::Begin::fresh);
    if (!log) return std::unexpected(log.error());
    stored.log_ = std::move(*log);
    file = stored.file_;
    sayInstead(file, stored.log_->address());
    reportMissing(stored.log_->address(), stored.log_->missing());
    return stored;
}

int StoredLog::finish(int status) {
    if (!log_) return status;
    if (const auto ok = log_->finish(); !ok) {
        printError(ok.error());
        if (!std::filesystem::exists(file_)) return kBad;
        sayInstead(file_, file_);
        printError(fmt::format("{} holds the whole log", file_));
        folder_.keep();
        return kBad;
    }
    if (log_->storedBytes() == 0) return status;  // the verb has said why
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
    const std::string shown = shownLog(std::exchange(file, copy));
    sayInstead(copy, shown);
    reportMissing(shown, fetched->missing);
    return folder;
}

}  // namespace rtsg::app
