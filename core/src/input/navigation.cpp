// Moves the viewer by a frame's keys, wheels and pointers, before the frame begins.
#include <rtsg/core/navigation.h>

#include <algorithm>
#include <cmath>
#include <unordered_set>

#include <rtsg/core/device_input.h>
#include <rtsg/core/geospatial.h>
#include <rtsg/core/x3d.h>

#include <rtsg/core/portable_math.h>
#include <rtsg/core/rotation.h>
#include "avatar.h"
#include "avatar_sweep.h"
#include "scene/view_pose.h"
#include "state/state.h"
#include "viewer_move.h"

namespace rtsg {

namespace {

using Root = x3d::RtsgScene;
using Key = NavigationState::Key;

constexpr double kRotationRate = M_PI / 4;  // radians a second, of keys
constexpr double kOrbitPerHalf = M_PI / 2;  // radians, of a drag by half the picture's smaller side
constexpr double kWheelStep = .9;           // of the distance to the centre
constexpr double kWheelSeconds = .25;       // at NavigationInfo's speed
constexpr double kLargestZoom = 1e6;
/// Buttons whose drag moves the viewer along the picture in EXAMINE.
constexpr std::uint32_t kPanButtons = PointerInput::kSecondary | PointerInput::kMiddle;
constexpr double kPanRate = .5;  // halves of the picture a second, of keys

/// The events of a frame's queue that navigation answers.
struct Devices {
    double seconds = 0;  // since the frame before
    Vec2d wheel{0};
    Vec2d rotation{0};  // radians to the right and up, of a gamepad's stick
    std::vector<KeyInput> keys;
    std::optional<PointerInput> pointer;  // number 0
    bool anyMoved = true;                 // geometry or views, since the frame before
};

const Node* boundInfo(const Scene& scene) {
    const Node* info = topOfStack(scene, "_navigationStack");
    return info && info->is(x3d::NavigationInfo::type) ? info : nullptr;
}

/// Half the angle that the picture's smaller side shows.
double halfAngle(const Node& view) {
    return std::clamp(fieldOfViewOf(&view), 1e-6, M_PI - 1e-6) / 2;
}

/// Whether a sensor or an Anchor has hold of the pointer.
bool isHeld(const Scene& scene, std::int32_t device) {
    for (const NodeId id : scene.node(scene.root()).get(Root::_pointed)) {
        const Node* node = scene.find(id);
        const FieldIndex holder = node ? node->type().findExact("_holder") : kNoField;
        if (holder != kNoField && node->get(Field<std::int32_t>{holder}) == device + 1) return true;
    }
    return false;
}
/// The buttons that were down before this frame.
std::uint32_t buttonsBefore(const Scene& scene, std::int32_t device) {
    constexpr std::size_t kRow = 9;  // device, buttons, kind, bearing
    const auto& rows = scene.node(scene.root()).get(Root::_pointers);
    for (std::size_t k = 0; k + kRow <= rows.size(); k += kRow)
        if (rows[k] == device) return static_cast<std::uint32_t>(rows[k + 1]);
    return 0;
}

/// Half the smaller side of what an OrthoViewpoint shows, in metres.
double halfExtent(const Node& orthoViewpoint) {
    const auto [left, bottom, right, top] = extentOf(orthoViewpoint);
    return std::min(right - left, top - bottom) / 2;
}
/// The zoom at which a ball fills the picture's smaller side; 1 for a perspective.
double zoomTo(const Node& view, double radius) {
    if (!view.is(x3d::OrthoViewpoint::type) || !(radius > 0)) return 1;
    const double now = viewOf(view)->zoom, zoom = now * halfExtent(view) / radius;
    return std::isfinite(zoom) ? std::clamp(zoom, 1 / kLargestZoom, kLargestZoom) : 1;
}

std::uint32_t keyBit(ActionKey key) {
    constexpr std::pair<ActionKey, std::uint32_t> kBits[] = {{ActionKey::up, Key::kUp},
                                                             {ActionKey::down, Key::kDown},
                                                             {ActionKey::left, Key::kLeft},
                                                             {ActionKey::right, Key::kRight},
                                                             {ActionKey::alt, Key::kAlt}};
    const auto* found = std::ranges::find(kBits, key, &std::pair<ActionKey, std::uint32_t>::first);
    return found == std::end(kBits) ? 0 : found->second;
}
std::optional<ViewpointChoice> choiceOf(ActionKey key) {
    if (key == ActionKey::home) return ViewpointChoice::first;
    if (key == ActionKey::end) return ViewpointChoice::last;
    if (key == ActionKey::pageUp) return ViewpointChoice::previous;
    if (key == ActionKey::pageDown) return ViewpointChoice::next;
    return std::nullopt;
}

/// The corner `i` of 8 of a shape's box.
glm::dvec3 cornerOf(const ShapeBox& box, int i) {
    return {i & 1 ? box.low.x : box.high.x, i & 2 ? box.low.y : box.high.y, i & 4 ? box.low.z : box.high.z};
}

/// 23.4.7: whether the viewpoints in a ViewpointGroup may be chosen from where the viewer is.
bool isOffered(const Scene& scene, const Node& group) {
    using G = x3d::ViewpointGroup;
    if (!group.get(G::displayed)) return false;
    const Vec3f size = group.get(G::size);
    if (size == Vec3f(0) || size.x < 0 || size.y < 0 || size.z < 0) return true;  // no box
    const auto world = worldAround(scene, group.id());
    if (!world) return false;
    const glm::dvec3 viewer = glm::inverse(*world) * glm::dvec4(viewerPose(scene).position, 1);
    const glm::dvec3 away = glm::abs(viewer - glm::dvec3(group.get(G::center)));
    return glm::all(glm::lessThanEqual(away * 2.0, glm::dvec3(size)));
}

/// None if there is none; `current` counts as before the first if it is none of them.
NodeId chosenViewpoint(const Scene& scene, NodeId current, ViewpointChoice choice) {
    const std::vector<NodeId> all = viewpoints(scene);
    if (all.empty()) return {};
    const auto at = std::ranges::find(all, current);
    switch (choice) {
        case ViewpointChoice::first:
            return all.front();
        case ViewpointChoice::last:
            return all.back();
        case ViewpointChoice::previous:
            return at == all.begin() || at == all.end() ? all.back() : *(at - 1);
        case ViewpointChoice::next:
            return at == all.end() || at + 1 == all.end() ? all.front() : *(at + 1);
    }
    return {};
}

/// One frame's navigation from one viewpoint.
class Navigator {
  public:
    Navigator(const Scene& scene, SpaceQueries* queries, const Node& view, const ViewFields& fields,
              const glm::dmat4& world)
        : scene_(scene),
          queries_(queries),
          view_(view),
          fields_(fields),
          world_(world),
          worldNormal_(glm::transpose(glm::dmat3(world))),
          info_(boundInfo(scene)),
          type_(navigationType(scene)),
          before_(NavigationState::fromValue(scene.node(scene.root()).get(Root::_navigation))),
          state_(before_),
          start_(*viewOf(view)),
          pose_(start_) {
        if (state_.viewpoint == view.id()) return;
        state_.walking = state_.dragging = false;
        state_.fallSpeed = 0;
    }

