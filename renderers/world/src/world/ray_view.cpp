// Queries that every ray of light, sound and picking uses. Nothing here locks or allocates.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <functional>

#include "embree/passed_hits.h"
#include "mesh/simd8.h"
#include "ray_boxes.h"
#include "ray_view_impl.h"

namespace rtsg {

namespace {

constexpr float kShortest = 1e-12f, kLongest = 1e9f;

/// False for NaN and infinity anywhere but in tMax, which may be infinite.
inline bool acceptable(float ox, float oy, float oz, float tMin, float dx, float dy, float dz, float tMax) {
    const float reach = std::max(std::max(std::abs(ox), std::abs(oy)), std::abs(oz));
    const float length = std::max(std::max(std::abs(dx), std::abs(dy)), std::abs(dz));
    // std::max drops a NaN in its second argument, so sums look for them.
    const float sum = (ox - ox) + (oy - oy) + (oz - oz) + (dx - dx) + (dy - dy) + (dz - dz);
    return (sum == 0) & (reach <= RayView::kMaxCoordinate) & (length >= kShortest) & (length <= kLongest) &
           (tMin >= 0) & (tMin < HUGE_VALF) & (tMax >= 0);
}

/// Lanes that must not be traced are inactive in `valid`. Returns the number of bad rays.
inline int findValid(const RayPacket16& rays, std::int32_t* valid) {
    int bad = 0;
    for (int i = 0; i < 16; ++i) {
        const bool ok = acceptable(rays.originX[i], rays.originY[i], rays.originZ[i], rays.tMin[i], rays.directionX[i],
                                   rays.directionY[i], rays.directionZ[i], rays.tMax[i]);
        valid[i] = ok ? rays.active[i] : 0;
        bad += !ok & (rays.active[i] != 0);
    }
    return bad;
}

/// Lanes that do not come where there is anything that stays become inactive.
inline void leaveOut(const RayFilter& hider, const RayPacket16& rays, const std::int32_t* valid, std::int32_t* kept) {
    const std::uint32_t met = meetBox(rays, hider.keptBounds());
    for (int i = 0; i < 16; ++i) kept[i] = met >> i & 1u ? valid[i] : 0;
}

/// The lanes that are traced, a bit each.
inline std::uint32_t lanesOf(const std::int32_t* valid) {
    std::uint32_t lanes = 0;
    for (int i = 0; i < 16; ++i) lanes |= static_cast<std::uint32_t>(valid[i] != 0) << i;
    return lanes;
}

/// The valid lanes about which a filter must be asked. Hidden instances need no question: rays pass them by themselves.
inline std::uint32_t lanesToAsk(const RayFilter* filter, const RayPacket16& rays, const std::int32_t* valid) {
    return filter ? meetBox(rays, filter->bounds()) & lanesOf(valid) : 0;
}

inline bool acceptable(const Ray& ray) {
    return acceptable(ray.origin.x, ray.origin.y, ray.origin.z, ray.tMin, ray.direction.x, ray.direction.y,
                      ray.direction.z, ray.tMax);
}

// Instances and bodies report normals in their own frames; merged triangles were turned inside out by a mirroring.

inline Vec3f worldNormal(Vec3f normal, const bvh::TopObject& object, const RayInstance& instance) {
    if (!object.slots) return instance.normalFromLocal * normal;
    if (!object.resting) normal = object.normalFromGroup * normal;
    return instance.sign < 0 ? -normal : normal;
}

Hit resolve(const bvh::RawHit& raw, const bvh::TopView& top, const RayInstances& instances) {
    Hit hit;
    if (!raw) return hit;
    const bvh::TopObject& object = top.objectOf(raw.objectId);
    hit.t = raw.t, hit.u = raw.u, hit.v = raw.v, hit.triangle = raw.triangle;
    hit.instance = object.slotOf(raw.geometryId);
    Vec3f normal = worldNormal(raw.normal, object, instances[hit.instance]);
    const float size = std::max(std::max(std::abs(normal.x), std::abs(normal.y)), std::abs(normal.z));
    if (size > 0) normal /= size;  // so that squares neither overflow nor vanish
    const float length = std::sqrt(glm::dot(normal, normal));
    hit.normal = length > 0 ? normal / length : Vec3f(0, 0, 1);
    return hit;
}

/// Whether the lanes of `mask` all have this value.
inline bool sharedBy(const std::uint32_t* lanes, std::uint32_t value, std::uint32_t mask) {
    std::uint32_t same = 0;
    for (int at = 0; at < 16; at += 8) {
        simd::I8 x;
        std::memcpy(&x, lanes + at, sizeof x);
        same |= simd::laneBits(x == static_cast<std::int32_t>(value)) << at;
    }
    return (same & mask) == mask;
}

/// worldNormal() of all lanes, which met the same.
void flipNormals(const RayPacket16& rays, const bvh::TopObject& object, const RayInstance& instance,
                 PacketHits16& out) {
    using namespace simd;
    const bool rotations = !object.slots || !object.resting, flips = object.slots && instance.sign < 0;
    const glm::mat3& m = object.slots ? object.normalFromGroup : instance.normalFromLocal;
    for (int at = 0; at < 16; at += 8) {
        const F8 x = load(rays.normalX_ + at), y = load(rays.normalY_ + at), z = load(rays.normalZ_ + at);
        const auto row = [&](int r) {
            const F8 own = r == 0 ? x : r == 1 ? y : z;
            const F8 turned = rotations ? m[0][r] * x + m[1][r] * y + m[2][r] * z : own;
            return flips ? -turned : turned;
        };
        store(out.normalX + at, row(0)), store(out.normalY + at, row(1)), store(out.normalZ + at, row(2));
    }
}

/// Normals of length 1.
void makeUnit(PacketHits16& out) {
    using namespace simd;
    for (int at = 0; at < 16; at += 8) {
        F8 x = load(out.normalX + at), y = load(out.normalY + at), z = load(out.normalZ + at);
        const F8 size = max(max(max(x, -x), max(y, -y)), max(z, -z));
        const I8 extreme = (size < 1e-15f) | (size > 1e15f);
        if (any(extreme)) {  // so that squares neither overflow nor vanish
            const F8 scale = select(extreme, 1.0f / max(size, all(1e-38f)), all(1));
            x *= scale, y *= scale, z *= scale;
        }
        const F8 squared = x * x + y * y + z * z;
        const I8 good = squared > 0.0f;
        const F8 inverse = 1.0f / sqrt(select(good, squared, all(1)));
        store(out.normalX + at, select(good, x * inverse, all(0)));
        store(out.normalY + at, select(good, y * inverse, all(0)));
        store(out.normalZ + at, select(good, z * inverse, all(1)));
    }
}

/// Everything but instances, and normals as they are.
void copyHits(const RayPacket16& rays, PacketHits16& out) {
    std::memcpy(out.normalX, rays.normalX_, 3 * sizeof out.normalX);  // three arrays in a row, in both
    std::memcpy(out.u, rays.u_, 2 * sizeof out.u);
    std::memcpy(out.triangle, rays.prim_, sizeof out.triangle);
}

}  // namespace

Hit RayView::intersect(const Ray& ray, RayKind kind) const {
    kind = meant(kind);
    if (!acceptable(ray)) [[unlikely]] {
        tables_->badRays.fetch_add(1, std::memory_order_relaxed);
        return {};
    }
    if (!filter_) return intersectAll(ray, kind);
    return meetCaps(ray, intersectFiltered(ray, kind), kind);
}

Hit RayView::intersectAll(const Ray& ray, RayKind kind) const {
    const RayFilter* hider = this->hider();
    if (hider && !meetsBox(ray, hider->keptBounds())) return {};
    Hit hit = resolve(tables_->top.intersect(ray, kind, hider), tables_->top, instances_);
    if (seesStrokes(kind)) meetStrokes(ray, kind, hit);
    return hit;
}

LensedView::LensedView(const RayView& view, const PixelLens& lens, const RayFilter* filter, RayKind views)
    : RayView(view) {
    lens_ = lens, filter_ = filter, views_ = views;
    const Bounds reach = tables_->strokes.reach(lens);
    strokesMiddle_ = reach.center();
    const Vec3f half = .5f * reach.size();
    strokesRadiusSquared_ = reach.empty() ? -1 : glm::dot(half, half);
}

void RayView::meetStrokes(const Ray& ray, RayKind kind, Hit& hit) const {
    bvh::StrokeHit stroke;
    Ray rest = ray;
    rest.tMax = std::min(rest.tMax, hit.t);
    struct Met final : bvh::StrokeSurface {
        const Hit& hit;
        explicit Met(const Hit& met) : hit(met) {}
        std::optional<Vec3f> normal(int) const override { return hit.normal; }
    };
    const Met met(hit);
    if (!tables_->strokes.intersect(rest, {lens_, kind, filter_, hit ? &met : nullptr}, stroke)) return;
    hit = {stroke.t, stroke.slot, stroke.stroke, stroke.u, 0, -glm::normalize(ray.direction)};
}

bool RayView::occluded(const Ray& ray, RayKind kind) const {
    kind = meant(kind);
    if (!acceptable(ray)) [[unlikely]] {
        tables_->badRays.fetch_add(1, std::memory_order_relaxed);
        return false;
    }
    if (filter_ && !filter_->bounds().empty())
        return static_cast<bool>(meetCaps(ray, intersectFiltered(ray, kind), kind));
    const RayFilter* hider = this->hider();
    if (hider && !meetsBox(ray, hider->keptBounds())) return false;
    return tables_->top.occluded(ray, kind, hider) ||
           (seesStrokes(kind) && tables_->strokes.occluded(ray, {lens_, kind, filter_}));
}

std::uint32_t RayView::intersect(RayPacket16& rays, bool coherent, RayKind kind) const {
    return intersect(rays, coherent, kind, nullptr);
}

std::uint32_t RayView::intersect(RayPacket16& rays, bool coherent, RayKind kind, const bvh::PrimaryBlock* known) const {
    kind = meant(kind);
    alignas(64) std::int32_t valid[16];
    if (const int bad = findValid(rays, valid); bad > 0) [[unlikely]]
        tables_->badRays.fetch_add(static_cast<std::uint64_t>(bad), std::memory_order_relaxed);
    const std::uint32_t asked = lanesToAsk(filter_, rays, valid);
    float tMax[16];
    if (asked) std::memcpy(tMax, rays.tMax, sizeof tMax);
    const std::uint32_t hits = intersectAll(rays, valid, coherent, kind, known);
    return asked ? filterHits(rays, hits, asked, tMax, kind) : hits;
}

std::uint32_t RayView::intersectAll(RayPacket16& rays, const std::int32_t* valid, bool coherent, RayKind kind,
                                    const bvh::PrimaryBlock* known) const {
    const RayFilter* hider = this->hider();
    alignas(64) std::int32_t kept[16];
    float tMax[16];
    if (hider) {
        leaveOut(*hider, rays, valid, kept);
        valid = kept;
        std::memcpy(tMax, rays.tMax, sizeof tMax);
    }
    // Known blocks hold hits of hidden instances too, so these are passed afterwards.
    std::uint32_t hits = tables_->top.intersect(rays, valid, coherent, kind, known, known ? nullptr : hider);
    if (hider && known) hits = passHidden(rays, hits, tMax, coherent, kind);
    // Most packets come nowhere near a line or point.
    if (!seesStrokes(kind) || !comeNear(rays, strokesMiddle_, strokesRadiusSquared_)) return hits;
    struct Met final : bvh::StrokeSurface {
        const RayView& view;
        const RayPacket16& rays;
        std::uint32_t hits;
        Met(const RayView& v, const RayPacket16& r, std::uint32_t h) : view(v), rays(r), hits(h) {}
        std::optional<Vec3f> normal(int lane) const override {
            if (!(hits >> lane & 1u)) return std::nullopt;
            return view.hit(rays, lane).normal;
        }
    };
    const Met met(*this, rays, hits);
    return hits | tables_->strokes.intersect(rays, valid, {lens_, kind, filter_, hits ? &met : nullptr});
}

std::uint32_t RayView::passHidden(RayPacket16& rays, std::uint32_t hits, const float* tMax, bool coherent,
                                  RayKind kind) const {
    const RayFilter& hider = *this->hider();
    alignas(64) std::int32_t again[16] = {};
    std::uint32_t hidden = 0;
    for (std::uint32_t rest = hits; rest; rest &= rest - 1) {
        const int i = std::countr_zero(rest);
        if (!hider.hides(tables_->top.objectOf(rays.inst_[i]).slotOf(rays.geom_[i]))) continue;
        again[i] = -1, hidden |= 1u << i;
    }
    if (!hidden) return hits;
    RayPacket16 behind = rays;
    std::memcpy(behind.tMax, tMax, sizeof behind.tMax);
    const std::uint32_t met = tables_->top.intersect(behind, again, coherent, kind, &hider);
    for (std::uint32_t rest = hidden; rest; rest &= rest - 1) {
        const int i = std::countr_zero(rest);
        rays.tMax[i] = behind.tMax[i];
        rays.u_[i] = behind.u_[i], rays.v_[i] = behind.v_[i];
        rays.normalX_[i] = behind.normalX_[i], rays.normalY_[i] = behind.normalY_[i];
        rays.normalZ_[i] = behind.normalZ_[i];
        rays.prim_[i] = behind.prim_[i], rays.geom_[i] = behind.geom_[i], rays.inst_[i] = behind.inst_[i];
    }
    return (hits & ~hidden) | (met & hidden);
}

std::uint32_t RayView::occludedByAll(RayPacket16& rays, const std::int32_t* valid, bool coherent, RayKind kind) const {
    const RayFilter* hider = this->hider();
    alignas(64) std::int32_t kept[16];
    if (hider) {
        leaveOut(*hider, rays, valid, kept);
        valid = kept;
    }
    std::uint32_t blocked = tables_->top.occluded(rays, valid, coherent, kind, nullptr, hider);
    if (seesStrokes(kind) && comeNear(rays, strokesMiddle_, strokesRadiusSquared_))
        blocked |= tables_->strokes.occluded(rays, valid, {lens_, kind, filter_});
    return blocked;
}

std::uint32_t RayView::occluded(RayPacket16& rays, bool coherent, RayKind kind) const {
    kind = meant(kind);
    alignas(64) std::int32_t valid[16];
    if (const int bad = findValid(rays, valid); bad > 0) [[unlikely]]
        tables_->badRays.fetch_add(static_cast<std::uint64_t>(bad), std::memory_order_relaxed);
    if (!filter_ || filter_->bounds().empty()) return occludedByAll(rays, valid, coherent, kind);
    // The surface that blocks a ray may be left out at that place: for blocked rays the nearest hit is looked for, and
    // hits beyond it if need be. If there are caps, something may be in the way that no ray meets by itself; otherwise
    // the filter is not asked about rays that nothing blocks.
    const bool makesCaps = filter_->makesCaps();
    std::uint32_t asked = makesCaps ? lanesToAsk(filter_, rays, valid) : 0;
    if (asked)
        for (int i = 0; i < 16; ++i) valid[i] = asked >> i & 1u ? 0 : valid[i];
    float tMax[16];
    std::memcpy(tMax, rays.tMax, sizeof tMax);
    std::uint32_t blocked = occludedByAll(rays, valid, coherent, kind);
    if (!makesCaps && blocked) asked = meetBox(rays, tMax, filter_->bounds()) & blocked;
    if (!asked) return blocked;
    blocked &= ~asked;
    for (int i = 0; i < 16; ++i) {
        valid[i] = -static_cast<std::int32_t>(asked >> i & 1u);
        if (valid[i]) rays.tMax[i] = tMax[i];
    }
    blocked |= filterHits(rays, intersectAll(rays, valid, coherent, kind), asked, tMax, kind);
    for (int i = 0; i < 16; ++i)
        if (asked >> i & 1u) rays.tMax[i] = blocked >> i & 1u ? -HUGE_VALF : tMax[i];
    return blocked;
}

std::uint32_t RayView::occludedBut(RayPacket16& rays, bool coherent, RayKind kind, bvh::PassedHits& passed,
                                   std::uint32_t& unknown) const {
    kind = meant(kind);
    alignas(64) std::int32_t valid[16];
    if (const int bad = findValid(rays, valid); bad > 0) [[unlikely]]
        tables_->badRays.fetch_add(static_cast<std::uint64_t>(bad), std::memory_order_relaxed);
    unknown = 0;
    if (seesStrokes(kind) && comeNear(rays, strokesMiddle_, strokesRadiusSquared_)) {
        unknown = lanesOf(valid);
        return 0;
    }
    unknown = lanesToAsk(filter_, rays, valid);
    for (std::uint32_t rest = unknown; rest; rest &= rest - 1) valid[std::countr_zero(rest)] = 0;
    const RayFilter* hider = this->hider();
    if (hider) leaveOut(*hider, rays, valid, valid);
    const std::uint32_t blocked = tables_->top.occluded(rays, valid, coherent, kind, &passed, hider);
    unknown |= passed.many;
    return blocked & ~passed.many;
}

Hit RayView::hit(const bvh::RawHit& raw) const {
    return resolve(raw, tables_->top, instances_);
}

Hit RayView::hit(const RayPacket16& rays, int lane) const {
    if (bvh::StrokeView::isResolved(rays.inst_[lane]))
        return {rays.tMax[lane],
                rays.geom_[lane],
                rays.prim_[lane],
                rays.u_[lane],
                rays.v_[lane],  // of a triangle behind something that was left out; 0 of strokes
                {rays.normalX_[lane], rays.normalY_[lane], rays.normalZ_[lane]}};
    return resolve({rays.tMax[lane],
                    rays.u_[lane],
                    rays.v_[lane],
                    {rays.normalX_[lane], rays.normalY_[lane], rays.normalZ_[lane]},
                    rays.prim_[lane],
                    rays.geom_[lane],
                    rays.inst_[lane]},
                   tables_->top, instances_);
}

bool RayView::hits(const RayPacket16& rays, std::uint32_t mask, PacketHits16& out) const {
    if (!mask) return false;
    copyHits(rays, out);
    const int first = std::countr_zero(mask);
    const std::uint32_t inst = rays.inst_[first], geom = rays.geom_[first];
    if (sharedBy(rays.inst_, inst, mask) && sharedBy(rays.geom_, geom, mask) && !bvh::StrokeView::isResolved(inst)) {
        const bvh::TopObject& object = tables_->top.objectOf(inst);
        const std::uint32_t slot = object.slotOf(geom);
        std::fill(std::begin(out.instance), std::end(out.instance), slot);
        if (!object.slots || !object.resting || instances_[slot].sign < 0)
            flipNormals(rays, object, instances_[slot], out);
        makeUnit(out);
        return true;
    }
    for (; mask; mask &= mask - 1) {
        const int i = std::countr_zero(mask);
        if (bvh::StrokeView::isResolved(rays.inst_[i])) {
            out.instance[i] = rays.geom_[i];
            continue;
        }
        const bvh::TopObject& object = tables_->top.objectOf(rays.inst_[i]);
        const std::uint32_t slot = object.slotOf(rays.geom_[i]);
        out.instance[i] = slot;
        const RayInstance& instance = instances_[slot];
        if (object.slots && object.resting && instance.sign >= 0) continue;
        const Vec3f n = worldNormal({out.normalX[i], out.normalY[i], out.normalZ[i]}, object, instance);
        out.normalX[i] = n.x, out.normalY[i] = n.y, out.normalZ[i] = n.z;
    }
    makeUnit(out);
    return false;
}

void RayView::visitNear(const Vec3f& center, float radius, const NearVisitor& visit, RayKind kind) const {
    float reach = radius;
    // By reference: a function of its own would take its room from the heap.
    const auto visitKind = [&](std::uint32_t slot, std::uint32_t triangle) {
        const Instance& info = instances_[slot].info;
        if (kind == RayKind::sound ? info.heard : info.seen) reach = visit(slot, triangle);
        return reach;
    };
    tables_->top.visitNear(center, radius, std::cref(visitKind));
}

void RayView::visitFelt(const Vec3f& center, float radius, const NearVisitor& visit) const {
    float reach = radius;
    tables_->top.visitNear(center, radius, [&](std::uint32_t slot, std::uint32_t triangle) {
        if (instances_[slot].info.felt) reach = visit(slot, triangle);
        return reach;
    });
}

Bounds RayView::bounds() const {
    // Not the tree's own bounds: these include things that have moved away or gone until it is rebuilt.
    Bounds result;
    for (const RayInstance& instance : instances_) {
        if (!instance.info.id || !instance.mesh || !instance.info.seen) continue;
        const Bounds& local = instance.mesh->bounds;
        const glm::mat4x3& m = instance.rayFromLocal;
        const Vec3f center = m * Vec4f(local.center(), 1), half = 0.5f * local.size();
        const Vec3f reach = glm::abs(m[0]) * half.x + glm::abs(m[1]) * half.y + glm::abs(m[2]) * half.z;
        result.extend(center - reach);
        result.extend(center + reach);
    }
    return result;
}

std::uint64_t RayView::badRays() const {
    return tables_->badRays.load(std::memory_order_relaxed);
}

}  // namespace rtsg
