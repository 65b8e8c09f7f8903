// Path tracing: at each surface the lights, one shining triangle and a place of the sky are asked directly, and one way
// on is chosen at random. A tile's paths advance together, in packets of sixteen.
//
// Source: Kajiya 1986; Veach 1997, section 9.2 (what both a bounce and a chosen direction find, counts in shares);
// Russian roulette as Arvo & Kirk 1990, by the weight that is left; where the sky lights the scene, by what is left of
// what the first surface left, near what Vorba & Křivánek 2016 do with an estimate of the pixel. Units: a Lambertian
// surface of colour c under a light of intensity 1 head-on shows c, as X3D has it; so a surface that sends radiance L
// in all directions is lit like the sky of colour L.
#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "lighting/packet_random.h"
#include "lighting/path_parts.h"
#include "lighting/probe.h"
#include "lighting/sample_points.h"
#include "lighting/sky_light.h"
#include "packet/tile_rays.h"
#include "packet/volume_march.h"
#include "path_emitters.h"
#include "path_scatter.h"
#include "path_wavefront.h"
#include "surface/lanes.h"
#include "surface/surface_detail.h"
#include "surface/surface_packet.h"
#include "texture/bsdf.h"
#include "texture/bsdf8.h"

namespace rtsg::trace {

using namespace simd;

namespace {

// Roulette ends paths; this only keeps light between perfect mirrors from running for ever. Light that is cut off is
// counted.
constexpr int kMaxBounces = 10'000;
constexpr float kRedraw = Roulette8::kRedraw;

/// Two unit vectors square to a unit vector and each other (Duff et al. 2017); as path_scatter.h has them.
void basis(const Vec3f& n, Vec3f& s, Vec3f& t) {
    const float sign = n.z < -kUpright ? -1.0f : 1.0f, a = -1 / (sign + n.z), b = n.x * n.y * a;
    s = {1 + sign * n.x * n.x * a, sign * b, -sign * n.x};
    t = {b, sign + n.y * n.y * a, -n.y};
}

/// The random numbers of sixteen paths at a surface, besides those that look for light.
struct alignas(64) Draws {
    float lobePick[16]{}, lobe[16]{}, u[16]{}, v[16]{}, fate[16]{};
    std::uint64_t next[16]{};  // PathRandom's state behind it

    /// `choose`: `way` and `lobe` are wanted. `redraw`: `fate` is.
    void draw(PacketRandom& random, std::uint32_t mask, bool choose, bool redraw) {
        if (choose)
            random.next(lobePick), random.next(lobe);
        else
            random.skip(), random.skip();
        random.nextPair(u, v);
        if (redraw)
            random.next(fate);
        else
            random.skip();
        for (; mask; mask &= mask - 1) next[std::countr_zero(mask)] = random.state(std::countr_zero(mask));
    }
};

/// The data that a packet's tasks bring along.
struct alignas(64) Brought {
    Lanes3 weight{};
    float first[16]{}, odds[16]{}, fate[16]{};
    std::uint32_t fresh = 0;   // lanes straight from the eye
    std::uint32_t inside = 0;  // in what absorbs

    void read(const PathTask* tasks, std::uint32_t mask, const Media& media) {
        fresh = inside = 0;
        for (; mask; mask &= mask - 1) {
            const int lane = std::countr_zero(mask);
            const PathTask& task = tasks[lane];
            weight.set(lane, task.weight);
            first[lane] = task.first, odds[lane] = task.odds, fate[lane] = task.fate;
            fresh |= static_cast<std::uint32_t>(task.depth == 0) << lane;
            inside |= static_cast<std::uint32_t>(media.absorption(task.media) != Vec3f(0)) << lane;
        }
    }
};

/// The continuations of sixteen paths.
struct alignas(64) Onward {
    Lanes3 shown, direction, start, weight;
    float density[16], odds[16], fate[16], first[16];
    std::uint32_t alive = 0;
};

class Paths {
  public:
    Paths(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
          std::span<TileResult> groups)
        : scene_(scene),
          roulette_(pathParts().roulette),
          settings_(settings),
          counts_(groups[0]),
          loop_(scene, camera, settings, x0, y0, groups),
          media_(scene) {
        if (scene.materials.bends()) surfaces_.media = &media_;
    }

