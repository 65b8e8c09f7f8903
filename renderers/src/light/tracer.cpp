// Pictures by rays: the camera, what the integrators see of a version of light's tables, and the loop over tiles.
#include <rtsg/renderers/light_tracer.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <span>
#include <tuple>

#include <fmt/format.h>

#include <rtsg/renderers/parallel_for.h>
#include <rtsg/renderers/picking.h>
#include <rtsg/renderers/shared_world.h>

#include "adaptive.h"
#include "emitters.h"
#include "light_tables.h"
#include "trace_scene.h"

namespace rtsg {

using namespace trace;

namespace {

/// Fields may hold numbers whose products leave the range of float; a picture never does.
Vec4f finite(Vec4f v) {
    for (int c = 0; c < 4; ++c) v[c] = v[c] > 0 ? std::min(v[c], std::numeric_limits<float>::max()) : 0.0f;  // NaN: 0
    return v;
}

/// The bound one of a kind, else the one that comes first in the document. A node that several paths lead to is
/// seen through one of them: which is up to us (7.2.2), but must not depend on the order in which they came.
template <class T>
const PlacedEntry* active(const LightState& state, std::uint16_t layer) {
    const auto rank = [](const PlacedEntry& entry) {
        const double* matrix = &entry.placed.worldFromLocal[0][0];
        return std::tuple(!std::get<T>(entry.what).bound, entry.placed.node, std::span<const double, 12>(matrix, 12));
    };
    const auto before = [&](const PlacedEntry& a, const PlacedEntry& b) {
        const auto [unboundA, nodeA, matrixA] = rank(a);
        const auto [unboundB, nodeB, matrixB] = rank(b);
        if (unboundA != unboundB) return unboundB;
        if (nodeA != nodeB) return nodeA < nodeB;
        return std::ranges::lexicographical_compare(matrixA, matrixB);
    };
    const PlacedEntry* best = nullptr;
    for (std::size_t i = 0; i < state.placed.size(); ++i)
        if (const PlacedEntry* entry = state.placed[i].get())
            if (std::holds_alternative<T>(entry->what) && entry->placed.layer == layer &&
                (!best || before(*entry, *best)))
                best = entry;
    return best;
}

/// `toTrace`: a Light as rays see it. The whole scene's group is filled last.
template <class ToTrace>
LightGroups groupLights(const LightState& state, std::uint16_t layer, const ToTrace& toTrace) {
    LightGroups result;
    const std::size_t count = std::max<std::size_t>(state.scopes.size(), 1);
    result.groups.resize(count);
    for (std::size_t i = count; i-- > 0 && i < state.scopes.size();) {
        LightGroups::Group& group = result.groups[i];
        group.first = static_cast<std::uint32_t>(result.lights.size());
        if (const auto& lights = state.scopes[i].lights)
            for (const std::uint32_t slot : *lights)
                if (state.placed[slot]->placed.layer == layer)
                    result.lights.push_back(toTrace(std::get<Light>(state.placed[slot]->what)));
        group.count = static_cast<std::uint32_t>(result.lights.size()) - group.first;
    }
    // Each looks outwards until it meets one that knows.
    std::vector<bool> known(count);
    std::vector<std::uint32_t> way;
    known[0] = true;
    for (std::uint32_t i = 1; i < count; ++i) {
        std::uint32_t at = i;
        for (; !known[at]; at = state.scopes[at].around) {
            known[at] = true;
            way.push_back(at);
        }
        for (; !way.empty(); way.pop_back()) {
            LightGroups::Group& group = result.groups[way.back()];
            const std::uint32_t outwards = result.groups[state.scopes[way.back()].around].start;
            group.start = group.count > 0 ? way.back() : outwards;
            group.around = outwards;
        }
    }
    return result;
}

bool anyLightWantsShadows(const LightState& state) {
    for (std::size_t i = 0; i < state.scopes.size(); ++i)
        if (const auto& lights = state.scopes[i].lights)
            for (const std::uint32_t slot : *lights)
                if (std::get<Light>(state.placed[slot]->what).shadows) return true;
    return false;
}

/// ClipPlanes: those of the scopes around a shape cut it (11.4.1).
class ClipFilter final : public RayFilter {
  public:
    /// Null: nothing is cut.
    static std::shared_ptr<const RayFilter> of(const LightState& state, const RayView& world) {
        std::shared_ptr<ClipFilter> filter;
        for (std::size_t i = 0; i < state.placed.size(); ++i) {
            const PlacedEntry* entry = state.placed[i].get();
            const ClipEntry* clip = entry ? std::get_if<ClipEntry>(&entry->what) : nullptr;
            if (!clip) continue;
            if (!filter) filter = std::make_shared<ClipFilter>(state);
            const double offset = clip->offset + glm::dot(clip->normal, world.origin());
            filter->planes_[clip->scope].emplace_back(Vec3f(clip->normal), static_cast<float>(offset));
        }
        return filter;
    }
    explicit ClipFilter(const LightState& state)
        : slots_(state.slots), planes_(std::max<std::size_t>(state.scopes.size(), 1)), around_(planes_.size()) {
        for (std::size_t i = 0; i < state.scopes.size(); ++i) around_[i] = state.scopes[i].around;
    }
    bool concerns(std::uint32_t slot) const override {
        for (std::uint32_t scope = scopeOf(slot);; scope = around_[scope]) {
            if (!planes_[scope].empty()) return true;
            if (scope == 0) return false;
        }
    }
    bool leavesOut(std::uint32_t slot, const Vec3f& at) const override {
        for (std::uint32_t scope = scopeOf(slot);; scope = around_[scope]) {
            for (const Vec4f& plane : planes_[scope])
                if (glm::dot(Vec3f(plane), at) + plane.w < 0) return true;
            if (scope == 0) return false;
        }
    }

