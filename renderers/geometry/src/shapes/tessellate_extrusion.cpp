// Extrusion (ISO/IEC 19775-1 V4.0, 13.3.5): frames along the spine, cross sections placed in them, caps.
#include <algorithm>
#include <numbers>

#include <fmt/format.h>
#include <glm/gtc/matrix_transform.hpp>

#include <rtsg/core/rotation.h>

#include "tessellate_detail.h"

namespace rtsg {

using detail::CornerMesh;
using detail::PolygonCutter;
using detail::warn;

namespace {

/// Columns X, Y, Z of a spine-aligned cross-section plane.
using Frame = glm::dmat3;

Vec3d unitOrZero(Vec3d v) {
    const double length = glm::length(v);
    return length > 0 ? v / length : Vec3d(0);
}

Vec3d anyPerpendicular(Vec3d unit) {
    const Vec3d helper = std::abs(unit.z) < 0.9 ? Vec3d(0, 0, 1) : Vec3d(1, 0, 0);
    return glm::normalize(glm::cross(unit, helper));
}

/// The smallest rotation that takes +Y to `direction`; half a turn about Z where that is not unique.
Frame frameFromY(Vec3d direction) {
    const Vec3d y = direction;
    if (y.y < -1 + 1e-12) return Frame(Vec3d(-1, 0, 0), Vec3d(0, -1, 0), Vec3d(0, 0, 1));
    // Rodrigues with axis (y.z, 0, -y.x) and cosine y.y.
    const double k = 1 / (1 + y.y);
    const Vec3d x(1 - y.x * y.x * k, -y.x, -y.x * y.z * k);
    return Frame(x, y, glm::cross(x, y));
}

/// Z of the plane at b between a and c; zero when the three are collinear to the precision of their coordinates.
Vec3d planeNormal(Vec3d a, Vec3d b, Vec3d c) {
    const Vec3d forward = c - b, backward = a - b;
    const double lf = glm::length(forward), lb = glm::length(backward);
    if (!(lf > 0) || !(lb > 0)) return Vec3d(0);
    const Vec3d z = glm::cross(forward / lf, backward / lb);
    const double magnitude = std::max({glm::length(a), glm::length(b), glm::length(c)});
    const double rounding = 4 * double{std::numeric_limits<float>::epsilon()} * magnitude / std::min(lf, lb);
    return glm::length(z) > std::max(1e-6, std::min(rounding, 0.1)) ? glm::normalize(z) : Vec3d(0);
}

/// ISO/IEC 19775-1, 13.3.5.3 and 13.3.5.4 for distinct points. If the clause leaves a frame open, since the spine turns
/// back on itself, the last direction is kept.
std::vector<Frame> framesOfDistinct(const std::vector<Vec3d>& p) {
    const std::size_t n = p.size();
    const bool closed = n > 2 && p.front() == p.back();
    std::vector<Vec3d> y(n), z(n, Vec3d(0));
    for (std::size_t i = 1; i + 1 < n; ++i) {
        y[i] = unitOrZero(p[i + 1] - p[i - 1]);
        if (y[i] == Vec3d(0)) y[i] = unitOrZero(p[i] - p[i - 1]);
        z[i] = planeNormal(p[i - 1], p[i], p[i + 1]);
    }
    y[0] = unitOrZero(p[1] - p[0]);
    y[n - 1] = unitOrZero(p[n - 1] - p[n - 2]);
    if (closed) {
        if (const Vec3d across = unitOrZero(p[1] - p[n - 2]); across != Vec3d(0)) y[0] = across;
        y[n - 1] = y[0];
        z[0] = z[n - 1] = planeNormal(p[n - 2], p[0], p[1]);
    }

    const auto defined = std::find_if(z.begin(), z.end(), [](Vec3d v) { return v != Vec3d(0); });
    if (defined == z.end()) {
        Vec3d along = unitOrZero(p[n - 1] - p[0]);
        if (along == Vec3d(0)) along = y[0];
        return std::vector<Frame>(n, frameFromY(along));
    }
    if (z[0] == Vec3d(0)) z[0] = *defined;
    std::vector<Frame> frames(n);
    for (std::size_t i = 0; i < n; ++i) {
        if (i > 0) {
            if (z[i] == Vec3d(0)) z[i] = z[i - 1];
            if (glm::dot(z[i], z[i - 1]) < 0) z[i] = -z[i];
        }
        Vec3d x = glm::cross(y[i], z[i]);
        x = glm::length(x) > 1e-6 ? glm::normalize(x) : anyPerpendicular(y[i]);
        frames[i] = Frame(x, y[i], glm::cross(x, y[i]));
    }
    if (closed) frames[n - 1] = frames[0];
    return frames;
}

/// One frame per spine point; coincident neighbours share theirs. If all points coincide, cross sections lie as they
/// are given, and orientation and scale alone make a surface of them (a ball of a turned half circle, a ring).
std::vector<Frame> spineFrames(const Array<Vec3f>& spine) {
    std::vector<Vec3d> distinct;
    std::vector<std::size_t> which;
    for (const Vec3f point : spine) {
        if (distinct.empty() || Vec3d(point) != distinct.back()) distinct.emplace_back(point);
        which.push_back(distinct.size() - 1);
    }
    if (distinct.size() < 2) return std::vector<Frame>(which.size(), Frame(1));
    const std::vector<Frame> frames = framesOfDistinct(distinct);
    std::vector<Frame> result;
    result.reserve(which.size());
    for (const std::size_t i : which) result.push_back(frames[i]);
    return result;
}

Frame rotationOf(Rotation rotation) {
    const Vec3d axis(rotation.x, rotation.y, rotation.z);
    const double length = glm::length(axis);
    if (!(length > 0) || !std::isfinite(length) || !std::isfinite(rotation.angle)) return Frame(1);
    return rotationMatrixOf(axis, double{rotation.angle});
}

/// One value holds for all points; a list that is too short goes on with its last value.
template <class T>
T valueAt(const Array<T>& values, std::size_t i, T whenEmpty) {
    return values.empty() ? whenEmpty : values[std::min(i, values.size() - 1)];
}

class Extruder {
  public:
    Extruder(Mesh& mesh, const ExtrusionParams& params) : mesh_(mesh), p_(params) {}

