// Describes a scene as messages: frames, shapes, changes and fields, for viewers of robots' recordings.
#include <rtsg/session/scene_messages.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <unordered_set>

#include <fmt/format.h>
#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/field_path.h>
#include <rtsg/core/field_text.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/mesh.h>
#include <rtsg/session/labels.h>

#include "viewers/message_schemas.h"

namespace rtsg {

namespace {

/// Messages up to these sizes are always complete. Longer ones are complete only after so many seconds.
constexpr std::size_t kWholeFrames = 256, kWholeSceneBytes = 256 << 10;
constexpr double kWholeFramesEvery = 1, kWholeSceneEvery = 10;
/// Values with longer text are left out of /rtsg/changes, because meshes would fill most of the file.
constexpr std::size_t kLongestValue = 4096;

std::string number(double value) {
    return std::isfinite(value) ? fmt::format("{}", value) : "0";
}
std::string vector(double x, double y, double z) {
    return fmt::format(R"({{"x":{},"y":{},"z":{}}})", number(x), number(y), number(z));
}
std::string vector(const glm::dvec3& v) {
    return vector(v.x, v.y, v.z);
}
std::string quaternion(const glm::dquat& q) {
    return fmt::format(R"({{"x":{},"y":{},"z":{},"w":{}}})", number(q.x), number(q.y), number(q.z), number(q.w));
}
std::string moment(double time) {
    const auto nanoseconds = static_cast<std::uint64_t>(std::llround(std::max(0., time) * 1e9));
    return fmt::format(R"({{"sec":{},"nsec":{}}})", nanoseconds / 1000000000, nanoseconds % 1000000000);
}
std::string pose(const glm::dquat& rotation = {1, 0, 0, 0}) {
    return fmt::format(R"({{"position":{},"orientation":{}}})", vector(0, 0, 0), quaternion(rotation));
}

/// A place in the world: position, rotation, and the rest of the linear part.
struct ScaledPose {
    glm::dvec3 position{0};
    glm::dquat rotation{1, 0, 0, 0};
    glm::dmat3 rest{1};

