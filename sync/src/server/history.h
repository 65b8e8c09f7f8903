// MirrorHistory: the records a mirror server may send: the last keyframe and the frames since, encoded and shared with
// the sockets.
//
// Invariant: each frame starts where the one before ends, and the last one ends at the newest state. The memory of the
// frames, in all codings and with the overhead of records, exceeds the limit by at most one frame.
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <vector>

#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/encoded_record.h>

namespace rtsg {

/// Takes back buffers of frames that nobody sends any more, up to a number of bytes. Buffers of keyframes are freed,
/// because the next frame would keep a snapshot's memory.
class RecordPool : public std::enable_shared_from_this<RecordPool> {
  public:
    RecordPool();
    std::shared_ptr<EncodedRecord> take();
    /// Makes sure that the next records of this length find memory whose pages are allocated. That takes longer than
    /// filling them and must not cost the scene's thread, so another thread calls this. Short records do not need it.
    void keepReady(std::size_t bytes);

  private:
    void giveBack(std::unique_ptr<EncodedRecord> record);
    std::mutex mutex_;
    std::vector<std::unique_ptr<EncodedRecord>> free_;
    std::size_t freeBytes_ = 0;  // capacities of the free buffers
};

class MirrorHistory {
  public:
    explicit MirrorHistory(std::uint64_t limit) : limit_(limit) {}

    /// Returns false if the record does not continue what is here, so the scene has started over.
    bool add(SharedRecord record);
    /// Adds a frame from before the first record that add() will get. Call it in order.
    void addEarlier(SharedRecord record);
    /// Keeps the first keyframe beside later ones while frames lead on from it. Peers that come back to a resumed
    /// session are in its state or one soon after.
    void keepFirst() { keepsFirst_ = true; }
    /// Sets a keyframe that was made later. Ignored unless its state is within the frames that are here.
    void setKeyframe(SharedRecord record);
    void clear();

    bool empty() const { return !started_; }
    std::uint64_t newest() const { return newest_; }
    /// True if a peer in this state can go on with frames alone.
    bool continues(std::uint64_t state) const;
    /// The same for a state with this hash, if both hashes are known (0: unknown). A server that resumed from a log may
    /// have lost the last states that its peers have.
    bool continues(std::uint64_t state, const Hash128& hash) const;
    /// The frame that starts at `state`; null if there is none.
    SharedRecord frameFrom(std::uint64_t state) const;
    /// All frames from `state` on, but at most `most`.
    std::vector<SharedRecord> framesFrom(std::uint64_t state, std::size_t maximum) const;
    /// The last keyframe whose state is not after `state`, and all frames since. Empty if these do not contain `state`.
    std::vector<SharedRecord> allSince(std::uint64_t state) const;
    /// Bytes of all frames from `state` on.
    std::uint64_t bytesFrom(std::uint64_t state) const;
    /// The last keyframe. Null if frames no longer lead on from it.
    SharedRecord keyframe() const;
    std::uint64_t limit() const { return limit_; }
    /// Bytes that the frames hold.
    std::uint64_t memory() const { return memory_; }

  private:
    std::size_t indexOf(std::uint64_t state) const;
    void replaceKeyframe(SharedRecord record);

    std::uint64_t limit_, memory_ = 0, newest_ = 0;
    SharedRecord keyframe_, first_;  // first_ is set after keepFirst(), once there is a later keyframe
    std::deque<SharedRecord> frames_;
    std::deque<std::uint64_t> ends_;  // total of bytes up to and including each frame
    std::uint64_t total_ = 0;
    bool started_ = false, keepsFirst_ = false;
};

}  // namespace rtsg
