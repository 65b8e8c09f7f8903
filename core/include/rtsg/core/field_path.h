// Finds nodes and fields by their names, and reads and writes field values as text.
//
// Threading: the scene's thread. Errors for unknown names suggest similar ones.
#pragma once

#include <string>
#include <string_view>

#include <rtsg/core/scene.h>

namespace rtsg {

/// Finds a node by its name. For a node within an Inline or a PROTO instance, put the name of that and a slash before
/// it: "HALL/DOOR". A node without a name is "#12". Errors: an unknown name, with similar names.
Result<NodeId> findNode(const Scene& scene, std::string_view path);

struct FieldRef {
    NodeId node;
    FieldIndex field = kNoField;
};
/// Finds "DOOR.translation": a node as for findNode, and a field, which may be written as set_x, x_changed or x.
/// Errors: an unknown name, with similar names.
Result<FieldRef> findField(const Scene& scene, std::string_view path);
/// The field's value in ClassicVRML.
Result<std::string> fieldText(const Scene& scene, std::string_view path);
/// Call Scene::setField and Scene::sendEvent with a value in text, where nodes are written as names. Errors: those of
/// findField(); text that is no value of this type.
Result<> setFieldText(Scene& scene, std::string_view path, std::string_view text);
Result<> sendFieldText(Scene& scene, std::string_view path, std::string_view text);

}  // namespace rtsg