    void run() {
        loop_.run([this](std::span<TilePacket> packets) {
            for (TilePacket& packet : packets) traceOne(packet);
        });
    }

    /// The same where goesInWavefronts().
    void runInWavefronts(const Camera& camera, int x0, int y0, std::span<TileResult> groups) {
        const auto others = [this](RayPacket16& rays, std::uint32_t lanes, PathTask* tasks,
                                   std::vector<PathTask>& onward) {
            elsewhere_ = &onward;
            shade(rays, lanes, tasks);
        };
        Wavefront(scene_, camera, settings_, x0, y0, groups, roulette_, bouncesFindSky_, others).run();
    }

    /// The same from a surface that no ray has found.
    void run(const Probe& probe) {
        Material white;
        white.model = ShadingModel::phong;
        for (std::uint16_t first = 0; first < kTilePixels; first += 16) {
            for (int sample = 0; sample < settings_.samplesPerPixel; ++sample) {
                PathTask tasks[16];
                addProbe(probe, white);
                for (int lane = 0; lane < 16; ++lane) {
                    tasks[lane].pixel = static_cast<std::uint16_t>(first + lane);
                    tasks[lane].random =
                        PathRandom(settings_.seed, loop_.x(tasks[lane].pixel), loop_.y(tasks[lane].pixel), sample)
                            .state();
                }
                PacketRandom random(tasks, 0xFFFF);
                lookForLight(tasks, random);
                draws_.draw(random, 0xFFFF, true, true);
                for (int lane = 0; lane < 16; ++lane) bounce(-probe.normal, tasks[lane], lane);
            }
            loop_.finish([this](std::span<TilePacket> packets) {
                for (TilePacket& packet : packets) traceOne(packet);
            });
        }
    }

  private:
    void traceOne(TilePacket& packet) {
        if (packet.tasks) return trace(packet.rays, packet.tasks, false);
        PathTask first[16];
        int x[16], y[16];
        std::uint64_t states[16];
        for (int lane = 0; lane < 16; ++lane) {
            const std::uint16_t pixel = first[lane].pixel = packet.pixels[lane];
            x[lane] = loop_.x(pixel), y[lane] = loop_.y(pixel);
        }
        randomOfPicture(packet.seed, x, y, packet.sample, settings_.samplesPerPixel, states);
        for (int lane = 0; lane < 16; ++lane) {
            first[lane].random = states[lane], first[lane].first = roulette_;
            first[lane].media = media_.aroundEye();
        }
        trace(packet.rays, first, true);
    }

    /// Fills the packet with the probe.
    void addProbe(const Probe& probe, const Material& white) {
        const HitPoint point = probe.point();
        SurfacePacket& s = surfaces_;
        s.mask = s.linear = 0xFFFF;
        s.back = s.special = s.unlit = s.physical = s.shiny = s.thin = 0;
        s.oneInstance = s.pointsFound = true, s.filled = nullptr;
        for (int lane = 0; lane < 16; ++lane) {
            s.hits.normalX[lane] = probe.normal.x, s.hits.normalY[lane] = probe.normal.y;
            s.hits.normalZ[lane] = probe.normal.z;
            s.hits.instance[lane] = kNoInstance, s.hits.triangle[lane] = 0;
            s.position.set(lane, probe.position), s.exact.set(lane, probe.position), s.error.set(lane, point.error);
            s.view.set(lane, probe.normal), s.normal.set(lane, probe.normal);
            s.base.set(lane, Vec3f(1));
            for (Lanes3* nothing : {&s.specular, &s.emissive, &s.ambient}) nothing->set(lane, Vec3f(0));
            s.distance[lane] = s.exponent[lane] = s.metallic[lane] = s.roughness[lane] = 0;
            s.coverage[lane] = s.opacity[lane] = 1;
            s.lights[lane] = 0;
            s.within[lane] = s.beyond[lane] = 0;
            s.material[lane] = &white;
        }
    }