    void run() {
        if (!check() || !layOutRings()) return;
        sides();
        const std::size_t sideCorners = out_.positionIndex.size();
        if (p_.beginCap) cap(0, false);
        if (p_.endCap) cap(p_.spine.size() - 1, true);
        if (out_.positionIndex.empty()) {
            warn(mesh_, "the extruded surface has no area: nothing is drawn");
            return;
        }
        if (!p_.ccw)
            for (auto* index : {&out_.positionIndex, &out_.texCoordIndex})
                for (std::size_t k = 0; k < index->size(); k += 3) std::swap((*index)[k + 1], (*index)[k + 2]);
        out_.finish(mesh_);
        normals(sideCorners);
    }

  private:
    bool check() {
        const std::size_t points = p_.spine.size(), sections = p_.crossSection.size();
        const auto nothing = [&](std::string why) {
            warn(mesh_, std::move(why) + ": nothing is drawn");
            return false;
        };
        if (points < 2 || sections < 2)
            return nothing(fmt::format("spine has {} points and crossSection {}, 2 are needed", points, sections));
        if (points > detail::kMaxVertices / sections)
            return nothing(fmt::format("spine of {} points times crossSection of {} is too much", points, sections));
        const auto bad = [](auto point) { return !detail::usable(point); };
        if (std::any_of(p_.spine.begin(), p_.spine.end(), bad)) return nothing("spine is not finite");
        if (std::any_of(p_.crossSection.begin(), p_.crossSection.end(), bad))
            return nothing("crossSection is not finite");
        if (std::any_of(p_.scale.begin(), p_.scale.end(), bad)) return nothing("scale is not finite");
        if (std::any_of(p_.scale.begin(), p_.scale.end(), [](Vec2f s) { return s.x < 0 || s.y < 0; }))
            warn(mesh_, "scale may not be negative: drawn mirrored");
        const auto shortList = [&](const char* name, std::size_t size) {
            if (size > 1 && size < points)
                warn(mesh_,
                     fmt::format("{} has {} values for {} spine points: the last is repeated", name, size, points));
        };
        shortList("scale", p_.scale.size());
        shortList("orientation", p_.orientation.size());
        closedSection_ = sections > 2 && p_.crossSection[0] == p_.crossSection.back();
        perRing_ = static_cast<int>(closedSection_ ? sections - 1 : sections);
        return true;
    }

