// FoxgloveServer: messages on topics for live viewers, by WebSocket in the protocol of Foxglove.
//
// A viewer hears which topics there are, and subscribes. A message of a topic that is a state says what has changed, or
// is whole; who subscribes anew, or has missed one, gets a whole one before it gets changes.
// Invariant: no viewer holds up the scene: kMaxQueued bytes, or one message, wait for each, and what has no room is
// left out and counted. Viewers change nothing. Whole messages that viewers make necessary have at most kWholeRate
// bytes a second for each topic. Pages of other sites may not connect, unless other machines may. Threading: a thread
// of the module sends and hears; all calls on the scene's thread. Source: the WebSocket protocol foxglove.websocket.v1
// (github.com/foxglove/ws-protocol).

// Example:
//     #include <rtsg/feeds/foxglove_server.h>
//     rtsg::FoxgloveOptions options;
//     options.listen = "0";
//     const auto viewers = rtsg::FoxgloveServer::start(options);
//     if (!viewers) return;  // viewers.error() says why
//     const auto topic = (*viewers)->addTopic("/height", "rtsg.Number", R"({"type":"object"})", true);
//     (*viewers)->service();
//     if ((*viewers)->wants(topic))
//         (*viewers)->send(topic, 0, R"({"value":1.7})", rtsg::FoxgloveServer::Reach::wholeForAll);
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

struct FoxgloveOptions {
    /// "8765" is that port on loopback, "HOST:8765" another address; port 0 is a free one.
    std::string listen = "8765";
    /// Allows an address that other machines can reach, and pages of any site.
    bool insecure = false;
    /// An eventfd that is written when a viewer asks for something. -1: none.
    int call = -1;
    /// What viewers show as the source.
    std::string name = "rtsg";
};

struct FoxgloveCounts {
    std::size_t clients = 0;     // connected now
    std::uint64_t messages = 0;  // that were handed over, for each client that got one
    std::uint64_t missed = 0;    // that a client had no room for
    std::uint64_t garbage = 0;   // messages of clients that made no sense
    std::uint64_t refused = 0;   // connections and requests that were turned away, those reported
};

class FoxgloveServer {
  public:
    static constexpr std::size_t kMaxQueued = std::size_t{4} << 20, kWholeRate = std::size_t{16} << 20;

    /// Errors: no such address; one that others reach, without `insecure`; no module, in builds without browsers.
    static Result<std::unique_ptr<FoxgloveServer>> start(FoxgloveOptions options);
    /// Says goodbye.
    ~FoxgloveServer();
    FoxgloveServer(const FoxgloveServer&) = delete;
    FoxgloveServer& operator=(const FoxgloveServer&) = delete;

    /// Adds a topic of JSON messages. Its schema is a JSON Schema; viewers know it by `schemaName`. `isState`: each
    /// message says what has changed since the one before. Call it before the first service().
    std::uint16_t addTopic(std::string_view topic, std::string_view schemaName, std::string_view schema, bool isState);
    /// Carries out what viewers have asked for. Call it between frames.
    void service();

    /// True if anybody has subscribed.
    bool wants(std::uint16_t topic) const;
    /// True if somebody who has subscribed waits for a whole message, and has room for it.
    bool wantsWhole(std::uint16_t topic) const;
    /// True if somebody waits for a whole message of any topic, whether or not there is room.
    bool owesWhole() const;
    enum class Reach : std::uint8_t {
        change,       // what has changed: for those who have had a whole one
        wholeForAll,  // all there is
        wholeForNew,  // all there is, where nothing has changed: for those who wait for it
    };
    /// `time` in seconds, >= 0.
    void send(std::uint16_t topic, double time, std::string json, Reach reach);
    /// Tells viewers the scene's time, which they show instead of the clock's.
    void sendTime(double time);

    /// "ws://127.0.0.1:8765", the port filled in.
    const std::string& address() const;
    FoxgloveCounts counts() const;
    /// What was refused since the last call.
    std::vector<Diagnostic> takeDiagnostics();

  private:
    struct State;
    explicit FoxgloveServer(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
