// Device input: the actions of pointers, keys, wheels and heads, as events of a scene like any others.
//
// Devices are inputOnly fields of the scene's root. So an input waits for the next frame, stands in change sets, logs
// and recorded inputs, and may come from a peer in the same way (MirrorClient::submitEvent sends the values below). A
// pointer's ray is cast when its frame begins, against the geometry at that time; the hit goes into the recorded event,
// so replicas and replays need no geometry. A frame takes one press or release of a pointer and one key, as outputs
// send one event at a timestamp; further ones wait for the next frames, in order, 256 at most. Moves between them
// become one move. Pick sensors are evaluated when a frame begins, in the same way. Threading: the scene's thread.
// Source: ISO/IEC 19775-1 V4.0 clauses 20, 21, 23.4.2, 38.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/value.h>

namespace rtsg {

class Node;
class Scene;

/// The first thing that a ray met.
struct PointerHit {
    Vec3d point{0}, normal{0, 0, 1};  // world space; the normal a unit vector
    Vec2d texCoord{0};
    std::vector<NodeId> path;  // from a root node to the Shape
    /// A node on the path whose content is placed by the picture and not by its fields alone (Billboard, LayoutGroup,
    /// ScreenGroup ...), and the transform that the picture used.
    struct ByPicture {
        std::size_t at = 0;  // the node's index on the path
        glm::dmat4x3 parentFromLocal{1.0};
        friend bool operator==(const ByPicture&, const ByPicture&) = default;
    };
    std::vector<ByPicture> byPicture{};  // in the order of the path
    friend bool operator==(const PointerHit&, const PointerHit&) = default;
};

/// The hit at a place in a picture, and the ray that found it.
struct PictureHit {
    Vec3d origin{0}, direction{0, 0, -1};  // world space
    std::optional<PointerHit> hit;
};

struct PointerInput {
    static constexpr std::int32_t kDevices = 64;
    static constexpr std::uint32_t kPrimary = 1, kSecondary = 2, kMiddle = 4;
    /// absent: it has left the window, or points nowhere.
    enum class Kind : std::uint8_t { absent, ray, picture } kind = Kind::ray;
    std::int32_t device = 0;               // below kDevices
    std::uint32_t buttons = 0;             // the buttons that are down: kPrimary, and others for applications
    Vec3d origin{0}, direction{0, 0, -1};  // of a ray, in world space
    /// A place in the picture that the bound viewpoint shows: from 0 (left, top) to 1; `aspect` = width / height.
    double x = 0, y = 0, aspect = 1;
    std::optional<PointerHit> hit;  // made when the frame begins, if the scene has SpaceQueries

    Array<double> toValue() const;
    /// Error: values that toValue() does not make. With numbers that are not finite, the pointer is absent.
    static Result<PointerInput> fromValue(const Array<double>& value);
};

/// The action keys of 21.4.1; the last three have no key events of their own but outputs of the KeySensor.
enum class ActionKey : std::uint8_t {
    none = 0,
    f1 = 1,
    f12 = 12,
    home = 13,
    end = 14,
    pageUp = 15,
    pageDown = 16,
    up = 17,
    down = 18,
    left = 19,
    right = 20,
    shift = 21,
    control = 22,
    alt = 23,
};
struct KeyInput {
    bool down = true;
    char32_t character = 0;  // 0 for an action key
    ActionKey action = ActionKey::none;