    void add(const PathTask& task, const Vec3f& radiance) {
        loop_.sumOf(task.pixel) += Vec4f(task.weight * radiance, 0);
    }
    /// Coverage belongs to the eye's own line of sight, as far as the first surface: who meets a clear one there tells
    /// of all that is behind it.
    static bool isFirst(const PathTask& task) { return task.depth == 0 && task.passes == 0; }
    void cover(const PathTask& task, float coverage) {
        if (isFirst(task)) loop_.sumOf(task.pixel).a += coverage * largest(task.weight);
    }
    /// The share of the background that shows through things behind a clear surface. Paths choose their way there at
    /// random, which would add noise to a pixel's coverage.
    float backgroundBehind(const Vec3f& direction, int lane) const {
        const float clear = 1 - scene_.skyColor(direction, true).a;
        if (!(clear > 0)) return 0;
        const Ray ray{RayWorld::leave(pointBehind(scene_, surfaces_, lane), direction), kLeave, direction,
                      std::numeric_limits<float>::infinity()};
        RunsIn in;
        if (surfaces_.media) in = {surfaces_.media, surfaces_.beyond[lane]};
        const float left = clear * largest(leftAlong(scene_, *scene_.world, ray, RayKind::eye, in));
        return left > 0 && !scene_.volumes.empty() ? left * volumesLeft(scene_, ray) : left;
    }

    /// Counts light that nothing but this bounce could find.
    void count(const PathTask& task, const Vec3f& light) const {
        counts_.chanceFinds += task.normal != Vec3f(0) && largest(light) >= scene_.countsFrom;
    }

    void trace(RayPacket16& rays, PathTask* tasks, bool coherent) {
        const std::uint32_t hits = scene_.world->intersect(rays, coherent);
        if (!scene_.volumes.empty()) march(rays, tasks);
        for (int lane = 0; lane < 16; ++lane) {
            if (!rays.active[lane] || (hits >> lane & 1u)) continue;
            const Vec3f direction(rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]);
            const bool seen = tasks[lane].depth == 0;
            const Vec4f sky =
                seen ? scene_.skyColor(direction, true) : scene_.fromFar(direction, tasks[lane].lights, true);
            float weight = 1;
            if (!(tasks[lane].density > 0)) count(tasks[lane], Vec3f(sky));
            if (scene_.skyLight && tasks[lane].density > 0)
                weight = powerHeuristic(tasks[lane].density, scene_.skyLight->density(direction));
            add(tasks[lane], weight * Vec3f(sky));
            cover(tasks[lane], sky.a);
        }
        if (hits) shade(rays, hits, tasks);
    }

    /// Shades the surfaces that these lanes have hit.
    void shade(const RayPacket16& rays, std::uint32_t hits, PathTask* tasks) {
        fetchSurfaces(scene_, rays, hits, tasks, surfaces_);
        PacketRandom random(tasks, hits);
        lookForLight(tasks, random);
        const std::uint32_t plain = findPlain(tasks), glossy = hits & (surfaces_.physical | surfaces_.shiny);
        bool redraw = false;
        for (std::uint32_t rest = hits; rest; rest &= rest - 1)
            redraw |= !(tasks[std::countr_zero(rest)].odds > kRedraw);
        draws_.draw(random, hits, plain != hits || glossy, redraw);
        if (plain) bouncePlain(tasks, plain, plain & glossy);
        for (std::uint32_t rest = hits & ~plain; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            bounce({rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]}, tasks[lane], lane);
        }
    }