  private:
    std::uint32_t scopeOf(std::uint32_t slot) const { return slot < slots_.size() ? slots_[slot].lights : 0; }
    SlotPages slots_;
    std::vector<std::vector<Vec4f>> planes_;  // by scope
    std::vector<std::uint32_t> around_;
};

/// Leaves out some instances besides what another filter does.
class HidingFilter final : public RayFilter {
  public:
    HidingFilter(std::vector<bool> hidden, std::shared_ptr<const RayFilter> other)
        : hidden_(std::move(hidden)), other_(std::move(other)) {}
    bool concerns(std::uint32_t slot) const override { return isHidden(slot) || (other_ && other_->concerns(slot)); }
    bool leavesOut(std::uint32_t slot, const Vec3f& at) const override {
        return isHidden(slot) || (other_ && other_->leavesOut(slot, at));
    }

  private:
    bool isHidden(std::uint32_t slot) const { return slot < hidden_.size() && hidden_[slot]; }
    std::vector<bool> hidden_;
    std::shared_ptr<const RayFilter> other_;
};

/// Where light is let through, if that can be told in few boxes.
void boxClear(const LightState& state, const RayView& world, TraceScene& scene) {
    constexpr std::size_t kFew = 8;  // boxes that cost a shadow ray little beside its own way
    if (!state.clearSlots) return;
    scene.clearAnywhere = false;
    for (const std::uint32_t slot : *state.clearSlots) {
        if (slot >= world.instances().size() || !world.instance(slot).mesh) continue;
        const RayInstance& instance = world.instance(slot);
        if (instance.mesh->strokeCount > 0) scene.clearAnywhere = true;  // wider than their bounds
        const Bounds& local = instance.mesh->bounds;
        const glm::mat4x3& m = instance.rayFromLocal;
        const Vec3f center = m * Vec4f(local.center(), 1), half = .5f * local.size();
        const Vec3f reach = glm::abs(m[0]) * half.x + glm::abs(m[1]) * half.y + glm::abs(m[2]) * half.z;
        const Vec3f slack = (glm::abs(center) + reach) * 0x1p-18f + instance.errorFloor;
        Bounds box;
        box.extend(center - reach - slack), box.extend(center + reach + slack);
        scene.clear.push_back(box);
        scene.allClear.extend(box.min), scene.allClear.extend(box.max);
    }
    if (scene.clear.size() > kFew) scene.clear.clear();
}

/// The fogs that reach places of some scopes alone. Of several in one scope the last in the document counts.
void findLocalFogs(const LightState& state, Fogs& fogs) {
    std::vector<std::tuple<std::uint32_t, NodeId, const Fog*>> found;
    for (std::size_t i = 0; i < state.placed.size(); ++i)
        if (const PlacedEntry* entry = state.placed[i].get())
            if (const auto* local = std::get_if<LocalFogEntry>(&entry->what))
                found.emplace_back(local->scope, entry->placed.node, &local->fog);
    if (found.empty()) return;
    std::ranges::sort(found);
    std::vector<std::uint32_t> around(state.scopes.size());
    for (std::size_t i = 0; i < around.size(); ++i) around[i] = state.scopes[i].around;
    std::vector<std::pair<std::uint32_t, Fog>> local;
    for (const auto& [scope, node, fog] : found) local.emplace_back(scope, *fog);
    fogs.setLocal(local, around);
}

/// What a picture is of, besides the camera that it is seen through.
struct Part {
    Vec3d headlight{0, 0, -1};  // where it shines to
    std::vector<bool> hidden;   // slots that are not there; empty: none
    bool over = false;          // something is seen where nothing is: no background of its own makes it clear
};

TraceScene makeTraceScene(const LightState& state, const RayView& world, const Camera& camera,
                          const RenderSettings& settings, Part part) {
    static const Sky black, clear = [] {
        Sky sky;
        sky.alpha = 0;
        return sky;
    }();
    const std::uint16_t layer = camera.layer;
    TraceScene scene;
    const auto height = static_cast<float>((camera.top - camera.bottom) / settings.height);
    (camera.orthographic ? scene.pixelSize : scene.pixelSpread) = height;
    const PixelLens lens{world.fromWorld(camera.position), Vec3f(camera.forward), scene.pixelSpread, scene.pixelSize};
    scene.filter = ClipFilter::of(state, world);
    if (!part.hidden.empty()) scene.filter = std::make_shared<const HidingFilter>(std::move(part.hidden), scene.filter);
    scene.lensed = std::make_shared<const LensedView>(world, lens, scene.filter.get());
    scene.eye = lens.eye, scene.right = Vec3f(camera.right), scene.up = Vec3f(camera.up), scene.forward = lens.forward;
    scene.world = scene.lensed.get();
    scene.materials = MaterialList(state.materials);
    scene.slots = SlotPages(state.slots);
    const PlacedEntry* sky = active<SkyEntry>(state, layer);
    scene.sky = sky ? &std::get<SkyEntry>(sky->what).sky : part.over ? &clear : &black;
    scene.evenSky = scene.sky->uniform();
    if (scene.evenSky) {
        scene.skyLinear = scene.sky->color({0, 1, 0}, ColorSpace::linear);
        scene.skyDisplay = scene.sky->color({0, 1, 0}, ColorSpace::display);
    }
    if (const PlacedEntry* fog = active<FogEntry>(state, layer))
        scene.fogs.setGlobal(std::get<FogEntry>(fog->what).fog);
    findLocalFogs(state, scene.fogs);
    scene.energyLimited = settings.integrator == Integrator::path;
    scene.space = settings.integrator == Integrator::path ? ColorSpace::linear : settings.colorSpace;

    const bool anySays = settings.shadows == Shadows::automatic && anyLightWantsShadows(state);
    const auto toTrace = [&](const Light& light) {
        TraceLight result;
        result.kind = light.kind;
        switch (settings.shadows) {
            case Shadows::all:
                result.shadows = true;
                break;
            case Shadows::none:
                break;
            case Shadows::authored:
                result.shadows = light.shadows;
                break;
            case Shadows::automatic:
                result.shadows = light.shadows || !anySays;
                break;
        }
        result.shadows = result.shadows && light.shadowIntensity > 0;
        result.shadowIntensity = light.shadowIntensity;
        result.color = light.color;
        if (settings.integrator != Integrator::path) result.ambient = light.ambient;
        result.position = world.fromWorld(light.position);
        result.direction = Vec3f(light.direction);
        result.attenuation = light.attenuation;
        result.radius = light.radius, result.localFromWorld = light.localFromWorld;
        result.beamWidth = light.beamWidth, result.cutOffAngle = light.cutOffAngle;
        return result;
    };
    TraceLight headlight;  // 23.4.4: intensity 1, colour 1 1 1, ambientIntensity 0, along the view
    headlight.color = Vec3f(1);
    headlight.direction = Vec3f(part.headlight);
    const PlacedEntry* navigation = active<Navigation>(state, layer);
    const bool lit = !navigation || std::get<Navigation>(navigation->what).headlight;
    scene.lightGroups = groupLights(state, layer, toTrace);
    if (lit) {
        // Of the whole scene, and so of the group that was filled last.
        scene.lightGroups.lights.push_back(headlight);
        ++scene.lightGroups.groups[0].count;
    }
    scene.anyTransmits = state.anyTransmits;
    if (state.anyTransmits) boxClear(state, world, scene);
    return scene;
}

/// The tiles of a picture, drawn by several threads, and what is counted over them.
class Drawing {
  public:
    Drawing(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, Picture& picture)
        : scene_(scene),
          camera_(camera),
          settings_(settings),
          picture_(picture),
          tilesX_((settings.width + kTileSide - 1) / kTileSide),
          tiles_(tilesX_ * ((settings.height + kTileSide - 1) / kTileSide)) {}

