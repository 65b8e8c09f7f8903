// Stages of paths side by side: rays, hits of a kind, rays towards lights, sums.
#include "path_wavefront.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "lighting/emitters.h"
#include "lighting/lane_gather.h"
#include "lighting/packet_random.h"
#include "lighting/path_parts.h"
#include "packet/tile_rays.h"
#include "path_emitters.h"
#include "path_scatter.h"
#include "surface/lanes.h"
#include "world/large_rays.h"

namespace rtsg::trace {

using namespace simd;

namespace {

// Columns of rays.
enum RayColumn : std::size_t {
    kOrigin = 0,
    kDirection = 3,
    kWeight = 6,
    kFirst = 9,  // to kCalls alike in hits
    kOdds,
    kFate,
    kTravelled,
    kPixel,  // and the depth, from bit 16 on
    kIndex,  // of the sample, its bits in reverse order
    kCalls,  // bits of PathRandom's sequence, from bit 12 on, and the number of its next call
    kRayNormal,
    kDensity = kRayNormal + 3,
    kOther,  // 0, or one more than the index of the ray's additional data
    kFront,  // the instance whose front it leaves; kNoFront: none, or nobody knows
    kRayColumns
};
// Columns of hits; kDirection, kWeight and the following ones are as for rays.
enum HitColumn : std::size_t {
    kInstance = 0,
    kTriangle,
    kDistance,
    kU = kCalls + 1,
    kV,
    kOutside,
    kHitColumns = kOutside + 3
};
// Columns of rays towards emitters.
enum AskedColumn : std::size_t { kLight = 6, kAskedPixel = 9, kEmitter, kAskedFront, kAskedColumns };
constexpr std::uint32_t kNoFront = bvh::LargeTable::kNone;

constexpr std::uint32_t kCallBits = 12, kMaxCalls = (1u << kCallBits) - 16, kMaxDepth = 9'999;
constexpr std::size_t kTogether = 2048;  // primary rays; their data fit into the second-level cache

using U8 = std::uint32_t __attribute__((vector_size(32)));

U8 unsignedBits(F8 v) {
    U8 r;
    std::memcpy(&r, &v, sizeof r);
    return r;
}
F8 asFloats(U8 v) {
    F8 r;
    std::memcpy(&r, &v, sizeof r);
    return r;
}
std::uint32_t firstLanes(std::size_t count) {
    return count >= 16 ? 0xFFFFu : (1u << count) - 1;
}

/// The random numbers of eight paths at a surface: what PathRandom gives for each.
class Numbers {
  public:
    Numbers() = default;
    Numbers(const std::uint32_t* calls, U8 reversed, std::uint32_t count) : reversed_(reversed), calls_(calls) {
        for (std::uint32_t lane = 1; lane < count; ++lane) together_ = together_ && calls[lane] == calls[0];
    }
    F8 one(std::uint32_t call) const {
        U8 order, first, second;
        seeds(call, order, first, second, false);
        return fraction(scrambleUpwards(shuffled(order), first));
    }
    void pair(std::uint32_t call, F8& u, F8& v) const {
        U8 order, first, second;
        seeds(call, order, first, second, true);
        const U8 index = shuffled(order);
        u = fraction(scrambleUpwards(index, first));
        v = fraction(scrambleUpwards(sobolSecondReversed(index), second));
    }

  private:
    static std::uint64_t seedOf(std::uint32_t calls) {
        constexpr std::uint32_t kLow = (1u << kCallBits) - 1;
        return mixBits(std::uint64_t{calls & ~kLow} << 32 | (calls & kLow));
    }
    void seeds(std::uint32_t call, U8& order, U8& first, U8& second, bool both) const {
        for (int lane = 0; lane < 8; ++lane) {
            const std::uint64_t seed = seedOf(calls_[lane] + call);
            const auto low = static_cast<std::uint32_t>(seed), high = static_cast<std::uint32_t>(seed >> 32),
                       other = both ? static_cast<std::uint32_t>(mixBits(seed)) : 0;
            if (together_) {
                order = U8{} + low, first = U8{} + high, second = U8{} + other;
                return;
            }
            order[lane] = low, first[lane] = high, second[lane] = other;
        }
    }
    U8 shuffled(U8 order) const { return reverseBits(scrambleUpwards(reversed_, order)); }
    static F8 fraction(U8 reversed) {
        const U8 high = reverseBits(reversed) >> 8;
        I8 whole;
        std::memcpy(&whole, &high, sizeof whole);
        return __builtin_convertvector(whole, F8) * 0x1p-24f;
    }