    explicit ScaledPose(const WorldFromLocal& m) : position(m[3]) {
        const glm::dmat3 linear(m[0], m[1], m[2]);
        const double a = glm::length(linear[0]);
        glm::dvec3 x = linear[0] / a, y = linear[1] - x * glm::dot(x, linear[1]);
        const double b = glm::length(y);
        if (!(a > 0) || !(b > 0) || !std::isfinite(a * b)) {
            rest = linear;  // flat: there is no direction to turn to
            return;
        }
        y /= b;
        const glm::dmat3 rotated(x, y, glm::cross(x, y));
        rotation = glm::quat_cast(rotated);
        rest = glm::transpose(rotated) * linear;
    }
    bool sameShape(const ScaledPose& other) const {
        double difference = 0, size = 0;
        for (int i = 0; i < 3; ++i) {
            difference = std::max(difference, glm::length(rest[i] - other.rest[i]));
            size = std::max(size, glm::length(rest[i]));
        }
        return difference <= 1e-6 * size;
    }
    /// Scales along the axes, if the rest is nothing else.
    std::optional<glm::dvec3> scale() const {
        const glm::dvec3 s(rest[0][0], rest[1][1], rest[2][2]);
        const double largest = std::max({s.x, s.y, s.z}), slack = 1e-6 * largest;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                if (i != j && std::abs(rest[i][j]) > slack) return std::nullopt;
        if (!(std::min({s.x, s.y, s.z}) > 0)) return std::nullopt;
        return s;
    }
};

/// The one colour in which the viewer shows an appearance.
std::string colorOf(const Scene& scene, NodeId appearance) {
    Color color{1, 1, 1};
    float opacity = 1;
    const Node* node = appearance ? scene.find(appearance) : nullptr;
    const Node* material = nullptr;
    if (node && node->is(x3d::Appearance::type)) material = scene.find(node->get(x3d::Appearance::material));
    const auto read = [&](const char* name, auto& into) {
        if (!material) return false;
        const FieldIndex index = material->type().findExact(name);
        using T = std::remove_reference_t<decltype(into)>;
        if (index == kNoField || material->type().fields[index].type != FieldTypeOf<T>::value) return false;
        into = *static_cast<const T*>(material->storage(index));
        return true;
    };
    if (!read("diffuseColor", color) && !read("baseColor", color)) read("emissiveColor", color);
    float transparency = 0;
    if (read("transparency", transparency)) opacity = 1 - transparency;
    return fmt::format(R"({{"r":{},"g":{},"b":{},"a":{}}})", number(color.r), number(color.g), number(color.b),
                       number(opacity));
}

std::string_view kindName(ChangeKind kind) {
    switch (kind) {
        case ChangeKind::defineType:
            return "type";
        case ChangeKind::createNode:
            return "create";
        case ChangeKind::setField:
            return "set";
        case ChangeKind::insertChild:
            return "insert";
        case ChangeKind::removeChild:
            return "remove";
        case ChangeKind::setName:
            return "name";
        case ChangeKind::addRoute:
            return "route";
        case ChangeKind::removeRoute:
            return "unroute";
        case ChangeKind::destroyNode:
            return "destroy";
        case ChangeKind::event:
            return "event";
    }
    return "?";
}

void appendChange(std::string& out, const Scene& scene, const Change& c) {
    const Node* node = scene.find(c.node);
    out += fmt::format(R"({{"kind":"{}","id":{},"external":{})", kindName(c.kind), c.node.value, bool(c.external));
    if (node) {
        out +=
            fmt::format(R"(,"node":{},"type":{})", jsonString(labelOf(scene, c.node)), jsonString(node->type().name));
        if (c.field < node->type().fields.size())
            out += fmt::format(R"(,"field":{})", jsonString(node->type().fields[c.field].name));
    }
    if (c.kind == ChangeKind::setField || c.kind == ChangeKind::setName || c.kind == ChangeKind::event) {
        const std::string text = printFieldText(c.value, TextSyntax::json);
        out += text.size() <= kLongestValue ? ",\"value\":" + text : fmt::format(R"(,"omitted":{})", text.size());
    }
    if (c.other) out += fmt::format(R"(,"other":{},"index":{})", c.other.value, c.index);
    out += '}';
}

}  // namespace

struct SceneMessages::Impl : InstanceSubscriber {
    using Reach = MessageSink::Reach;
    struct Item {
        std::string frame;
        ScaledPose pose;
        Instance instance;   // only for shapes
        std::string entity;  // JSON without its beginning, only for shapes
        bool moved = false, changed = false;
    };
    using Items = std::unordered_map<std::uint32_t, Item>;  // by slot
    /// A chosen field, with its topic. Without a node it is not there at present.
    struct Chosen {
        std::string path;
        FieldRef field;
        std::uint16_t topic = 0;
        bool due = false;
    };
    MessageSink& sink;
    std::uint16_t frames = 0, entities = 0, changes = 0;
    std::vector<Chosen> chosen;
    SharedWorld& world;
    Items shapes, placed;
    std::vector<std::uint32_t> movedShapes, movedPlaced, changedShapes;  // things for which a message is due, each once
    double latest = 0, shift = 0;                                        // of the messages' times
    /// The shapes that use each geometry and appearance.
    std::unordered_map<std::uint32_t, std::unordered_set<std::uint32_t>> users;
    std::unordered_map<std::uint32_t, std::shared_ptr<const Mesh>> meshes;
    std::unordered_set<std::string> names;
    std::vector<std::string> gone;
    std::size_t entityBytes = 0;
    double wholeFrames = -INFINITY, wholeScene = -INFINITY;

    Impl(SharedWorld& w, MessageSink& s) : sink(s), world(w) {}
    ~Impl() override { world.remove(*this); }
    std::string subscriberName() const override { return "messages of the scene"; }

