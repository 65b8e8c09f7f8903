// Finds triangles near a point: from the tree over everything into Embree's point queries.
#include "top.h"

namespace rtsg::bvh {

namespace {

struct Search {
    const NearVisitor& visit;
    const TopView& top;
    const TopObject& object;
    std::uint32_t index;  // of the object
    float radius;         // in ray space
    float localFromRay;  // factor that makes a distance in ray space one that is at least as long in the object's frame
    float localMargin;
};

float localRadius(const Search& search) {
    return search.radius * search.localFromRay + search.localMargin;
}

bool onTriangle(RTCPointQueryFunctionArguments* arguments) {
    auto& search = *static_cast<Search*>(arguments->userPtr);
    const std::uint32_t slot = search.object.slotOf(arguments->geomID);
    if (search.top.ownerOf(slot) != search.index) return false;  // hidden
    const LongTriangles* cut = search.object.cuts ? search.object.cuts[arguments->geomID] : nullptr;
    const float radius = search.visit(slot, cut ? cut->triangleOf(arguments->primID) : arguments->primID);
    if (!(radius < search.radius)) return false;
    search.radius = radius;
    arguments->query->radius = localRadius(search);
    return true;
}

}  // namespace

void TopView::visitNear(const Vec3f& center, float radius, const NearVisitor& visit) const {
    const auto ask = [&](const TopObject& object, std::uint32_t index) {
        Search search{visit, *this, object, index, radius, 1, 0};
        Vec3f local = center;
        if (!object.resting) {
            const glm::mat3& m = object.localFromRay;
            const Vec3f relative = center - object.translation;
            local = m * relative;
            // The Frobenius norm: no vector grows by more.
            search.localFromRay = std::sqrt(glm::dot(m[0], m[0]) + glm::dot(m[1], m[1]) + glm::dot(m[2], m[2]));
            search.localMargin =
                0x1p-20f * search.localFromRay *
                (std::abs(relative.x) + std::abs(relative.y) + std::abs(relative.z) + std::abs(object.translation.x) +
                 std::abs(object.translation.y) + std::abs(object.translation.z));
        }
        RTCPointQuery query;
        query.x = local.x, query.y = local.y, query.z = local.z;
        query.time = 0;
        query.radius = localRadius(search);
        RTCPointQueryContext context;
        rtcInitPointQueryContext(&context);
        rtcPointQuery(object.scene, &query, &context, onTriangle, &search);
        radius = search.radius;
    };
    if (main_) ask(*main_, mainObject_);
    tree_.traverseNear(center, radius, [&](std::uint32_t index) {
        ask(object(index), index);
        return radius;
    });
}

}  // namespace rtsg::bvh
