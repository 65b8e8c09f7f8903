// Affine matrices in double precision, and emptying a delta.
#include <rtsg/renderers/instance_delta.h>

#include <cmath>

namespace rtsg {

int determinantSign(const WorldFromLocal& m) {
    const double determinant = glm::dot(m[0], glm::cross(m[1], m[2]));
    const double size = glm::length(m[0]) * glm::length(m[1]) * glm::length(m[2]);
    if (!(std::abs(determinant) > 1e-12 * size) || !isFinite(m)) return 0;  // the negation catches NaN
    return determinant > 0 ? 1 : -1;
}

WorldFromLocal compose(const WorldFromLocal& a, const WorldFromLocal& b) {
    WorldFromLocal r;
    for (int i = 0; i < 4; ++i) r[i] = a[0] * b[i].x + a[1] * b[i].y + a[2] * b[i].z;
    r[3] += a[3];
    return r;
}

WorldFromLocal identityTransform() {
    return WorldFromLocal(1.0);
}

bool isFinite(const WorldFromLocal& m) {
    double sum = 0;
    for (int i = 0; i < 4; ++i) sum += (m[i].x - m[i].x) + (m[i].y - m[i].y) + (m[i].z - m[i].z);
    return sum == 0;  // Inf - Inf and NaN - NaN are NaN
}

bool InstanceDelta::empty() const {
    return scopes.empty() && removed.empty() && added.empty() && moved.empty() && rebound.empty() &&
           geometries.empty() && geometriesRemoved.empty() && appearanceChanged.empty() && acousticsChanged.empty() &&
           placedRemoved.empty() && placedAdded.empty() && placedMoved.empty() && placedRebound.empty() &&
           placedChanged.empty();
}

void InstanceDelta::clear() {
    scopes.clear(), removed.clear(), added.clear(), moved.clear(), rebound.clear();
    geometries.clear(), geometriesRemoved.clear(), appearanceChanged.clear(), acousticsChanged.clear();
    placedRemoved.clear(), placedAdded.clear(), placedMoved.clear(), placedRebound.clear(), placedChanged.clear();
}

}  // namespace rtsg
