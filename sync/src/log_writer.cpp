#include <cerrno>
#include <cstring>
#include <random>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <rtsg/core/scene.h>
#include <rtsg/sync/log.h>

#include "log_index.h"

namespace rtsg {

namespace {

std::uint64_t freshEpoch() {
    std::random_device device;
    const std::uint64_t high = device();
    return high << 32 | device();
}

}  // namespace

LogWriter::LogWriter(std::filesystem::path file, TypeTable types, LogOptions options)
    : file_(std::move(file)), types_(types), options_(std::move(options)) {}

Diagnostic LogWriter::failure(std::string_view what, int error) const {
    return {Severity::error, file_.string(), {}, fmt::format("{}: {}", what, std::strerror(error))};
}

Result<std::unique_ptr<LogWriter>> LogWriter::create(const std::filesystem::path& file, TypeTable types,
                                                     LogOptions options) {
    std::unique_ptr<LogWriter> log(new LogWriter(file, types, std::move(options)));
    std::uint64_t keep = 0;
    if (log->options_.append && std::filesystem::exists(file)) {
        Result<LogReader> old = LogReader::open(file);
        if (!old) return std::unexpected(old.error());
        log->keyframes_ = scanLogKeyframes(*old);
        keep = old->intactEnd();
    }
    log->descriptor_ = ::open(file.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | (keep ? 0 : O_TRUNC), 0644);
    if (log->descriptor_ < 0) return std::unexpected(log->failure("cannot write", errno));
    if (keep &&
        (::ftruncate(log->descriptor_, static_cast<off_t>(keep)) != 0 || ::lseek(log->descriptor_, 0, SEEK_END) < 0))
        return std::unexpected(log->failure("cannot append", errno));
    log->size_ = keep;
    if (auto ok = log->writeHead(); !ok) return std::unexpected(ok.error());
    return log;
}

LogWriter::~LogWriter() {
    (void)close();
}

Result<> LogWriter::writeHead() {
    epoch_ = freshEpoch();
    head_ = size_;
    ByteBuffer head;
    encodeHead(epoch_, options_.creator, types_, true, head);
    return writeRecord(head);
}

Result<> LogWriter::writeRecord(const ByteBuffer& record) {
    if (broken_ || descriptor_ < 0) return fail("the log is closed", {}, file_.string());
    const std::byte* at = record.data();
    std::size_t left = record.size();
    while (left > 0) {
        const ssize_t written = ::write(descriptor_, at, left);
        if (written < 0 && errno == EINTR) continue;
        if (written <= 0) {
            const int error = written < 0 ? errno : ENOSPC;
            broken_ = true;
            // The file shall end with a whole record, whatever came of this one.
            const bool cut = ::ftruncate(descriptor_, static_cast<off_t>(size_)) == 0;
            return std::unexpected(failure(cut ? "cannot write" : "cannot write, nor cut back", error));
        }
        at += written;
        left -= static_cast<std::size_t>(written);
    }
    size_ += record.size();
    return {};
}

Result<> LogWriter::flush() {
    if (::fdatasync(descriptor_) == 0 || errno == EINVAL || errno == EROFS) return {};  // pipes cannot be synced
    return std::unexpected(failure("cannot flush", errno));
}

Result<> LogWriter::write(const ChangeSet& changes) {
    if (changes.isSnapshot() && state_ != 0 && (changes.to != state_ || changes.hash != hash_))
        if (auto ok = writeHead(); !ok) return ok;
    state_ = changes.to;
    hash_ = changes.hash;
    encoder_.encode(changes, record_);
    const std::uint64_t offset = size_;
    if (auto ok = writeRecord(record_); !ok) return ok;
    if (changes.isSnapshot()) {
        keyframes_.push_back({offset, changes.to, changes.time, head_});
        keyframeSize_ = record_.size();
        sinceKeyframe_ = 0;
    } else {
        sinceKeyframe_ += record_.size();
    }
    ++frames_;
    if (options_.sync == LogOptions::Sync::always ||
        (options_.sync == LogOptions::Sync::atKeyframes && changes.isSnapshot()))
        return flush();
    return {};
}

Result<> LogWriter::apply(const Scene& scene, const ChangeSet& changes) {
    if (auto ok = write(changes); !ok) return ok;
    const double due = options_.keyframeFactor * static_cast<double>(keyframeSize_);
    if (sinceKeyframe_ < options_.keyframeBytes || static_cast<double>(sinceKeyframe_) < due) return {};
    // Only while the scene is in the very state that was just written: a subscriber that is polled may lag behind.
    if (scene.sequence() != changes.to) return {};
    if (auto ok = write(scene.snapshot()); !ok) return ok;
    --frames_;
    return {};
}

Result<> LogWriter::writeIndex() {
    encodeLogIndex(keyframes_, size_, record_);
    return writeRecord(record_);
}

Result<> LogWriter::close() {
    if (descriptor_ < 0) return {};
    Result<> result;
    if (!broken_) result = writeIndex();
    if (result && !broken_) result = flush();
    if (::close(descriptor_) != 0 && result) result = std::unexpected(failure("cannot close", errno));
    descriptor_ = -1;
    return result;
}

}  // namespace rtsg
