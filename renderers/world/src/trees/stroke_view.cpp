// Rays among lines and points. Queries neither allocate nor lock.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <utility>

#include "strokes.h"

namespace rtsg::bvh {

using namespace simd;

// ---- cones and boxes ----------------------------------------------------------------------------------------------

namespace {

/// One or more rays, as a cone: at distance t from `origin` the rays and their possible hits are within reach + growth
/// t.
struct Cone {
    Vec3f origin, direction;  // in a tree's frame
    Vec3f reach, growth;      // by axis
    float start, end;

    /// In the frame that has its origin there; `lengths`: of the rows of the matrix that leads to it.
    Cone in(const Vec3f& there, const glm::mat3& toFrame, const Vec3f& lengths) const {
        return {toFrame * (origin - there), toFrame * direction, reach * lengths, growth * lengths, start, end};
    }
};

constexpr float kSmallDirection = 1e-18f;
float safeReciprocal(float d) {
    return 1 / (std::abs(d) < kSmallDirection ? std::copysign(kSmallDirection, d) : d);
}

/// A box's planes, each moved outwards as fast as the cone grows; met at t = (plane - offset) * inverse. Planes that a
/// ray passes on its way in make the start later, those on its way out make the end earlier; if the cone grows faster
/// than it comes nearer, both planes of an axis may be on the way in.
struct Slabs {
    float offset[6], inverse[6];
    bool entry[6];
    explicit Slabs(const Cone& c) {
        for (int k = 0; k < 3; ++k) {
            offset[k] = c.origin[k] + c.reach[k], inverse[k] = safeReciprocal(c.direction[k] + c.growth[k]);
            offset[3 + k] = c.origin[k] - c.reach[k], inverse[3 + k] = safeReciprocal(c.direction[k] - c.growth[k]);
            entry[k] = inverse[k] > 0, entry[3 + k] = inverse[3 + k] < 0;
        }
    }
    /// A bit per child that may be met, and from where.
    std::uint32_t meet(const TreeView::Node& n, float start, float end, F8& near) const {
        near = all(start);
        F8 far = all(end);
        const float* planes = &n.bounds[0][0][0];
        for (int i = 0; i < 6; ++i) {
            const F8 t = (load(planes + 8 * i) - offset[i]) * inverse[i];
            if (entry[i])
                near = max(near, t);
            else
                far = min(far, t);
        }
        near *= TreeView::kCloser;
        return simd::laneBits(near <= far * TreeView::kFarther);
    }
};

/// Calls leaf(child) for those that the cone may meet, roughly from near to far; it returns the cone's new end, a
/// negative one to stop.
template <class NodeOf, class Leaf>
void traverseCone(const Cone& cone, NodeOf nodeOf, Leaf leaf) {
    const Slabs slabs(cone);
    float end = cone.end;
    std::array<std::uint64_t, TreeView::kStack> stack;
    std::size_t top = 0;
    std::uint32_t current = TreeView::kRoot;
    alignas(32) float nears[8];
    for (;;) {
        if (current & TreeView::kLeaf) {
            end = leaf(current);
            if (end < 0) return;
        } else {
            const TreeView::Node& n = nodeOf(current);
            F8 near;
            std::uint32_t mask = slabs.meet(n, cone.start, end, near);
            for (int i = 0; i < 8; ++i) mask &= ~(static_cast<std::uint32_t>(n.child[i] == TreeView::kNone) << i);
            if (mask) {
                store(nears, near);
                const auto next = [&] {
                    const auto i = static_cast<std::uint32_t>(std::countr_zero(mask));
                    mask &= mask - 1;
                    return std::uint64_t{std::bit_cast<std::uint32_t>(nears[i])} << 32 | n.child[i];
                };
                std::uint64_t best = next();
                while (mask) {  // NOLINT(bugprone-infinite-loop): next() takes a bit out
                    const std::uint64_t other = next();
                    stack[top++] = std::max(best, other);
                    best = std::min(best, other);
                }
                current = static_cast<std::uint32_t>(best);
                continue;
            }
        }
        const std::uint64_t last = std::uint64_t{std::bit_cast<std::uint32_t>(end)} << 32 | 0xFFFFFFFF;
        do {
            if (top == 0) return;
            --top;
        } while (stack[top] > last);
        current = static_cast<std::uint32_t>(stack[top]);
    }
}

// ---- rays and strokes ---------------------------------------------------------------------------------------------

V8 broadcast(const Vec3f& v) {
    return {all(v.x), all(v.y), all(v.z)};
}

/// The space in which a lens' pixels are square: the eye's own, if the lens knows it, else ray space.
struct Square {
    bool isRaySpace = true;
    glm::mat3 fromRay{1.0f}, toRay{1.0f}, normalFromRay{1.0f};
    Vec3f rows{1};      // lengths of those of toRay
    float longest = 1;  // no step of 1 is longer in ray space