    /// Adds the light that volumes send on the way to the hits, and weakens the light from the hits.
    void march(const RayPacket16& rays, PathTask* tasks) {
        const std::uint32_t met = meetBox(rays, scene_.volumeBounds);
        for (int lane = 0; lane < 16; ++lane) {
            if (!rays.active[lane] || !(met >> lane & 1u)) continue;
            const VolumeLight found = marchVolumes(scene_, rays.ray(lane), true, tasks[lane].line);
            add(tasks[lane], found.radiance);
            cover(tasks[lane], 1 - found.left);
            tasks[lane].weight *= found.left;
        }
    }

    /// All that is asked directly.
    void lookForLight(const PathTask* tasks, PacketRandom& random) {
        addLights(scene_, surfaces_, counts_.shadowRays);
        findPoints(scene_, surfaces_);
        found_.mask = 0;
        if (scene_.emitters) lookForEmitters(scene_, surfaces_, tasks, random, found_, counts_.shadowRays);
        lamp_.mask = 0;
        if (scene_.lamps) lookForLamps(scene_, surfaces_, random, lamp_, counts_.shadowRays);
        sky_.mask = 0;
        if (scene_.skyLight) lookForSky(scene_, surfaces_, random, sky_, counts_.shadowRays);
    }

    /// The lanes whose surfaces have no way on but from their own colours, in clear air: nearly all of most scenes.
    std::uint32_t findPlain(const PathTask* tasks) {
        const SurfacePacket& s = surfaces_;
        std::uint32_t lanes = s.mask & ~s.unlit;
        for (std::uint32_t rest = lanes & s.special; rest; rest &= rest - 1) {
            const Material& material = *s.material[std::countr_zero(rest)];
            if (material.reflectivity != Vec3f(0) || material.refractiveIndex > 0) lanes &= ~(rest & -rest);
        }
        if (scene_.fogs.any() || !lanes) return 0;
        brought_.read(tasks, lanes, media_);
        for (int at = 0; at < 16; at += 8) {
            const I8 whole = (load(s.coverage + at) == 1.0f) & (load(s.opacity + at) == 1.0f);
            lanes &= laneBits(whole) << at | 0xFFu << (8 - at);
        }
        return lanes & ~brought_.inside;
    }

    /// The light that eight surfaces reflect from sampled sources, and the directions in which they send paths on.
    struct Scattered {
        V8 lit;
        Scattered8 on;
    };

    /// The reflected light of the sampled sources for eight lanes. `shown` gives it for a radiance of 1, by direction
    /// and density.
    template <class Shown>
    V8 foundBy(const EmitterLight& from, int at, const Shown& shown) const {
        if (!(from.mask >> at & 0xFFu)) return V8{};
        const V8 light = shown(loadV(from.direction, at), load(from.density + at)) * loadV(from.light, at);
        return select(lanesFrom(from.mask, at), light, V8{});
    }

    /// Scatters at matte surfaces.
    Scattered matte(int at, const V8& normal, const V8& facing) const {
        const V8 base = loadV(surfaces_.base, at);
        const auto shown = [&](const V8& direction, F8 density) {
            const F8 all = shownMatte(direction, density, normal, facing);
            return V8{all, all, all};
        };
        const V8 lit = foundBy(found_, at, shown) + foundBy(lamp_, at, shown) + foundBy(sky_, at, shown);
        return {base * lit, scatterMatte(base, normal, load(draws_.u + at), load(draws_.v + at))};
    }

