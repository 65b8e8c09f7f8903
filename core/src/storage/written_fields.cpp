// Gives out chunks of entries, and keeps them for the next frame.
#include "written_fields.h"

#include <algorithm>
#include <new>

namespace rtsg {

void WrittenFields::grow() {
    const std::size_t room = std::max<std::size_t>(4, 2 * room_);
    auto table = std::make_unique<Memory*[]>(room);
    for (std::size_t i = 0; i < chunks_.size(); ++i) table[i] = chunks_[i].get();
    table_.store(table.get(), std::memory_order_release);
    tables_.push_back(std::move(table));
    room_ = room;
}

std::size_t WrittenFields::findFree(std::uint32_t lane) {
    const std::size_t count = chunks_.size();
    if (lane >= looked_.size()) looked_.resize(lane + 1);
    for (std::size_t& i = looked_[lane]; i < count; ++i)
        if (!chunks_[i]->isTaken && (lane == 0 || chunks_[i]->lane == lane)) return i;
    constexpr std::size_t kSpare = 16;
    if (lane == 0 || count < 2 * std::size_t{taken_} + kSpare) return count;
    // There are enough, and others have left theirs.
    std::size_t free = 0;
    while (free < count && chunks_[free]->isTaken) ++free;
    return free;
}

WrittenFields::Chunk WrittenFields::takeChunk(std::uint32_t lane) {
    const std::lock_guard lock(mutex_);
    const std::size_t index = findFree(lane);
    if (index == chunks_.size()) {
        void* bytes = std::aligned_alloc(alignof(Memory), sizeof(Memory) + kChunk * sizeof(WrittenField));
        if (!bytes) throw std::bad_alloc();
        chunks_.emplace_back(new (bytes) Memory);
        if (chunks_.size() > room_)
            grow();
        else
            table_.load(std::memory_order_relaxed)[index] = chunks_.back().get();
    }
    Memory& chunk = *chunks_[index];
    chunk.used = 0;
    chunk.lane = lane;
    chunk.isTaken = true;
    ++taken_;
    return {chunk.entries(), static_cast<std::uint32_t>(index) * kChunk};
}

void WrittenFields::append(Piece piece, std::uint32_t slot) {
    if (piece.count == 0) return;
    Memory& chunk = *chunks_[slot / kChunk];
    chunk.used = static_cast<std::uint32_t>(piece.begin - chunk.entries()) + piece.count;
    pieces_.push_back(piece);
    size_ += piece.count;
}

void WrittenFields::clear() {
    // The memory of one large frame, such as loading, is not kept for the small ones that follow.
    constexpr std::uint32_t kAlways = 16;
    if (chunks_.size() > std::max(kAlways, 8 * taken_)) chunks_.resize(std::max(kAlways, taken_));
    if (tables_.size() > 1) tables_.erase(tables_.begin(), tables_.end() - 1);
    for (const auto& chunk : chunks_) {
        chunk->used = 0;
        chunk->isTaken = false;
    }
    taken_ = 0;
    looked_.clear();
    pieces_.clear();
    size_ = 0;
}

}  // namespace rtsg
