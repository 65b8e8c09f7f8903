// Binds ChangeSet, Change and Subscription.
#include "changes.h"

#include <string>

#include <rtsg/core/field_path.h>

#include "collected.h"
#include "errors.h"
#include "module.h"
#include "values.h"

namespace py = pybind11;

namespace rtsg::python {

namespace {

constexpr const char* kKinds[] = {"define_type", "create_node", "set_field",    "insert_child", "remove_child",
                                  "set_name",    "add_route",   "remove_route", "destroy_node", "event"};

/// One change of a set; it keeps the set.
struct ChangeObject {
    py::object changes;
    std::size_t index = 0;

    const ChangesObject& set() const { return py::cast<const ChangesObject&>(changes); }
    const Change& change() const { return set().set->changes[index]; }
    int traverse(visitproc visit, void* arg) {
        Py_VISIT(changes.ptr());
        return 0;
    }
    void clear() {}
};

const Scene& sceneOf(const ChangesObject& changes) {
    return py::cast<const SceneHandle&>(changes.scene).scene();
}

/// None where the node is gone, and its type with it.
py::object fieldName(const ChangesObject& changes, NodeId id, FieldIndex field) {
    if (field == kNoField) return py::none();
    const Node* const node = sceneOf(changes).find(id);
    if (!node || field >= node->type().fieldCount()) return py::none();
    return py::str(node->type().fields[field].name);
}

std::string nodePath(const Scene& scene, NodeId id) {
    const std::string_view name = scene.name(id);
    return name.empty() ? "#" + std::to_string(id.value) : std::string(name);
}

/// The new value of NODE.field; null: it is not in the set.
const Value* newValue(const ChangesObject& changes, const std::string& path) {
    const auto ref = findField(sceneOf(changes), path);
    if (!ref) raise(ref.error(), "NoSuchName");
    const auto& all = changes.set->changes;
    for (std::size_t i = all.size(); i-- > 0;)
        if (all[i].kind == ChangeKind::setField && all[i].node == ref->node && all[i].field == ref->field)
            return &all[i].value;
    return nullptr;
}

py::object authorOf(const ChangeObject& object) {
    const ChangesObject& changes = object.set();
    if (!changes.set->authors) return py::none();
    const Change& change = object.change();
    for (const Authored& authored : *changes.set->authors)
        if (authored.node == change.node && (authored.field == change.field || authored.field == kNoField))
            return py::str(authored.author.str());
    return py::none();
}

py::object otherOf(const ChangeObject& object) {
    const Change& change = object.change();
    switch (change.kind) {
        case ChangeKind::insertChild:
        case ChangeKind::removeChild:
        case ChangeKind::addRoute:
        case ChangeKind::removeRoute:
            return nodeOrNone(object.set().scene, change.other);
        default:
            return py::none();
    }
}

std::string pathOf(const ChangeObject& object) {
    const py::object field = fieldName(object.set(), object.change().node, object.change().field);
    const std::string node = nodePath(sceneOf(object.set()), object.change().node);
    return field.is_none() ? node : node + "." + py::cast<std::string>(field);
}

py::object valueOf(const ChangeObject& object) {
    const Change& change = object.change();
    if (change.kind != ChangeKind::setField && change.kind != ChangeKind::event && change.kind != ChangeKind::setName)
        return py::none();
    return toPython(change.value, object.set().scene);
}

void addChange(py::module_& module) {
    py::class_<ChangeObject>(module, "Change", collected<ChangeObject>(), "One change of a ChangeSet.")
        .def_property_readonly(
            "kind", [](const ChangeObject& c) { return kKinds[static_cast<int>(c.change().kind)]; },
            "What happened: set_field, create_node, destroy_node, insert_child, remove_child, set_name, add_route, "
            "remove_route, define_type, or event for an input that came from outside.")
        .def_property_readonly(
            "node", [](const ChangeObject& c) { return nodeOrNone(c.set().scene, c.change().node); },
            "The node that changed; it may be gone by now.")
        .def_property_readonly(
            "field", [](const ChangeObject& c) { return fieldName(c.set(), c.change().node, c.change().field); },
            "The field's name; None where there is none, or the node is gone.")
        .def_property_readonly("path", pathOf, "\"NODE.field\", as scene.value() takes it.")
        .def_property_readonly("value", valueOf, "The new value, the event's, or the new name; else None.")
        .def_property_readonly("other", otherOf, "The child, or the node that a route leads to; else None.")
        .def_property_readonly(
            "index", [](const ChangeObject& c) { return c.change().index; },
            "The position of a child that came or went.")
        .def_property_readonly(
            "external", [](const ChangeObject& c) { return bool{c.change().external}; },
            "True: the application caused it; False: the scene did by itself.")
        .def_property_readonly("author", authorOf, "Who asked for it, where it was not the application itself.")
        .def("__repr__", [](const ChangeObject& c) {
            return std::string("<rtsg.Change ") + kKinds[static_cast<int>(c.change().kind)] + " " + pathOf(c) + ">";
        });
}

void addSubscription(py::module_& module) {
    py::class_<Subscription, std::shared_ptr<Subscription>>(
        module, "Subscription", "A function that follows a scene; made by Scene.subscribe(). Closing it ends that.")
        .def_property_readonly("active", &Subscription::active, "False once it was closed, or its function raised.")
        .def_property_readonly(
            "error", [](const Subscription& s) { return s.error(); }, "What its function raised; None if nothing.")
        .def(
            "close", [](const std::shared_ptr<Subscription>& s) { s->end(); }, "The function is called no more.")
        .def("__enter__", [](py::object self) { return self; })
        .def("__exit__", [](const std::shared_ptr<Subscription>& s, const py::args&) { s->end(); });
}

}  // namespace

py::object toPython(std::shared_ptr<const ChangeSet> set, const py::object& scene) {
    if (!set) return py::none();
    const ChangeSet* const inside = set.get();
    return py::cast(ChangesObject{scene, inside, std::move(set)});
}

void callWith(const py::function& call, const py::object& scene, const ChangeSet& changes) {
    const py::object object = py::cast(ChangesObject{scene, &changes, nullptr});
    const auto keep = [&] {
        if (Py_REFCNT(object.ptr()) == 1) return;
        auto& inside = py::cast<ChangesObject&>(object);
        inside.kept = std::make_shared<const ChangeSet>(changes);
        inside.set = inside.kept.get();
    };
    try {
        call(object);
    } catch (...) {
        keep();  // a traceback holds the function's arguments
        throw;
    }
    keep();
}

void addChanges(py::module_& module) {
    py::class_<ChangesObject>(module, "ChangeSet", collected<ChangesObject>(),
                              "The changes that lead from one state of a scene to the next; a sequence of Change.")
        .def_property_readonly(
            "scene", [](const ChangesObject& c) { return c.scene; }, "The scene.")
        .def_property_readonly(
            "number", [](const ChangesObject& c) { return c.set->to; }, "The number of the state that it leads to.")
        .def_property_readonly(
            "since", [](const ChangesObject& c) { return c.set->from; }, "The number of the state before; 0: none.")
        .def_property_readonly(
            "time", [](const ChangesObject& c) { return c.set->time; }, "Scene time, seconds.")
        .def_property_readonly(
            "hash", [](const ChangesObject& c) { return c.set->hash.hex(); },
            "The 128-bit hash of the state that it leads to, 32 hexadecimal digits.")
        .def_property_readonly(
            "is_snapshot", [](const ChangesObject& c) { return c.set->isSnapshot(); },
            "It leads from the empty scene to its state: what was known before is void.")
        .def("__len__", [](const ChangesObject& c) { return c.set->changes.size(); })
        .def("__getitem__",
             [](const py::object& self, py::ssize_t index) {
                 const auto size = static_cast<py::ssize_t>(py::cast<ChangesObject&>(self).set->changes.size());
                 if (index < 0) index += size;
                 if (index < 0 || index >= size) throw py::index_error("there is no such change");
                 return ChangeObject{self, static_cast<std::size_t>(index)};
             })
        .def(
            "__getitem__",
            [](const ChangesObject& c, const std::string& path) {
                const Value* const value = newValue(c, path);
                if (!value) throw py::key_error(path + " is not in this set");
                return toPython(*value, c.scene);
            },
            "The new value of \"NODE.field\". Raises KeyError if this set does not change it.")
        .def("__contains__",
             [](const ChangesObject& c, const std::string& path) { return newValue(c, path) != nullptr; })
        .def(
            "get",
            [](const ChangesObject& c, const std::string& path, const py::object& otherwise) {
                const Value* const value = newValue(c, path);
                return value ? toPython(*value, c.scene) : otherwise;
            },
            py::arg("path"), py::arg("default") = py::none(), "As [path], or `default` if this set does not change it.")
        .def("__repr__", [](const ChangesObject& c) {
            return "<rtsg.ChangeSet " + std::to_string(c.set->to) + ", " + std::to_string(c.set->changes.size()) +
                   " changes>";
        });
    addChange(module);
    addSubscription(module);
}

}  // namespace rtsg::python
