// Light's tables: materials by instance, lights by scope, and the versions of both.
#include "light_tables.h"

#include "lighting/emitters.h"
#include "lighting/sky_light.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/shared_world.h>

#include "texture/volume.h"

namespace rtsg {

using namespace trace;

namespace {

/// Whether a delta has more than movements, which are the world's business.
bool concernsLight(const InstanceDelta& d) {
    return !d.scopes.empty() || !d.removed.empty() || !d.added.empty() || !d.rebound.empty() || !d.geometries.empty() ||
           !d.geometriesRemoved.empty() || !d.appearanceChanged.empty() || !d.placedRemoved.empty() ||
           !d.placedAdded.empty() || !d.placedMoved.empty() || !d.placedRebound.empty() || !d.placedChanged.empty();
}

/// Whether it is made of lines or points.
bool isStrokes(const Node& geometry) {
    return geometry.is(x3d::PointSet::type) || geometry.is(x3d::LineSet::type) ||
           geometry.is(x3d::IndexedLineSet::type) || geometry.is(x3d::Polypoint2D::type) ||
           geometry.is(x3d::Polyline2D::type) || geometry.is(x3d::Arc2D::type) || geometry.is(x3d::Circle2D::type);
}

void reportOfTextures(const Scene& scene, NodeId geometry, const Material& material, Diagnostics& diagnostics) {
    if (!material.textured()) return;
    const Node* node = scene.effectiveNode(geometry);
    if (!node || !isStrokes(*node)) return;
    const std::string_view name = scene.name(node->id());
    diagnostics.warningAt(scene.locationOf(node->id()),
                          fmt::format("{}{}{}: lines and points have no textures, so those of its Appearance change "
                                      "nothing",
                                      node->type().name, name.empty() ? "" : " ", name));
}

}  // namespace

std::shared_ptr<TextureStore> sharedTextures(SharedWorld& world, const Resources& resources) {
    const auto make = [&] { return std::make_shared<TextureStore>(resources); };
    return std::static_pointer_cast<TextureStore>(world.shared(TextureStore::nameOf(resources), make));
}

void LightTables::reportOfDamage() {
    textures_->reportOfDamage(said_);
}

LightTables::LightTables(std::shared_ptr<TextureStore> textures)
    : textures_(std::move(textures)),
      emitterTable_(std::make_shared<EmitterTable>()),
      skyTable_(std::make_shared<SkyTable>()) {
    uses_.resize(1);
    materials_.resize(1);
    materials_.change(0) = std::make_shared<const MaterialEntry>();
    scopes_.resize(1);
    lightScopes_.resize(1);
    numberOf_.emplace(0u, 0u);
}

void LightTables::apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) {
    followLayers(scene, changes);
    if (!concernsLight(delta)) return;
    latest_.reset();
    for (const InstanceDelta::Scope& scope : delta.scopes) {
        const std::uint32_t around = scopeNumber(scope.parent), number = scopeNumber(scope.scope);
        lightScopes_.change(number).around = around;
    }
    followGeometries(delta);
    for (const InstanceId& id : delta.removed) release(id.slot);
    for (const Instance& instance : delta.added) bind(scene, instance);
    for (const Instance& instance : delta.rebound) bind(scene, instance);
    for (const NodeId geometry : delta.geometriesRemoved) {
        namedMeshes_.erase(geometry.value);
        alphaColored_.erase(geometry.value);
    }
    followMaterials(scene, delta);
    if (!delta.removed.empty() || !delta.rebound.empty() || !delta.appearanceChanged.empty()) textures_->collect();
    followPlaced(scene, delta);
    followLights();
    reportOfMappings(scene);
    if (!diagnostics_.all().empty()) reported_.append(std::exchange(diagnostics_, Diagnostics()), said_);
}

LightState LightTables::now() const {
    return {shading_.now(), materials_.now(), lightScopes_.now(), placed_.now(), anyTransmits(),
            clearSlots(),   layers_,          volumeSlots(),      emitterTable_, skyTable_};
}

std::shared_ptr<const std::vector<std::uint32_t>> LightTables::clearSlots() const {
    // If any geometry has colours with an alpha there is no list, since it is not known which instances use it.
    if (transmitting_.empty() || !alphaColored_.empty() || transmitting_.size() > LightState::kMaxClear) return nullptr;
    auto list = std::make_shared<std::vector<std::uint32_t>>();
    for (const std::uint32_t material : transmitting_)
        for (std::uint32_t slot = uses_[material].first; slot != kNone; slot = slots_[slot].next) {
            if (list->size() == LightState::kMaxClear) return nullptr;
            list->push_back(slot);
        }
    return list;
}

