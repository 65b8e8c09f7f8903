// Merges frames that change the same fields: the last frame, with the start of the first.
#include "plain_merges.h"

#include <algorithm>
#include <utility>

#include "superseded.h"

namespace rtsg {

namespace {

constexpr std::uint64_t kMaxBytes = std::uint64_t{2}
                                    << 20;  // of the frames; comparing these takes some tenths of a millisecond
constexpr std::size_t kKept = 16;

bool isPlainFrame(const RecordHeader& header) {
    return header.kind == RecordKind::frame && header.from != header.to && header.flags == 0;
}

}  // namespace

SharedRecord PlainMerges::merge(std::uint32_t part, std::span<const SharedRecord> frames) {
    if (frames.empty()) return nullptr;
    const std::uint64_t from = frames.front()->header.from;
    const RecordHeader& last = frames.back()->header;
    for (const Created& known : created_)
        if (known.part == part && known.from == from && known.to == last.to && known.hash == last.hash)
            return known.record;
    created_.push_front({part, from, last.to, last.hash, make(frames)});
    if (created_.size() > kKept) created_.pop_back();
    return created_.front().record;
}

SharedRecord PlainMerges::make(std::span<const SharedRecord> frames) const {
    std::uint64_t bytes = 0;
    for (const SharedRecord& frame : frames) {
        bytes += frame->bytes.size();
        if (!isPlainFrame(frame->header) || bytes > kMaxBytes) return nullptr;
    }
    for (std::size_t i = 1; i < frames.size(); ++i)
        if (!mirror::isSuperseded(frames[i - 1]->bytes.bytes(), frames[i]->bytes.bytes())) return nullptr;
    const std::shared_ptr<EncodedRecord> merged = pool_->take();
    merged->header = frames.back()->header;
    merged->header.from = frames.front()->header.from;
    merged->published = frames.back()->published;
    merged->bytes.clear();
    merged->bytes.append(frames.back()->bytes.bytes());
    sealRecord(merged->bytes, merged->header);
    finishRecord(*merged);
    return merged;
}

}  // namespace rtsg
