// MirrorServer::Io: the side of a mirror server that talks to peers. It has one thread, listeners, and all peers.
//
// Invariant: only this thread touches peers, histories and listeners. It does nothing that takes long; the shadow does
// that. The scene's thread hands over records through the inbox, and waits only for peers that may hold it up. With a
// clock that is stepped there is no thread: step() does what it would have done.
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
#include <vector>

#include <poll.h>

#include <rtsg/core/descriptor.h>
#include <rtsg/core/worker.h>
#include <rtsg/sync/mirror_server.h>
#include <rtsg/sync/record_log.h>

#include "edits/upstream.h"
#include "history.h"
#include "plain_merges.h"
#include "shadow.h"
#include "sockets/file_watch.h"
#include "sockets/message.h"
#include "sockets/pace.h"
#include "transport/transport.h"

namespace rtsg {

/// Data that both threads use.
struct MirrorServer::Shared {
    struct Item {
        SharedRecord record;
        bool requested = false;   // a snapshot that the scene's thread was asked for
        bool restart = false;     // the scene has started over, so nothing before counts
        bool earlier = false;     // from before this server was started
        std::uint64_t start = 0;  // how often the scene had started over since sendWhatIsLogged()
        bool snapshot = false;    // the log wants a snapshot of this state
    };
    /// A command for a player, or its reply.
    struct Control {
        std::string peer;
        std::uint64_t session = 0;
        std::string text;
    };
    MirrorServerOptions options;
    std::string endpoint;
    std::shared_ptr<RecordPool> pool = std::make_shared<RecordPool>();
    std::atomic<bool> wantSnapshot{false}, wantRunState{false};
    std::atomic<bool> wantAcknowledged{false};  // somebody waits for acknowledgements
    std::atomic<bool> wantPredicted{false};     // some peer takes predicted values
    std::atomic<std::uint64_t> coded{0};
    std::atomic<bool> wantForget{false};  // some peer lacks the values that predictions refer to
    std::atomic<std::uint64_t> epoch{0};
    std::atomic<bool> originLost{false};         // at a relay
    std::atomic<std::uint64_t> originMissed{0};  // times that a relay missed states
    Wakeup wake;                                 // of the sockets' thread
    Wakeup call;                                 // of the scene's thread: service() has something to do

    Clock& clock() const { return options.transport->clock(); }

    std::mutex mutex;  // guards the rest
    std::condition_variable caughtUp;
    bool heldUp = false;  // a peer that may hold up the scene is behind
    std::vector<Item> inbox;
    std::vector<std::unique_ptr<Listener>> listeners;  // more of them
    std::chrono::milliseconds longestWaitForLog{0};    // 0: frames do not wait for a log
    std::uint64_t loggedStart = 0, loggedState = 0;    // what is in the log
    std::vector<mirror::Submission> submissions;
    std::vector<std::uint64_t> left;  // clients that are gone and had sent requests
    std::uint64_t submittedBytes = 0;
    std::vector<mirror::Verdict> verdicts;
    std::vector<Control> controls, replies;
    MirrorServerStatistics statistics;
    std::vector<Diagnostic> diagnostics;
    char failure[160] = {};  // a thread's exception, after which nobody is served; there may be no memory for a string

    Result<> result();
    void post(Item item);
    std::shared_ptr<RecordLog> log;
    void awaken() const { wake.raise(); }
    void callScene() const { call.raise(); }
    void answer(mirror::Verdict verdict);
    void report(Severity severity, std::string text);
};

class MirrorServer::Io {
  public:
    explicit Io(std::shared_ptr<Shared> shared);
    ~Io();
    /// Binds and starts the thread. `shared->endpoint` is then the real address.
    Result<> start(const std::string& endpoint);
    /// With a clock that is stepped: takes what has come, and sends what is due.
    void step();

