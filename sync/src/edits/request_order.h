// The order in which what peers ask for takes effect.
//
// Edits take effect at once, events with the scene's next frame. So that of two requests that touch one node the later
// one counts, a request waits behind events that are queued, if they are of the same peer or go to a node that it
// touches, and behind requests that wait themselves. It waits 250 ms at most: then it goes ahead of them.
// Threading: all on the scene's thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <set>
#include <vector>

#include <rtsg/core/scene.h>

#include "upstream.h"

namespace rtsg::mirror {

class RequestOrder {
  public:
    RequestOrder(Scene& scene, Writers& writers) : scene_(scene), writers_(writers) {}

    void add(std::vector<Submission> submissions);
    /// Carries out what need not wait. Returns verdicts, but for those on events, which happened() has later.
    std::vector<Verdict> carryOut();
    /// The scene has published `changes`: verdicts on the events that happened in them.
    std::vector<Verdict> happened(const ChangeSet& changes);
    /// Whether something that this client asked for still waits.
    bool holds(std::uint64_t client) const;
    /// Of the records that wait.
    std::uint64_t bytes() const;

  private:
    using Clock = std::chrono::steady_clock;
    struct Waiting {
        Submission submission;
        Clock::time_point since;
        std::optional<RequestTouch> touch;
    };
    static const RequestTouch& touch(Waiting& request);
    bool mustWait(Waiting& request, Clock::time_point now);
    void note(Waiting& held);

    Scene& scene_;
    Writers& writers_;
    std::deque<Waiting> waiting_;
    std::set<std::uint64_t> heldClients_;   // of this turn: whose requests wait,
    std::set<NodeId> heldNodes_;            // and what they touch
    std::vector<Verdict> events_;           // on events that are queued for the next frame,
    double queuedAt_ = 0;                   // the scene's time then,
    std::set<std::uint64_t> eventClients_;  // whose they are,
    std::set<NodeId> eventNodes_;           // and where they go
};

}  // namespace rtsg::mirror