    std::string nameFor(const Scene& scene, const std::vector<NodeId>& path) {
        std::string name;
        for (const NodeId id : path)
            if (id != scene.root()) name += (name.empty() ? "" : "/") + labelOf(scene, id);
        std::string unique = name;
        for (int i = 2; !names.insert(unique).second; ++i) unique = fmt::format("{} ({})", name, i);
        return unique;
    }
    static void mark(bool& flag, std::vector<std::uint32_t>& list, std::uint32_t slot) {
        if (!std::exchange(flag, true)) list.push_back(slot);
    }
    void use(const Instance& instance) {
        for (const NodeId node : {instance.geometry, instance.appearance})
            if (node) users[node.value].insert(instance.id.slot);
    }
    void unuse(const Instance& instance) {
        for (const NodeId node : {instance.geometry, instance.appearance})
            if (const auto found = users.find(node.value); found != users.end()) {
                found->second.erase(instance.id.slot);
                if (found->second.empty()) users.erase(found);
            }
    }
    void forget(Items& items, InstanceId id) {
        const auto found = items.find(id.slot);
        if (found == items.end()) return;
        if (&items == &shapes) unuse(found->second.instance);
        names.erase(found->second.frame);
        entityBytes -= found->second.entity.size();
        if (&items == &shapes) gone.push_back(found->second.frame);
        items.erase(found);
    }
    void describe(const Scene& scene, Item& item) {
        const Node* geometry = scene.find(item.instance.geometry);
        const std::string color = colorOf(scene, item.instance.appearance);
        const auto scale = item.pose.scale();
        std::string body;
        const auto solid = [&](const char* list, const glm::dvec3& size, const std::string& more,
                               const glm::dquat& rotation) {
            body = fmt::format(R"("{}":[{{"pose":{},"size":{},{}"color":{}}}])", list, pose(rotation), vector(size),
                               more, color);
        };
        // X3D's cylinders have the axis y, the viewer's have z.
        const glm::dquat upright(std::sqrt(.5), -std::sqrt(.5), 0, 0);
        const glm::dquat none(1, 0, 0, 0);
        if (geometry && scale && geometry->is(x3d::Box::type)) {
            const Vec3f size = geometry->get(x3d::Box::size);
            solid("cubes", glm::dvec3(size.x, size.y, size.z) * *scale, "", none);
        } else if (geometry && scale && geometry->is(x3d::Sphere::type)) {
            solid("spheres", 2. * double(geometry->get(x3d::Sphere::radius)) * *scale, "", none);
        } else if (geometry && scale && geometry->is(x3d::Cylinder::type) && geometry->get(x3d::Cylinder::side) &&
                   geometry->get(x3d::Cylinder::top) && geometry->get(x3d::Cylinder::bottom)) {
            const double d = 2. * double(geometry->get(x3d::Cylinder::radius)),
                         h = geometry->get(x3d::Cylinder::height);
            solid("cylinders", {d * scale->x, d * scale->z, h * scale->y}, R"("bottom_scale":1,"top_scale":1,)",
                  upright);
        } else if (geometry && scale && geometry->is(x3d::Cone::type) && geometry->get(x3d::Cone::side) &&
                   geometry->get(x3d::Cone::bottom)) {
            const double d = 2. * double(geometry->get(x3d::Cone::bottomRadius)), h = geometry->get(x3d::Cone::height);
            solid("cylinders", {d * scale->x, d * scale->z, h * scale->y}, R"("bottom_scale":1,"top_scale":0,)",
                  upright);
        } else if (const auto mesh = meshes.find(item.instance.geometry.value);
                   !item.instance.volume && mesh != meshes.end() && mesh->second) {
            body = fmt::format(R"("triangles":[{{"pose":{},"color":{},"points":[)", pose(), color);
            const Mesh& m = *mesh->second;
            bool first = true;
            for (const Vec3f p : m.positions) {
                if (!std::exchange(first, false)) body += ',';
                body += vector(item.pose.rest * glm::dvec3(p.x, p.y, p.z));
            }
            body += "],\"indices\":[";
            for (std::uint32_t t = 0; t < m.triangleCount; ++t)
                for (std::uint32_t c = 0; c < 3; ++c)
                    body += fmt::format("{}{}", t + c ? "," : "", m.vertexIndex(t, c));
            body += "]}]";
        }
        entityBytes -= item.entity.size();
        const std::string name = jsonString(item.frame);
        item.entity = fmt::format(R"(,"frame_id":{},"id":{},"lifetime":{{"sec":0,"nsec":0}},"frame_locked":true,)"
                                  R"("metadata":[{{"key":"node","value":{}}}])",
                                  name, name, jsonString(labelOf(scene, item.instance.shape)));
        if (!body.empty()) item.entity += "," + body;
        item.entity += '}';
        entityBytes += item.entity.size();
    }

