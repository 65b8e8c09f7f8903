// NodeType: one row of the spec table: name, component, level and fields with type, access, default, range and aspect.
// Built-in types come from core/spec/*.x3dspec through the table compiler; types of PROTOs, Scripts and users are made
// at run time and have the same form.
//
// Invariant: a NodeType never changes once a scene knows it. Field indices are stable within a type.
// Source: ISO/IEC 19775-1 V4.0, node tables of clauses 7-43, access rules 4.4.2.2. Threading: constant data.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/custom_field.h>
#include <rtsg/core/value.h>

namespace rtsg {

enum class Access : std::uint8_t { initializeOnly, inputOnly, outputOnly, inputOutput };

/// What a field means to subscribers.
enum class Aspect : std::uint8_t { none, structure, transform, geometry, appearance, light, view, sound, time };

/// The unit of a field of a built-in type: the tables' @unit. A rotation's angle is in radians whatever this says.
enum class Unit : std::uint8_t { none, length, angle, mass, force, speed, angularRate, acceleration, area, torque };

using FieldIndex = std::uint16_t;
constexpr FieldIndex kNoField = 0xFFFF;

/// Whether a node acts by itself, as far as its type tells: the tables' @acts.
enum class Acts : std::uint8_t {
    unstated,  // of PROTOs and Scripts; finish() works it out for types of users that no table describes
    never,
    onInput,  // its outputs change only when an input does
    always,   // it may change at any time
};

/// Index into Scene's types: built-in types first (same numbers in every scene of one build), then the scene's own.
struct TypeIndex {
    std::uint16_t value = 0xFFFF;
    friend bool operator==(const TypeIndex&, const TypeIndex&) = default;
};

struct FieldDef {
    std::string name;
    FieldType type = FieldType::SFBool;
    Access access = Access::inputOutput;
    Aspect aspect = Aspect::none;
    Value defaultValue;
    /// Bounds of every component of every element: inclusive unless exclusive*, infinite if there is none. They are
    /// advice for validation, never enforced on set; see inRange().
    double min = -std::numeric_limits<double>::infinity();
    double max = std::numeric_limits<double>::infinity();
    bool exclusiveMin = false, exclusiveMax = false;
    /// Allowed strings of an enumerated SFString (empty: any). Advice for validation, never enforced on set.
    std::vector<std::string> allowed;
    /// Node or abstract types that an SFNode/MFNode accepts (empty: any).
    std::vector<std::string> accepts;
    /// Not in the standard: invisible to files but part of the state, such as the `body` of a PROTO instance.
    bool hidden = false;
    Unit unit = Unit::none;
    /// The version of X3D that introduced the field, as in NodeType::since; never less than that of its node.
    std::uint8_t since = 0;
    /// The custom type, if `type` is SFCustom or MFCustom; else null.
    std::shared_ptr<const CustomType> custom;
    /// Byte offset in the node's block; kNoOffset for inputOnly fields, which have no storage.
    static constexpr std::uint32_t kNoOffset = 0xFFFFFFFF;
    std::uint32_t offset = kNoOffset;

    bool readable() const { return access != Access::inputOnly; }
    bool writable() const { return access == Access::inputOnly || access == Access::inputOutput; }
    bool sends() const { return access == Access::outputOnly || access == Access::inputOutput; }
    bool bounded() const {
        return min > -std::numeric_limits<double>::infinity() || max < std::numeric_limits<double>::infinity();
    }
    /// Whether the value has the type of this field.
    bool holds(const Value& value) const { return isOfType(value, type, custom.get()); }
    std::string typeName() const { return fieldTypeName(type, custom.get()); }
    /// Whether every number of a value of this type is in range. Bounds that are multiples of pi also accept their
    /// decimal form in files (1.571 in [0, pi/2]). NaN is out of any range.
    bool inRange(const Value& value) const;
};

/// The place and the representation of a field, so small that all fields of a type share a cache line or two.
struct FieldSlot {
    std::uint32_t offset = FieldDef::kNoOffset;
    FieldType type = FieldType::SFBool;
    std::uint8_t size = 0;  // bytes in the block
    Aspect aspect = Aspect::none;
    /// Plain bytes, at most 16, no node, and authors may give it a value: it can be written without further checks.
    bool plain = false;
};
static_assert(sizeof(FieldSlot) == 8);

class NodeType {
  public:
    enum class Kind : std::uint8_t { builtin, user, proto, externProto, script };