    /// Scatters at Phong surfaces with a highlight, and at physical ones.
    Scattered glossy(int at, const V8& normal, const V8& facing) const {
        const SurfacePacket& s = surfaces_;
        const Frame8 frame(normal, facing, loadV(s.view, at));
        const I8 physical = lanesFrom(s.physical, at);
        const Bsdf8 own(physical, loadV(s.base, at), select(physical, V8{}, loadV(s.specular, at)),
                        load(s.exponent + at), load(s.metallic + at), load(s.roughness + at), frame.view.z);
        const auto shown = [&](const V8& direction, F8 density) { return shownGlossy(direction, density, own, frame); };
        const V8 lit = foundBy(found_, at, shown) +
                       foundBy(lamp_, at, shown) * select(physical, all(kPhysicalLight), all(1)) +
                       foundBy(sky_, at, shown);
        return {select(own.sends(), lit, V8{}),
                scatterGlossy(own, frame, load(draws_.lobe + at), load(draws_.u + at), load(draws_.v + at))};
    }

    /// bounce() for these; `glossy`: the ones among them that do not scatter evenly.
    void bouncePlain(const PathTask* tasks, std::uint32_t lanes, std::uint32_t glossy) {
        const SurfacePacket& s = surfaces_;
        for (int at = 0; at < 16; at += 8) {
            const std::uint32_t here = lanes >> at & 0xFFu, shiny = glossy >> at & 0xFFu;
            if (!here) continue;
            const V8 normal = loadV(s.normal, at), facing = facing8(s, at), before = loadV(brought_.weight, at);
            Scattered own{};
            if (shiny != here) own = matte(at, normal, facing);
            if (shiny) {
                const Scattered other = this->glossy(at, normal, facing);
                const I8 which = lanesFrom(glossy, at);
                own = {select(which, other.lit, own.lit),
                       {select(which, other.on.out, own.on.out), select(which, other.on.weight, own.on.weight),
                        select(which, other.on.density, own.on.density)}};
            }
            storeV(onward_.shown, at, before * (loadV(s.radiance, at) + own.lit));
            const V8 out = aboveSurface(own.on.out, facing);
            storeV(onward_.direction, at, out);
            storeV(onward_.start, at, leave8(s, at, out));
            store(onward_.density + at, own.on.density);
            survive(at, before * own.on.weight);
        }
        for (std::uint32_t rest = lanes; rest; rest &= rest - 1)
            goOn(tasks[std::countr_zero(rest)], std::countr_zero(rest));
    }

    /// Roulette, as follow() has it, for paths of these weights.
    void survive(int at, V8 after) {
        Roulette8 roulette{load(brought_.first + at), load(brought_.odds + at), load(brought_.fate + at)};
        if (bouncesFindSky_)
            roulette.first = select(lanesFrom(brought_.fresh, at), largest(after) * roulette_, roulette.first);
        const I8 alive = roulette.survive(after, load(draws_.fate + at));
        onward_.alive &= ~(0xFFu << at);
        onward_.alive |= laneBits(alive) << at;
        storeV(onward_.weight, at, after);
        store(onward_.odds + at, roulette.odds), store(onward_.fate + at, roulette.fate);
        store(onward_.first + at, roulette.first);
    }

    /// Adds a lane's radiance, and queues its ray.
    void goOn(const PathTask& task, int lane) {
        const SurfacePacket& s = surfaces_;
        const Onward& to = onward_;
        Vec3f light = to.shown.get(lane);
        if (s.emissive.get(lane) != Vec3f(0)) light += task.weight * (radiance(lane, task) - s.radiance.get(lane));
        loop_.sumOf(task.pixel) += Vec4f(light, 0);
        cover(task, 1);
        if (!(to.alive >> lane & 1u)) return;
        if (task.depth >= kMaxBounces) {
            loop_.resultOf(task.pixel).addMissing(task.pixel % kTilePixels, largest(to.weight.get(lane)));
            return;
        }
        PathTask& next = push();
        next.origin = to.start.get(lane), next.direction = to.direction.get(lane), next.weight = to.weight.get(lane);
        next.travelled = task.travelled + s.distance[lane];
        next.pixel = task.pixel, next.passes = task.passes, next.media = task.media;
        next.depth = static_cast<std::uint16_t>(task.depth + 1);
        next.lights = s.lights[lane], next.linear = task.linear;
        next.random = draws_.next[lane];
        next.normal = s.normal.get(lane), next.density = to.density[lane];
        next.first = to.first[lane], next.odds = to.odds[lane], next.fate = to.fate[lane];
    }

