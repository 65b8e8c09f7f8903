// What a client has received and not applied yet: everything in the order in which it came, frames held until their
// time.
//
// Invariant: an item never overtakes another. Threading: the replica's thread.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/sync/change_codec.h>

namespace rtsg {

/// Between two values of one type: linear, rotations along the shorter arc; other types jump at the end.
Value interpolate(const Value& from, const Value& to, double fraction);

class MirrorPlayout {
  public:
    struct Item {
        std::vector<std::byte> bytes;  // a record, or a message with its prologue
        bool isRecord = true;
        std::uint64_t due = 0;        // ns on our clock; 0: as soon as it is the first
        std::uint64_t published = 0;  // on the server's
    };
    void push(Item item);
    bool empty() const { return items_.empty(); }
    std::uint64_t bytes() const { return bytes_; }
    const Item& front() const { return items_.front(); }
    Item pop();
    void clear();

    /// The value that the first frame in store gives the field, and that frame; nothing if it does not touch it.
    const Value* next(ChangeDecoder& decoder, NodeId node, FieldIndex field) const;

  private:
    std::deque<Item> items_;
    std::uint64_t bytes_ = 0;
    mutable bool peeked_ = false;
    mutable ChangeSet peek_;
    mutable std::unordered_map<std::uint64_t, std::size_t> index_;
};

}  // namespace rtsg
