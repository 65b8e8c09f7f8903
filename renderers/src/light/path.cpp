// Path tracing: at each surface the lights are asked directly and one way on is chosen at random. A tile's paths
// advance together, in packets of sixteen.
//
// Source: Kajiya 1986; sampling of visible normals after Heitz 2018 (Journal of Computer Graphics Techniques 7, 4).
// Units: a Lambertian surface of colour c under a light of intensity 1 head-on shows c, as X3D has it; so a surface
// that sends radiance L in all directions is lit like the sky of colour L.
#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "surface_packet.h"
#include "tile_rays.h"

namespace rtsg::trace {

namespace {

constexpr int kMaxPasses = 250, kMaxBounces = 250, kSureBounces = 3;
constexpr float kSurvival = 0.95f;

float largest(const Vec3f& v) {
    return std::max({v.x, v.y, v.z});
}

/// Two unit vectors square to a unit vector and each other (Duff et al. 2017).
void basis(const Vec3f& n, Vec3f& s, Vec3f& t) {
    const float sign = std::copysign(1.0f, n.z), a = -1 / (sign + n.z), b = n.x * n.y * a;
    s = {1 + sign * n.x * n.x * a, sign * b, -sign * n.x};
    t = {b, sign + n.y * n.y * a, -n.y};
}

/// Density cos / pi about +z.
Vec3f cosineSample(float u, float v) {
    const float r = std::sqrt(u), phi = 2 * std::numbers::pi_v<float> * v;
    return {r * std::cos(phi), r * std::sin(phi), std::sqrt(std::max(1 - u, 0.0f))};
}

/// A microfacet's normal as seen from `view` (z up), for GGX of roughness alpha.
Vec3f visibleNormal(const Vec3f& view, float alpha, float u, float v) {
    const Vec3f stretched = glm::normalize(Vec3f(alpha * view.x, alpha * view.y, view.z));
    const float r = std::sqrt(u), phi = 2 * std::numbers::pi_v<float> * v;
    const float x = r * std::cos(phi);
    float y = r * std::sin(phi);
    const float blend = 0.5f * (1 + stretched.z);
    const Vec3f across = stretched.z < 0.9999f ? glm::normalize(glm::cross(Vec3f(0, 0, 1), stretched)) : Vec3f(1, 0, 0);
    const Vec3f along = glm::cross(stretched, across);
    y = (1 - blend) * std::sqrt(std::max(1 - x * x, 0.0f)) + blend * y;
    const Vec3f h = x * across + y * along + std::sqrt(std::max(1 - x * x - y * y, 0.0f)) * stretched;
    return glm::normalize(Vec3f(alpha * h.x, alpha * h.y, std::max(h.z, 1e-6f)));
}

/// Smith's masking of one direction, 2 / (1 + sqrt(1 + alpha^2 tan^2)).
float masking(float cosine, float alpha) {
    if (!(cosine > 0)) return 0;
    const float c2 = cosine * cosine;
    return 2 / (1 + std::sqrt(1 + alpha * alpha * (1 - c2) / c2));
}

class Paths {
  public:
    Paths(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
          TileResult& result)
        : scene_(scene), camera_(camera), settings_(settings), x0_(x0), y0_(y0), result_(result) {}

    void run() {
        for (int sample = 0; sample < settings_.samplesPerPixel; ++sample) {
            for (int block = 0; block < kTilePixels / 16; ++block) {
                RayPacket16 rays;
                std::uint16_t pixels[16];
                const std::uint32_t active =
                    primaryRays(scene_, camera_, settings_, x0_, y0_, block, sample, rays, pixels);
                if (!active) continue;
                result_.primaryRays += static_cast<std::uint64_t>(std::popcount(active));
                PathTask tasks[16];
                for (int lane = 0; lane < 16; ++lane) {
                    const int x = x0_ + pixels[lane] % kTileSide, y = y0_ + pixels[lane] / kTileSide;
                    tasks[lane].pixel = pixels[lane];
                    tasks[lane].random = PathRandom(settings_.seed, x, y, sample).state();
                }
                trace(rays, tasks, true);
            }
            while (!next_.empty()) {
                now_.swap(next_);
                next_.clear();
                for (std::size_t first = 0; first < now_.size(); first += 16) {
                    RayPacket16 rays;
                    const auto count = static_cast<int>(std::min<std::size_t>(16, now_.size() - first));
                    PathTask tasks[16];
                    for (int lane = 0; lane < 16; ++lane) {
                        rays.skip(lane);
                        if (lane >= count) continue;
                        tasks[lane] = now_[first + static_cast<std::size_t>(lane)];
                        rays.set(lane, {tasks[lane].origin, kLeave, tasks[lane].direction,
                                        std::numeric_limits<float>::infinity()});
                    }
                    result_.secondaryRays += static_cast<std::uint64_t>(count);
                    trace(rays, tasks, false);
                }
            }
        }
    }

