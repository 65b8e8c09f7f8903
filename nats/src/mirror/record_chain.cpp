// Decides by the headers of records whether they continue the stream.
#include "record_chain.h"

namespace rtsg::nats {

RecordChain::Step RecordChain::begin(std::uint64_t size, std::span<const std::byte> part, bool joining) {
    const auto header = parseRecordHeader(part, 0, kMaxPayload);
    if (!header || header->size() != size) return Step::rubbish;
    if (header->kind != RecordKind::frame && header->kind != RecordKind::keyframe) return Step::rubbish;
    header_ = *header;
    size_ = size;
    if (header->from == header->to) return Step::repair;
    if (header->from == 0) return joining ? Step::pass : Step::old;
    if (header->from == state_) return Step::pass;
    return header->to <= state_ ? Step::old : Step::gap;
}

RecordChain::Step RecordChain::add(std::uint64_t size, std::uint64_t offset, std::span<const std::byte> part,
                                   bool joining) {
    if (part.empty() || part.size() > size || offset > size - part.size()) return Step::rubbish;
    if (offset == 0) {
        // An earlier record is incomplete; its reader notices that by this one's offset.
        next_ = 0;
        const Step step = begin(size, part, joining);
        if (step == Step::rubbish) return step;
        step_ = step;
    } else if (next_ == 0 || offset != next_ || size != size_) {
        next_ = 0;
        return Step::gap;
    }
    next_ = offset + part.size();
    if (next_ < size) return step_;
    next_ = 0;
    if (step_ == Step::pass) {
        state_ = header_.to;
        hash_ = header_.hash;
    }
    return step_;
}

}  // namespace rtsg::nats
