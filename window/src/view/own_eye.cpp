// A viewpoint in a scene of its own, moved by that scene's navigation among the walls of another one.
#include <rtsg/window/own_eye.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>
#include <type_traits>
#include <utility>

#include <rtsg/core/navigation.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/world_queries.h>

namespace rtsg {

namespace {

using Root = x3d::RtsgScene;
constexpr double kBeforeIt = 1e-3;  // of the distance from the hit back to the eye

/// The obstacles for avatars in the other scene's world. Pointers meet nothing, since nodes have other numbers there.
class Walls final : public SpaceQueries {
  public:
    explicit Walls(SharedWorld& world) : scene_(world.scene()), queries_(world) {}
    std::optional<PointerHit> firstHit(const Vec3d&, const Vec3d&) override { return std::nullopt; }
    std::optional<PictureHit> throughPicture(double, double, std::optional<NodeId>) override { return std::nullopt; }
    std::vector<std::vector<NodeId>> within(const Vec3d&, double) override { return {}; }
    std::vector<Crossing> crossings(const Vec3d& origin, const Vec3d& direction, double length) override {
        return withoutPaths(queries_.crossings(origin, direction, length));
    }
    std::vector<Crossing> obstacles(const Vec3d& origin, const Vec3d& direction, double length) override {
        if (!rules.stops(length)) return {};
        std::vector<Crossing> all = queries_.obstacles(origin, direction, length);
        std::erase_if(all, [&](const Crossing& one) { return !stopsAvatars(scene_, one.path); });
        return withoutPaths(std::move(all));
    }
    bool knowsTriangles() const override { return queries_.knowsTriangles(); }
    std::vector<Meeting> obstaclesNear(const Vec3d& center, double radius, TriangleTest& test) override {
        if (!rules.walls) return {};
        InTheOtherScene there(scene_, test);
        return queries_.obstaclesNear(center, radius, there);
    }
    std::vector<ShapeBox> boxes() override {
        std::vector<ShapeBox> all = queries_.boxes();
        for (ShapeBox& box : all) box.path.clear();
        return all;
    }
    std::vector<Meeting> meetings(const Vec3d&, double, TriangleTest&) override { return {}; }
    std::vector<Vec3d> corners(const Node&) override { return {}; }

    ObstacleRules rules;

  private:
    /// Which Shapes stop avatars is for the other scene to say.
    class InTheOtherScene final : public TriangleTest {
      public:
        InTheOtherScene(const Scene& scene, TriangleTest& test) : scene_(scene), test_(test) {}
        bool concerns(const std::vector<NodeId>& path) override {
            return stopsAvatars(scene_, path) && test_.concerns({});
        }
        bool meets(const std::array<Vec3d, 3>& corners) override { return test_.meets(corners); }

      private:
        const Scene& scene_;
        TriangleTest& test_;
    };
    static std::vector<Crossing> withoutPaths(std::vector<Crossing> all) {
        for (Crossing& one : all) one.path.clear();
        return all;
    }
    const Scene& scene_;
    WorldQueries queries_;
};

/// The node on top of a stack of the active layer, or of the root where there is none; null if it is empty.
const Node* bound(const Scene& scene, std::string_view stack) {
    const Node& root = scene.node(scene.root());
    const Node* layer = scene.find(root.get(Root::_activeLayer));
    const Node& holder = layer ? *layer : root;
    const FieldIndex field = holder.type().findExact(stack);
    if (field == kNoField || holder.type().fields[field].type != FieldType::MFNode) return nullptr;
    const Array<NodeId>& all = holder.get(Field<Array<NodeId>>{field});
    return all.empty() ? nullptr : scene.find(all[0]);
}

}  // namespace

struct OwnEye::Impl {
    Impl(SharedWorld& w, OwnScene* o) : world(w), ownScene(o), walls(w), picture(w) {}

    SharedWorld& world;
    OwnScene* const ownScene;
    Walls walls;
    WorldQueries picture;
    bool pressed = false;        // a button is
    std::optional<NodeId> over;  // the layer, other than the active one, that the pointer is over, or was when pressed
    std::optional<NodeId> kept;  // the same for the thing that is kept before this eye
    std::unique_ptr<Scene> own;  // null until it is moved
    double time = 0;
    double fieldOfView = 0.7854;
    double nearest = 0, farthest = std::numeric_limits<double>::infinity(), limit = farthest;  // as in Camera