    /// `bind`: the viewpoint that a key asks for.
    std::optional<ViewerMove> answer(const Devices& devices, NodeId& bind) {
        ViewerMove move;
        move.viewpoint = view_.id();
        const bool rests = type_ == NavigationType::none || !view_.get(fields_.transition).empty();
        if (!rests) steer(devices);
        readKeys(devices.keys, bind);
        if (devices.pointer) readPointer(*devices.pointer, move, rests);
        if (type_ == NavigationType::none) state_ = {};
        if (move.kind == ViewerMove::Kind::stay && pose_ != start_) move.kind = ViewerMove::Kind::jump;
        if (bind && bind == view_.id()) goBack(move);
        move.offset = target_ ? *target_ : relative(authorsView(view_, fields_), pose_);
        const bool idle = state_.held == 0 && !state_.dragging && !state_.walking;
        state_.viewpoint = idle ? NodeId{} : view_.id();
        if (idle) state_ = {};
        move.state = state_;
        if (!isFinite(move.offset)) return std::nullopt;
        if (move.kind == ViewerMove::Kind::stay && state_ == before_) return std::nullopt;
        return move;
    }

  private:
    /// The viewpoint is bound already: back to where its author put it.
    void goBack(ViewerMove& move) {
        if (userOffset(view_, fields_) == ViewerPose{}) return;
        move.kind = ViewerMove::Kind::animate;
        target_ = ViewerPose{};
    }

