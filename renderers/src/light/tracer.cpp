// LightTracer: keeps materials, lights and textures in step with the scene, and renders pictures tile by tile.
#include <rtsg/renderers/light_tracer.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <span>
#include <tuple>
#include <unordered_map>
#include <unordered_set>
#include <variant>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "mesh/told_once.h"
#include "texture_store.h"
#include "trace_scene.h"

namespace rtsg {

using namespace trace;

namespace {

/// A Viewpoint, OrthoViewpoint or GeoViewpoint, in its own frame.
struct View {
    Vec3d position{0, 0, 10};
    Rotation orientation;
    double fieldOfView = 0.7854;
    std::array<double, 4> extent{-1, -1, 1, 1};
    bool orthographic = false, bound = false, viewAll = false;
    float farDistance = -1;
    std::string name, description;
};
struct Navigation {
    bool headlight = true, bound = false;
    float visibilityLimit = 0;
};
struct SkyEntry {
    Sky sky;
    bool bound = false;
};
struct FogEntry {
    Fog fog;
    bool bound = false;
};

struct PlacedEntry {
    Placed placed;
    std::variant<std::monostate, Light, View, SkyEntry, FogEntry, Navigation> what;
};

View readView(const Scene& scene, const Node& node) {
    View view;
    view.name = scene.name(node.id());
    const auto common = [&]<class V>(const V*) {
        view.orientation = node.get(V::orientation);
        view.bound = node.get(V::isBound);
        view.viewAll = node.get(V::viewAll);
        view.farDistance = node.get(V::farDistance);
        view.description = node.get(V::description).str();
        view.position = Vec3d(node.get(V::position));
    };
    if (node.is(x3d::Viewpoint::type)) {
        common(static_cast<const x3d::Viewpoint*>(nullptr));
        view.fieldOfView = node.get(x3d::Viewpoint::fieldOfView);
    } else if (node.is(x3d::OrthoViewpoint::type)) {
        common(static_cast<const x3d::OrthoViewpoint*>(nullptr));
        view.orthographic = true;
        const auto& extent = node.get(x3d::OrthoViewpoint::fieldOfView);
        for (std::size_t i = 0; i < 4 && extent.size() >= 4; ++i) view.extent[i] = extent[i];
    } else if (node.is(x3d::GeoViewpoint::type)) {
        common(static_cast<const x3d::GeoViewpoint*>(nullptr));
        view.fieldOfView = node.get(x3d::GeoViewpoint::fieldOfView);
    }
    return view;
}

/// Fields may hold numbers whose products leave the range of float; a picture never does.
Vec4f finite(Vec4f v) {
    for (int c = 0; c < 4; ++c) v[c] = v[c] > 0 ? std::min(v[c], std::numeric_limits<float>::max()) : 0.0f;  // NaN: 0
    return v;
}

/// Encodes what PhysicalMaterials have added and puts it to the rest.
void addLight(TileResult& tile) {
    for (std::size_t i = 0; i < tile.sum.size(); ++i) {
        const Vec3f& share = tile.share[i];
        if (share == Vec3f(0)) continue;
        for (int c = 0; c < 3; ++c)
            if (share[c] > 0) tile.sum[i][c] += share[c] * srgbFromLinear(tile.light[i][c] / share[c]);
    }
}

template <class S>
void readColors(const Node& node, Sky& sky, const S*) {
    const auto colors = [](const Array<Color>& from) {
        std::vector<Vec3f> result;
        for (const Color& c : from) result.emplace_back(std::max(c.r, 0.0f), std::max(c.g, 0.0f), std::max(c.b, 0.0f));
        return result;
    };
    sky.skyColors = colors(node.get(S::skyColor));
    sky.groundColors = colors(node.get(S::groundColor));
    sky.skyAngles.assign(node.get(S::skyAngle).begin(), node.get(S::skyAngle).end());
    sky.groundAngles.assign(node.get(S::groundAngle).begin(), node.get(S::groundAngle).end());
    sky.alpha = std::clamp(1 - node.get(S::transparency), 0.0f, 1.0f);
}

}  // namespace

struct LightTracer::Impl {
    explicit Impl(Resources resources) : textures(std::move(resources)) { materials.resize(1); }

