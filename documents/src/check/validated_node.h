// A node of a document at its end, as `validate` sees it: which fields were set, and their values.
//
// Threading: none of its own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include <rtsg/core/value.h>
#include <rtsg/documents/dialect.h>
#include <rtsg/documents/document_handler.h>

namespace rtsg {
class ScriptLanguage;
}

namespace rtsg::detail {

struct ValidatedNode {
    static constexpr std::size_t kNone = SIZE_MAX;
    struct Given {
        Value value;
        SourceLocation where;
    };
    struct Child {
        std::string type;
        std::size_t count = kNone;  // of its points, vectors, colours; kNone: it has none
        Value points;               // of a Coordinate, where they are given
    };
    /// An index into the points of a figure that a node below it has.
    struct Reach {
        std::int32_t index;
        std::string what;  // "skinCoordIndex[3] of HAnimJoint"
        SourceLocation where;
    };

    const NodeType* type = nullptr;  // null: of a PROTO, or unknown
    std::string def, field;
    std::unordered_map<std::string, Given> given;     // no nodes, and no fields that IS connects
    std::unordered_map<std::string, Child> children;  // by field, the last one
    std::vector<Reach> reaches;                       // of a humanoid or segment: the largest of each node below it
    bool isConnected = false;                         // so that instances may have other values

    std::int32_t number(const char* name, std::int32_t otherwise) const {
        const auto found = given.find(name);
        const bool isOne = found != given.end() && found->second.value.holds<std::int32_t>();
        return isOne ? found->second.value.as<std::int32_t>() : otherwise;
    }
    /// The array that a field was given, or null.
    template <class T>
    const Array<T>* array(const char* name) const {
        const auto found = given.find(name);
        const bool isOne = found != given.end() && found->second.value.holds<Array<T>>();
        return isOne ? &found->second.value.as<Array<T>>() : nullptr;
    }
    /// The place where the field was given; `otherwise` if it was not.
    SourceLocation at(const char* name, SourceLocation otherwise) const {
        const auto found = given.find(name);
        return found == given.end() ? otherwise : found->second.where;
    }
    /// How many points, vectors or colours the node in the field of this name has; kNone if that cannot be told.
    std::size_t countIn(const char* name) const {
        const auto found = children.find(name);
        return found == children.end() ? kNone : found->second.count;
    }
};

/// A filter that reports what fits together badly. `scripts`: by which the texts of Scripts are checked; null: not at
/// all.
std::unique_ptr<DocumentHandler> makeValidate(DocumentHandler& next, Diagnostics& diagnostics,
                                              const ScriptLanguage* scripts, std::shared_ptr<const Dialect> dialect);
/// Warns of lists that have too few or too many values beside others, do not ascend, or say nothing.
void checkCounts(const ValidatedNode& node, SourceLocation where, Diagnostics& diagnostics);
/// Warns of triangles and faces without an area.
void checkAreas(const ValidatedNode& node, SourceLocation where, Diagnostics& diagnostics);

}  // namespace rtsg::detail
