// LightTables: the data of a scene that lighting needs besides rays: materials, lights, and viewpoints.
//
// Invariant: after apply() they equal tables that are built anew. The work depends on the delta: switching a light
// touches the list of its own scope only; whoever makes a picture finds the lists that reach an instance along the
// scopes around it.
// Versions: a picture reads paged arrays, of which a version costs four pointers; materials and placed things are
// replaced, never changed. Threading: the scene's thread; a LightState from any.
// Source: ISO/IEC 19775-1 V4.0 17.2.2 (scope of lights), 7.2.2 (bindable nodes).
#pragma once

#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <variant>
#include <vector>

#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/paged_array.h>
#include <rtsg/renderers/render_settings.h>

#include "lighting/trace_scene.h"
#include "mesh/report_once.h"
#include "texture/texture_store.h"

namespace rtsg {

class SharedWorld;

namespace trace {

class EmitterTable;
class SkyTable;

/// How a bindable node stands (7.2.2). Nothing is bound before a scene's first frame: then the first one counts that
/// would be, which no node of an Inline is.
enum class Binding : std::uint8_t { bound, first, inlined, unbound };

struct Navigation {
    bool headlight = true;
    Binding binding = Binding::first;
    float visibilityLimit = 0;
};
/// A Viewpoint, OrthoViewpoint or GeoViewpoint, in its own frame.
struct View {
    Vec3d position{0, 0, 10};
    Rotation orientation;
    double fieldOfView = 0.7854;
    std::array<double, 4> extent{-1, -1, 1, 1};
    bool orthographic = false, viewAll = false;
    Binding binding = Binding::first;
    float nearDistance = -1, farDistance = -1;
    std::string name, description;
    std::optional<Navigation> navigation;  // that it brings (23.3.1)
};
struct SkyEntry {
    Sky sky;
    Binding binding = Binding::first;
};
struct FogEntry {
    Fog fog;
    Binding binding = Binding::first;
};
/// The fog of the things in its scope, in place of a Fog and of fogs around it (24.4.4).
struct LocalFogEntry {
    Fog fog;
    std::uint32_t scope = 0;  // its number
};
/// Cuts off the parts of everything in its scope that lie on the wrong side of any of its planes; and the parts of an
/// eye's view outside a window, as in clipBoundaryOf().
struct ClipEntry {
    std::vector<CutPlane> planes;
    std::optional<std::array<float, 4>> window;
    std::uint32_t scope = 0;  // its number
    bool capped = false;      // where RenderSettings::caps says so: a ClipPlane, not a viewport
};
/// Left, right, bottom and top of a Viewport, as shares of the area that it divides.
std::array<float, 4> clipBoundaryOf(const Node& viewport);
struct PlacedEntry {
    Placed placed;
    std::variant<std::monostate, Light, View, SkyEntry, FogEntry, Navigation, ClipEntry, LocalFogEntry> what;
};

/// A place that holds local lights, by a number of its own; 0 is the whole scene, whose lights are the global ones.
struct LightScope {
    std::uint32_t around = 0;                                  // the next one outwards
    std::shared_ptr<const std::vector<std::uint32_t>> lights;  // that are on, as placed slots, in order; null: none
};

/// Which of a mesh's texture coordinates each texture of a material uses, by their names; without a mesh the first.
std::array<std::uint8_t, kTextureRoles> channelsOf(const Material& material, const Mesh* mesh);

/// A LayerSet (35.4.2): the order of drawing.
struct LayerList {
    struct Layer {
        std::uint16_t number = 0;               // as Instance::layer
        std::array<float, 4> clip{0, 1, 0, 1};  // left, right, bottom, top of its viewport, as shares of the picture
        bool laidOut = false;                   // a LayoutLayer: no viewpoint's eye but an implicit one (36.2)
        friend bool operator==(const Layer&, const Layer&) = default;
    };
    std::vector<Layer> order;  // from the back to the front
    std::uint16_t active = 0;  // whose viewpoint a picture's is
    friend bool operator==(const LayerList&, const LayerList&) = default;
};

}  // namespace trace

/// One version.
struct LightState {
    PagedArray<trace::SlotShading, trace::kSlotBits> slots;
    PagedArray<std::shared_ptr<const trace::MaterialEntry>> materials;  // [0]: without an Appearance
    PagedArray<trace::LightScope> scopes;
    PagedArray<std::shared_ptr<const trace::PlacedEntry>> placed;  // null: a hole
    bool anyTransmits = false;                                     // some material or mesh lets light through
    /// The slots of all that does, where these are few enough to be listed; null: they are not.
    std::shared_ptr<const std::vector<std::uint32_t>> clearSlots;
    static constexpr std::size_t kMaxClear = 256;
    std::shared_ptr<const trace::LayerList> layers;                 // null: all is in one
    std::shared_ptr<const std::vector<std::uint32_t>> volumeSlots;  // null: there are none
    std::shared_ptr<trace::EmitterTable> emitterTable;              // of all versions; may be null
    std::shared_ptr<trace::SkyTable> skyTable;                      // the same
};

/// The textures of a world under one policy, shared by all who have the same policy.
std::shared_ptr<TextureStore> sharedTextures(SharedWorld& world, const Resources& resources);

class LightTables {
  public:
    explicit LightTables(std::shared_ptr<TextureStore> textures);

    void apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta);

