// Region: a sphere in the world and the nodes within it, for parts that peers ask for by region.
//
// Units (spatial_index.h) enter when their boxes are within the radius. They leave when they are beyond the radius and
// its margin, so that things at the border do not flicker. Units with an effect anywhere are always in. A unit takes
// all groups above it with it, and the sensors beside it in these.
// Threading: one thread.
#pragma once

#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "spatial_index.h"

namespace rtsg {

/// A region in the form of a hello: `region:` and [NAME | x,y,z] radius [margin], separated by commas. Without a centre
/// it is around the viewer.
struct RegionWish {
    std::string name;  // the node at the centre
    bool isFixed = false;
    Vec3d point{0};
    double radius = 0;   // metres, more than 0
    double margin = .1;  // share of the radius, 0 to 10

    static bool isOne(std::string_view part) { return part.starts_with("region:"); }
    /// Error: what is wrong, and the right syntax.
    static Result<RegionWish> parse(std::string_view part);
};

class Region {
  public:
    explicit Region(RegionWish wish) : wish_(std::move(wish)) {}

    const RegionWish& wish() const { return wish_; }
    /// The nodes that entered and left by the last step of `places`, in order; or all nodes if `places` or the region
    /// (`fresh`) began anew. Precondition: `places` are those of `whole`.
    struct Step {
        bool anew = false;
        std::vector<NodeId> entered, left;
    };
    Step follow(const Scene& whole, const SpatialIndex& index, bool fresh);

  private:
    using EntryId = SpatialIndex::EntryId;

    void take(const SpatialIndex& index, EntryId id);
    void hold(const SpatialIndex& index, EntryId group);
    void release(const SpatialIndex& index, EntryId id);
    void count(EntryId id, std::span<const NodeId> nodes);
    void uncount(EntryId id);
    void judge(const SpatialIndex& index, EntryId id);
    void findCentre(const Scene& whole);
    void refer(NodeId id);
    void drop(NodeId id);

    RegionWish wish_;
    std::uint64_t beginning_ = 0;                             // SpatialIndex::beginning() of the places
    bool known_ = false;                                      // there is a centre
    Vec3d centre_{0};                                         // in the world
    std::vector<NodeId> chain_;                               // from the node at the centre upwards
    std::unordered_map<EntryId, std::vector<NodeId>> taken_;  // the nodes counted for each place
    std::unordered_map<EntryId, std::uint32_t> held_;         // by group: how many of its units and groups are in
    std::unordered_map<std::uint32_t, std::uint32_t> counts_;
    std::unordered_map<std::uint32_t, bool> touched_;  // whether the node was in before this step
    std::vector<EntryId> near_;
};

}  // namespace rtsg
