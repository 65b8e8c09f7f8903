// Which peer's pointer is which, so that one whose peer is gone lets go of what it held.
//
// Invariant: of each pointer that peers have sent and that points or holds, the peer that sent it last is known.
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
    /// A change of a request of that client has been carried out, or sent on.
    void saw(const Scene& scene, std::uint64_t client, const Change& change);
    /// The events by which the client's pointers let go and are over nothing; forgets them.
    std::vector<Change> leave(const Scene& scene, std::uint64_t client);

  private:
    std::map<std::int32_t, std::uint64_t> clients_;  // of devices
};

}  // namespace rtsg::mirror
