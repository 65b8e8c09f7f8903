// The side of a mirror server that talks to peers: one thread, one ROUTER socket, the history and every peer's place.
//
// Invariant: only this thread touches peers, histories and sockets, and it does nothing that takes long: what does is
// the shadow's. The scene's thread hands over records through the inbox; it waits only for peers that may hold it up.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <rtsg/sync/mirror_server.h>
#include <rtsg/sync/record_log.h>

#include "edits/upstream.h"
#include "history.h"
#include "plain_merges.h"
#include "shadow.h"
#include "sockets/gate.h"
#include "sockets/message.h"
#include "sockets/pace.h"
#include "sockets/zmq_socket.h"

namespace rtsg {

/// What both threads touch.
struct MirrorServer::Shared {
    struct Item {
        SharedRecord record;
        bool requested = false;   // a snapshot that the scene's thread was asked for
        bool restart = false;     // the scene has started over: nothing before counts
        bool earlier = false;     // of before this server
        std::uint64_t start = 0;  // how often the scene had started over since sendWhatIsLogged()
        bool snapshot = false;    // the log wants one of this state
    };
    /// What a peer asks a player for, or is answered.
    struct Control {
        std::string peer;
        std::uint64_t session = 0;
        std::string text;
    };
    MirrorServerOptions options;
    std::string endpoint;
    std::shared_ptr<RecordPool> pool = std::make_shared<RecordPool>();
    std::atomic<bool> wantSnapshot{false}, wantRunState{false}, stop{false};
    std::atomic<bool> wantAcknowledged{false};  // somebody waits for acknowledgements
    std::atomic<bool> wantPredicted{false};     // somebody takes predicted values
    std::atomic<std::uint64_t> coded{0};
    std::atomic<bool> wantForget{false};  // somebody has not got what predicted values refer to
    std::atomic<std::uint64_t> epoch{0};
    std::atomic<bool> originLost{false};         // of a relay
    std::atomic<std::uint64_t> originMissed{0};  // holes of a relay's
    int wake = -1;                               // eventfd, of the sockets' thread
    int call = -1;                               // of the scene's: there is something for service()

    std::mutex mutex;  // guards the rest
    std::condition_variable caughtUp;
    bool heldUp = false;  // a peer that may hold the scene up is behind
    std::vector<Item> inbox;
    std::chrono::milliseconds longestWaitForLog{0};  // 0: nothing waits
    std::uint64_t loggedStart = 0, loggedState = 0;  // what is in the log
    std::vector<mirror::Submission> submissions;
    std::vector<std::uint64_t> left;  // clients that sent some, and are gone
    std::uint64_t submittedBytes = 0;
    std::vector<mirror::Verdict> verdicts;
    std::vector<Control> controls, replies;
    MirrorServerStatistics statistics;
    std::vector<Diagnostic> diagnostics;
    char failure[160] = {};  // what a thread threw: nobody is served any more; there may be no memory for a string

    ~Shared();
    Result<> result();
    void post(Item item);
    std::shared_ptr<RecordLog> log;
    void awaken() const;
    void callScene() const;
    void answer(mirror::Verdict verdict);
    void report(Severity severity, std::string text);
};

class MirrorServer::Io {
  public:
    explicit Io(std::shared_ptr<Shared> shared);
    ~Io();
    /// Binds; on success `shared->endpoint` is the real one and the thread runs.
    Result<> start(const std::string& endpoint);

  private:
    using Clock = std::chrono::steady_clock;

