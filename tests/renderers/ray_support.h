// Shared by tests of RayWorld: small meshes, deltas, and an independent tracer in double precision.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/renderers/ray_world.h>

namespace rtsg::test {

inline std::shared_ptr<Mesh> makeMesh(std::vector<Vec3f> positions, std::vector<std::int32_t> triangles) {
    auto mesh = std::make_shared<Mesh>();
    mesh->positions = Array<Vec3f>(std::span<const Vec3f>(positions));
    mesh->triangles = Array<std::int32_t>(std::span<const std::int32_t>(triangles));
    mesh->triangleCount = static_cast<std::uint32_t>(triangles.size() / 3);
    for (const Vec3f& p : positions) mesh->bounds.extend(p);
    return mesh;
}

/// Octahedron, subdivided `levels` times onto the sphere of radius 1; fronts face outwards.
inline std::shared_ptr<Mesh> makeSphere(int levels) {
    std::vector<Vec3f> p{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    std::vector<std::int32_t> t{0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
    for (int level = 0; level < levels; ++level) {
        std::map<std::pair<int, int>, int> middles;
        const auto middle = [&](int a, int b) {
            auto [at, fresh] = middles.try_emplace(std::minmax(a, b), static_cast<int>(p.size()));
            if (fresh) p.push_back(glm::normalize(p[static_cast<std::size_t>(a)] + p[static_cast<std::size_t>(b)]));
            return at->second;
        };
        std::vector<std::int32_t> finer;
        for (std::size_t i = 0; i < t.size(); i += 3) {
            const int a = t[i], b = t[i + 1], c = t[i + 2], ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
            finer.insert(finer.end(), {a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca});
        }
        t = std::move(finer);
    }
    return makeMesh(std::move(p), std::move(t));
}

inline std::shared_ptr<Mesh> makeBox() {
    std::vector<Vec3f> p;
    for (int i = 0; i < 8; ++i) p.push_back({i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1});
    return makeMesh(std::move(p), {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                   2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5});
}

inline std::shared_ptr<Mesh> makeSoup(std::mt19937& random, int triangles) {
    std::uniform_real_distribution<float> unit(-1, 1);
    std::vector<Vec3f> p;
    std::vector<std::int32_t> t;
    for (int i = 0; i < triangles; ++i) {
        const Vec3f center(unit(random), unit(random), unit(random));
        for (int k = 0; k < 3; ++k) {
            p.push_back(center + .4f * Vec3f(unit(random), unit(random), unit(random)));
            t.push_back(i * 3 + k);
        }
    }
    return makeMesh(std::move(p), std::move(t));
}

/// Slanting prisms from about `low` to about `high`, closed, with as many sides of two triangles each from end to end;
/// fronts face outwards. Returns the axis of each, too.
inline std::shared_ptr<Mesh> makeBeams(std::mt19937& random, int beams, int sides, float radius,
                                       std::vector<std::pair<Vec3f, Vec3f>>* axes = nullptr) {
    std::uniform_real_distribution<float> unit(-1, 1);
    std::vector<Vec3f> p;
    std::vector<std::int32_t> t;
    for (int beam = 0; beam < beams; ++beam) {
        const Vec3f from(8 * unit(random), -4 + unit(random), 8 * unit(random));
        const Vec3f to(8 * unit(random), 4 + unit(random), 8 * unit(random));
        const Vec3f axis = glm::normalize(to - from), side = glm::normalize(glm::cross(axis, Vec3f(.3f, .1f, 1)));
        const Vec3f other = glm::cross(axis, side);
        const auto first = static_cast<std::int32_t>(p.size());
        for (const Vec3f& end : {from, to})
            for (int k = 0; k < sides; ++k) {
                const float angle = 6.2831853f * static_cast<float>(k) / static_cast<float>(sides);
                p.push_back(end + radius * (std::cos(angle) * side + std::sin(angle) * other));
            }
        for (int k = 0; k < sides; ++k) {
            const std::int32_t a = first + k, b = first + (k + 1) % sides, c = a + sides, d = b + sides;
            t.insert(t.end(), {a, b, c, b, d, c});
            if (k >= 2) t.insert(t.end(), {first, a, a - 1, first + sides, c - 1, c});
        }
        if (axes) axes->emplace_back(from, to);
    }
    return makeMesh(std::move(p), std::move(t));
}

inline Instance makeInstance(std::uint32_t slot, NodeId geometry, const WorldFromLocal& m = identityTransform(),
                             std::uint32_t generation = 0) {
    Instance instance;
    instance.id = {slot, generation};
    instance.shape = NodeId{1000 + slot};
    instance.geometry = geometry;
    instance.worldFromLocal = m;
    return instance;
}

inline WorldFromLocal translation(Vec3d t) {
    WorldFromLocal m(1.0);
    m[3] = t;
    return m;
}
inline WorldFromLocal scaling(Vec3d s) {
    WorldFromLocal m(1.0);
    for (int i = 0; i < 3; ++i) m[i][i] = s[i];
    return m;
}
/// Any linear part with columns of length about .3 to 3, mirrored half of the time.
inline WorldFromLocal randomTransform(std::mt19937& random, double spread) {
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> unit(-1, 1);
    for (;;) {
        WorldFromLocal m;
        for (int i = 0; i < 3; ++i) m[i] = Vec3d(normal(random), normal(random), normal(random));
        m[3] = spread * Vec3d(unit(random), unit(random), unit(random));
        const double volume = std::abs(glm::dot(m[0], glm::cross(m[1], m[2])));
        if (volume > .1 && volume < 20) return m;
    }
}

/// Every triangle of every instance, without any tree and in double precision (Moeller and Trumbore 1997).
class BruteForce {
  public:
    struct Answer {
        double t = HUGE_VAL, u = 0, v = 0;
        std::uint32_t instance = kNoInstance, triangle = 0;
        Vec3d normal{0};
        /// Smallest distance, in barycentric or relative t terms, to another decision.
        double margin = HUGE_VAL;
    };
    struct Item {
        Instance info;
        std::shared_ptr<const Mesh> mesh;
    };
    std::map<std::uint32_t, Item> items;  // by slot

    Answer intersect(const Ray& ray, Vec3d origin = Vec3d(0)) const {
        Answer best;
        double second = HUGE_VAL, edge = HUGE_VAL;
        const Vec3d o = Vec3d(ray.origin) + origin, d(ray.direction);
        for (const auto& [slot, item] : items) {
            const WorldFromLocal& m = item.info.worldFromLocal;
            const auto world = [&](Vec3f p) { return m * Vec4d(p, 1); };
            for (std::uint32_t t = 0; t < item.mesh->triangleCount; ++t) {
                const Vec3d a = world(item.mesh->vertex(t, 0)), e1 = world(item.mesh->vertex(t, 1)) - a,
                            e2 = world(item.mesh->vertex(t, 2)) - a;
                const Vec3d p = glm::cross(d, e2);
                const double determinant = glm::dot(e1, p);
                if (determinant == 0) continue;
                const Vec3d s = o - a, q = glm::cross(s, e1);
                const double u = glm::dot(s, p) / determinant, v = glm::dot(d, q) / determinant;
                const double distance = glm::dot(e2, q) / determinant;
                const double inside = std::min({u, v, 1 - u - v});
                if (distance > ray.tMin && distance < ray.tMax) edge = std::min(edge, std::abs(inside));
                if (inside < 0 || distance < ray.tMin || distance > ray.tMax) continue;
                if (distance < best.t) {
                    second = best.t;
                    const Vec3d normal = glm::normalize(glm::cross(e1, e2)) * double(determinantSign(m) < 0 ? -1 : 1);
                    best = {distance, u, v, slot, t, normal, 0};
                } else {
                    second = std::min(second, distance);
                }
            }
        }
        best.margin = std::min(edge, std::isfinite(second) ? (second - best.t) / second : HUGE_VAL);
        return best;
    }
};

inline Ray randomRay(std::mt19937& random, float spread) {
    std::uniform_real_distribution<float> unit(-1, 1);
    std::normal_distribution<float> normal;
    Ray ray;
    ray.origin = spread * Vec3f(unit(random), unit(random), unit(random));
    ray.direction = Vec3f(normal(random), normal(random), normal(random));
    return ray;
}

/// Compares single rays, packets and occlusion with the brute force. Rays too close to call are left out, and counted.
inline void expectSameHits(const RayView& world, const BruteForce& truth, std::mt19937& random, int packets,
                           float spread, double slack = 1e-5) {
    int compared = 0, hits = 0;
    for (int p = 0; p < packets; ++p) {
        RayPacket16 packet, shadow;
        Ray rays[16];
        for (int i = 0; i < 16; ++i) {
            rays[i] = randomRay(random, spread);
            if (i % 5 == 4) rays[i].tMax = spread * .3f;
            packet.set(i, rays[i]);
            shadow.set(i, rays[i]);
        }
        packet.skip(7);
        shadow.skip(7);
        const std::uint32_t hitMask = world.intersect(packet), blockedMask = world.occluded(shadow);
        EXPECT_FALSE(hitMask & 1u << 7);
        EXPECT_FALSE(blockedMask & 1u << 7);
        for (int i = 0; i < 16; ++i) {
            const BruteForce::Answer expected = truth.intersect(rays[i], world.origin());
            if (expected.margin < 1e-4) continue;
            ++compared;
            const bool hits1 = expected.instance != kNoInstance;
            hits += hits1;
            const Hit one = world.intersect(rays[i]);
            ASSERT_EQ(bool(one), hits1) << "ray " << p << "/" << i;
            EXPECT_EQ(world.occluded(rays[i]), hits1);
            if (i != 7) {
                EXPECT_EQ((hitMask >> i & 1u) != 0, hits1);
                EXPECT_EQ((blockedMask >> i & 1u) != 0, hits1);
            }
            if (!hits1) continue;
            for (const Hit& hit : {one, world.hit(packet, i)}) {
                if (i == 7 && !hit) continue;
                EXPECT_EQ(hit.instance, expected.instance);
                EXPECT_EQ(hit.triangle, expected.triangle);
                EXPECT_NEAR(hit.t, expected.t, 1e-4 * expected.t + slack);
                EXPECT_NEAR(hit.u, expected.u, 2e-3 + 10 * slack);
                EXPECT_NEAR(hit.v, expected.v, 2e-3 + 10 * slack);
                EXPECT_GT(glm::dot(Vec3d(hit.normal), expected.normal), .999);
                EXPECT_EQ(world.instance(hit.instance).info.id, truth.items.at(hit.instance).info.id);
            }
        }
    }
    if (packets >= 20) {
        EXPECT_GT(compared, packets * 8);
        EXPECT_TRUE(truth.items.size() < 7 || hits > 0);
    }
}

/// A world, and a loop over all triangles of the things that it is to get.
struct CheckedWorld {
    RayWorld world;
    BruteForce truth;
    InstanceDelta delta;
    void add(std::shared_ptr<Mesh> mesh, const WorldFromLocal& m, Motion motion = Motion::fixed) {
        const auto slot = static_cast<std::uint32_t>(truth.items.size());
        Instance instance = makeInstance(slot, NodeId{10 + slot}, m);
        instance.motion = motion;
        delta.geometries.push_back({NodeId{10 + slot}, mesh});
        delta.added.push_back(instance);
        truth.items[slot] = {instance, mesh};
    }
};

}  // namespace rtsg::test
