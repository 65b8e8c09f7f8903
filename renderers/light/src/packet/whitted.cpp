// Whitted's recursion, unrolled: a tile's rays of one depth are traced in packets of sixteen and queue those of the
// next.
#include <algorithm>
#include <bit>
#include <cmath>

#include "seen_first.h"
#include "surface/packet_kernels.h"
#include "surface/surface_branches.h"
#include "surface/surface_detail.h"
#include "surface/surface_packet.h"
#include "tile_rays.h"
#include "trail.h"
#include "volume_march.h"

namespace rtsg::trace {

namespace {

/// Shadows that are left out add up to the cutoff at most, of however many lights; of few each to a fourth of it.
constexpr std::size_t kFewLights = 4;
constexpr float kSmallWeight = .1f;  // of a pixel
constexpr float kMinCutoff = 1e-6f;  // so that the number of rays of a sample has a bound

class Tile {
    using Round = TileLoop::Round;

  public:
    Tile(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
         std::span<TileResult> groups)
        : scene_(scene),
          settings_(settings),
          x0_(x0),
          y0_(y0),
          counts_(groups[0]),
          loop_(scene, camera, settings, x0, y0, groups),
          media_(scene) {
        if (scene.materials.bends())
            for (SurfacePacket& surfaces : surfaces_) surfaces.media = &media_;
        fromEye_.media = media_.aroundEye();
    }

    void run() {
        if (scene_.primary) find();
        if (scene_.seen) lookThrough(scene_.seen->sight().position);
        loop_.run([this](std::span<TilePacket> packets) { trace(packets); });
    }

  private:
    /// Finds the resting surfaces that the tile's primary rays meet.
    void find() {
        static_assert(kTileSide == bvh::kTilePixelsAside);
        const int samples = settings_.samplesPerPixel;
        known_.resize(static_cast<std::size_t>(samples));
        std::vector<bvh::TilePositions> inTile;
        if (samples > 1) {
            positions_.resize(known_.size()), inTile.resize(known_.size());
            findSpatialIndex(counts_.seed, x0_, y0_, positions_);
            for (std::size_t s = 0; s < known_.size(); ++s)
                for (int block = 0; block < kTilePixels / 16; ++block)
                    for (int i = 0; i < 16; ++i) {
                        const int x = block % 4 * 4 + i % 4 - kTileSide / 2, y = block / 4 * 4 + i / 4 - kTileSide / 2;
                        inTile[s].x[block][i] = positions_[s].u[block][i] + static_cast<float>(x);
                        inTile[s].y[block][i] = positions_[s].v[block][i] + static_cast<float>(y);
                    }
            loop_.usePositions(positions_);
        }
        isKnown_ =
            scene_.primary->find(x0_ / kTileSide, y0_ / kTileSide, known_, samples > 1 ? inTile.data() : nullptr);
    }

