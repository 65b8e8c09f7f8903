// Binds the user's node types: a table of fields, and Python functions for the behaviour of their nodes.
#include "own_nodes.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/behaviour.h>

#include "collected.h"
#include "errors.h"
#include "module.h"
#include "values.h"

namespace py = pybind11;

namespace rtsg::python {

namespace {

/// The cascade that calls a function, for as long as the call lasts.
struct CascadeObject {
    Cascade* cascade = nullptr;
    SceneHandle* handle = nullptr;
    NodeId node;

    Cascade& running() const {
        if (!cascade) raise(DiagnosticCode("application"), "the call that this cascade was for is over", "Closed");
        return *cascade;
    }
};

void emit(const CascadeObject& object, const NodeObject& node, const std::string& name, const py::handle& value) {
    Cascade& cascade = object.running();
    if (node.id != object.node || node.handle != object.handle)
        raise(DiagnosticCode("access"), "a node's functions emit what is the node's own");
    const Node& own = node.node();
    const FieldIndex field = own.type().findExact(name);
    if (field == kNoField)
        raise(DiagnosticCode("no-such-field"), fmt::format("{} has no field {}", own.type().name, name), "NoSuchField");
    const FieldDef& def = own.type().fields[field];
    if (!def.readable()) raise(DiagnosticCode("access"), name + " is an input and sends nothing");
    take(cascade.output(own, field, fromPython(def, value, *object.handle, own.type().name + "." + name)));
}

/// Calls a function for a node. Its exception is raised by frame() once the frame is complete, and all nodes of its
/// type do nothing from then on.
template <class... Arguments>
py::object callFor(OwnBehaviour& own, const py::function& function, Cascade& cascade, const Node& node,
                   Arguments&&... arguments) {
    if (own.rests || !function) return py::none();
    const py::object rotation = py::cast(CascadeObject{&cascade, own.handle, node.id()});
    py::object result = py::none();
    try {
        const py::object scene = objectOf(*own.handle);
        result = function(rotation, nodeOrNone(scene, node.id()), std::forward<Arguments>(arguments)...);
    } catch (py::error_already_set& error) {
        own.rests = true;
        own.handle->keep(std::move(error));
    }
    py::cast<CascadeObject&>(rotation).cascade = nullptr;
    return result;
}

double onTime(Cascade& cascade, const Node& node) {
    auto& own = *static_cast<OwnBehaviour*>(cascade.context(node));
    const py::gil_scoped_acquire lock;
    const py::object next = callFor(own, own.onTime, cascade, node);
    if (next.is_none()) return kNever;
    const double time = PyFloat_AsDouble(next.ptr());
    if (!PyErr_Occurred()) return time;
    own.rests = true;
    own.handle->keep(py::error_already_set());
    return kNever;
}

void onEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    auto& own = *static_cast<OwnBehaviour*>(cascade.context(node));
    const py::gil_scoped_acquire lock;
    callFor(own, own.onEvent, cascade, node, py::str(node.type().fields[field].name),
            toPython(value.value(), objectOf(*own.handle)));
}

Access accessFrom(const std::string& name, const std::string& field) {
    constexpr std::pair<const char*, Access> kNames[] = {{"initializeOnly", Access::initializeOnly},
                                                         {"inputOnly", Access::inputOnly},
                                                         {"outputOnly", Access::outputOnly},
                                                         {"inputOutput", Access::inputOutput}};
    for (const auto& [known, access] : kNames)
        if (name == known) return access;
    throw py::value_error(
        fmt::format("{}: \"{}\" is no access: initializeOnly, inputOnly, outputOnly or inputOutput", field, name));
}

/// "SFFloat", ("SFFloat", "outputOnly") or ("SFFloat", "inputOutput", 1.0).
FieldDef fieldFrom(const std::string& name, const py::handle& given, const SceneHandle& handle) {
    const py::tuple parts =
        py::isinstance<py::str>(given) ? py::make_tuple(given) : py::tuple(py::cast<py::object>(given));
    if (parts.empty() || parts.size() > 3)
        throw py::value_error(name + ": expected a type, or (type, access), or (type, access, default)");
    FieldDef field;
    field.name = name;
    const std::string type = textFrom(parts[0], name);
    if (!fieldTypeFromName(type, field.type, field.custom))
        throw py::value_error(fmt::format("{}: there is no field type {}", name, type));
    if (parts.size() > 1) field.access = accessFrom(textFrom(parts[1], name), name);
    field.defaultValue =
        parts.size() > 2 ? fromPython(field, parts[2], handle, name) : zeroOf(field.type, field.custom.get());
    return field;
}

/// Names are attributes here, and words in files.
std::string nameFrom(const py::handle& object, std::string_view what) {
    const std::string name = textFrom(object, what);
    if (!PyUnicode_IsIdentifier(object.ptr()))
        throw py::value_error(fmt::format("{}: {} is no name", what, py::cast<std::string>(py::repr(object))));
    return name;
}

void define(SceneHandle& handle, const py::str& given, const py::dict& fields, const py::object& onTimeFunction,
            const py::object& onEventFunction, const std::vector<std::string>& implements, bool deterministic) {
    Scene& scene = handle.edited();
    const SceneHandle::Within within(handle);
    const std::string name = nameFrom(given, "define()");
    if (scene.findType(name)) raise(DiagnosticCode("edit"), "there is a node type " + name + " already");
    for (const std::string& abstract : implements)
        if (!isAbstractType(abstract))
            throw py::value_error(
                fmt::format("{} implements {}: there is no abstract type of that name", name, abstract));
    auto type = std::make_shared<NodeType>();
    type->name = name;
    type->component = "Own";
    type->kind = NodeType::Kind::user;
    type->implements = implements;
    type->acts = !onTimeFunction.is_none() ? Acts::always : onEventFunction.is_none() ? Acts::never : Acts::onInput;
    for (const auto& [field, parts] : fields) type->fields.push_back(fieldFrom(nameFrom(field, name), parts, handle));
    if (!type->finish()) throw py::value_error(name + ": two fields have one name, or there are too many");
    auto own = std::make_unique<OwnBehaviour>();
    own->handle = &handle;
    Behaviour behaviour;
    // What is no function throws here, before the type is there.
    if (!onTimeFunction.is_none()) own->onTime = onTimeFunction, behaviour.onTime = onTime;
    if (!onEventFunction.is_none()) own->onEvent = onEventFunction, behaviour.onEvent = onEvent;
    behaviour.deterministic = deterministic;
    behaviour.context = own.get();
    scene.registerBehaviour(take(scene.defineType(std::move(type))), behaviour);
    handle.keep(std::move(own));
}

}  // namespace

