// Whitted's recursion, unrolled: a tile's rays of one depth are traced in packets of sixteen and queue those of the
// next.
#include <algorithm>
#include <bit>
#include <cmath>

#include "simd8.h"
#include "surface_packet.h"

namespace rtsg::trace {

namespace {

constexpr int kMaxPasses = 250;

std::uint32_t scramble(std::uint64_t x) {
    x ^= x >> 33, x *= 0xff51afd7ed558ccdull, x ^= x >> 33, x *= 0xc4ceb9fe1a85ec53ull, x ^= x >> 33;
    return static_cast<std::uint32_t>(x);
}

std::uint32_t reverseBits(std::uint32_t x) {
    x = x << 16 | x >> 16;
    x = (x & 0x00ff00ffu) << 8 | (x & 0xff00ff00u) >> 8;
    x = (x & 0x0f0f0f0fu) << 4 | (x & 0xf0f0f0f0u) >> 4;
    x = (x & 0x33333333u) << 2 | (x & 0xccccccccu) >> 2;
    return (x & 0x55555555u) << 1 | (x & 0xaaaaaaaau) >> 1;
}

std::uint32_t sobol2(std::uint32_t index) {
    std::uint32_t result = 0;
    for (std::uint32_t v = 1u << 31; index; index >>= 1, v ^= v >> 1)
        if (index & 1u) result ^= v;
    return result;
}

/// The place of a sample in its pixel, [0, 1)^2.
Vec2f samplePlace(const RenderSettings& settings, int x, int y, int sample) {
    if (settings.samplesPerPixel == 1) return Vec2f(0.5f);
    const std::uint64_t pixel = static_cast<std::uint64_t>(y) << 32 | static_cast<std::uint32_t>(x);
    const auto index = static_cast<std::uint32_t>(sample);
    const std::uint32_t u = reverseBits(index) ^ scramble(pixel * 2 + settings.seed * 0x9e3779b97f4a7c15ull);
    const std::uint32_t v = sobol2(index) ^ scramble((pixel * 2 + 1) ^ settings.seed * 0xd1b54a32d192ed03ull);
    return {static_cast<float>(u >> 8) * 0x1p-24f, static_cast<float>(v >> 8) * 0x1p-24f};
}

class Tile {
  public:
    Tile(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
         TileResult& result)
        : scene_(scene), camera_(camera), settings_(settings), x0_(x0), y0_(y0), result_(result) {}

    void run() {
        for (int block = 0; block < kTilePixels / 16; ++block) {
            for (int sample = 0; sample < settings_.samplesPerPixel; ++sample) {
                RayPacket16 rays;
                std::uint16_t pixels[16];
                if (!primary(block, sample, rays, pixels)) break;
                trace(rays, nullptr, pixels, true);
            }
        }
        while (!next_.empty()) {
            now_.swap(next_);
            next_.clear();
            for (std::size_t first = 0; first < now_.size(); first += 16) {
                RayPacket16 rays;
                std::uint16_t pixels[16];
                const auto count = static_cast<int>(std::min<std::size_t>(16, now_.size() - first));
                for (int lane = 0; lane < 16; ++lane) {
                    rays.skip(lane);
                    if (lane >= count) continue;
                    const PathTask& task = now_[first + static_cast<std::size_t>(lane)];
                    rays.set(lane, {task.origin, kLeave, task.direction, std::numeric_limits<float>::infinity()});
                    pixels[lane] = task.pixel;
                }
                result_.secondaryRays += static_cast<std::uint64_t>(count);
                trace(rays, &now_[first], pixels, false);
            }
        }
    }

