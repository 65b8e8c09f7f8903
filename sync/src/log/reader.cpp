// Reads a log record by record, skips damage, and finds the keyframes.
#include <algorithm>
#include <cstring>
#include <utility>

#include <fmt/format.h>

#include <rtsg/sync/log.h>

#include "columns/wire.h"
#include "index.h"
#include "log_files.h"

namespace rtsg {

namespace {

constexpr std::size_t kWindow = std::size_t{1} << 20;

}  // namespace

void encodeLogIndex(const std::vector<LogKeyframe>& keyframes, std::uint64_t offset, ByteBuffer& record,
                    RecordHeader next) {
    record.clear();
    record.room(kRecordHeaderSize);
    record.advance(kRecordHeaderSize);
    record.putVarint(keyframes.size());
    for (const LogKeyframe& keyframe : keyframes) {
        record.put(keyframe.offset);
        record.put(keyframe.to);
        record.put(keyframe.time);
        record.put(keyframe.head);
    }
    record.put(offset);
    record.append(kIndexMagic.data(), kIndexMagic.size());
    next.kind = RecordKind::index;
    sealRecord(record, next);
}

bool decodeLogIndex(std::span<const std::byte> record, std::uint64_t offset, std::vector<LogKeyframe>& keyframes) {
    wire::Reader in(recordPayload(record), kRecordHeaderSize);
    const std::size_t count = in.count(32);
    keyframes.clear();
    keyframes.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
        LogKeyframe keyframe;
        keyframe.offset = in.number<std::uint64_t>();
        keyframe.to = in.number<std::uint64_t>();
        keyframe.time = in.number<double>();
        keyframe.head = in.number<std::uint64_t>();
        if (keyframe.offset >= offset || keyframe.head >= keyframe.offset ||
            (i > 0 && keyframe.offset <= keyframes.back().offset))
            return false;
        keyframes.push_back(keyframe);
    }
    return !in.problem && in.left() == kIndexTail;
}

Result<LogReader> LogReader::open(const std::filesystem::path& file, std::uint64_t maxPayload) {
    LogReader log;
    log.file_ = file;
    log.maxPayload_ = maxPayload;
    auto files = LogFiles::open(file);
    if (!files) return std::unexpected(files.error());
    log.files_ = std::move(*files);
    log.size_ = log.files_->ends().back();
    log.searchBudget_ = 4 * log.size_ + (std::uint64_t{16} << 20);
    if (log.next()) {
        log.position_ = 0;
        log.intactEnd_ = 0;
        log.closed_ = log.goesOn_ = false;
        return log;
    }
    return fail(log.damage_.empty() ? "not a log: at byte 0: it is empty" : "not a log: " + log.damage_.front().text,
                {}, file.string());
}

LogReader::LogReader(LogReader&& other) noexcept {
    *this = std::move(other);
}

LogReader& LogReader::operator=(LogReader&& other) noexcept {
    std::swap(file_, other.file_);
    std::swap(files_, other.files_);
    std::swap(size_, other.size_);
    std::swap(position_, other.position_);
    std::swap(intactEnd_, other.intactEnd_);
    std::swap(maxPayload_, other.maxPayload_);
    std::swap(searchBudget_, other.searchBudget_);
    std::swap(damage_, other.damage_);
    std::swap(keyframes_, other.keyframes_);
    std::swap(hadIndex_, other.hadIndex_);
    std::swap(closed_, other.closed_);
    std::swap(goesOn_, other.goesOn_);
    std::swap(window_, other.window_);
    std::swap(windowAt_, other.windowAt_);
    return *this;
}

LogReader::~LogReader() = default;

/// Takes in bytes that were added since the file was opened, if they complete the record that ends at `end`. The log
/// then ends there.
void LogReader::growTo(std::uint64_t end) {
    if (end > size_ && files_->size() >= end) size_ = end;
}

std::string LogReader::damageText() const {
    if (damage_.empty()) return {};
    const LogDamage& first = damage_.front();
    return fmt::format("{} damaged place{}, the first at bytes {} to {}: {}", damage_.size(),
                       damage_.size() == 1 ? "" : "s", first.offset, first.offset + first.length, first.text);
}

bool LogReader::beingWritten() const {
    return files_->beingWritten();
}

/// True if the bytes from `offset` on are the beginning of a record that somebody is writing.
bool LogReader::waitsForMore(std::uint64_t offset) {
    ByteBuffer head;
    files_->read(offset, std::min<std::uint64_t>(size_ - offset, kRecordHeaderSize), head);
    const std::size_t magic = std::min(head.size(), kRecordMagic.size());
    if (std::memcmp(head.data(), kRecordMagic.data(), magic) != 0) return false;
    if (head.size() == kRecordHeaderSize) {
        const Result<RecordHeader> header = parseRecordHeader(head.bytes(), offset, maxPayload_);
        if (!header || header->size() <= size_ - offset) return false;
    }
    return beingWritten();
}