    Array<std::int32_t> toValue() const;
    /// Error: neither a Unicode character nor an action key.
    static Result<KeyInput> fromValue(const Array<std::int32_t>& value);
    /// "a", "é", "HOME", "F7", "SHIFT", "ENTER", "BACKSPACE", "ESCAPE", "TAB", "SPACE" or "U+1F600".
    static Result<KeyInput> named(std::string_view name, bool down);
};

/// Queue an input for the next frame. Errors: called on another thread; an invalid device, key or number.
Result<> sendPointer(Scene& scene, const PointerInput& input);
Result<> sendKey(Scene& scene, const KeyInput& input);
/// Text that was composed or pasted. StringSensors get it as if it had been typed; '\n' ends a string.
Result<> sendText(Scene& scene, std::string_view text);
/// Queues wheel steps across and down, which navigation (navigation.h) handles.
Result<> sendWheel(Scene& scene, double across, double down);
/// Queues the pose of a head relative to the bound viewpoint, in metres. It is recorded and mirrored; no built-in node
/// uses it.
Result<> sendHeadPose(Scene& scene, const Vec3d& position, const Rotation& orientation);

/// The ray through a place in the picture of the bound viewpoint, as in PointerInput. `direction` has length 1.
struct Bearing {
    Vec3d origin{0}, direction{0, 0, -1};
};
Bearing bearingThrough(const Scene& scene, double x, double y, double aspect);

/// A point where a ray meets a surface.
struct Crossing {
    Vec3d point{0}, normal{0, 0, 1};  // world space; the normal a unit vector, on the surface's front
    Vec3d texCoord{0};
    std::vector<NodeId> path;  // from a root node to the Shape
};

/// A Shape's bounding box, along the axes of the Shape's own coordinates.
struct ShapeBox {
    glm::dmat4 worldFromShape{1};
    Vec3d low{0}, high{0};
    std::vector<NodeId> path;  // from a root node to the Shape
};

/// Tests triangles one by one; SpaceQueries::meetings() passes those of the Shapes in question.
class TriangleTest {
  public:
    virtual ~TriangleTest() = default;
    /// `path` leads from a root node to a Shape. Returns false if no triangle of this Shape is asked about.
    virtual bool concerns(const std::vector<NodeId>& path) = 0;
    /// `corners` are in world space and finite; the area between them may be 0.
    virtual bool meets(const std::array<Vec3d, 3>& corners) = 0;
};

/// A Shape that has a triangle which a test has met.
struct Meeting {
    ShapeBox box;
    double distance = 0;  // metres from the centre that was asked for to the Shape's nearest point
};

/// Which obstacles there are for avatars, as the user chooses: SpaceQueries::obstacles() leaves the others out.
struct ObstacleRules {
    bool walls = true, ground = true;
    /// Navigation looks for ground without end, and for walls as far as it goes.
    bool stops(double length) const { return length < std::numeric_limits<double>::infinity() ? walls : ground; }
    friend bool operator==(const ObstacleRules&, const ObstacleRules&) = default;
};

/// Answers questions about where geometry is. The scene asks at the beginning of a frame, never while one runs.
class SpaceQueries {
  public:
    virtual ~SpaceQueries() = default;
    /// `direction` is finite and not zero.
    virtual std::optional<PointerHit> firstHit(const Vec3d& origin, const Vec3d& direction) = 0;
    /// The hit at a place in the last picture, `x` and `y` from 0 (left, top) to 1. `layer`: only in this layer; the
    /// root stands for what is in no layer. Nothing if there is no picture with layers, where the bound viewpoint is
    /// all that is needed.
    virtual std::optional<PictureHit> throughPicture(double x, double y, std::optional<NodeId> layer) {
        (void)x, (void)y, (void)layer;
        return std::nullopt;
    }
    /// The paths to all Shapes within `radius` metres that stop avatars, as for obstacles().
    virtual std::vector<std::vector<NodeId>> within(const Vec3d& center, double radius) = 0;
    /// All surfaces that a ray meets within `length` metres (infinity: without end), from either side, the nearest
    /// first. `direction` as above.
    virtual std::vector<Crossing> crossings(const Vec3d& origin, const Vec3d& direction, double length) = 0;
    /// The same for surfaces that stop avatars. They include the proxies of Collision nodes (23.4.2), which are not
    /// seen, and also the children that a proxy replaces: the caller tells them apart by their paths.
    virtual std::vector<Crossing> obstacles(const Vec3d& origin, const Vec3d& direction, double length) {
        return crossings(origin, direction, length);
    }
    /// Whether obstaclesNear() passes triangles; otherwise avatars feel their way by rays.
    virtual bool knowsTriangles() const { return false; }
    /// As meetings(), with the surfaces of obstacles().
    virtual std::vector<Meeting> obstaclesNear(const Vec3d& center, double radius, TriangleTest& test) {
        return meetings(center, radius, test);
    }
    /// The boxes of all Shapes, in no order.
    virtual std::vector<ShapeBox> boxes() = 0;
    /// The Shapes that `test` concerns and that have a triangle within `radius` metres of `center` which the test
    /// meets, in no order. The triangles of each Shape are tested in turn until one is met. Points and lines are not
    /// tested.
    virtual std::vector<Meeting> meetings(const Vec3d& center, double radius, TriangleTest& test) = 0;
    /// The corners of a geometry's triangles, lines and points, in its own coordinates; the geometry need not be drawn.
    /// A corner may come several times. A geometry without corners gives none.
    virtual std::vector<Vec3d> corners(const Node& geometry) = 0;
};

}  // namespace rtsg