    bool isDown(Key key) const { return (state_.held & key) != 0; }
    /// -1, 0 or 1
    double between(Key less, Key more) const { return double(isDown(more)) - double(isDown(less)); }
    double speed() const {
        const double speed = (info_ ? info_->get(x3d::NavigationInfo::speed) : 1.0f) * geoFactor();
        return std::isfinite(speed) && speed > 0 ? speed : 0;
    }
    /// 25.3.11: the higher the viewer is above the ellipsoid, the faster he goes: at the NavigationInfo's speed on the
    /// ground, at a tenth of the height a second far above it.
    double geoFactor() const {
        if (!view_.is(x3d::GeoViewpoint::type)) return 1;
        const auto reference = GeoReference::of(scene_, view_);
        const auto at = reference ? geoTransform(scene_, view_) : std::unexpected(reference.error());
        if (!at) return 1;
        const GeoSystem& own = reference->system();
        const Vec3d there = reference->fromScene(Vec3d(*at * glm::dvec4(pose_.position, 1)));
        GeoSystem geodetic;
        geodetic.ellipsoid = own.ellipsoid;
        const double height = geodetic.fromGeocentric(own.toGeocentric(there)).z;
        return (1 + std::max(0.0, height) / 10) * double{view_.get(x3d::GeoViewpoint::speedFactor)};
    }
    Avatar avatar() const {
        Avatar avatar;
        if (!info_) return avatar;
        const auto& size = info_->get(x3d::NavigationInfo::avatarSize);
        double* const parts[] = {&avatar.radius, &avatar.height, &avatar.step};
        for (std::size_t i = 0; i < std::min<std::size_t>(3, size.size()); ++i)
            if (std::isfinite(size[i]) && size[i] >= 0) *parts[i] = size[i];
        return avatar;
    }

    // ---- steering ----------------------------------------------------------------------------------------------

    bool examines() const { return type_ == NavigationType::examine || type_ == NavigationType::lookAt; }
    bool isOrtho() const { return view_.is(x3d::OrthoViewpoint::type); }

    void steer(const Devices& devices) {
        if (examines())
            examine(devices);
        else
            travel(devices);
        if (devices.pointer) drag(*devices.pointer);
    }

    glm::dvec3 center() const { return centerOfRotation(scene_, view_, fields_); }

    void orbit(double right, double up) {
        if (right != 0 || up != 0) pose_ = orbited(pose_, center(), -right, up);
    }
    /// Along the picture, in halves of its smaller side at the centre's distance; what is seen goes the other way.
    void pan(double right, double up) {
        if (right == 0 && up == 0) return;
        const double depth = std::abs(glm::dot(center() - pose_.position, pose_.orientation * glm::dvec3(0, 0, -1)));
        const double half = isOrtho() ? halfExtent(view_) : portable::tan(halfAngle(view_)) * std::max(depth, 1e-6);
        pose_.position += pose_.orientation * glm::dvec3(right * half, up * half, 0);
    }
    void examine(const Devices& devices) {
        const double right = between(Key::kLeft, Key::kRight), up = between(Key::kDown, Key::kUp);
        const double angle = isDown(Key::kAlt) ? 0 : kRotationRate * devices.seconds;
        if (isDown(Key::kAlt)) pan(right * kPanRate * devices.seconds, up * kPanRate * devices.seconds);
        orbit(right * angle + devices.rotation.x, up * angle + devices.rotation.y);
        if (devices.wheel.y == 0) return;
        // Nearness changes nothing in a parallel projection (23.4.5).
        if (const double nearer = portable::pow(kWheelStep, -devices.wheel.y); isOrtho())
            pose_.zoom = std::clamp(pose_.zoom / nearer, 1 / kLargestZoom, kLargestZoom);
        else
            pose_.position = center() + (pose_.position - center()) * nearer;
    }

