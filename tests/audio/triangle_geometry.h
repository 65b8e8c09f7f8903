// Brute-force geometry in double precision: the reference the tests trace against, and rooms made of it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "walls/plane_index.h"

namespace rtsg::test {

/// Where most tests of a room stand.
inline const glm::dvec3 kSource{1, 1, 1.5}, kListener{4, 3, 1.5};

class TriangleGeometry : public AcousticGeometry {
  public:
    std::uint32_t addMaterial(double absorption, double scattering, double transmission = 0) {
        materials_.push_back({allBands(absorption), allBands(scattering), allBands(transmission)});
        return static_cast<std::uint32_t>(materials_.size() - 1);
    }
    std::uint32_t addMaterial(const AcousticMaterial& material) {
        materials_.push_back(material);
        return static_cast<std::uint32_t>(materials_.size() - 1);
    }
    void addTriangle(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, std::uint32_t material) {
        triangles_.push_back({a, b - a, c - a, merger_.add(a, b, c), material});
    }
    void addQuad(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d,
                 std::uint32_t material) {
        addTriangle(a, b, c, material);
        addTriangle(a, c, d, material);
    }
    /// Axis-parallel box; materials of -x +x -y +y -z +z.
    void addBox(const glm::dvec3& low, const glm::dvec3& high, const std::array<std::uint32_t, 6>& material) {
        const auto corner = [&](int i) {
            return glm::dvec3((i & 1) ? high.x : low.x, (i & 2) ? high.y : low.y, (i & 4) ? high.z : low.z);
        };
        constexpr std::array<std::array<int, 4>, 6> kFaces{
            {{0, 2, 6, 4}, {1, 5, 7, 3}, {0, 4, 5, 1}, {2, 3, 7, 6}, {0, 1, 3, 2}, {4, 6, 7, 5}}};
        for (std::size_t f = 0; f < 6; ++f)
            addQuad(corner(kFaces[f][0]), corner(kFaces[f][1]), corner(kFaces[f][2]), corner(kFaces[f][3]),
                    material[f]);
    }
    void removeLastTriangle() { triangles_.pop_back(); }
    void finish() {
        planes_ = merger_.finish();
        for (ReflectingPlane& plane : planes_) plane.mirrors = 0;
        for (const Triangle& t : triangles_)
            planes_[t.plane].mirrors = std::max(planes_[t.plane].mirrors, materials_[t.material].maxMirrored());
    }

    std::span<const ReflectingPlane> planes() const override { return planes_; }
    std::span<const AcousticMaterial> materials() const override { return materials_; }

    bool closest(const glm::dvec3& origin, const glm::dvec3& direction, double maxDistance, std::uint32_t except,
                 AcousticHit& hit) const override {
        bool found = false;
        hit.distance = maxDistance;
        for (const Triangle& t : triangles_) {
            if (t.plane == except) continue;
            const glm::dvec3 p = glm::cross(direction, t.v);
            const double determinant = glm::dot(t.u, p);
            if (determinant == 0) continue;
            const glm::dvec3 s = origin - t.a;
            const double u = glm::dot(s, p) / determinant;
            if (u < 0 || u > 1) continue;
            const glm::dvec3 q = glm::cross(s, t.u);
            const double v = glm::dot(direction, q) / determinant;
            if (v < 0 || u + v > 1) continue;
            const double distance = glm::dot(t.v, q) / determinant;
            if (distance < 0 || distance >= hit.distance) continue;
            hit = {distance, planes_[t.plane].normal, t.plane, t.material};
            found = true;
        }
        return found;
    }

    double distanceToSurface(const glm::dvec3& point) const override {
        double nearest = std::numeric_limits<double>::infinity();
        for (const Triangle& t : triangles_) nearest = std::min(nearest, distanceTo(t, point));
        return nearest;
    }

