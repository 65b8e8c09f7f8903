// Keeps fetched files in a folder, each complete or not there.
#include "disk_cache.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <system_error>
#include <vector>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

namespace rtsg::fetch {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kFirstLine = "rtsg fetched file 1";
constexpr std::uint64_t kMaxEntryBytes = std::uint64_t{64} << 10;
constexpr auto kOldest = std::chrono::hours(1);  // of a file that is being written

bool isHash(std::string_view name) {
    return name.size() == 64 && name.find_first_not_of("0123456789abcdef") == name.npos;
}

/// The bytes of a regular file that is ours; nothing if there are more than `most`.
std::optional<std::string> readAll(const fs::path& file, std::uint64_t maximum) {
    const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (descriptor < 0) return std::nullopt;
    struct stat status{};
    std::optional<std::string> result;
    if (::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode) && status.st_uid == ::geteuid() &&
        static_cast<std::uint64_t>(status.st_size) <= maximum) {
        result.emplace(static_cast<std::size_t>(status.st_size), '\0');
        std::size_t got = 0;
        while (got < result->size()) {
            const ssize_t more = ::read(descriptor, result->data() + got, result->size() - got);
            if (more <= 0) break;
            got += static_cast<std::size_t>(more);
        }
        if (got < result->size()) result.reset();
    }
    ::close(descriptor);
    return result;
}

bool writeAll(int descriptor, std::string_view bytes) {
    while (!bytes.empty()) {
        const ssize_t done = ::write(descriptor, bytes.data(), bytes.size());
        if (done <= 0) return false;
        bytes.remove_prefix(static_cast<std::size_t>(done));
    }
    return true;
}

/// The next line of a text, which ends in a line feed.
std::optional<std::string> line(std::string_view& text) {
    const std::size_t end = text.find('\n');
    if (end == text.npos) return std::nullopt;
    std::string result(text.substr(0, end));
    text.remove_prefix(end + 1);
    return result;
}

}  // namespace

DiskCache::DiskCache(fs::path folder, std::uint64_t limit) : folder_(std::move(folder)), limit_(limit) {
    if (folder_.empty()) return;
    std::error_code problem;
    fs::create_directories(folder_.parent_path(), problem);
    ::mkdir(folder_.c_str(), S_IRWXU);
    for (const char* name : {"entries", "files"}) ::mkdir((folder_ / name).c_str(), S_IRWXU);
    struct stat status{};
    // Others might put files there.
    constexpr mode_t kOthersWrite = S_IWGRP | S_IWOTH;
    if (::stat(folder_.c_str(), &status) != 0 || status.st_uid != ::geteuid() || (status.st_mode & kOthersWrite) != 0)
        folder_.clear();
}

std::optional<CacheEntry> DiskCache::find(const std::string& address, const TransferModule& module) const {
    if (folder_.empty()) return std::nullopt;
    const auto text = readAll(folder_ / "entries" / module.sha256(address), kMaxEntryBytes);
    if (!text) return std::nullopt;
    std::string_view rest = *text;
    if (line(rest) != kFirstLine || line(rest) != address) return std::nullopt;
    CacheEntry entry;
    for (std::string* field : {&entry.mediaType, &entry.etag, &entry.lastModified, &entry.hash}) {
        auto next = line(rest);
        if (!next) return std::nullopt;
        *field = std::move(*next);
    }
    if (!isHash(entry.hash)) return std::nullopt;
    return entry;
}

std::optional<std::string> DiskCache::content(const std::string& hash, std::uint64_t maximumBytes,
                                              const TransferModule& module) const {
    if (folder_.empty() || !isHash(hash)) return std::nullopt;
    const fs::path file = folder_ / "files" / hash;
    auto bytes = readAll(file, maximumBytes);
    if (!bytes) return std::nullopt;
    if (module.sha256(*bytes) != hash) {
        ::unlink(file.c_str());
        return std::nullopt;
    }
    ::utimensat(AT_FDCWD, file.c_str(), nullptr, 0);  // it is in use
    return bytes;
}

void DiskCache::store(const std::string& address, const CacheEntry& entry, std::string_view bytes,
                      const TransferModule& module) const {
    if (folder_.empty() || bytes.size() > limit_) return;
    write(folder_ / "files" / entry.hash, bytes);
    const auto plain = [](std::string text) {
        std::ranges::replace_if(text, [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
        return text;
    };
    write(folder_ / "entries" / module.sha256(address),
          fmt::format("{}\n{}\n{}\n{}\n{}\n{}\n", kFirstLine, address, plain(entry.mediaType), plain(entry.etag),
                      plain(entry.lastModified), entry.hash));
    shrink();
}

/// Errors leave the folder as it was: a cache may lack anything.
void DiskCache::write(const fs::path& file, std::string_view bytes) const {
    static std::atomic<unsigned> count = 0;
    const fs::path created = folder_ / fmt::format(".{}.{}", ::getpid(), ++count);
    const int descriptor =
        ::open(created.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, S_IRUSR | S_IWUSR);
    if (descriptor < 0) return;
    const bool whole = writeAll(descriptor, bytes);
    if (::close(descriptor) != 0 || !whole || ::rename(created.c_str(), file.c_str()) != 0) ::unlink(created.c_str());
}

/// Removes the files longest unused, entries whose files are gone, and remains of processes that were killed.
void DiskCache::shrink() const {
    struct Kept {
        fs::file_time_type used;
        std::uint64_t bytes = 0;
        fs::path file;
    };
    std::vector<Kept> all;
    std::uint64_t sum = 0;
    std::error_code problem;
    for (const char* name : {"files", "entries"})
        for (fs::directory_iterator at(folder_ / name, problem), end; !problem && at != end; at.increment(problem)) {
            if (!isHash(at->path().filename().native())) continue;
            std::error_code gone;
            const std::uint64_t bytes = at->file_size(gone);
            const auto used = at->last_write_time(gone);
            if (gone) continue;
            sum += bytes;
            all.push_back({used, bytes, at->path()});
        }
    const auto now = fs::file_time_type::clock::now();
    for (fs::directory_iterator at(folder_, problem), end; !problem && at != end; at.increment(problem)) {
        std::error_code gone;
        const bool isOurs = at->path().filename().native().starts_with('.') && at->is_regular_file(gone);
        if (isOurs && now - at->last_write_time(gone) > kOldest) fs::remove(at->path(), gone);
    }
    if (sum <= limit_) return;
    std::ranges::sort(all, {}, &Kept::used);
    for (const Kept& one : all) {
        if (sum <= limit_) return;
        std::error_code gone;
        fs::remove(one.file, gone);
        sum -= one.bytes;
    }
}

}  // namespace rtsg::fetch
