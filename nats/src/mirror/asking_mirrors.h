// AskingMirrors: passes on to the server what mirrors send over NATS, and gives each its answers.
//
// The server sees one peer, so requests are given numbers of that peer, and questions are sent one at a time.
// Invariant: a request is passed on once, however often its mirror repeats it. The numbers of mirrors, requests and
// questions that are remembered are bounded.
// Threading: one thread.
#pragma once

#include <chrono>
#include <deque>
#include <functional>
#include <map>
#include <string>

#include "edits/upstream.h"
#include "packet.h"
#include "server_stream.h"

namespace rtsg::nats {

class AskingMirrors {
  public:
    using Reply = std::function<void(const std::string& inbox, std::span<const std::byte> first,
                                     std::span<const std::byte> second)>;
    AskingMirrors(ServerStream& server, std::uint64_t typesHash, Reply reply)
        : server_(server), typesHash_(typesHash), reply_(std::move(reply)) {}

    /// A mirror has come. False: there are too many.
    bool greeted(const std::string& inbox, const mirror::Hello& hello);
    /// A mirror that only pings is there, too.
    void pinged(const std::string& inbox, Clock::time_point now) {
        if (const auto found = mirrors_.find(inbox); found != mirrors_.end()) found->second.heard = now;
    }
    /// A message of a mirror that is neither a hello nor a ping. False: it makes no sense.
    bool take(const std::string& inbox, const Packet& packet, Clock::time_point now);
    /// A message of the server. A repair is a record that leads from a state to itself.
    void answered(const Packet& packet);
    void repaired(const SharedRecord& record, std::size_t maxBytes);
    /// The server has welcomed us; with another epoch nothing of before counts.
    void welcomed(bool sameEpoch);
    /// Asks the next question when it is due, and forgets mirrors that have left.
    void poll(Clock::time_point now);

  private:
    struct Mirror {
        std::uint64_t client = 0;
        std::string name;
        bool sameTypes = false;
        Clock::time_point heard;
        mirror::Assembly submission;
    };
    struct Question {
        std::string inbox;
        std::vector<std::byte> message;
    };
    struct Request {
        std::uint64_t client = 0, number = 0;
        std::vector<std::byte> record;
        std::string author;
    };
    struct Command {
        std::string inbox;
        std::uint64_t session = 0;
    };

    bool submit(const std::string& inbox, Mirror& mirror, const Packet& packet);
    void passOn(std::uint64_t number, const Request& request);
    void refuse(const std::string& inbox, std::uint64_t session, std::uint64_t request, std::string why);
    void verdict(const Packet& packet);
    void reply(const std::string& inbox, const ByteBuffer& message) { reply_(inbox, message.bytes(), {}); }

    ServerStream& server_;
    const std::uint64_t typesHash_;
    const Reply reply_;
    std::map<std::string, Mirror, std::less<>> mirrors_;  // by inbox
    std::map<std::uint64_t, std::string> inboxes_;        // by client
    std::map<std::uint64_t, std::uint64_t> sessions_;     // by client, of its last request
    mirror::RequestLedger ledger_;
    std::map<std::uint64_t, Request> requests_;  // without a verdict, by our number
    std::uint64_t nextRequest_ = 1;
    std::deque<Command> commands_;
    std::deque<Question> questions_;  // the first one has been asked if `asked_` is set
    bool asked_ = false;
    double allowance_ = 0;
    Clock::time_point askedAt_{}, turned_{}, pruned_{};
    ByteBuffer message_, packet_;
};

}  // namespace rtsg::nats
