// Cuts one polygon into triangles: a fan if it is convex, otherwise by GLU's tessellator.
#include <algorithm>

#include "glu.h"
#include "tessellate_detail.h"

namespace rtsg::detail {

namespace {

/// Twice the area vector; independent of the origin only for closed polygons, so it is taken from the first point.
Vec3d newellNormal(std::span<const Vec3f> points) {
    const Vec3d origin(points[0]);
    Vec3d normal(0);
    for (std::size_t i = 1; i + 1 < points.size(); ++i)
        normal += glm::cross(Vec3d(points[i]) - origin, Vec3d(points[i + 1]) - origin);
    return normal;
}

constexpr std::size_t kLongestOutlineForGlu = 30000;

double orientation(Vec2d a, Vec2d b, Vec2d c) {
    return (b.x - a.x) * (c.y - b.y) - (b.y - a.y) * (c.x - b.x);
}

/// Left turns only, and once around: a star turns left at each corner too, but changes its direction more often.
bool isConvex(std::span<const Vec2d> p) {
    const std::size_t n = p.size();
    int signChanges = 0;
    double lastSign = 0;
    for (std::size_t pass = 0; pass < 2; ++pass)
        for (std::size_t i = 0; i < n; ++i) {
            const double dx = p[(i + 1) % n].x - p[i].x;
            if (dx == 0.0) continue;
            if (pass == 1 && lastSign * dx < 0) ++signChanges;
            lastSign = dx;
        }
    if (signChanges > 2) return false;
    for (std::size_t i = 0; i < n; ++i)
        if (orientation(p[i], p[(i + 1) % n], p[(i + 2) % n]) < -1e-9) return false;
    return true;
}

struct CutState {
    std::span<const Vec2d> points;
    std::vector<std::array<int, 3>>* triangles = nullptr;
    std::array<int, 3> current{};
    int filled = 0;
    bool crossing = false, failed = false;
};

using Callback = void (*)();

// A corner travels through the library as its number plus one, which is never null.
void* toPointer(int corner) {
    return reinterpret_cast<void*>(static_cast<std::uintptr_t>(corner) + 1);  // NOLINT: GLU's cookie, never followed
}
int toCorner(void* pointer) {
    return static_cast<int>(reinterpret_cast<std::uintptr_t>(pointer) - 1);
}

void onVertex(void* vertex, void* user) {
    auto& state = *static_cast<CutState*>(user);
    state.current[static_cast<std::size_t>(state.filled++)] = toCorner(vertex);
    if (state.filled < 3) return;
    state.filled = 0;
    const auto [a, b, c] = state.current;
    if (a != b && b != c && c != a) state.triangles->push_back(state.current);
}

// Called for coincident corners (a hole joined by a bridge, say) and for true crossings, which X3D forbids: those
// are moved to the nearest corner and reported.
void onCombine(GLdouble at[3], void* corners[4], GLfloat*, void** out, void* user) {
    auto& state = *static_cast<CutState*>(user);
    double best = std::numeric_limits<double>::infinity();
    *out = corners[0];
    for (int i = 0; i < 4; ++i) {
        if (!corners[i]) continue;
        const Vec2d d = state.points[static_cast<std::size_t>(toCorner(corners[i]))] - Vec2d(at[0], at[1]);
        if (const double distance = glm::dot(d, d); distance < best) {
            best = distance;
            *out = corners[i];
        }
    }
    if (!(best < 1e-12)) state.crossing = true;
}

void onError(GLenum, void* user) {
    static_cast<CutState*>(user)->failed = true;
}
void onEdgeFlag(GLboolean, void*) {}  // its presence makes the library emit separate triangles only

}  // namespace

PolygonCutter::~PolygonCutter() {
    if (tessellator_) gluDeleteTess(static_cast<GLUtesselator*>(tessellator_));
}

PolygonCutter::Outcome PolygonCutter::cut(std::span<const Vec3f> points, std::vector<std::array<int, 3>>& triangles) {
    triangles.clear();
    const std::size_t n = points.size();
    if (n < 3) return Outcome::degenerate;
    if (n == 3) {
        triangles.push_back({0, 1, 2});
        return Outcome::good;
    }
    const Vec3d normal = newellNormal(points);
    const double length = glm::length(normal);
    if (!(length > 0.0) || !std::isfinite(length)) return Outcome::degenerate;

    // Onto the polygon's plane, scaled to unit size. Corners at the place of the one before have no edge: they are left
    // out, whatever their number says.
    const Vec3d z = normal / length;
    const Vec3d helper = std::abs(z.x) < 0.6 ? Vec3d(1, 0, 0) : Vec3d(0, 1, 0);
    const Vec3d x = glm::normalize(glm::cross(helper, z)), y = glm::cross(z, x);
    double extent = 0;
    flat_.clear();
    kept_.clear();
    for (std::size_t i = 0; i < n; ++i) {
        if (points[i] == points[i == 0 ? n - 1 : i - 1]) continue;
        const Vec3d d = Vec3d(points[i]) - Vec3d(points[0]);
        flat_.emplace_back(glm::dot(d, x), glm::dot(d, y));
        kept_.push_back(static_cast<int>(i));
        extent = std::max({extent, std::abs(flat_.back().x), std::abs(flat_.back().y)});
    }
    if (flat_.size() < 3 || !(extent > 0.0)) return Outcome::degenerate;
    for (Vec2d& p : flat_) p /= extent;
    const Outcome outcome = cutFlat(triangles);
    if (kept_.size() < n)
        for (auto& triangle : triangles)
            for (int& corner : triangle) corner = kept_[static_cast<std::size_t>(corner)];
    return outcome;
}

PolygonCutter::Outcome PolygonCutter::cutFlat(std::vector<std::array<int, 3>>& triangles) {
    const auto n = static_cast<int>(flat_.size());
    const auto fan = [&](int apex) {
        for (int i = 1; i + 1 < n; ++i) triangles.push_back({apex, (apex + i) % n, (apex + i + 1) % n});
    };
    if (isConvex(flat_)) {
        fan(0);
        return Outcome::good;
    }
    if (n == 4) {
        // One reflex corner: the diagonal from it is inside. Two: the sides cross.
        int reflex = -1, count = 0;
        for (int i = 0; i < 4; ++i)
            if (orientation(flat_[static_cast<std::size_t>((i + 3) % 4)], flat_[static_cast<std::size_t>(i)],
                            flat_[static_cast<std::size_t>((i + 1) % 4)]) < 0) {
                reflex = i;
                ++count;
            }
        fan(std::max(reflex, 0));
        return count == 1 ? Outcome::good : Outcome::selfIntersecting;
    }
    if (cutSimplePolygon(flat_, triangles)) return Outcome::good;
    // Its sweep keeps the active edges in a list: an outline of this size could take minutes.
    if (flat_.size() > kLongestOutlineForGlu) return Outcome::tooLong;
    return cutConcave(flat_, triangles);
}

PolygonCutter::Outcome PolygonCutter::cutConcave(std::span<const Vec2d> points,
                                                 std::vector<std::array<int, 3>>& triangles) {
    if (!tessellator_) {
        GLUtesselator* fresh = newTessellator();
        if (!fresh) return Outcome::degenerate;
        gluTessCallback(fresh, GLU_TESS_VERTEX_DATA, reinterpret_cast<Callback>(onVertex));
        gluTessCallback(fresh, GLU_TESS_COMBINE_DATA, reinterpret_cast<Callback>(onCombine));
        gluTessCallback(fresh, GLU_TESS_ERROR_DATA, reinterpret_cast<Callback>(onError));
        gluTessCallback(fresh, GLU_TESS_EDGE_FLAG_DATA, reinterpret_cast<Callback>(onEdgeFlag));
        gluTessProperty(fresh, GLU_TESS_WINDING_RULE, GLU_TESS_WINDING_ODD);
        tessellator_ = fresh;
    }
    auto* tessellator = static_cast<GLUtesselator*>(tessellator_);
    CutState state{.points = points, .triangles = &triangles};
    gluTessNormal(tessellator, 0, 0, 1);
    gluTessBeginPolygon(tessellator, &state);
    gluTessBeginContour(tessellator);
    for (std::size_t i = 0; i < points.size(); ++i) {
        GLdouble at[3] = {points[i].x, points[i].y, 0};
        gluTessVertex(tessellator, at, toPointer(static_cast<int>(i)));
    }
    gluTessEndContour(tessellator);
    gluTessEndPolygon(tessellator);
    if (state.failed) triangles.clear();
    if (triangles.empty()) return Outcome::degenerate;
    return state.crossing ? Outcome::selfIntersecting : Outcome::good;
}

}  // namespace rtsg::detail
