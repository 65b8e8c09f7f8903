// Binds Node: a node of a scene with its fields by their names.
#include <algorithm>
#include <string>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/world.h>

#include "collected.h"
#include "errors.h"
#include "module.h"
#include "values.h"

namespace py = pybind11;

namespace rtsg::python {

namespace {

std::string pathOf(const NodeObject& object, std::string_view field) {
    const std::string_view name = object.handle->scene().name(object.id);
    return name.empty() ? fmt::format("#{}.{}", object.id.value, field) : fmt::format("{}.{}", name, field);
}

FieldIndex fieldOf(const Node& node, const std::string& name) {
    return node.type().find(name);
}

[[noreturn]] void noField(const NodeObject& object, const Node& node, const std::string& name) {
    const auto found = findField(object.handle->scene(), fmt::format("#{}.{}", object.id.value, name));
    Diagnostic diagnostic;
    diagnostic.code = DiagnosticCode("no-such-field");
    diagnostic.text = found ? fmt::format("{} has no field {}", node.type().name, name) : found.error().text;
    raise(diagnostic, "NoSuchField");
}

py::object valueOf(const NodeObject& object, const std::string& name) {
    const Node& node = object.node();
    const FieldIndex field = fieldOf(node, name);
    if (field == kNoField) noField(object, node, name);
    if (node.type().slot(field).offset == FieldDef::kNoOffset)
        raise(DiagnosticCode("access"), pathOf(object, name) + " is an input and has no value");
    return toPython(node.value(field), object.scene);
}

void setValue(const NodeObject& object, const std::string& name, const py::handle& value) {
    Scene& scene = object.handle->edited();
    const Node& node = object.node();
    const FieldIndex field = fieldOf(node, name);
    if (field == kNoField) noField(object, node, name);
    const FieldDef& def = node.type().fields[field];
    if (!def.readable())
        raise(DiagnosticCode("access"), pathOf(object, name) + " is an input: send_event() sends to it");
    Value created = fromPython(def, value, *object.handle, pathOf(object, name));
    take(scene.setField(object.id, field, std::move(created)));
}

void sendEvent(const NodeObject& object, const std::string& name, const py::handle& value, const std::string& author) {
    Scene& scene = object.handle->edited();
    const Node& node = object.node();
    const FieldIndex field = fieldOf(node, name);
    if (field == kNoField) noField(object, node, name);
    take(scene.sendEvent(object.id, field,
                         fromPython(node.type().fields[field], value, *object.handle, pathOf(object, name)), author));
}

void addChild(const NodeObject& object, const NodeObject& child, const std::string& name,
              std::optional<std::size_t> index) {
    Scene& scene = object.handle->edited();
    if (child.handle != object.handle) throw py::value_error("the node is of another scene");
    const Node& node = object.node();
    (void)child.node();
    const FieldIndex field = fieldOf(node, name);
    if (field == kNoField) noField(object, node, name);
    take(scene.insertChild(object.id, field, child.id, index.value_or(SIZE_MAX)));
}

void removeChild(const NodeObject& object, const NodeObject& child, const std::string& name) {
    Scene& scene = object.handle->edited();
    const Node& node = object.node();
    const FieldIndex field = fieldOf(node, name);
    if (field == kNoField) noField(object, node, name);
    const FieldDef& def = node.type().fields[field];
    if (def.type != FieldType::MFNode || !def.readable())
        throw py::type_error(pathOf(object, name) + " is no list of nodes");
    const Value children = node.value(field);
    const Array<NodeId>& ids = children.as<Array<NodeId>>();
    const auto* const at = std::find(ids.begin(), ids.end(), child.id);
    if (at == ids.end())
        throw py::value_error(fmt::format("node #{} is not in {}", child.id.value, pathOf(object, name)));
    take(scene.removeChild(object.id, field, static_cast<std::size_t>(at - ids.begin())));
}

py::tuple fieldNames(const NodeObject& object) {
    py::list names;
    for (const FieldDef& def : object.node().type().fields)
        if (!def.hidden) names.append(def.name);
    return names;
}

py::dict fieldTypes(const NodeObject& object) {
    py::dict types;
    for (const FieldDef& def : object.node().type().fields)
        if (!def.hidden) types[py::str(def.name)] = def.typeName();
    return types;
}

/// Of a node that is gone, what all nodes have: dir() raises nothing.
py::list directory(const NodeObject& object) {
    const bool isThere =
        !object.handle->isClosed() && object.handle->isHere() && object.handle->scene().find(object.id);
    py::list names = isThere ? py::list(fieldNames(object)) : py::list();
    for (const char* const own : {"def_name", "type_name", "node_id", "field_names", "field_types", "is_alive",
                                  "parent_nodes", "send_event", "add_child", "remove_child", "text_of"})
        names.append(own);
    return names;
}

py::list parents(const NodeObject& object) {
    py::list found;
    const Scene& scene = object.handle->scene();
    for (const ParentRef& parent : scene.parents(object.id))
        found.append(py::make_tuple(nodeOrNone(object.scene, parent.node),
                                    scene.node(parent.node).type().fields[parent.field].name));
    return found;
}

py::object nameOf(const NodeObject& object) {
    (void)object.node();
    const std::string_view name = object.handle->scene().name(object.id);
    return name.empty() ? py::object(py::none()) : py::str(std::string(name));
}

/// Fields, and the name: all else there is no writing.
void setAttribute(const NodeObject& object, const std::string& name, const py::object& value) {
    if (name != "def_name") return setValue(object, name, value);
    (void)object.node();
    const std::string text = value.is_none() ? std::string() : textFrom(value, name);
    take(object.handle->edited().setName(object.id, text));
}

std::string describe(const NodeObject& object) {
    if (object.handle->isClosed()) return "<rtsg.Node of a closed scene>";
    if (!object.handle->isHere()) return fmt::format("<rtsg.Node #{} of another thread's scene>", object.id.value);
    const Node* const node = object.handle->scene().find(object.id);
    if (!node) return fmt::format("<rtsg.Node #{}, gone>", object.id.value);
    const std::string_view name = object.handle->scene().name(object.id);
    return fmt::format("<rtsg.Node {}{}>", node->type().name,
                       name.empty() ? fmt::format(" #{}", object.id.value) : fmt::format(" {}", name));
}

}  // namespace

void addNodes(py::module_& module) {
    py::class_<NodeObject>(module, "Node", collected<NodeObject>(),
                           "A node of a scene. Its fields are its attributes, or its items where a name is a word of "
                           "Python or of this class: light[\"global\"]. MF fields of numbers are read-only arrays of n "
                           "rows over the scene's own memory, which stay as they were when the field is set again. To "
                           "assign is to edit: no event is sent; send_event() sends one.")
        .def("__getattr__", valueOf)
        .def("__setattr__", setAttribute)
        .def("__getitem__", valueOf, "The field's value, as an attribute.")
        .def("__setitem__",
             [](const NodeObject& n, const std::string& name, const py::object& v) { setValue(n, name, v); })
        .def("__dir__", directory)
        .def_property_readonly("def_name", nameOf, "The DEF name, which can be set; None: it has none.")
        .def_property_readonly(
            "type_name", [](const NodeObject& n) { return n.node().type().name; }, "\"Transform\", say.")
        .def_property_readonly(
            "node_id", [](const NodeObject& n) { return n.id.value; },
            "Its number, which no other node of the scene ever has; \"#12\" names node 12.")
        .def_property_readonly("field_names", fieldNames, "The names of its fields.")
        .def_property_readonly("field_types", fieldTypes,
                               "The type of each field: {\"translation\": \"SFVec3f\", ...}.")
        .def_property_readonly(
            "is_alive", [](const NodeObject& n) { return n.handle->scene().find(n.id) != nullptr; },
            "False once it was destroyed.")
        .def_property_readonly("parent_nodes", parents, "(node, field) of each place where it hangs.")
        .def("send_event", sendEvent, py::arg("field"), py::arg("value"), py::arg("author") = "",
             "Sends an event to the field in the next frame. `author`: whose wish it is, for logs.")
        .def("add_child", addChild, py::arg("child"), py::arg("field") = "children", py::arg("index") = py::none(),
             "Puts a node into a list of nodes: at its end, or before the one at `index`.")
        .def("remove_child", removeChild, py::arg("child"), py::arg("field") = "children",
             "Takes a node out of a list of nodes; it stays in the scene.")
        .def(
            "text_of",
            [](const NodeObject& n, const std::string& name) {
                return take(fieldText(n.handle->scene(), fmt::format("#{}.{}", n.id.value, name)));
            },
            py::arg("field"), "The field's value as ClassicVRML writes it.")
        .def("__eq__",
             [](const NodeObject& a, const py::object& b) {
                 if (!py::isinstance<NodeObject>(b)) return false;
                 const auto& other = py::cast<const NodeObject&>(b);
                 return a.handle == other.handle && a.id == other.id;
             })
        .def("__hash__", [](const NodeObject& n) { return std::hash<const void*>()(n.handle) ^ n.id.value; })
        .def("__repr__", describe)
        .attr("__iter__") = py::none();  // items are fields, by name
}

}  // namespace rtsg::python