    /// The ways on from a surface, of which one is taken.
    enum Path { mirror, enter, straight, surface, kLobes };
    struct Lobes {
        Vec3f weight[kLobes] = {};  // of the light from there
        Vec3f solid{0};             // of the surface's own light
        float chance[kLobes] = {};
        float total = 0, eta = 1;
    };

    /// The surface's own colours; nothing for unlit ones.
    Bsdf bsdf(int lane) const {
        const SurfacePacket& s = surfaces_;
        switch (s.material[lane]->model) {
            case ShadingModel::physical:
                return Bsdf::physical(s.base.get(lane), s.metallic[lane], s.roughness[lane]);
            case ShadingModel::phong:
                return Bsdf::phong(s.base.get(lane), s.specular.get(lane), s.exponent[lane]);
            case ShadingModel::unlit:
                break;
        }
        return Bsdf::phong(Vec3f(0), Vec3f(0), 0);
    }

    Lobes lobes(int lane, float cosine, const Bsdf& own) const {
        const SurfacePacket& s = surfaces_;
        const Material& material = *s.material[lane];
        const float coverage = s.coverage[lane], opacity = s.opacity[lane];
        Lobes result;
        Vec3f mirrored = material.reflectivity, body = Vec3f(1) - mirrored;
        const bool glass = material.refractiveIndex > 0;
        if (glass) {
            result.eta = s.eta[lane];
            const float reflectance = fresnelDielectric(cosine, result.eta).mean();
            mirrored += body * reflectance;
            body *= 1 - reflectance;
        }
        const Vec3f entering = coverage * body * (1 - opacity) * leftBySheet(material);
        result.solid = coverage * body * opacity;
        result.weight[mirror] = coverage * mirrored;
        result.weight[enter] = glass ? entering : Vec3f(0);
        result.weight[straight] = Vec3f(1 - coverage) + (glass ? Vec3f(0) : entering);
        result.weight[surface] = result.solid * own.albedo(cosine);
        for (int i = 0; i < kLobes; ++i) result.total += result.chance[i] = largest(result.weight[i]);
        return result;
    }

