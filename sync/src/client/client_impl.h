// MirrorClient::Impl: the inside of MirrorClient. client_connection.cpp has the connection and its messages,
// client_replica.cpp their effect on the replica.
//
// Invariant: `state_` is the state of the origin to which the replica was brought. If the replica's own number differs,
// its owner has edited it.
// Threading: the replica's thread.
#pragma once

#include <atomic>
#include <deque>
#include <optional>

#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/input_codec.h>
#include <rtsg/sync/mirror_client.h>

#include "columns/plain_columns.h"
#include "edits/questions.h"
#include "playout.h"
#include "sockets/clock.h"
#include "sockets/message.h"
#include "transport/transport.h"

namespace rtsg {

class MirrorClient::Impl {
  public:
    Impl(Scene& replica, MirrorClientOptions options);
    ~Impl();

    Result<> start(const std::string& endpoint);
    std::size_t poll(std::chrono::milliseconds timeout);
    MirrorClient::Waiting waiting() const;
    Clock& clock() const { return time_; }
    void wakeBy(int descriptor) { wakes_ = descriptor; }
    void onStep(std::function<void(const RecordStep&)> heard) { onStep_ = std::move(heard); }
    bool inStep() const {
        return connected_ && !relayLost_ && haveState_ && partial_.empty() && playout_.empty() && !diverged_ &&
               statistics_.sequence >= newestHeard_;
    }
    bool originLost() const;
    bool receiving() const;
    /// poll() was called on another thread. It touches nothing else there.
    void refuseThread() { foreignPolls_.fetch_add(1, std::memory_order_relaxed); }
    /// A diagnostic if such calls were refused since the last time.
    std::optional<Diagnostic> takeRefusedPolls();
    Result<std::uint64_t> submit(MirrorRequest request);
    Value presented(NodeId node, FieldIndex field) const;

    Scene& replica_;
    MirrorStatistics statistics_;
    std::vector<Diagnostic> diagnostics_;
    std::vector<MirrorVerdict> verdicts_;
    std::vector<std::string> replies_;
    std::deque<std::uint64_t> commands_;  // commands without a reply: the session in which each was sent
    bool control(std::string_view command);
    std::string refusal_;
    bool serverLeft_ = false, turnedAway_ = false;
    std::uint32_t nextProvisional_;
    struct Request {
        std::uint64_t number = 0;
        ByteBuffer record;
        std::string author;
        std::size_t sent = 0;
        Clock::time_point sentAt{};
        std::uint64_t types = 0;  // the origin's dictionary hash for which it was written
    };
    std::deque<Request> requests_;  // requests without a verdict

  private:
    // Connection.
    bool send();
    Result<> toOriginsNumbers(std::vector<Change>& changes) const;
    bool sendRequests();
    void report(Severity severity, std::string text);
    void garbage(std::string text);
    void answered(const mirror::Words& reply);
    void loseCommands(std::ptrdiff_t count);
    void hello(bool afresh);
    bool mayGreet(Clock::time_point now) const;
    void watchConnection();
    void connectionLost();
    bool linked() const { return up_ && !cut_; }
    void keepInTouch(bool idle);
    bool bringsBytes(Clock::time_point now);
    void reconnect(Clock::time_point now);
    void pingNow(Clock::time_point now);
    void ping(Clock::time_point now);
    bool wait(std::chrono::milliseconds maximum);
    std::chrono::milliseconds longestSleep() const;
    int receivePortion();
    bool receiveOne();
    void receive(mirror::Message type, wire::Reader& in, const Received& message);
    void hearOrigin(wire::Reader& in);
    void meetVersion(std::uint8_t version, std::span<const std::byte> bytes);
    void forgetPause(Clock::duration expected);
    void welcome(wire::Reader& in, std::span<const std::byte> part);
    void data(wire::Reader& in, std::span<const std::byte> part);
    void noticeLoss(std::uint64_t sent);
    void acknowledge();

