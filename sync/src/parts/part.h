// MirrorPart: a part of a scene as a scene of its own, for a peer that asked for subtrees or aspects only.
//
// The part holds the root, the subtrees asked for, and the nodes on the way to them. These keep their fields, but refer
// only to nodes of the part. Fields that refer to nodes and those of the aspects asked for have their values; others
// have their defaults. Routes are there if both ends are. State numbers are the whole scene's; the hash is that of a
// scene that holds just this.
// Invariant: following step by step gives the same as building the part anew. A frame that moves no node in or out
// costs what it changes; another one costs a walk over the part.
//
// A part by region (region.h) holds what is near. Its steps cost what changes in it. The lists of its groups are
// ordered by node number, because the scene's order would cost a walk along the whole list.
// Threading: one thread.
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

/// True if the part is a region.
inline bool isPartByRegion(const mirror::Wishes& wishes) {
    return !wishes.parts.empty() && RegionWish::isOne(wishes.parts.front());
}

class MirrorPart {
  public:
    /// Why no server can follow such a part. Empty if it can.
    static std::optional<std::string> refusalOf(const mirror::Wishes& wishes);
    /// Precondition: refusalOf() is empty.
    explicit MirrorPart(mirror::Wishes wishes);
    /// Null unless the part is a region.
    const RegionWish* region() const { return region_ ? &region_->wish() : nullptr; }
    const Scene& scene() const { return *scene_; }

    /// Brings the part to the state of `whole`, whose last step was `set`; with null, from any state. Returns the set
    /// that does the same to another replica of the part. A region needs `places` that have followed the same step.
    Result<std::shared_ptr<const ChangeSet>> follow(const Scene& whole, const ChangeSet* set,
                                                    const SpatialIndex* index = nullptr);

  private:
    using Members = std::unordered_set<std::uint32_t>;
    class Links;

    bool holds(NodeId id) const { return members_.contains(id.value); }
    bool wanted(const FieldDef& def) const;
    bool wanted(NodeId node, FieldIndex field, const Scene& whole) const;
    Members membersOf(const Scene& whole) const;
    Value valueOf(const Node& node, FieldIndex field) const;
    /// Gives the part these members. With `set` null everything is compared.
    void compare(const Scene& whole, Members now, const ChangeSet* set, ChangeSet& out);
    void followRegion(const Scene& whole, const ChangeSet* set, const SpatialIndex& index, ChangeSet& out);
    /// For a step in which nodes enter, leave or get another parent.
    void copyRegion(const Scene& whole, const ChangeSet& set, const SpatialIndex& index, const Region::Step& step,
                    ChangeSet& out) const;
    void copyRoutes(const Scene& whole, const ChangeSet& set, const Region::Step& step, ChangeSet& out) const;
    void copyWanted(const Scene& whole, const ChangeSet& set, ChangeSet& out) const;

    mirror::Wishes wishes_;
    std::unique_ptr<Scene> scene_;
    Members members_;
    std::unique_ptr<Region> region_;
};

}  // namespace rtsg