    void surfacesNear(const glm::dvec3& point, double radius, const SurfaceVisitor& visit) const override {
        for (const Triangle& t : triangles_) {
            if (distanceTo(t, point) > radius) continue;
            const glm::dvec3 normal = glm::normalize(glm::cross(t.u, t.v));
            visit({normal, glm::dot(point - t.a, normal)});
        }
    }

  private:
    struct Triangle {
        glm::dvec3 a, u, v;
        std::uint32_t plane, material;
    };

    static double distanceTo(const Triangle& t, const glm::dvec3& p) {
        const glm::dvec3 n = glm::cross(t.u, t.v), s = p - t.a;
        const double n2 = glm::dot(n, n);
        const double u = glm::dot(glm::cross(s, t.v), n) / n2, v = glm::dot(glm::cross(t.u, s), n) / n2;
        if (u >= 0 && v >= 0 && u + v <= 1) return std::abs(glm::dot(s, n)) / std::sqrt(n2);
        const auto toEdge = [&](const glm::dvec3& start, const glm::dvec3& edge) {
            const double along = std::clamp(glm::dot(p - start, edge) / glm::dot(edge, edge), 0.0, 1.0);
            return glm::distance(p, start + along * edge);
        };
        return std::min({toEdge(t.a, t.u), toEdge(t.a, t.v), toEdge(t.a + t.u, t.v - t.u)});
    }

    PlaneMerger merger_;
    std::vector<Triangle> triangles_;
    std::vector<ReflectingPlane> planes_;
    std::vector<AcousticMaterial> materials_;
};

/// A shoebox with one corner at the origin.
struct Shoebox {
    glm::dvec3 size{6, 5, 3};
    std::array<double, 6> absorption{};
    double scattering = 0;

    static Shoebox uniform(const glm::dvec3& size, double absorption, double scattering = 0) {
        Shoebox box{size, {}, scattering};
        box.absorption.fill(absorption);
        return box;
    }
    TriangleGeometry geometry() const {
        TriangleGeometry result;
        std::array<std::uint32_t, 6> materials{};
        for (std::size_t i = 0; i < 6; ++i) materials[i] = result.addMaterial(absorption[i], scattering);
        result.addBox(glm::dvec3(0), size, materials);
        result.finish();
        return result;
    }

    /// Calls visit(distance, energy, order) for every mirror image nearer than `reach`: the lattice in closed form.
    template <class Visit>
    void images(const glm::dvec3& source, const glm::dvec3& listener, double reach, Visit visit) const {
        struct Axis {
            double offset, factor;
            int order;
        };
        std::array<std::vector<Axis>, 3> axes;
        for (int a = 0; a < 3; ++a) {
            const int n = static_cast<int>(reach / size[a]) + 2;
            const double low = 1 - absorption[static_cast<std::size_t>(2 * a)];
            const double high = 1 - absorption[static_cast<std::size_t>(2 * a + 1)];
            for (int k = -n; k <= n; ++k) {
                // Cell k of the unfolded room: |k| walls crossed, low and high ones in turn.
                const double position = k % 2 == 0 ? k * size[a] + source[a] : (k + 1) * size[a] - source[a];
                const int order = std::abs(k), first = (order + 1) / 2, second = order / 2;
                const double factor = k > 0 ? std::pow(high, first) * std::pow(low, second)
                                            : std::pow(low, first) * std::pow(high, second);
                axes[static_cast<std::size_t>(a)].push_back({position - listener[a], factor, order});
            }
        }
        for (const Axis& x : axes[0])
            for (const Axis& y : axes[1]) {
                const double xy = x.offset * x.offset + y.offset * y.offset;
                if (xy > reach * reach) continue;
                for (const Axis& z : axes[2]) {
                    const double d2 = xy + z.offset * z.offset;
                    if (d2 > reach * reach) continue;
                    visit(std::sqrt(d2), x.factor * y.factor * z.factor / (4 * M_PI * d2), x.order + y.order + z.order);
                }
            }
    }
};

}  // namespace rtsg::test