  private:
    void add(const PathTask& task, const Vec3f& radiance) {
        result_.sum[task.pixel] += Vec4f(task.weight * radiance, 0);
    }
    /// Coverage belongs to the eye's own line of sight; on it a weight holds nothing but what clear surfaces left over.
    void cover(const PathTask& task, float coverage) {
        if (task.depth == 0) result_.sum[task.pixel].a += coverage * largest(task.weight);
    }

    void trace(RayPacket16& rays, PathTask* tasks, bool coherent) {
        const std::uint32_t hits = scene_.world->intersect(rays, coherent);
        for (int lane = 0; lane < 16; ++lane) {
            if (!rays.active[lane] || (hits >> lane & 1u)) continue;
            const Vec4f sky =
                scene_.skyColor({rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]}, true);
            add(tasks[lane], Vec3f(sky));
            cover(tasks[lane], sky.a);
        }
        if (!hits) return;
        fetchSurfaces(scene_, rays, hits, tasks, surfaces_);
        addLights(scene_, surfaces_, result_.shadowRays);
        findPoints(scene_, surfaces_);
        for (std::uint32_t rest = hits; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            bounce({rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]}, tasks[lane], lane);
        }
    }

    /// The share of light that a way on carries, and where to.
    struct Way {
        Vec3f share{0};
        Vec3f direction{0};
    };