    void travel(const Devices& devices) {
        const bool walks = type_ == NavigationType::walk;
        glm::dvec3 ahead = pose_.orientation * glm::dvec3(0, 0, -1), up = pose_.orientation * glm::dvec3(0, 1, 0);
        const glm::dvec3 aside = pose_.orientation * glm::dvec3(1, 0, 0);
        if (walks) {
            const glm::dvec3 given = ahead;
            ahead.y = 0;
            if (!(glm::length(ahead) > 1e-9)) ahead = {up.x * -given.y, 0, up.z * -given.y};
            ahead = glm::length(ahead) > 1e-9 ? glm::normalize(ahead) : glm::dvec3(0, 0, -1);
            up = glm::dvec3(0);
        }
        const double length = speed() * devices.seconds, wheel = speed() * kWheelSeconds;
        const bool alt = isDown(Key::kAlt);
        const double forward = between(Key::kDown, Key::kUp), right = between(Key::kLeft, Key::kRight);
        glm::dvec3 motion = ahead * (-devices.wheel.y * wheel) + aside * (devices.wheel.x * wheel);
        motion += (alt && !walks ? up : ahead) * (forward * length);
        if (alt) motion += aside * (right * length);
        const double left = alt ? 0 : -right * kRotationRate * devices.seconds;
        if (left != 0 || devices.rotation != Vec2d(0))
            pose_ = turned(pose_, left - devices.rotation.x, devices.rotation.y);
        if (walks && (left != 0 || motion != glm::dvec3(0))) state_.walking = true;
        go(motion, walks, devices);
    }

    void go(const glm::dvec3& motion, bool walks, const Devices& devices) {
        const bool moves = motion != glm::dvec3(0);
        if (!queries_) {
            pose_.position += motion;
            return;
        }
        const Avatar size = avatar();
        const CastRay cast = [this](const glm::dvec3& from, const glm::dvec3& direction, double length) {
            return this->cast(from, direction, length);
        };
        const glm::dvec3 there = moves ? slide(motion, size, walks, cast) : pose_.position;
        if (!walks || !state_.walking || !(moves || state_.fallSpeed != 0 || devices.anyMoved)) {
            pose_.position = there;
            return;
        }
        const Stand stand = standOrFall(there, state_.fallSpeed, devices.seconds, size, cast, there - pose_.position);
        state_.fallSpeed = stand.fallSpeed;
        if (!stand.blocked) pose_.position = stand.eye;
    }

    glm::dvec3 slide(const glm::dvec3& motion, const Avatar& size, bool walks, const CastRay& cast) {
        if (!queries_->knowsTriangles()) return slideBy(pose_.position, motion, size, walks, cast);
        return slideBy(pose_.position, motion, [&](const glm::dvec3& eye, const glm::dvec3& direction, double length) {
            return firstTouched({eye, direction, length, walks}, size);
        });
    }
    /// Piece by piece, so that the ball around a piece is not much larger than the avatar.
    std::optional<Met> firstTouched(const AvatarPath& path, const Avatar& size) {
        constexpr double kMaxPieces = 64;
        const double pieces = std::clamp(std::ceil(path.length / (4 * std::max(size.radius, .1))), 1.0, kMaxPieces);
        for (double piece = 0; piece < pieces; ++piece) {
            AvatarPath part = path;
            part.eye += path.direction * (path.length * piece / pieces);
            part.length /= pieces;
            Touched touched(*this, part, size);
            const SweptBall ball = ballAround(part, size);
            double stretch = 0;
            for (int i = 0; i < 3; ++i) stretch = std::max(stretch, glm::length(glm::dvec3(world_[i])));
            (void)queries_->obstaclesNear(world_ * glm::dvec4(ball.center, 1), ball.radius * stretch, touched);
            if (!touched.first) continue;
            touched.first->distance += path.length * piece / pieces;
            return touched.first;
        }
        return std::nullopt;
    }
    /// Keeps the first of the triangles that the avatar touches.
    class Touched final : public TriangleTest {
      public:
        Touched(const Navigator& navigator, const AvatarPath& path, const Avatar& size)
            : scene_(navigator.scene_), local_(glm::inverse(navigator.world_)), path_(path), size_(size) {}
        bool concerns(const std::vector<NodeId>& path) override { return stopsAvatars(scene_, path); }
        bool meets(const std::array<Vec3d, 3>& corners) override {
            std::array<glm::dvec3, 3> triangle;
            for (std::size_t i = 0; i < 3; ++i) triangle[i] = local_ * glm::dvec4(corners[i], 1);
            const auto met = sweepAvatar(path_, size_, triangle);
            if (met && (!first || met->distance < first->distance)) first = met;
            return false;  // all are looked at
        }
        std::optional<Met> first;