std::shared_ptr<const std::vector<std::uint32_t>> LightTables::volumeSlots() const {
    if (volumes_.empty()) return nullptr;
    auto list = std::make_shared<std::vector<std::uint32_t>>();
    for (const std::uint32_t material : volumes_)
        for (std::uint32_t slot = uses_[material].first; slot != kNone; slot = slots_[slot].next) list->push_back(slot);
    std::ranges::sort(*list);
    return list;
}

std::shared_ptr<const LightState> LightTables::latest() {
    if (!latest_)
        latest_ = std::make_shared<const LightState>(shading_.freeze(), materials_.freeze(), lightScopes_.freeze(),
                                                     placed_.freeze(), anyTransmits(), clearSlots(), layers_,
                                                     volumeSlots(), emitterTable_, skyTable_);
    return latest_;
}

void LightTables::followLayers(const Scene& scene, const ChangeSet& changes) {
    if (changes.isSnapshot()) layerSets_.clear();
    for (const Change& change : changes.changes)
        if (change.kind == ChangeKind::createNode && change.index == x3d::LayerSet::type.value)
            layerSets_.insert(change.node.value);
    if (layerSets_.empty() && !layers_) return;
    std::erase_if(layerSets_, [&](std::uint32_t id) { return !scene.find(NodeId{id}); });
    std::shared_ptr<const LayerList> now = readLayers(scene);
    if (now ? layers_ && *now == *layers_ : !layers_) return;
    layers_ = std::move(now);
    latest_.reset();
}

std::array<float, 4> trace::clipBoundaryOf(const Node& viewport) {
    std::array<float, 4> result{0, 1, 0, 1};
    const Array<float>& clip = viewport.get(x3d::Viewport::clipBoundary);
    for (std::size_t i = 0; i < 4 && clip.size() >= 4; ++i)
        result[i] = std::isfinite(clip[i]) ? std::clamp(clip[i], 0.0f, 1.0f) : 0;
    return result;
}

std::shared_ptr<const LayerList> LightTables::readLayers(const Scene& scene) const {
    using S = x3d::LayerSet;
    // 35.4.2: there is one LayerSet, at the root. If there are several, the first counts.
    const Node* set = nullptr;
    for (const std::uint32_t id : layerSets_)
        if (!set && !scene.parents(NodeId{id}).empty()) set = scene.find(NodeId{id});
    if (!set) return nullptr;
    auto list = std::make_shared<LayerList>();
    const Array<NodeId>& layers = set->get(S::layers);
    const auto exists = [&](std::int32_t i) {
        return i >= 0 && static_cast<std::size_t>(i) <= std::min<std::size_t>(layers.size(), 0xFFFE);
    };
    for (const std::int32_t number : set->get(S::order)) {
        if (!exists(number)) continue;
        LayerList::Layer layer{static_cast<std::uint16_t>(number)};
        const Node* node = number > 0 ? scene.effectiveNode(layers[static_cast<std::size_t>(number) - 1]) : nullptr;
        NodeId viewport;
        if (node && node->is(x3d::Layer::type)) viewport = node->get(x3d::Layer::viewport);
        if (node && node->is(x3d::LayoutLayer::type)) {
            viewport = node->get(x3d::LayoutLayer::viewport);
            layer.laidOut = true;
        }
        if (const Node* view = scene.effectiveNode(viewport); view && view->is(x3d::Viewport::type))
            layer.clip = clipBoundaryOf(*view);
        list->order.push_back(layer);
    }
    if (exists(set->get(S::activeLayer))) list->active = static_cast<std::uint16_t>(set->get(S::activeLayer));
    return list;
}

// ---- materials -------------------------------------------------------------------------------------------------

std::uint32_t LightTables::takeMaterial(const Scene& scene, NodeId appearance) {
    if (!appearance) return 0;
    const auto [found, isNew] = materialOf_.try_emplace(appearance.value, 0u);
    if (isNew) {
        if (freeMaterials_.empty()) {
            found->second = static_cast<std::uint32_t>(uses_.size());
            uses_.emplace_back();
            materials_.resize(uses_.size());
        } else {
            found->second = freeMaterials_.back();
            freeMaterials_.pop_back();
        }
        uses_[found->second].appearance = appearance;
        loadMaterial(scene, found->second);
    }
    ++uses_[found->second].users;
    return found->second;
}