  private:
    /// Sixteen neighbouring pixels' rays; false when none of them is in the picture.
    bool primary(int block, int sample, RayPacket16& rays, std::uint16_t* pixels) {
        using namespace simd;
        alignas(32) float u[16], v[16];
        const int bx = (block & 3) * 4, by = (block >> 2) * 4;
        int active = 0;
        for (int lane = 0; lane < 16; ++lane) {
            const int px = bx + (lane & 3), py = by + (lane >> 2), x = x0_ + px, y = y0_ + py;
            pixels[lane] = static_cast<std::uint16_t>(py * kTileSide + px);
            const bool in = x < settings_.width && y < settings_.height;
            rays.active[lane] = in ? -1 : 0;
            active += in;
            const Vec2f place = samplePlace(settings_, x, y, sample);
            u[lane] = (static_cast<float>(x) + place.x) / static_cast<float>(settings_.width);
            v[lane] = (static_cast<float>(y) + place.y) / static_cast<float>(settings_.height);
        }
        if (!active) return false;
        result_.primaryRays += static_cast<std::uint64_t>(active);
        const Vec3f eye = scene_.world->fromWorld(camera_.position);
        const Vec3f right(camera_.right), up(camera_.up), forward(camera_.forward);
        const auto left = static_cast<float>(camera_.left),
                   width = static_cast<float>(camera_.rightEdge - camera_.left);
        const auto top = static_cast<float>(camera_.top), height = static_cast<float>(camera_.top - camera_.bottom);
        for (int at = 0; at < 16; at += 8) {
            const F8 x = left + width * load(u + at), y = top - height * load(v + at);
            V8 d{right.x * x + up.x * y, right.y * x + up.y * y, right.z * x + up.z * y};
            V8 o{all(eye.x), all(eye.y), all(eye.z)};
            if (camera_.orthographic) {
                o = o + d;
                d = {all(forward.x), all(forward.y), all(forward.z)};
            } else {
                d = d + V8{all(forward.x), all(forward.y), all(forward.z)};
                d = d * (1.0f / sqrt(dot(d, d)));
            }
            store(rays.originX + at, o.x), store(rays.originY + at, o.y), store(rays.originZ + at, o.z);
            store(rays.directionX + at, d.x), store(rays.directionY + at, d.y), store(rays.directionZ + at, d.z);
            store(rays.tMin + at, all(0));
            store(rays.tMax + at, all(static_cast<float>(camera_.visibilityLimit)));
        }
        return true;
    }

    void add(std::uint16_t pixel, const Vec3f& weight, const Vec3f& radiance, float coverage) {
        result_.sum[pixel] += Vec4f(weight * radiance, coverage * (weight.x + weight.y + weight.z) / 3);
    }

    void trace(RayPacket16& rays, const PathTask* tasks, const std::uint16_t* pixels, bool coherent) {
        const std::uint32_t hits = scene_.world->intersect(rays, coherent);
        for (int lane = 0; lane < 16; ++lane) {
            if (!rays.active[lane] || (hits >> lane & 1u)) continue;
            const Vec4f sky = scene_.sky->color({rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]});
            const Vec3f weight = tasks ? tasks[lane].weight : Vec3f(1);
            add(pixels[lane], weight, Vec3f(sky), sky.a);
        }
        if (!hits) return;
        fetchSurfaces(scene_, rays, hits, tasks, surfaces_);
        addLights(scene_, surfaces_, result_.shadowRays);
        if (surfaces_.special) findPoints(scene_, surfaces_);
        if (!tasks && !surfaces_.special && scene_.fog.type == FogType::none) {
            for (std::uint32_t rest = hits; rest; rest &= rest - 1) {
                const int lane = std::countr_zero(rest);
                result_.sum[pixels[lane]] += Vec4f(surfaces_.radiance.get(lane), 1);
            }
            return;
        }
        for (std::uint32_t rest = hits; rest; rest &= rest - 1) finish(rays, tasks, pixels, std::countr_zero(rest));
    }

    /// Adds what a lane's surface sends and queues the rays it asks for.
    void finish(const RayPacket16& rays, const PathTask* tasks, const std::uint16_t* pixels, int lane) {
        const SurfacePacket& s = surfaces_;
        const float t = s.distance[lane];
        Vec3f weight(1);
        float fog = 1;
        if (tasks) {
            const PathTask& task = tasks[lane];
            weight = task.weight;
            if (task.absorption != Vec3f(0)) weight *= glm::exp(-task.absorption * t);
        }
        if (scene_.fog.type != FogType::none)
            fog = fogFactor(scene_.fog.type, scene_.fog.visibilityRange, t + (tasks ? tasks[lane].line : 0));
        const auto fogged = [&](const Vec3f& radiance) { return radiance * fog + scene_.fog.color * (1 - fog); };
        if (!(s.special >> lane & 1u)) {
            add(pixels[lane], weight, fog < 1 ? fogged(s.radiance.get(lane)) : s.radiance.get(lane), 1);
            return;
        }
        branch(rays, tasks, pixels[lane], lane, weight, fog);
    }