    explicit Square(const PixelLens& lens) {
        if (!lens.toSquare) return;
        isRaySpace = false;
        fromRay = *lens.toSquare;
        const glm::dmat3 inverse = glm::inverse(glm::dmat3(fromRay));
        toRay = glm::mat3(inverse), normalFromRay = glm::mat3(glm::transpose(inverse));
        rows = rowLengths(toRay);
        longest = glm::length(rows);
    }
    V8 of(const V8& v) const {
        if (isRaySpace) return v;
        return broadcast(fromRay[0]) * v.x + broadcast(fromRay[1]) * v.y + broadcast(fromRay[2]) * v.z;
    }
    /// How far the farthest corner of a box is from a point at most; both in ray space.
    float farthest(const Vec3f& lower, const Vec3f& upper, const Vec3f& from) const {
        const Vec3f far = glm::max(glm::abs(lower - from), glm::abs(upper - from));
        if (isRaySpace) return glm::length(far);
        return glm::length(glm::abs(fromRay[0]) * far.x + glm::abs(fromRay[1]) * far.y + glm::abs(fromRay[2]) * far.z);
    }
};

/// The data that eight pairs of a ray and a stroke share.
struct Width {
    V8 eye, forward;
    float spreadSquared, sizeSquared;
    const StrokeStyle* attenuated = nullptr;
    float halfWidth;
    float spread, size;
    bool isSquare;  // points, in the eye's own space

    Width(const PixelLens& lens, const Square& square, const StrokeObject& o)
        : eye(broadcast(square.fromRay * lens.eye)),
          forward(broadcast(square.isRaySpace ? lens.forward : Vec3f(0, 0, -1))),
          spreadSquared(lens.spread * lens.spread),
          sizeSquared(lens.size * lens.size),
          halfWidth(o.halfWidth),
          spread(lens.spread),
          size(lens.size),
          isSquare(o.isPoints && !square.isRaySpace) {
        if (o.isPoints && o.style && o.style->attenuated()) attenuated = o.style.get();
    }
    /// Half, in pixels, squared; `distance` from the eye.
    F8 halfSquared(F8 distance) const {
        if (!attenuated) return all(halfWidth * halfWidth);
        const StrokeStyle& s = *attenuated;
        const F8 fall = s.attenuation.x + distance * (s.attenuation.y + distance * s.attenuation.z);
        const F8 half = .5f * min(max(s.pointSize / max(fall, all(1e-6f)), all(s.minimum)), all(s.maximum));
        return half * half;
    }
};

/// Whether a line of this type is there after so many pixels from its start. Each stroke begins its pattern anew.
bool isDrawn(std::int32_t type, float pixels, float width) {
    const float unit = std::max(width, 1.0f);
    const auto within = [&](std::initializer_list<float> pattern) {
        float length = 0;
        for (const float part : pattern) length += part;
        float at = std::fmod(pixels / unit, length);
        bool on = true;
        for (const float part : pattern) {
            if (at < part) return on;
            at -= part, on = !on;
        }
        return on;
    };
    switch (type) {
        case 2:
            return within({8, 4});
        case 3:
            return within({2, 4});
        case 4:
            return within({8, 4, 2, 4});
        case 5:
            return within({8, 4, 2, 4, 2, 4});
        default:
            return true;
    }
}

struct Met {
    I8 hit;
    F8 t, u;
    F8 pixel;  // metres, where it was met