    U8 reversed_{};
    const std::uint32_t* calls_ = nullptr;
    bool together_ = true;
};

}  // namespace

bool goesInWavefronts(const TraceScene& scene, const Camera& camera) {
    if (camera.isBounded()) return false;  // each ray from the eye has ends of its own
    if (!scene.aroundEye.empty()) return false;
    const bool clearAir = scene.volumes.empty() && !scene.fogs.any() && !scene.filter && !scene.shutter;
    const bool plainLight = !scene.lamps && !scene.skyLight && scene.lightGroups.lights.empty() &&
                            scene.environments.lights.empty() && (!scene.emitters || scene.emitters->even());
    return pathParts().wavefronts && clearAir && plainLight && scene.plain && scene.plain->maximum() &&
           scene.energyLimited;
}

namespace {

/// The memory of the rays' queues stays with the thread: to get it anew for each tile costs more than to trace some.
void swapQueues(LaneQueue& now, LaneQueue& next, LaneQueue& open) {
    thread_local LaneQueue kept[3] = {LaneQueue(kRayColumns), LaneQueue(kRayColumns), LaneQueue(kRayColumns)};
    std::swap(now, kept[0]), std::swap(next, kept[1]), std::swap(open, kept[2]);
}

}  // namespace

Wavefront::Wavefront(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
                     std::span<TileResult> groups, float roulette, bool bouncesFindSky, Others others)
    : scene_(scene),
      camera_(camera),
      settings_(settings),
      plain_(*scene.plain),
      x0_(x0),
      y0_(y0),
      groups_(groups),
      roulette_(roulette),
      bouncesFindSky_(bouncesFindSky),
      callsOfLights_(scene.emitters ? 2 : 0),
      others_(std::move(others)),
      matte_(kHitColumns),
      glossy_(kHitColumns),
      flat_(kHitColumns),
      asked_(kAskedColumns),
      askedOpen_(kAskedColumns),
      blocked_(kAskedColumns) {
    swapQueues(now_, next_, open_);
}
Wavefront::~Wavefront() {
    now_.clear(), next_.clear(), open_.clear();
    swapQueues(now_, next_, open_);
}

void Wavefront::run() {
    for (std::size_t group = 0; group < groups_.size(); ++group) {
        const TileResult& asked = groups_[group];
        const int end = std::min(asked.lastSample, settings_.samplesPerPixel);
        for (int block = 0; block < kTilePixels / 16; ++block) {
            if (!(asked.blocks >> block & 1u)) continue;
            for (int sample = asked.firstSample; sample < end; ++sample) {
                start(group, block, sample);
                if (now_.size() >= kTogether) drain();
            }
        }
    }
    drain();
}

/// Queues the rays of a block's pixels.
void Wavefront::start(std::size_t group, int block, int sample) {
    RayPacket16 rays;
    std::uint16_t pixels[16];
    const std::uint64_t seed = groups_[group].seed;
    const std::uint32_t active = primaryRays(scene_, camera_, settings_, seed, x0_, y0_, block, sample, rays, pixels);
    if (!active) return;
    groups_[0].primaryRays += static_cast<std::uint64_t>(std::popcount(active));
    int x[16], y[16];
    std::uint64_t states[16];
    alignas(32) std::uint32_t pixel[16], index[16], calls[16];
    for (int lane = 0; lane < 16; ++lane) {
        x[lane] = x0_ + pixels[lane] % kTileSide, y[lane] = y0_ + pixels[lane] / kTileSide;
        pixel[lane] = pixels[lane] + static_cast<std::uint32_t>(group) * kTilePixels;
    }
    randomOfPicture(seed, x, y, sample, settings_.samplesPerPixel, states);
    for (int lane = 0; lane < 16; ++lane) {
        const PathRandom random(states[lane]);
        index[lane] = random.index(), calls[lane] = random.sequenceAndCalls();
    }
    now_.reserve(16);
    const auto read = [](const std::uint32_t* from) {
        U8 r;
        std::memcpy(&r, from, sizeof r);
        return r;
    };
    for (int at = 0; at < 16; at += 8) {
        const auto rows = now_.add(active >> at & 0xFFu);
        rows.put(kOrigin, V8{load(rays.originX + at), load(rays.originY + at), load(rays.originZ + at)});
        rows.put(kDirection, V8{load(rays.directionX + at), load(rays.directionY + at), load(rays.directionZ + at)});
        rows.put(kWeight, V8{all(1), all(1), all(1)});
        rows.put(kFirst, all(roulette_));
        for (const std::size_t none : {kOdds, kFate, kTravelled, kDensity, kOther}) rows.put(none, F8{});
        rows.put(kRayNormal, V8{}), rows.put(kFront, I8{} - 1);
        rows.put(kPixel, asFloats(read(pixel + at)));
        rows.put(kIndex, asFloats(reverseBits(read(index + at))));
        rows.put(kCalls, asFloats(read(calls + at)));
    }
}

/// Follows all paths to their ends.
void Wavefront::drain() {
    for (;;) {
        while (!now_.empty()) traceAll();
        if (matte_.empty() && glossy_.empty() && flat_.empty()) break;
        while (!flat_.empty()) shadeMatte(flat_);
        while (!matte_.empty()) shadeMatte(matte_);
        while (!glossy_.empty()) shadeGlossy();
        std::swap(now_, next_), nowOther_.swap(nextOther_);
    }
    while (!asked_.empty()) scene_.large ? askLarge() : askWhetherFree(asked_);
    while (!askedOpen_.empty()) askWhetherFree(askedOpen_);
    while (!blocked_.empty()) askWhatIsFirst();
    primary_ = true;
}

/// A generation; the next one becomes the current one.
void Wavefront::traceAll() {
    const auto shade = [&] {
        while (flat_.size() >= 8) shadeMatte(flat_);
        while (matte_.size() >= 8) shadeMatte(matte_);
        while (glossy_.size() >= 8) shadeGlossy();
    };
    for (std::size_t row = 0; row < now_.size(); row += 16) {
        const std::uint32_t lanes = firstLanes(now_.size() - row);
        scene_.large ? traceLarge(row, lanes) : trace(now_, row, lanes);
        shade();
    }
    for (std::size_t row = 0; row < open_.size(); row += 16) trace(open_, row, firstLanes(open_.size() - row)), shade();
    if (!primary_) groups_[0].secondaryRays += now_.size();
    primary_ = false;
    now_.clear(), nowOther_.clear(), open_.clear();
    std::swap(now_, next_), nowOther_.swap(nextOther_);
}

namespace {

/// Some of sixteen rows to the end of another queue with the same columns.
void moveOn(const LaneQueue& from, std::size_t row, std::uint32_t lanes, LaneQueue& to) {
    to.reserve(16);
    for (std::size_t at = 0; at < 16; at += 8) {
        if (!(lanes >> at & 0xFFu)) continue;
        const auto rows = to.add(lanes >> at & 0xFFu);
        for (std::size_t c = 0; c < from.columns(); ++c) rows.put(c, from.load(c, row + at));
    }
}

/// Sixteen rays in a queue's columns.
bvh::RayRows rowsOf(const LaneQueue& from, std::size_t front, std::size_t row, std::uint32_t lanes, float tMin,
                    float tMax) {
    const auto at = [&](std::size_t column) { return from.at(column, row); };
    return {{at(kOrigin), at(kOrigin + 1), at(kOrigin + 2)},
            {at(kDirection), at(kDirection + 1), at(kDirection + 2)},
            at(front),
            tMin,
            tMax,
            lanes};
}
/// The same as a packet.
void read(const LaneQueue& from, std::size_t row, std::uint32_t lanes, float tMin, float tMax, RayPacket16& rays) {
    float* const to[] = {rays.originX, rays.originY, rays.originZ, rays.directionX, rays.directionY, rays.directionZ};
    for (std::size_t c = 0; c < 6; ++c) std::memcpy(to[c], from.at(kOrigin + c, row), 16 * sizeof(float));
    for (int at = 0; at < 16; at += 8) {
        store(rays.tMin + at, all(tMin)), store(rays.tMax + at, all(tMax));
        const I8 active = lanesFrom(lanes, at);
        std::memcpy(rays.active + at, &active, sizeof active);
    }
}

I8 kindsAt(const std::int32_t* kinds) {
    I8 r;
    std::memcpy(&r, kinds, sizeof r);
    return r;
}

}  // namespace

/// The lanes that must be treated elsewhere, whatever these sixteen rays hit.
std::uint32_t Wavefront::lanesOfOthers(const LaneQueue& from, std::size_t row) {
    std::uint32_t result = 0;
    for (std::size_t at = 0; at < 16; at += 8) {
        const I8 calls = bits(from.load(kCalls, row + at)) & ((1 << kCallBits) - 1),
                 depth = bits(from.load(kPixel, row + at)) >> 16;
        result |= laneBits((bits(from.load(kOther, row + at)) != 0) | (calls > static_cast<std::int32_t>(kMaxCalls)) |
                           (depth >= static_cast<std::int32_t>(kMaxDepth)))
                  << at;
    }
    return result;
}

float Wavefront::nearest() const {
    return primary_ ? 0 : kLeave;
}
float Wavefront::farthest() const {
    return primary_ ? static_cast<float>(camera_.visibilityLimit) : std::numeric_limits<float>::infinity();
}

void Wavefront::trace(const LaneQueue& from, std::size_t row, std::uint32_t lanes) {
    RayPacket16 rays;
    read(from, row, lanes, nearest(), farthest(), rays);
    const std::uint32_t hits = scene_.world->intersect(rays, primary_);
    if (lanes != hits) miss(from, row, rays, lanes & ~hits);
    if (!hits) return;
    PacketHits16 met;
    alignas(64) std::int32_t kinds[16]{};
    if (scene_.world->hits(rays, hits, met))
        std::fill(kinds, kinds + 16, plain_.kindOf(met.instance[std::countr_zero(hits)]));
    else
        for (std::uint32_t rest = hits; rest; rest &= rest - 1)
            kinds[std::countr_zero(rest)] = plain_.kindOf(met.instance[std::countr_zero(rest)]);
    sort(from, row, rays, hits, met, kinds, nullptr);
}

/// Traces against the large triangles alone; rays that stay open wait until there are sixteen.
void Wavefront::traceLarge(std::size_t row, std::uint32_t lanes) {
    RayPacket16 rays;
    bvh::LargeHits reported;
    std::uint32_t open = 0;
    const std::uint32_t hits =
        scene_.large->intersect(rowsOf(now_, kFront, row, lanes, nearest(), farthest()), rays, reported, open);
    if (const std::uint32_t missed = lanes & ~(hits | open)) miss(now_, row, rays, missed);
    if (hits) sort(now_, row, rays, hits, reported.hits, reported.label, &reported.faces);
    if (open) moveOn(now_, row, open, open_);
}

/// Treats the hits of sixteen rays, by the kind of surface.
void Wavefront::sort(const LaneQueue& from, std::size_t row, RayPacket16& rays, std::uint32_t hits,
                     const PacketHits16& met, const std::int32_t* kinds, const PacketHits16* faces) {
    const auto lanesOf = [kinds](int what) {
        return laneBits((kindsAt(kinds) & what) != 0) | laneBits((kindsAt(kinds + 8) & what) != 0) << 8;
    };
    const std::uint32_t matte = hits & lanesOf(PlainSurfaces::matte), glossy = hits & lanesOf(PlainSurfaces::glossy),
                        solid = lanesOf(PlainSurfaces::kSolid), black = lanesOf(PlainSurfaces::kBlack),
                        shines = lanesOf(PlainSurfaces::kShines);
    std::uint32_t back = 0;
    for (int at = 0; at < 16; at += 8) {
        const V8 d{load(rays.directionX + at), load(rays.directionY + at), load(rays.directionZ + at)},
            n{load(met.normalX + at), load(met.normalY + at), load(met.normalZ + at)};
        back |= laneBits(dot(d, n) > 0.0f) << at;
    }
    // The back of a solid is not there.
    const std::uint32_t plain = (matte | glossy) & ~(solid & back) & ~lanesOfOthers(from, row);
    if (shines & plain) shine(from, row, rays, met, shines & plain);
    if (primary_)
        for (std::uint32_t rest = plain; rest; rest &= rest - 1)
            sumOf(from.bits(kPixel, row + static_cast<std::size_t>(std::countr_zero(rest)))).a += 1;
    const std::uint32_t even = matte & plain & ~black, flat = faces ? even & lanesOf(PlainSurfaces::kFlat) : 0;
    if (flat) keep(flat_, from, row, rays, *faces, flat);
    if (even != flat) keep(matte_, from, row, rays, met, even & ~flat);
    if (glossy & plain) keep(glossy_, from, row, rays, met, glossy & plain);
    if (hits & ~plain) handOver(from, row, rays, hits & ~plain);
}

void Wavefront::miss(const LaneQueue& from, std::size_t row, const RayPacket16& rays, std::uint32_t lanes) {
    for (std::uint32_t rest = std::isinf(scene_.countsFrom) ? 0 : lanes; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        const std::size_t at = row + static_cast<std::size_t>(lane);
        if (from.number(kDensity, at) > 0 || from.vector(kRayNormal, at) == Vec3f(0)) continue;
        const Vec3f direction(rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]);
        groups_[0].chanceFinds += largest(Vec3f(scene_.skyColor(direction, true))) >= scene_.countsFrom;
    }
    if (scene_.evenSky) {
        const Vec4f& sky = scene_.skyLinear;
        if (Vec3f(sky) == Vec3f(0) && !primary_) return;
        for (std::size_t at = 0; at < 16; at += 8) {
            if (!(lanes >> at & 0xFFu)) continue;
            const V8 weight = from.loadV(kWeight, row + at);
            alignas(32) std::uint32_t pixels[8];
            std::memcpy(pixels, from.at(kPixel, row + at), sizeof pixels);
            add({weight.x * sky.r, weight.y * sky.g, weight.z * sky.b}, all(primary_ ? sky.a : 0), pixels,
                lanes >> at & 0xFFu);
        }
        return;
    }
    for (; lanes; lanes &= lanes - 1) {
        const int lane = std::countr_zero(lanes);
        const std::size_t at = row + static_cast<std::size_t>(lane);
        const Vec4f sky = scene_.skyColor({rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]}, true);
        sumOf(from.bits(kPixel, at)) += Vec4f(from.vector(kWeight, at) * Vec3f(sky), primary_ ? sky.a : 0);
    }
}

