// MirrorShadow: the mirror server's own replica, on its own thread. It makes keyframes for late joiners, hashes for
// peers in doubt, repairs, and merged frames for slow peers, so that the threads of the scene and the sockets never
// stall.
//
// Invariant: the replica is in a published state, and answers a question in a state not before the last record posted
// before it. It costs the memory of one more scene, and of another while a part is opened from an earlier state. It
// follows in batches. Waiting records are bounded by `limit` bytes; beyond that the replica is given up until a
// keyframe comes.
// Threading: post, ask and takeAnswers from one thread; the work on another, or in step(). `wake` is raised
// for answers.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/core/descriptor.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/worker.h>
#include <rtsg/sync/change_codec.h>

#include "history.h"
#include "near_first.h"
#include "parts/part.h"
#include "sockets/message.h"
#include "transport/clock.h"

namespace rtsg {

class MirrorShadow {
  public:
    struct Question {
        /// keyframe: make one. merge: merge frames. peers: a peer's message. open, close: begin or end to follow a
        /// part. frame: a part's frame (an answer without a question; without a record the part cannot be followed any
        /// more).
        enum class Kind : std::uint8_t { keyframe, merge, peers, open, close, frame };
        Kind kind = Kind::keyframe;
        std::uint32_t part = 0;       // number of the part; 0: the whole scene
        mirror::Wishes wishes;        // of the part to open
        std::string peer;             // the peer that asks; empty for keyframes
        std::uint64_t session = 0;    // of the peer
        std::vector<std::byte> text;  // a peer's whole message
        /// For merge: the frames. For open: an earlier keyframe and all frames since, if the part shall begin there.
        std::vector<SharedRecord> frames;
        /// For merge. nearFirst: what is near goes first (near_first.h), about `budget` bytes. held: values wait for
        /// the peer already. all: nothing may wait any more.
        bool nearFirst = false, held = false, all = false;
        std::uint64_t budget = 0;
    };
    /// Has a message or a record, or neither if there is no answer.
    struct Answer {
        Question::Kind kind = Question::Kind::keyframe;
        std::uint32_t part = 0;
        std::string peer;
        std::uint64_t session = 0, state = 0;
        SharedRecord record;
        std::shared_ptr<ByteBuffer> message;
        std::string why;        // for a part's frame without a record: what its peers are told
        bool holds = false;     // some values wait; with all of them the scene is in `state`
        std::uint64_t era = 0;  // number of restart() calls before it
    };

    /// `places` is the most places of shapes; with more, regions are not followed.
    MirrorShadow(const Clock& clock, std::shared_ptr<RecordPool> pool, const Wakeup& wake, std::uint64_t limit,
                 std::size_t index = std::size_t{1} << 22);

    /// Sets who takes the snapshots that post() asks for. Called on the shadow's thread, or on the one that gives the
    /// replica up.
    using TakeSnapshot = std::function<void(std::uint64_t state, std::shared_ptr<const ChangeSet>)>;
    void onSnapshot(TakeSnapshot take);
    /// Returns false if too much waits: the replica was given up, and questions wait for a keyframe. With `snapshot` a
    /// snapshot of this state is wanted soon; null is handed over if there will be none.
    bool post(SharedRecord record, bool snapshot = false);
    void ask(Question question);
    std::vector<Answer> takeAnswers();
    /// Forgets questions and answers, because their states have no meaning any more.
    void restart();
    /// Throws if the thread has ended with an exception, so that nothing is answered any more.
    void checkAlive();
    /// With a clock that is stepped there is no thread, and this does all that waits. Returns false if nothing did.
    bool step();

  private:
    void run();
    void follow();
    void work(std::unique_lock<std::mutex>& lock);
    bool isWorthWaking() const;
    void dropWaiting();
    bool skip(const EncodedRecord& record, const EncodedRecord* next);
    bool follow(Scene& scene, const SharedRecord& record);
    void handOver(const Scene& scene, std::uint64_t state, bool good);
    void followParts(const Scene& scene, const ChangeSet* set, std::uint64_t published);
    void openPart(const Scene& scene, const Question& question);
    bool openEarlier(const Scene& scene, const Question& question);
    void findSpatialIndex(const Scene& scene, const ChangeSet* set);
    Answer frameOf(MirrorPart& part, const Scene& scene, const ChangeSet* set, const SpatialIndex* index,
                   std::uint64_t published);
    void reply(Answer answer);
    Answer answer(const Scene& whole, const Question& question);
    SharedRecord keyframe(const Scene& scene);
    SharedRecord merge(const Scene& scene, std::uint32_t part, const std::vector<SharedRecord>& frames);
    void keepMerged(std::uint32_t part, SharedRecord record);
    void mergeNearFirst(const Scene& scene, const Question& question, Answer& result);
    std::shared_ptr<EncodedRecord> encode(const ChangeSet& set);

    const Clock& clock_;
    const std::shared_ptr<RecordPool> pool_;
    const Wakeup& wake_;
    const std::uint64_t limit_;
    const std::size_t maximumIndexed_;

    std::mutex mutex_;  // guards what follows
    std::condition_variable some_;
    struct Waiting {
        SharedRecord record;
        bool snapshot = false;
    };
    std::deque<Waiting> waiting_;
    std::uint64_t waitingBytes_ = 0;
    bool hurries_ = false;  // a snapshot of a waiting record is wanted
    TakeSnapshot takeSnapshot_;
    std::deque<Question> questions_;
    std::vector<Answer> answers_;
    bool eager_ = false;      // a part is followed, and its peers wait for every frame
    bool lost_ = true;        // only a keyframe helps
    char failure_[160] = {};  // the thread's exception; there may be no memory for a string
    std::uint64_t era_ = 0;   // answers from before a restart are dropped

    std::unique_ptr<Scene> scene_;  // from here on for the thread only
    ChangeDecoder decoder_;
    ChangeEncoder encoder_;
    std::shared_ptr<ChangeSet> set_;
    std::optional<std::uint64_t> handingOver_;  // the state whose snapshot is being made for a log
    std::optional<std::uint64_t> skippedFrom_;  // the first state of the skipped frames
    /// Frames merged recently, newest first. State numbers of a part are those of the whole scene.
    struct Merged {
        std::uint32_t part = 0;
        SharedRecord record;
    };
    std::deque<Merged> merged_;
    std::map<std::uint32_t, MirrorPart> parts_;
    std::unique_ptr<SpatialIndex> index_;  // exists while regions are followed
    double cells_ = 0;                     // the radius for which they were made
    /// A peer that got merged frames recently.
    struct Eased {
        std::unique_ptr<NearFirst> scene;
        std::uint64_t session = 0;
        Clock::time_point used, again;  // again: no new one is made before that
    };
    std::map<std::string, Eased> eased_;
    std::uint64_t eraHere_ = 0;
    Worker worker_{"rtsg shadow"};  // last: its job uses the others
};

}  // namespace rtsg
