// The links of a node besides its fields: routes from it and to it, its name, and parents beyond the first.
//
// Most nodes have none of them, and pay only a pointer. Threading: the scene's thread; see lane.h for others.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include <rtsg/core/scene.h>

#include "route_list.h"

namespace rtsg {

struct OutgoingRoute {
    RouteTarget to;
    std::size_t hash() const {
        return (std::uint64_t{to.node.value} << 17 ^ std::uint64_t{to.field} << 1 ^ (to.isConnection ? 1u : 0u)) *
               0x9E3779B97F4A7C15ull;
    }
    friend bool operator==(const OutgoingRoute&, const OutgoingRoute&) = default;
};

struct RouteGroup {
    FieldIndex field = kNoField;
    std::uint32_t listeners = 0;  // who wants to hear of its events besides; the group stays for them
    std::uint64_t stamp = 0;      // timestamp at which the field last sent: at most one event each (4.4.8.3)
    std::uint64_t gone = 0;       // at which its event went along the routes: it says the last value until then
    FewRoutes<OutgoingRoute> targets;
};

/// A node's groups, the first of them in place, so that with one route all that an event needs is in a cache line.
class RouteGroups {
  public:
    RouteGroups() = default;
    RouteGroups(const RouteGroups&) = delete;
    RouteGroups& operator=(const RouteGroups&) = delete;
    RouteGroup* begin() { return first_; }
    RouteGroup* end() { return first_ + count_; }
    const RouteGroup* begin() const { return first_; }
    const RouteGroup* end() const { return first_ + count_; }
    bool empty() const { return count_ == 0; }
    RouteGroup& add(FieldIndex field);
    void erase(RouteGroup* group);

  private:
    RouteGroup* first_ = &own_;
    std::uint32_t count_ = 0, room_ = 1;
    RouteGroup own_;
    std::unique_ptr<RouteGroup[]> more_;  // all of them, once there have been two
};

struct IncomingRoute {
    NodeId from;
    FieldIndex fromField = kNoField, toField = kNoField;
    bool isConnection = false;
    std::size_t hash() const {
        return ((std::uint64_t{from.value} << 32 | std::uint64_t{fromField} << 16 | toField) ^
                (isConnection ? 1u : 0u)) *
               0x9E3779B97F4A7C15ull;
    }
    friend bool operator==(const IncomingRoute&, const IncomingRoute&) = default;
};

/// Parents beyond the first: a multiset of (node, field) with constant-time removal, however many there are.
class ParentList {
  public:
    void add(ParentRef parent);
    bool remove(ParentRef parent);
    bool empty() const { return few_.empty() && !many_; }
    /// Precondition: !empty().
    ParentRef takeAny();
    void appendTo(std::vector<ParentRef>& out) const;

  private:
    static constexpr std::size_t kFew = 32;  // beyond this, hashing beats a linear search
    static std::uint64_t key(ParentRef p) { return std::uint64_t{p.node.value} << 16 | p.field; }
    static ParentRef fromKey(std::uint64_t k) {
        return {NodeId{static_cast<std::uint32_t>(k >> 16)}, static_cast<FieldIndex>(k & 0xFFFF)};
    }
    std::vector<ParentRef> few_;
    using Counts = std::unordered_map<std::uint64_t, std::uint32_t>;
    std::unique_ptr<Counts> many_;  // to the number of times; used instead of few_, never empty
};

/// Links lie in memory of their own, in the order in which nodes got them: an event finds the next ones beside its own,
/// however fragmented the heap is when a scene is loaded.
struct alignas(64) Node::Links {
    RouteGroups out;
    FewRoutes<IncomingRoute> in;
    String name;
    ParentList parents;
    bool empty() const { return name.empty() && parents.empty() && out.empty() && in.empty(); }
    /// Null if nobody hears of the field.
    RouteGroup* outOf(FieldIndex field) {
        for (RouteGroup& group : out)
            if (group.field == field) return &group;
        return nullptr;
    }
    static std::uint16_t heardBit(FieldIndex field) { return static_cast<std::uint16_t>(1u << (field & 15u)); }
    bool hasRoutes() const {
        return !in.empty() || std::ranges::any_of(out, [](const RouteGroup& group) { return !group.targets.empty(); });
    }
};

}  // namespace rtsg
