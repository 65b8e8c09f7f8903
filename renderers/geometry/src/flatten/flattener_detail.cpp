// Chooses how finely curved geometry is divided: by its error in pixels, in metres, or relative to its size.
#include <algorithm>
#include <cmath>
#include <limits>

#include <rtsg/core/portable_math.h>

#include "flattener_impl.h"
#include "mesh/triangle_distance.h"

namespace rtsg {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// How many levels too fine a mesh may be: one because levels are whole, half a one against swaying.
constexpr double kSlack = 1.5;

/// No direction grows by more than this (Gershgorin's bound of the largest singular value: exact without shear).
double maxStretch(const WorldFromLocal& m) {
    const auto row = [&](int i) {
        return std::abs(glm::dot(m[i], m[0])) + std::abs(glm::dot(m[i], m[1])) + std::abs(glm::dot(m[i], m[2]));
    };
    return std::sqrt(std::max({row(0), row(1), row(2)}));
}

/// From the eye to the nearest triangle.
double distanceToMesh(const Vec3d& eye, const WorldFromLocal& m, const Mesh& mesh) {
    const auto world = [&](std::uint32_t t, std::uint32_t corner) {
        return m * Vec4d(Vec3d(mesh.positions[mesh.vertexIndex(t, corner)]), 1);
    };
    double minimum = kInfinity;
    const std::uint32_t count = mesh.strokeCount > 0 ? mesh.strokeCount : mesh.triangleCount;
    for (std::uint32_t t = 0; t < count; ++t) {
        const exact::Triangle triangle{world(t, 0), world(t, 1), world(t, 2)};
        const exact::Weights w = exact::nearest(eye, triangle);
        minimum = std::min(minimum, glm::distance(eye, triangle.at(w.u, w.v)));
    }
    return minimum;
}

/// The least that a pixel covers of a surface `distance` away, wherever in the picture that is.
double pixelAcross(const LayerSight& sight, double distance) {
    if (sight.kind == LayerSight::Kind::parallel) return sight.pixel();
    if (sight.kind == LayerSight::Kind::around) return sight.pixel() * distance;
    // Off the middle by an angle, a length across the ray takes 1 / cos^2 as many pixels as in the middle.
    const double x = glm::length(sight.right) * std::max(std::abs(sight.edges[0]), std::abs(sight.edges[1]));
    const double y = glm::length(sight.up) * std::max(std::abs(sight.edges[2]), std::abs(sight.edges[3]));
    return sight.pixel() * distance / (1 + x * x + y * y);
}

}  // namespace

double Flattener::Impl::levelNeeded(const Instance& instance, const Detail& detail, const Mesh& mesh) const {
    const WorldFromLocal& m = instance.worldFromLocal;
    const double stretch = maxStretch(m);
    if (!(stretch > 0) || !std::isfinite(stretch)) return -kInfinity;
    const auto error = [&](const TessellationOptions& cut) {
        return double{cut.chordError} * stretch * mesh.curveSize;
    };
    double allowed = options.error.metres > 0 ? double{options.error.metres} : kInfinity;
    if (options.error.ofRadius > 0) allowed = std::min(allowed, error({.chordError = options.error.ofRadius}));
    const LayerSight* sight = viewer ? flatten::sightOf(sights, instance.layer) : nullptr;
    if (sight && options.error.pixels > 0) {
        const Vec3d low(mesh.bounds.min), high(mesh.bounds.max);
        const Vec3d middle = m * Vec4d((low + high) / 2.0, 1);
        double distance = glm::distance(sight->eye, middle) - stretch * glm::length(high - low) / 2;
        if (distance <= 0) distance = distanceToMesh(sight->eye, m, mesh);
        // The surface itself may be nearer than its triangles.
        distance -= error(detail.level ? Tessellator::levelOptions(*detail.level) : TessellationOptions());
        allowed = std::min(allowed, options.error.pixels * pixelAcross(*sight, std::max(distance, 0.0)));
    }
    if (!std::isfinite(allowed)) allowed = error(TessellationOptions());  // of a layer that the picture does not show
    return portable::log2(error(Tessellator::levelOptions(0)) / allowed) / 2;
}

std::optional<int> Flattener::Impl::nextLevel(double needed, std::optional<int> now) const {
    if (options.error.metres <= 0 && options.error.ofRadius <= 0 && (!viewer || sights.empty())) return std::nullopt;
    if (now && needed <= *now && needed > *now - kSlack) return now;
    return static_cast<int>(std::ceil(std::clamp(needed, 0.0, Tessellator::kLevels - 1.0)));
}

std::shared_ptr<const Mesh> Flattener::Impl::atItsLevel(NodeId geometry, std::shared_ptr<const Mesh> mesh) {
    ++detailsCreated;
    if (!mesh || !(mesh->curveSize > 0) || options.meshes) {
        details.erase(geometry.value);
        return mesh;
    }
    Detail& detail = details[geometry.value];
    if (std::exchange(detail.chosen, false)) return mesh;
    detail.needed = -kInfinity;
    shapesAbove(geometry);
    for (const NodeId shape : shapes)
        for (std::uint32_t o = state(shape).firstOccurrence; o != kNone; o = tree[o].nextOfNode) {
            if (tree[o].slot == kNone || instances.records[tree[o].slot].geometry != geometry) continue;
            detail.needed = std::max(detail.needed, levelNeeded(instances.records[tree[o].slot], detail, *mesh));
        }
    shapes.clear();
    const std::optional<int> level = nextLevel(detail.needed, detail.level);
    if (level == detail.level) return mesh;
    detail.level = level;
    ++detailsCreated;
    return makeMesh(geometry);
}

void Flattener::Impl::chooseLevel(NodeId geometry, Detail& detail) {
    const std::optional<int> level = nextLevel(detail.needed, detail.level);
    if (level == detail.level) return;
    detail.level = level;
    detail.chosen = true;
    state(geometry).meshStale = true;
    touchGeometry(geometry);
}

void Flattener::Impl::followDetails() {
    const auto look = [&](const Instance& instance) {
        const auto known = instance.id ? details.find(instance.geometry.value) : details.end();
        const auto mesh = known == details.end() ? meshes.end() : meshes.find(instance.geometry.value);
        if (mesh == meshes.end() || !mesh->second) return details.end();
        known->second.needed = std::max(known->second.needed, levelNeeded(instance, known->second, *mesh->second));
        return known;
    };
    if (std::exchange(detailsDue, false)) {
        for (auto& [id, detail] : details) detail.needed = -kInfinity;
        for (const Instance& instance : instances.records) look(instance);
        for (auto& [id, detail] : details) chooseLevel(NodeId{id}, detail);
        return;
    }
    for (const auto* slots : {&instances.createdNow, &instances.movedNow, &instances.reboundNow})
        for (const std::uint32_t slot : *slots)
            if (const auto known = look(instances.records[slot]); known != details.end())
                chooseLevel(NodeId{known->first}, known->second);
}

Flattener::Cuts Flattener::cuts() const {
    const Impl& s = *impl_;
    Cuts cuts;
    cuts.created = s.detailsCreated;
    for (const auto& [id, detail] : s.details) {
        const auto mesh = s.meshes.find(id);
        if (mesh == s.meshes.end() || !mesh->second) continue;
        ++cuts.geometries;
        cuts.triangles += mesh->second->triangleCount;
        cuts.tooCoarse += detail.needed > Tessellator::kLevels - 1;
        if (detail.level) ++cuts.ofLevel[static_cast<std::size_t>(*detail.level)];
    }
    return cuts;
}

}  // namespace rtsg
