// Whitted's recursion, unrolled: a tile's rays of one depth are traced in packets of sixteen and queue those of the
// next.
#include <algorithm>
#include <bit>
#include <cmath>

#include "surface_packet.h"
#include "tile_rays.h"

namespace rtsg::trace {

namespace {

constexpr int kMaxPasses = 250;
constexpr std::size_t kDrain = 8192;  // queued rays, so that many samples need no more memory than few

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
                const std::uint32_t active =
                    primaryRays(scene_, camera_, settings_, x0_, y0_, block, sample, rays, pixels);
                if (!active) break;
                result_.primaryRays += static_cast<std::uint64_t>(std::popcount(active));
                trace(rays, nullptr, pixels, true);
                if (next_.size() >= kDrain) drain();
            }
        }
        drain();
    }

  private:
    void drain() {
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