    /// Removes the parts in the gaps of a line of that length, width and type; false: all of it.
    bool keepDrawn(std::int32_t type, float length, float width) {
        for (int k = 0; k < 8; ++k)
            if (hit[k] && !isDrawn(type, u[k] * length / pixel[k], width)) hit[k] = 0;
        return any(hit);
    }
};

/// The point on an axis that is nearest to a ray in pixels: with the smallest quotient of distance and depth. Both
/// change linearly along the axis, so it is the nearest point in a plane onto which all of it is projected. It cannot
/// be at or behind the eye; an axis that begins there is cut off just before.
F8 nearestInPicture(const V8& apartA, const V8& apartB, F8 depthA, F8 depthB) {
    constexpr float kCut = 1e-4f;
    const F8 minimum = kCut * max(depthA, depthB), difference = depthB - depthA;
    const F8 first = select(depthA < minimum, (minimum - depthA) / difference, all(0));
    const F8 last = select(depthB < minimum, (minimum - depthA) / difference, all(1));
    const V8 along = apartB - apartA;
    const F8 z0 = 1.0f / (depthA + first * difference), z1 = 1.0f / (depthA + last * difference);
    const V8 p0 = (apartA + along * first) * z0, distance = (apartA + along * last) * z1 - p0;
    const F8 square = dot(distance, distance);
    const F8 v = select(square > 1e-30f, min(max(-dot(p0, distance) / square, all(0)), all(1)), all(0));
    // Back from the plane: the middle there is nearer to the nearer end.
    return first + (last - first) * (v * z1) / max(z0 * (1.0f - v) + z1 * v, all(1e-30f));
}

/// Whether eight rays meet the squares around eight points, in the eye's own space, and where. A ray along an edge
/// meets the square to its left, or below. `isOwn`: of which rays this is true, as they are the picture's own.
Met meetSquares(const V8& o, const V8& d, const V8& points, const Width& width, I8& isOwn) {
    constexpr float kBeside = .02f;       // pixels: rays may have gone straight through something
    constexpr float kEdge = 1.0f / 2048;  // pixels: more than roundings, so that a point between two pixels is in one
                                          // of them
    const V8 from = points - width.eye, start = o - width.eye;
    const I8 isAhead = d.z < 0.0f;
    const F8 inverse = -1.0f / select(isAhead, d.z, all(-1));
    const F8 depth = -from.z, t = (depth + start.z) * inverse;
    F8 pixel = all(width.size), besideX = d.x * inverse, besideY = d.y * inverse, maximum = all(1e-4f);
    if (width.spread > 0) {
        pixel = width.spread * depth, maximum = kBeside * pixel;
        besideX = start.x + besideX * start.z, besideY = start.y + besideY * start.z;
    }
    isOwn = isAhead & (depth > 0.0f) & (besideX * besideX + besideY * besideY <= maximum * maximum);
    const F8 far = sqrt(dot(from, from)), half = sqrt(width.halfSquared(far)) * pixel, edge = kEdge * pixel;
    const F8 x = start.x + d.x * t - from.x - edge, y = start.y + d.y * t - from.y - edge;
    const F8 tie = kTie * (sqrt(dot(o, o)) + sqrt(dot(points, points)) + far);
    return {(x >= -half) & (x < half) & (y >= -half) & (y < half), t - tie / sqrt(dot(d, d)), all(0), pixel};
}

/// Meets eight rays with eight strokes, pair by pair. Rays that lead forwards or backwards meet a stroke at its axis'
/// depth, as if it were a ribbon that faces the eye; other rays meet it at their place nearest to its axis.
Met meet(const V8& o, const V8& d, const V8& a, const V8& b, const Width& width) {
    Met square{};
    I8 isOwn{};
    if (width.isSquare) {
        square = meetSquares(o, d, a, width, isOwn);
        if (!any(~isOwn)) return square;
    }
    const V8 toA = a - o, along = b - a;
    const F8 dd = 1.0f / dot(d, d), da = dot(d, toA), dw = dot(d, along), ww = dot(along, along);
    // The place on the axis that the ray's line comes nearest to.
    const F8 den = ww - dw * dw * dd, num = da * dw * dd - dot(toA, along);
    F8 u = select(den > 1e-12f * ww, min(max(num / den, all(0)), all(1)), all(0));
    if (width.spreadSquared > 0) {
        const F8 depthA = dot(a - width.eye, width.forward), depthB = dot(b - width.eye, width.forward);
        const V8 fromEye = o - width.eye;
        const I8 both = (depthA > 0.0f) & (depthB > 0.0f);
        // For strokes across the eye's plane, only rays that start at the eye count by the picture: other rays may see
        // all of the stroke.
        const I8 some = ((depthA > 0.0f) | (depthB > 0.0f)) & (dot(fromEye, fromEye) < 1e-12f * dot(toA, toA));
        const F8 alongB = (da + dw) * dd;
        const F8 seen = nearestInPicture(toA - d * (da * dd), toA + along - d * alongB, depthA, depthB);
        u = select(both | some, min(max(seen, all(0)), all(1)), u);
    }
    const F8 axis = (da + u * dw) * dd;
    const V8 apart = toA + along * u - d * axis, position = a + along * u, from = position - width.eye;
    const F8 beside = dot(apart, apart), lean = dot(apart, width.forward);
    F8 offset = beside, reach, pixelSquared;
    const F8 far = dot(from, from), distance = sqrt(far);
    if (width.spreadSquared > 0) {
        // The depth gives the width of a pixel. Away from the picture's middle, at an angle f, things look longer by 1
        // / cos f in the direction away from the middle, so the tube is made narrower by this factor. Beyond 60 degrees
        // the factor stays as it is there.
        const F8 depth = dot(from, width.forward);
        const F8 squared = max(max(depth * depth, .25f * far), all(1e-30f));
        offset += lean * lean * (far / squared);
        pixelSquared = width.spreadSquared * squared;
        reach = width.halfSquared(distance) * pixelSquared;
    } else {
        pixelSquared = all(width.sizeSquared);
        reach = width.halfSquared(distance) * pixelSquared;
    }
    // No farther from the axis than the stroke is wide, so that the boxes around it hold the place.
    const F8 ahead = dot(d, width.forward), maximum = sqrt(max(reach - beside, all(0)) * dd);
    const I8 faces = ahead * ahead * dd >= .25f;
    const F8 step = min(max(select(faces, lean / select(faces, ahead, all(1)), all(0)), -maximum), maximum);
    const F8 tie = kTie * (sqrt(dot(o, o)) + sqrt(dot(position, position)) + distance);
    Met met{offset <= reach, axis + step - tie * sqrt(dd), u, sqrt(pixelSquared)};
    if (!width.isSquare) return met;
    met.hit = (isOwn & square.hit) | (~isOwn & met.hit);
    met.t = select(isOwn, square.t, met.t);
    return met;
}

/// The ends of a leaf's strokes, placed.
class LeafEnds {
  public:
    void set(int i, const glm::mat4x3& fromLocal, const StrokeBvh::Stroke& stroke) {
        const Vec3f a = fromLocal * Vec4f(stroke.a, 1), b = fromLocal * Vec4f(stroke.b, 1);
        for (int c = 0; c < 3; ++c) lanes_[c][i] = a[c], lanes_[3 + c][i] = b[c];
    }
    Vec3f a(int i) const { return {lanes_[0][i], lanes_[1][i], lanes_[2][i]}; }
    Vec3f b(int i) const { return {lanes_[3][i], lanes_[4][i], lanes_[5][i]}; }
    /// A bit for each that may come into the cone, whose axis is a unit vector; many that share a box with others do
    /// not.
    std::uint32_t near(const Cone& cone) const {
        const V8 d = broadcast(cone.direction), from = broadcast(cone.origin);
        const V8 a = V8{load(lanes_[0]), load(lanes_[1]), load(lanes_[2])} - from;
        const V8 b = V8{load(lanes_[3]), load(lanes_[4]), load(lanes_[5])} - from;
        const F8 ta = dot(a, d), tb = dot(b, d), last = max(ta, tb);
        // The point that is nearest to the axis, seen along it.
        const V8 across = a - d * ta, distance = b - d * tb - across;
        const F8 u = min(max(-dot(across, distance) / max(dot(distance, distance), all(1e-30f)), all(0)), all(1));
        const V8 apart = across + distance * u;
        const F8 rounding = 0x1p-18f * (sqrt(dot(a, a)) + sqrt(dot(b, b)) + glm::length(cone.origin));
        const F8 radius = cone.reach.x + cone.growth.x * max(last, all(0)) + rounding;
        return simd::laneBits((dot(apart, apart) <= radius * radius) & (last + radius >= cone.start) &
                              (min(ta, tb) - radius <= cone.end));
    }