/// Adds the light that is emitted out there, weighted by the share that no sampled direction brings.
void Wavefront::shine(const LaneQueue& from, std::size_t row, const RayPacket16& rays, const PacketHits16& hits,
                      std::uint32_t lanes) {
    for (; lanes; lanes &= lanes - 1) {
        const int lane = std::countr_zero(lanes);
        const std::size_t at = row + static_cast<std::size_t>(lane);
        Vec3f light = plain_.emissive(hits.instance[lane]);
        const float density = from.number(kDensity, at);
        const Vec3f normal = from.vector(kRayNormal, at);
        float other = 0;
        if (scene_.emitters && density > 0)
            other = emitterDensity(scene_, hits.instance[lane], hits.triangle[lane], from.vector(kOrigin, at),
                                   from.vector(kDirection, at), rays.tMax[lane], normal);
        if (other > 0)
            light *= powerHeuristic(density, other);
        else
            groups_[0].chanceFinds += normal != Vec3f(0) && largest(light) >= scene_.countsFrom;
        sumOf(from.bits(kPixel, at)) += Vec4f(from.vector(kWeight, at) * light, 0);
    }
}

void Wavefront::keep(LaneQueue& to, const LaneQueue& from, std::size_t row, const RayPacket16& rays,
                     const PacketHits16& hits, std::uint32_t lanes) {
    to.reserve(16);
    const auto bitsAt = [](const std::uint32_t* numbers) {
        F8 r;
        std::memcpy(&r, numbers, sizeof r);
        return r;
    };
    for (std::size_t at = 0; at < 16; at += 8) {
        const std::uint32_t some = lanes >> at & 0xFFu;
        if (!some) continue;
        const auto rows = to.add(some);
        rows.put(kInstance, bitsAt(hits.instance + at)), rows.put(kTriangle, bitsAt(hits.triangle + at));
        rows.put(kDistance, load(rays.tMax + at));
        for (std::size_t c = kDirection; c <= kCalls; ++c) rows.put(c, from.load(c, row + at));
        rows.put(kU, load(hits.u + at)), rows.put(kV, load(hits.v + at));
        rows.put(kOutside, V8{load(hits.normalX + at), load(hits.normalY + at), load(hits.normalZ + at)});
    }
}