    int tiles() const { return tiles_; }

    void draw(int number) {
        if (cancelled_.load(std::memory_order_relaxed)) return;
        const int x0 = number % tilesX_ * kTileSide, y0 = number / tilesX_ * kTileSide;
        AdaptiveTile tile;
        if (settings_.error > 0) {
            adaptiveTile(scene_, camera_, settings_, x0, y0, tile);
        } else {
            const auto trace = settings_.integrator == Integrator::path ? pathTile : whittedTile;
            trace(scene_, camera_, settings_, x0, y0, tile.result);
            tile.samples.fill(static_cast<std::uint32_t>(settings_.samplesPerPixel));
        }
        if (scene_.space == ColorSpace::automatic) addLight(tile.result);
        take(tile, x0, y0);
        const int finished = ++done_;
        if (settings_.progress && progressMutex_.try_lock()) {
            const std::lock_guard lock(progressMutex_, std::adopt_lock);
            if (!settings_.progress(static_cast<double>(finished) / tiles_)) cancelled_ = true;
        }
    }

    void tell(RenderStats& stats) const {
        const double pixels = double{1} * settings_.width * settings_.height;
        stats.primaryRays = sum_.primaryRays, stats.shadowRays = sum_.shadowRays;
        stats.secondaryRays = sum_.secondaryRays;
        stats.cancelled = cancelled_;
        stats.missing = sum_.missing / pixels, stats.missingMost = sum_.missingMost;
        stats.error = std::sqrt(sum_.error / pixels), stats.unreached = sum_.unreached / pixels;
        stats.samples = sum_.samples / pixels;
    }

