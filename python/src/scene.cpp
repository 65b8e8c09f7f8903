// Binds Scene, and the functions that make one: load(), loads().
#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/world.h>
#include <rtsg/documents/writer.h>
#include <rtsg/scripts/run_scripts.h>
#include <rtsg/sync/scene_file.h>

#include "changes.h"
#include "collected.h"
#include "errors.h"
#include "module.h"
#include "unlocked.h"
#include "values.h"

namespace py = pybind11;
namespace fs = std::filesystem;

namespace rtsg::python {

namespace {

// ---- making one ----------------------------------------------------------------------------------------------------

ResourcePolicy policyOf(const std::vector<fs::path>& allow) {
    ResourcePolicy policy;
    policy.roots = allow;
    return policy;
}

/// Ends a load: raises errors, and reports other diagnostics.
void finishLoading(SceneHandle& handle, const Diagnostics& found, bool usable, bool partial) {
    const bool failed = found.errors() > 0 || !usable;
    if (failed && (!partial || !usable)) {
        const auto& all = found.all();
        const auto first =
            std::find_if(all.begin(), all.end(), [](const Diagnostic& d) { return d.severity == Severity::error; });
        if (first != all.end()) raise(*first);
        raise(Diagnostic{Severity::error, found.file(), {}, "nothing usable is in it"});
    }
    handle.say(found);
    handle.follow();
    handle.report();
}

std::shared_ptr<SceneHandle> load(const fs::path& file, const std::vector<fs::path>& allow, bool partial, bool scripts,
                                  const std::string& clip) {
    SceneHandle::Options options{Resources::ofFile(file, policyOf(allow)), file, scripts};
    auto handle = SceneHandle::make(options);
    Diagnostics found(file.string());
    bool usable = true;
    if (isSceneFile(file)) {
        const auto read = unlocked([&] { return readSceneFile(handle->scene(), file); });
        if (!read) raise(read.error());
    } else {
        Scene& scene = handle->scene();
        Interruption interruption;
        usable = unlocked([&] {
            LoadOptions how;
            how.resources = options.resources;
            how.clip = clip;
            return loadFile(scene, file, found, how);
        });
        interruption.raise();
    }
    finishLoading(*handle, found, usable, partial);
    return handle;
}

std::shared_ptr<SceneHandle> loadFromText(const std::string& text, const fs::path& base,
                                          const std::vector<fs::path>& allow, bool partial, bool scripts) {
    ResourcePolicy policy = policyOf(allow);
    if (!base.empty()) policy.roots.push_back(base);
    SceneHandle::Options options{Resources(base, policy), {}, scripts};
    auto handle = SceneHandle::make(options);
    Scene& scene = handle->scene();
    Diagnostics found("text");
    const bool usable = unlocked([&] {
        LoadOptions how;
        how.resources = options.resources;
        return loadText(scene, text, found, base, how);
    });
    finishLoading(*handle, found, usable, partial);
    return handle;
}

std::shared_ptr<SceneHandle> makeEmpty(const std::vector<fs::path>& allow, bool scripts) {
    ResourcePolicy policy = policyOf(allow);
    policy.roots.emplace_back(".");
    auto handle = SceneHandle::make({Resources(".", policy), {}, scripts});
    handle->follow();
    return handle;
}

// ---- nodes ---------------------------------------------------------------------------------------------------------

SceneHandle& handleOf(const py::object& self) {
    return py::cast<SceneHandle&>(self);
}

py::object nodeNamed(const py::object& self, const std::string& path) {
    const auto found = findNode(handleOf(self).scene(), path);
    if (!found) raise(found.error(), "NoSuchName");
    return nodeOrNone(self, *found);
}

py::object nodeNumbered(const py::object& self, std::uint32_t id) {
    if (!handleOf(self).scene().find(NodeId{id}))
        raise(DiagnosticCode("no-such-node"), fmt::format("no node #{}", id), "NoSuchName");
    return nodeOrNone(self, NodeId{id});
}

py::list nodes(const py::object& self, const std::string& type) {
    py::list found;
    handleOf(self).scene().forEachNode([&](const Node& node) {
        if (node.type().internal || (!type.empty() && !node.type().isA(type))) return;
        found.append(nodeOrNone(self, node.id()));
    });
    return found;
}

FieldRef fieldAt(const Scene& scene, const std::string& path) {
    const auto found = findField(scene, path);
    if (!found)
        raise(found.error(), found.error().code == DiagnosticCode("no-such-field") ? "NoSuchField" : "NoSuchName");
    return *found;
}

py::object valueAt(const py::object& self, const std::string& path) {
    const Scene& scene = handleOf(self).scene();
    const FieldRef at = fieldAt(scene, path);
    const Node& node = scene.node(at.node);
    if (node.type().slot(at.field).offset == FieldDef::kNoOffset)
        raise(DiagnosticCode("access"), path + " is an input and has no value");
    return toPython(node.value(at.field), self);
}

void send(SceneHandle& handle, const std::string& path, const py::object& value, const std::string& author) {
    Scene& scene = handle.edited();
    const FieldRef at = fieldAt(scene, path);
    const FieldDef& def = scene.node(at.node).type().fields[at.field];
    take(scene.sendEvent(at.node, at.field, fromPython(def, value, handle, path), author));
}

py::object create(const py::object& self, const std::string& type, const py::kwargs& fields) {
    Scene& scene = handleOf(self).edited();
    const NodeId id = take(scene.createNode(std::string_view(type)));
    py::object node = nodeOrNone(self, id);
    try {
        for (const auto& [name, value] : fields) py::setattr(node, name, value);
    } catch (...) {
        (void)scene.destroyNode(id);
        throw;
    }
    return node;
}

py::list add(const py::object& self, const std::string& text, const py::object& parent, const std::string& field) {
    SceneHandle& handle = handleOf(self);
    Scene& scene = handle.edited();
    Diagnostics found("text");
    LoadOptions options;
    options.resources = handle.resources();
    const auto piece = createX3DFromString(scene, text, found, options);
    const auto undo = [&] {
        if (piece)
            for (const NodeId root : piece->roots) (void)scene.destroyNode(root);
    };
    for (const Diagnostic& d : found.all())
        if (d.severity == Severity::error) {
            undo();
            raise(d);
        }
    if (!piece) raise(Diagnostic{Severity::error, "text", {}, "nothing usable is in it"});
    py::list created;
    const py::object to = parent.is_none() ? nodeOrNone(self, scene.root()) : parent;
    for (const NodeId root : piece->roots) {
        py::object node = nodeOrNone(self, root);
        to.attr("add_child")(node, field);
        created.append(std::move(node));
    }
    handle.say(found);
    handle.report();
    return created;
}

/// With what hangs below it, and nowhere else.
std::size_t destroyBelow(Scene& scene, NodeId top) {
    std::vector<NodeId> below{top};
    std::size_t count = 0;
    while (!below.empty()) {
        const NodeId id = below.back();
        below.pop_back();
        const Node* const node = scene.find(id);
        if (!node || (id != top && !scene.parents(id).empty())) continue;
        for (const FieldIndex field : node->type().nodeFields()) {
            if (node->type().slot(field).offset == FieldDef::kNoOffset) continue;
            const Value value = node->value(field);
            if (value.type() == FieldType::SFNode)
                below.push_back(value.as<NodeId>());
            else
                for (const NodeId child : value.as<Array<NodeId>>()) below.push_back(child);
        }
        take(scene.destroyNode(id));
        ++count;
    }
    return count;
}

std::size_t removeNode(SceneHandle& handle, const NodeObject& node) {
    Scene& scene = handle.edited();
    if (node.handle != &handle) throw py::value_error("the node is of another scene");
    (void)node.node();
    if (node.id == scene.root()) throw py::value_error("the root of a scene stays");
    return destroyBelow(scene, node.id);
}

// ---- many at once --------------------------------------------------------------------------------------------------

template <class T>
void setEachOf(Scene& scene, std::span<const NodeId> ids, FieldIndex field, const Numbers& numbers) {
    if constexpr (std::is_trivially_copyable_v<T> && !std::is_same_v<T, NodeId>)
        take(scene.setEach(ids, Field<T>{field},
                           std::span<const T>(static_cast<const T*>(numbers.array.data()), ids.size())));
}

void setEach(SceneHandle& handle, const py::iterable& nodes, const std::string& name, const py::object& values) {
    Scene& scene = handle.edited();
    const SceneHandle::Within within(handle);  // iterators and arrays have functions of Python
    std::vector<NodeId> ids;
    const NodeType* nodeType = nullptr;
    for (const py::handle one : nodes) {
        if (!py::isinstance<NodeObject>(one)) throw py::type_error("set_each() takes nodes");
        const auto& object = py::cast<const NodeObject&>(one);
        if (object.handle != &handle) throw py::value_error("a node is of another scene");
        const NodeType& own = object.node().type();
        if (!nodeType) nodeType = &own;
        if (&own != nodeType) throw py::value_error("set_each() takes nodes of one type");
        ids.push_back(object.id);
    }
    if (!nodeType) return;
    const FieldIndex field = nodeType->find(name);
    if (field == kNoField)
        raise(DiagnosticCode("no-such-field"), fmt::format("{} has no field {}", nodeType->name, name), "NoSuchField");
    const FieldType type = nodeType->fields[field].type;
    if (isMF(type) || !numberType(type))
        throw py::type_error(fmt::format("{} is {}: set_each() is of single values of numbers", name,
                                         nodeType->fields[field].typeName()));
    const Numbers numbers = numbersFrom(mf(type), values, name);
    if (numbers.count != ids.size())
        throw py::value_error(fmt::format("{} values for {} nodes", numbers.count, ids.size()));
    switch (type) {
#define RTSG_X(suffix, element) \
    case FieldType::SF##suffix: \
        return setEachOf<element>(scene, ids, field, numbers);
        RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
        default:
            return;
    }
}

// ---- routes, files -------------------------------------------------------------------------------------------------

void route(SceneHandle& handle, const std::string& from, const std::string& to, bool add) {
    Scene& scene = handle.edited();
    const FieldRef a = fieldAt(scene, from), b = fieldAt(scene, to);
    take(add ? scene.addRoute(a.node, a.field, b.node, b.field) : scene.removeRoute(a.node, a.field, b.node, b.field));
}

std::string pathText(const Scene& scene, NodeId id, FieldIndex field) {
    const std::string_view name = scene.name(id);
    return fmt::format("{}.{}", name.empty() ? fmt::format("#{}", id.value) : std::string(name),
                       scene.node(id).type().fields[field].name);
}

py::list routes(const SceneHandle& handle) {
    py::list found;
    const Scene& scene = handle.scene();
    scene.forEachNode([&](const Node& node) {
        for (const Route& r : scene.routesFrom(node.id()))
            if (!r.isConnection)
                found.append(
                    py::make_tuple(pathText(scene, r.fromNode, r.fromField), pathText(scene, r.toNode, r.toField)));
    });
    return found;
}

void save(SceneHandle& handle, const fs::path& file, bool replace) {
    Scene& scene = handle.between();
    const Existing existing = replace ? Existing::replace : Existing::keep;
    Diagnostics found(file.string());
    const auto written = handle.work([&]() -> Result<> {
        if (file.extension() == ".rtsgb") return writeSceneFile(scene, file, existing);
        return saveWorld(scene, file, found, existing);
    });
    handle.raisePending();
    take(written);
    handle.say(found);
    handle.report();
}

py::list diagnostics(SceneHandle& handle) {
    py::list all;
    for (const Diagnostic& one : handle.said().all()) all.append(toPython(one));
    return all;
}

std::string describe(const SceneHandle& handle) {
    if (handle.isClosed()) return "<rtsg.Scene, closed>";
    if (!handle.isHere()) return "<rtsg.Scene of another thread>";
    const Scene& scene = handle.scene();
    return fmt::format("<rtsg.Scene{}{}, {} nodes, t = {:g}>", handle.file().empty() ? "" : " ", handle.file().string(),
                       scene.nodeCount(), scene.now());
}

using SceneClass = py::class_<SceneHandle, std::shared_ptr<SceneHandle>>;

void addReading(SceneClass& scene) {
    scene
        .def("__getitem__", nodeNamed,
             "The node of this name: \"DOOR\", \"HALL/DOOR\" inside of an Inline or PROTO, \"#12\".")
        .def("__contains__",
             [](const SceneHandle& h, const std::string& path) { return findNode(h.scene(), path).has_value(); })
        .def(
            "__len__", [](const SceneHandle& h) { return h.scene().nodeCount(); }, "How many nodes there are.")
        .def("__bool__", [](const SceneHandle&) { return true; })
        .def("node", nodeNumbered, py::arg("node_id"), "The node of this number, as the ids of pictures have it.")
        .def("nodes", nodes, py::arg("type_name") = "",
             "All nodes, or those of a type, abstract ones too (\"X3DLightNode\"), in the order of their numbers.")
        .def("value", valueAt, py::arg("path"), "The value of \"NODE.field\".")
        .def_property_readonly(
            "root", [](const py::object& self) { return nodeOrNone(self, handleOf(self).scene().root()); },
            "The node whose `children` are the scene's root nodes.")
        .def_property_readonly(
            "now", [](const SceneHandle& h) { return h.scene().now(); }, "Scene time, seconds.")
        .def_property_readonly(
            "number", [](const SceneHandle& h) { return h.scene().sequence(); }, "The number of its state.")
        .def_property_readonly(
            "hash", [](const SceneHandle& h) { return h.scene().hash().hex(); },
            "The 128-bit hash of its state, 32 hexadecimal digits; equal states have equal ones, everywhere.")
        .def_property_readonly(
            "rests_until", [](const SceneHandle& h) { return h.scene().restsUntil(); },
            "When it does something by itself next, scene time: minus infinity, a time, or infinity.")
        .def_property_readonly("routes", routes, "(\"FROM.field\", \"TO.field\") of each route.")
        .def_property_readonly(
            "file", [](const SceneHandle& h) { return h.file().string(); }, "As it was loaded from.")
        .def_property_readonly("diagnostics", diagnostics,
                               "All that was said of the scene so far, Diagnostic by Diagnostic.")
        .def_property_readonly("closed", &SceneHandle::isClosed, "Whether close() was called.")
        .def(
            "snapshot",
            [](const py::object& self) {
                SceneHandle& handle = handleOf(self);
                const Scene& inside = handle.between();
                auto set = unlocked([&] { return std::make_shared<const ChangeSet>(inside.snapshot()); });
                handle.raisePending();
                return toPython(std::move(set), self);
            },
            "The whole state as a ChangeSet.")
        .def(
            "dump", [](const SceneHandle& h) { return h.scene().dump(); }, "The whole state as text, for bug reports.")
        .def("save", save, py::arg("path"), py::arg("replace") = true,
             "Writes the scene: .x3d, .x3dv, .wrl, .json, each with .gz if wanted, or .rtsgb.")
        .def("__repr__", describe)
        .def(
            "__iter__", [](const py::object& self) { return py::iter(nodes(self, "")); },
            "Over all nodes that there are now but the root, in the order of their numbers.");
}

void addEditing(SceneClass& scene) {
    scene
        .def("create", create, py::arg("type_name"),
             "A new node that hangs nowhere yet: scene.create(\"Transform\", def_name=\"BOX\", translation=(0, 1, 0)).")
        .def("add", add, py::arg("text"), py::arg("parent") = py::none(), py::arg("field") = "children",
             "Adds the nodes of a piece of ClassicVRML (or XML, JSON) below the root or `parent`. Returns them.")
        .def("remove", removeNode, py::arg("node"),
             "Destroys a node, and what hangs below it and nowhere else. Returns how many nodes.")
        .def("set_each", setEach, py::arg("nodes"), py::arg("field"), py::arg("values"),
             "Sets a field of many nodes of one type, each to its row of `values`: an array of n rows.")
        .def(
            "add_route", [](SceneHandle& h, const std::string& a, const std::string& b) { route(h, a, b, true); },
            py::arg("source"), py::arg("target"), "Makes a route from \"NODE.field\" to \"NODE.field\".")
        .def(
            "remove_route", [](SceneHandle& h, const std::string& a, const std::string& b) { route(h, a, b, false); },
            py::arg("source"), py::arg("target"), "Takes such a route away.")
        .def("send", send, py::arg("path"), py::arg("value"), py::arg("author") = "",
             "Sends an event to \"NODE.field\" in the next frame. `author`: whose wish it is, for logs.");
}

void addRunning(SceneClass& scene) {
    scene
        .def(
            "frame", [](const py::object& self, double t) { return toPython(handleOf(self).frame(t), self); },
            py::arg("t"),
            "Runs one frame at scene time `t`, seconds: events, clocks, routes, Scripts, bodies. Returns its "
            "ChangeSet, "
            "which all subscribers have had. Raises Error if time goes back; what a subscriber raised, after all "
            "others "
            "had their turn.")
        .def(
            "seal", [](const py::object& self) { return toPython(handleOf(self).seal(), self); },
            "Publishes edits without running anything. None if there are none.")
        .def(
            "subscribe",
            [](SceneHandle& h, py::function call) {
                (void)h.between();
                return h.subscribe(std::move(call));
            },
            py::arg("function"),
            "Calls function(changes) with a snapshot at once, and then with each ChangeSet. One that raises is called "
            "no "
            "more, and frame() raises what it raised.")
        .def(
            "set_threads", [](SceneHandle& h, unsigned count) { h.edited().setThreads(count); }, py::arg("count"),
            "How many threads, 8 at most, work on a frame of thousands of events; results are the same.")
        .def("close", &SceneHandle::close, "Ends all that hangs on the scene, then the scene. Using it raises Closed.")
        .def("__enter__", [](py::object self) { return self; })
        .def("__exit__", [](SceneHandle& h, const py::args&) { h.close(); });
}

}  // namespace

void addScene(py::module_& module) {
    SceneClass scene(module, "Scene", collected<SceneHandle>(),
                     "A running X3D scene. It belongs to the thread that made it; others get WrongThread.");
    scene.def(py::init(&makeEmpty), py::kw_only(), py::arg("allow") = std::vector<fs::path>(),
              py::arg("scripts") = true,
              "An empty scene. `allow`: folders whose files urls may open, besides the working folder.");
    addReading(scene);
    addEditing(scene);
    addRunning(scene);
    module.def(
        "load", load, py::arg("path"), py::kw_only(), py::arg("allow") = std::vector<fs::path>(),
        py::arg("partial") = false, py::arg("scripts") = true, py::arg("clip") = "",
        "Reads a scene: X3D in any encoding, VRML97, glTF, OBJ, PLY, STL, .rtsgb. Raises Error, with file, line "
        "and code, where it has an error; `partial`: only where nothing is usable, and errors are warnings. "
        "`allow`: folders besides its own and the working one whose files urls may open. `clip`: glTF animation.");
    module.def("loads", loadFromText, py::arg("text"), py::kw_only(), py::arg("base") = fs::path(),
               py::arg("allow") = std::vector<fs::path>(), py::arg("partial") = false, py::arg("scripts") = true,
               "The same of text. `base`: the folder from which relative urls start; none: urls open nothing.");
}

}  // namespace rtsg::python