/// Leaves lanes that are not plain to path.cpp; rays that follow from them come back.
void Wavefront::handOver(const LaneQueue& from, std::size_t row, RayPacket16& rays, std::uint32_t lanes) {
    PathTask tasks[16];
    for (std::uint32_t rest = lanes; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        const std::size_t at = row + static_cast<std::size_t>(lane);
        PathTask& task = tasks[lane];
        if (const std::uint32_t other = from.bits(kOther, at)) task = nowOther_[other - 1];
        task.origin = from.vector(kOrigin, at), task.direction = from.vector(kDirection, at);
        task.weight = from.vector(kWeight, at), task.normal = from.vector(kRayNormal, at);
        task.first = from.number(kFirst, at), task.odds = from.number(kOdds, at), task.fate = from.number(kFate, at);
        task.travelled = from.number(kTravelled, at), task.density = from.number(kDensity, at);
        const std::uint32_t pixel = from.bits(kPixel, at);
        task.pixel = static_cast<std::uint16_t>(pixel), task.depth = static_cast<std::uint16_t>(pixel >> 16);
        task.random = PathRandom::ofParts(from.bits(kCalls, at), reverseBits(from.bits(kIndex, at))).state();
    }
    others_(rays, lanes, tasks, onward_);
    for (const PathTask& task : onward_) push(task);
    onward_.clear();
}