    bool layOutRings() {
        const std::vector<Frame> frames = spineFrames(p_.spine);
        for (std::size_t i = 0; i < frames.size(); ++i) {
            const Vec2f scale = valueAt(p_.scale, i, Vec2f(1));
            const Frame placed = frames[i] * rotationOf(valueAt(p_.orientation, i, Rotation{}));
            ringStart_.push_back(static_cast<int>(out_.positions.size()));
            for (int j = 0; j < perRing_; ++j) {
                const Vec2f c = p_.crossSection[static_cast<std::size_t>(j)];
                const Vec3d local(double{c.x} * scale.x, 0, double{c.y} * scale.y);
                const Vec3f point(Vec3d(p_.spine[i]) + placed * local);
                if (!detail::usable(point)) {
                    warn(mesh_, "the extruded points are not finite: nothing is drawn");
                    return false;
                }
                out_.positions.push_back(point);
            }
        }
        // A closed spine ends on its first ring, unless scale or orientation make the two differ.
        const auto ring = [&](int start) {
            return std::span(out_.positions)
                .subspan(static_cast<std::size_t>(start), static_cast<std::size_t>(perRing_));
        };
        if (frames.size() > 2 && std::ranges::equal(ring(ringStart_.front()), ring(ringStart_.back()))) {
            out_.positions.resize(static_cast<std::size_t>(ringStart_.back()));
            ringStart_.back() = 0;
        }
        return true;
    }

    void addIfDrawn(CornerMesh::Corner a, CornerMesh::Corner b, CornerMesh::Corner c) {
        const auto at = [&](CornerMesh::Corner corner) {
            return out_.positions[static_cast<std::size_t>(corner.position)];
        };
        if (at(a) != at(b) && at(b) != at(c) && at(c) != at(a)) out_.addTriangle(a, b, c);
    }

    /// 13.3.5.6: s runs from 0 to 1 over the points of crossSection, t over those of the spine.
    void sides() {
        const int sections = static_cast<int>(p_.crossSection.size()), points = static_cast<int>(p_.spine.size());
        for (int i = 0; i < points; ++i)
            for (int j = 0; j < sections; ++j)
                out_.addTexCoord({static_cast<float>(j) / static_cast<float>(sections - 1),
                                  static_cast<float>(i) / static_cast<float>(points - 1)});
        const auto corner = [&](int i, int j) {
            return CornerMesh::Corner{ringStart_[static_cast<std::size_t>(i)] + j % perRing_, 0, i * sections + j};
        };
        for (int i = 0; i + 1 < points; ++i)
            for (int j = 0; j + 1 < sections; ++j) {
                const auto a = corner(i, j), b = corner(i, j + 1), c = corner(i + 1, j + 1), d = corner(i + 1, j);
                addIfDrawn(a, b, c);
                addIfDrawn(a, c, d);
            }
    }