    void bounce(const Vec3f& direction, PathTask task, int lane) {
        const SurfacePacket& s = surfaces_;
        const Material& material = *s.material[lane];
        const bool back = s.back >> lane & 1u;
        const Vec3f normal = s.normal.get(lane), facing = back ? -s.outside(lane) : s.outside(lane);
        const float t = s.distance[lane];
        if (task.media) task.weight *= glm::exp(-media_.absorption(task.media) * t);
        const float cosine = std::clamp(glm::dot(normal, -direction), 1e-4f, 1.0f);
        const Bsdf own = bsdf(lane);
        const Lobes w = lobes(lane, cosine, own);
        if (isFirst(task)) {
            const float left = largest(w.weight[straight]);
            cover(task, left > 0 ? 1 - left * backgroundBehind(direction, lane) : 1);
        }
        // Light that goes straight on is fogged where its line ends, for the whole line.
        float fog = 1;
        if (scene_.fogs.any() && t + task.line > 0) {
            fog = s.fogLeft(scene_, lane, s.exact.get(lane), t + task.line);
            PathTask hazy = task;
            hazy.weight *= (Vec3f(1) - w.weight[straight]) * (1 - fog);
            add(hazy, scene_.fogs.of(s.lights[lane]).linear);
        }
        PathTask lit = task;
        lit.weight *= fog * w.solid;
        add(lit, radiance(lane, task));

        if (!(w.total > 0)) return;
        const Frame frame(normal, facing, direction, cosine);
        const float chance = w.chance[surface] / w.total;
        if (found_.mask >> lane & 1u) add(lit, found(found_, lane, own, frame, chance));
        if (lamp_.mask >> lane & 1u)
            add(lit, found(lamp_, lane, own, frame, chance) * (s.physical >> lane & 1u ? kPhysicalLight : 1.0f));
        if (sky_.mask >> lane & 1u) add(lit, found(sky_, lane, own, frame, chance));
        float pick = draws_.lobePick[lane] * w.total;
        int lobe = 0;
        while (lobe < kLobes - 1 && pick >= w.chance[lobe]) pick -= w.chance[lobe++];
        if (!(w.chance[lobe] > 0)) return;
        Vec3f weight = w.weight[lobe] * (w.total / w.chance[lobe]), out = direction;
        if (lobe == mirror) {
            out = reflectDirection(direction, normal);
            if (glm::dot(out, facing) <= 0) out = reflectDirection(direction, facing);
        } else if (lobe == enter) {
            auto bent = refractDirection(direction, normal, w.eta);
            if (bent && glm::dot(*bent, facing) >= 0) bent = refractDirection(direction, facing, w.eta);
            if (!bent) return;
            out = *bent;
        } else if (lobe == surface) {
            const BsdfSample sample = scatter(own, frame, lane, out);
            weight = w.solid * (w.total / w.chance[lobe]) * sample.weight;
            task.normal = normal, task.density = chance * sample.density;
        }
        const bool bends = material.refractiveIndex > 0, passes = lobe == enter || lobe == straight;
        if (passes && bends) task.media = s.beyond[lane];
        // Surfaces that bend light, or would without another body around them, are only reached by bounces.
        if (lobe == mirror || (passes && bends)) task.density = 0;
        task.weight *= lobe == straight ? weight : fog * weight;
        follow(task, lobe == straight, t, out, lane);
    }

    /// The directions around a surface's shading normal, and the view in them.
    struct Frame {
        Vec3f x, y, z, facing, view;
        Frame(const Vec3f& normal, const Vec3f& facesUs, const Vec3f& direction, float cosine)
            : z(normal), facing(facesUs) {
            basis(z, x, y);
            view = glm::normalize(Vec3f(glm::dot(-direction, x), glm::dot(-direction, y), cosine));
        }
        Vec3f local(const Vec3f& v) const { return {glm::dot(v, x), glm::dot(v, y), glm::dot(v, z)}; }
        /// A smooth normal's half space reaches below the true surface, where nothing comes from. Directions below it
        /// are taken from the same angle above.
        Vec3f mirrored(const Vec3f& v) const { return v - 2 * glm::dot(v, facing) * facing; }
    };

    /// A direction that the surface's own colours send light on from, and what light from there counts.
    BsdfSample scatter(const Bsdf& own, const Frame& frame, int lane, Vec3f& out) const {
        const BsdfSample sample = own.sample(frame.view, draws_.lobe[lane], draws_.u[lane], draws_.v[lane]);
        out = sample.direction.x * frame.x + sample.direction.y * frame.y + sample.direction.z * frame.z;
        if (glm::dot(out, frame.facing) < 0) out = frame.mirrored(out);
        return sample;
    }

    /// The light that the surface reflects from the sampled source. `chance`: that of a bounce by its own colours.
    static Vec3f found(const EmitterLight& from, int lane, const Bsdf& own, const Frame& frame, float chance) {
        const Vec3f direction = from.direction.get(lane);
        Vec3f result(0);
        // A bounce comes to this direction in two ways where the normal is smooth.
        for (const Vec3f& displacement : {direction, frame.mirrored(direction)}) {
            if (std::isinf(from.density[lane]) && displacement != direction) break;  // no bounce, so there is one way
            const Vec3f light = frame.local(displacement);
            if (!(light.z > 0)) continue;
            const float weight = powerHeuristic(from.density[lane], chance * own.density(frame.view, light));
            result += own.value(frame.view, light) * (weight / std::numbers::pi_v<float>);
        }
        return result * from.light.get(lane);
    }