void Wavefront::push(const PathTask& task) {
    next_.reserve(1);
    const std::size_t at = next_.addOne();
    next_.set(kOrigin, at, task.origin), next_.set(kDirection, at, task.direction);
    next_.set(kWeight, at, task.weight), next_.set(kRayNormal, at, task.normal);
    next_.set(kFirst, at, task.first), next_.set(kOdds, at, task.odds), next_.set(kFate, at, task.fate);
    next_.set(kTravelled, at, task.travelled), next_.set(kDensity, at, task.density);
    next_.set(kPixel, at, std::uint32_t{task.pixel} | std::uint32_t{task.depth} << 16);
    const PathRandom random(task.random);
    next_.set(kIndex, at, reverseBits(random.index())), next_.set(kCalls, at, random.sequenceAndCalls());
    std::uint32_t other = 0;
    if (task.passes > 0 || task.line > 0 || task.media) {
        nextOther_.push_back(task);
        other = static_cast<std::uint32_t>(nextOther_.size());
    }
    next_.set(kOther, at, other), next_.set(kFront, at, kNoFront);
}

// ---- surfaces -------------------------------------------------------------------------------------------------------

/// The last ones of a queue, which are taken from it.
struct Wavefront::Hits {
    std::uint32_t count, lanes;
    PlainSurfaces::Hits met;
    V8 weight;
    F8 distance, first, odds, fate, travelled, index;
    alignas(32) std::uint32_t pixel[8], calls[8];
    Numbers numbers;

