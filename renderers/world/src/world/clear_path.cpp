// ClearPath: the order in which rays meet the surfaces that they pass through.
#include "clear_path.h"

#include <algorithm>
#include <tuple>

namespace rtsg {

void ClearPath::sort(int lane) {
    bvh::RawHit* const hits = passed_.hits[lane];
    const auto key = [](const bvh::RawHit& hit) {
        return std::tuple(hit.t, hit.objectId, hit.geometryId, hit.triangle);
    };
    std::sort(hits, hits + passed_.count[lane],
              [&](const bvh::RawHit& a, const bvh::RawHit& b) { return key(a) < key(b); });
}

}  // namespace rtsg
