// Pointing device sensors and Anchor: ISO/IEC 19775-1 V4.0, clauses 20 and 9.4.1. Pointers' events come to the root,
// which finds the sensors that they concern on the way from what was hit to the root; so sensors at rest cost nothing.
//
// What a pointer is over and what it has hold of is in hidden fields: of the root `_pointers` (where each was last) and
// `_pointed` (the sensors that any is over or has hold of), of a sensor `_devices`, `_holder` and `_grip`.
#include <algorithm>
#include <cmath>
#include <limits>

#include <rtsg/core/device_input.h>
#include <rtsg/core/geospatial.h>
#include <rtsg/core/x3d.h>

#include <rtsg/core/portable_math.h>
#include <rtsg/core/rotation.h>
#include "behaviour/behaviours.h"
#include "drag_geometry.h"
#include "scene/world_transforms.h"

namespace rtsg::behaviours {

namespace {

using R = x3d::RtsgScene;

enum class PointingKind : std::uint8_t { none, touch, geoTouch, plane, cylinder, sphere, anchor };

PointingKind kindOf(const Node& node) {
    if (node.is(x3d::TouchSensor::type)) return PointingKind::touch;
    if (node.is(x3d::GeoTouchSensor::type)) return PointingKind::geoTouch;
    if (node.is(x3d::PlaneSensor::type)) return PointingKind::plane;
    if (node.is(x3d::CylinderSensor::type)) return PointingKind::cylinder;
    if (node.is(x3d::SphereSensor::type)) return PointingKind::sphere;
    return node.is(x3d::Anchor::type) ? PointingKind::anchor : PointingKind::none;
}

/// Calls `f` with the node type of a sensor, as a template argument.
template <class F>
void withType(const Node& node, const F& f) {
    switch (kindOf(node)) {
        case PointingKind::touch:
            return f.template operator()<x3d::TouchSensor>();
        case PointingKind::geoTouch:
            return f.template operator()<x3d::GeoTouchSensor>();
        case PointingKind::plane:
            return f.template operator()<x3d::PlaneSensor>();
        case PointingKind::cylinder:
            return f.template operator()<x3d::CylinderSensor>();
        case PointingKind::sphere:
            return f.template operator()<x3d::SphereSensor>();
        case PointingKind::anchor:
            return f.template operator()<x3d::Anchor>();
        case PointingKind::none:
            return;
    }
}

/// The state of an active sensor that all kinds have.
struct Hold {
    Array<std::int32_t> devices;
    std::int32_t holder = 0;
    bool isOver(std::int32_t device) const { return std::ranges::find(devices, device) != devices.end(); }
};
Hold holdOf(const Node& node) {
    Hold hold;
    withType(node, [&]<class N>() { hold = {node.get(N::_devices), node.get(N::_holder)}; });
    return hold;
}

// ---- which sensors a hit concerns --------------------------------------------------------------------------------

struct Concerned {
    NodeId sensor;
    glm::dmat4 worldFromLocal{1};
};

bool isEnabledPointingSensor(const Node& node) {
    bool enabled = true;
    withType(node, [&]<class N>() {
        if constexpr (requires { N::enabled; }) enabled = node.get(N::enabled);
    });
    return enabled;
}

/// Sensors that are children of the group; a PROTO instance counts as its first node.
void appendSensors(const Scene& scene, const Node& group, const glm::dmat4& world, std::vector<Concerned>& out) {
    const std::string& role = group.type().role;
    if (role == "choice" || role == "level") return;  // one child is shown, and that is not the sensor
    for (const FieldIndex field : group.type().below) {
        if (group.type().fields[field].type != FieldType::MFNode) continue;
        for (const NodeId child : group.get(Field<Array<NodeId>>{field})) {
            const Node* node = scene.find(child);
            if (node && node->type().kind != NodeType::Kind::builtin) node = scene.effectiveNode(child);
            if (!node) continue;
            const PointingKind kind = kindOf(*node);
            if (kind != PointingKind::none && kind != PointingKind::anchor && isEnabledPointingSensor(*node))
                out.push_back({node->id(), world});
        }
    }
}

/// 20.2.1: the lowest enabled sensors above the hit, all of them that share a group.
std::vector<Concerned> concerned(const Scene& scene, const PointerHit& hit) {
    const std::vector<NodeId>& path = hit.path;
    std::vector<glm::dmat4> worlds;
    glm::dmat4 world(1);
    auto placed = hit.byPicture.begin();
    for (const NodeId id : path) {
        const Node* node = scene.find(id);
        if (!node) break;
        const bool byPicture = placed != hit.byPicture.end() && placed->at == worlds.size();
        world *= byPicture ? glm::dmat4((placed++)->parentFromLocal) : parentFromLocal(scene, *node);
        worlds.push_back(world);
    }
    std::vector<Concerned> found;
    for (std::size_t i = worlds.size(); i-- > 0 && found.empty();) {
        const Node& node = scene.node(path[i]);
        if (kindOf(node) == PointingKind::anchor) found.push_back({node.id(), worlds[i]});
        appendSensors(scene, node, worlds[i], found);
    }
    if (found.empty()) appendSensors(scene, scene.node(scene.root()), glm::dmat4(1), found);
    return found;
}

// ---- drags -------------------------------------------------------------------------------------------------------

/// X3DDragSensorNode::_grip: how a drag began.
struct Grip {
    glm::dmat4 localFromWorld{1};
    glm::dvec3 start{0};  // the point that was hit
    bool disk = false, far = false, moved = false;
    double facing = 0, beside = 0;  // cylinder: OnCylinder of the first ray
    double last = 0, turned = 0;    // disk: the angle of the last ray, and all turns so far
    static constexpr std::size_t kNumbers = 16 + 3 + 3 + 4;

