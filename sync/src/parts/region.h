// A sphere in the world and what of a scene is in it: the members of a part that a peer asked for by region.
//
// Units (shape_places.h) whose boxes come within the radius enter, and leave when they are farther than the radius and
// its margin, so that what moves at the border does not come and go. What has an effect anywhere is always in. With a
// unit all groups above it are in, and the sensors beside it in these. Threading: one thread.
#pragma once

#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "shape_places.h"

namespace rtsg {

/// As a hello spells it: `region:` and [NAME | x,y,z] radius [margin], with commas between them. Without a centre it is
/// where the viewer is.
struct RegionWish {
    std::string name;  // of the node that is the centre
    bool isFixed = false;
    Vec3d point{0};
    double radius = 0;   // metres, more than 0
    double margin = .1;  // share of the radius, 0 to 10

    static bool isOne(std::string_view part) { return part.starts_with("region:"); }
    /// Error: says what is wrong and how it is spelled.
    static Result<RegionWish> parse(std::string_view part);
};

class Region {
  public:
    explicit Region(RegionWish wish) : wish_(std::move(wish)) {}

    const RegionWish& wish() const { return wish_; }
    /// Nodes that have come in and gone out, in order, by the last step of `places`, or from nothing where that began
    /// anew or `fresh` is true. Precondition: `places` are those of `whole`.
    struct Step {
        bool anew = false;
        std::vector<NodeId> entered, left;
    };
    Step follow(const Scene& whole, const ShapePlaces& places, bool fresh);

  private:
    using PlaceId = ShapePlaces::PlaceId;

    void take(const ShapePlaces& places, PlaceId id);
    void hold(const ShapePlaces& places, PlaceId group);
    void release(const ShapePlaces& places, PlaceId id);
    void count(PlaceId id, std::span<const NodeId> nodes);
    void uncount(PlaceId id);
    void judge(const ShapePlaces& places, PlaceId id);
    void findCentre(const Scene& whole);
    void refer(NodeId id);
    void drop(NodeId id);

    RegionWish wish_;
    std::uint64_t beginning_ = 0;                             // of the places
    bool known_ = false;                                      // there is a centre
    Vec3d centre_{0};                                         // in the world
    std::vector<NodeId> way_;                                 // from the node at the centre up
    std::unordered_map<PlaceId, std::vector<NodeId>> taken_;  // what was counted for each place
    std::unordered_map<PlaceId, std::uint32_t> held_;         // of a group: the units and groups in it that are in
    std::unordered_map<std::uint32_t, std::uint32_t> counts_;
    std::unordered_map<std::uint32_t, bool> touched_;  // whether it was in before this step
    std::vector<PlaceId> near_;
};

}  // namespace rtsg
