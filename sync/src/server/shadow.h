// The mirror server's own replica, on a thread of its own. Late joiners' keyframes, hashes for those who doubt, repairs
// and merged frames for stragglers are made from it, so that neither the scene's thread nor the sockets' ever stalls.
//
// Invariant: the replica is in a state that was published; a question is answered in a state not before the last record
// posted before it. It costs the memory of one more scene, and of another one for as long as a part is opened from an
// earlier state. It follows lazily, in batches; records that wait are bounded by `limit` bytes, beyond which the
// replica is given up until a keyframe comes.
// Threading: post, ask and takeAnswers from one thread; the work on another; `wake` (an eventfd) is written for
// answers.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/sync/change_codec.h>

#include "history.h"
#include "near_first.h"
#include "parts/part.h"
#include "sockets/message.h"

namespace rtsg {

class MirrorShadow {
  public:
    struct Question {
        /// A keyframe; frames merged; what a peer asks; a part to be followed from now on, or no more; a part's frame
        /// (answers only, without a question; no record: the part cannot be followed any more).
        enum class Kind : std::uint8_t { keyframe, merge, peers, open, close, frame };
        Kind kind = Kind::keyframe;
        std::uint32_t part = 0;       // of which part of the scene; 0: all of it
        mirror::Wishes wishes;        // to open one
        std::string peer;             // whose; empty for keyframes
        std::uint64_t session = 0;    // of the peer
        std::vector<std::byte> text;  // of a peer: its message, whole
        /// To merge; of a part to open, an earlier keyframe and all frames since, if it shall begin there.
        std::vector<SharedRecord> frames;
        /// Of a merge: what is near goes first (near_first.h), about so many bytes; `held`: something waits at the peer
        /// already; `all`: nothing shall wait any more.
        bool nearFirst = false, held = false, all = false;
        std::uint64_t budget = 0;
    };
    /// Either a message or a record, or neither when there is no answer.
    struct Answer {
        Question::Kind kind = Question::Kind::keyframe;
        std::uint32_t part = 0;
        std::string peer;
        std::uint64_t session = 0, state = 0;
        SharedRecord record;
        std::shared_ptr<ByteBuffer> message;
        std::string why;        // of a part's frame without a record: what its peers are told
        bool holds = false;     // some of what was merged waits; `state` is the one it leads to when nothing does
        std::uint64_t era = 0;  // how often restart() had been called
    };

    /// `places`: of shapes, beyond which parts by region are not followed.
    MirrorShadow(std::shared_ptr<RecordPool> pool, int wake, std::uint64_t limit,
                 std::size_t places = std::size_t{1} << 22);
    ~MirrorShadow();

    /// Takes the snapshots that post() was asked for, on the shadow's thread or that of the call which gives them up.
    using TakeSnapshot = std::function<void(std::uint64_t state, std::shared_ptr<const ChangeSet>)>;
    void onSnapshot(TakeSnapshot take);
    /// False when too much waits: the replica has been given up, and questions wait for a keyframe. `snapshot`: of this
    /// state one is wanted, soon; null is handed over if there will be none.
    bool post(SharedRecord record, bool snapshot = false);
    void ask(Question question);
    std::vector<Answer> takeAnswers();
    /// Forgets questions and answers: their states mean nothing any more.
    void restart();
    /// Throws if the thread has ended on an exception: nothing is answered any more.
    void checkAlive();

  private:
    void run();
    void follow();
    bool isWorthWaking() const;
    void dropWaiting();
    bool skip(const EncodedRecord& record, const EncodedRecord* next);
    bool follow(Scene& scene, const SharedRecord& record);
    void handOver(const Scene& scene, std::uint64_t state, bool good);
    void followParts(const Scene& scene, const ChangeSet* set, std::uint64_t published);
    void openPart(const Scene& scene, const Question& question);
    bool openEarlier(const Scene& scene, const Question& question);
    void findPlaces(const Scene& scene, const ChangeSet* set);
    Answer frameOf(MirrorPart& part, const Scene& scene, const ChangeSet* set, const ShapePlaces* places,
                   std::uint64_t published);
    void reply(Answer answer);
    Answer answer(const Scene& whole, const Question& question);
    SharedRecord keyframe(const Scene& scene);
    SharedRecord merge(const Scene& scene, std::uint32_t part, const std::vector<SharedRecord>& frames);
    void keepMerged(std::uint32_t part, SharedRecord record);
    void mergeNearFirst(const Scene& scene, const Question& question, Answer& result);
    std::shared_ptr<EncodedRecord> encode(const ChangeSet& set);

    const std::shared_ptr<RecordPool> pool_;
    const int wake_;
    const std::uint64_t limit_;
    const std::size_t mostPlaces_;

    std::mutex mutex_;  // guards what follows
    std::condition_variable some_;
    struct Waiting {
        SharedRecord record;
        bool snapshot = false;
    };
    std::deque<Waiting> waiting_;
    std::uint64_t waitingBytes_ = 0;
    bool hurries_ = false;  // a snapshot is wanted of one of them
    TakeSnapshot takeSnapshot_;
    std::deque<Question> questions_;
    std::vector<Answer> answers_;
    bool eager_ = false;               // a part is followed: its peers wait for every frame
    bool stop_ = false, lost_ = true;  // lost: only a keyframe helps
    char failure_[160] = {};           // what the thread threw; there may be no memory for a string
    std::uint64_t era_ = 0;            // answers to questions of before a restart are dropped

    ChangeDecoder decoder_;  // the thread's own from here on
    ChangeEncoder encoder_;
    std::shared_ptr<ChangeSet> set_;
    std::optional<std::uint64_t> handingOver_;  // the state whose snapshot is being made: a log waits for it
    std::optional<std::uint64_t> skippedFrom_;  // where the frames that were skipped set out
    /// Made not long ago, the newest first; states of a part have the numbers of the whole scene's.
    struct Merged {
        std::uint32_t part = 0;
        SharedRecord record;
    };
    std::deque<Merged> merged_;
    std::map<std::uint32_t, MirrorPart> parts_;
    std::unique_ptr<ShapePlaces> places_;  // while there are parts by region
    double cells_ = 0;                     // the radius that they were made for
    /// Of a peer whose frames were merged not long ago.
    struct Eased {
        std::unique_ptr<NearFirst> scene;
        std::uint64_t session = 0;
        NearFirst::Clock::time_point used, again;  // again: not before that made anew
    };
    std::map<std::string, Eased> eased_;
    std::uint64_t eraHere_ = 0;
    std::thread thread_;
};

}  // namespace rtsg
