// What a mirror server keeps to send: the last keyframe and the frames since, encoded, shared with the sockets.
//
// Invariant: frames are contiguous (each starts where the one before ends) and end at the newest state. The memory of
// frames, in all their codings and with what a record costs beside its bytes, exceeds the limit by at most one frame.
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <vector>

#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/encoded_record.h>

namespace rtsg {

/// Buffers of frames go back to where they came from once nobody sends them any more; so many bytes of them at most
/// wait to be used again. Those of keyframes go: the next frame would drag a snapshot's memory along.
class RecordPool : public std::enable_shared_from_this<RecordPool> {
  public:
    RecordPool();
    std::shared_ptr<EncodedRecord> take();
    /// Sees to it that the next records so long find memory that the system has given out: that takes longer than
    /// filling it, and whoever takes one is the scene's thread. Called by another. Short ones do without.
    void keepReady(std::size_t bytes);

  private:
    void giveBack(std::unique_ptr<EncodedRecord> record);
    std::mutex mutex_;
    std::vector<std::unique_ptr<EncodedRecord>> free_;
    std::size_t freeBytes_ = 0;  // their capacities
};

class MirrorHistory {
  public:
    explicit MirrorHistory(std::uint64_t limit) : limit_(limit) {}

    /// False when the record does not continue what is here: the scene has started over.
    bool add(SharedRecord record);
    /// A frame that led to the first state that add() will be given, in order.
    void addEarlier(SharedRecord record);
    /// The first keyframe is kept beside later ones for as long as frames lead on from it: those who come back to a
    /// session that has gone on are in its state or in one soon after.
    void keepFirst() { keepsFirst_ = true; }
    /// A keyframe that was made later, of a state within the frames that are here. Others are ignored.
    void setKeyframe(SharedRecord record);
    void clear();

    bool empty() const { return !started_; }
    std::uint64_t newest() const { return newest_; }
    /// A peer in this state can go on with frames alone.
    bool continues(std::uint64_t state) const;
    /// And it is the same state: one with this hash, where both are known (0: not known). A server that has gone on
    /// from a log may have lost the end of what its peers have got.
    bool continues(std::uint64_t state, const Hash128& hash) const;
    /// The frame that starts at `state`; null if there is none.
    SharedRecord frameFrom(std::uint64_t state) const;
    /// All frames from `state` on, at most `most`.
    std::vector<SharedRecord> framesFrom(std::uint64_t state, std::size_t most) const;
    /// The last keyframe of a state not after `state`, and all frames since, if `state` is among theirs; else nothing.
    std::vector<SharedRecord> allSince(std::uint64_t state) const;
    /// Bytes of all frames from `state` on.
    std::uint64_t bytesFrom(std::uint64_t state) const;
    /// The last keyframe; null when frames do not lead on from it any more.
    SharedRecord keyframe() const;
    std::uint64_t limit() const { return limit_; }
    /// What the frames hold, bytes.
    std::uint64_t memory() const { return memory_; }

  private:
    std::size_t indexOf(std::uint64_t state) const;
    void replaceKeyframe(SharedRecord record);

    std::uint64_t limit_, memory_ = 0, newest_ = 0;
    SharedRecord keyframe_, first_;  // the latter where keepFirst(), once there is a later one
    std::deque<SharedRecord> frames_;
    std::deque<std::uint64_t> ends_;  // running total of bytes up to and including each frame
    std::uint64_t total_ = 0;
    bool started_ = false, keepsFirst_ = false;
};

}  // namespace rtsg