    /// Another session of a log may begin with an earlier time. It then goes on from the last one, as in
    /// Replayer::time().
    double inOrder(double time) {
        shift += std::max(0., latest - (time + shift));
        return latest = time + shift;
    }

    Result<> apply(const Scene& scene, const ChangeSet& set, const InstanceDelta& delta) override {
        take(scene, delta);
        const double t = inOrder(std::max(0., scene.now()));
        if (auto ok = writeFrames(t); !ok) return ok;
        if (auto ok = writeScene(scene, t); !ok) return ok;
        if (set.from == set.to) return {};  // a moved viewer is no state of its own
        if (auto ok = writeFields(scene, set, t); !ok) return ok;
        if (!sink.wants(changes)) return {};
        std::string text = fmt::format(R"({{"frame":{},"from":{},"t":{},"hash":"{}","changes":[)", set.to, set.from,
                                       set.time, set.hash.hex());
        for (const Change& change : set.changes) {
            if (&change != set.changes.data()) text += ',';
            appendChange(text, scene, change);
        }
        text += "]}";
        return sink.write(changes, t, std::move(text), Reach::wholeForAll);
    }

    void take(const Scene& scene, const InstanceDelta& delta) {
        const Flattener& flattener = world.flattener();
        for (const auto& geometry : delta.geometries) meshes[geometry.node.value] = geometry.mesh;
        for (const InstanceId id : delta.removed) forget(shapes, id);
        for (const InstanceId id : delta.placedRemoved) forget(placed, id);
        const auto add = [](Items& items, std::vector<std::uint32_t>& list, std::uint32_t slot, Item item) {
            Item& added = items.insert_or_assign(slot, std::move(item)).first->second;
            mark(added.moved, list, slot);
        };
        for (const Instance& i : delta.added) {
            if (i.boundingBox) continue;
            add(shapes, movedShapes, i.id.slot,
                {nameFor(scene, flattener.path(i.id)), ScaledPose(i.worldFromLocal), i, {}});
            mark(shapes.at(i.id.slot).changed, changedShapes, i.id.slot);
            use(i);
        }
        for (const Placed& p : delta.placedAdded)
            add(placed, movedPlaced, p.id.slot,
                {nameFor(scene, flattener.placedPath(p.id)), ScaledPose(p.worldFromLocal), {}, {}});
        for (const Instance& i : delta.rebound) {
            if (i.boundingBox) continue;
            Item& item = shapes.at(i.id.slot);
            unuse(item.instance);
            item.instance = i;
            use(i);
            mark(item.changed, changedShapes, i.id.slot);
        }
        for (const auto& moved : delta.moved) {
            const auto shape = shapes.find(moved.id.slot);
            if (shape == shapes.end()) continue;  // it is a bounding box
            Item& item = shape->second;
            const ScaledPose pose(moved.worldFromLocal);
            if (!pose.sameShape(item.pose)) mark(item.changed, changedShapes, moved.id.slot);
            item.pose = pose;
            mark(item.moved, movedShapes, moved.id.slot);
        }
        for (const auto& moved : delta.placedMoved) {
            Item& item = placed.at(moved.id.slot);
            item.pose = ScaledPose(moved.worldFromLocal);
            mark(item.moved, movedPlaced, moved.id.slot);
        }
        const auto touch = [&](NodeId node) {
            if (const auto found = users.find(node.value); found != users.end())
                for (const std::uint32_t slot : found->second) mark(shapes.at(slot).changed, changedShapes, slot);
        };
        for (const NodeId id : delta.appearanceChanged) touch(id);
        for (const auto& geometry : delta.geometries) touch(geometry.node);
        for (const NodeId id : delta.geometriesRemoved) meshes.erase(id.value);
    }

    /// Calls `each` for the due things on `list` that still exist, or with `whole` for all things.
    static void visit(Items& items, std::vector<std::uint32_t>& list, bool Item::* due, bool whole, const auto& each) {
        if (whole)
            for (auto& [slot, item] : items) {
                item.*due = false;
                each(item);
            }
        else
            for (const std::uint32_t slot : list)
                if (const auto found = items.find(slot); found != items.end())
                    if (std::exchange(found->second.*due, false)) each(found->second);
        list.clear();
    }