      private:
        const Scene& scene_;
        const glm::dmat4 local_;
        const AvatarPath& path_;
        const Avatar& size_;
    };

    /// The first surface that collides (23.4.2), all in the coordinates around the viewpoint.
    std::optional<Met> cast(const glm::dvec3& from, const glm::dvec3& direction, double length) {
        const glm::dvec3 origin = world_ * glm::dvec4(from, 1), along = glm::dmat3(world_) * direction;
        const double stretch = glm::length(along);
        if (!(stretch > 0) || !std::isfinite(stretch) || !std::isfinite(origin.x + origin.y + origin.z))
            return std::nullopt;
        for (const Crossing& crossing : queries_->obstacles(origin, along / stretch, length * stretch)) {
            if (!stopsAvatars(scene_, crossing.path)) continue;
            Met met{glm::length(crossing.point - origin) / stretch, worldNormal_ * crossing.normal};
            if (!(glm::length(met.normal) > 0)) continue;
            met.normal = glm::normalize(met.normal);
            if (glm::dot(met.normal, direction) > 0) met.normal = -met.normal;
            return met;
        }
        return std::nullopt;
    }

    // ---- devices -----------------------------------------------------------------------------------------------

    /// A sensor that has the keys has them all (21.2).
    void readKeys(const std::vector<KeyInput>& keys, NodeId& bind) {
        const bool taken = scene_.find(scene_.node(scene_.root()).get(Root::_keyFocus)) != nullptr;
        for (const KeyInput& key : keys) {
            const std::uint32_t bit = keyBit(key.action);
            state_.held = key.down && !taken ? state_.held | bit : state_.held & ~bit;
            const auto choice = choiceOf(key.action);
            if (choice && key.down && !taken && type_ != NavigationType::none)
                bind = chosenViewpoint(scene_, view_.id(), *choice);
        }
        if (taken) state_.held = 0;
    }

    /// From the middle of the picture, to the right and up, in halves of its smaller side.
    std::optional<Vec2d> pointerPosition(const PointerInput& pointer) const {
        if (pointer.kind != PointerInput::Kind::ray) return std::nullopt;
        const ViewerPose eye = transformed(world_, start_);
        const glm::dquat back = glm::conjugate(eye.orientation);
        const glm::dvec3 direction = back * pointer.direction;
        Vec2d point = Vec2d(direction) / (-direction.z * portable::tan(halfAngle(view_)));
        if (isOrtho()) {
            const auto [left, bottom, right, top] = extentOf(view_);
            const Vec2d middle(left + right, bottom + top);
            point = (Vec2d(back * (pointer.origin - eye.position)) - middle * .5) / halfExtent(view_);
        } else if (!(direction.z < 0)) {
            return std::nullopt;
        }
        return std::isfinite(point.x + point.y) ? std::optional(point) : std::nullopt;
    }

    void drag(const PointerInput& pointer) {
        const auto at = pointerPosition(pointer);
        if (!state_.dragging || !at || *at == state_.at || isHeld(scene_, pointer.device)) return;
        const Vec2d by = *at - state_.at;
        const bool pans = (buttonsBefore(scene_, pointer.device) & PointerInput::kPrimary) == 0;
        if (pans)
            pan(-by.x, -by.y);
        else if (examines())
            orbit(by.x * kOrbitPerHalf, by.y * kOrbitPerHalf);
        else
            pose_ = turned(pose_, by.x * halfAngle(view_), -by.y * halfAngle(view_));
        state_.dragged = true;
    }

    void readPointer(const PointerInput& pointer, ViewerMove& move, bool rests) {
        const std::uint32_t drags = PointerInput::kPrimary | (examines() ? kPanButtons : 0);
        const std::uint32_t before = buttonsBefore(scene_, pointer.device);
        const bool down = (pointer.buttons & drags) != 0, was = (before & drags) != 0;
        const auto at = pointerPosition(pointer);
        if (at) state_.at = *at;
        if (down && !was) {
            state_.dragging = at.has_value();
            state_.dragged = false;
        } else if (was && isHeld(scene_, pointer.device)) {
            state_.dragging = false;
        }
        if (down) return;
        const bool clicked = (before & PointerInput::kPrimary) != 0 && state_.dragging && !state_.dragged;
        state_.dragging = state_.dragged = false;
        state_.at = Vec2d(0);
        if (clicked && !rests && type_ == NavigationType::lookAt && pointer.hit) lookAt(*pointer.hit, move);
    }