  private:
    /// Whoever asks something.
    struct Asker {
        std::string identity, author;
        std::string user;  // its public key; empty without keys
        std::uint64_t session = 0;
        std::uint64_t client = 0;  // its name in all its connections
        MirrorUpstream upstream = MirrorUpstream::none;
        bool sameTypes = false;  // its types are ours
        bool noTypes = false;    // it takes our types as they are described
        Clock::time_point heard;
        mirror::Assembly submission;
    };
    /// A verdict, and whom it is for.
    struct Judged {
        std::string to;
        std::uint64_t session = 0;
        mirror::Verdict verdict;
    };
    /// Peers of one listener that broadcasts. They read the same records, as if they were one peer, which asks one
    /// question at a time for all of them.
    struct BroadcastGroup {
        struct Question {
            std::string asker;
            std::uint64_t session = 0;
            std::vector<std::byte> text;
        };
        std::map<std::string, Asker, std::less<>> members;
        std::map<std::uint64_t, std::string> clients;  // the newest member of each
        std::deque<Question> questions;                // the first one has been asked while the peer is asking
        std::vector<std::pair<std::string, std::uint64_t>> resuming;  // members, and the states they are in
        bool stateWanted = false;                                     // by members without a state of ours
        double allowance = 0;                                         // bytes of answers to hellos
        Clock::time_point allowed{}, stateSent{}, pruned{};
    };
    struct Peer : Asker {
        std::uint64_t window = 0;
        std::unique_ptr<BroadcastGroup> broadcast;  // it stands for these
        std::size_t longest = SIZE_MAX;             // bytes of a part
        MirrorPace pace;
        std::uint64_t sentBytes = 0, ackedBytes = 0, ackedState = 0;
        std::uint64_t awaitedBytes = 0;  // the part of sentBytes whose acknowledgement was asked for
        Clock::time_point awaitedAt{};
        std::uint64_t debt = 0;  // bytes sent before its last hello that it may not have read yet
        bool placed = false;     // `state` is valid
        /// The state of a part that it says it has, while the part is being opened.
        struct Claim {
            std::uint64_t state = 0;
            Hash128 hash;
        };
        std::optional<Claim> claim;
        bool remembers = false;   // has all predicted frames since the last kForget
        std::uint64_t state = 0;  // its state once everything sent has arrived
        SharedRecord sending;     // a record that is partly sent
        std::string to;           // where it goes,
        std::uint64_t toSession = 0;
        bool inputs = false;   // wants inputs
        bool running = false;  // has the run state, so it can go on with inputs
        SharedRecord then;     // to be sent next, before anything else
        std::size_t sent = 0;  // bytes of `sending` that were sent
        Clock::time_point spoken, waitingSince{};
        MirrorWhenSlow whenSlow = MirrorWhenSlow::coalesce;
        Clock::duration interval{};  // least time between frames
        Clock::time_point due{};
        Clock::time_point behindSince{};
        std::uint32_t part = 0;  // the number of the stream it follows
        // A question to the shadow. Nothing is sent until the answer is there; then frames are sent up to the answer's
        // state.
        bool asking = false;
        std::uint64_t held = 0;  // if not 0: it lacks values of this state, which is the one after `state`
        std::optional<MirrorShadow::Answer> answer;
        std::optional<MirrorShadow::Answer> after;  // an answer that waits for merged frames up to its state
        double allowance = 0;                       // questions that it may ask
        Clock::time_point allowed{};
        std::deque<Judged> verdicts;  // their requests' frames have not been sent yet
    };
    using Peers = std::map<std::string, Peer, std::less<>>;
    /// A stream that peers follow: the scene, or a part of it.
    struct Stream {
        explicit Stream(std::uint64_t limit) : history(limit) {}
        MirrorHistory history;
        bool keyframeAsked = false;
        mirror::Wishes wishes;
        std::uint64_t epochMix =
            0;  // makes the epoch of a part its own, because its state numbers are those of the scene
        Clock::time_point used{};
    };

