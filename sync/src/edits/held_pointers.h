// HeldPointers: remembers which peer each pointer belongs to, so that pointers of a peer that has left can be released.
//
// Invariant: for each pointer of peers that points at or holds something, it knows the peer that sent it last.
// Threading: the scene's thread.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include <rtsg/core/change.h>
#include <rtsg/core/scene.h>

namespace rtsg::mirror {

class HeldPointers {
  public:
    /// Call it when a change of the client's request was carried out or passed on.
    void saw(const Scene& scene, std::uint64_t client, const Change& change);
    /// The events by which the client's pointers release what they hold and leave what they are over. Forgets these
    /// pointers.
    std::vector<Change> leave(const Scene& scene, std::uint64_t client);

  private:
    std::map<std::int32_t, std::uint64_t> clients_;  // by device
};

}  // namespace rtsg::mirror