    Result<> writeFrames(double t) {
        if (!sink.wants(frames)) {  // who wants them later is told of all
            visit(shapes, movedShapes, &Item::moved, false, [](const Item&) {});
            visit(placed, movedPlaced, &Item::moved, false, [](const Item&) {});
            return {};
        }
        const bool due = !movedShapes.empty() || !movedPlaced.empty(), wanted = sink.wantsWhole(frames);
        if (!due && !wanted) return {};
        const bool whole =
            wanted || shapes.size() + placed.size() <= kWholeFrames || t - wholeFrames >= kWholeFramesEvery;
        if (whole) wholeFrames = t;
        std::string text = R"({"transforms":[)";
        bool first = true;
        const auto append = [&](const Item& item) {
            text += fmt::format(R"({}{{"timestamp":{},"parent_frame_id":"world","child_frame_id":{},)"
                                R"("translation":{},"rotation":{}}})",
                                std::exchange(first, false) ? "" : ",", moment(t), jsonString(item.frame),
                                vector(item.pose.position), quaternion(item.pose.rotation));
        };
        visit(shapes, movedShapes, &Item::moved, whole, append);
        visit(placed, movedPlaced, &Item::moved, whole, append);
        return sink.write(frames, t, text + "]}", reachOf(whole, due));
    }

    static Reach reachOf(bool whole, bool due) {
        return !whole ? Reach::change : due ? Reach::wholeForAll : Reach::wholeForNew;
    }

    Result<> writeScene(const Scene& scene, double t) {
        if (!sink.wants(entities)) {
            gone.clear();
            changedShapes.clear();  // those with their mark are described when somebody wants all
            return {};
        }
        const bool due = !gone.empty() || !changedShapes.empty(), wanted = sink.wantsWhole(entities);
        if (!due && !wanted) return {};
        const bool whole = wanted || entityBytes <= kWholeSceneBytes || t - wholeScene >= kWholeSceneEvery;
        if (whole) wholeScene = t;
        describeChanged(scene, whole);
        std::string text = R"({"deletions":[)";
        if (whole) gone.assign(1, "");
        for (std::size_t i = 0; i < gone.size(); ++i)
            text += fmt::format(R"({}{{"timestamp":{},"type":{},"id":{}}})", i ? "," : "", moment(t), whole ? 1 : 0,
                                jsonString(gone[i]));
        gone.clear();
        text += R"(],"entities":[)";
        bool first = true;
        visit(shapes, changedShapes, &Item::changed, whole, [&](const Item& item) {
            text += fmt::format(R"({}{{"timestamp":{})", std::exchange(first, false) ? "" : ",", moment(t));
            text += item.entity;
        });
        return sink.write(entities, t, text + "]}", reachOf(whole, due));
    }

    /// Describes the shapes on the list, or with `all` each that has changed since it was described.
    void describeChanged(const Scene& scene, bool all) {
        if (all) {
            for (auto& [slot, item] : shapes)
                if (item.changed) describe(scene, item);
            return;
        }
        for (const std::uint32_t slot : changedShapes)
            if (const auto found = shapes.find(slot); found != shapes.end() && found->second.changed)
                describe(scene, found->second);
    }