  private:
    void take(const AdaptiveTile& tile, int x0, int y0) {
        RenderStats own;
        for (int pixel = 0; pixel < kTilePixels; ++pixel) {
            const int x = x0 + pixel % kTileSide, y = y0 + pixel / kTileSide;
            if (x >= settings_.width || y >= settings_.height) continue;
            const auto at = static_cast<std::size_t>(pixel), block = static_cast<std::size_t>(blockOf(pixel));
            const float scale = 1.0f / static_cast<float>(tile.samples[block]);
            picture_.at(x, y) = finite(tile.result.sum[at] * scale);
            own.samples += tile.samples[block];
            if (!tile.result.missing.empty()) {
                const double missing = double{tile.result.missing[at]} * scale;
                own.missing += missing, own.missingMost = std::max(own.missingMost, missing);
            }
            if (picture_.interval.empty()) continue;
            picture_.interval[static_cast<std::size_t>(y) * static_cast<std::size_t>(picture_.width) +
                              static_cast<std::size_t>(x)] = tile.interval[at];
            own.error += double{tile.error[at]} * tile.error[at];
            own.unreached += tile.ranOut >> block & 1u;
        }
        const std::lock_guard lock(sumMutex_);
        sum_.samples += own.samples, sum_.error += own.error, sum_.unreached += own.unreached;
        sum_.missing += own.missing, sum_.missingMost = std::max(sum_.missingMost, own.missingMost);
        sum_.primaryRays += tile.result.primaryRays, sum_.shadowRays += tile.result.shadowRays;
        sum_.secondaryRays += tile.result.secondaryRays;
    }