    void run();
    /// Does it, and gives up if that throws.
    void guard(const std::function<void()>& work);
    void wait(Clock::duration maximum);
    Listener::Items itemsOf(std::size_t listener);
    void gather();
    void poll();
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
    /// Returns false if messages are left. Reading is bounded, so that a peer that floods us leaves time for the
    /// others.
    bool receive(std::size_t listener);
    void receiveAll();
    void handle(const std::string& identity, std::span<const std::byte> bytes, std::span<const std::byte> body,
                const std::string& user);
    void handleOf(Peer& peer, Asker& asker, mirror::Message type, wire::Reader& in, std::span<const std::byte> bytes,
                  std::span<const std::byte> body);
    void hello(const std::string& identity, const mirror::Hello& hello, const std::string& user);
    /// `by`: the broadcast to which it belongs.
    void introduce(Asker& asker, const std::string& identity, const mirror::Hello& hello, const std::string& user,
                   const std::string& by = {});
    /// Returns false if the connection is gone.
    bool welcome(const std::string& to, std::uint64_t session, std::uint64_t epoch, std::uint64_t newest);
    // Of those who read what a listener broadcasts.
    void openBroadcast(std::size_t listener);
    Peer* broadcastOf(const std::string& identity);
    void join(Peer& all, const std::string& identity, const mirror::Hello& hello, const std::string& user);
    void leave(Peer& all, const std::string& identity);
    void forgetSilent(Peer& all, Clock::time_point now);
    static Asker* askerIn(Peer& peer, std::uint64_t client);
    void askNext(Peer& all);
    static bool addressAnswer(Peer& all, bool merged);
    void answerJoiners(Peer& all);
    void sendState(Peer& all, const std::string& to, std::uint64_t from, const SharedRecord& keyframe);
    void noteHeard(const std::string& identity);
    std::string authorOf(const mirror::Hello& hello, const std::string& user, const std::string& by) const;
    void refuseVersion(const std::string& identity, std::uint8_t version);
    void takeKeys();
    bool isListed(const std::string& user) const;
    MirrorUpstream upstreamOf(const std::string& user) const;
    bool mayAsk(Peer& peer);
    void question(Peer& peer, std::span<const std::byte> bytes);
    void submission(Peer& peer, Asker& asker, wire::Reader& in, std::span<const std::byte> body);
    void control(const Asker& asker, wire::Reader& in);
    void reply(const Shared::Control& control);
    void restart();
    void tick(Clock::time_point now);
    void noticeWhoLeft();
    /// How long the thread may sleep.
    std::chrono::milliseconds patience();
    std::chrono::milliseconds untilTick(Clock::time_point now) const;
    /// How old the statistics may be.
    Clock::duration settling() const;
    /// When the peer needs attention even if no message comes from it and no record for it.
    Clock::time_point dueFor(const Peer& peer, Clock::time_point now) const;
    /// Sends what may be sent, to all peers or to those heard in this turn.
    void pumpAll(Clock::time_point now);
    void pumpHeard(Clock::time_point now);
    void callForSnapshot();
    void askForKeyframe(std::uint32_t part);
    void keepKeyframeNear(std::uint32_t part);
    /// The number of the stream for the parts and aspects of this hello. Empty if there are as many streams as allowed.
    std::optional<std::uint32_t> streamFor(const mirror::Hello& hello);
    /// Lets the peer go on from the state that it says it has, if frames lead on from there.
    void enqueue(Peer& peer);
    void dropStream(std::uint32_t part);
    bool dropUnusedPart();
    void refuseRegions(std::string why);
    /// `forGood` means that the answer will always be the same.
    void refuse(const std::string& identity, const std::string& reason, bool forGood = false);
    Stream& streamOf(const Peer& peer) { return streams_.find(peer.part)->second; }
    const MirrorHistory& historyOf(const Peer& peer) const { return streams_.find(peer.part)->second.history; }
    bool behind(const Peer& peer) const;
    bool late(const Peer& peer) const;
    bool mayPass(Peer& peer);
    /// Returns false if the peer is gone.
    bool pump(Peer& peer);
    bool deliverAnswer(Peer& peer);
    bool deliverVerdicts(Peer& peer);
    SharedRecord nextFor(Peer& peer);
    /// The record as this peer gets it: as changes, or as the input of the frame.
    SharedRecord asFollowed(Peer& peer, SharedRecord next);
    SharedRecord keyframeFor(Peer& peer);
    SharedRecord frameFor(Peer& peer);
    /// Merges here if that is easy. Otherwise asks the shadow and returns null.
    SharedRecord mergeNow(Peer& peer, std::vector<SharedRecord> frames);
    void merge(Peer& peer, std::vector<SharedRecord> frames, bool all = false);
    void mergeHeld(Peer& peer);
    SharedRecord frameTowards(Peer& peer, std::uint64_t state);
    SharedRecord codedFor(Peer& peer, SharedRecord record);
    bool sendChunk(Peer& peer);
    bool mayWait(const Peer& peer, std::uint64_t size, Clock::time_point now) const;
    bool askForAcknowledgement(Peer& peer);
    void askAllForAcknowledgements();
    bool sendTo(const std::string& identity, const ByteBuffer& head, std::span<const std::byte> body = {},
                const SharedBytes& owner = {});
    /// Tells the state sent and the scene's. Returns false if the peer is gone.
    bool ping(const Peer& peer);
    void garbage(std::string text);
    void warn(std::uint64_t by, std::string text);
    void publishStatistics();