    // Replica.
    void arrived(std::span<const std::byte> bytes, bool isRecord, std::uint64_t published);
    void playDue();
    std::chrono::milliseconds untilDue(std::chrono::milliseconds maximum) const;
    void take(std::span<const std::byte> bytes, bool isRecord);
    void record(std::span<const std::byte> bytes);
    bool editedByItsOwner();
    void apply(std::span<const std::byte> bytes, const RecordHeader& header, bool afresh);
    bool applyAgain(std::span<const std::byte> bytes, const RecordHeader& header);
    Result<std::shared_ptr<ChangeSet>> applySet(std::span<const std::byte> bytes, const RecordHeader& header);
    void reportStep(std::span<const std::byte> bytes, const RecordHeader& header, std::shared_ptr<ChangeSet> set);
    void input(std::span<const std::byte> bytes, const RecordHeader& header);
    void stopRunning(const std::string& why);
    void noteLag();
    void noteHole(const RecordHeader& header, bool afresh);
    void compare(const RecordHeader& header);
    void repair(std::span<const std::byte> bytes, const RecordHeader& header);
    void answer(std::span<const std::byte> message);
    void nothingDiffers();
    void giveUpRepair(const std::string& why);
    void doubt(std::vector<mirror::NodeRange> ranges);
    void scrub(Clock::time_point now);
    void announce(const Divergence& divergence);
    void healed();
    std::shared_ptr<ChangeSet> freshSet();

    MirrorClientOptions options_;
    std::string endpoint_;
    std::atomic<std::uint64_t> foreignPolls_{0};
    Clock& time_;
    std::unique_ptr<Connection> connection_;
    mutable ChangeDecoder decoder_;
    wire::RepeatedColumns repeated_;
    ChangeEncoder encoder_;
    InputDecoder inputDecoder_;
    std::uint64_t dictionaryHash_;  // for hellos; 0 once an origin with other types was asked for something
    std::uint64_t originTypes_;     // the origin's dictionary hash
    ByteBuffer message_;

    std::uint64_t session_ = 0, epoch_ = 0, client_ = 0, nextRequest_ = 1;
    bool helloPending_ = true, connected_ = false;
    int unanswered_ = 0;              // hellos of this connection since the last answer
    bool up_ = false;                 // there is a connection, by its last event that was read
    bool cut_ = false;                // a connection has ended, and its messages are still being read
    bool relayLost_ = false;          // the server is a relay that has lost its origin
    int wakes_ = -1;                  // a descriptor that ends poll() when readable
    bool called_ = false;             // it was readable, or a signal has come
    bool moreWaits_ = false;          // some messages have not been received yet
    bool quiet_ = false;              // nothing was heard for longer than a heartbeat, or no answer came
    Clock::time_point askedSince_{};  // the first ping since the server was heard
    bool streams_ = false;            // records follow each other closely
    std::chrono::milliseconds heartbeat_{500};
    bool haveState_ = false;      // the replica is in a state of this epoch
    bool touched_ = false;        // something was applied to the replica, so it must be reset before a keyframe
    Clock::time_point coming_{};  // when a part of a record, or bytes of one, came last
    std::uint64_t brought_ = 0;   // bytes of the connection at the last look
    Clock::time_point lookedAt_{};
    std::uint64_t state_ = 0, newestHeard_ = 0;
    Hash128 stateHash_;                              // of `state_`, as the server says
    std::uint64_t originAt_ = 0;                     // the newest state that the server has named
    std::uint64_t received_ = 0, acknowledged_ = 0;  // bytes in this session
    bool awaited_ = false;                           // the server waits for the acknowledgement
    ByteBuffer partial_;                             // a record that comes in several parts
    std::uint64_t partialSize_ = 0;
    std::uint64_t heldEpoch_ = 0;  // the epoch of `state_`
    std::optional<Clock::time_point>
        lostAt_;  // set if the origin was out of reach since the last state: when it was last heard
    Clock::time_point relayLostAt_{};         // when the relay said that its own origin is lost
    std::uint64_t relayMissed_ = 0;           // times that the relay missed states, as it says
    int attempts_ = 0;                        // attempts to reconnect since the server was heard
    Clock::time_point looked_ = time_.now();  // for messages
    Clock::time_point reconnected_{}, heard_{}, greeted_{}, repaired_{}, dataAt_{}, pinged_{}, asked_{}, scrubbed_{};
    std::vector<std::shared_ptr<ChangeSet>> sets_;
    std::size_t applied_ = 0;  // sets applied in this poll()
    std::function<void(const RecordStep&)> onStep_;

    bool running_ = false;        // it has a run state, so inputs can be run
    unsigned inputTroubles_ = 0;  // after some of these, inputs are not asked for any more
    static constexpr unsigned kMaxInputTroubles = 3;
    bool diverged_ = false;
    mirror::Bisection bisection_;
    std::size_t lastChanges_ = 0;  // of the frame after which the hash differed
    std::uint32_t scrubAt_ = 0;

    MirrorClock clock_;
    MirrorPlayout playout_;
    std::uint64_t shownAt_ = 0;  // the server's time of the frame applied last
};

}  // namespace rtsg
