// Finds the plain instances of a scene, and fetches corners, transforms and colours of eight hits side by side.
#include "plain_surfaces.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "lanes.h"
#include "lighting/lane_gather.h"
#include "texture/bsdf.h"

namespace rtsg::trace {

using namespace simd;

namespace {

/// The kind of a material, if it is the same everywhere.
std::uint8_t kindOf(const MaterialEntry& entry) {
    const Material& m = entry.material;
    if (entry.textured || entry.transmits || entry.volume || m.back || !m.stages.empty()) return 0;
    if (m.model == ShadingModel::unlit || m.hatching.present) return 0;
    if (m.refractiveIndex > 0 || m.reflectivity != Vec3f(0) || m.absorption != Vec3f(0) || m.opacity != 1) return 0;
    const bool isMatte = m.model == ShadingModel::phong && m.linear.specular == Vec3f(0);
    const std::uint8_t shines = m.linear.emissive != Vec3f(0) ? PlainSurfaces::kShines : 0;
    const std::uint8_t black = isMatte && m.linear.base == Vec3f(0) ? PlainSurfaces::kBlack : 0;
    return static_cast<std::uint8_t>((isMatte ? PlainSurfaces::matte : PlainSurfaces::glossy) | shines | black);
}

}  // namespace

PlainSurfaces::Colors::Colors(const Material& material) : unused{} {
    const Vec3f maximum = glm::min(material.linear.base, Vec3f(1));
    const bool isPhysical = material.model == ShadingModel::physical;
    const Vec3f shine = isPhysical ? Vec3f(0) : energyLimited(maximum, material.linear.specular, material.exponent);
    for (int c = 0; c < 3; ++c) base[c] = maximum[c], specular[c] = shine[c], emissive[c] = material.linear.emissive[c];
    exponent = material.exponent, metallic = material.metallic, roughness = material.roughness;
    physical = isPhysical ? 1.0f : 0.0f;
}

PlainSurfaces::PlainSurfaces(const TraceScene& scene) : world_(scene.world) {
    const RayInstances& instances = scene.world->instances();
    kinds_.resize(instances.size()), numbers_.resize(instances.size());
    std::unordered_map<std::uint32_t, std::uint32_t> numberOf;  // of materials
    std::size_t all = 0, plain = 0;
    for (std::uint32_t slot = 0; slot < instances.size(); ++slot) {
        const RayInstance& instance = instances[slot];
        if (!instance.info.id || !instance.mesh || slot >= scene.slots.size()) continue;
        const Mesh& mesh = *instance.mesh;
        all += mesh.triangleCount;
        if (mesh.strokeCount > 0 || mesh.colors.present()) continue;
        const std::uint32_t material = scene.slots[slot].material;
        std::uint8_t kind = trace::kindOf(scene.materials[material]);
        if (kind == other) continue;
        if (mesh.solid) kind |= kSolid;
        const auto [at, isNew] = numberOf.try_emplace(material, static_cast<std::uint32_t>(colors_.size()));
        if (isNew) colors_.emplace_back(scene.materials[material].material);
        kinds_[slot] = kind, numbers_[slot] = at->second;
        plain += mesh.triangleCount;
    }
    maximum_ = plain > all / 2;
}

V8 PlainSurfaces::Surfaces::leave(const V8& towards) const {
    return leaveFrom(outside, exact, error, towards);
}

namespace {

bool areSame(const std::uint32_t* eight) {
    I8 all, first = I8{} + static_cast<std::int32_t>(eight[0]);
    std::memcpy(&all, eight, sizeof all);
    return !any(all != first);
}

/// The corners of a mesh's triangles.
struct Corners {
    const std::int32_t* triangles;
    const Vec3f* positions;
    std::size_t stride;
    explicit Corners(const Mesh& mesh)
        : triangles(mesh.triangles.data()), positions(mesh.positions.data()), stride(mesh.triangleStride) {}
    void find(std::uint32_t triangle, const float* (&corner)[3][8], int lane) const {
        const std::int32_t* const numbers = triangles + triangle * stride;
        for (int c = 0; c < 3; ++c) corner[c][lane] = &positions[numbers[c]].x;
    }
};

/// A matrix of twelve numbers, one for all lanes or one for each.
struct Matrix8 {
    F8 m[12];
    explicit Matrix8(const glm::mat4x3& one) {
        for (int i = 0; i < 12; ++i) m[i] = all((&one[0].x)[i]);
    }
    explicit Matrix8(const RayInstance* const* each) {
        for (int part = 0; part < 3; ++part) {
            const float* positions[8];
            for (int i = 0; i < 8; ++i) positions[i] = &each[i]->rayFromLocal[0].x + 4 * part;
            const Q8 q = gather4(positions);
            m[4 * part] = q.x, m[4 * part + 1] = q.y, m[4 * part + 2] = q.z, m[4 * part + 3] = q.w;
        }
    }
};

}  // namespace

/// Computes places and error bounds as RayView::point() does.
void PlainSurfaces::fetch(const Hits& hits, Surfaces& out) const {
    const bool same = areSame(hits.instance);
    const RayInstance* each[8];
    const float* corner[3][8];
    each[0] = &world_->instance(hits.instance[0]);
    if (same) {
        const Corners corners(*each[0]->mesh);
        for (int i = 0; i < 8; ++i) corners.find(hits.triangle[i], corner, i);
        out.base = broadcast(baseOf(hits.instance[0]));
    } else {
        const float* colors[8];
        for (int i = 0; i < 8; ++i) {
            each[i] = &world_->instance(hits.instance[i]);
            Corners(*each[i]->mesh).find(hits.triangle[i], corner, i);
            colors[i] = colors_[numbers_[hits.instance[i]]].base;
        }
        out.base = gather3(colors);
    }
    const F8 w = 1 - hits.u - hits.v;
    const V8 a = gather3(corner[0]) * w, b = gather3(corner[1]) * hits.u, c = gather3(corner[2]) * hits.v;
    const V8 local = a + b + c;
    const auto sum = [](F8 x, F8 y, F8 z) { return absolute(x) + absolute(y) + absolute(z); };
    const V8 size{sum(a.x, b.x, c.x), sum(a.y, b.y, c.y), sum(a.z, b.z, c.z)};
    const Matrix8 matrix = same ? Matrix8(each[0]->rayFromLocal) : Matrix8(each);
    F8 scale = all(each[0]->errorScale);
    V8 floor{all(each[0]->errorFloor.x), all(each[0]->errorFloor.y), all(each[0]->errorFloor.z)};
    if (!same)
        for (int i = 1; i < 8; ++i) {
            const Vec3f& own = each[i]->errorFloor;
            scale[i] = each[i]->errorScale, floor.x[i] = own.x, floor.y[i] = own.y, floor.z[i] = own.z;
        }
    constexpr float eps = 0x1p-24f, gamma = 12 * eps / (1 - 12 * eps);
    const auto row = [&](int r) {
        return local.x * matrix.m[r] + local.y * matrix.m[3 + r] + local.z * matrix.m[6 + r] + matrix.m[9 + r];
    };
    const auto bound = [&](int r) {
        return ((size.x * absolute(matrix.m[r]) + size.y * absolute(matrix.m[3 + r]) +
                 size.z * absolute(matrix.m[6 + r])) *
                    scale +
                absolute(matrix.m[9 + r])) *
               gamma;
    };
    out.exact = {row(0), row(1), row(2)};
    out.error = V8{bound(0), bound(1), bound(2)} + floor;
    normals(hits, each, same, out);
}

void PlainSurfaces::fetchFaces(const bvh::LargeTable& table, const Hits& hits, Surfaces& out) {
    const float* positions[8];
    const auto read = [&](int from) {
        for (int i = 0; i < 8; ++i) positions[i] = table.spots[hits.triangle[i]].corner + from;
        return gather4(positions);
    };
    const Q8 corner = read(0), second = read(4), third = read(8), error = read(12);
    const auto vector = [](const Q8& q) { return V8{q.x, q.y, q.z}; };
    out.exact = vector(corner) + vector(second) * hits.u + vector(third) * hits.v;
    out.error = vector(error), out.base = {corner.w, second.w, third.w};
    const F8 side = select(dot(hits.direction, hits.outside) > 0.0f, all(-1), all(1));
    out.outside = hits.outside, out.normal = out.facing = hits.outside * side;
}

void PlainSurfaces::normals(const Hits& hits, const RayInstance* const* each, bool same, Surfaces& out) {
    V8 n = hits.outside;
    const RayInstance& first = *each[0];
    if (same && first.mesh->normals.present()) {
        const MeshAttribute& attribute = first.mesh->normals;
        const float* corner[3][8];
        for (int i = 0; i < 8; ++i)
            for (std::uint32_t c = 0; c < 3; ++c)
                corner[c][i] = attribute.data() + std::size_t{attribute.valueIndex(hits.triangle[i], c)} * 3;
        const V8 local = attribute.binding() == MeshAttribute::Binding::face
                             ? gather3(corner[0])
                             : gather3(corner[0]) * (1 - hits.u - hits.v) + gather3(corner[1]) * hits.u +
                                   gather3(corner[2]) * hits.v;
        const glm::mat3& m = first.normalFromLocal;
        const auto row = [&](int r) { return local.x * m[0][r] + local.y * m[1][r] + local.z * m[2][r]; };
        n = {row(0), row(1), row(2)};
    } else if (!same) {
        for (int i = 0; i < 8; ++i) {
            const RayInstance& instance = *each[i];
            const MeshAttribute& attribute = instance.mesh->normals;
            if (!attribute.present()) continue;
            const Vec3f own =
                instance.normalFromLocal * Vec3f(attribute.interpolate(hits.triangle[i], hits.u[i], hits.v[i]));
            n.x[i] = own.x, n.y[i] = own.y, n.z[i] = own.z;
        }
    }
    const F8 squared = dot(n, n);
    const I8 good = (squared > 1e-24f) & (squared < 1e30f);
    n = select(good, n * (1 / simd::sqrt(select(good, squared, all(1)))), hits.outside);
    const F8 side = select(dot(hits.direction, hits.outside) > 0.0f, all(-1), all(1));
    out.outside = hits.outside;
    out.normal = n * side, out.facing = hits.outside * side;
}

Bsdf8 PlainSurfaces::bsdf(const Hits& hits, const Surfaces& surfaces, const V8& back, F8 cosView) const {
    const float* positions[8];
    const auto read = [&](int from) {
        for (int i = 0; i < 8; ++i) positions[i] = colors_[numbers_[hits.instance[i]]].base + from;
        return gather4(positions);
    };
    const Q8 own = read(0), shine = read(4), rest = read(8), model = read(12);
    const I8 physical = model.x > 0.0f;
    const V8 less = energyLimited(surfaces.base, shine.w, rest.w, dot(surfaces.normal, back));
    return {physical, select(physical, less, surfaces.base), {shine.x, shine.y, shine.z}, own.w, shine.w, rest.w,
            cosView};
}

}  // namespace rtsg::trace