    struct Peer {
        std::string identity, name, author;
        std::uint64_t session = 0, window = 0;
        MirrorPace pace;
        std::uint64_t sentBytes = 0, ackedBytes = 0, ackedState = 0;
        std::uint64_t awaitedBytes = 0;  // of these sent, those whose acknowledgement was asked for
        Clock::time_point awaitedAt{};
        std::uint64_t debt = 0;  // bytes sent before its last hello that it may not have read yet
        bool placed = false;     // `state` means something
        /// What it says it has of a part that is being opened.
        struct Claim {
            std::uint64_t state = 0;
            Hash128 hash;
        };
        std::optional<Claim> claim;
        bool remembers = false;   // all frames since the last one with kForget, predicted
        std::uint64_t state = 0;  // that it will be in once everything sent has arrived
        SharedRecord sending;     // partly sent
        bool inputs = false;      // wants those
        bool running = false;     // has what it takes to go on with inputs
        SharedRecord then;        // to be sent next, before anything else
        std::size_t sent = 0;     // bytes of it
        Clock::time_point heard, spoken, waitingSince{};
        MirrorWhenSlow whenSlow = MirrorWhenSlow::coalesce;
        Clock::duration interval{};  // least time between frames
        Clock::time_point due{};
        Clock::time_point behindSince{};
        std::uint64_t client = 0;  // its name across connections
        std::uint32_t part = 0;    // which stream it follows
        MirrorUpstream upstream = MirrorUpstream::none;
        bool sameTypes = false;  // as here
        bool noTypes = false;    // takes ours as they are described
        // A question to the shadow: nothing is sent until there is an answer, then frames up to the state it is about.
        bool asking = false;
        std::uint64_t held = 0;  // not 0: it lacks some of what leads to this state, the one after `state`
        std::optional<MirrorShadow::Answer> answer;
        std::optional<MirrorShadow::Answer> after;  // its turn comes when frames up to its state, merged, are there
        double allowance = 0;                       // questions it may ask
        Clock::time_point allowed{};
        mirror::Assembly submission;
        std::deque<mirror::Verdict> verdicts;  // of requests whose frames have not been sent yet
    };
    using Peers = std::map<std::string, Peer, std::less<>>;
    /// What peers follow: the scene, or a part of it.
    struct Stream {
        explicit Stream(std::uint64_t limit) : history(limit) {}
        MirrorHistory history;
        bool keyframeAsked = false;
        mirror::Wishes wishes;
        std::uint64_t epochMix = 0;  // states of a part have the same numbers as others: its epoch tells them apart
        Clock::time_point used{};
    };

    void run();
    /// Where something may have come.
    struct Came {
        bool messages = false, connections = false, knocks = false;
    };
    Came wait();
    void gather();
    void turn();
    void giveUp(const char* why);
    void sayGoodbye();
    void sendLastFrames();
    bool hasBeenSentAll(const Peer& peer) const;
    void takeInbox();
    void arrive(Shared::Item item);
    bool waitsForLog(const Shared::Item& item) const;
    void release(Shared::Item item);
    void takeAnswers();
    bool isEarly(const MirrorShadow::Answer& answer) const;
    void takeAnswer(MirrorShadow::Answer answer);
    /// False when messages are left: a peer that floods us shall leave time for the others.
    bool receive();
    void handle(const std::string& identity, std::span<const std::byte> bytes, const ZmqMessage& body,
                const std::string& user);
    void handleOf(Peer& peer, mirror::Message type, wire::Reader& in, std::span<const std::byte> bytes,
                  const ZmqMessage& body);
    void hello(const std::string& identity, const mirror::Hello& hello, const std::string& user);
    void noteHeard(const std::string& identity);
    std::string authorOf(const mirror::Hello& hello, const std::string& user) const;
    void question(Peer& peer, std::span<const std::byte> bytes);
    void submission(Peer& peer, wire::Reader& in, const ZmqMessage& body);
    void control(Peer& peer, wire::Reader& in);
    void reply(const Shared::Control& control);
    void restart();
    void tick(Clock::time_point now);
    void noticeWhoLeft();
    /// How long the thread may sleep.
    std::chrono::milliseconds patience();
    std::chrono::milliseconds untilTick(Clock::time_point now) const;
    /// How old statistics may be.
    Clock::duration settling() const;
    /// When something is to be done for the peer though nothing comes from it nor for it.
    Clock::time_point dueFor(const Peer& peer, Clock::time_point now) const;
    /// Sends what may be sent: to everybody, or to those who have been heard in this turn.
    void pumpAll(Clock::time_point now);
    void pumpHeard(Clock::time_point now);
    void callForSnapshot();
    void askForKeyframe(std::uint32_t part);
    void keepKeyframeNear(std::uint32_t part);
    /// The number of the stream with the parts and aspects of this hello; nothing when there are as many as there may
    /// be.
    std::optional<std::uint32_t> streamFor(const mirror::Hello& hello);
    /// Has it go on from the state that it says it has, if frames lead on from there.
    void place(Peer& peer);
    void dropStream(std::uint32_t part);
    bool dropUnusedPart();
    void refuseRegions(std::string why);
    /// `forGood`: whatever changes here, the peer will be told the same again.
    void refuse(const std::string& identity, const std::string& reason, bool forGood = false);
    Stream& streamOf(const Peer& peer) { return streams_.find(peer.part)->second; }
    const MirrorHistory& historyOf(const Peer& peer) const { return streams_.find(peer.part)->second.history; }
    bool behind(const Peer& peer) const;
    bool late(const Peer& peer) const;
    bool mayPass(Peer& peer);
    /// False when the peer is gone.
    bool pump(Peer& peer);
    bool deliverAnswer(Peer& peer);
    bool deliverVerdicts(Peer& peer);
    SharedRecord nextFor(Peer& peer);
    /// The record as this peer gets it: the changes, or what came into the frame.
    SharedRecord asFollowed(Peer& peer, SharedRecord next);
    SharedRecord keyframeFor(Peer& peer);
    SharedRecord frameFor(Peer& peer);
    /// Merged here if that is easy; else null, and the shadow is asked.
    SharedRecord mergeNow(Peer& peer, std::vector<SharedRecord> frames);
    void merge(Peer& peer, std::vector<SharedRecord> frames, bool all = false);
    void mergeHeld(Peer& peer);
    SharedRecord frameTowards(Peer& peer, std::uint64_t state);
    SharedRecord codedFor(Peer& peer, SharedRecord record);
    bool sendChunk(Peer& peer);
    bool mayWait(const Peer& peer, std::uint64_t size, Clock::time_point now) const;
    bool askForAcknowledgement(Peer& peer);
    void askAllForAcknowledgements();
    bool sendTo(const std::string& identity, const ByteBuffer& head, ZmqMessage* body = nullptr);
    /// A message of a part of a record, the same for all peers that get it; if the part is no whole record, for one.
    const ZmqMessage& bodyOf(const SharedRecord& record, std::span<const std::byte> part);
    /// With its state and the scene's. False when the peer is gone.
    bool ping(const Peer& peer);
    void garbage(std::string text);
    void warn(std::uint64_t by, std::string text);
    void publishStatistics();