    Array<double> toValue() const {
        Array<double> v = Array<double>::ofSize(kNumbers);
        double* out = v.mutableData();
        for (int i = 0; i < 16; ++i) *out++ = localFromWorld[i / 4][i % 4];
        for (const double number :
             {start.x, start.y, start.z, double(disk), double(far), double(moved), facing, beside, last, turned})
            *out++ = number;
        return v;
    }
    static std::optional<Grip> fromValue(const Array<double>& v) {
        if (v.size() != kNumbers) return std::nullopt;
        Grip g;
        for (std::size_t i = 0; i < 16; ++i) g.localFromWorld[int(i / 4)][int(i % 4)] = v[i];
        g.start = {v[16], v[17], v[18]};
        g.disk = v[19] != 0;
        g.far = v[20] != 0;
        g.moved = v[21] != 0;
        g.facing = v[22];
        g.beside = v[23];
        g.last = v[24];
        g.turned = v[25];
        return g;
    }
    DragRay local(const PointerInput& input) const {
        return {localFromWorld * glm::dvec4(input.origin, 1), localFromWorld * glm::dvec4(input.direction, 0)};
    }
};

DragRay turned(const glm::dquat& by, const DragRay& ray) {
    return {by * ray.origin, by * ray.direction};
}
/// Whether the numbers are finite, also as floats.
bool isFinite(const glm::dvec3& v) {
    return glm::length(v) < double(std::numeric_limits<float>::max());
}

void begin(const Node&, const x3d::PlaneSensor*, const DragRay&, Grip&) {}  // a plane through the point that was hit
/// 20.4.1: seen along its axis it is a disk, else a cylinder through the point that was hit.
void begin(const Node& node, const x3d::CylinderSensor*, const DragRay& local, Grip& grip) {
    using N = x3d::CylinderSensor;
    const glm::dquat toSensor = glm::conjugate(toQuaternion(node.get(N::axisRotation)));
    const DragRay ray = turned(toSensor, local);
    const glm::dvec3 start = toSensor * grip.start;
    const double along = std::abs(ray.direction.y) / glm::length(ray.direction);
    grip.disk = portable::acos(std::min(1.0, along)) < node.get(N::diskAngle);
    grip.last = rotationAboutY(start);
    grip.far = leavesCylinder(ray, start);
    if (const auto on = onCylinder(ray, portable::hypot(start.x, start.z), grip.far); on && !grip.disk) {
        grip.facing = on->facing;
        grip.beside = on->beside;
    }
}
void begin(const Node&, const x3d::SphereSensor*, const DragRay& local, Grip& grip) {
    grip.far = leavesSphere(local, grip.start);
}

/// 20.4.2. Offset and clamping as X_ITE and x3dom have them with an axisRotation, where the clause leaves it open:
/// outputs are in the node's own coordinates, limits in the turned ones.
void track(Cascade& cascade, const Node& node, const x3d::PlaneSensor*, const DragRay& ray, Grip& grip) {
    using N = x3d::PlaneSensor;
    const glm::dquat axes = toQuaternion(node.get(N::axisRotation));
    const auto point = onPlane(ray, grip.start, axes * glm::dvec3(0, 0, 1));
    if (!point || !isFinite(*point)) return;
    glm::dvec3 moved = glm::conjugate(axes) * (*point - grip.start + glm::dvec3(node.get(N::offset)));
    const Vec2f low = node.get(N::minPosition), high = node.get(N::maxPosition);
    if (low.x <= high.x) moved.x = std::clamp<double>(moved.x, low.x, high.x);
    if (low.y <= high.y) moved.y = std::clamp<double>(moved.y, low.y, high.y);
    if (!isFinite(moved)) return;
    grip.moved = true;
    cascade.emit(node, N::trackPoint_changed, Vec3f(*point));
    cascade.emit(node, N::translation_changed, Vec3f(axes * moved));
}

void track(Cascade& cascade, const Node& node, const x3d::CylinderSensor*, const DragRay& local, Grip& grip) {
    using N = x3d::CylinderSensor;
    const glm::dquat axes = toQuaternion(node.get(N::axisRotation)), toSensor = glm::conjugate(axes);
    const DragRay ray = turned(toSensor, local);
    const glm::dvec3 start = toSensor * grip.start;
    glm::dvec3 point;
    if (grip.disk) {
        const auto on = onPlane(ray, start, {0, 1, 0});
        if (!on || !isFinite(*on)) return;
        point = *on;
        const double angle = rotationAboutY(point);
        grip.turned += wrapped(angle - std::exchange(grip.last, angle));
    } else {
        const double radius = portable::hypot(start.x, start.z);
        const auto on = radius > 0 ? onCylinder(ray, radius, grip.far) : std::nullopt;
        if (!on || !isFinite(on->point) || !std::isfinite(on->beside)) return;
        point = on->point;
        grip.turned = wrapped(on->facing - grip.facing) + on->beside - grip.beside;
    }
    double angle = node.get(N::offset) + grip.turned;
    const double low = node.get(N::minAngle), high = node.get(N::maxAngle);
    if (low <= high) angle = std::clamp(angle, low, high);
    if (!(std::abs(angle) < 1e9)) return;  // beyond, a float knows no angle
    const glm::vec3 axis(axes * glm::dvec3(0, 1, 0));
    grip.moved = true;
    cascade.emit(node, N::trackPoint_changed, Vec3f(axes * point));
    cascade.emit(node, N::rotation_changed, Rotation{axis.x, axis.y, axis.z, static_cast<float>(angle)});
}

void track(Cascade& cascade, const Node& node, const x3d::SphereSensor*, const DragRay& ray, Grip& grip) {
    using N = x3d::SphereSensor;
    const double radius = glm::length(grip.start);
    const auto point = radius > 0 ? onSphere(ray, radius, grip.far) : std::nullopt;
    if (!point || !isFinite(*point) || !(glm::length(*point) > 0)) return;
    const glm::dquat all = shortestRotation(grip.start, *point) * toQuaternion(node.get(N::offset));
    grip.moved = true;
    cascade.emit(node, N::trackPoint_changed, Vec3f(*point));
    cascade.emit(node, N::rotation_changed, toRotation(all));
}

void keepOffset(Cascade& cascade, const Node& node, const x3d::PlaneSensor*) {
    cascade.emit(node, x3d::PlaneSensor::offset, node.get(x3d::PlaneSensor::translation_changed));
}
void keepOffset(Cascade& cascade, const Node& node, const x3d::CylinderSensor*) {
    cascade.emit(node, x3d::CylinderSensor::offset, node.get(x3d::CylinderSensor::rotation_changed).angle);
}
void keepOffset(Cascade& cascade, const Node& node, const x3d::SphereSensor*) {
    cascade.emit(node, x3d::SphereSensor::offset, node.get(x3d::SphereSensor::rotation_changed));
}

// ---- one event of one pointer --------------------------------------------------------------------------------------

class PointerEvent {
  public:
    PointerEvent(Cascade& cascade, const Node& root, const PointerInput& input)
        : cascade_(cascade), scene_(cascade.scene()), root_(root), input_(input) {
        if (input.hit) concerned_ = concerned(scene_, *input.hit);
        const auto& pointed = root.get(R::_pointed);
        pointed_.assign(pointed.begin(), pointed.end());
    }

