// Requests: what the user of `rtsg mirror` asks of the origin, each when the replica has come so far since it joined.
//
// --set sends events, --edit changes fields, --undo and --redo take the user's edits back and do them again, --lock
// keeps nodes for the user. Among requests that are due at one time, locks go first, then edits, events, undo and redo.
// Threading: the replica's thread.
#pragma once

#include <map>
#include <string>
#include <vector>

#include <rtsg/sync/mirror_client.h>

#include "injections.h"

namespace rtsg::app {

struct RequestArguments {
    std::vector<std::string> set, edit, undo, redo, lock;
    void addTo(Command& command);
};

class Requests {
  public:
    explicit Requests(const RequestArguments& arguments) : arguments_(arguments) {}
    /// The names are known once there is a replica. Errors name the option and what is wrong with it.
    Result<> parse(Scene& replica);
    /// Sends what is due `since` seconds after the replica joined, whose clock is at `now`.
    void turn(MirrorClient& client, double since, double now);
    /// Counts the answers. Requests that were refused, or not wholly taken back, are reported on standard error.
    void takeVerdicts(MirrorClient& client);
    /// Verdicts are still to come.
    bool open() const { return accepted + refused < sent; }
    /// The first, as it was typed, whose time has not come; empty: none.
    std::string firstUnsent() const;
    std::uint64_t sent = 0, accepted = 0, refused = 0, unsent = 0;  // unsent: too large, say

  private:
    struct Timed {
        double time = 0;   // seconds
        std::string text;  // as it was typed, with its option
        MirrorRequest request{};
        std::vector<std::string> names{};  // of the nodes of a lock
    };
    Result<> parseEdits(Scene& replica);
    Result<> parseLocks(const Scene& replica);
    static Result<std::vector<NodeId>> nodesOf(const Timed& lock, const Scene& replica);
    void sendDue(MirrorClient& client, std::vector<Timed>& requests, std::size_t& next, double since);
    /// `text`: what was asked, with its option.
    void note(const Result<std::uint64_t>& request, std::string text);

    const RequestArguments& arguments_;
    Injections events_, edits_;
    std::vector<Timed> locks_, takenBack_;  // by time
    std::size_t nextLock_ = 0, nextTakenBack_ = 0;
    const Scene* replica_ = nullptr;
    std::map<std::uint64_t, std::string> asked_;  // requests without an answer yet
};

}  // namespace rtsg::app
