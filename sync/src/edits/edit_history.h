// EditHistory: what takes back what each author has done to a scene, request by request.
//
// Invariant: taking back never undoes what somebody else did: what has another value than the request left, is gone,
// or is a new node that others have worked on, stays as it is, and is named. What was taken back can be done again
// until its author does something new. A node that was destroyed comes back under a new number, which the whole history
// then knows. Events are not taken back, as what followed from them is the scene's own. Memory is bounded: the oldest
// requests are forgotten. Threading: the scene's thread, between frames.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/sync/mirror_keys.h>

#include "node_locks.h"

namespace rtsg::mirror {

class EditHistory {
  public:
    static constexpr std::size_t kMostSteps = 1000;  // of an author, each way
    static constexpr std::size_t kMostAuthors = 256;
    static constexpr std::uint64_t kMostBytes = std::uint64_t{64} << 20;  // of all

    /// Before a change of the request at hand is carried out; its nodes are there, but for one that it creates.
    void before(const Scene& scene, const Change& change);
    /// It is done. `created`: of a createNode, the number that the node has got.
    void after(const Scene& scene, NodeId created = {});
    /// The change could not be carried out.
    void failed() { pending_.resize(mark_); }
    /// The request is over; it is one step of its author's. `permission`: what it took.
    void end(std::string_view author, MirrorUpstream permission);

    /// The author's last step backwards, or with `again` the last one that was taken back forwards, attributed to the
    /// author and not sealed. What stays as it is, and why; an error if nothing was done.
    Result<std::string> takeBack(Scene& scene, std::string_view author, bool again, MirrorUpstream permission,
                                 const NodeLocks& locks);

  private:
    /// A node that was destroyed, as it was.
    struct Lost {
        TypeIndex type;
        std::string name;
        std::vector<std::pair<FieldIndex, Value>> fields;
        std::vector<Change> places;  // insertChild and setField of its parents
        std::vector<Route> routes;
    };
    struct Item {
        Change back;  // what takes it back
        Value left;   // what the field or name had then, or how often a child was there: others' changes show by it
        std::shared_ptr<const Lost> lost;  // with createNode: what comes back
        bool cameBack = false;             // with destroyNode: it had been destroyed before, as it hung in the scene
    };
    struct Step {
        std::vector<Item> items;
        std::uint64_t number = 0, bytes = 0;
        MirrorUpstream permission = MirrorUpstream::edits;
    };
    struct Author {
        std::deque<Step> done, undone;
        std::uint64_t used = 0;
    };

    static std::shared_ptr<const Lost> remember(const Scene& scene, NodeId id);
    struct Taking;
    using Renamed = std::unordered_map<std::uint32_t, NodeId>;
    Taking look(const Step& step, std::string_view author) const;
    static std::string whyKept(const Scene& scene, const Item& item, const Taking& taking);
    Result<> carryOut(Scene& scene, Item item, std::string_view author);
    Result<> bringBack(Scene& scene, const Item& item, std::string_view author, Renamed& renamed);
    static void rename(Item& item, const Renamed& renamed);
    void rename(const Renamed& renamed);
    void push(std::deque<Step>& steps, MirrorUpstream permission);
    void forget();

    std::map<std::string, Author, std::less<>> authors_;
    std::vector<Item> pending_;  // of the request at hand
    std::size_t mark_ = 0;       // how many they were before its last change
    std::uint64_t steps_ = 0, bytes_ = 0;
};

}  // namespace rtsg::mirror
