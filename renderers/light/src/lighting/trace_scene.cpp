// The data of a scene that integrators read: its lens, its environments, its fogs, its materials.
#include "trace_scene.h"

#include <algorithm>
#include <span>

#include "environment.h"

namespace rtsg::trace {

PixelLens lensOf(const RayView& world, const Camera& camera, int rows) {
    const auto pixel = static_cast<float>((camera.top - camera.bottom) / rows);
    PixelLens lens{world.fromWorld(camera.position), Vec3f(camera.forward), camera.orthographic ? 0 : pixel,
                   camera.orthographic ? pixel : 0};
    if (!camera.panorama)
        lens.toSquare = glm::mat3(glm::dmat3(Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(0, 0, -1)) * camera.steps());
    return lens;
}

void TraceScene::pixelOf(const RayView& view, const Camera& camera, int height) {
    eye = view.fromWorld(camera.position), forward = Vec3f(camera.forward);
    const auto pixel = static_cast<float>(camera.pixel(height));
    pixelSpread = camera.orthographic ? 0 : pixel, pixelSize = camera.orthographic ? pixel : 0;
    const glm::dmat3 rows = glm::transpose(camera.steps()) * (camera.pixel(1) / (camera.top - camera.bottom));
    right = Vec3f(rows[0]), up = Vec3f(rows[1]);
}

Vec3f TraceEnvironment::radiance(const Vec3f& direction, bool linear, float width) const {
    const Vec3f light = from->radiance(localFromWorld * direction, width);
    return color * (linear ? light : srgbFromLinear(light));
}

Vec4f TraceScene::fromEnvironments(const Vec3f& direction, std::uint32_t group, bool linear) const {
    std::uint32_t at = environments.start(group);
    // A group without any starts with the whole scene's, which may have none either.
    if (environments.groups[at].count == 0) return skyColor(direction, linear);
    Vec4f sum(0, 0, 0, 1);
    for (; at != EnvironmentGroups::kEnd; at = environments.next(at))
        for (const TraceEnvironment& light : environments.lightsOf(at))
            sum += Vec4f(light.radiance(direction, linear), 0);
    return sum;
}

SlotPages::SlotPages(const PagedArray<SlotShading, kSlotBits>& slots) : size_(slots.size()) {
    static const std::array<SlotShading, std::size_t{1} << kSlotBits> untouched{};
    for (std::size_t first = 0; first < size_; first += untouched.size()) {
        const SlotShading* page = slots.page(first);
        pages_.push_back(page ? page : untouched.data());
    }
}

void Fogs::setLocal(const std::vector<std::pair<std::uint32_t, Fog>>& fogs, std::span<const std::uint32_t> around) {
    constexpr std::uint32_t kUnknown = 0xFFFFFFFF;
    byScope_.assign(std::max<std::size_t>(around.size(), 1), kUnknown);
    byScope_[0] = 0;
    for (const auto& [scope, fog] : fogs) {
        byScope_[scope] = static_cast<std::uint32_t>(entries_.size());
        entries_.push_back({fog, linearFromSrgb(fog.color)});
        any_ = any_ || fog.type != FogType::none;
    }
    std::vector<std::uint32_t> path;
    for (std::uint32_t i = 0; i < around.size(); ++i) {
        std::uint32_t at = i;
        for (; byScope_[at] == kUnknown; at = around[at]) path.push_back(at);
        for (; !path.empty(); path.pop_back()) byScope_[path.back()] = byScope_[at];
    }
}

MaterialList::MaterialList(const PagedArray<std::shared_ptr<const MaterialEntry>>& materials) {
    static const MaterialEntry none;
    for (std::size_t i = 0; i < materials.size(); ++i) entries_.push_back(materials[i] ? materials[i].get() : &none);
    if (entries_.empty()) entries_.push_back(&none);
    glossy_ = std::ranges::any_of(entries_, [](const MaterialEntry* entry) {
        const Material& m = entry->material;
        return m.model == ShadingModel::physical || m.specular != Vec3f(0) || m.back;
    });
    bends_ = std::ranges::any_of(entries_, [](const MaterialEntry* entry) {
        const Material& m = entry->material;
        return m.refractiveIndex > 0 || (m.back && m.back->refractiveIndex > 0);
    });
    generates_ = std::ranges::any_of(entries_, [](const MaterialEntry* entry) { return !entry->generated.empty(); });
}

}  // namespace rtsg::trace