    /// From where the other scene's viewer is.
    void begin() { begin(viewerPose(world.scene()), bound(world.scene(), "_viewpointStack")); }
    /// `theirs`: the other scene's viewpoint, whose angle and centre count; or none.
    void begin(const ViewerPose& pose, const Node* theirs) {
        using V = x3d::Viewpoint;
        using N = x3d::NavigationInfo;
        const Scene& other = world.scene();
        own = std::make_unique<Scene>();
        own->setNavigation(true);
        own->setSpaceQueries(&walls);
        const NodeId navigation = own->createNode(N::type);
        const NodeId view = theirs && theirs->is(x3d::OrthoViewpoint::type)
                                ? viewLike<x3d::OrthoViewpoint>(pose, theirs)
                                : viewLike<V>(pose, theirs && theirs->is(V::type) ? theirs : nullptr);
        limit = std::numeric_limits<double>::infinity();
        if (const Node* info = bound(other, "_navigationStack"); info && info->is(N::type)) {
            if (const float far = info->get(N::visibilityLimit); far > 0) limit = double{far};
            for (FieldIndex f = 0; f < info->type().fields.size(); ++f) {
                const FieldDef& def = info->type().fields[f];
                if (def.access == Access::inputOutput && !def.hidden && sf(def.type) != FieldType::SFNode)
                    (void)own->setField(navigation, f, info->value(f));
            }
        }
        (void)own->setField(own->root(), Root::children.index, Array<NodeId>{view, navigation});
        (void)own->sendEvent(view, V::set_bind.index, true);
        (void)own->sendEvent(navigation, N::set_bind.index, true);
        own->newFrame(time);
    }
    /// A viewpoint of our own with the projection of theirs, if there is one.
    template <class V>
    NodeId viewLike(const ViewerPose& pose, const Node* theirs) {
        const NodeId view = own->createNode(V::type);
        (void)own->set(view, V::position, Vec3f(pose.position));
        (void)own->set(view, V::orientation, orientationOf(pose));
        nearest = 0, farthest = std::numeric_limits<double>::infinity();
        if (!theirs) return view;
        if (const float near = theirs->get(V::nearDistance); near > 0) nearest = double{near};
        if (const float far = theirs->get(V::farDistance); far > 0) farthest = double{far};
        (void)own->set(view, V::centerOfRotation, theirs->get(V::centerOfRotation));
        if constexpr (std::is_same_v<V, x3d::OrthoViewpoint>) {
            Array<float> extent;
            for (const double side : extentOf(*theirs)) extent.push_back(static_cast<float>(side));
            (void)own->set(view, V::fieldOfView, std::move(extent));
        } else {
            fieldOfView = double{theirs->get(V::fieldOfView)};
            (void)own->set(view, V::fieldOfView, theirs->get(V::fieldOfView));
        }
        return view;
    }

    /// The layer that is in front at a place of the picture; null: the active one, or none.
    std::optional<NodeId> layerAt(double x, double y) {
        const auto seen = picture.throughPicture(x, y, std::nullopt);
        if (!seen || !seen->hit) return std::nullopt;
        const Scene& scene = world.scene();
        const NodeId active = scene.node(scene.root()).get(Root::_activeLayer);
        for (const NodeId id : seen->hit->path)
            if (const Node* node = scene.find(id); node && node->type().isA("X3DLayerNode"))
                return id == active ? std::nullopt : std::optional(id);
        return std::nullopt;
    }

    /// A ray that hits the thing that is kept before this eye is led to the place of that thing in the world.
    PointerInput toKept(PointerInput ray, bool isFree) {
        const auto hit = picture.firstHit(ray.origin, ray.direction);
        const auto met = hit ? ownScene->keptOn(hit->path) : std::nullopt;
        if (isFree) kept = met;
        if (!kept) return ray;
        if (met == kept)
            ray.origin = glm::mix(hit->point, ray.origin, kBeforeIt);  // other things may lie before it there
        return ownScene->asThere(ray, *kept);
    }