    /// 23.4.4: to where the whole box of the shape is seen, whose middle becomes the centre of rotation.
    void lookAt(const PointerHit& hit, ViewerMove& move) {
        if (!queries_) return;
        const glm::dmat4 back = glm::inverse(world_);
        for (const ShapeBox& box : queries_->boxes()) {
            if (box.path != hit.path) continue;
            const glm::dmat4 worldFromBox = back * box.worldFromShape;
            const glm::dvec3 middle = worldFromBox * glm::dvec4((box.low + box.high) * .5, 1);
            double radius = 0;
            for (int i = 0; i < 8; ++i) {
                const glm::dvec3 corner(worldFromBox * glm::dvec4(cornerOf(box, i), 1));
                radius = std::max(radius, glm::length(corner - middle));
            }
            glm::dvec3 away = pose_.position - middle;
            if (!(glm::length(away) > 0)) away = pose_.orientation * glm::dvec3(0, 0, 1);
            away = glm::normalize(away);
            ViewerPose there{middle + away * (radius / portable::sin(halfAngle(view_))), lookAlong(-away, pose_)};
            there.zoom = zoomTo(view_, radius);
            move.kind = ViewerMove::Kind::look;
            move.center = middle;
            target_ = relative(authorsView(view_, fields_), there);
            return;
        }
    }

