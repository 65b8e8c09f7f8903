// RecordChain: checks parts of records as they arrive, and tells which of them continue the present state.
//
// Invariant: a record is passed on whole or not at all, unless its last parts are lost; then there is a gap.
// Threading: one thread.
#pragma once

#include <cstdint>
#include <span>

#include <rtsg/sync/record.h>

namespace rtsg::nats {

class RecordChain {
  public:
    enum class Step : std::uint8_t {
        pass,    // it belongs to a record that leads on
        old,     // its record leads to no later state
        gap,     // something before it is missing
        repair,  // it leads from a state to itself
        rubbish,
    };
    /// `joining` lets a keyframe begin anew.
    Step add(std::uint64_t size, std::uint64_t offset, std::span<const std::byte> part, bool joining);

    /// The state of which all records have passed, with its hash; 0: none.
    std::uint64_t state() const { return state_; }
    const Hash128& hash() const { return hash_; }
    void set(std::uint64_t state, const Hash128& hash) {
        state_ = state;
        hash_ = hash;
        next_ = 0;
    }
    /// True between two parts of a record.
    bool within() const { return next_ > 0; }

  private:
    Step begin(std::uint64_t size, std::span<const std::byte> part, bool joining);

    std::uint64_t state_ = 0, next_ = 0, size_ = 0;
    Hash128 hash_;
    RecordHeader header_;
    Step step_ = Step::old;
};

}  // namespace rtsg::nats