    /// Whether such input moves a viewer that has not been moved yet.
    static bool moves(FieldIndex field, const Value& value) {
        if (field == Root::wheel.index) return true;
        if (field == Root::pointer.index) {
            const auto pointer = PointerInput::fromValue(value.as<Array<double>>());
            return pointer && pointer->buttons != 0;
        }
        if (field != Root::key.index) return false;
        const auto key = KeyInput::fromValue(value.as<Array<std::int32_t>>());
        return key && key->down && key->action >= ActionKey::up && key->action <= ActionKey::right;
    }
    static bool goesHome(FieldIndex field, const Value& value) {
        if (field != Root::key.index) return false;
        const auto key = KeyInput::fromValue(value.as<Array<std::int32_t>>());
        return key && key->down && key->action == ActionKey::home;
    }
};

OwnEye::OwnEye(SharedWorld& world, OwnScene* own) : impl_(std::make_unique<Impl>(world, own)) {}
OwnEye::~OwnEye() = default;

void OwnEye::take(FieldIndex field, const Value& value) {
    Impl& s = *impl_;
    if (Impl::goesHome(field, value)) return s.own.reset();
    if (!s.own) {
        if (!Impl::moves(field, value)) return;
        s.begin();
    }
    (void)s.own->sendEvent(s.own->root(), field, value);
}

Result<> OwnEye::goTo(NodeId viewpoint) {
    const Scene& scene = impl_->world.scene();
    const Node* node = scene.find(viewpoint);
    const auto pose = node ? viewOf(*node) : std::nullopt;
    if (!pose) return fail("this is no viewpoint that one can go to");
    const glm::dmat4 world = worldAroundNode(scene, viewpoint);
    glm::dmat3 rotation(world);
    for (int i = 0; i < 3; ++i) rotation[i] = glm::normalize(rotation[i]);
    ViewerPose there{world * glm::dvec4(pose->position, 1),
                     glm::normalize(glm::quat_cast(rotation) * pose->orientation)};
    const glm::dquat& q = there.orientation;
    if (!std::isfinite(there.position.x + there.position.y + there.position.z + q.x + q.y + q.z + q.w))
        return fail("this viewpoint is nowhere");
    impl_->begin(there, node);
    return {};
}

void OwnEye::advance(double seconds) {
    Impl& s = *impl_;
    s.time = std::max(s.time, seconds);
    if (s.own) s.own->newFrame(s.time);
    if (!s.ownScene) return;
    const auto placed = s.ownScene->setPose(s.own ? std::optional(viewerPose(*s.own)) : std::nullopt);
    if (!placed) s.world.scene().diagnostics().error({}, placed.error().text);
}

bool OwnEye::isMoving() const {
    return impl_->own && impl_->own->restsUntil() <= impl_->time;
}

std::optional<Camera> OwnEye::camera(double aspect) const {
    const Impl& s = *impl_;
    if (!s.own) return std::nullopt;
    const ViewerPose pose = viewerPose(*s.own);
    const Node* view = bound(*s.own, "_viewpointStack");
    Camera camera =
        view && view->is(x3d::OrthoViewpoint::type)
            ? Camera::parallel(WorldFromLocal(1), pose.position, orientationOf(pose), extentOf(*view), aspect)
            : Camera::perspective(WorldFromLocal(1), pose.position, orientationOf(pose), s.fieldOfView, aspect);
    camera.nearDistance = s.nearest, camera.farDistance = s.farthest;
    if (!std::isfinite(s.farthest)) camera.visibilityLimit = s.limit;
    return camera;
}

Result<> OwnEye::choose(const std::function<Result<>(Scene&, SpaceQueries&)>& choice) {
    Impl& s = *impl_;
    if (!s.own) s.begin();
    return choice(*s.own, s.walls);
}
void OwnEye::setObstacles(const ObstacleRules& rules) {
    impl_->walls.rules = rules;
}
const Scene& OwnEye::navigated() const {
    return impl_->own ? *impl_->own : impl_->world.scene();
}

PointerInput OwnEye::throughPicture(const PointerInput& input) {
    Impl& s = *impl_;
    if (input.kind != PointerInput::Kind::picture) return input;
    const bool isFree = !std::exchange(s.pressed, input.buttons != 0);
    if (isFree) s.over = s.layerAt(input.x, input.y);
    PointerInput ray = input;
    ray.kind = PointerInput::Kind::ray;
    if (s.over)
        if (const auto seen = s.picture.throughPicture(input.x, input.y, s.over)) {
            ray.origin = seen->origin, ray.direction = seen->direction;
            // From right before it: whoever casts the ray again may take no account of layers, whose things lie among
            // each other in the world.
            if (seen->hit) ray.origin = glm::mix(seen->hit->point, seen->origin, kBeforeIt);
            return ray;
        }
    const Scene& scene = s.own ? *s.own : s.world.scene();
    const Bearing bearing = bearingThrough(scene, input.x, input.y, input.aspect);
    ray.origin = bearing.origin, ray.direction = bearing.direction;
    return s.ownScene ? s.toKept(ray, isFree) : ray;
}

}  // namespace rtsg
