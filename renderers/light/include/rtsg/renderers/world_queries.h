// WorldQueries: answers the scene's questions about pointers, avatars and pick sensors from the shared world's BVH.
//
// It is made for Scene::setSpaceQueries(). The world is brought up to date before each answer; if it no longer follows
// the scene, all answers are empty, which is reported once. Pointers meet what a picture shows (LightTracer::pick());
// all other queries use the geometry. Threading: the scene's thread. Source: ISO/IEC 19775-1 V4.0 20.2.3, 23.4.2, 38.

// Example:
//     #include <rtsg/core/device_input.h>
//     #include <rtsg/documents/loader.h>
//     #include <rtsg/renderers/world_queries.h>
//     rtsg::Scene scene;
//     rtsg::Diagnostics diagnostics;
//     rtsg::loadFile(scene, "door.x3dv", diagnostics);
//     rtsg::SharedWorld world(scene);
//     rtsg::WorldQueries queries(world);
//     scene.setSpaceQueries(&queries);
//     rtsg::PointerInput press;  // with the primary button, at the middle of the picture
//     press.kind = rtsg::PointerInput::Kind::picture;
//     press.x = press.y = .5;
//     press.buttons = rtsg::PointerInput::kPrimary;
//     (void)rtsg::sendPointer(scene, press);
//     scene.newFrame(0);  // a TouchSensor there is active now
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include <rtsg/core/device_input.h>
#include <rtsg/core/resource.h>
#include <rtsg/renderers/shared_world.h>

namespace rtsg {

struct Pick;
enum class Surfaces : std::uint8_t;

class WorldQueries final : public SpaceQueries {
  public:
    /// The world must outlive this. `resources` says what urls of textures may open; a texture is read when a pointer
    /// meets it.
    explicit WorldQueries(SharedWorld& world, Resources resources = {});
    /// Calls `make` for a world at the first question, so that a scene without pointers, Collisions and pick sensors is
    /// not tessellated for this.
    explicit WorldQueries(std::function<SharedWorld&()> make, Resources resources = {});
    ~WorldQueries() override;
    WorldQueries(const WorldQueries&) = delete;
    WorldQueries& operator=(const WorldQueries&) = delete;
    std::optional<PointerHit> firstHit(const Vec3d& origin, const Vec3d& direction) override;
    std::optional<PictureHit> throughPicture(double x, double y, std::optional<NodeId> layer) override;
    std::vector<std::vector<NodeId>> within(const Vec3d& center, double radius) override;
    std::vector<Crossing> crossings(const Vec3d& origin, const Vec3d& direction, double length) override;
    std::vector<Crossing> obstacles(const Vec3d& origin, const Vec3d& direction, double length) override;
    bool knowsTriangles() const override { return true; }
    std::vector<Meeting> obstaclesNear(const Vec3d& center, double radius, TriangleTest& test) override;
    std::vector<ShapeBox> boxes() override;
    /// Uses triangles in world space, in double precision; a level of detail is the one that was last seen.
    std::vector<Meeting> meetings(const Vec3d& center, double radius, TriangleTest& test) override;
    std::vector<Vec3d> corners(const Node& geometry) override;
    /// What obstacles() leaves out. By default nothing.
    void setObstacles(const ObstacleRules& rules) { rules_ = rules; }

  private:
    bool follow();
    std::vector<Meeting> meetings(const Vec3d& center, double radius, TriangleTest& test, Surfaces surfaces);
    std::vector<Crossing> crossings(const Vec3d& origin, const Vec3d& direction, double length, Surfaces surfaces);
    std::optional<PointerHit> hitOf(Pick&& pick) const;
    class Seen;
    std::function<SharedWorld&()> make_;
    Resources resources_;
    SharedWorld* world_ = nullptr;  // from the first question on, as is seen_
    std::unique_ptr<Seen> seen_;
    bool reported_ = false;
    ObstacleRules rules_;
};

}  // namespace rtsg