    explicit Hits(LaneQueue& from) {
        count = static_cast<std::uint32_t>(std::min<std::size_t>(from.size(), 8));
        lanes = firstLanes(count);
        const std::size_t row = from.size() - count;
        std::memcpy(met.instance, from.at(kInstance, row), sizeof met.instance);
        std::memcpy(met.triangle, from.at(kTriangle, row), sizeof met.triangle);
        // Lanes without a surface repeat one that is there.
        for (std::uint32_t lane = count; lane < 8; ++lane)
            met.instance[lane] = met.instance[0], met.triangle[lane] = met.triangle[0];
        met.u = from.load(kU, row), met.v = from.load(kV, row);
        met.outside = from.loadV(kOutside, row), met.direction = from.loadV(kDirection, row);
        weight = from.loadV(kWeight, row);
        distance = from.load(kDistance, row), first = from.load(kFirst, row), odds = from.load(kOdds, row);
        fate = from.load(kFate, row), travelled = from.load(kTravelled, row), index = from.load(kIndex, row);
        std::memcpy(pixel, from.at(kPixel, row), sizeof pixel), std::memcpy(calls, from.at(kCalls, row), sizeof calls);
        numbers = Numbers(calls, unsignedBits(index), count);
        from.drop(count);
    }
    Hits(const Hits&) = delete;
    Hits& operator=(const Hits&) = delete;
    /// The instances, where they are seen from their fronts; else kNoFront.
    I8 front() const {
        I8 instances;
        std::memcpy(&instances, met.instance, sizeof instances);
        return instances | (dot(met.direction, met.outside) > 0.0f);
    }
};

void Wavefront::shadeMatte(LaneQueue& from) {
    const Hits hits(from);
    PlainSurfaces::Surfaces s;
    if (&from == &flat_)
        PlainSurfaces::fetchFaces(scene_.large->table(), hits.met, s);
    else
        plain_.fetch(hits.met, s);
    if (scene_.emitters)
        lookForLight(hits, s, [&](const V8& direction, F8 density) {
            return s.base * shownMatte(direction, density, s.normal, s.facing);
        });
    F8 u, v;
    hits.numbers.pair(callsOfLights_ + 2, u, v);
    follow(hits, s, scatterMatte(s.base, s.normal, u, v));
}