    const TraceScene& scene_;
    const Camera& camera_;
    const RenderSettings& settings_;
    Picture& picture_;
    const int tilesX_, tiles_;
    std::atomic<int> done_ = 0;
    std::atomic<bool> cancelled_ = false;
    std::mutex progressMutex_, sumMutex_;
    RenderStats sum_;  // over pixels; of `error` the squares
};

Picture drawPicture(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, RenderStats* stats) {
    Picture picture(settings.width, settings.height);
    picture.space = scene.space == ColorSpace::linear ? ColorSpace::linear : ColorSpace::display;
    if (settings.error > 0) picture.interval.resize(picture.pixels.size(), Vec3f(0));
    Drawing drawing(scene, camera, settings, picture);
    withThreads(settings.threads, [&] {
        parallelFor(static_cast<std::size_t>(drawing.tiles()),
                    [&](std::size_t tile) { drawing.draw(static_cast<int>(tile)); });
    });
    if (stats) drawing.tell(*stats);
    return picture;
}

/// Who shows a GeneratedCubeMapTexture.
struct CubeUsers {
    std::shared_ptr<const GeneratedCube> cube;
    std::vector<bool> slots;
    std::uint32_t first = 0;
};
std::vector<CubeUsers> findCubes(const TraceScene& scene, const RayView& world) {
    std::vector<CubeUsers> result;
    for (std::uint32_t slot = 0; slot < world.instances().size(); ++slot) {
        if (slot >= scene.slots.size() || !world.instance(slot).mesh) continue;
        for (const auto& cube : scene.materials[scene.slots[slot].material].generated) {
            auto found = std::ranges::find(result, cube->node, [](const CubeUsers& c) { return c.cube->node; });
            if (found == result.end()) {
                result.push_back({cube, std::vector<bool>(world.instances().size()), slot});
                found = result.end() - 1;
            }
            found->slots[slot] = true;
        }
    }
    return result;
}

/// Draws what GeneratedCubeMapTextures show, along the world's axes.
/// `part`: slots that are not there, as Part::hidden.
void drawCubes(const LightState& state, const RayView& world, const Camera& camera, const RenderSettings& settings,
               const std::vector<bool>& part, TraceScene& scene) {
    if (!scene.materials.generates()) return;
    RenderSettings own = settings;
    own.integrator = Integrator::whitted;
    if (settings.integrator == Integrator::path) own.colorSpace = ColorSpace::linear;
    own.samplesPerPixel = 1, own.error = 0;
    own.progress = {};
    std::vector<std::pair<NodeId, SpaceTexture>> made;
    for (const CubeUsers& users : findCubes(scene, world)) {
        own.width = own.height = users.cube->size;
        std::array<std::shared_ptr<const Texture>, 6> sides;
        for (std::size_t i = 0; i < 6; ++i) {
            const auto side = static_cast<CubeSide>(i);
            Camera eye;
            eye.position = world.toWorld(world.instance(users.first).rayFromLocal[3]);
            eye.forward = Vec3d(cubeDirection(side, {.5f, .5f}));
            eye.right = glm::normalize(Vec3d(cubeDirection(side, {1, .5f}) - cubeDirection(side, {0, .5f})));
            eye.up = glm::cross(eye.right, eye.forward);
            std::vector<bool> hidden = users.slots;
            for (std::size_t slot = 0; !part.empty() && slot < hidden.size(); ++slot)
                hidden[slot] = hidden[slot] || part[slot];
            eye.layer = camera.layer;
            const TraceScene around =
                makeTraceScene(state, world, eye, own, Part{camera.forward, std::move(hidden), false});
            const Picture picture = toLinear(drawPicture(around, eye, own, nullptr));
            std::vector<Vec4f> pixels;
            pixels.reserve(picture.pixels.size());
            for (int y = picture.height - 1; y >= 0; --y)
                for (int x = 0; x < picture.width; ++x) pixels.emplace_back(Vec3f(picture.at(x, y)), 1);
            auto texture =
                Texture::fromFloats(std::move(pixels), picture.width, picture.height, 3, Texture::Content::color);
            if (texture) sides[i] = std::make_shared<const Texture>(std::move(*texture));
        }
        made.emplace_back(users.cube->node, SpaceTexture::cube(std::move(sides)));
    }
    scene.generated = std::move(made);
}

Picture drawPart(const LightState& state, const RayView& world, const Camera& camera, const RenderSettings& settings,
                 const Part& part, RenderStats& stats) {
    TraceScene scene = makeTraceScene(state, world, camera, settings, part);
    drawCubes(state, world, camera, settings, part.hidden, scene);
    const Emitters emitters = settings.integrator == Integrator::path ? Emitters(scene) : Emitters();
    if (!emitters.empty()) scene.emitters = &emitters;
    return drawPicture(scene, camera, settings, &stats);
}

/// Lays a picture over a part of another.
void layOver(const Picture& over, int left, int topmost, Picture& under) {
    const auto at = [](const Picture& p, int x, int y) {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(p.width) + static_cast<std::size_t>(x);
    };
    for (int y = 0; y < over.height; ++y)
        for (int x = 0; x < over.width; ++x) {
            const std::size_t to = at(under, left + x, topmost + y), from = at(over, x, y);
            const Vec4f& pixel = over.pixels[from];
            const float rest = 1 - std::clamp(pixel.a, 0.0f, 1.0f);
            under.pixels[to] = pixel + under.pixels[to] * rest;
            if (!under.interval.empty()) under.interval[to] = over.interval[from] + under.interval[to] * rest;
        }
}

void addStats(const RenderStats& part, double share, RenderStats& sum) {
    sum.primaryRays += part.primaryRays, sum.shadowRays += part.shadowRays, sum.secondaryRays += part.secondaryRays;
    sum.missing += part.missing * share, sum.missingMost = std::max(sum.missingMost, part.missingMost);
    sum.error = std::hypot(sum.error, part.error * std::sqrt(share));
    sum.unreached += part.unreached * share, sum.samples += part.samples * share;
    sum.cancelled = sum.cancelled || part.cancelled;
}

/// The layers of a LayerSet one over the other, each from its own viewpoint; that of `camera` is given (35.2).
Picture drawLayers(const LightState& state, const RayView& world, const Camera& camera, const RenderSettings& settings,
                   RenderStats& stats) {
    const auto views = LightTracer::layers(state, world, camera, settings.width, settings.height);
    Picture picture(settings.width, settings.height);
    picture.space = settings.colorSpace == ColorSpace::linear || settings.integrator == Integrator::path
                        ? ColorSpace::linear
                        : ColorSpace::display;
    if (settings.error > 0) picture.interval.resize(picture.pixels.size(), Vec3f(0));
    for (std::size_t i = 0; i < views.size() && !stats.cancelled; ++i) {
        const LayerView& view = views[i];
        RenderSettings own = settings;
        own.width = view.width, own.height = view.height;
        if (settings.progress)
            own.progress = [&](double done) {
                return settings.progress((static_cast<double>(i) + done) / static_cast<double>(views.size()));
            };
        Part part{.headlight = view.camera.forward, .hidden = {}, .over = i > 0};
        part.hidden.resize(world.instances().size());
        for (std::uint32_t slot = 0; slot < world.instances().size(); ++slot)
            part.hidden[slot] = world.instance(slot).info.layer != view.camera.layer;
        RenderStats drawn;
        const Picture layer = drawPart(state, world, view.camera, own, part, drawn);
        const double share = double{1} * view.width * view.height / (double{1} * settings.width * settings.height);
        addStats(drawn, share, stats);
        layOver(layer, view.left, view.top, picture);
    }
    return picture;
}

}  // namespace

trace::SlotPages::SlotPages(const PagedArray<SlotShading, kSlotBits>& slots) : size_(slots.size()) {
    static const std::array<SlotShading, std::size_t{1} << kSlotBits> untouched{};
    for (std::size_t first = 0; first < size_; first += untouched.size()) {
        const SlotShading* page = slots.page(first);
        pages_.push_back(page ? page : untouched.data());
    }
}

void trace::Fogs::setLocal(const std::vector<std::pair<std::uint32_t, Fog>>& fogs,
                           std::span<const std::uint32_t> around) {
    constexpr std::uint32_t kUnknown = 0xFFFFFFFF;
    byScope_.assign(std::max<std::size_t>(around.size(), 1), kUnknown);
    byScope_[0] = 0;
    for (const auto& [scope, fog] : fogs) {
        byScope_[scope] = static_cast<std::uint32_t>(entries_.size());
        entries_.push_back({fog, linearFromSrgb(fog.color)});
        any_ = any_ || fog.type != FogType::none;
    }
    std::vector<std::uint32_t> way;
    for (std::uint32_t i = 0; i < around.size(); ++i) {
        std::uint32_t at = i;
        for (; byScope_[at] == kUnknown; at = around[at]) way.push_back(at);
        for (; !way.empty(); way.pop_back()) byScope_[way.back()] = byScope_[at];
    }
}

trace::MaterialList::MaterialList(const PagedArray<std::shared_ptr<const MaterialEntry>>& materials) {
    static const MaterialEntry none;
    for (std::size_t i = 0; i < materials.size(); ++i) entries_.push_back(materials[i] ? materials[i].get() : &none);
    if (entries_.empty()) entries_.push_back(&none);
    generates_ = std::ranges::any_of(entries_, [](const MaterialEntry* entry) { return !entry->generated.empty(); });
}

namespace {

/// What a camera shows of a viewpoint; null: the standard's default one.
Camera cameraOf(const LightState& state, const RayView& world, const PlacedEntry* chosen, std::uint16_t layer,
                double aspect) {
    const auto frameEverything = [&](Camera& camera) {
        const Bounds bounds = world.bounds();
        if (!bounds.empty()) camera.frame(world.toWorld(bounds.min), world.toWorld(bounds.max));
    };
    Camera camera;
    if (!chosen) {
        camera = Camera::perspective(identityTransform(), {0, 0, 10}, {}, 0.7854, aspect);
        if (!state.layers) frameEverything(camera);
        camera.layer = layer;
        return camera;
    }
    const View& view = std::get<View>(chosen->what);
    camera = view.orthographic
                 ? Camera::parallel(chosen->placed.worldFromLocal, view.position, view.orientation, view.extent, aspect)
                 : Camera::perspective(chosen->placed.worldFromLocal, view.position, view.orientation, view.fieldOfView,
                                       aspect);
    camera.layer = chosen->placed.layer;
    if (view.viewAll) frameEverything(camera);
    if (view.farDistance > 0)
        camera.visibilityLimit = view.farDistance;
    else if (const PlacedEntry* navigation = active<Navigation>(state, camera.layer))
        if (const float limit = std::get<Navigation>(navigation->what).visibilityLimit; limit > 0)
            camera.visibilityLimit = limit;
    return camera;
}

bool isSameView(const Camera& a, const Camera& b) {
    return a.position == b.position && a.right == b.right && a.up == b.up && a.forward == b.forward &&
           a.orthographic == b.orthographic && a.left == b.left && a.rightEdge == b.rightEdge && a.bottom == b.bottom &&
           a.top == b.top;
}

}  // namespace

Result<Camera> LightTracer::camera(const LightState& state, const RayView& world, double aspect,
                                   std::string_view name) {
    if (!(aspect > 0) || !std::isfinite(aspect)) return fail("a picture's width and height must be positive");
    const PlacedEntry* chosen = nullptr;
    const std::uint16_t layer = state.layers ? state.layers->active : std::uint16_t{0};
    if (name.empty()) {
        chosen = active<View>(state, layer);
    } else {
        std::string known;
        for (std::size_t i = 0; i < state.placed.size(); ++i) {
            const PlacedEntry* entry = state.placed[i].get();
            if (const View* view = entry ? std::get_if<View>(&entry->what) : nullptr) {
                const bool matches = view->name == name || view->description == name;
                if (matches && (!chosen || view->name == name)) chosen = entry;
                known += fmt::format("{}\"{}\"", known.empty() ? "" : ", ",
                                     view->name.empty() ? view->description : view->name);
            }
        }
        if (!chosen)
            return fail(
                fmt::format("no viewpoint is called \"{}\"; there are: {}", name, known.empty() ? "none" : known));
    }
    return cameraOf(state, world, chosen, layer, aspect);
}

Result<Picture> LightTracer::render(const LightState& state, const RayView& world, const Camera& camera,
                                    const RenderSettings& settings, RenderStats* stats) {
    constexpr int kMaxSide = 1 << 16;
    if (settings.width < 1 || settings.height < 1 || settings.width > kMaxSide || settings.height > kMaxSide)
        return fail(fmt::format("cannot render {} x {} pixels; both must be from 1 to {}", settings.width,
                                settings.height, kMaxSide));
    if (settings.samplesPerPixel < 1 || settings.samplesPerPixel > 1 << 20)
        return fail(fmt::format("cannot take {} samples per pixel", settings.samplesPerPixel));
    if (!(settings.error >= 0) || !std::isfinite(settings.error))
        return fail(fmt::format("cannot reach an error of {}", settings.error));
    if (settings.integrator == Integrator::raster)
        return fail("the rasteriser is not built in; there are whitted and path");
    if (settings.integrator == Integrator::path && settings.colorSpace == ColorSpace::display)
        return fail("paths are light: they cannot be computed in the display's space, only auto and linear");
    const auto start = std::chrono::steady_clock::now();
    RenderStats drawn;
    Picture picture = state.layers ? drawLayers(state, world, camera, settings, drawn)
                                   : drawPart(state, world, camera, settings, Part{camera.forward, {}, false}, drawn);
    drawn.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (stats) *stats = drawn;
    return picture;
}

std::vector<LayerView> LightTracer::layers(const LightState& state, const RayView& world, const Camera& camera,
                                           int width, int height) {
    if (!state.layers) return {{camera, 0, 0, width, height}};
    std::vector<LayerView> result;
    for (const LayerList::Layer& layer : state.layers->order) {
        const auto at = [](float share, int size) {
            return static_cast<int>(std::lround(share * static_cast<float>(size)));
        };
        LayerView view;
        view.left = at(layer.clip[0], width), view.width = at(layer.clip[1], width) - view.left;
        view.top = height - at(layer.clip[3], height), view.height = height - at(layer.clip[2], height) - view.top;
        if (view.width < 1 || view.height < 1) continue;
        const double aspect = static_cast<double>(view.width) / view.height;
        const bool whole = view.width == width && view.height == height;
        const auto ofLayer = [&](double shape) {
            return cameraOf(state, world, active<View>(state, layer.number), layer.number, shape);
        };
        if (layer.number != camera.layer)
            view.camera = ofLayer(aspect);
        else if (whole)
            view.camera = camera;
        else  // of an eye that is no viewpoint's it is not known what must be seen
            view.camera = isSameView(camera, ofLayer(static_cast<double>(width) / height)) ? ofLayer(aspect)
                                                                                           : camera.shaped(aspect);
        result.push_back(view);
    }
    return result;
}

struct LightTracer::Impl {
    explicit Impl(std::shared_ptr<TextureStore> textures) : tables(std::move(textures)) {}
    LightTables tables;
};

LightTracer::LightTracer(Resources resources)
    : impl_(std::make_unique<Impl>(std::make_shared<TextureStore>(std::move(resources)))) {}
LightTracer::LightTracer(SharedWorld& world, const Resources& resources)
    : impl_(std::make_unique<Impl>(std::static_pointer_cast<TextureStore>(
          world.shared(TextureStore::nameOf(resources), [&] { return std::make_shared<TextureStore>(resources); })))) {}
LightTracer::~LightTracer() = default;

Result<> LightTracer::apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) {
    impl_->tables.apply(scene, changes, delta);
    return {};
}