  private:
    alignas(32) float lanes_[6][8] = {};
};

constexpr float kRoom = 1.01f;  // for roundings

/// How far behind a surface that far away strokes may be that lie in it.
float roomBehind(const PixelLens& lens, float halfWidth, float distance) {
    constexpr float kSlant = 16;  // depth over width: beyond it a surface is seen edge on
    return kSlant * halfWidth * (lens.spread * distance + lens.size);
}

/// The factor that bounds a pixel's width by the way along a ray: beyond the axis' distance from the eye by the width.
float growthOf(const PixelLens& lens, float halfWidth) {
    const float slope = std::min(halfWidth * lens.spread, .5f);
    return halfWidth * lens.spread * kRoom / (1 - slope);
}

}  // namespace

namespace {

/// All strokes with the room around them that they may take up as an eye sees them: pixels are as wide as their depth
/// says, and that of no stroke is more than the box's farthest corner is away.
struct Reach {
    Vec3f lower, upper;
    Reach(const TreeView::Box& box, const PixelLens& lens, const Square& square, float widest) {
        const float far = square.farthest(box.lower, box.upper, lens.eye);
        const Vec3f room = square.rows * (kRoom * widest * (lens.spread * far + lens.size));
        // And for the roundings of boxes and rays.
        const Vec3f slack = room + 0x1p-18f * (glm::max(glm::abs(box.lower), glm::abs(box.upper)) + square.rows * far);
        lower = box.lower - slack, upper = box.upper + slack;
    }
    /// Lanes that may come into it within their segments.
    I8 mayMeet(const V8& o, const V8& d, F8 tMin, F8 tMax) const {
        const auto slab = [](F8 from, F8 along, float low, float high, F8& near, F8& far) {
            const F8 small = all(kSmallDirection), zero{};
            const F8 inverse =
                1.0f / select((along < small) & (along > -small), select(along < zero, -small, small), along);
            const F8 a = (low - from) * inverse, b = (high - from) * inverse;
            near = max(near, min(a, b)), far = min(far, max(a, b));
        };
        F8 near = tMin, far = tMax;
        slab(o.x, d.x, lower.x, upper.x, near, far);
        slab(o.y, d.y, lower.y, upper.y, near, far);
        slab(o.z, d.z, lower.z, upper.z, near, far);
        return near * TreeView::kCloser <= far * TreeView::kFarther;
    }
};

}  // namespace

/// The rays of a query: one, or those of a packet that run together, in the lens' square space, where metres count.
/// `spread`: by how much they differ from the middle one, at its origin and in direction.
struct StrokeView::Rays {
    static constexpr std::int32_t kNoSlot = -1;
    Vec3f origin, direction;  // of the middle; unit
    float originSpread = 0, directionSpread = 0;
    float start = 0, end = 0;  // metres
    V8 o[2], d[2];
    V8 givenO[2], givenD[2];  // in ray space
    F8 tMin[2], tMax[2], length[2];
    F8 surface[2];   // tMax as it was
    int lane = 0;    // which of the query's the first of these is
    float room = 0;  // metres: how far behind a surface strokes are looked for that lie in it
    I8 active[2];
    F8 u[2];
    I8 hitSlot[2], hitStroke[2];
    int halves = 2;