void Wavefront::shadeGlossy() {
    const Hits hits(glossy_);
    PlainSurfaces::Surfaces s;
    plain_.fetch(hits.met, s);
    const V8 back{-hits.met.direction.x, -hits.met.direction.y, -hits.met.direction.z};
    const Frame8 frame(s.normal, s.facing, back);
    const Bsdf8 own = plain_.bsdf(hits.met, s, back, frame.view.z);
    if (scene_.emitters)
        lookForLight(hits, s, [&](const V8& direction, F8 density) {
            return select(own.sends(), shownGlossy(direction, density, own, frame), V8{});
        });
    F8 u, v;
    hits.numbers.pair(callsOfLights_ + 2, u, v);
    follow(hits, s, scatterGlossy(own, frame, hits.numbers.one(callsOfLights_ + 1), u, v));
}

/// Chooses an emitter and a point on it for each, and queues a ray to it with the light that it would bring. `shown`:
/// of a radiance of 1 from a direction that is sampled with a density.
template <class Shown>
void Wavefront::lookForLight(const Hits& hits, const PlainSurfaces::Surfaces& s, const Shown& shown) {
    const Emitters& emitters = *scene_.emitters;
    F8 u, v;
    hits.numbers.pair(1, u, v);
    const LightTree::Choices choices = emitters.sample(s.exact, s.normal, hits.numbers.one(0), hits.lanes);
    std::uint32_t chosen = 0;
    alignas(32) std::uint32_t number[8];
    for (int lane = 0; lane < 8; ++lane) {
        const bool any = choices.emitter[lane] != Emitters::kNone;
        chosen |= static_cast<std::uint32_t>(any) << lane;
        number[lane] = any ? choices.emitter[lane] : 0;
    }
    if (!chosen) return;
    const Emitters::Eight e = emitters.eight(number);
    const F8 side = simd::sqrt(u);
    const V8 position = e.corner + e.ab * (1 - side) + e.ac * (v * side);
    const V8 start = s.leave(position - s.exact), length = position - start;
    const F8 squared = dot(length, length), distance = simd::sqrt(squared);
    const V8 direction = length * (1 / max(distance, all(1e-30f)));
    const F8 cosine = -dot(e.normal, direction);
    const F8 density = load(choices.probability) / e.area * squared / absolute(cosine);
    const V8 arriving = select(cosine < 0.0f, e.behind, e.front) * (1 / density);
    const V8 light = hits.weight * arriving * shown(direction, density);
    const I8 good = lanesFrom(chosen, 0) & (distance > 1e-12f) & (dot(direction, s.facing) > 0.0f) &
                    (dot(direction, s.normal) > 0.0f) & ((cosine > 0.0f) | e.bothSides) & (density > 0.0f) &
                    (density <= std::numeric_limits<float>::max()) & (largest(light) > 0.0f);
    const std::uint32_t lanes = laneBits(good);
    if (!lanes) return;
    groups_[0].shadowRays += static_cast<std::uint64_t>(std::popcount(lanes));
    asked_.reserve(8);
    const auto rows = asked_.add(lanes);
    rows.put(kOrigin, start), rows.put(kDirection, length), rows.put(kLight, light);
    const auto bitsAt = [](const std::uint32_t* numbers) {
        F8 r;
        std::memcpy(&r, numbers, sizeof r);
        return r;
    };
    rows.put(kAskedPixel, bitsAt(hits.pixel)), rows.put(kEmitter, bitsAt(number)), rows.put(kAskedFront, hits.front());
    if (asked_.size() >= 16) scene_.large ? askLarge() : askWhetherFree(asked_);
}