/// Loads the whole record at `offset` into the window and checks it.
Result<RecordHeader> LogReader::load(std::uint64_t offset) {
    const auto inWindow = [&](std::uint64_t length) {
        return offset >= windowAt_ && offset + length <= windowAt_ + window_.size();
    };
    const auto view = [&] { return window_.bytes().subspan(offset - windowAt_); };
    if (size_ - std::min(size_, offset) < kRecordHeaderSize) growTo(offset + kRecordHeaderSize);
    std::uint64_t left = size_ - std::min(size_, offset);
    if (!inWindow(std::min<std::uint64_t>(left, kRecordHeaderSize))) {
        windowAt_ = offset;
        files_->read(offset, std::min<std::uint64_t>(left, kWindow), window_);
    }
    Result<RecordHeader> header = parseRecordHeader(left ? view() : std::span<const std::byte>(), offset, maxPayload_);
    if (!header) return header;
    if (header->size() > left) {
        growTo(offset + header->size());
        left = size_ - offset;
    }
    if (header->size() > left)
        return fail(fmt::format("at byte {}: record truncated: {} of {} bytes", offset, left, header->size()));
    if (!inWindow(header->size())) {
        windowAt_ = offset;
        files_->read(offset, std::max<std::uint64_t>(header->size(), std::min<std::uint64_t>(left, kWindow)), window_);
    }
    return checkRecord(view(), offset, maxPayload_);
}

std::uint64_t LogReader::findMagic(std::uint64_t from) {
    ByteBuffer part;
    while (from < size_) {
        const std::size_t length = std::min<std::uint64_t>(size_ - from, kWindow);
        files_->read(from, length, part);
        if (part.size() < kRecordMagic.size()) return size_;
        const std::string_view text(reinterpret_cast<const char*>(part.data()), part.size());
        if (const std::size_t found = text.find(kRecordMagic); found != text.npos) return from + found;
        from += part.size() - (kRecordMagic.size() - 1);
    }
    return size_;
}

void LogReader::noteDamage(std::uint64_t from, std::uint64_t to, std::string text) {
    const auto known = [from](const LogDamage& d) { return d.offset == from; };
    if (damage_.size() < 1000 && std::ranges::none_of(damage_, known))
        damage_.push_back({from, to - from, std::move(text) + files_->locationAt(from)});
}

std::optional<LogReader::Record> LogReader::next() {
    const std::uint64_t start = position_;
    std::string problem;
    while (position_ < size_) {
        const Result<RecordHeader> header = load(position_);
        if (header) {
            if (!problem.empty()) noteDamage(start, position_, std::move(problem));
            Record record{*header, position_, window_.bytes().subspan(position_ - windowAt_, header->size())};
            position_ += header->size();
            if (position_ > intactEnd_) {
                intactEnd_ = position_;
                closed_ = saysEnd(*header);
                goesOn_ = saysGoesOn(*header);
            }
            return record;
        }
        if (problem.empty())
            problem = header.error().text;
        else if (const Result<RecordHeader> tried =
                     parseRecordHeader(window_.bytes().subspan(position_ - windowAt_), position_, maxPayload_);
                 tried && tried->size() <= size_ - position_) {
            // Without this bound a file full of forged headers would take quadratic time.
            if (tried->size() > searchBudget_) {
                noteDamage(start, size_, problem + "; gave up looking for an intact record");
                position_ = size_;
                return std::nullopt;
            }
            searchBudget_ -= tried->size();
        }
        position_ = findMagic(position_ + 1);
    }
    if (!problem.empty()) {
        closed_ = goesOn_ = false;
        if (!waitsForMore(start)) noteDamage(start, size_, std::move(problem));
    }
    return std::nullopt;
}

bool LogReader::readIndex() {
    std::vector<std::uint64_t> ends = files_->ends();
    ends.back() = size_;
    std::vector<LogKeyframe> all;
    std::uint64_t from = 0;
    for (const std::uint64_t end : ends)
        if (!readIndex(std::exchange(from, end), end, all)) return false;
    keyframes_ = std::move(all);
    return true;
}

/// Appends what the index says of the file that lies there.
bool LogReader::readIndex(std::uint64_t from, std::uint64_t end, std::vector<LogKeyframe>& into) {
    if (end - from < kRecordHeaderSize + kIndexTail) return false;
    ByteBuffer tail;
    files_->read(end - kIndexTail, kIndexTail, tail);
    if (tail.size() < kIndexTail || std::memcmp(tail.data() + 8, kIndexMagic.data(), kIndexMagic.size()) != 0)
        return false;
    std::uint64_t offset = 0;
    std::memcpy(&offset, tail.data(), sizeof(offset));
    if (offset >= end - from) return false;
    const Result<RecordHeader> header = load(from + offset);
    if (!header || header->kind != RecordKind::index || from + offset + header->size() != end) return false;
    std::vector<LogKeyframe> found;
    if (!decodeLogIndex(window_.bytes().subspan(from + offset - windowAt_, header->size()), offset, found))
        return false;
    for (LogKeyframe& keyframe : found) {
        keyframe.offset += from;
        keyframe.head += from;
        into.push_back(keyframe);
    }
    return true;
}

std::vector<LogKeyframe> scanLogKeyframes(LogReader& log) {
    std::vector<LogKeyframe> found;
    std::optional<std::uint64_t> head;
    while (const std::optional<LogReader::Record> record = log.next()) {
        if (record->header.kind == RecordKind::head) head = record->offset;
        // A keyframe without a head before it cannot be read. The same state comes again behind the next head.
        if (record->header.kind == RecordKind::keyframe && head)
            found.push_back({record->offset, record->header.to, record->header.time, *head});
    }
    return found;
}

void LogReader::scanKeyframes() {
    const std::uint64_t before = position_;
    position_ = 0;
    keyframes_ = scanLogKeyframes(*this);
    position_ = before;
}

const std::vector<LogKeyframe>& LogReader::keyframes() {
    if (!keyframes_) {
        hadIndex_ = readIndex();
        if (!hadIndex_) scanKeyframes();
    }
    return *keyframes_;
}

}  // namespace rtsg