std::shared_ptr<const void> LightTracer::freeze() {
    return latest();
}
std::shared_ptr<const LightState> LightTracer::latest() {
    return impl_->tables.latest();
}

Result<Camera> LightTracer::camera(const RayView& world, double aspect, std::string_view name) const {
    return camera(impl_->tables.now(), world, aspect, name);
}
Result<Picture> LightTracer::render(const RayView& world, const Camera& camera, const RenderSettings& settings,
                                    RenderStats* stats) const {
    return render(impl_->tables.now(), world, camera, settings, stats);
}

Result<Pick> LightTracer::pick(const Picker& picker, const std::vector<LayerView>& views, double x, double y) {
    for (auto view = views.rbegin(); view != views.rend(); ++view) {
        const double across = (x - view->left) / view->width, down = (y - view->top) / view->height;
        if (!(across >= 0 && across <= 1 && down >= 0 && down <= 1)) continue;
        const Camera& camera = view->camera;
        const Camera::WorldRay ray = camera.ray(across, down);
        const double height = (camera.top - camera.bottom) / view->height;
        auto found = picker.ray(ray.origin, ray.direction, camera.layer, camera.visibilityLimit,
                                camera.orthographic ? Picker::kPixel : height);
        if (!found || *found) return found;
    }
    return Pick();
}

std::vector<LayerView> LightTracer::layers(const RayView& world, const Camera& camera, int width, int height) const {
    return layers(impl_->tables.now(), world, camera, width, height);
}

LightTracer::Counts LightTracer::counts() const {
    return impl_->tables.counts();
}
const Diagnostics& LightTracer::diagnostics() const {
    return impl_->tables.diagnostics();
}

}  // namespace rtsg
