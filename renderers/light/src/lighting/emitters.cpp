// The table of shining triangles.
#include "emitters.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "lane_gather.h"
#include "path_parts.h"
#include "shutter.h"
#include "texture/bsdf.h"
#include "trace_scene.h"

namespace rtsg::trace {

namespace {

/// Beyond this number of triangles, instances are left to bounces.
constexpr std::size_t kMax = std::size_t{1} << 22;

/// The largest emission of a material, whatever its textures; 0 if it emits nothing, or is not of the kind that is
/// looked for.
float emission(const Material& material, const Mesh& mesh) {
    if (material.transmits() || material.refractiveIndex > 0 || material.reflectivity != Vec3f(0)) return 0;
    if (!material.stages.empty() || material.hatching.present) return 0;
    if (material.model != ShadingModel::unlit) return largest(material.linear.emissive);
    return mesh.colors.present() ? 1.0f : largest(material.linear.base);
}

/// Whether it emits the same everywhere.
bool isEven(const Material& material, const Mesh& mesh) {
    if (material.model != ShadingModel::unlit) return !material.texture(TextureRole::emissive);
    return !mesh.colors.present() && !material.texture(TextureRole::base);
}
/// Precondition: isEven().
Vec3f evenRadiance(const Material& material) {
    return material.model == ShadingModel::unlit ? material.linear.base : material.linear.emissive;
}

Bounds boxOf(const Emitters::Emitter& e) {
    Bounds box;
    for (const Vec3f& corner : {e.corner, e.corner + e.ab, e.corner + e.ac}) box.extend(corner);
    return box;
}

/// By how far the places of a ray that ends there may be off, and more.
float slackOf(const Bounds& box) {
    return 0x1p-17f * std::max(largest(glm::abs(box.min)), largest(glm::abs(box.max)));
}

/// Whether two triangles share some of a plane; those that share an edge or a corner do not. By separating axes.
bool overlapInPlane(const Emitters::Emitter& a, const Emitters::Emitter& b, float slack) {
    const Vec3f as[] = {a.corner, a.corner + a.ab, a.corner + a.ac};
    const Vec3f bs[] = {b.corner, b.corner + b.ab, b.corner + b.ac};
    for (const Vec3f& corner : bs)
        if (!(std::abs(glm::dot(a.normal, corner - a.corner)) <= slack)) return false;
    for (const Vec3f* side : {as, bs})
        for (int i = 0; i < 3; ++i) {
            const Vec3f axis = glm::cross(a.normal, side[(i + 1) % 3] - side[i]);
            float minimum[2] = {INFINITY, INFINITY}, maximum[2] = {-INFINITY, -INFINITY};
            for (int k = 0; k < 3; ++k) {
                const float at[2] = {glm::dot(axis, as[k] - a.corner), glm::dot(axis, bs[k] - a.corner)};
                for (int j = 0; j < 2; ++j)
                    minimum[j] = std::min(minimum[j], at[j]), maximum[j] = std::max(maximum[j], at[j]);
            }
            const float shared = std::min(maximum[0], maximum[1]) - std::max(minimum[0], minimum[1]);
            if (!(shared > slack * glm::length(axis))) return false;
        }
    return true;
}

/// A cluster that the tree chooses evenly: every point is inside it, and is lit alike from anywhere in it.
LightTree::Cluster asLikelyAsAny(const LightTree::Cluster& cluster) {
    constexpr float kFar = 1e6f;  // metres
    LightTree::Cluster result;
    result.bounds.extend(Vec3f(-kFar)), result.bounds.extend(Vec3f(kFar));
    result.cosCone = -1, result.falloff = {1, 0, 0};
    result.power = cluster.power > 0 ? 1.0f : 0.0f;
    return result;
}

}  // namespace

std::shared_ptr<const Emitters> EmitterTable::of(const TraceScene& scene) {
    std::vector<Emitters::Source> sources = Emitters::sourcesIn(scene);
    const bool withTree = pathParts().lightTree;
    const std::scoped_lock lock(mutex_);
    if (last_ && withTree == withTree_ && sources == sources_) return last_;
    last_ = std::make_shared<const Emitters>(sources);
    sources_ = std::move(sources), withTree_ = withTree;
    return last_;
}

std::vector<Emitters::Source> Emitters::sourcesIn(const TraceScene& scene) {
    std::vector<Source> sources;
    const RayInstances& instances = scene.world->instances();
    for (std::uint32_t slot = 0; slot < instances.size(); ++slot) {
        const RayInstance& instance = instances[slot];
        if (scene.shutter && scene.shutter->moves(slot)) continue;  // it is not in one place
        if (!instance.mesh || slot >= scene.slots.size()) continue;
        if (!instance.info.seen || instance.info.clear) continue;  // no ray of light meets it
        const Mesh& mesh = *instance.mesh;
        const Material& front = scene.materials[scene.slots[slot].material].material;
        if (mesh.triangleCount == 0 || (mesh.colors.present() && mesh.colors.components() == 4)) continue;
        const float glow = std::max(emission(front, mesh), front.back ? emission(*front.back, mesh) : 0.0f);
        if (!(glow > 0)) continue;
        const Material& behind = front.back ? *front.back : front;
        Source source{slot, instance.mesh, instance.rayFromLocal, instance.sign, glow};
        source.even = isEven(front, mesh) && isEven(behind, mesh);
        if (source.even) source.front = evenRadiance(front), source.behind = evenRadiance(behind);
        sources.push_back(std::move(source));
    }
    return sources;
}

Emitters::Emitters(const std::vector<Source>& sources) {
    std::vector<LightTree::Cluster> clusters;
    std::size_t count = 0;
    for (const Source& source : sources) count += source.mesh->triangleCount;
    clusters.reserve(std::min<std::size_t>(count, kMax)), emitters_.reserve(clusters.capacity());
    if (!sources.empty()) firstOf_.resize(sources.back().slot + std::size_t{1}, kNone);
    for (const Source& source : sources) add(source, clusters);
    if (emitters_.empty()) return;
    findContested();
    if (!pathParts().lightTree)
        for (LightTree::Cluster& cluster : clusters) cluster = asLikelyAsAny(cluster);
    constexpr float kMin = 1e-12f;  // m^2, so that no sum leaves the range of float
    tree_ = LightTree(clusters, kMin);
    for (const Emitter& e : emitters_) even_ = even_ && e.even && !e.contested;
    if (tree_.empty()) emitters_.clear();
    if (!even_) return;
    packed_.reserve(emitters_.size());
    for (const Emitter& e : emitters_) packed_.emplace_back(e);
    for (std::size_t i = 0; i < packed_.size() && i < 8; ++i)
        for (std::size_t column = 0; column < 20; ++column) few_.columns[column][i] = packed_[i].numbers[column];
}

void Emitters::add(const Source& source, std::vector<LightTree::Cluster>& clusters) {
    const Mesh& mesh = *source.mesh;
    if (emitters_.size() + mesh.triangleCount > kMax) return;
    firstOf_[source.slot] = static_cast<std::uint32_t>(emitters_.size());
    const bool bothSides = !mesh.solid;
    for (std::uint32_t triangle = 0; triangle < mesh.triangleCount; ++triangle) {
        Emitter e;
        const auto positionOf = [&](std::uint32_t corner) {
            return source.rayFromLocal * Vec4f(mesh.vertex(triangle, corner), 1);
        };
        e.corner = positionOf(0), e.ab = positionOf(1) - e.corner, e.ac = positionOf(2) - e.corner;
        const Vec3d normal = glm::cross(Vec3d(e.ab), Vec3d(e.ac));
        const double twice = glm::length(normal);
        const bool good = twice > 0 && std::isfinite(twice);
        e.area = good ? static_cast<float>(twice / 2) : 0.0f;
        if (good) e.normal = Vec3f(normal / twice) * static_cast<float>(source.sign);
        e.instance = source.slot, e.triangle = triangle, e.bothSides = bothSides;
        e.even = source.even, e.front = source.front, e.behind = source.behind;
        emitters_.push_back(e);
        const float power = source.glow * e.area * (bothSides ? 2.0f : 1.0f);
        LightTree::Cluster cluster;
        for (const Vec3f& at : {e.corner, e.corner + e.ab, e.corner + e.ac}) cluster.bounds.extend(at);
        cluster.axis = e.normal;
        cluster.cosCone = bothSides ? -1.0f : 1.0f;
        // A triangle without area never lights anything.
        cluster.power = std::isfinite(power) ? std::min(power, 1e20f) : 0.0f;
        clusters.push_back(cluster);
    }
}

void Emitters::findContested() {
    constexpr std::size_t kMaxCompared = 4096;  // some ms a picture; beyond them all count as uncontested
    if (emitters_.size() > kMaxCompared) return;
    struct Placed {
        Bounds box;
        float slack = 0;
        Emitter* emitter = nullptr;
        bool isApart(const Placed& other, float maximum, int k) const {
            return other.box.min[k] > box.max[k] + maximum || box.min[k] > other.box.max[k] + maximum;
        }
    };
    std::vector<Placed> placed;
    Bounds starts;
    for (Emitter& e : emitters_) {
        if (!(e.area > 0)) continue;
        const Bounds box = boxOf(e);
        placed.push_back({box, slackOf(box), &e});
        starts.extend(box.min);
    }
    // By where they begin, along the axis on which that is farthest apart.
    const Vec3f size = starts.max - starts.min;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    std::ranges::sort(placed, {}, [axis](const Placed& p) { return p.box.min[axis]; });
    for (std::size_t i = 0; i < placed.size(); ++i) {
        const Placed& one = placed[i];
        for (std::size_t k = i + 1; k < placed.size() && placed[k].box.min[axis] <= one.box.max[axis] + one.slack;
             ++k) {
            const Placed& other = placed[k];
            const float slack = std::max(one.slack, other.slack);
            if (one.isApart(other, slack, (axis + 1) % 3) || one.isApart(other, slack, (axis + 2) % 3)) continue;
            if (overlapInPlane(*one.emitter, *other.emitter, slack))
                one.emitter->contested = other.emitter->contested = true;
        }
    }
}

Emitters::Choice Emitters::sample(const Vec3f& point, const Vec3f& normal, float u) const {
    const LightTree::Choice choice = tree_.sample(point, normal, u);
    return {choice.emitter, choice.probability};
}

Emitters::Packed::Packed(const Emitter& e) {
    const auto put = [this](int at, const Vec3f& v) {
        numbers[at] = v.x, numbers[at + 1] = v.y, numbers[at + 2] = v.z;
    };
    put(0, e.corner), put(4, e.ab), put(8, e.ac), put(12, e.normal), put(16, e.behind);
    numbers[3] = e.area, numbers[7] = e.front.x, numbers[11] = e.front.y, numbers[15] = e.front.z;
    numbers[19] = e.bothSides ? -1.0f : 0.0f;
}

Emitters::Eight Emitters::eight(const std::uint32_t* numbers) const {
    using namespace simd;
    if (packed_.size() <= 8) {
        I8 which;
        std::memcpy(&which, numbers, sizeof which);
        const auto one = [&](std::size_t column) { return oneEach(few_.columns[column], which); };
        const auto three = [&](std::size_t column) { return V8{one(column), one(column + 1), one(column + 2)}; };
        return {three(0), three(4), three(8), three(12), {one(7), one(11), one(15)}, three(16), one(3), one(19) < 0.0f};
    }
    const float* positions[8];
    for (int i = 0; i < 8; ++i) positions[i] = packed_[numbers[i]].numbers;
    const auto four = [&positions](int from) {
        const float* some[8];
        for (int i = 0; i < 8; ++i) some[i] = positions[i] + from;
        return gather4(some);
    };
    const Q8 corner = four(0), ab = four(4), ac = four(8), normal = four(12), behind = four(16);
    return {{corner.x, corner.y, corner.z},
            {ab.x, ab.y, ab.z},
            {ac.x, ac.y, ac.z},
            {normal.x, normal.y, normal.z},
            {ab.w, ac.w, normal.w},
            {behind.x, behind.y, behind.z},
            corner.w,
            behind.w < 0.0f};
}

float Emitters::density(std::uint32_t emitter, const Vec3f& point, const Vec3f& normal) const {
    return tree_.probability(emitter, point, normal);
}

std::uint32_t Emitters::find(std::uint32_t instance, std::uint32_t triangle) const {
    if (instance >= firstOf_.size() || firstOf_[instance] == kNone || triangle == kCap) return kNone;
    return firstOf_[instance] + triangle;
}

}  // namespace rtsg::trace
