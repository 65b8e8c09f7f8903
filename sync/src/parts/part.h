// A part of a scene as a scene of its own: what a peer gets that asked for subtrees or aspects only.
//
// The part holds the root, the subtrees asked for, and the nodes on the way to them, which keep their fields but refer
// to nodes of the part only. Of its nodes it holds the fields that refer to nodes and those of the aspects asked for;
// others have their defaults. Routes are there when both ends are. States have the numbers of the whole scene's, and
// the hash that a scene has that holds just this. Invariant: update by update == made from scratch. A frame that moves
// no node in or out costs what it changes; one that does costs a walk over the part.
//
// A part by region (region.h) holds what is near instead. Its steps cost what changes in it. The lists of its groups
// are in the order of the nodes' numbers: where something stood among what is not there would take a walk along the
// whole list to find out. Threading: one thread.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <unordered_set>
#include <vector>

#include <rtsg/core/scene.h>

#include "region.h"
#include "sockets/message.h"

namespace rtsg {

/// Whether a part is one by region.
inline bool isPartByRegion(const mirror::Wishes& wishes) {
    return !wishes.parts.empty() && RegionWish::isOne(wishes.parts.front());
}

class MirrorPart {
  public:
    /// Why no server follows such a part; nothing if it can.
    static std::optional<std::string> refusalOf(const mirror::Wishes& wishes);
    /// Precondition: there is no refusal.
    explicit MirrorPart(mirror::Wishes wishes);
    /// Null unless it is one by region.
    const RegionWish* region() const { return region_ ? &region_->wish() : nullptr; }
    const Scene& scene() const { return *scene_; }

    /// The part is brought to the state of `whole`, whose last step `set` was; with null, from wherever it is. Returns
    /// the set that does the same to another replica of the part. A part by region needs `places`, which have followed
    /// the same step.
    Result<std::shared_ptr<const ChangeSet>> follow(const Scene& whole, const ChangeSet* set,
                                                    const ShapePlaces* places = nullptr);

  private:
    using Members = std::unordered_set<std::uint32_t>;
    class Links;

    bool holds(NodeId id) const { return members_.contains(id.value); }
    bool wanted(const FieldDef& def) const;
    bool wanted(NodeId node, FieldIndex field, const Scene& whole) const;
    Members membersOf(const Scene& whole) const;
    Value valueOf(const Node& node, FieldIndex field) const;
    /// To have these members. `set` null: everything is compared.
    void compare(const Scene& whole, Members now, const ChangeSet* set, ChangeSet& out);
    void followRegion(const Scene& whole, const ChangeSet* set, const ShapePlaces& places, ChangeSet& out);
    /// A step in which nodes come in, go out or are hung elsewhere.
    void copyRegion(const Scene& whole, const ChangeSet& set, const ShapePlaces& places, const Region::Step& step,
                    ChangeSet& out) const;
    void copyRoutes(const Scene& whole, const ChangeSet& set, const Region::Step& step, ChangeSet& out) const;
    void copyWanted(const Scene& whole, const ChangeSet& set, ChangeSet& out) const;

    mirror::Wishes wishes_;
    std::unique_ptr<Scene> scene_;
    Members members_;
    std::unique_ptr<Region> region_;
};

}  // namespace rtsg