    void go() {
        const std::uint32_t before = remember();
        const bool down = input_.buttons & PointerInput::kPrimary, wasDown = before & PointerInput::kPrimary;
        std::vector<NodeId> grabbed;
        for (const NodeId id : pointed_)
            if (holdOf(scene_.node(id)).holder == input_.device + 1) grabbed.push_back(id);
        if (grabbed.empty()) {
            enterAndLeave({});
            touch();
            if (down && !wasDown)
                for (const Concerned& one : concerned_) press(one);
        } else {
            // 20.2.2: no others hear of this pointer until it lets go.
            enterAndLeave(grabbed);
            touch();
            for (const NodeId id : grabbed) drag(scene_.node(id));
            if (!down) {
                for (const NodeId id : grabbed) release(scene_.node(id));
                enterAndLeave({});
            }
        }
        std::erase_if(pointed_, [&](NodeId id) {
            const Hold hold = holdOf(scene_.node(id));
            return hold.devices.empty() && hold.holder == 0;
        });
        const Array<NodeId> pointed{std::span<const NodeId>(pointed_)};
        if (pointed != root_.get(R::_pointed)) cascade_.store(root_, R::_pointed, pointed);
    }

  private:
    /// Keeps where the pointer is; returns the buttons that were down before.
    std::uint32_t remember() {
        constexpr std::size_t kRow = 9;
        Array<double> rows = root_.get(R::_pointers);
        std::size_t at = 0;
        while (at + kRow <= rows.size() && rows[at] != input_.device) at += kRow;
        const bool isNew = at + kRow > rows.size();
        const std::uint32_t before = isNew ? 0 : static_cast<std::uint32_t>(rows[at + 1]);
        const Array<double> now = input_.toValue();
        if (isNew) rows.resize(at + kRow);
        double* row = rows.mutableData() + at;
        moved_ = isNew;
        for (std::size_t i = 0; i < kRow; ++i) {
            moved_ |= i >= 2 && row[i] != now[i];
            row[i] = now[i];
        }
        cascade_.store(root_, R::_pointers, rows);
        return before;
    }

