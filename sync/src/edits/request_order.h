// RequestOrder: the order in which requests of peers take effect.
//
// Edits take effect at once, events with the scene's next frame. The later of two requests for one node must win. So a
// request waits for queued events of the same peer or for a node that it touches, and for requests that wait
// themselves. After 250 ms it waits no longer.
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
    /// Carries out requests that need not wait. Returns their verdicts, except those on events, which happened() gives
    /// later.
    std::vector<Verdict> carryOut();
    /// The scene has published `changes`. Returns the verdicts on events that happened in them.
    std::vector<Verdict> happened(const ChangeSet& changes);
    /// True if a request of this client still waits.
    bool holds(std::uint64_t client) const;
    /// Bytes of the records that wait.
    std::uint64_t bytes() const;

  private:
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
    std::set<std::uint64_t> heldClients_;   // in this turn: clients whose requests wait,
    std::set<NodeId> heldNodes_;            // and the nodes that these touch
    std::vector<Verdict> events_;           // on events queued for the next frame,
    double queuedAt_ = 0;                   // the scene's time when they were queued,
    std::set<std::uint64_t> eventClients_;  // the clients that sent them,
    std::set<NodeId> eventNodes_;           // and the nodes to which they go
};

}  // namespace rtsg::mirror