    /// Sends the primary rays through one place of all pixels, from the left and the top.
    void lookThrough(const Vec2d& position) {
        positions_.resize(1);
        for (int block = 0; block < kTilePixels / 16; ++block) {
            std::fill_n(positions_[0].u[block], 16, static_cast<float>(position.x));
            std::fill_n(positions_[0].v[block], 16, static_cast<float>(position.y));
        }
        loop_.usePositions(positions_);
    }
    /// Finds the hits of a packet's primary rays where a rasteriser has looked before. Pixels whose colour stays are
    /// done, and become inactive. Rays are traced near the known depth; those that hit nothing there, at edges that the
    /// rasteriser places otherwise, are traced in full later.
    std::uint32_t meetSeen(TilePacket& packet) {
        const SeenFirst& seen = *scene_.seen;
        const PrimarySight& sight = seen.sight();
        RayPacket16& rays = packet.rays;
        std::array<Ray, 16> whole;
        std::uint32_t asked = 0, near = 0;
        for (std::uint32_t rest = packet.active; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            const std::uint32_t bit = std::uint32_t{1} << lane;
            const std::uint16_t pixel = packet.pixels[lane];
            const std::size_t at = sight.at(loop_.x(pixel), loop_.y(pixel));
            const std::uint32_t instance = sight.instances[at];
            whole[static_cast<std::size_t>(lane)] = rays.ray(lane);
            if (seen.stays(instance)) {
                loop_.sumOf(pixel) += sight.colors[at];
                packet.active &= ~bit;
                --counts_.primaryRays;
            }
            rays.skip(lane);
            if (seen.stays(instance) || instance == kNoInstance) continue;
            asked |= bit;
            Ray ray = whole[static_cast<std::size_t>(lane)];
            if (seen.hasDepth(instance)) {
                const float t = sight.depths[at] / glm::dot(ray.direction, scene_.forward);
                ray.tMin = std::max(ray.tMin, t * (1 - SeenFirst::kDepthError));
                ray.tMax = std::min(ray.tMax, t * (1 + SeenFirst::kDepthError));
                near |= bit;
            }
            rays.set(lane, ray);
        }
        const std::uint32_t hits = asked ? scene_.world->intersect(rays, true) : 0;
        for (std::uint32_t rest = packet.active; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            const Ray& ray = whole[static_cast<std::size_t>(lane)];
            rays.tMin[lane] = ray.tMin, rays.active[lane] = -1;
            if (!(hits >> lane & 1u)) rays.tMax[lane] = ray.tMax;
        }
        for (std::uint32_t rest = near & ~hits; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            PathTask& task = loop_.push(Round::none, fromEye_);
            task.origin = rays.at(lane, rays.tMin[lane]), task.direction = rays.ray(lane).direction;
            task.travelled = task.line = rays.tMin[lane], task.pixel = packet.pixels[lane];
            packet.active &= ~(std::uint32_t{1} << lane);
            rays.skip(lane);
        }
        return hits;
    }

    /// Adds a colour that a ray has found. `linear` says that it is light, not a display value; `whole` that light is
    /// not yet part of a share, so that its weight counts as one.
    void add(std::uint16_t pixel, const PathTask* task, const Vec3f& weight, Vec3f color, bool linear, float coverage,
             bool whole = true) {
        loop_.sumOf(pixel).a += coverage * (weight.x + weight.y + weight.z) / 3;
        if (scene_.space == ColorSpace::automatic && (linear || (task && task->linear))) {
            const bool within = task && task->linear;
            if (!linear) color = linearFromSrgb(color);
            loop_.resultOf(pixel).addLight(pixel % kTilePixels, weight * color, !within && whole ? weight : Vec3f(0));
            return;
        }
        loop_.sumOf(pixel) += Vec4f(weight * color, 0);
    }
    /// The colour of a surface, seen straight or through others. If it is mixed with something before or behind it, a
    /// display value above white counts as white, as it does in browsers.
    Vec3f seenOf(const SurfacePacket& s, int lane, const PathTask* task) const {
        const Vec3f radiance = s.radiance.get(lane);
        const bool light = scene_.space == ColorSpace::linear || (s.linear >> lane & 1u) || (task && task->linear);
        const bool mixed = task || s.coverage[lane] * s.opacity[lane] < 1;
        return light || !mixed || (task && task->depth > 0) ? radiance : glm::min(radiance, Vec3f(1));
    }
    /// Whether values without a colour space of their own (sky and fog) become linear light.
    bool asLight(const PathTask* task) const { return scene_.space == ColorSpace::linear || (task && task->linear); }

    void trace(std::span<TilePacket> packets) {
        std::uint32_t hits[TileLoop::kTogether];
        for (std::size_t i = 0; i < packets.size(); ++i)
            hits[i] = scene_.seen && !packets[i].tasks ? meetSeen(packets[i])
                      : isKnown_ && !packets[i].tasks
                          ? scene_.primary->intersect(
                                packets[i].rays, known_[static_cast<std::size_t>(packets[i].sample)], packets[i].block)
                          : scene_.world->intersect(packets[i].rays, !packets[i].tasks);
        for (std::size_t i = 0; i < packets.size(); ++i)
            if (hits[i]) fetchSurfaces(scene_, packets[i].rays, hits[i], packets[i].tasks, surfaces_[i]);
        if (TileReach* reach = counts_.reach)
            for (std::size_t i = 0; i < packets.size(); ++i)
                reach->note(packets[i].rays, packets[i].active, hits[i], surfaces_[i], !packets[i].tasks);
        for (std::size_t i = 0; i < packets.size(); ++i)
            if (hits[i]) light(packets[i], hits[i], surfaces_[i]);
        for (std::size_t i = 0; i < packets.size(); ++i) take(packets[i], hits[i], surfaces_[i]);
    }