    bool isConcerned(NodeId sensor) const {
        return std::ranges::find(concerned_, sensor, &Concerned::sensor) != concerned_.end();
    }

    void setDevices(const Node& node, const Array<std::int32_t>& devices) {
        withType(node, [&]<class N>() {
            [[maybe_unused]] const bool was = !node.get(N::_devices).empty(), is = !devices.empty();
            cascade_.store(node, N::_devices, devices);
            if constexpr (requires { N::isOver; })
                if (was != is) cascade_.emit(node, N::isOver, is);
        });
    }

    /// `only`: those that the pointer has hold of; all if empty.
    void enterAndLeave(const std::vector<NodeId>& only) {
        const auto counts = [&](NodeId id) { return only.empty() || std::ranges::find(only, id) != only.end(); };
        for (const NodeId id : pointed_) {
            Hold hold = holdOf(scene_.node(id));
            const auto at = std::ranges::find(hold.devices, input_.device);
            if (at == hold.devices.end() || !counts(id) || isConcerned(id)) continue;
            hold.devices.erase(static_cast<std::size_t>(at - hold.devices.begin()));
            setDevices(scene_.node(id), hold.devices);
        }
        for (const Concerned& one : concerned_) {
            Hold hold = holdOf(scene_.node(one.sensor));
            if (!counts(one.sensor) || hold.isOver(input_.device)) continue;
            hold.devices.push_back(input_.device);
            entered_.push_back(one.sensor);
            if (std::ranges::find(pointed_, one.sensor) == pointed_.end()) pointed_.push_back(one.sensor);
            setDevices(scene_.node(one.sensor), hold.devices);
        }
    }