void LightTables::loadMaterial(const Scene& scene, std::uint32_t index) {
    auto entry = std::make_shared<MaterialEntry>();
    if (const Node* node = scene.find(uses_[index].appearance); node && node->type().isA("X3DVolumeDataNode")) {
        const MaterialEntry* before = materials_[index].get();
        entry->volume = readVolume(scene, *node, *textures_, before ? before->volume.get() : nullptr, diagnostics_);
        entry->material = Material();
        volumes_.insert(index);
    } else {
        entry->material = readMaterial(scene, uses_[index].appearance, *textures_, diagnostics_);
    }
    entry->finish();
    uses_[index].isMapped =
        std::ranges::any_of(entry->material.textures, [](const TextureUse& use) { return !use.mapping.empty(); });
    std::shared_ptr<const MaterialEntry>& record = materials_.change(index);
    if (entry->transmits)
        transmitting_.insert(index);
    else
        transmitting_.erase(index);
    record = std::move(entry);
    ++counts_.materialsRead;
    counts_.materials = materialOf_.size();
}

void LightTables::dropMaterial(std::uint32_t index) {
    if (index == 0 || --uses_[index].users > 0) return;
    materialOf_.erase(uses_[index].appearance.value);
    uses_[index] = Use();
    std::shared_ptr<const MaterialEntry>& record = materials_.change(index);
    transmitting_.erase(index);
    volumes_.erase(index);
    record.reset();
    freeMaterials_.push_back(index);
    counts_.materials = materialOf_.size();
}

// ---- instances -------------------------------------------------------------------------------------------------

void LightTables::bind(const Scene& scene, const Instance& instance) {
    const std::uint32_t at = instance.id.slot;
    if (at >= slots_.size()) {
        slots_.resize(at + 1);
        shading_.resize(at + 1);
    }
    Slot& slot = slots_[at];
    const std::uint32_t lights = scopeNumber(instance.scope);
    const auto isAsBefore = [&] {
        const SlotShading& now = shading_[at];
        return slot.used && slot.geometry == instance.geometry && now.lights == lights &&
               uses_[now.material].appearance == instance.appearance;
    };
    if (isAsBefore()) return;  // something that is none of light's business
    const std::uint32_t material = takeMaterial(scene, instance.appearance);
    release(at);
    slot.used = true;
    slot.geometry = instance.geometry;
    if (material != 0) {
        slot.next = std::exchange(uses_[material].first, at);
        if (slot.next != kNone) slots_[slot.next].previous = at;
    }
    SlotShading& shading = shading_.change(at);
    shading.material = material;
    shading.lights = lights;
    shading.channels = {};
    reportOfTextures(scene, slot.geometry, materials_[material]->material, diagnostics_);
    if (!uses_[material].isMapped) return;
    setMapped(at, true);
    findChannels(at);
}

void LightTables::release(std::uint32_t at) {
    if (at >= slots_.size() || !slots_[at].used) return;
    Slot& slot = slots_[at];
    const std::uint32_t material = shading_[at].material;
    setMapped(at, false);
    if (material != 0) {
        (slot.previous == kNone ? uses_[material].first : slots_[slot.previous].next) = slot.next;
        if (slot.next != kNone) slots_[slot.next].previous = slot.previous;
    }
    slot = Slot();
    shading_.change(at) = SlotShading();
    dropMaterial(material);
}

void LightTables::setMapped(std::uint32_t at, bool mapped) {
    Slot& slot = slots_[at];
    if (mapped == (slot.mapped != kNone)) return;
    const auto found = mappedSlotsOf_.try_emplace(slot.geometry.value).first;
    std::vector<std::uint32_t>& all = found->second;
    if (mapped) {
        slot.mapped = static_cast<std::uint32_t>(all.size());
        all.push_back(at);
        return;
    }
    slots_[all.back()].mapped = slot.mapped;
    all[slot.mapped] = all.back();
    all.pop_back();
    slot.mapped = kNone;
    if (all.empty()) mappedSlotsOf_.erase(found);
}