    void light(const TilePacket& packet, std::uint32_t hits, SurfacePacket& surfaces) {
        RayWeights weights;
        addLights(scene_, surfaces, counts_.shadowRays,
                  findFractions(packet, hits, surfaces, weights) ? &weights : nullptr);
    }
    /// False: no share is small enough for a closer look to pay; the others count as whole. So do linear ones, because
    /// encoding them for display enlarges small values.
    bool findFractions(const TilePacket& packet, std::uint32_t hits, const SurfacePacket& s,
                       RayWeights& weights) const {
        if (scene_.space == ColorSpace::linear || (!packet.tasks && !s.special)) return false;
        bool anySmall = false;
        weights.minimum = cutoff_ / static_cast<float>(std::max(kFewLights, scene_.lightGroups.lights.size()));
        std::fill(std::begin(weights.of), std::end(weights.of), RayWeights::kWhole);
        for (std::uint32_t rest = hits & ~s.linear; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            float weight = 1;
            if (packet.tasks) {
                const PathTask& task = packet.tasks[lane];
                if (task.linear) continue;
                weight = std::max({task.weight.x, task.weight.y, task.weight.z});
            }
            if (s.special >> lane & 1u) weight *= s.coverage[lane] * s.opacity[lane];
            if (!(weight < kSmallWeight)) continue;
            weights.of[lane] = weight;
            anySmall = true;
        }
        return anySmall;
    }

    /// Adds the results of a packet to its pixels.
    void take(const TilePacket& packet, std::uint32_t hits, SurfacePacket& surfaces) {
        const RayPacket16& rays = packet.rays;
        const PathTask* tasks = packet.tasks;
        marched_ = !scene_.volumes.empty() && march(rays, tasks, packet.pixels);
        for (std::uint32_t rest = packet.active & ~hits; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            const PathTask* task = tasks ? tasks + lane : nullptr;
            const bool light = asLight(task);
            const Vec3f direction(rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]);
            const Vec4f sky = task && task->depth > 0 ? scene_.fromFar(direction, task->lights, light)
                                                      : scene_.skyColor(direction, light);
            Vec3f weight = task ? task->weight : Vec3f(1);
            if (marched_) weight *= left_[lane];
            add(packet.pixels[lane], task, weight, Vec3f(sky), light, sky.a);
        }
        if (!hits) return;
        if (!scene_.environments.lights.empty()) addEnvironments(scene_, surfaces);
        if (surfaces.special) findPoints(scene_, surfaces);
        const bool oneSpace = scene_.space != ColorSpace::automatic || !surfaces.linear;
        const bool clearAir = !marched_ && !fromEye_.media;
        if (!tasks && !surfaces.special && oneSpace && clearAir && !isFogged(hits, surfaces)) {
            packetKernels().addToPixels(surfaces, hits, &loop_.sumOf(packet.pixels[0]).x);
            return;
        }
        if (surfaces.special) branches_.find(surfaces, hits & surfaces.special);
        for (std::uint32_t rest = hits & surfaces.special & surfaces.thin; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            branches_.behind.set(lane, RayView::leave(pointBehind(scene_, surfaces, lane), -surfaces.view.get(lane)));
        }
        for (std::uint32_t rest = hits; rest; rest &= rest - 1) finish(packet, surfaces, std::countr_zero(rest));
    }

    /// Whether anything that was met lies in a fog.
    bool isFogged(std::uint32_t hits, const SurfacePacket& s) const {
        if (!scene_.fogs.any()) return false;
        for (; hits; hits &= hits - 1) {
            if (scene_.fogs.of(s.lights[std::countr_zero(hits)]).fog.type != FogType::none) return true;
            if (s.oneInstance) return false;
        }
        return false;
    }