/// Roulette, and the rays of those that are left.
void Wavefront::follow(const Hits& hits, const PlainSurfaces::Surfaces& s, const Scattered8& on) {
    V8 after = hits.weight * on.weight;
    Roulette8 roulette{hits.first, hits.odds, hits.fate};
    U8 pixel;
    std::memcpy(&pixel, hits.pixel, sizeof pixel);
    if (bouncesFindSky_) {
        const I8 fresh = (pixel >> 16) == 0u;
        roulette.first = select(fresh, largest(after) * roulette_, roulette.first);
    }
    const bool draws = (laneBits(hits.odds <= Roulette8::kRedraw) & hits.lanes) != 0;
    const I8 alive = roulette.survive(after, draws ? hits.numbers.one(callsOfLights_ + 3) : F8{});
    const std::uint32_t lanes = laneBits(alive) & hits.lanes;
    if (!lanes) return;
    const V8 out = aboveSurface(on.out, s.facing);
    next_.reserve(8);
    const auto rows = next_.add(lanes);
    rows.put(kOrigin, s.leave(out)), rows.put(kDirection, out), rows.put(kWeight, after);
    rows.put(kFirst, roulette.first), rows.put(kOdds, roulette.odds), rows.put(kFate, roulette.fate);
    rows.put(kTravelled, hits.travelled + hits.distance);
    rows.put(kPixel, asFloats(pixel + (1u << 16))), rows.put(kIndex, hits.index);
    U8 calls;
    std::memcpy(&calls, hits.calls, sizeof calls);
    rows.put(kCalls, asFloats(calls + (callsOfLights_ + 4)));
    rows.put(kRayNormal, s.normal), rows.put(kDensity, on.density), rows.put(kOther, F8{});
    rows.put(kFront, hits.front());
}

// ---- rays towards emitters ------------------------------------------------------------------------------------------

/// Adds the light of the last rays of asked_ if the large triangles decide about them; the others go on to askedOpen_.
void Wavefront::askLarge() {
    const std::size_t count = std::min<std::size_t>(asked_.size(), 16), row = asked_.size() - count;
    const std::uint32_t lanes = firstLanes(count);
    std::uint32_t open = 0;
    const std::uint32_t blocked =
        scene_.large->occluded(rowsOf(asked_, kAskedFront, row, lanes, kLeave, kBefore), open);
    addLight(asked_, row, lanes & ~(blocked | open));
    if (open) moveOn(asked_, row, open, askedOpen_);
    asked_.drop(count);
    while (askedOpen_.size() >= 16) askWhetherFree(askedOpen_);
}

/// Adds the light of rays whose way is completely free; the others go on to blocked_.
void Wavefront::askWhetherFree(LaneQueue& asked) {
    const std::size_t count = std::min<std::size_t>(asked.size(), 16), row = asked.size() - count;
    const std::uint32_t lanes = firstLanes(count);
    RayPacket16 rays;
    read(asked, row, lanes, kLeave, kBefore, rays);
    const std::uint32_t blocked = scene_.world->occluded(rays, false, RayKind::view) & lanes;
    addLight(asked, row, lanes & ~blocked);
    if (blocked) moveOn(asked, row, blocked, blocked_);
    asked.drop(count);
    while (blocked_.size() >= 16) askWhatIsFirst();
}

/// Something is in the way of these: what, and does it let light through?
void Wavefront::askWhatIsFirst() {
    const std::size_t count = std::min<std::size_t>(blocked_.size(), 16), row = blocked_.size() - count;
    RayPacket16 rays;
    read(blocked_, row, firstLanes(count), kLeave, kReach, rays);
    for (std::uint32_t hits = scene_.world->intersect(rays); hits; hits &= hits - 1) {
        const int lane = std::countr_zero(hits);
        const std::size_t at = row + static_cast<std::size_t>(lane);
        const Emitters::Emitter& target = (*scene_.emitters)[blocked_.bits(kEmitter, at)];
        Vec3f left(1);
        if (reachesEmitter(scene_, target, blocked_.vector(kOrigin, at) + blocked_.vector(kDirection, at),
                           rays.ray(lane), scene_.world->hit(rays, lane), left))
            sumOf(blocked_.bits(kAskedPixel, at)) += Vec4f(left * blocked_.vector(kLight, at), 0);
    }
    blocked_.drop(count);
}

void Wavefront::addLight(const LaneQueue& from, std::size_t row, std::uint32_t lanes) {
    for (std::size_t at = 0; at < 16; at += 8) {
        if (!(lanes >> at & 0xFFu)) continue;
        alignas(32) std::uint32_t pixels[8];
        std::memcpy(pixels, from.at(kAskedPixel, row + at), sizeof pixels);
        add(from.loadV(kLight, row + at), F8{}, pixels, lanes >> at & 0xFFu);
    }
}

void Wavefront::add(const V8& light, F8 alpha, const std::uint32_t* pixels, std::uint32_t lanes) {
    float* positions[8];
    for (int lane = 0; lane < 8; ++lane) positions[lane] = lanes >> lane & 1u ? &sumOf(pixels[lane]).x : nullptr;
    addTo(positions, lanes, {light.x, light.y, light.z, alpha});
}

}  // namespace rtsg::trace
