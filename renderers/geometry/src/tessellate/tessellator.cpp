// Remembers the meshes of geometry nodes, shares equal primitives, and forgets what is unused.
#include <rtsg/renderers/tessellator.h>

#include <algorithm>
#include <bit>
#include <utility>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "particles.h"
#include "shapes/tessellate_deform.h"
#include "shapes/tessellate_text.h"

namespace rtsg {

Tessellator::Tessellator(TessellationOptions options) : options_(options) {
    for (int level = 0; level < kLevels; ++level) levels_[static_cast<std::size_t>(level)] = levelOptions(level);
}
Tessellator::~Tessellator() = default;
Tessellator::Tessellator(Tessellator&&) noexcept = default;
Tessellator& Tessellator::operator=(Tessellator&&) noexcept = default;

std::size_t Tessellator::KeyHash::operator()(const Key& key) const {
    std::uint64_t hash = 0xcbf29ce484222325ull;
    for (const std::uint32_t word : key) {
        hash = (hash ^ word) * 0x9e3779b97f4a7c15ull;
        hash ^= hash >> 29;
    }
    return hash;
}

TessellationOptions Tessellator::levelOptions(int level) {
    return {.chordError = .25f / static_cast<float>(1 << 2 * level), .segments = 0};
}

const TessellationOptions& Tessellator::optionsOf(std::optional<int> level) const {
    return level ? levels_[static_cast<std::size_t>(*level)] : options_;
}

bool Tessellator::keyOf(const Scene& scene, NodeId geometry, std::optional<int> level, Key& key) {
    const Node* node = scene.find(geometry);
    if (!node) return false;
    key = {node->typeIndex().value, level ? static_cast<std::uint32_t>(*level) + 1 : 0};
    std::size_t at = 2;
    const auto number = [&](Field<float> field) { key[at++] = std::bit_cast<std::uint32_t>(node->get(field)); };
    const auto flag = [&](Field<bool> field) { key[1] = key[1] << 1 | (node->get(field) ? 1u : 0u); };
    switch (node->typeIndex().value) {
        case x3d::Box::type.value:
            for (int axis = 0; axis < 3; ++axis)
                key[at++] = std::bit_cast<std::uint32_t>(node->get(x3d::Box::size)[axis]);
            flag(x3d::Box::solid);
            return true;
        case x3d::Sphere::type.value:
            number(x3d::Sphere::radius);
            flag(x3d::Sphere::solid);
            return true;
        case x3d::VolumeData::type.value:
        case x3d::SegmentedVolumeData::type.value:
        case x3d::IsoSurfaceVolumeData::type.value:
            for (int axis = 0; axis < 3; ++axis)
                key[at++] = std::bit_cast<std::uint32_t>(detail::volumeSize(*node)[axis]);
            return true;
        case x3d::Cone::type.value:
            number(x3d::Cone::bottomRadius);
            number(x3d::Cone::height);
            flag(x3d::Cone::side);
            flag(x3d::Cone::bottom);
            flag(x3d::Cone::solid);
            return true;
        case x3d::Cylinder::type.value:
            number(x3d::Cylinder::radius);
            number(x3d::Cylinder::height);
            flag(x3d::Cylinder::side);
            flag(x3d::Cylinder::top);
            flag(x3d::Cylinder::bottom);
            flag(x3d::Cylinder::solid);
            return true;
        case x3d::Disk2D::type.value:
            number(x3d::Disk2D::innerRadius);
            number(x3d::Disk2D::outerRadius);
            flag(x3d::Disk2D::solid);
            return true;
        case x3d::Rectangle2D::type.value:
            for (int axis = 0; axis < 2; ++axis)
                key[at++] = std::bit_cast<std::uint32_t>(node->get(x3d::Rectangle2D::size)[axis]);
            flag(x3d::Rectangle2D::solid);
            return true;
        default:
            return false;
    }
}

std::shared_ptr<const Mesh> Tessellator::mesh(const Scene& scene, NodeId geometry, const detail::PointsOf* points,
                                              std::optional<int> level) {
    Key key;
    if (!keyOf(scene, geometry, level, key)) {
        auto mesh = deform(scene, geometry, points);
        return mesh ? mesh : make(scene, geometry, false, level, points);
    }
    if (const auto found = shared_.find(key); found != shared_.end())
        if (auto mesh = found->second.lock()) return mesh;
    auto mesh = make(scene, geometry, key[0] == x3d::Sphere::type.value, level, nullptr);
    // A mesh with diagnostics is not shared, since they name its own node.
    if (mesh && mesh->diagnostics.all().empty()) {
        forgetUnused();
        shared_[key] = mesh;
    }
    return mesh;
}

/// Null if it is no composed geometry, and for one seen for the first time: most never change, and remembering those
/// that do costs memory.
std::shared_ptr<const Mesh> Tessellator::deform(const Scene& scene, NodeId geometry, const detail::PointsOf* points) {
    const Node* node = scene.effectiveNode(geometry);
    if (!node || !detail::isComposed(*node)) return nullptr;
    const auto [found, isNew] = surfaces_.try_emplace(geometry.value);
    if (isNew && (!points || points->empty())) return nullptr;
    Mesh problems;
    const detail::ComposedParams params = detail::readComposed(scene, *node, problems, points);
    std::unique_ptr<detail::DeformingSurface>& surface = found->second;
    if (surface)
        if (auto mesh = surface->deform(params)) return mesh;
    surface = std::make_unique<detail::DeformingSurface>(params);
    Mesh& mesh = *surface->mesh();
    problems.diagnostics.append(mesh.diagnostics);
    mesh.diagnostics = std::move(problems.diagnostics);
    detail::labelDiagnostics(scene, *node, mesh);
    diagnostics_.append(mesh.diagnostics);
    return surface->mesh();
}

void Tessellator::forget(NodeId geometry) {
    surfaces_.erase(geometry.value);
}

Diagnostics Tessellator::takeDiagnostics() {
    return std::exchange(diagnostics_, Diagnostics());
}

std::shared_ptr<const Mesh> Tessellator::make(const Scene& scene, NodeId geometry, bool isSphere,
                                              std::optional<int> level, const detail::PointsOf* points) {
    if (isSphere) {
        const Node& node = scene.node(geometry);
        const float radius = node.get(x3d::Sphere::radius);
        auto& unitSphere = unitSpheres_[static_cast<std::size_t>(level.value_or(kLevels))];
        if (!unitSphere) unitSphere = std::make_shared<Mesh>(tessellate(SphereParams{}, optionsOf(level)));
        if (radius > 0.0f && radius <= 1e18f) {
            // Not make_shared: the weak pointers would keep the memory of the mesh, too.
            std::shared_ptr<Mesh> scaled(new Mesh(*unitSphere));
            scaled->solid = node.get(x3d::Sphere::solid);
            if (radius != 1.0f) {
                Vec3f* positions = scaled->positions.mutableData();
                for (std::size_t i = 0; i < scaled->positions.size(); ++i) positions[i] *= radius;
                scaled->bounds.min *= radius;
                scaled->bounds.max *= radius;
                scaled->curveSize *= radius;
            }
            return scaled;
        }
    }
    if (!text_) text_ = std::make_unique<detail::TextMaker>();
    auto mesh = detail::tessellateNode(scene, geometry, optionsOf(level), text_.get(), points);
    if (!mesh) {
        diagnostics_.error(mesh.error().where, mesh.error().text);
        return nullptr;
    }
    diagnostics_.append((*mesh)->diagnostics);
    return *mesh;
}

std::shared_ptr<const Mesh> Tessellator::particles(const Scene& scene, NodeId system, std::optional<Vec3d> eye) {
    const Node* node = scene.find(system);
    if (!node || !node->is(x3d::ParticleSystem::type)) return nullptr;
    if (!text_) text_ = std::make_unique<detail::TextMaker>();
    auto mesh = detail::particlesNode(scene, *node, options_, text_.get(), eye);
    diagnostics_.append(mesh->diagnostics);
    return mesh;
}

void Tessellator::forgetUnused() {
    if (shared_.size() < forgetAt_) return;
    std::erase_if(shared_, [](const auto& entry) { return entry.second.expired(); });
    forgetAt_ = std::max<std::size_t>(64, shared_.size() * 2);
}

}  // namespace rtsg