    /// Fields that a set changes, and those of which somebody wants to know the value.
    Result<> writeFields(const Scene& scene, const ChangeSet& set, double t) {
        if (chosen.empty()) return {};
        const auto mayMove = [](const Change& c) {
            return c.kind == ChangeKind::createNode || c.kind == ChangeKind::setName;
        };
        if (std::ranges::any_of(set.changes, mayMove)) lookForFields(scene);
        for (const Change& change : set.changes) {
            if (change.kind != ChangeKind::setField) continue;
            for (Chosen& one : chosen)
                if (one.field.node == change.node && one.field.field == change.field) one.due = true;
        }
        return writeValues(scene, t);
    }
    Result<> writeValues(const Scene& scene, double t) {
        for (Chosen& one : chosen) {
            const bool due = std::exchange(one.due, false);
            const Node* node = scene.find(one.field.node);
            if (!node || !sink.wants(one.topic) || !(due || sink.wantsWhole(one.topic))) continue;
            const Value value = node->value(one.field.field);
            if (auto ok = writeField(one, value, t, reachOf(true, due)); !ok) return ok;
        }
        return {};
    }
    Result<> writeField(const Chosen& one, const Value& value, double t, Reach reach) {
        return sink.write(
            one.topic, t,
            fmt::format(R"({{"timestamp":{},"value":{}}})", moment(t), printFieldText(value, TextSyntax::json)), reach);
    }
    void lookForFields(const Scene& scene) {
        for (Chosen& one : chosen) one.field = findField(scene, one.path).value_or(FieldRef{});
    }
};

namespace {

/// "DEF.field", or each field of "DEF.*" that sends events.
Result<std::vector<std::string>> fieldsNamed(const Scene& scene, const std::string& text) {
    if (!text.ends_with(".*")) {
        const auto found = findField(scene, text);
        if (!found) return std::unexpected(found.error());
        if (!scene.node(found->node).type().fields[found->field].readable())
            return fail(fmt::format("{}: an input has no value to show", text));
        return std::vector{text};
    }
    const std::string name = text.substr(0, text.size() - 2);
    const auto node = findNode(scene, name);
    if (!node) return std::unexpected(node.error());
    std::vector<std::string> all;
    for (const FieldDef& field : scene.node(*node).type().fields)
        if (!field.hidden && field.sends()) all.push_back(fmt::format("{}.{}", name, field.name));
    return all;
}

}  // namespace

SceneMessages::SceneMessages(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SceneMessages::~SceneMessages() = default;

Result<std::unique_ptr<SceneMessages>> SceneMessages::attach(SharedWorld& world, MessageSink& sink,
                                                             const std::vector<std::string>& fields) {
    auto impl = std::make_unique<Impl>(world, sink);
    const auto topic = [&](std::uint16_t& number, const std::string& name, const std::string& schemaName,
                           const std::string& schema, bool isState) {
        const auto added = sink.addTopic(name, schemaName, schema, isState);
        if (added) number = *added;
        return added ? Result<>{} : Result<>(std::unexpected(added.error()));
    };
    if (auto ok = topic(impl->frames, "/tf", "foxglove.FrameTransforms", frameTransformsSchema(), true); !ok)
        return std::unexpected(ok.error());
    if (auto ok = topic(impl->entities, "/scene", "foxglove.SceneUpdate", sceneUpdateSchema(), true); !ok)
        return std::unexpected(ok.error());
    if (auto ok = topic(impl->changes, "/rtsg/changes", "rtsg.Changes", changesSchema(), false); !ok)
        return std::unexpected(ok.error());
    const Scene& scene = world.scene();
    for (const std::string& text : fields) {
        const auto named = fieldsNamed(scene, text);
        if (!named) return std::unexpected(named.error());
        for (const std::string& path : *named) {
            const FieldRef field = *findField(scene, path);
            const FieldDef& definition = scene.node(field.node).type().fields[field.field];
            Impl::Chosen& one = impl->chosen.emplace_back(path, field);
            const std::string name =
                fmt::format("/fields/{}/{}", path.substr(0, path.rfind('.')), std::string_view(definition.name));
            if (auto ok = topic(one.topic, name, fmt::format("rtsg.{}", info(definition.type).name),
                                fieldSchema(definition.type), true);
                !ok)
                return std::unexpected(ok.error());
        }
    }
    world.add(*impl);
    if (const std::string why = world.failure(*impl); !why.empty()) return fail(why);
    return std::unique_ptr<SceneMessages>(new SceneMessages(std::move(impl)));
}

Result<> SceneMessages::offer() {
    const Scene& scene = impl_->world.scene();
    const double t = time();
    if (auto ok = impl_->writeFrames(t); !ok) return ok;
    if (auto ok = impl_->writeScene(scene, t); !ok) return ok;
    return impl_->writeValues(scene, t);
}

double SceneMessages::time() const {
    return impl_->inOrder(std::max(0., impl_->world.scene().now()));
}

std::string SceneMessages::failure() const {
    return impl_->world.failure(*impl_);
}

void SceneMessages::detach() {
    impl_->world.remove(*impl_);
}

}  // namespace rtsg