    std::shared_ptr<Shared> shared_;
    ZmqContext context_;
    ZmqSocket router_;
    MirrorGate gate_;
    std::map<std::uint32_t, Stream> streams_;  // 0 is the whole scene
    MirrorHistory& history_;                   // of that
    std::uint32_t nextPart_ = 1;
    MirrorShadow shadow_;
    std::deque<Shared::Item> held_;  // frames that the shadow has, and peers may not have yet
    struct Logged {
        std::uint64_t start = 0, state = 0;
        std::chrono::milliseconds longestWait{0};
    } logged_;                                // as the log said last
    std::deque<MirrorShadow::Answer> early_;  // of states that peers may not have yet
    std::uint64_t era_ = 0;                   // restarts that were released
    PlainMerges merges_;
    mirror::RequestLedger ledger_;
    std::set<std::uint64_t> submitters_;  // clients that are here and sent requests
    Peers peers_;
    bool toldLost_ = false;           // what peers have been told of the origin
    bool leaving_ = false;            // only what peers have read, and their answers to goodbyes, count
    bool news_ = true;                // for everybody: frames, answers, verdicts
    std::vector<std::string> heard_;  // peers, in this turn
    Clock::time_point allDue_{}, ticked_{}, settled_{}, turned_{}, newsAt_{};
    bool isBusy_ = false;     // frames come one upon the other
    bool unsettled_ = false;  // something has happened since the statistics were published
    bool heldUp_ = false;     // as published
    MirrorServerStatistics statistics_;
    std::uint64_t crowded_ = 0, strangers_ = 0;  // refused for want of room, or of a key
    ByteBuffer message_, head_;
    std::size_t wantedNext_ = 0;  // bytes: a frame came in such a buffer, and others will
    std::optional<ZmqMessage> body_;
    SharedRecord bodyRecord_;  // which `body_` is all of
    std::uint64_t dictionaryHash_ = 0;
    Clock::time_point forgetAsked_{};
    std::string noRegions_;             // why not, when that was tried last
    Clock::time_point regionsAgain_{};  // not tried again before
    std::thread thread_;
};

}  // namespace rtsg