void addOwnNodes(py::module_& module) {
    module.def(
        "register_field_type",
        [](const std::string& name, const std::string& kind, std::uint16_t count) {
            constexpr std::pair<std::string_view, CustomLayout::Of> kKinds[] = {{"float64", CustomLayout::Of::float64},
                                                                                {"float32", CustomLayout::Of::float32},
                                                                                {"int32", CustomLayout::Of::int32},
                                                                                {"bytes", CustomLayout::Of::bytes}};
            const auto found = std::ranges::find(kKinds, kind, &std::pair<std::string_view, CustomLayout::Of>::first);
            if (found == std::end(kKinds))
                throw py::value_error(kind + " is no kind of numbers: float64, float32, int32 or bytes");
            const auto created = registerFieldType(name, {found->second, count});
            if (!created) throw py::value_error(created.error().text);
        },
        py::arg("name"), py::arg("kind"), py::arg("count") = 1,
        "Makes a field type known to the process, as \"SFQuantity\", which has \"MFQuantity\" beside it: each value "
        "consists of `count` numbers, or of bytes (0: of any number of them). Raises ValueError for what cannot be, "
        "and "
        "where there is one of that name with another layout.");
    py::class_<CascadeObject>(
        module, "Cascade", "What the functions of a node type of one's own are called with; good for the call alone.")
        .def_property_readonly(
            "now", [](const CascadeObject& c) { return c.running().now(); }, "Scene time of the frame, seconds.")
        .def_property_readonly(
            "previous", [](const CascadeObject& c) { return c.running().previous(); }, "That of the frame before.")
        .def("emit", emit, py::arg("node"), py::arg("field"), py::arg("value"),
             "Stores a field of the node, and sends it along its routes if it is an output. Once it has gone along "
             "routes "
             "in a frame, it is not sent again until the next.")
        .def(
            "warn",
            [](const CascadeObject& c, const std::string& text) {
                Cascade& cascade = c.running();
                cascade.warn(cascade.scene().node(c.node), text);
            },
            py::arg("text"), "Says something of the node, once: a DiagnosticWarning.");
    auto scene = py::class_<SceneHandle, std::shared_ptr<SceneHandle>>(module.attr("Scene"));
    scene.def(
        "define", define, py::arg("name"), py::arg("fields"), py::kw_only(), py::arg("on_time") = py::none(),
        py::arg("on_event") = py::none(), py::arg("implements") = std::vector<std::string>{"X3DNode", "X3DChildNode"},
        py::arg("deterministic") = false,
        "Defines a node type: `fields` is {\"length\": (\"SFFloat\", \"inputOutput\", 1.0), ...}; access and default "
        "may be "
        "left out. on_time(cascade, node) is called when a field was written or the time has come that it returned "
        "last: "
        "cascade.now for every frame, None for not before a field is written. on_event(cascade, node, field, value) is "
        "called for each event that comes in. `implements`: all abstract types that it is of. `deterministic` promises "
        "that what they do follows from fields, events and the clock alone; else replicas of inputs play back their "
        "calls. Raises Error where there is a type of that name, ValueError for what `implements` does not know.");
}

}  // namespace rtsg::python