    /// For reading at once.
    LightState now() const;
    /// The same one until something changes that it holds.
    std::shared_ptr<const LightState> latest();

    const LightCounts& counts() const { return counts_; }
    const Diagnostics& diagnostics() const { return said_; }
    void reportOfDamage();

  private:
    static constexpr std::uint32_t kNone = 0xFFFFFFFF;
    /// A slot, and its neighbours among those of the same material.
    struct Slot {
        NodeId geometry;
        std::uint32_t next = kNone, previous = kNone;
        std::uint32_t mapped = kNone;  // its place in mappedSlotsOf_
        bool used = false;
    };
    struct Use {  // of a material
        NodeId appearance;
        std::uint32_t users = 0, first = kNone;
        bool isMapped = false;  // a texture asks for coordinates by name
    };
    struct Scope {
        std::vector<std::uint32_t> lights;   // as in LightScope
        std::vector<std::uint32_t> changed;  // placed slots that come or go, maybe, in this apply()
    };

    // light_tables.cpp
    void followGeometries(const InstanceDelta& delta);
    void followMaterials(const Scene& scene, const InstanceDelta& delta);
    void followPlaced(const Scene& scene, const InstanceDelta& delta);
    std::uint32_t takeMaterial(const Scene& scene, NodeId appearance);
    void loadMaterial(const Scene& scene, std::uint32_t index);
    void dropMaterial(std::uint32_t index);
    void bind(const Scene& scene, const Instance& instance);
    void release(std::uint32_t slot);
    void findChannels(std::uint32_t slot);
    /// Reports those in lookedUp_ whose textures ask for coordinates that their geometry does not have.
    void reportOfMappings(const Scene& scene);
    void setMapped(std::uint32_t slot, bool mapped);
    std::uint32_t scopeNumber(ScopeId scope);
    /// A light of this scope comes or goes.
    void noteLight(ScopeId scope, std::uint32_t placed);
    bool shinesIn(std::uint32_t scopeNumber, std::uint32_t placed);
    void followLights();
    void putPlaced(const Scene& scene, const Placed& what);
    void unplace(std::uint32_t slot);
    void setPlaced(std::uint32_t slot, std::shared_ptr<const trace::PlacedEntry> entry);

    void followLayers(const Scene& scene, const ChangeSet& changes);
    std::shared_ptr<const trace::LayerList> readLayers(const Scene& scene) const;

    // light_placed.cpp: what is read of lights, viewpoints, backgrounds ...
    std::shared_ptr<const trace::PlacedEntry> readPlaced(const Scene& scene, const Placed& placed);
    trace::SkyEntry readSky(const Scene& scene, const Node& node, const WorldFromLocal& worldFromLocal);
    /// One for all lights that describe the same.
    std::shared_ptr<const trace::Environment> environmentOf(const Scene& scene, const Node& node);
    /// With the picture of a projector, and the environment of an EnvironmentLight.
    Light readLights(const Scene& scene, const Node& node, const Placed& placed);

    std::shared_ptr<TextureStore> textures_;
    std::shared_ptr<trace::EmitterTable> emitterTable_;
    std::shared_ptr<trace::SkyTable> skyTable_;
    Diagnostics diagnostics_;  // of this apply() so far
    Diagnostics said_;         // since the start, each once
    ReportOnce reported_;
    LightCounts counts_;

    PagedArrayWriter<trace::SlotShading, trace::kSlotBits> shading_;
    PagedArrayWriter<std::shared_ptr<const trace::MaterialEntry>> materials_;
    PagedArrayWriter<trace::LightScope> lightScopes_;
    PagedArrayWriter<std::shared_ptr<const trace::PlacedEntry>> placed_;
    std::unordered_set<std::uint32_t> transmitting_;  // materials that let light through
    std::unordered_set<std::uint32_t> volumes_;       // materials that are volumes
    bool anyTransmits() const { return !transmitting_.empty() || !alphaColored_.empty(); }
    std::shared_ptr<const std::vector<std::uint32_t>> clearSlots() const;
    std::shared_ptr<const std::vector<std::uint32_t>> volumeSlots() const;
    std::shared_ptr<const LightState> latest_;
    std::vector<std::weak_ptr<const trace::Environment>> environments_;  // that there are
    std::set<std::uint32_t> layerSets_;                                  // node numbers
    std::shared_ptr<const trace::LayerList> layers_;

    std::vector<std::uint32_t> lookedUp_;  // slots that findChannels() looked at in this apply()
    std::vector<Slot> slots_;
    std::vector<Use> uses_;  // by material
    std::vector<std::uint32_t> freeMaterials_;
    std::unordered_map<std::uint32_t, std::uint32_t> materialOf_;                 // appearance -> index
    std::unordered_map<std::uint32_t, std::shared_ptr<const Mesh>> namedMeshes_;  // geometry -> with named coordinates
    std::unordered_set<std::uint32_t> alphaColored_;  // geometries whose vertex colours may let light through
    std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> mappedSlotsOf_;  // geometry -> with a mapped material
    std::unordered_multimap<std::uint32_t, std::uint32_t> placedOf_;               // node -> slots
    std::vector<Scope> scopes_;                                                    // by number
    std::unordered_map<std::uint32_t, std::uint32_t> numberOf_;                    // scope -> number
    std::vector<std::uint32_t> dirtyScopes_;
};

}  // namespace rtsg