std::array<std::uint8_t, kTextureRoles> trace::channelsOf(const Material& material, const Mesh* mesh) {
    std::array<std::uint8_t, kTextureRoles> channels{};
    for (std::size_t role = 0; role < kTextureRoles && mesh; ++role) {
        const String& mapping = material.textures[role].mapping;
        if (mapping.empty()) continue;
        for (std::size_t c = 0; c < mesh->texCoords.size() && c < 256; ++c)
            if (mesh->texCoords[c].mapping == mapping) {
                channels[role] = static_cast<std::uint8_t>(c);
                break;
            }
    }
    return channels;
}

void LightTables::findChannels(std::uint32_t slot) {
    lookedUp_.push_back(slot);
    const auto mesh = namedMeshes_.find(slots_[slot].geometry.value);
    const auto channels = channelsOf(materials_[shading_[slot].material]->material,
                                     mesh != namedMeshes_.end() ? mesh->second.get() : nullptr);
    if (shading_[slot].channels != channels) shading_.change(slot).channels = channels;
}

void LightTables::reportOfMappings(const Scene& scene) {
    for (const std::uint32_t at : lookedUp_) {
        const Slot& slot = slots_[at];
        const Node* geometry = slot.used ? scene.effectiveNode(slot.geometry) : nullptr;
        if (slot.mapped == kNone || !geometry) continue;
        const NodeId appearance = uses_[shading_[at].material].appearance;
        const auto mesh = namedMeshes_.find(slot.geometry.value);
        for (const TextureUse& use : materials_[shading_[at].material]->material.textures) {
            const auto isIt = [&](const TexCoords& coords) { return coords.mapping == use.mapping; };
            if (use.mapping.empty() || use.namesTransform) continue;
            if (mesh != namedMeshes_.end() && std::ranges::any_of(mesh->second->texCoords, isIt)) continue;
            const Node* node = scene.effectiveNode(appearance);
            const Node* material = node && node->is(x3d::Appearance::type)
                                       ? scene.effectiveNode(node->get(x3d::Appearance::material))
                                       : nullptr;
            if (!material) continue;
            const auto named = [&](const Node& of) {
                const std::string_view name = scene.name(of.id());
                return fmt::format("{}{}{}", of.type().name, name.empty() ? "" : " ", name);
            };
            diagnostics_.warningAt(scene.locationOf(material->id()),
                                   fmt::format("{}: {} has no texture coordinates of the mapping \"{}\": the texture "
                                               "is shown by its first ones",
                                               named(*material), named(*geometry), use.mapping.view()));
        }
    }
    lookedUp_.clear();
}

void LightTables::followGeometries(const InstanceDelta& delta) {
    for (const InstanceDelta::Geometry& geometry : delta.geometries) {
        if (geometry.mesh && geometry.mesh->colors.present() && geometry.mesh->colors.components() == 4)
            alphaColored_.insert(geometry.node.value);
        else
            alphaColored_.erase(geometry.node.value);
        // Only meshes whose coordinates have names can matter to findChannels.
        const bool named = geometry.mesh && std::ranges::any_of(geometry.mesh->texCoords,
                                                                [](const TexCoords& t) { return !t.mapping.empty(); });
        if (named)
            namedMeshes_[geometry.node.value] = geometry.mesh;
        else if (namedMeshes_.erase(geometry.node.value) == 0)
            continue;
        if (const auto mapped = mappedSlotsOf_.find(geometry.node.value); mapped != mappedSlotsOf_.end())
            for (const std::uint32_t slot : mapped->second) findChannels(slot);
    }
}

void LightTables::followMaterials(const Scene& scene, const InstanceDelta& delta) {
    for (const NodeId appearance : delta.appearanceChanged) {
        const auto found = materialOf_.find(appearance.value);
        if (found == materialOf_.end()) continue;
        const Use& use = uses_[found->second];
        const bool was = use.isMapped, wasTextured = materials_[found->second]->material.textured();
        loadMaterial(scene, found->second);
        if (const Material& now = materials_[found->second]->material; !wasTextured && now.textured())
            for (std::uint32_t slot = use.first; slot != kNone; slot = slots_[slot].next)
                reportOfTextures(scene, slots_[slot].geometry, now, diagnostics_);
        if (!was && !use.isMapped) continue;
        for (std::uint32_t slot = use.first; slot != kNone; slot = slots_[slot].next) {
            setMapped(slot, use.isMapped);
            findChannels(slot);
        }
    }
}

// ---- lights and the other placed things ------------------------------------------------------------------------