    /// The light that the surface sends out without another bounce: that of lights, and its own emission, of which only
    /// the share counts that no chosen direction brings.
    Vec3f radiance(int lane, const PathTask& task) const {
        const Vec3f all = surfaces_.radiance.get(lane);
        const bool unlit = surfaces_.unlit >> lane & 1u;
        const Vec3f own = unlit ? surfaces_.base.get(lane) : surfaces_.emissive.get(lane);
        if (own == Vec3f(0)) return all;
        const bool asked = scene_.emitters && task.density > 0;
        const float other = asked ? emitterDensity(scene_, surfaces_, lane, task) : 0;
        if (other > 0) return all - own * (1 - powerHeuristic(task.density, other));
        count(task, own);
        return all;
    }

    /// Roulette, and the next ray: surviving paths also carry the share of those that end, which keeps the mean.
    void follow(PathTask& task, bool straightOn, float t, const Vec3f& out, int lane) {
        const float weight = largest(task.weight);
        if (!(weight > 0)) return;
        if (!straightOn) {
            // A pixel is as dark as the first surface on its way. If bounces find the light, a dark first surface must
            // not end them, since they tell the pixel from its neighbours.
            if (task.depth == 0 && bouncesFindSky_) task.first = weight * roulette_;
            const float survival = std::min(weight / task.first, 1.0f);
            // One number decides for the whole path. A pixel's numbers are spread evenly, and so are the lengths of its
            // paths.
            if (!(task.odds > kRedraw)) task.odds = 1, task.fate = draws_.fate[lane];
            task.odds *= survival;
            if (!(task.fate < task.odds)) return;
            task.weight /= survival;
        }
        const bool enough = straightOn ? task.passes >= kMaxPassed : task.depth >= kMaxBounces;
        if (enough) {
            loop_.resultOf(task.pixel).addMissing(task.pixel % kTilePixels, largest(task.weight));
            return;
        }
        if (straightOn)
            ++task.passes, task.line += t;
        else
            ++task.depth, task.line = 0, task.lights = surfaces_.lights[lane];
        task.travelled += t;
        task.direction = out;
        task.origin = RayWorld::leave(straightOn ? pointBehind(scene_, surfaces_, lane) : surfaces_.point(lane), out);
        task.random = draws_.next[lane];
        push() = task;
    }

    /// A ray that is to be followed, to be filled in.
    PathTask& push() { return elsewhere_ ? elsewhere_->emplace_back() : loop_.push(); }

    /// Whether light from far away is met by bounces alone.
    static bool meetsSky(const TraceScene& scene) {
        if (scene.skyLight) return false;
        return !scene.environments.lights.empty() || !scene.evenSky || largest(Vec3f(scene.skyLinear)) > 0;
    }

    const TraceScene& scene_;
    const bool bouncesFindSky_ = meetsSky(scene_);
    const float roulette_;  // as PathParts has it
    const RenderSettings& settings_;
    TileResult& counts_;  // of all groups
    TileLoop loop_;
    Media media_;
    std::vector<PathTask>* elsewhere_ = nullptr;  // where rays go that a wavefront follows
    SurfacePacket surfaces_{};                    // unused lanes stay finite
    EmitterLight found_{}, lamp_{}, sky_{};
    Draws draws_;
    Brought brought_;
    Onward onward_{};
};

}  // namespace

void pathTile(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
              std::span<TileResult> groups) {
    Paths paths(scene, camera, settings, x0, y0, groups);
    if (goesInWavefronts(scene, camera))
        paths.runInWavefronts(camera, x0, y0, groups);
    else
        paths.run();
}

void pathProbe(const TraceScene& scene, const Probe& probe, const RenderSettings& settings, int tile,
               TileResult& result) {
    Paths(scene, Camera(), settings, tile * kTileSide, 0, std::span(&result, 1)).run(probe);
}

}  // namespace rtsg::trace