    void bounce(const Vec3f& direction, PathTask task, int lane) {
        const SurfacePacket& s = surfaces_;
        const Material& material = *s.material[lane];
        const bool back = s.back >> lane & 1u;
        const Vec3f normal = s.normal.get(lane), facing = back ? -s.outside(lane) : s.outside(lane);
        const float t = s.distance[lane], coverage = s.coverage[lane], opacity = s.opacity[lane];
        PathRandom random(task.random);
        if (task.absorption != Vec3f(0)) task.weight *= glm::exp(-task.absorption * t);
        const float cosine = std::clamp(glm::dot(normal, -direction), 1e-4f, 1.0f);
        const bool glass = material.refractiveIndex > 0;
        float eta = 1;
        Vec3f mirror = material.reflectivity, body = Vec3f(1) - mirror;
        if (glass) {
            eta = back ? 1 / material.refractiveIndex : material.refractiveIndex;
            const float reflectance = fresnelDielectric(cosine, eta).mean();
            mirror += body * reflectance;
            body *= 1 - reflectance;
        }
        const Vec3f entering = coverage * body * (1 - opacity), solid = coverage * body * opacity;
        const Vec3f straight = Vec3f(1 - coverage) + (glass ? Vec3f(0) : entering);
        cover(task, 1 - largest(straight));
        if (scene_.fog.type != FogType::none && coverage > 0) {
            const float fog = fogFactor(scene_.fog.type, scene_.fog.visibilityRange, t + task.line);
            PathTask hazy = task;
            hazy.weight *= coverage * (1 - fog);
            add(hazy, scene_.fogLinear);
            if (coverage >= 1) task.weight *= fog;
        }
        PathTask own = task;
        own.weight *= solid;
        add(own, s.radiance.get(lane));

        // The ways on: mirror, through glass, straight, diffuse, glossy. One is taken.
        Way ways[5];
        ways[0].share = coverage * mirror;
        if (glass) ways[1].share = entering;
        ways[2].share = straight;
        if (material.model == ShadingModel::phong) {
            ways[3].share = solid * s.base.get(lane);
        } else if (material.model == ShadingModel::physical) {
            const Vec3f base = s.base.get(lane);
            const Vec3f f0 = glm::mix(Vec3f(0.04f), base, s.metallic[lane]);
            const Vec3f fresnel = fresnelSchlick(f0, cosine);
            ways[3].share = solid * (Vec3f(1) - fresnel) * (1 - s.metallic[lane]) * base;
            ways[4].share = solid * fresnel;
        }
        float total = 0, chance[5];
        for (int i = 0; i < 5; ++i) total += chance[i] = largest(ways[i].share);
        if (!(total > 0)) return;
        float pick = random.next() * total;
        int way = 0;
        while (way < 4 && pick >= chance[way]) pick -= chance[way++];
        if (!(chance[way] > 0)) return;
        Vec3f share = ways[way].share * (total / chance[way]);

        Vec3f out = direction;
        switch (way) {
            case 0:
                out = reflectDirection(direction, normal);
                if (glm::dot(out, facing) <= 0) out = reflectDirection(direction, facing);
                break;
            case 1: {
                auto bent = refractDirection(direction, normal, eta);
                if (bent && glm::dot(*bent, facing) >= 0) bent = refractDirection(direction, facing, eta);
                if (!bent) return;
                out = *bent;
                task.absorption = back ? Vec3f(0) : material.absorption;
                break;
            }
            case 2:
                break;
            case 3: {
                const Vec3f local = cosineSample(random.next(), random.next());
                Vec3f x, y;
                basis(normal, x, y);
                out = local.x * x + local.y * y + local.z * normal;
                if (glm::dot(out, facing) <= 0) return;  // below the true surface: nothing comes from there
                break;
            }
            case 4:
                if (!glossy(direction, normal, facing, s.base.get(lane), s.metallic[lane], s.roughness[lane], cosine,
                            random, out, share))
                    return;
                break;
            default:
                return;
        }
        task.weight *= share;
        if (way == 2) {
            if (task.passes++ >= kMaxPasses) return;
            task.line += t;
        } else {
            if (++task.depth > kMaxBounces) return;
            task.line = 0;
        }
        // Russian roulette keeps the mean: what survives carries the share of what does not.
        if (task.depth > kSureBounces && way != 2) {
            const float survival = std::min(largest(task.weight), kSurvival);
            if (!(random.next() < survival)) return;
            task.weight /= survival;
        }
        task.travelled += t;
        task.direction = out;
        task.origin = RayWorld::leave(s.point(lane), out);
        task.random = random.state();
        next_.push_back(task);
    }

    /// Reflection at a rough surface; `share` comes with Fresnel's term head-on to `cosine` and leaves with the true
    /// one.
    static bool glossy(const Vec3f& direction, const Vec3f& normal, const Vec3f& facing, const Vec3f& base,
                       float metallic, float roughness, float cosine, PathRandom& random, Vec3f& out, Vec3f& share) {
        const float alpha = std::max(roughness * roughness, 1e-3f);
        Vec3f x, y;
        basis(normal, x, y);
        const Vec3f view(glm::dot(-direction, x), glm::dot(-direction, y), cosine);
        const float u = random.next(), v = random.next();
        const Vec3f h = visibleNormal(view, alpha, u, v);
        const Vec3f light = 2 * glm::dot(view, h) * h - view;
        if (!(light.z > 0)) return false;
        out = light.x * x + light.y * y + light.z * normal;
        if (glm::dot(out, facing) <= 0) return false;
        const Vec3f f0 = glm::mix(Vec3f(0.04f), base, metallic);
        const Vec3f assumed = fresnelSchlick(f0, cosine),
                    exact = fresnelSchlick(f0, std::max(glm::dot(light, h), 0.0f));
        // Weight of a visible normal: F G2 / G1; G2 with correlated heights.
        const float gv = masking(view.z, alpha), gl = masking(light.z, alpha);
        const float g2 = gv + gl > 0 ? gv * gl / (gv + gl - gv * gl) : 0;
        share *= exact / glm::max(assumed, Vec3f(1e-6f)) * (gv > 0 ? g2 / gv : 0);
        return true;
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

void pathTile(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
              TileResult& result) {
    Paths(scene, camera, settings, x0, y0, result).run();
}

}  // namespace rtsg::trace