    TextureStore textures;
    Diagnostics diagnostics;  // of this apply() so far
    Diagnostics said;         // since the start, each once
    ToldOnce told;
    std::vector<MaterialEntry> materials;  // [0]: without an Appearance
    std::vector<std::uint32_t> freeMaterials;
    std::unordered_map<std::uint32_t, std::uint32_t> materialOf;  // appearance -> index
    std::vector<SlotShading> slots;
    std::unordered_map<std::uint32_t, std::shared_ptr<const Mesh>> meshes;  // of those with texture mappings
    std::vector<PlacedEntry> placed;
    std::unordered_multimap<std::uint32_t, std::uint32_t> placedOf;  // node -> slots
    std::unordered_set<std::uint32_t> alphaColored;  // geometries whose vertex colours may let light through
    std::vector<std::uint32_t> scopeParent{0};
    std::vector<std::vector<std::uint32_t>> lists;  // placed slots of the lights that reach a scope
    std::vector<std::uint32_t> listOfScope;
    bool lightsChanged = true;
    Counts counts;

    // ---- materials -----------------------------------------------------------------------------------------
    std::uint32_t takeMaterial(const Scene& scene, NodeId appearance) {
        if (!appearance) return 0;
        const auto [found, isNew] = materialOf.try_emplace(appearance.value, 0u);
        if (isNew) {
            if (freeMaterials.empty()) {
                found->second = static_cast<std::uint32_t>(materials.size());
                materials.emplace_back();
            } else {
                found->second = freeMaterials.back();
                freeMaterials.pop_back();
            }
            materials[found->second].appearance = appearance;
            loadMaterial(scene, materials[found->second]);
        }
        ++materials[found->second].users;
        return found->second;
    }
    void loadMaterial(const Scene& scene, MaterialEntry& entry) {
        entry.material = readMaterial(scene, entry.appearance, textures, diagnostics);
        entry.finish();
        ++counts.materialsRead;
    }
    void dropMaterial(std::uint32_t index) {
        if (index == 0 || --materials[index].users > 0) return;
        materialOf.erase(materials[index].appearance.value);
        materials[index] = MaterialEntry();
        freeMaterials.push_back(index);
    }

    /// Which of the mesh's texture coordinates each texture uses.
    void findChannels(SlotShading& slot, const std::unordered_map<std::uint32_t, std::shared_ptr<const Mesh>>& known) {
        slot.channels = {};
        const Material& material = materials[slot.material].material;
        for (std::size_t role = 0; role < kTextureRoles; ++role) {
            const String& mapping = material.textures[role].mapping;
            if (mapping.empty()) continue;
            const auto mesh = known.find(slot.geometry.value);
            if (mesh == known.end() || !mesh->second) continue;
            for (std::size_t c = 0; c < mesh->second->texCoords.size() && c < 256; ++c)
                if (mesh->second->texCoords[c].mapping == mapping) {
                    slot.channels[role] = static_cast<std::uint8_t>(c);
                    break;
                }
        }
    }

    // ---- instances -----------------------------------------------------------------------------------------
    void release(std::uint32_t index) {
        if (index >= slots.size() || !slots[index].used) return;
        dropMaterial(slots[index].material);
        slots[index] = SlotShading();
    }
    void bind(const Scene& scene, const Instance& instance) {
        if (instance.id.slot >= slots.size()) slots.resize(instance.id.slot + 1);
        const std::uint32_t material = takeMaterial(scene, instance.appearance);
        release(instance.id.slot);
        SlotShading& slot = slots[instance.id.slot];
        slot.used = true;
        slot.material = material;
        slot.appearance = instance.appearance;
        slot.geometry = instance.geometry;
        slot.scope = instance.scope;
        findChannels(slot, meshes);
        assignLights(slot);
    }