    /// The cross-section as a polygon, closed if need be; its larger dimension fills the texture.
    void cap(std::size_t spinePoint, bool end) {
        std::vector<Vec3f> polygon;
        std::vector<int> which;
        Vec2f low(std::numeric_limits<float>::infinity()), high(-low);
        for (int j = 0; j < perRing_; ++j) {
            const Vec2f c = p_.crossSection[static_cast<std::size_t>(j)];
            low = glm::min(low, c);
            high = glm::max(high, c);
            if (const Vec3f point(c.x, 0, c.y); polygon.empty() || polygon.back() != point) {
                polygon.push_back(point);
                which.push_back(j);
            }
        }
        const PolygonCutter::Outcome outcome = cutter_.cut(polygon, triangles_);
        if (triangles_.empty() && !capReported_) warn(mesh_, "crossSection encloses no area: no cap is drawn");
        if (outcome == PolygonCutter::Outcome::selfIntersecting && !capReported_)
            warn(mesh_, "crossSection crosses itself");
        capReported_ = true;
        const float extent = std::max(high.x - low.x, high.y - low.y);
        const int firstTexCoord = static_cast<int>(out_.texCoords.size());
        for (int j = 0; j < perRing_; ++j)
            out_.addTexCoord(extent > 0 ? (p_.crossSection[static_cast<std::size_t>(j)] - low) / extent : Vec2f(0));
        for (const auto& triangle : triangles_) {
            CornerMesh::Corner corners[3];
            for (int c = 0; c < 3; ++c) {
                const int j = which[static_cast<std::size_t>(triangle[static_cast<std::size_t>(c)])];
                corners[c] = {ringStart_[spinePoint] + j, 0, firstTexCoord + j};
            }
            end ? addIfDrawn(corners[0], corners[1], corners[2]) : addIfDrawn(corners[0], corners[2], corners[1]);
        }
    }

    /// Caps keep their own flat normals whatever the creaseAngle, so only the sides are smoothed.
    void normals(std::size_t sideCorners) {
        const float crease = detail::checkedCreaseAngle(mesh_, p_.creaseAngle);
        const std::uint32_t all = mesh_.triangleCount;
        mesh_.triangleCount = static_cast<std::uint32_t>(sideCorners / 3);
        const MeshAttribute sides = detail::generateNormals(mesh_, crease);
        mesh_.triangleCount = all;
        if (!sides.present() || all * std::size_t{3} == sideCorners) {
            mesh_.normals = sides;
            return;
        }
        const Array<Vec3f>& sideNormals = sides.values().as<Array<Vec3f>>();
        std::vector<Vec3f> values(sideNormals.begin(), sideNormals.end());
        std::vector<std::int32_t> index;
        index.reserve(all * std::size_t{3});
        for (std::uint32_t t = 0; t < sideCorners / 3; ++t)
            for (std::uint32_t c = 0; c < 3; ++c) index.push_back(static_cast<std::int32_t>(sides.valueIndex(t, c)));
        for (auto t = static_cast<std::uint32_t>(sideCorners / 3); t < all; ++t) {
            const Vec3f n = mesh_.geometricNormal(t);
            if (values.back() != n || t == sideCorners / 3) values.push_back(n);
            index.insert(index.end(), 3, static_cast<std::int32_t>(values.size()) - 1);
        }
        mesh_.normals =
            MeshAttribute(detail::toArray(values), MeshAttribute::Binding::corner, detail::toArray(index), 3);
    }

    Mesh& mesh_;
    const ExtrusionParams& p_;
    CornerMesh out_;
    PolygonCutter cutter_;
    std::vector<std::array<int, 3>> triangles_;
    std::vector<int> ringStart_;
    int perRing_ = 0;
    bool closedSection_ = false, capReported_ = false;
};

}  // namespace

Mesh tessellate(const ExtrusionParams& params) {
    Mesh mesh;
    mesh.solid = params.solid;
    Extruder(mesh, params).run();
    return mesh;
}

}  // namespace rtsg