    /// Adds the light of volumes in front of the hits, and finds the share of the hits' light that they leave. False:
    /// none is near.
    bool march(const RayPacket16& rays, const PathTask* tasks, const std::uint16_t* pixels) {
        const std::uint32_t met = meetBox(rays, scene_.volumeBounds);
        if (!met) return false;
        for (int lane = 0; lane < 16; ++lane) {
            left_[lane] = 1;
            if (!rays.active[lane] || !(met >> lane & 1u)) continue;
            const PathTask* task = tasks ? tasks + lane : nullptr;
            const bool light = asLight(task);
            const VolumeLight found = marchVolumes(scene_, rays.ray(lane), light, task ? task->line : 0);
            left_[lane] = found.left;
            if (!(found.left < 1)) continue;
            // The radiance is complete and needs no weight; the coverage does.
            add(pixels[lane], task, task ? task->weight : Vec3f(1), found.radiance, light, 1 - found.left);
        }
        return true;
    }

    /// Adds a lane's own radiance and queues the rays that its surface asks for.
    void finish(const TilePacket& packet, const SurfacePacket& s, int lane) {
        const PathTask* tasks = packet.tasks;
        const std::uint16_t pixel = packet.pixels[lane];
        const float t = s.distance[lane];
        const PathTask& from = tasks ? tasks[lane] : fromEye_;
        Vec3f weight = from.weight;
        float fog = 1;
        if (from.media) weight = darkened(pixel, weight, glm::exp(-media_.absorption(from.media) * t));
        if (marched_) weight *= left_[lane];
        if (scene_.fogs.any())
            fog = s.fogLeft(scene_, lane, packet.rays.at(lane, t), t + (tasks ? tasks[lane].line : 0));
        if (!(s.special >> lane & 1u)) {
            const PathTask* task = tasks ? tasks + lane : nullptr;
            add(pixel, task, weight * fog, seenOf(s, lane, task), s.linear >> lane & 1u, 1);
            addFog(pixel, task, weight, fog, s.lights[lane]);
            return;
        }
        branch(packet, s, lane, weight, fog);
    }
    /// The share that absorption leaves. Absorbed light is dark, not transparent.
    Vec3f darkened(std::uint16_t pixel, const Vec3f& weight, const Vec3f& left) {
        const Vec3f lost = weight * (Vec3f(1) - left);
        loop_.sumOf(pixel).a += (lost.x + lost.y + lost.z) / 3;
        return weight * left;
    }
    void addFog(std::uint16_t pixel, const PathTask* task, const Vec3f& weight, float fog, std::uint32_t scope) {
        if (!(fog < 1)) return;
        const bool light = asLight(task);
        add(pixel, task, weight * (1 - fog), scene_.fogs.of(scope).color(light), light, 1);
    }

    /// Adds a surface's own radiance, and the fog before it.
    void addOwn(std::uint16_t pixel, const PathTask* task, const SurfacePacket& s, int lane, const Vec3f& weight,
                float fog) {
        const Vec3f shown = weight * s.coverage[lane], solid = shown * s.opacity[lane] * fog;
        add(pixel, task, solid * branches_.body.get(lane), seenOf(s, lane, task), s.linear >> lane & 1u, 0, false);
        // The mirrored part covers as far as its ray meets something, also where `body` is whole.
        const Vec3f covered = solid * branches_.covering.get(lane);
        loop_.sumOf(pixel).a += (covered.x + covered.y + covered.z) / 3;
        addFog(pixel, task, shown * branches_.whole.get(lane), fog, s.lights[lane]);
    }