    // ---- lights and the other placed things ----------------------------------------------------------------
    void assignLights(SlotShading& slot) {
        slot.lights = slot.scope.value < listOfScope.size() ? listOfScope[slot.scope.value] : 0;
    }
    void buildLightLists() {
        lists.clear();
        const std::vector<std::uint32_t> before = std::exchange(listOfScope, {});
        listOfScope.assign(scopeParent.size(), 0);
        std::vector<std::uint32_t> global;
        bool local = false;
        for (std::uint32_t i = 0; i < placed.size(); ++i)
            if (const Light* light = std::get_if<Light>(&placed[i].what); light && light->on) {
                if (light->scope.value == 0)
                    global.push_back(i);
                else
                    local = true;
            }
        lists.push_back(std::move(global));
        if (local)
            for (std::uint32_t scope = 1; scope < scopeParent.size(); ++scope) {
                std::vector<std::uint32_t> list;
                for (std::uint32_t i = 0; i < placed.size(); ++i) {
                    const Light* light = std::get_if<Light>(&placed[i].what);
                    if (light && light->on && (light->scope.value == 0 || isWithin(scope, light->scope.value)))
                        list.push_back(i);
                }
                if (list != lists[0]) {
                    listOfScope[scope] = static_cast<std::uint32_t>(lists.size());
                    lists.push_back(std::move(list));
                }
            }
        // Nearly always the scopes keep their lists, whose contents alone have changed.
        if (before != listOfScope)
            for (SlotShading& slot : slots) assignLights(slot);
    }
    bool isWithin(std::uint32_t scope, std::uint32_t outer) const {
        for (std::size_t steps = 0; steps <= scopeParent.size(); ++steps) {
            if (scope == outer) return true;
            if (scope == 0 || scope >= scopeParent.size()) return false;
            scope = scopeParent[scope];
        }
        return false;
    }

    void readPlaced(const Scene& scene, PlacedEntry& entry) {
        const Placed& p = entry.placed;
        const Node* node = scene.find(p.node);
        const auto before = std::exchange(entry.what, std::monostate());
        if (!node) return;
        switch (p.kind) {
            case PlacedKind::light: {
                const Light light = readLight(scene, p.node, p.worldFromLocal, p.scope);
                const Light* old = std::get_if<Light>(&before);
                lightsChanged = lightsChanged || !old || old->on != light.on || old->scope != light.scope;
                entry.what = light;
                ++counts.lightsRead;
                break;
            }
            case PlacedKind::view:
                entry.what = readView(scene, *node);
                break;
            case PlacedKind::background:
                entry.what = readSky(scene, *node, p.worldFromLocal);
                break;
            case PlacedKind::fog:
                if (node->is(x3d::Fog::type))
                    entry.what = FogEntry{readFog(scene, p.node, p.worldFromLocal), node->get(x3d::Fog::isBound)};
                break;
            case PlacedKind::navigation:
                if (node->is(x3d::NavigationInfo::type))
                    entry.what =
                        Navigation{node->get(x3d::NavigationInfo::headlight), node->get(x3d::NavigationInfo::isBound),
                                   node->get(x3d::NavigationInfo::visibilityLimit)};
                break;
            default:
                break;
        }
    }
    SkyEntry readSky(const Scene& scene, const Node& node, const WorldFromLocal& worldFromLocal) {
        SkyEntry entry;
        constexpr auto color = Texture::Content::color;
        if (node.is(x3d::Background::type)) {
            using B = x3d::Background;
            readColors(node, entry.sky, static_cast<const B*>(nullptr));
            entry.bound = node.get(B::isBound);
            const Field<Array<String>> urls[] = {B::frontUrl, B::backUrl, B::leftUrl,
                                                 B::rightUrl, B::topUrl,  B::bottomUrl};
            for (std::size_t i = 0; i < 6; ++i)
                entry.sky.panorama[i] = textures.ofUrls(scene, node, node.get(urls[i]), color, diagnostics);
        } else if (node.is(x3d::TextureBackground::type)) {
            using B = x3d::TextureBackground;
            readColors(node, entry.sky, static_cast<const B*>(nullptr));
            entry.bound = node.get(B::isBound);
            const Field<NodeId> sides[] = {B::frontTexture, B::backTexture, B::leftTexture,
                                           B::rightTexture, B::topTexture,  B::bottomTexture};
            for (std::size_t i = 0; i < 6; ++i)
                if (const Node* side = scene.effectiveNode(node.get(sides[i])))
                    entry.sky.panorama[i] = textures.ofNode(scene, *side, color, diagnostics);
        }
        entry.sky.localFromWorld = glm::mat3(glm::transpose(turningOf(worldFromLocal)));
        return entry;
    }
    void unplace(std::uint32_t slot) {
        PlacedEntry& entry = placedAt(slot);
        if (!entry.placed.id) return;
        const auto [first, last] = placedOf.equal_range(entry.placed.node.value);
        for (auto i = first; i != last; ++i)
            if (i->second == slot) {
                placedOf.erase(i);
                break;
            }
        if (entry.placed.kind == PlacedKind::light) lightsChanged = true;
        entry = PlacedEntry();
    }
    void place(const Scene& scene, const Placed& what) {
        unplace(what.id.slot);
        PlacedEntry& entry = placedAt(what.id.slot);
        entry.placed = what;
        placedOf.emplace(what.node.value, what.id.slot);
        readPlaced(scene, entry);
    }
    PlacedEntry& placedAt(std::uint32_t slot) {
        if (slot >= placed.size()) placed.resize(slot + 1);
        return placed[slot];
    }

