// Keeps the records that a mirror server may have to send again, and recycles their buffers.
#include "history.h"

#include <algorithm>
#include <cstdint>
#include <new>

#include <sys/mman.h>

namespace rtsg {

namespace {

constexpr std::size_t kPooled = 32;
constexpr std::size_t kMaxPooled = std::size_t{8} << 20;  // bytes, of all buffers
constexpr std::size_t kMinReady = std::size_t{32} << 10,
                      kMaxReady = std::size_t{4} << 20;  // bytes, of one buffer and of all
constexpr std::size_t kReady = 4;
constexpr std::size_t kPage = 4096;
/// Touches the pages of this memory, if possible at once, so that the system allocates them. Its content does not
/// matter.
void makePresent(std::byte* memory, std::size_t bytes) {
#ifdef MADV_POPULATE_WRITE
    const auto into = reinterpret_cast<std::uintptr_t>(memory) % kPage;
    if (::madvise(memory - into, into + bytes, MADV_POPULATE_WRITE) == 0) return;
#endif
    for (std::size_t at = 0; at < bytes; at += kPage) static_cast<volatile std::byte*>(memory)[at] = std::byte{};
}

}  // namespace

/// Reserves all room now, because records are returned by threads that must not throw even when memory is short.
RecordPool::RecordPool() {
    free_.reserve(kPooled);
}

std::shared_ptr<EncodedRecord> RecordPool::take() {
    std::unique_ptr<EncodedRecord> record;
    {
        const std::scoped_lock lock(mutex_);
        if (!free_.empty()) {
            record = std::move(free_.back());
            free_.pop_back();
            freeBytes_ -= record->bytes.capacity();
        }
    }
    if (!record) record = std::make_unique<EncodedRecord>();
    record->published = 0;
    return {record.release(), [pool = weak_from_this()](EncodedRecord* r) {
                std::unique_ptr<EncodedRecord> owned(r);
                if (const auto alive = pool.lock()) alive->giveBack(std::move(owned));
            }};
}

void RecordPool::keepReady(std::size_t bytes) {
    if (bytes < kMinReady) return;
    const auto enough = [&] {
        const std::scoped_lock lock(mutex_);
        return free_.size() >= std::min(kReady, kMaxReady / bytes);
    };
    while (!enough()) {
        std::unique_ptr<EncodedRecord> record;
        try {
            record = std::make_unique<EncodedRecord>();
            record->bytes.room(bytes);
        } catch (const std::bad_alloc&) {
            return;  // whoever needs the memory finds out
        }
        makePresent(record->bytes.data(), bytes);
        giveBack(std::move(record));
    }
}

void RecordPool::giveBack(std::unique_ptr<EncodedRecord> record) {
    record->input.reset();
    record->runState.reset();
    record->predicted.reset();
    if (record->header.kind == RecordKind::keyframe) return;
    const std::scoped_lock lock(mutex_);
    if (free_.size() >= kPooled || freeBytes_ + record->bytes.capacity() > kMaxPooled) return;
    freeBytes_ += record->bytes.capacity();
    free_.push_back(std::move(record));
}

void MirrorHistory::clear() {
    keyframe_.reset();
    first_.reset();
    frames_.clear();
    ends_.clear();
    memory_ = total_ = newest_ = 0;
    started_ = false;
}

bool MirrorHistory::add(SharedRecord record) {
    const RecordHeader& header = record->header;
    if (header.kind == RecordKind::keyframe) {
        // A keyframe is a first state, a snapshot of the newest state, or the first change of a new scene.
        if (!empty() && header.to != newest_ && newest_ != 0) return false;
        if (newest_ != header.to) frames_.clear(), ends_.clear(), memory_ = 0, first_.reset();
        newest_ = header.to;
        started_ = true;
        replaceKeyframe(std::move(record));
        return true;
    }
    if (empty() || header.from != newest_) return false;
    if (header.to == header.from) {
        // A repair: the served replica was wrong. Its followers find out by the hash, and nobody else may get the
        // records that led here.
        keyframe_.reset();
        first_.reset();
        frames_.clear();
        ends_.clear();
        memory_ = 0;
        return true;
    }
    newest_ = header.to;
    memory_ += memoryOf(*record);
    total_ += record->bytes.size();
    ends_.push_back(total_);
    frames_.push_back(std::move(record));
    while (memory_ > limit_ && frames_.size() > 1) {
        memory_ -= memoryOf(*frames_.front());
        frames_.pop_front();
        ends_.pop_front();
    }
    if (first_ && !continues(first_->header.to)) first_.reset();
    return true;
}

void MirrorHistory::replaceKeyframe(SharedRecord record) {
    if (keepsFirst_ && keyframe_ && !first_ && continues(keyframe_->header.to)) first_ = std::move(keyframe_);
    keyframe_ = std::move(record);
}

void MirrorHistory::addEarlier(SharedRecord record) {
    if (record->header.kind != RecordKind::frame) return;
    if (!started_) newest_ = record->header.from;
    started_ = true;
    add(std::move(record));
}

std::size_t MirrorHistory::indexOf(std::uint64_t state) const {
    if (frames_.empty()) return 0;
    // Mostly each frame leads on by one state, so the index follows from the difference.
    const std::uint64_t first = frames_.front()->header.from, likely = state - first;
    if (state >= first && likely < frames_.size() && frames_[likely]->header.from == state) return likely;
    const auto found =
        std::ranges::lower_bound(frames_, state, {}, [](const SharedRecord& r) { return r->header.from; });
    return found != frames_.end() && (*found)->header.from == state ? static_cast<std::size_t>(found - frames_.begin())
                                                                    : frames_.size();
}

bool MirrorHistory::continues(std::uint64_t state) const {
    return !empty() && (state == newest_ || indexOf(state) < frames_.size());
}

bool MirrorHistory::continues(std::uint64_t state, const Hash128& hash) const {
    if (!continues(state)) return false;
    if (hash == Hash128{}) return true;
    const std::size_t index = indexOf(state);  // of the frame after the state; one behind the last at the end
    if (index > 0) return frames_[index - 1]->header.hash == hash;
    for (const SharedRecord* known : {&keyframe_, &first_})
        if (*known && (*known)->header.to == state && (*known)->header.hash != hash) return false;
    return true;
}

std::vector<SharedRecord> MirrorHistory::allSince(std::uint64_t state) const {
    std::vector<SharedRecord> records;
    SharedRecord from = keyframe();
    if (!from || from->header.to > state) from = first_;
    if (!from || from->header.to > state || !continues(state)) return records;
    records = framesFrom(from->header.to, frames_.size());
    records.insert(records.begin(), from);
    return records;
}

SharedRecord MirrorHistory::frameFrom(std::uint64_t state) const {
    const std::size_t index = indexOf(state);
    return index < frames_.size() ? frames_[index] : nullptr;
}

std::uint64_t MirrorHistory::bytesFrom(std::uint64_t state) const {
    const std::size_t index = indexOf(state);
    return index < frames_.size() ? total_ - ends_[index] + frames_[index]->bytes.size() : 0;
}

std::vector<SharedRecord> MirrorHistory::framesFrom(std::uint64_t state, std::size_t maximum) const {
    const auto first = frames_.begin() + static_cast<std::ptrdiff_t>(indexOf(state));
    return {first, first + static_cast<std::ptrdiff_t>(
                               std::min<std::size_t>(maximum, static_cast<std::size_t>(frames_.end() - first)))};
}

SharedRecord MirrorHistory::keyframe() const {
    return keyframe_ && continues(keyframe_->header.to) ? keyframe_ : nullptr;
}

void MirrorHistory::setKeyframe(SharedRecord record) {
    if (continues(record->header.to)) replaceKeyframe(std::move(record));
}

}  // namespace rtsg