    void branch(const RayPacket16& rays, const PathTask* tasks, std::uint16_t pixel, int lane, const Vec3f& weight,
                float fog) {
        const SurfacePacket& s = surfaces_;
        const Material& material = *s.material[lane];
        const Vec3f direction(rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]);
        const bool back = s.back >> lane & 1u;
        const Vec3f normal = s.normal.get(lane), facing = back ? -s.outside(lane) : s.outside(lane);
        const float cosine = std::clamp(glm::dot(normal, -direction), 0.0f, 1.0f);
        const float coverage = s.coverage[lane], opacity = s.opacity[lane];
        const bool glass = material.refractiveIndex > 0;

        // Shares of: the mirror, the surface's own colours, what passes.
        Vec3f mirror = material.reflectivity;
        Vec3f body = Vec3f(1) - mirror;
        float eta = 1;
        if (glass) {
            eta = back ? 1 / material.refractiveIndex : material.refractiveIndex;
            const float reflectance = fresnelDielectric(cosine, eta).mean();
            mirror += body * reflectance;
            body *= 1 - reflectance;
        } else if (material.model == ShadingModel::physical) {
            // The diffuse part already is what Fresnel leaves, so `body` stays whole.
            const Vec3f f0 = glm::mix(Vec3f(0.04f), s.base.get(lane), s.metallic[lane]);
            const float smooth = 1 - s.roughness[lane];
            mirror += body * fresnelSchlick(f0, cosine) * (smooth * smooth);
        }
        const Vec3f own = weight * coverage * body * opacity;
        const Vec3f fogColor = scene_.fog.color * (1 - fog);
        add(pixel, own, s.radiance.get(lane) * fog + fogColor, 1);

        PathTask base;
        if (tasks) base = tasks[lane];
        const Vec3f absorptionHere = base.absorption;
        base.travelled += s.distance[lane];
        base.pixel = pixel;
        const HitPoint point = s.point(lane);
        const auto queue = [&](PathTask task, const Vec3f& share, const Vec3f& towards) {
            task.weight = share;
            if (!(std::max({share.x, share.y, share.z}) >= settings_.cutoff)) return;
            task.direction = towards;
            task.origin = RayWorld::leave(point, towards);
            next_.push_back(task);
        };

        const Vec3f mirrored = weight * coverage * mirror;
        if (mirrored != Vec3f(0)) {
            if (fog < 1) add(pixel, mirrored, fogColor, 1);
            if (base.depth < settings_.maxDepth) {
                Vec3f out = reflectDirection(direction, normal);
                // A shading normal may mirror into the surface; the true one never does.
                if (glm::dot(out, facing) <= 0) out = reflectDirection(direction, facing);
                PathTask task = base;
                ++task.depth;
                task.line = 0;
                queue(task, mirrored * fog, out);
            }
        }
        const Vec3f entering = weight * coverage * body * (1 - opacity);
        if (glass && entering != Vec3f(0)) {
            const auto bent = refractDirection(direction, normal, eta);
            if (bent && base.depth < settings_.maxDepth) {
                Vec3f out = *bent;
                if (glm::dot(out, facing) >= 0) out = refractDirection(direction, facing, eta).value_or(direction);
                PathTask task = base;
                ++task.depth;
                task.line = 0;
                task.absorption = back ? Vec3f(0) : material.absorption;
                queue(task, entering * fog, out);
            }
        }
        const Vec3f straight = weight * (1 - coverage) + (glass ? Vec3f(0) : entering);
        if (straight != Vec3f(0) && base.passes < kMaxPasses) {
            PathTask task = base;
            ++task.passes;
            task.line += s.distance[lane];
            task.absorption = absorptionHere;
            queue(task, straight, direction);
        }
    }

    const TraceScene& scene_;
    const Camera& camera_;
    const RenderSettings& settings_;
    int x0_, y0_;
    TileResult& result_;
    SurfacePacket surfaces_{};  // unused lanes stay finite
    std::vector<PathTask> now_, next_;
};

}  // namespace

void whittedTile(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
                 TileResult& result) {
    Tile(scene, camera, settings, x0, y0, result).run();
}

}  // namespace rtsg::trace
