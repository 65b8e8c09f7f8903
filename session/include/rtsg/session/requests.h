// Requests: sends the requests of the user of a mirror to the origin, at times since the replica joined.
//
// `set` sends events, `edit` changes fields, `undo` and `redo` take the user's edits back and do them again, `lock`
// reserves nodes. If several are due at one time, locks are sent first, then edits, events, undo and redo. Threading:
// the replica's thread.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include <rtsg/session/notices.h>
#include <rtsg/sync/mirror_client.h>

namespace rtsg {

class Injections;

/// As the options of `rtsg mirror` of these names have them.
struct RequestOptions {
    std::vector<std::string> set, edit, undo, redo, lock;
};

class Requests {
  public:
    Requests(RequestOptions options, SessionContext context);
    ~Requests();
    Requests(const Requests&) = delete;
    Requests& operator=(const Requests&) = delete;
    /// Call it when there is a replica, so that names can be looked up. Errors name the option and what is wrong with
    /// it; kUsageCode: a moment, or a lease.
    Result<> parse(Scene& replica);
    /// Sends what is due `since` seconds after the replica joined; its clock is at `now`.
    void poll(MirrorClient& client, double since, double now);
    /// Counts the answers. Reports requests that were refused, or only partly taken back.
    void takeVerdicts(MirrorClient& client);
    /// True while verdicts are missing.
    bool open() const { return accepted + refused < sent; }
    /// The first request that is not due yet, as typed. Empty if there is none.
    std::string firstUnsent() const;
    std::uint64_t sent = 0, accepted = 0, refused = 0, unsent = 0;  // unsent: too large, for example

  private:
    struct Timed {
        double time = 0;   // seconds
        std::string text;  // as typed, with its option
        MirrorRequest request{};
        std::vector<std::string> names{};  // of the nodes to lock
    };
    Result<> parseEdits(Scene& replica);
    Result<> parseLocks(const Scene& replica);
    static Result<std::vector<NodeId>> nodesOf(const Timed& lock, const Scene& replica);
    void sendDue(MirrorClient& client, std::vector<Timed>& requests, std::size_t& next, double since);
    /// `text` is the request with its option.
    void note(const Result<std::uint64_t>& request, std::string text);

    const RequestOptions options_;
    const SessionContext context_;
    std::unique_ptr<Injections> events_, edits_;
    std::vector<Timed> locks_, takenBack_;  // by time
    std::size_t nextLock_ = 0, nextTakenBack_ = 0;
    const Scene* replica_ = nullptr;
    std::map<std::uint64_t, std::string> asked_;  // requests without an answer
};

}  // namespace rtsg
