// Nodes and fields by their names, and fields' values as text.
//
// Threading: the scene's thread. Bad input gives an error that says what may have been meant.
#pragma once

#include <string>
#include <string_view>

#include <rtsg/core/scene.h>

namespace rtsg {

/// A node by its name. One within an Inline or a PROTO instance stands behind the name of that, and a slash:
/// "HALL/DOOR"; a node without a name is "#12". Errors: what is not there, and what may have been meant.
Result<NodeId> findNode(const Scene& scene, std::string_view path);

struct FieldRef {
    NodeId node;
    FieldIndex field = kNoField;
};
/// "DOOR.translation", a node as findNode has it; the field may be written as set_x, x_changed or x. Errors: what is
/// not there, and what may have been meant.
Result<FieldRef> findField(const Scene& scene, std::string_view path);
/// The field's value as ClassicVRML has it.
Result<std::string> fieldText(const Scene& scene, std::string_view path);
/// Call Scene::setField and Scene::sendEvent with a value in text. A node is written as its name. Errors: those of
/// findField(); text that is no such value.
Result<> setFieldText(Scene& scene, std::string_view path, std::string_view text);
Result<> sendFieldText(Scene& scene, std::string_view path, std::string_view text);

}  // namespace rtsg