    /// 20.4.4, 25.3.9: where on the surface, for every movement over a TouchSensor, in its own coordinates.
    void touch() {
        for (const Concerned& one : concerned_) {
            const Node& node = scene_.node(one.sensor);
            const Hold hold = holdOf(node);
            const bool free = hold.holder == 0 || hold.holder == input_.device + 1;
            const bool entered = std::ranges::find(entered_, one.sensor) != entered_.end();
            const PointingKind kind = kindOf(node);
            if (kind != PointingKind::touch && kind != PointingKind::geoTouch) continue;
            if (!free || !hold.isOver(input_.device) || !(moved_ || entered)) continue;
            const PointerHit& hit = *input_.hit;
            const glm::dvec3 point = glm::inverse(one.worldFromLocal) * glm::dvec4(hit.point, 1);
            const glm::dvec3 normal = glm::transpose(glm::dmat3(one.worldFromLocal)) * hit.normal;
            if (!isFinite(point) || !isFinite(normal) || !(glm::length(normal) > 0)) continue;
            withType(node, [&]<class N>() {
                if constexpr (requires { N::hitPoint_changed; }) {
                    cascade_.emit(node, N::hitPoint_changed, Vec3f(point));
                    cascade_.emit(node, N::hitNormal_changed, Vec3f(glm::normalize(normal)));
                    cascade_.emit(node, N::hitTexCoord_changed, Vec2f(hit.texCoord));
                }
            });
            if (kind == PointingKind::geoTouch) sendCoordinates(node, point);
        }
    }
    void sendCoordinates(const Node& node, const glm::dvec3& point) {
        const auto reference = GeoReference::of(scene_, node);
        if (!reference) return cascade_.warn(node, reference.error().text);
        const Vec3d coordinates = reference->fromScene(point);
        if (isFinite(coordinates)) cascade_.emit(node, x3d::GeoTouchSensor::hitGeoCoord_changed, coordinates);
    }

    void press(const Concerned& one) {
        const Node& node = scene_.node(one.sensor);
        if (holdOf(node).holder != 0) return;  // another pointer's
        withType(node, [&]<class N>() {
            if constexpr (requires { N::_grip; }) {
                Grip grip;
                grip.localFromWorld = glm::inverse(one.worldFromLocal);
                grip.start = grip.localFromWorld * glm::dvec4(input_.hit->point, 1);
                if (!isFinite(grip.start)) return;  // drawn flat: no way back from the world to its coordinates
                begin(node, static_cast<const N*>(nullptr), grip.local(input_), grip);
                cascade_.store(node, N::_grip, grip.toValue());
            }
            cascade_.store(node, N::_holder, input_.device + 1);
            if constexpr (requires { N::isActive; }) cascade_.emit(node, N::isActive, true);
        });
    }

    void drag(const Node& node) {
        if (!moved_ || input_.kind != PointerInput::Kind::ray) return;
        withType(node, [&]<class N>() {
            if constexpr (requires { N::_grip; }) {
                auto grip = Grip::fromValue(node.get(N::_grip));
                if (!grip) return;
                track(cascade_, node, static_cast<const N*>(nullptr), grip->local(input_), *grip);
                cascade_.store(node, N::_grip, grip->toValue());
            }
        });
    }

    void release(const Node& node) {
        const bool isOver = holdOf(node).isOver(input_.device);
        withType(node, [&]<class N>() {
            cascade_.store(node, N::_holder, 0);
            if constexpr (requires { N::isActive; }) cascade_.emit(node, N::isActive, false);
            if constexpr (requires { N::touchTime; })
                if (isOver) cascade_.emit(node, N::touchTime, Time{cascade_.now()});
            if constexpr (requires { N::_grip; }) {
                const auto grip = Grip::fromValue(node.get(N::_grip));
                cascade_.store(node, N::_grip, Array<double>());
                if (grip && grip->moved && node.get(N::autoOffset))
                    keepOffset(cascade_, node, static_cast<const N*>(nullptr));
            }
        });
        if (isOver && kindOf(node) == PointingKind::anchor) activate(node);
    }