    /// The bound one of a kind, else the one that comes first in the document. A node that several paths lead to is
    /// seen through one of them: which is up to us (7.2.2), but must not depend on the order in which they came.
    template <class T>
    const PlacedEntry* active() const {
        const auto rank = [](const PlacedEntry& entry) {
            const double* matrix = &entry.placed.worldFromLocal[0][0];
            return std::tuple(!std::get<T>(entry.what).bound, entry.placed.node,
                              std::span<const double, 12>(matrix, 12));
        };
        const auto before = [&](const PlacedEntry& a, const PlacedEntry& b) {
            const auto [unboundA, nodeA, matrixA] = rank(a);
            const auto [unboundB, nodeB, matrixB] = rank(b);
            if (unboundA != unboundB) return unboundB;
            if (nodeA != nodeB) return nodeA < nodeB;
            return std::ranges::lexicographical_compare(matrixA, matrixB);
        };
        const PlacedEntry* best = nullptr;
        for (const PlacedEntry& entry : placed)
            if (std::holds_alternative<T>(entry.what) && (!best || before(entry, *best))) best = &entry;
        return best;
    }

    TraceScene makeTraceScene(const RayWorld& world, const Camera& camera, const RenderSettings& settings) const;
};

LightTracer::LightTracer(Resources resources) : impl_(std::make_unique<Impl>(std::move(resources))) {}
LightTracer::~LightTracer() = default;

Result<> LightTracer::apply(const Scene& scene, const ChangeSet&, const InstanceDelta& delta) {
    Impl& s = *impl_;
    for (const InstanceDelta::Scope& scope : delta.scopes) {
        if (scope.scope.value >= s.scopeParent.size()) s.scopeParent.resize(scope.scope.value + 1, 0u);
        s.scopeParent[scope.scope.value] = scope.parent.value;
        s.lightsChanged = true;
    }
    for (const InstanceDelta::Geometry& geometry : delta.geometries) {
        // Only meshes whose coordinates have names can matter to findChannels.
        const bool named = geometry.mesh && std::ranges::any_of(geometry.mesh->texCoords,
                                                                [](const TexCoords& t) { return !t.mapping.empty(); });
        const bool known =
            named ? (s.meshes[geometry.node.value] = geometry.mesh, true) : s.meshes.erase(geometry.node.value) > 0;
        if (known)
            for (SlotShading& slot : s.slots)
                if (slot.used && slot.geometry == geometry.node) s.findChannels(slot, s.meshes);
    }
    for (const InstanceId& id : delta.removed) s.release(id.slot);
    for (const Instance& instance : delta.added) s.bind(scene, instance);
    for (const Instance& instance : delta.rebound) s.bind(scene, instance);
    for (const NodeId geometry : delta.geometriesRemoved) {
        s.meshes.erase(geometry.value);
        s.alphaColored.erase(geometry.value);
    }

    for (const NodeId appearance : delta.appearanceChanged) {
        const auto found = s.materialOf.find(appearance.value);
        if (found == s.materialOf.end()) continue;
        s.loadMaterial(scene, s.materials[found->second]);
        if (!s.meshes.empty())
            for (SlotShading& slot : s.slots)
                if (slot.used && slot.material == found->second) s.findChannels(slot, s.meshes);
    }
    if (!delta.removed.empty() || !delta.rebound.empty() || !delta.appearanceChanged.empty()) s.textures.collect();

    for (const InstanceId& id : delta.placedRemoved) s.unplace(id.slot);
    for (const Placed& added : delta.placedAdded) s.place(scene, added);
    for (const Placed& rebound : delta.placedRebound) s.place(scene, rebound);
    for (const InstanceDelta::Moved& moved : delta.placedMoved) {
        PlacedEntry& entry = s.placedAt(moved.id.slot);
        entry.placed.worldFromLocal = moved.worldFromLocal;
        s.readPlaced(scene, entry);
    }
    for (const NodeId node : delta.placedChanged) {
        const auto [first, last] = s.placedOf.equal_range(node.value);
        for (auto i = first; i != last; ++i) s.readPlaced(scene, s.placed[i->second]);
    }
    if (s.lightsChanged) s.buildLightLists();
    s.lightsChanged = false;
    if (!s.diagnostics.all().empty()) s.told.append(std::exchange(s.diagnostics, Diagnostics()), s.said);
    return {};
}

Result<Camera> LightTracer::camera(const RayWorld& world, double aspect, std::string_view name) const {
    const Impl& s = *impl_;
    if (!(aspect > 0) || !std::isfinite(aspect)) return fail("a picture's width and height must be positive");
    const PlacedEntry* chosen = nullptr;
    if (name.empty()) {
        chosen = s.active<View>();
    } else {
        std::string known;
        for (const PlacedEntry& entry : s.placed)
            if (const View* view = std::get_if<View>(&entry.what)) {
                const bool matches = view->name == name || view->description == name;
                if (matches && (!chosen || view->name == name)) chosen = &entry;
                known += fmt::format("{}\"{}\"", known.empty() ? "" : ", ",
                                     view->name.empty() ? view->description : view->name);
            }
        if (!chosen)
            return fail(
                fmt::format("no viewpoint is called \"{}\"; there are: {}", name, known.empty() ? "none" : known));
    }
    const auto frameEverything = [&](Camera& camera) {
        const Bounds bounds = world.bounds();
        if (!bounds.empty()) camera.frame(world.toWorld(bounds.min), world.toWorld(bounds.max));
    };
    Camera camera;
    if (!chosen) {
        camera = Camera::perspective(identityTransform(), {0, 0, 10}, {}, 0.7854, aspect);
        frameEverything(camera);
        return camera;
    }
    const View& view = std::get<View>(chosen->what);
    camera = view.orthographic
                 ? Camera::parallel(chosen->placed.worldFromLocal, view.position, view.orientation, view.extent, aspect)
                 : Camera::perspective(chosen->placed.worldFromLocal, view.position, view.orientation, view.fieldOfView,
                                       aspect);
    if (view.viewAll) frameEverything(camera);
    if (view.farDistance > 0)
        camera.visibilityLimit = view.farDistance;
    else if (const PlacedEntry* navigation = s.active<Navigation>())
        if (const float limit = std::get<Navigation>(navigation->what).visibilityLimit; limit > 0)
            camera.visibilityLimit = limit;
    return camera;
}

TraceScene LightTracer::Impl::makeTraceScene(const RayWorld& world, const Camera& camera,
                                             const RenderSettings& settings) const {
    static const Sky black;
    TraceScene scene;
    scene.world = &world;
    scene.materials = materials;
    scene.slots = slots;
    const PlacedEntry* sky = active<SkyEntry>();
    scene.sky = sky ? &std::get<SkyEntry>(sky->what).sky : &black;
    scene.evenSky = scene.sky->uniform();
    if (scene.evenSky) {
        scene.skyLinear = scene.sky->color({0, 1, 0}, ColorSpace::linear);
        scene.skyDisplay = scene.sky->color({0, 1, 0}, ColorSpace::display);
    }
    if (const PlacedEntry* fog = active<FogEntry>()) scene.fog = std::get<FogEntry>(fog->what).fog;
    scene.fogLinear = linearFromSrgb(scene.fog.color);
    scene.space = settings.integrator == Integrator::path ? ColorSpace::linear : settings.colorSpace;

    const auto toTrace = [&](const Light& light) {
        TraceLight result;
        result.kind = light.kind;
        result.shadows = settings.shadows == Shadows::all || (settings.shadows == Shadows::authored && light.shadows);
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
    headlight.direction = Vec3f(camera.forward);
    const PlacedEntry* navigation = active<Navigation>();
    const bool lit = !navigation || std::get<Navigation>(navigation->what).headlight;
    scene.lightLists.resize(std::max<std::size_t>(lists.size(), 1));
    for (std::size_t i = 0; i < scene.lightLists.size(); ++i) {
        if (i < lists.size())
            for (const std::uint32_t slot : lists[i])
                scene.lightLists[i].push_back(toTrace(std::get<Light>(placed[slot].what)));
        if (lit) scene.lightLists[i].push_back(headlight);
    }
    scene.anyTransmits =
        std::ranges::any_of(materials, [](const MaterialEntry& m) { return m.users > 0 && m.transmits; });
    scene.anyTransmits = scene.anyTransmits || !alphaColored.empty();
    const auto height = static_cast<float>((camera.top - camera.bottom) / settings.height);
    (camera.orthographic ? scene.pixelSize : scene.pixelSpread) = height;
    return scene;
}

Result<Picture> LightTracer::render(const RayWorld& world, const Camera& camera, const RenderSettings& settings,
                                    RenderStats* stats) const {
    constexpr int kMaxSide = 1 << 16;
    if (settings.width < 1 || settings.height < 1 || settings.width > kMaxSide || settings.height > kMaxSide)
        return fail(fmt::format("cannot render {} x {} pixels; both must be from 1 to {}", settings.width,
                                settings.height, kMaxSide));
    if (settings.samplesPerPixel < 1 || settings.samplesPerPixel > 1 << 20)
        return fail(fmt::format("cannot take {} samples per pixel", settings.samplesPerPixel));
    if (settings.integrator == Integrator::raster)
        return fail("the rasteriser is not built in; there are whitted and path");
    if (settings.integrator == Integrator::path && settings.colorSpace == ColorSpace::display)
        return fail("paths are light: they cannot be computed in the display's space, only auto and linear");
    const auto start = std::chrono::steady_clock::now();
    const TraceScene scene = impl_->makeTraceScene(world, camera, settings);
    Picture picture(settings.width, settings.height);
    picture.space = scene.space == ColorSpace::linear ? ColorSpace::linear : ColorSpace::display;
    const int tilesX = (settings.width + kTileSide - 1) / kTileSide,
              tilesY = (settings.height + kTileSide - 1) / kTileSide;
    const int tiles = tilesX * tilesY;
    std::atomic<std::uint64_t> primary = 0, shadow = 0, secondary = 0;
    std::atomic<int> done = 0;
    std::atomic<bool> cancelled = false;
    std::mutex progressMutex;
    const float scale = 1.0f / static_cast<float>(settings.samplesPerPixel);

    const auto drawTile = [&](int tile) {
        if (cancelled.load(std::memory_order_relaxed)) return;
        const int x0 = tile % tilesX * kTileSide, y0 = tile / tilesX * kTileSide;
        TileResult result;
        (settings.integrator == Integrator::path ? pathTile : whittedTile)(scene, camera, settings, x0, y0, result);
        if (scene.space == ColorSpace::automatic) addLight(result);
        for (int y = 0; y < kTileSide && y0 + y < settings.height; ++y)
            for (int x = 0; x < kTileSide && x0 + x < settings.width; ++x)
                picture.at(x0 + x, y0 + y) =
                    finite(result.sum[static_cast<std::size_t>(y) * kTileSide + static_cast<std::size_t>(x)] * scale);
        primary += result.primaryRays, shadow += result.shadowRays, secondary += result.secondaryRays;
        const int finished = ++done;
        if (settings.progress && progressMutex.try_lock()) {
            const std::lock_guard lock(progressMutex, std::adopt_lock);
            if (!settings.progress(static_cast<double>(finished) / tiles)) cancelled = true;
        }
    };
    // No more than there are: TBB would only warn.
    const int available = tbb::this_task_arena::max_concurrency();
    tbb::task_arena arena(
        settings.threads == 0 ? available : std::min(available, static_cast<int>(std::min(settings.threads, 1024u))));
    arena.execute([&] { tbb::parallel_for(0, tiles, drawTile); });

    if (stats) {
        stats->primaryRays = primary, stats->shadowRays = shadow, stats->secondaryRays = secondary;
        stats->seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        stats->cancelled = cancelled;
    }
    return picture;
}

LightTracer::Counts LightTracer::counts() const {
    Counts result = impl_->counts;
    result.materials = impl_->materialOf.size();
    result.lights = static_cast<std::size_t>(std::ranges::count_if(
        impl_->placed, [](const PlacedEntry& e) { return std::holds_alternative<Light>(e.what); }));
    return result;
}

const Diagnostics& LightTracer::diagnostics() const {
    return impl_->said;
}

}  // namespace rtsg
