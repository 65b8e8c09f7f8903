// EditHistory: knows how to take back what each author has done to a scene, request by request.
//
// Invariant: taking back never undoes what somebody else did. It leaves alone, and names, nodes that are gone, fields
// with another value than the request left, and new nodes that others have worked on. An undone request can be done
// again until its author does something new. A request of which nothing can be taken back is passed over from then on,
// until its author's values stand again, since others have taken theirs back. A destroyed node comes back under a new
// number, which the whole history then uses. Events are not taken back, because their consequences are the scene's own.
// Memory is bounded: the oldest requests are forgotten. Threading: the scene's thread, between frames.
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
    static constexpr std::size_t kMaxSteps = 1000;  // for each author, in each direction
    static constexpr std::size_t kMaxPassed = 16;
    static constexpr std::size_t kMaxAuthors = 256;
    static constexpr std::uint64_t kMaxBytes = std::uint64_t{64} << 20;  // for all together

    /// Call it before a change of the present request is carried out. All nodes exist then, except one that the change
    /// creates.
    void before(const Scene& scene, const Change& change);
    /// Call it when the change is done. `created` is the number of a node that it created.
    void after(const Scene& scene, NodeId created = {});
    /// Call it instead if the change failed.
    void failed() { pending_.resize(mark_); }
    /// Ends the request, which becomes one step of its author. `permission` is what the request needed.
    void end(std::string_view author, MirrorUpstream permission);

    /// Takes back the author's last step, or with `again` does again what was last taken back. The edits are attributed
    /// to the author and not sealed. Returns what was left unchanged, and why. Error: nothing was done.
    Result<std::string> takeBack(Scene& scene, std::string_view author, bool again, MirrorUpstream permission,
                                 const NodeLocks& locks);

  private:
    /// A destroyed node as it was.
    struct Lost {
        TypeIndex type;
        std::string name;
        std::vector<std::pair<FieldIndex, Value>> fields;
        std::vector<Change> links;  // insertChild and setField of its parents
        std::vector<Route> routes;
    };
    struct Item {
        Change back;  // the change that takes it back
        Value left;   // the value of the field or name after the request, or the child's count: tells whether others
                      // have changed it
        std::shared_ptr<const Lost> lost;  // with createNode: the node that comes back
        bool cameBack = false;  // with destroyNode: the node had been destroyed before and was still in the scene
    };
    struct Step {
        std::vector<Item> items;
        std::uint64_t number = 0, bytes = 0;
        MirrorUpstream permission = MirrorUpstream::edits;
        bool passed = false;  // nothing of it could be taken back when its author asked
    };
    using Steps = std::deque<Step>;
    struct Author {
        Steps done, undone;
        std::uint64_t used = 0;
    };

    static std::shared_ptr<const Lost> remember(const Scene& scene, NodeId id);
    struct Taking;
    using Renamed = std::unordered_map<std::uint32_t, NodeId>;
    Taking look(const Step& step, std::string_view author) const;
    Steps::iterator choose(const Scene& scene, Steps& from, std::string_view author);
    void giveBack(Steps& from, Step step);
    static std::string whyKept(const Scene& scene, const Item& item, const Taking& taking);
    Result<> carryOut(Scene& scene, Item item, std::string_view author);
    Result<> bringBack(Scene& scene, const Item& item, std::string_view author, Renamed& renamed);
    static void rename(Item& item, const Renamed& renamed);
    void rename(const Renamed& renamed);
    void push(std::deque<Step>& steps, MirrorUpstream permission);
    void forget();

    std::map<std::string, Author, std::less<>> authors_;
    std::vector<Item> pending_;  // of the present request
    std::size_t mark_ = 0;       // their number before its last change
    std::uint64_t steps_ = 0, bytes_ = 0;
};

}  // namespace rtsg::mirror