    /// 9.4.1: "#Name" binds a viewpoint of this file; other urls are loaded by the application.
    void activate(const Node& anchor) {
        cascade_.emit(root_, R::anchor, static_cast<std::int32_t>(anchor.id().value));
        for (const String& url : anchor.get(x3d::Anchor::url)) {
            if (!url.view().starts_with('#')) continue;
            const Node* view = scene_.find(scene_.findName(url.view().substr(1), anchor.scope()));
            if (!view || !view->type().isA("X3DViewpointNode")) continue;
            const FieldIndex bind = view->type().findExact("set_bind");
            if (bind != kNoField) (void)cascade_.deliver(view->id(), bind, Value(true));
            return;
        }
        // An Anchor reports urls that lead nowhere only if it has no url for the application to load.
        const Array<String>& urls = anchor.get(x3d::Anchor::url);
        if (!urls.empty() && std::ranges::all_of(urls, [](const String& url) { return url.view().starts_with('#'); }))
            cascade_.warn(anchor, "there is no viewpoint '" + urls[0].str().substr(1) + "' to bind");
    }

    Cascade& cascade_;
    const Scene& scene_;
    const Node& root_;
    const PointerInput& input_;
    std::vector<Concerned> concerned_;
    std::vector<NodeId> pointed_, entered_;
    bool moved_ = false;
};

/// A sensor that is disabled lets go of what it has.
template <class N>
void pointingSensorOnEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    if (field != N::enabled.index || value.as<bool>()) return;
    cascade.store(node, N::_holder, 0);
    cascade.store(node, N::_devices, Array<std::int32_t>());
    if (node.get(N::isActive)) cascade.emit(node, N::isActive, false);
    if (node.get(N::isOver)) cascade.emit(node, N::isOver, false);
}

/// 23.4.2: whose geometry the avatar is in contact with, from now on.
void feel(Cascade& cascade, const Node& root, const Array<std::int32_t>& numbers) {
    using N = x3d::Collision;
    const Scene& scene = cascade.scene();
    Array<NodeId> now;
    for (const std::int32_t number : numbers) {
        const Node* node = number > 0 ? scene.find(NodeId{static_cast<std::uint32_t>(number)}) : nullptr;
        if (node && node->is(N::type) && node->get(N::enabled) && std::ranges::find(now, node->id()) == now.end())
            now.push_back(node->id());
    }
    const Array<NodeId> before = root.get(R::_contacts);
    cascade.store(root, R::_contacts, now);
    for (const NodeId id : before)
        if (std::ranges::find(now, id) == now.end() && scene.node(id).get(N::isActive))
            cascade.emit(scene.node(id), N::isActive, false);
    for (const NodeId id : now) {
        if (scene.node(id).get(N::isActive)) continue;
        cascade.emit(scene.node(id), N::isActive, true);
        cascade.emit(scene.node(id), N::collideTime, Time{cascade.now()});
    }
}

void collisionOnEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    using N = x3d::Collision;
    if (field == N::enabled.index && !value.as<bool>() && node.get(N::isActive)) cascade.emit(node, N::isActive, false);
}

}  // namespace

void rootOnEvent(Cascade& cascade, const Node& root, FieldIndex field, EventValue value) {
    if (field == R::contact.index) return feel(cascade, root, value.as<Array<std::int32_t>>());
    if (field == R::picked.index) return pickedOnEvent(cascade, root, value);
    if (field == R::navigate.index) return viewerOnEvent(cascade, root, value);
    if (field == R::heard.index) return heardOnEvent(cascade, root, value);
    if (field == R::key.index || field == R::text.index) return keysOnEvent(cascade, root, field, value);
    if (field != R::pointer.index) return;
    const auto input = PointerInput::fromValue(value.as<Array<double>>());
    if (input)
        PointerEvent(cascade, root, *input).go();
    else
        cascade.warn(root, input.error().text);
}

void appendPointing(std::vector<BuiltinBehaviour>& table) {
    const auto add = [&](TypeIndex type, auto onEvent) { table.push_back({type, {.onEvent = onEvent}}); };
    add(x3d::TouchSensor::type, pointingSensorOnEvent<x3d::TouchSensor>);
    add(x3d::GeoTouchSensor::type, pointingSensorOnEvent<x3d::GeoTouchSensor>);
    add(x3d::PlaneSensor::type, pointingSensorOnEvent<x3d::PlaneSensor>);
    add(x3d::CylinderSensor::type, pointingSensorOnEvent<x3d::CylinderSensor>);
    add(x3d::SphereSensor::type, pointingSensorOnEvent<x3d::SphereSensor>);
    add(x3d::Collision::type, collisionOnEvent);
}

}  // namespace rtsg::behaviours
