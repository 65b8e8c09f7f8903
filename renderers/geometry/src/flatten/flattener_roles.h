// The role of a node type in the hierarchy: which of its children count, whether it has a transform, what it places.
//
// It is found once per type from the @role that node tables give it, so that PROTOs and users' own types work alike.
// Source: ISO/IEC 19775-1 V4.0 10.4.4 (Transform's matrix), 10.4.3, 23.4.3, 26 (HAnim), 32 (CAD), 35 (layers).
#pragma once

#include <array>
#include <memory>
#include <string_view>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/renderers/flattener.h>

namespace rtsg::flatten {

enum class Role : std::uint8_t {
    none,    // no place in the hierarchy
    all,     // a group
    first,   // a PROTO instance: only the first node of its body is rendered (4.4.4.2)
    choice,  // Switch
    level,   // LOD
    layers,  // LayerSet
    shape,
    placed,  // light, viewpoint, sound ...
};

struct TypeRole {
    Role role = Role::none;
    PlacedKind kind = PlacedKind::light;
    bool hasTransform = false;
    bool geographic = false;   // which is by geographic coordinates: geoTransform()
    bool facesViewer = false;  // its transform follows the picture: Billboard (`axis`), layouts (`layout`), ScreenGroup
    bool isParticles = false;  // a shape that is its own geometry
    bool isVolume = false;     // a shape that is its own geometry and appearance
    bool ownsGeometry() const { return isParticles || isVolume; }
    bool ofHumanoid = false;  // its content may move a skin: a humanoid, joint, segment or displacer
    std::uint8_t childFields = 0;
    std::array<FieldIndex, 3> children{kNoField, kNoField, kNoField};
    FieldIndex visible = kNoField, global = kNoField, choice = kNoField, range = kNoField, order = kNoField;
    FieldIndex translation = kNoField, rotation = kNoField, scale = kNoField, scaleOrientation = kNoField,
               center = kNoField, axis = kNoField, layout = kNoField, viewport = kNoField, proxy = kNoField;
    FieldIndex geometry = kNoField, appearance = kNoField, castShadow = kNoField;
    FieldIndex bboxDisplay = kNoField, bboxCenter = kNoField, bboxSize = kNoField;  // of nodes that can show their box

    bool isChildField(FieldIndex field) const {
        return field == children[0] || field == children[1] || field == children[2];
    }
};

/// Calls `f` with the name of every type, concrete or abstract, whose nodes have others below them in the hierarchy.
void forEachGroupType(const auto& f) {
    for (const std::string_view type : builtinGroupTypes()) f(type);
    f(std::string_view("X3DPrototypeInstance"));
}

class RoleTable {
  public:
    /// Stays where it is, whatever other types are asked for, until clear().
    const TypeRole& of(const Node& node) {
        const std::size_t index = node.typeIndex().value;
        if (index >= roles_.size()) roles_.resize(index + 1);
        if (!roles_[index]) roles_[index] = std::make_unique<const TypeRole>(work(node.type()));
        return *roles_[index];
    }
    void clear() { roles_.clear(); }

  private:
    static TypeRole work(const NodeType& type);
    std::vector<std::unique_ptr<const TypeRole>> roles_;
};

template <class T>
const T& read(const Node& node, FieldIndex field) {
    return node.get(Field<T>{field});
}

/// T C R SR S -SR -C. A rotation whose axis has no length counts as none. False when it is the identity, and where a
/// geographic one has an error.
bool localTransform(const Scene& scene, const Node& node, const TypeRole& role, WorldFromLocal& parentFromLocal);

/// A translation alone.
inline WorldFromLocal movedBy(const Vec3d& by) {
    WorldFromLocal m = identityTransform();
    m[3] = by;
    return m;
}

/// Billboard: how it turns, so that its z axis points to `viewer`; the identity without one.
bool rotateTowards(const Node& node, const TypeRole& role, const WorldFromLocal& worldFromParent,
                   const EyePosition* viewer, WorldFromLocal& parentFromLocal);

/// Appends the nodes below it that count, those without a role included.
void desiredChildren(const Node& node, const TypeRole& role, std::uint32_t level, std::vector<NodeId>& out);

/// A Collision's proxy (23.4.2), which avatars meet in place of the children and nothing else meets; none if it has
/// none, or if that is one of the children too: then it is seen there.
NodeId proxyOf(const Node& node, const TypeRole& role);

/// Follows PROTO instances to the node that stands for them; `id` itself if it is none. None for an empty body.
NodeId resolve(const Scene& scene, RoleTable& roles, NodeId id);

/// The geometry node of a shape; a ParticleSystem stands for its own, which is made of its particles, and a volume for
/// its own, which is the box around it.
NodeId geometryOf(const Scene& scene, RoleTable& roles, const Node& shape);
/// The appearance with which a shape is drawn; for a volume, the volume itself.
NodeId appearanceOf(const Scene& scene, RoleTable& roles, const Node& shape);

/// How an Appearance draws lines and points; null for the default, and for none.
std::shared_ptr<const StrokeStyle> strokeStyle(const Scene& scene, NodeId appearance);
/// Whether a node of this type is part of that.
bool isOfStrokeStyle(const Node& node);

/// Whether a node is a material whose transparency says that it shows nothing.
bool isClear(const Node& material);
/// Whether a shape with this geometry and appearance is invisible: its inside is neither filled nor hatched, or its
/// material isClear(), and nothing replaces that: colours with an alpha of their own, several textures, another back,
/// hatches, an alphaMode, a MetadataSet. Never true for geometry of a user's own type, which may colour it at will.
bool showsNothing(const Scene& scene, NodeId geometry, NodeId appearance);

/// LOD: the level for a viewer at `viewer` (world); 0 without one.
std::uint32_t chooseLevel(const Node& node, const TypeRole& role, const WorldFromLocal& worldFromLocal,
                          const std::optional<EyePosition>& viewer);

}  // namespace rtsg::flatten