    std::shared_ptr<Shared> shared_;
    Clock& clock_;
    std::vector<std::unique_ptr<Listener>> listeners_;
    std::vector<pollfd> items_;                // to wait at: `wake`, the list of keys, and those of the listeners
    FileWatch keyFile_;                        // tells when the list of keys may be another one
    std::map<std::uint32_t, Stream> streams_;  // 0 is the whole scene
    MirrorHistory& history_;                   // history of the whole scene
    std::uint32_t nextPart_ = 1;
    MirrorShadow shadow_;
    std::deque<Shared::Item> held_;  // frames that the shadow has and peers must not have yet
    struct Logged {
        std::uint64_t start = 0, state = 0;
        std::chrono::milliseconds longestWait{0};
    } logged_;                                // what the log said last
    std::deque<MirrorShadow::Answer> early_;  // answers about states that peers must not have yet
    std::uint64_t era_ = 0;                   // number of restarts that were released
    PlainMerges merges_;
    mirror::RequestLedger ledger_;
    std::set<std::uint64_t> submitters_;  // connected clients that sent requests
    Peers peers_;
    static constexpr const char* kNotListed = "its key is no longer on the list";
    bool reportedLost_ = false;       // what peers were told about the origin
    bool leaving_ = false;            // at the end: only what peers have read, and their goodbyes, count
    bool news_ = true;                // something came for all peers: frames, answers, verdicts
    std::vector<std::string> heard_;  // peers heard in this turn
    Clock::time_point allDue_{}, ticked_{}, settled_{}, turned_{}, newsAt_{};
    bool isBusy_ = false;     // frames follow each other closely
    bool unsettled_ = false;  // something has happened since the statistics were published
    bool heldUp_ = false;     // as published
    MirrorServerStatistics statistics_;
    // Refused because there was no room, or no valid key, or another version of the protocol.
    std::uint64_t crowded_ = 0, strangers_ = 0, foreigners_ = 0;
    ByteBuffer message_, head_;
    std::size_t wantedNext_ = 0;  // bytes of the last frame's buffer, as more such frames will come
    std::uint64_t dictionaryHash_ = 0;
    Clock::time_point forgetAsked_{};
    std::string noRegions_;             // why regions were refused when last tried
    Clock::time_point regionsAgain_{};  // regions are not tried again before
    Worker worker_{"rtsg mirror"};      // last: its job uses the others
};

}  // namespace rtsg