    std::string name;
    std::string component;
    int level = 1;
    Kind kind = Kind::builtin;
    std::string containerField = "children";  // XML default, ISO/IEC 19776-1
    std::vector<std::string> implements;      // every abstract type, direct or inherited ("X3DChildNode", ...)
    std::vector<FieldDef> fields;             // hidden ones last
    bool internal = false;                    // not creatable from files (RtsgScene)
    /// Ten times the first version of X3D that has the type, as the tables' @since says; 20 is VRML97.
    std::uint8_t since = 0;
    Acts acts = Acts::unstated;
    bool writesInputs = false;      // when it acts, its inputOutput fields may change too, not only its outputs
    std::string role;               // the tables' @role for renderers of pictures and sound; empty if it has none
    std::vector<FieldIndex> below;  // for the role: fields whose nodes hang below it in the hierarchy
    /// For PROTOs and EXTERNPROTOs: the declaration as ClassicVRML text, so that a replica can save it.
    std::string declaration;

    /// Computes offsets, the default block and, for a user's type without @acts, what its abstract types say. Call it
    /// once, after the fields are complete. It returns false, and the type is unusable, if two public or two hidden
    /// fields share a name, if there are more fields than a FieldIndex can count, or if a custom field does not name
    /// its type.
    [[nodiscard]] bool finish();

    /// Finds `name`, or an inputOutput field by `set_name` or `name_changed` (4.4.2.2); kNoField if absent or hidden.
    FieldIndex find(std::string_view name) const;
    /// Exact name only, hidden fields included; a public field wins over a hidden one of the same name.
    FieldIndex findExact(std::string_view name) const;
    bool isA(std::string_view typeOrAbstract) const;
    /// The hidden `body` of a PROTO instance or an Inline; kNoField if the type has none. Do not look it up by name: an
    /// author's field may have the same name.
    FieldIndex body() const;

    std::size_t fieldCount() const { return slots_.size(); }
    const FieldSlot& slot(FieldIndex field) const { return slots_[field]; }
    std::size_t blockSize() const { return blockSize_; }
    /// `blockSize()` bytes; shared values inside are owned by the type.
    const std::byte* defaults() const { return defaults_.data(); }
    /// Fields stored as shared pointers, which construction and destruction must visit.
    std::span<const FieldIndex> sharedFields() const { return sharedFields_; }
    /// Fields of type SFNode or MFNode.
    std::span<const FieldIndex> nodeFields() const { return nodeFields_; }

    NodeType() = default;
    NodeType(const NodeType&) = delete;
    NodeType& operator=(const NodeType&) = delete;
    ~NodeType();

  private:
    void takeTags();

    std::size_t blockSize_ = 0;
    std::vector<FieldSlot> slots_;
    std::vector<std::byte> defaults_;
    std::vector<FieldIndex> sharedFields_, nodeFields_;
    std::vector<std::pair<std::string_view, FieldIndex>> byName_;  // sorted; public before hidden
};

/// Typed handle of a field, generated per built-in type: `x3d::Transform::translation`.
template <class T>
struct Field {
    FieldIndex index;
};

/// Every built-in type, in TypeIndex order. Built on first use, immutable afterwards.
std::span<const std::unique_ptr<NodeType>> builtinTypes();
const NodeType* findBuiltinType(std::string_view name);
/// The abstract types' names, for `isA` and validation.
bool isAbstractType(std::string_view name);
/// Names of the types, abstract or not, whose own @role has `below`; types that inherit it are not listed.
std::span<const std::string_view> builtinGroupTypes();

}  // namespace rtsg