std::uint32_t LightTables::scopeNumber(ScopeId scope) {
    const auto [found, isNew] = numberOf_.try_emplace(scope.value, static_cast<std::uint32_t>(scopes_.size()));
    if (isNew) {
        scopes_.emplace_back();
        lightScopes_.resize(scopes_.size());
    }
    return found->second;
}

void LightTables::noteLight(ScopeId scope, std::uint32_t placed) {
    const std::uint32_t number = scopeNumber(scope);
    if (scopes_[number].changed.empty()) dirtyScopes_.push_back(number);
    scopes_[number].changed.push_back(placed);
}

bool LightTables::shinesIn(std::uint32_t number, std::uint32_t placed) {
    const PlacedEntry* entry = placed_[placed].get();
    const Light* light = entry ? std::get_if<Light>(&entry->what) : nullptr;
    return light && light->on && scopeNumber(light->scope) == number;
}

void LightTables::followLights() {
    constexpr std::size_t kFew = 16;  // beyond, the list is sorted anew
    for (const std::uint32_t number : dirtyScopes_) {
        auto& [lights, changed] = scopes_[number];
        if (changed.size() > kFew) {
            lights.insert(lights.end(), changed.begin(), changed.end());
            std::ranges::sort(lights);
            lights.erase(std::ranges::unique(lights).begin(), lights.end());
            std::erase_if(lights, [&](std::uint32_t placed) { return !shinesIn(number, placed); });
        } else {
            for (const std::uint32_t placed : changed) {
                const auto at = std::ranges::lower_bound(lights, placed);
                const bool is = at != lights.end() && *at == placed, shines = shinesIn(number, placed);
                if (shines && !is) lights.insert(at, placed);
                if (!shines && is) lights.erase(at);
            }
        }
        changed.clear();
        const auto& before = lightScopes_[number].lights;
        if (before ? *before == lights : lights.empty()) continue;
        lightScopes_.change(number).lights =
            lights.empty() ? nullptr : std::make_shared<const std::vector<std::uint32_t>>(lights);
    }
    dirtyScopes_.clear();
}

void LightTables::setPlaced(std::uint32_t slot, std::shared_ptr<const PlacedEntry> entry) {
    if (slot >= placed_.size()) placed_.resize(slot + 1);
    std::shared_ptr<const PlacedEntry>& record = placed_.change(slot);
    const auto lightOf = [](const PlacedEntry* e) { return e ? std::get_if<Light>(&e->what) : nullptr; };
    const Light* before = lightOf(record.get());
    const Light* now = lightOf(entry.get());
    if (!before || !now || before->on != now->on || before->scope != now->scope) {
        if (before) noteLight(before->scope, slot);
        if (now) noteLight(now->scope, slot);
    }
    counts_.lights += now != nullptr;
    counts_.lights -= before != nullptr;
    record = std::move(entry);
}

void LightTables::unplace(std::uint32_t slot) {
    if (slot >= placed_.size() || !placed_[slot]) return;
    const auto [first, last] = placedOf_.equal_range(placed_[slot]->placed.node.value);
    for (auto i = first; i != last; ++i)
        if (i->second == slot) {
            placedOf_.erase(i);
            break;
        }
    setPlaced(slot, nullptr);
}

void LightTables::putPlaced(const Scene& scene, const Placed& what) {
    unplace(what.id.slot);
    placedOf_.emplace(what.node.value, what.id.slot);
    setPlaced(what.id.slot, readPlaced(scene, what));
}

void LightTables::followPlaced(const Scene& scene, const InstanceDelta& delta) {
    for (const InstanceId& id : delta.placedRemoved) unplace(id.slot);
    for (const Placed& added : delta.placedAdded) putPlaced(scene, added);
    for (const Placed& rebound : delta.placedRebound) putPlaced(scene, rebound);
    for (const InstanceDelta::Moved& moved : delta.placedMoved) {
        if (moved.id.slot >= placed_.size() || !placed_[moved.id.slot]) continue;
        Placed placed = placed_[moved.id.slot]->placed;
        placed.worldFromLocal = moved.worldFromLocal;
        setPlaced(moved.id.slot, readPlaced(scene, placed));
    }
    for (const NodeId node : delta.placedChanged) {
        const auto [first, last] = placedOf_.equal_range(node.value);
        for (auto i = first; i != last; ++i) setPlaced(i->second, readPlaced(scene, placed_[i->second]->placed));
    }
}

}  // namespace rtsg
