// Keeps the rasteriser's things in step with the instances of a scene.
#include "raster_scene.h"

#include <algorithm>
#include <ctime>
#include <utility>

namespace rtsg {

namespace {

double threadCpuSeconds() {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

RasterScene::~RasterScene() {
    if (!module_) return;
    for (std::uint32_t slot = 0; slot < slots_.size(); ++slot) release(slot);
}

void RasterScene::open(RasterModule* module) {
    module_ = module;
    textures_.open(module);
    for (std::uint32_t slot = 0; slot < slots_.size(); ++slot)
        if (slots_[slot].used) dirtySlots_.insert(slot);
}

// ---- what happens in the scene ---------------------------------------------------------------------------------

void RasterScene::setInstance(const Instance& instance) {
    const std::uint32_t at = instance.id.slot;
    if (at >= slots_.size()) slots_.resize(at + 1);
    Slot& slot = slots_[at];
    if (slot.used) {
        geometries_[slot.instance.geometry.value].slots.erase(at);
        looking_[slot.instance.appearance.value].erase(at);
    }
    slot.instance = instance, slot.used = true;
    geometries_[instance.geometry.value].slots.insert(at);
    looking_[instance.appearance.value].insert(at);
    dirtySlots_.insert(at);
}

void RasterScene::follow(const InstanceDelta& delta) {
    const double start = threadCpuSeconds();
    for (const InstanceDelta::Geometry& geometry : delta.geometries) {
        geometries_[geometry.node.value].mesh = geometry.mesh;
        dirtyGeometries_.insert(geometry.node.value);
    }
    for (const InstanceId& id : delta.removed) {
        if (id.slot >= slots_.size() || !slots_[id.slot].used) continue;
        Slot& slot = slots_[id.slot];
        geometries_[slot.instance.geometry.value].slots.erase(id.slot);
        looking_[slot.instance.appearance.value].erase(id.slot);
        slot.used = false;
        dirtySlots_.insert(id.slot);
    }
    for (const Instance& instance : delta.added) setInstance(instance);
    for (const Instance& instance : delta.rebound) setInstance(instance);
    for (const InstanceDelta::Moved& moved : delta.moved) {
        if (moved.id.slot >= slots_.size()) continue;
        slots_[moved.id.slot].instance.worldFromLocal = moved.worldFromLocal;
        movedSlots_.insert(moved.id.slot);
    }
    for (const NodeId appearance : delta.appearanceChanged)
        if (const auto found = looking_.find(appearance.value); found != looking_.end())
            dirtySlots_.insert(found->second.begin(), found->second.end());
    for (const NodeId geometry : delta.geometriesRemoved) {
        geometries_[geometry.value].mesh = nullptr;
        dirtyGeometries_.insert(geometry.value);
    }
    counts_.handing += threadCpuSeconds() - start;
}

WorldBox RasterScene::box(std::uint16_t layer) const {
    WorldBox box;
    for (const Slot& slot : slots_) {
        if (!slot.used || slot.instance.layer != layer || !slot.instance.seen) continue;
        const auto found = geometries_.find(slot.instance.geometry.value);
        if (found == geometries_.end() || !found->second.mesh || found->second.mesh->bounds.empty()) continue;
        const Bounds& b = found->second.mesh->bounds;
        for (int k = 0; k < 8; ++k)
            box.extend(slot.instance.worldFromLocal * Vec4d((k & 1) != 0 ? b.max.x : b.min.x,
                                                            (k & 2) != 0 ? b.max.y : b.min.y,
                                                            (k & 4) != 0 ? b.max.z : b.min.z, 1));
    }
    return box;
}

RasterContent RasterScene::content() const {
    RasterContent content;
    for (const Slot& slot : slots_) {
        if (!slot.used || slot.materials.empty()) continue;
        ++content.instances;
        content.triangles += geometries_.at(slot.instance.geometry.value).mesh->triangleCount;
    }
    return content;
}

// ---- what is handed over ---------------------------------------------------------------------------------------

void RasterScene::handMeshes(Geometry& geometry) {
    if (!geometry.mesh) {
        geometry.corners.clear();
        return;
    }
    for (const auto& [channel, number] : geometry.numbers) {
        RasterCorners& corners = geometry.corners[channel];
        if (RasterArrays moved; corners.next(geometry.mesh, channel, moved)) {
            module_->bendMesh(number, moved.view());
            ++counts_.bent;
            continue;
        }
        const RasterArrays arrays = corners.start(geometry.mesh, channel);
        module_->setMesh(number, arrays.view());
        ++counts_.meshes;
    }
}

std::uint32_t RasterScene::takeMesh(NodeId node, std::size_t channel) {
    Geometry& geometry = geometries_[node.value];
    const auto [found, isNew] = geometry.numbers.try_emplace(channel, nextMesh_ + 1);
    ++meshUsers_[found->second];
    if (!isNew) return found->second;
    ++nextMesh_;
    meshOf_[found->second] = {node.value, channel};
    const RasterArrays arrays = rasterArrays(*geometry.mesh, channel);
    module_->setMesh(found->second, arrays.view());
    ++counts_.meshes;
    return found->second;
}

void RasterScene::dropMesh(std::uint32_t number) {
    if (number == 0 || --meshUsers_[number] > 0) return;
    const auto [node, channel] = meshOf_[number];
    meshUsers_.erase(number), meshOf_.erase(number);
    module_->dropMesh(number);
    const auto geometry = geometries_.find(node);
    geometry->second.numbers.erase(channel), geometry->second.corners.erase(channel);
    if (geometry->second.slots.empty() && !geometry->second.mesh) geometries_.erase(geometry);
}

std::uint32_t RasterScene::takeMaterial(const std::shared_ptr<const Material>& material, const LookKind& kind) {
    const MaterialKey key{material.get(), kind};
    const auto [found, isNew] = materialNumbers_.try_emplace(key, nextMaterial_ + 1);
    MaterialEntry& entry = materials_[found->second];
    ++entry.users;
    if (!isNew) return found->second;
    ++nextMaterial_;
    entry.from = material, entry.key = key;
    entry.created = rasterMaterial(*material, kind, textures_, lack_);
    module_->setMaterial(found->second, entry.created);
    ++counts_.materials;
    return found->second;
}

void RasterScene::dropMaterial(std::uint32_t number) {
    MaterialEntry& entry = materials_[number];
    if (--entry.users > 0) return;
    module_->dropMaterial(number);
    dropTextures(entry.created, textures_);
    materialNumbers_.erase(entry.key);
    materials_.erase(number);
}

void RasterScene::release(std::uint32_t at) {
    Slot& slot = slots_[at];
    for (std::uint32_t i = 0; i < slot.materials.size(); ++i) module_->dropItem(2 * at + i);
    for (const std::uint32_t material : std::exchange(slot.materials, {})) dropMaterial(material);
    dropMesh(std::exchange(slot.mesh, 0));
}

void RasterScene::moveOrigin(const Vec3d& eye) {
    constexpr double kFar = 1024;  // metres: a float tells sixteenths of a millimetre apart there
    if (!originMoved_ && glm::distance(eye, origin_) < kFar) return;
    origin_ = glm::round(eye), originMoved_ = true;
    for (std::uint32_t slot = 0; slot < slots_.size(); ++slot) movedSlots_.insert(slot);
}

void RasterScene::bringTables(const SurfaceState& state, const std::vector<LayerView>& layers) {
    std::vector<std::uint16_t> numbers;
    for (const LayerView& layer : layers) numbers.push_back(layer.camera.layer);
    if (state == state_ && numbers == layers_ && !originMoved_ && !anyCuts_) return;
    std::vector<std::vector<SurfaceState::Surroundings>> all;
    std::map<std::uint16_t, std::uint32_t> first;
    std::uint32_t count = 0;
    anyCuts_ = false;
    for (const LayerView& layer : layers) {
        first[layer.camera.layer] = count;
        all.push_back(state.surroundings(layer.camera));
        count += static_cast<std::uint32_t>(all.back().size());
        for (const auto& position : all.back()) anyCuts_ = anyCuts_ || !position.cuts.empty();
    }
    module_->setTables(rasterTables(all, origin_, lack_));
    ++counts_.tables;
    if (first != firstSurroundings_)
        for (std::uint32_t slot = 0; slot < slots_.size(); ++slot)
            if (slots_[slot].used) dirtySlots_.insert(slot);
    firstSurroundings_ = std::move(first), layers_ = std::move(numbers);
}

void RasterScene::bringSkies(const SurfaceState& state, const std::vector<LayerView>& layers) {
    skies_.resize(layers.size());
    for (std::size_t i = 0; i < layers.size(); ++i) {
        SkyEntry& entry = skies_[i];
        const Sky* sky = state.sky(layers[i].camera.layer);
        if (entry.known && (sky ? entry.from == *sky : !entry.from)) continue;
        RasterSky created = rasterSky(sky, i > 0, textures_);
        for (const std::uint32_t side : entry.sky.sides)
            if (side != 0) textures_.drop(side);
        entry = {sky ? std::optional(*sky) : std::nullopt, true, std::move(created)};
    }
}

std::uint32_t RasterScene::locationOf(const SurfaceState::Look& look, std::uint16_t layer) const {
    const auto first = firstSurroundings_.find(layer);
    return look.surroundings + (first == firstSurroundings_.end() ? 0 : first->second);
}

namespace {

void setSurroundings(const WorldFromLocal& m, const Vec3d& origin, RasterObject& object) {
    object.linear = glm::mat3(glm::dmat3(m[0], m[1], m[2]));
    object.position = Vec3f(m[3] - origin);
    object.mirrored = determinantSign(m) < 0;
}

void setStrokes(const StrokeStyle& style, bool points, RasterObject& object) {
    object.stroke = {points ? style.pointSize : style.lineWidth, points ? 1 : static_cast<float>(style.lineType),
                     style.minimum, style.maximum};
    object.attenuation = Vec4f(style.attenuation, points && style.attenuated() ? 1 : 0);
}

/// The first of the coordinates that a material's textures use.
std::size_t channelOf(const SurfaceState::Look& look) {
    for (std::size_t role = 0; role < kTextureRoles; ++role)
        if (look.material->textures[role].texture) return look.channels[role];
    return 0;
}

bool usesSeveral(const SurfaceState::Look& look) {
    for (std::size_t role = 0; role < kTextureRoles; ++role)
        if (look.material->textures[role].texture && look.channels[role] != channelOf(look)) return true;
    return false;
}

}  // namespace

RasterScene::MeshTraits RasterScene::traitsOf(const Mesh* mesh) {
    if (!mesh) return {};
    MeshTraits traits;
    traits.drawn = mesh->triangleCount > 0 || mesh->strokeCount > 0;
    traits.solid = mesh->solid;
    traits.fogged = mesh->fogDepths.present(), traits.colored = mesh->colors.present();
    traits.generated = std::ranges::any_of(
        mesh->texCoords, [](const TexCoords& c) { return c.generator != TexCoords::Generator::none; });
    traits.kind = {mesh->strokeCount > 0, mesh->strokes == Mesh::Strokes::points, mesh->normals.present(),
                   traits.colored && mesh->colors.components() == 4};
    return traits;
}

void RasterScene::bringSlot(const SurfaceState& state, std::uint32_t at) {
    const Slot before = slots_[at];  // holds what both use while it is exchanged
    Slot& slot = slots_[at];
    const Instance& instance = slot.instance;
    const auto geometry = geometries_.find(instance.geometry.value);
    const Mesh* mesh = geometry != geometries_.end() ? geometry->second.mesh.get() : nullptr;
    if (slot.used && instance.volume) lack_("a volume is left out");
    const MeshTraits traits = traitsOf(mesh);
    const bool drawn = slot.used && traits.drawn && instance.seen && !instance.volume && !instance.clear &&
                       isFinite(instance.worldFromLocal);
    if (!drawn) return release(at);
    const SurfaceState::Look look = state.look(at);
    const std::size_t channel = channelOf(look);
    if (usesSeveral(look)) lack_("textures of one material share its first texture coordinates");
    if (traits.generated && look.material->textured()) lack_("a TextureCoordinateGenerator is left out");
    const LookKind kind = traits.kind;
    RasterObject object;
    object.mesh = takeMesh(instance.geometry, channel);
    object.surroundings = locationOf(look, instance.layer), object.layer = instance.layer;
    object.colored = traits.colored, object.alphaColored = kind.alphaColored, object.fogged = traits.fogged;
    if (kind.strokes) setStrokes(instance.strokes ? *instance.strokes : StrokeStyle(), kind.points, object);
    setSurroundings(instance.worldFromLocal, origin_, object);
    std::vector<std::uint32_t> materials{takeMaterial(look.material, kind)};
    const bool backs = !traits.solid && !kind.strokes;
    const bool twice = backs && (look.material->back || materials_[materials[0]].created.clear);
    if (twice) materials.push_back(takeMaterial(look.material->back ? look.material->back : look.material, kind));
    for (std::uint32_t i = 0; i < materials.size(); ++i) {
        object.material = materials[i];
        // The second shows the backs, which lie behind the fronts.
        object.fronts = i == 0, object.backs = i == 1 || (backs && !twice), object.first = i == 1;
        module_->setItem(2 * at + i, object);
        ++counts_.objects;
    }
    if (before.materials.size() > materials.size()) module_->dropItem(2 * at + 1);
    slot.materials = std::move(materials), slot.mesh = object.mesh;
    for (const std::uint32_t material : before.materials) dropMaterial(material);
    dropMesh(before.mesh);
}

void RasterScene::bring(const SurfaceState& state, const std::vector<LayerView>& layers, const Vec3d& eye) {
    const double start = threadCpuSeconds();
    moveOrigin(eye);
    bringSkies(state, layers);
    bringTables(state, layers);
    for (const std::uint32_t node : std::exchange(dirtyGeometries_, {})) {
        const auto found = geometries_.find(node);
        if (found == geometries_.end()) continue;
        Geometry& geometry = found->second;
        handMeshes(geometry);
        if (const MeshTraits now = traitsOf(geometry.mesh.get()); std::exchange(geometry.traits, now) != now)
            dirtySlots_.insert(geometry.slots.begin(), geometry.slots.end());
    }
    for (const std::uint32_t slot : std::exchange(dirtySlots_, {})) {
        bringSlot(state, slot);
        movedSlots_.erase(slot);
    }
    for (const std::uint32_t at : std::exchange(movedSlots_, {})) {
        const Slot& slot = slots_[at];
        if (slot.used && (slot.materials.empty() || !isFinite(slot.instance.worldFromLocal))) bringSlot(state, at);
        if (!slot.used || slot.materials.empty()) continue;
        RasterObject object;
        setSurroundings(slot.instance.worldFromLocal, origin_, object);
        for (std::uint32_t i = 0; i < slot.materials.size(); ++i)
            module_->moveItem(2 * at + i, object.linear, object.position, object.mirrored);
        ++counts_.moved;
    }
    counts_.textures = textures_.created();
    state_ = state, originMoved_ = false;
    counts_.handing += threadCpuSeconds() - start;
}

}  // namespace rtsg