    void branch(const TilePacket& packet, const SurfacePacket& s, int lane, const Vec3f& weight, float fog) {
        const std::uint16_t pixel = packet.pixels[lane];
        const float coverage = s.coverage[lane], opacity = s.opacity[lane];
        const bool glass = branches_.glass >> lane & 1u;
        const PathTask* task = packet.tasks ? packet.tasks + lane : nullptr;
        addOwn(pixel, task, s, lane, weight, fog);
        // A surface in linear light, hit by a ray that is not linear: its reflected and refracted light is linear too,
        // and shares one weight with its own colour. Light that passes straight on keeps the space of the ray.
        const bool root = scene_.space == ColorSpace::automatic && (s.linear >> lane & 1u) && !(task && task->linear);
        if (root)
            loop_.resultOf(pixel).addLight(pixel % kTilePixels, Vec3f(0),
                                           weight * fog * coverage * branches_.whole.get(lane));

        const PathTask& from = task ? *task : fromEye_;
        // Rays are filled in directly in the queue, because copying recently written parts takes as long as many
        // additions.
        const auto queue = [&](Round how, const Vec3f& fraction, const Lanes3& start, const Vec3f& towards,
                               const auto& fill) {
            if (!(std::max({fraction.x, fraction.y, fraction.z}) >= cutoff_)) return;
            PathTask& next = loop_.push(how, from);
            next.origin = start.get(lane), next.direction = towards, next.weight = fraction;
            next.travelled = from.travelled + s.distance[lane];
            next.pixel = pixel;
            fill(next);
        };
        const auto round = [&](PathTask& next) {
            next.depth = static_cast<std::uint16_t>(from.depth + 1);
            next.line = 0;
            next.lights = s.lights[lane];
            next.linear = from.linear || root;
        };

        const bool deeper = from.depth < settings_.maxDepth;
        const auto cut = [&](const Vec3f& fraction) {
            const float maximum = std::max({fraction.x, fraction.y, fraction.z});
            loop_.sumOf(pixel).a += (fraction.x + fraction.y + fraction.z) / 3;  // dark, and not clear
            if (maximum >= cutoff_) loop_.resultOf(pixel).addMissing(pixel % kTilePixels, maximum);
        };
        const Vec3f mirrored = weight * coverage * branches_.mirror.get(lane);
        if (mirrored != Vec3f(0)) {
            if (deeper)
                queue(Round::mirrored, mirrored * fog, branches_.before, branches_.mirrored.get(lane), round);
            else
                cut(mirrored * fog);
        }
        const Vec3f entering = darkened(pixel, weight * coverage * branches_.passing.get(lane) * (1 - opacity),
                                        leftBySheet(*s.material[lane]));
        if (glass && entering != Vec3f(0)) {
            if (!deeper)
                cut(entering * fog);
            else if (branches_.refracts >> lane & 1u)
                queue(Round::bent, entering * fog, branches_.behind, branches_.bent.get(lane), [&](PathTask& next) {
                    round(next);
                    next.media = s.beyond[lane];
                });
        }
        const Vec3f straight = weight * (1 - coverage) + (glass ? Vec3f(0) : entering);
        if (straight != Vec3f(0) && from.passes >= kMaxPassed) {
            cut(straight);
        } else if (straight != Vec3f(0)) {
            queue(Round::none, straight, branches_.behind, -s.view.get(lane), [&](PathTask& next) {
                next.passes = static_cast<std::uint16_t>(from.passes + 1);
                next.line = from.line + s.distance[lane];
                if (glass) next.media = s.beyond[lane];
            });
        }
    }

    const TraceScene& scene_;
    const RenderSettings& settings_;
    const float cutoff_ = std::max(settings_.cutoff, kMinCutoff);
    const int x0_, y0_;
    TileResult& counts_;  // of all groups
    TileLoop loop_;
    Media media_;
    PathTask fromEye_{};
    SurfacePacket surfaces_[TileLoop::kTogether]{};  // unused lanes stay finite
    SurfaceBranches branches_;                       // of the packet at hand
    bool isKnown_ = false;
    std::vector<bvh::TileHits> known_;        // by sample: what primary rays meet of what rests
    std::vector<SamplePositions> positions_;  // of more than one
    bool marched_ = false;                    // volumes are near the packet at hand:
    float left_[16] = {};                     // share of light that they leave
};

}  // namespace

void whittedTile(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
                 std::span<TileResult> groups) {
    Tile(scene, camera, settings, x0, y0, groups).run();
}

}  // namespace rtsg::trace