    Rays() {
        for (int h = 0; h < 2; ++h) hitSlot[h] = I8{} + kNoSlot, hitStroke[h] = I8{}, u[h] = F8{};
    }
    Rays(const Ray& ray, const Square& square) : Rays() {
        origin = square.fromRay * ray.origin, direction = square.fromRay * ray.direction;
        const float size = glm::length(direction);
        o[0] = broadcast(origin), d[0] = broadcast(direction);
        direction /= size;
        start = ray.tMin * size;
        halves = 1;
        givenO[0] = broadcast(ray.origin), givenD[0] = broadcast(ray.direction);
        tMin[0] = all(ray.tMin), tMax[0] = surface[0] = all(ray.tMax), length[0] = all(size);
        active[0] = I8{-1};  // one lane of eight
        findEnd();
    }
    /// Takes hits out that the filter leaves out; false: all of them.
    bool keep(const RayFilter& filter, std::uint32_t slot, int h, const F8& t, I8& hit) const {
        for (int k = 0; k < 8; ++k)
            if (hit[k] && filter.leavesOutAlong(slot, {givenO[h].x[k], givenO[h].y[k], givenO[h].z[k]},
                                                {givenD[h].x[k], givenD[h].y[k], givenD[h].z[k]}, t[k]))
                hit[k] = 0;
        return any(hit);
    }
    /// Finds the rays that meet a stroke behind a surface in which the stroke lies. Seen at a slant, half of its width
    /// is behind the surface, but belongs to the picture like the other half.
    void findLying(const StrokeSurface& met, const Square& square, const Vec3f& eye, int h, const Vec3f& a,
                   const Vec3f& b, const Met& m, I8 behind, F8& t, I8& hit) const {
        for (int k = 0; k < 8; ++k) {
            if (!behind[k] || tMax[h][k] < surface[h][k]) continue;
            std::optional<Vec3f> normal = met.normal(lane + 8 * h + k);
            if (!normal) continue;
            if (!square.isRaySpace) normal = glm::normalize(square.normalFromRay * *normal);
            const Vec3f from(o[h].x[k], o[h].y[k], o[h].z[k]), along(d[h].x[k], d[h].y[k], d[h].z[k]);
            const Vec3f position = a + m.u[k] * (b - a), at = from + surface[h][k] * along;
            const float tie = kTie * (glm::length(from) + glm::length(position) + glm::length(position - eye));
            if (!(std::abs(glm::dot(position - at, *normal)) <= tie)) continue;
            t[k] = surface[h][k] - tie / length[h][k];
            hit[k] = -static_cast<std::int32_t>(t[k] >= tMin[h][k]);
        }
    }
    void makeRoom(float behind) {
        if (!std::isfinite(end)) return;
        room = behind;
        findEnd();
    }
    void findEnd() {
        F8 last = all(-HUGE_VALF);
        for (int h = 0; h < halves; ++h) last = max(last, select(active[h], tMax[h] * length[h], last));
        end = largest(last) + room;
    }
};

template <bool kAny>
void StrokeView::traverse(Rays& rays, const StrokeQuery& query) const {
    const PixelLens& lens = query.lens;
    const Square square(lens);
    const Vec3f eye = square.fromRay * lens.eye;
    const float away = glm::length(rays.origin - eye) + rays.originSpread;
    if (query.surface) rays.makeRoom(roomBehind(lens, widest_, away + rays.end));
    const float rounding = kTie * kRoom * (2 * (glm::length(rays.origin) + rays.originSpread) + away);
    const auto coneOf = [&](float halfWidth) {
        const float growth = growthOf(lens, halfWidth) + 2 * kTie * kRoom;
        Cone cone;
        cone.origin = rays.origin, cone.direction = rays.direction;
        cone.reach = Vec3f(rays.originSpread + growth * away + kRoom * halfWidth * lens.size + rounding);
        cone.growth = Vec3f(rays.directionSpread + growth);
        cone.start = rays.start, cone.end = rays.end;
        return cone;
    };
    const auto inObject = [&](std::uint32_t index) {
        const StrokeObject& o = object(index & ~TreeView::kLeaf);
        if (!(o.kinds & static_cast<std::uint32_t>(query.kind)) || !o.bvh || o.bvh->nodes().empty()) return rays.end;
        const Cone around = coneOf(o.reach());
        const glm::mat4x3 placed = square.isRaySpace ? o.rayFromLocal : square.fromRay * o.rayFromLocal;
        const glm::mat3 toLocal = square.isRaySpace ? o.localFromRay : o.localFromRay * square.toRay;
        const Vec3f rows = square.isRaySpace ? o.rowLengths : rowLengths(toLocal);
        const Cone cone = around.in(placed[3], toLocal, rows);
        const Width width(lens, square, o);
        const std::int32_t type = o.style && !o.isPoints ? o.style->lineType : 1;
        const RayFilter* filter = query.filter && query.filter->concerns(o.slot) ? query.filter : nullptr;
        const TreeView::Node* nodes = o.bvh->nodes().data();
        const StrokeBvh::Stroke* strokes = o.bvh->strokes().data();
        traverseCone(
            cone, [&](std::uint32_t i) -> const TreeView::Node& { return nodes[i]; },
            [&](std::uint32_t leaf) {
                const std::uint32_t first = StrokeBvh::firstOf(leaf), count = StrokeBvh::countOf(leaf);
                bool found = false;
                LeafEnds ends;
                for (std::uint32_t k = 0; k < StrokeBvh::kMaxInLeaf; ++k)
                    ends.set(static_cast<int>(k), placed, strokes[first + std::min(k, count - 1)]);
                std::uint32_t near = (1u << count) - 1;
                if (rays.halves > 1) near &= ends.near(around);
                for (; near; near &= near - 1) {
                    const int which = std::countr_zero(near);
                    const std::uint32_t i = first + static_cast<std::uint32_t>(which);
                    const Vec3f a = ends.a(which), b = ends.b(which);
                    for (int h = 0; h < rays.halves; ++h) {
                        Met m = rtsg::bvh::meet(rays.o[h], rays.d[h], broadcast(a), broadcast(b), width);
                        m.hit &= (m.t >= rays.tMin[h]) & rays.active[h];
                        const I8 behind = m.hit & (m.t > rays.tMax[h]);
                        m.hit &= m.t <= rays.tMax[h];
                        if (query.surface && any(behind))
                            rays.findLying(*query.surface, square, eye, h, a, b, m, behind, m.t, m.hit);
                        if (!any(m.hit)) continue;
                        if (type > 1 && !m.keepDrawn(type, glm::length(b - a), 2 * o.halfWidth)) continue;
                        // Here and not afterwards: rays may start within many, and have to pass all of them.
                        if (filter && !rays.keep(*filter, o.slot, h, m.t, m.hit)) continue;
                        found = true;
                        rays.tMax[h] = select(m.hit, kAny ? all(-HUGE_VALF) : m.t, rays.tMax[h]);
                        rays.u[h] = select(m.hit, m.u, rays.u[h]);
                        rays.hitSlot[h] = m.hit ? I8{} + static_cast<std::int32_t>(o.slot) : rays.hitSlot[h];
                        rays.hitStroke[h] =
                            m.hit ? I8{} + static_cast<std::int32_t>(strokes[i].number) : rays.hitStroke[h];
                        if constexpr (kAny) rays.active[h] &= ~m.hit;
                    }
                }
                if (found) rays.findEnd();
                return rays.end;
            });
        return rays.end;
    };
    const auto node = [&](std::uint32_t i) -> const TreeView::Node& {
        return tree_.nodePages()[i >> TreeView::kPageBits][i & (TreeView::kPerPage - 1)];
    };
    const Cone whole = coneOf(widest_);
    traverseCone(square.isRaySpace ? whole : whole.in(Vec3f(0), square.toRay, square.rows), node, inObject);
}

bool StrokeView::intersect(const Ray& ray, const StrokeQuery& query, StrokeHit& hit) const {
    Rays rays(ray, Square(query.lens));
    traverse<false>(rays, query);
    if (rays.hitSlot[0][0] == Rays::kNoSlot) return false;
    hit = {rays.tMax[0][0], rays.u[0][0], static_cast<std::uint32_t>(rays.hitSlot[0][0]),
           static_cast<std::uint32_t>(rays.hitStroke[0][0])};
    return true;
}

bool StrokeView::occluded(const Ray& ray, const StrokeQuery& query) const {
    Rays rays(ray, Square(query.lens));
    traverse<true>(rays, query);
    return rays.hitSlot[0][0] != Rays::kNoSlot;
}

Bounds StrokeView::reach(const PixelLens& lens) const {
    Bounds result;
    if (empty() || !lens) return result;
    const Reach reach(box_, lens, Square(lens), widest_);
    result.extend(reach.lower), result.extend(reach.upper);
    return result;
}

/// Which lanes may meet a line or point at all.
bool StrokeView::comesNear(const RayPacket16& packet, const std::int32_t* valid, const StrokeQuery& query,
                           I8* near) const {
    const PixelLens& lens = query.lens;
    const Square square(lens);
    const Reach reach(box_, lens, square, widest_);
    const float far = square.farthest(reach.lower, reach.upper, lens.eye);
    const float room = query.surface ? square.longest * roomBehind(lens, widest_, far) : 0;
    for (int h = 0; h < 2; ++h) {
        const int at = 8 * h;
        const F8 tMin = load(packet.tMin + at), tMax = load(packet.tMax + at);
        const V8 o{load(packet.originX + at), load(packet.originY + at), load(packet.originZ + at)};
        const V8 d{load(packet.directionX + at), load(packet.directionY + at), load(packet.directionZ + at)};
        I8 wanted;
        std::memcpy(&wanted, valid + at, sizeof wanted);
        const F8 end = room > 0 ? tMax + room / sqrt(dot(d, d)) : tMax;
        near[h] = (wanted != 0) & (tMin <= tMax) & reach.mayMeet(o, d, tMin, end);
    }
    return any(near[0]) || any(near[1]);
}

template <bool kAny>
std::uint32_t StrokeView::packet(RayPacket16& packet, const std::int32_t* valid, const StrokeQuery& query) const {
    I8 near[2];
    if (!comesNear(packet, valid, query, near)) return 0;
    Rays rays;
    const Square square(query.lens);
    Vec3f low(HUGE_VALF), high(-HUGE_VALF), sum(0);
    int count = 0;
    rays.start = HUGE_VALF;
    Vec3f units[16];
    const auto given = [&packet](int i) {
        return Ray{{packet.originX[i], packet.originY[i], packet.originZ[i]},
                   packet.tMin[i],
                   {packet.directionX[i], packet.directionY[i], packet.directionZ[i]},
                   packet.tMax[i]};
    };
    for (int i = 0; i < 16; ++i) {
        if (!near[i / 8][i % 8]) continue;
        const Ray ray = given(i);
        const Vec3f o = square.fromRay * ray.origin, d = square.fromRay * ray.direction;
        const float length = glm::length(d);
        units[i] = d / length;
        low = glm::min(low, o), high = glm::max(high, o);
        sum += units[i];
        rays.start = std::min(rays.start, packet.tMin[i] * length);
        ++count;
    }
    if (count == 0) return 0;
    for (int h = 0; h < 2; ++h) {
        const int at = 8 * h;
        rays.givenO[h] = {load(packet.originX + at), load(packet.originY + at), load(packet.originZ + at)};
        rays.givenD[h] = {load(packet.directionX + at), load(packet.directionY + at), load(packet.directionZ + at)};
        rays.o[h] = square.of(rays.givenO[h]), rays.d[h] = square.of(rays.givenD[h]);
        rays.length[h] = sqrt(dot(rays.d[h], rays.d[h]));
        rays.tMin[h] = load(packet.tMin + at), rays.tMax[h] = rays.surface[h] = load(packet.tMax + at);
        rays.active[h] = near[h];
    }
    // Rays that run together look for boxes as one; others each for itself.
    constexpr float kTogether = .05f;
    const float size = glm::length(sum);
    rays.direction = size > 0 ? sum / size : Vec3f(0, 0, 1);
    rays.origin = .5f * (low + high);
    rays.originSpread = .5f * glm::length(high - low);
    for (int i = 0; i < 16; ++i)
        if (rays.active[i / 8][i % 8])
            rays.directionSpread = std::max(rays.directionSpread, glm::length(units[i] - rays.direction));
    if (rays.directionSpread <= kTogether) {
        rays.directionSpread *= kRoom, rays.originSpread *= kRoom;
        rays.findEnd();
        traverse<kAny>(rays, query);
    } else {
        const I8 active[2] = {rays.active[0], rays.active[1]};
        for (int i = 0; i < 16; ++i) {
            if (!active[i / 8][i % 8]) continue;
            Rays one(given(i), square);
            one.lane = i;
            traverse<kAny>(one, query);
            const int h = i / 8, k = i % 8;
            rays.tMax[h][k] = one.tMax[0][0], rays.u[h][k] = one.u[0][0];
            rays.hitSlot[h][k] = one.hitSlot[0][0], rays.hitStroke[h][k] = one.hitStroke[0][0];
        }
    }
    std::uint32_t hits = 0;
    for (int i = 0; i < 16; ++i) {
        const int h = i / 8, k = i % 8;
        if (rays.hitSlot[h][k] == Rays::kNoSlot) continue;
        hits |= 1u << i;
        packet.tMax[i] = rays.tMax[h][k];
        if constexpr (kAny) continue;
        packet.u_[i] = rays.u[h][k], packet.v_[i] = 0;
        packet.prim_[i] = static_cast<std::uint32_t>(rays.hitStroke[h][k]);
        packet.geom_[i] = static_cast<std::uint32_t>(rays.hitSlot[h][k]);
        packet.inst_[i] = kResolved;
        const Vec3f back = square.isRaySpace ? -units[i] : -glm::normalize(given(i).direction);
        packet.normalX_[i] = back.x, packet.normalY_[i] = back.y, packet.normalZ_[i] = back.z;
    }
    return hits;
}

std::uint32_t StrokeView::intersect(RayPacket16& rays, const std::int32_t* valid, const StrokeQuery& query) const {
    return packet<false>(rays, valid, query);
}

std::uint32_t StrokeView::occluded(RayPacket16& rays, const std::int32_t* valid, const StrokeQuery& query) const {
    return packet<true>(rays, valid, query);
}

}  // namespace rtsg::bvh
