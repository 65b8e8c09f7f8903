// The side of a mirror server that talks to peers: one thread, one ROUTER socket, the history and every peer's place.
//
// Invariant: only this thread touches peers, history and sockets. The scene's thread hands over records through
// `Inbox` and never waits.
#pragma once

#include <atomic>
#include <chrono>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <rtsg/sync/mirror_server.h>

#include "mirror_history.h"
#include "mirror_message.h"
#include "zmq_socket.h"

namespace rtsg {

/// What both threads touch.
struct MirrorServer::Shared {
    struct Item {
        SharedRecord record;
        bool requested = false;  // a snapshot taken for late joiners
        bool restart = false;    // the scene has started over: nothing before counts
    };
    MirrorServerOptions options;
    std::string endpoint;
    std::shared_ptr<RecordPool> pool = std::make_shared<RecordPool>();
    std::atomic<bool> wantSnapshot{false}, stop{false};
    std::atomic<std::uint64_t> epoch{0};
    int wake = -1;  // eventfd

    std::mutex mutex;  // guards the rest
    std::vector<Item> inbox;
    MirrorServerStatistics statistics;
    std::vector<Diagnostic> diagnostics;

    ~Shared();
    void post(Item item);
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
        std::string identity, name;
        std::uint64_t session = 0, window = 0;
        std::uint64_t sentBytes = 0, ackedBytes = 0, ackedState = 0;
        std::uint64_t debt = 0;   // bytes sent before its last hello that it may not have read yet
        bool placed = false;      // `state` means something
        std::uint64_t state = 0;  // that it will be in once everything sent has arrived
        SharedRecord sending;     // partly sent
        std::size_t sent = 0;     // bytes of it
        Clock::time_point heard, spoken, waitingSince{};
    };
    using Peers = std::map<std::string, Peer, std::less<>>;

    void run();
    void sayGoodbye();
    void takeInbox();
    void receive();
    void handle(const std::string& identity, std::span<const std::byte> bytes);
    void hello(const std::string& identity, const mirror::Hello& hello);
    void authenticate();
    void watchConnections();
    void restart();
    void tick(Clock::time_point now);
    /// False when the peer is gone.
    bool pump(Peer& peer);
    SharedRecord nextFor(Peer& peer);
    SharedRecord keyframeFor(Peer& peer);
    bool sendChunk(Peer& peer);
    bool sendTo(const std::string& identity, const ByteBuffer& head, ZmqMessage* body = nullptr);
    void garbage(std::string text);
    void publishStatistics();

    std::shared_ptr<Shared> shared_;
    ZmqContext context_;
    ZmqSocket router_, monitor_, zap_;
    MirrorHistory history_;
    Peers peers_;
    MirrorServerStatistics statistics_;
    ByteBuffer message_, head_;
    std::thread thread_;
};

}  // namespace rtsg