    const Scene& scene_;
    SpaceQueries* queries_;
    const Node& view_;
    const ViewFields fields_;
    const glm::dmat4 world_;
    const glm::dmat3 worldNormal_;  // from the world's normals to those around the viewpoint
    const Node* info_;
    NavigationType type_;
    const NavigationState before_;
    NavigationState state_;
    const ViewerPose start_;
    ViewerPose pose_;
    std::optional<ViewerPose> target_;  // of an animation, as an offset
};

/// The bound viewpoint, if one can move from it.
struct BoundView {
    const Node* view = nullptr;
    ViewFields fields;
    glm::dmat4 world{1};
};
std::optional<BoundView> boundView(const Scene& scene) {
    const Node* view = topOfStack(scene, "_viewpointStack");
    const auto fields = view ? viewFields(*view) : std::nullopt;
    const auto world = fields ? worldAround(scene, view->id()) : std::nullopt;
    if (!world) return std::nullopt;
    return BoundView{view, *fields, *world};
}

}  // namespace

// ---- poses -------------------------------------------------------------------------------------------------------

ViewerPose viewerPose(const Scene& scene) {
    WorldTransforms positions(scene);
    const Viewer viewer = positions.viewer(scene.root());
    const Node* view = topOfStack(scene, "_viewpointStack");
    const auto pose = view ? viewOf(*view) : std::nullopt;
    return {viewer.position, viewer.orientation, pose ? pose->zoom : 1};
}

NavigationType navigationType(const Scene& scene) {
    const Node* info = boundInfo(scene);
    if (!info) return NavigationType::examine;
    for (const String& type : info->get(x3d::NavigationInfo::type_)) {
        if (type.view() == "WALK") return NavigationType::walk;
        if (type.view() == "FLY") return NavigationType::fly;
        if (type.view() == "LOOKAT") return NavigationType::lookAt;
        if (type.view() == "NONE") return NavigationType::none;
        if (type.view() == "EXAMINE" || type.view() == "ANY") return NavigationType::examine;
    }
    return NavigationType::examine;
}

// ---- viewpoints and moves of applications ------------------------------------------------------------------------

std::vector<NodeId> viewpoints(const Scene& scene) {
    std::vector<NodeId> found, pending;
    std::unordered_set<std::uint32_t> seen;
    const Node* layer = scene.find(scene.node(scene.root()).get(Root::_activeLayer));
    pending.push_back(layer ? layer->id() : scene.root());
    while (!pending.empty()) {
        const Node* node = scene.find(pending.back());
        pending.pop_back();
        if (!node || !seen.insert(node->id().value).second) continue;
        if (viewFields(*node)) {
            found.push_back(node->id());
            continue;
        }
        if (isLayer(*node) && node != layer) continue;  // it has a viewer of its own
        if (node->is(x3d::ViewpointGroup::type) && !isOffered(scene, *node)) continue;
        std::vector<NodeId> below;
        for (FieldIndex i = 0; i < node->type().fieldCount(); ++i) {
            const FieldDef& field = node->type().fields[i];
            if (sf(field.type) != FieldType::SFNode || !field.readable() || !isTransform(node->type(), i)) continue;
            if (node->id() == scene.root() && i != Root::children.index) continue;
            if (field.type == FieldType::SFNode)
                below.push_back(node->get(Field<NodeId>{i}));
            else
                for (const NodeId child : node->get(Field<Array<NodeId>>{i})) below.push_back(child);
        }
        pending.insert(pending.end(), below.rbegin(), below.rend());
    }
    return found;
}

Result<> bindViewpoint(Scene& scene, ViewpointChoice choice) {
    const Node* bound = topOfStack(scene, "_viewpointStack");
    const Node* chosen = scene.find(chosenViewpoint(scene, bound ? bound->id() : NodeId{}, choice));
    if (!chosen) return fail("there is no viewpoint");
    return scene.sendEvent(chosen->id(), chosen->type().findExact("set_bind"), Value(true));
}

Result<> moveViewer(Scene& scene, const ViewerPose& pose, bool animated) {
    if (!isFinite(pose)) return fail("a viewer's pose is not finite");
    const auto bound = boundView(scene);
    if (!bound) return fail("no viewpoint is bound from which a viewer could move");
    ViewerMove move;
    move.kind = animated ? ViewerMove::Kind::animate : ViewerMove::Kind::jump;
    move.viewpoint = bound->view->id();
    const ViewerPose local =
        transformed(glm::inverse(bound->world), {pose.position, glm::normalize(pose.orientation), pose.zoom});
    move.offset = relative(authorsView(*bound->view, bound->fields), local);
    if (!isFinite(move.offset)) return fail("a viewer's pose is out of reach");
    return scene.sendEvent(scene.root(), Root::navigate.index, move.toValue());
}

Result<> viewAll(Scene& scene, SpaceQueries& queries) {
    const auto bound = boundView(scene);
    if (!bound) return fail("no viewpoint is bound from which a viewer could move");
    Vec3d low(INFINITY), high(-INFINITY);
    for (const ShapeBox& box : queries.boxes())
        for (int i = 0; i < 8; ++i) {
            const glm::dvec3 at = box.worldFromShape * glm::dvec4(cornerOf(box, i), 1);
            low = glm::min(low, at);
            high = glm::max(high, at);
        }
    const double radius = glm::length(high - low) / 2;
    if (!(radius > 0) || !std::isfinite(radius)) return fail("there is nothing to be seen");
    ViewerPose pose = viewerPose(scene);
    const glm::dvec3 back = pose.orientation * glm::dvec3(0, 0, 1);
    pose.position = (low + high) * .5 + back * (radius / portable::sin(halfAngle(*bound->view)));
    pose.zoom = zoomTo(*bound->view, radius);
    return moveViewer(scene, pose);
}

Result<> straightenViewer(Scene& scene) {
    const auto bound = boundView(scene);
    if (!bound) return fail("no viewpoint is bound from which a viewer could move");
    ViewerPose local = *viewOf(*bound->view);
    local.orientation = lookAlong(local.orientation * glm::dvec3(0, 0, -1), local);
    return moveViewer(scene, transformed(bound->world, local));
}

// ---- the user's choice -------------------------------------------------------------------------------------------

namespace {

constexpr std::pair<NavigationType, const char*> kTypeNames[] = {{NavigationType::examine, "EXAMINE"},
                                                                 {NavigationType::walk, "WALK"},
                                                                 {NavigationType::fly, "FLY"},
                                                                 {NavigationType::lookAt, "LOOKAT"},
                                                                 {NavigationType::none, "NONE"}};

/// The bound NavigationInfo; if none is bound, a new one, which will be bound in the next frame.
Result<NodeId> infoToChange(Scene& scene) {
    using N = x3d::NavigationInfo;
    if (const Node* info = boundInfo(scene)) return info->id();
    const Node* layer = scene.find(scene.node(scene.root()).get(Root::_activeLayer));
    const Node& holder = layer ? *layer : scene.node(scene.root());
    const FieldIndex below = holder.type().findExact("children");
    if (below == kNoField) return fail("there is no place for a NavigationInfo in the active layer");
    Array<NodeId> all = holder.get(Field<Array<NodeId>>{below});
    const NodeId info = scene.createNode(N::type);
    all.push_back(info);
    if (auto ok = scene.setField(holder.id(), below, Value(std::move(all))); !ok) return std::unexpected(ok.error());
    if (auto ok = scene.sendEvent(info, N::set_bind.index, Value(true)); !ok) return std::unexpected(ok.error());
    return info;
}

}  // namespace

std::string_view nameOf(NavigationType type) {
    for (const auto& [one, name] : kTypeNames)
        if (one == type) return name;
    return "EXAMINE";
}

double navigationSpeed(const Scene& scene) {
    const Node* info = boundInfo(scene);
    return info ? double{info->get(x3d::NavigationInfo::speed)} : 1;
}

Result<> chooseNavigation(Scene& scene, NavigationType type) {
    auto info = infoToChange(scene);
    if (!info) return std::unexpected(info.error());
    return scene.sendEvent(*info, x3d::NavigationInfo::type_.index,
                           Value(Array<String>{String(nameOf(type)), String("ANY")}));
}

Result<> chooseSpeed(Scene& scene, double speed) {
    if (!std::isfinite(speed) || !(speed > 0)) return fail("a viewer's speed is above 0");
    auto info = infoToChange(scene);
    if (!info) return std::unexpected(info.error());
    return scene.sendEvent(*info, x3d::NavigationInfo::speed.index, Value(static_cast<float>(speed)));
}

// ---- a frame -----------------------------------------------------------------------------------------------------

void Scene::State::navigate(double t) {
    const auto bound = boundView(owner);
    if (!bound) return;
    Devices devices;
    devices.seconds = started ? std::max(0.0, t - now) : 0;
    constexpr std::uint32_t kSpace = aspectBit(Aspect::structure) | aspectBit(Aspect::transform) |
                                     aspectBit(Aspect::view) | aspectBit(Aspect::geometry);
    devices.anyMoved = ((touched | touchedBefore) & kSpace) != 0;
    QueuedEvent* given = nullptr;
    for (QueuedEvent& event : inputQueue) {
        if (event.node != owner.root()) continue;
        if (event.field == Root::navigate.index) {
            given = &event;
        } else if (event.field == Root::wheel.index) {
            const auto& steps = event.value.as<Array<double>>();
            if (steps.size() >= 2 && std::isfinite(steps[0] + steps[1])) devices.wheel += Vec2d(steps[0], steps[1]);
            if (steps.size() >= 4 && std::isfinite(steps[2] + steps[3])) devices.rotation += Vec2d(steps[2], steps[3]);
        } else if (event.field == Root::key.index) {
            if (const auto key = KeyInput::fromValue(event.value.as<Array<std::int32_t>>()))
                devices.keys.push_back(*key);
        } else if (event.field == Root::pointer.index) {
            const auto pointer = PointerInput::fromValue(event.value.as<Array<double>>());
            if (pointer && pointer->device == 0) devices.pointer = *pointer;
        }
    }
    auto stated = given ? ViewerMove::fromValue(given->value.as<Array<double>>()) : Result<ViewerMove>(ViewerMove{});
    if (!stated) return;
    if (given) {
        // The event is about the bound viewpoint, which has another number if a recorded frame is run anew in a changed
        // scene.
        stated->viewpoint = bound->view->id();
        if (stated->state && stated->state->viewpoint) stated->state->viewpoint = bound->view->id();
        given->value = Value(stated->toValue());
    }
    if (!navigates || stated->state) return;  // a recorded one has all that happens in this frame
    if (given) {
        // An application's own counts; of the devices, which keys are down.
        devices.seconds = 0;
        devices.wheel = devices.rotation = Vec2d(0);
        devices.pointer.reset();
    }
    NodeId bind;
    auto move = Navigator(owner, queries, *bound->view, bound->fields, bound->world).answer(devices, bind);
    viewerMoved = move.has_value();
    if (given && move) {
        stated->state = move->state;
        given->value = Value(stated->toValue());
    } else if (move) {
        inputQueue.push_back({owner.root(), Root::navigate.index, Value(move->toValue())});
    }
    if (const Node* chosen = owner.find(bind); chosen && bind != bound->view->id())
        inputQueue.push_back({bind, chosen->type().findExact("set_bind"), Value(true)});
}

}  // namespace rtsg
