// The engine of one scene: ODE's worlds, bodies, geometries and joints beside the nodes that they stand for.
//
// Bodies are in doubles here and in floats in their fields. While a field holds the value that was written last, the
// doubles are used; otherwise somebody has set the field, and its value is used. Everything is built again from the
// fields and the doubles when the structure changes: bodies, joints, collidables or shapes come or go, or a field
// changes that ODE cannot change in place. Threading: the scene's thread; steps of several scenes wait for each other,
// as ODE has one source of random numbers.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include <ode/ode.h>

#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/bus.h>
#include <rtsg/physics/rigid_body_physics.h>
#include <rtsg/renderers/tessellator.h>

namespace rtsg {

namespace physics {

struct Pose {
    glm::dvec3 position{0};
    glm::dquat rotation{1, 0, 0, 0};
    Pose operator*(const Pose& inner) const {
        return {position + rotation * inner.position, rotation * inner.rotation};
    }
    Pose inverse() const {
        const glm::dquat back = glm::conjugate(rotation);
        return {back * -position, back};
    }
};

bool isFinite(const Pose& pose);

constexpr std::size_t kNone = SIZE_MAX;

/// The values that a body's fields hold.
struct Written {
    Vec3f position{0}, linearVelocity{0}, angularVelocity{0};
    Rotation orientation;
    friend bool operator==(const Written&, const Written&) = default;
};

struct Body {
    NodeId id;
    std::size_t world = 0;
    dBodyID body = nullptr;  // none: fixed or not enabled, it stands where its fields say
    Pose pose;               // of the node's origin; the engine's is that of the centre of mass
    glm::dvec3 centre{0}, linear{0}, angular{0}, before{0};
    Written written;
    bool isStuck = false;  // what came of it was no number: it rests until somebody sets it
    std::vector<std::size_t> geoms;
};

struct Geom {
    dGeomID geom = nullptr;
    dTriMeshDataID mesh = nullptr;
    std::vector<double> corners;
    std::vector<dTriIndex> triangles;
    NodeId listed, leaf;       // as bodies and collections name it; the CollidableShape
    std::size_t body = kNone;  // in Engine::bodies
    Pose offset;               // CollidableOffsets above the leaf
    Pose shape;                // from the engine's axes to the Shape's
    std::uint64_t collections = 0;
    bool isOn = true;
};

/// The poses of a joint's bodies when it was made, for when everything is built anew.
struct JointStart {
    std::vector<float> signature;  // of the values that it was made from
    Pose first, second;
};

struct Joint {
    NodeId id;
    dJointID joint = nullptr;
    std::size_t first = kNone, second = kNone;  // bodies
};

struct World {
    NodeId id;
    dWorldID world = nullptr;
    dJointGroupID contacts = nullptr;
    NodeId collider;
    std::vector<std::size_t> bodies;
    std::vector<Joint> joints;
};

struct Hit {
    std::size_t first = 0, second = 0;  // geometries
    std::uint64_t collections = 0;
    dContactGeom point{};
};

/// The purpose that a node was used for.
enum class Use : std::uint8_t { structure, world, joint, parameters, leaf, body };

/// Makes ODE's geometry of a node; false, with the reason in `problem`, if it is nothing that can be hit.
struct GeomMaker {
    const Scene& scene;
    Tessellator& tessellator;
    std::string problem;
    bool make(const Node& geometry, Geom& into);

  private:
    bool mesh(const Node& geometry, Geom& into);
};

/// How a contact answers, of a CollisionCollection's or a Contact's fields.
struct Surface {
    const Array<String>* applied = nullptr;
    float bounce = 0, minBounceSpeed = 0, constantForce = 0, errorCorrection = 0;
    Vec2f friction{0}, slip{0}, speed{0};
    dSurfaceParameters parameters() const;
};

/// ODE's own state of a thread and its messages, which end no process: the first since it was taken.
void useThread();
std::string takeMessage();

}  // namespace physics

class RigidBodyPhysics::Engine final : public Subscriber {
  public:
    explicit Engine(Scene& scene);
    ~Engine() override;
    Scene& scene() { return scene_; }

    Result<> apply(const Scene& scene, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "rigid body physics"; }
    /// All worlds to the cascade's time, once a timestamp; for a node that may be new.
    void meet(Cascade& cascade, const Node& node);
    void advance(Cascade& cascade);
    void sense(Cascade& cascade, const Node& sensor);
    void giveContacts(const Node& collection, const Array<NodeId>& contacts);
    Counts counts() const;

  private:
    friend struct JointMaker;
    void build();
    void clear();
    void buildWorld(const Node& collection);
    void buildBody(const Node& node, std::size_t world);
    bool setMass(const Node& node, physics::Body& body);
    void buildCollidable(const Node& listed, std::size_t body, std::uint64_t collections);
    void buildLeaf(const std::vector<const Node*>& chain, std::size_t body, std::uint64_t collections);
    void buildCollections();
    void gatherMembers(const Array<NodeId>& members, std::uint64_t bit, int depth);
    void buildJoint(const Node& node, std::size_t world);
    void noteUse(NodeId id, physics::Use use) { uses_.insert_or_assign(id.value, use); }
    void useGeometry(const Node& node, int depth);

    bool takeField(physics::Body& body, const Node& node);
    void takeFields(physics::Body& body, const Node& node);
    void moveBody(physics::Body& body);
    void moveGeom(physics::Geom& geom);
    void wake(physics::Body& body);
    void setWorld(physics::World& world, const Node& node);
    void setBody(physics::Body& body, const Node& node, const Node& collection);
    void setJoint(const physics::Joint& joint, const Node& node);
    void frame(double count);
    void push();
    void step();
    void collide(std::uint64_t collections);
    static void near(void* engine, dGeomID a, dGeomID b);
    void join();
    void join(physics::World& world, const physics::Hit& hit, const Node& collection);
    void wakeGiven();
    void joinGiven(physics::World& world);
    void solve(physics::World& world);
    void settle(physics::World& world);
    void send(physics::Body& body, const Node& node);
    static void driveToStops(const physics::Joint& joint);
    void sendJoint(const physics::Joint& joint, const Node& node);
    void warn(NodeId id, const std::string& text);
    dBodyID bodyOf(std::size_t body, std::size_t world) const;
    std::size_t findBody(NodeId id) const;

    Scene& scene_;
    Cascade* cascade_ = nullptr;  // of the call under way
    Attachment attachment_;
    Tessellator tessellator_;
    dSpaceID space_ = nullptr;
    std::vector<physics::World> worlds_;
    std::vector<physics::Body> bodies_;
    std::vector<std::unique_ptr<physics::Geom>> geoms_;
    std::vector<NodeId> collections_;  // by bit
    std::uint64_t colliders_ = 0, sensed_ = 0;
    std::unordered_map<std::uint32_t, std::size_t> bodyOf_, worldOf_, geomOf_;
    /// Contact nodes that set_contacts brought for the next steps, by their RigidBodyCollection.
    std::unordered_map<std::uint32_t, std::vector<NodeId>> given_;
    std::unordered_map<std::uint32_t, physics::Use> uses_;
    std::unordered_map<std::uint32_t, physics::Body> kept_;  // over a rebuild
    std::unordered_map<std::uint32_t, physics::JointStart> starts_;
    std::unordered_map<std::uint32_t, std::vector<NodeId>> reports_;  // Contact nodes, by sensor
    // Bodies that somebody has set, and whether that alone wakes them; standing collidables.
    std::vector<std::pair<NodeId, bool>> dirty_;
    std::vector<NodeId> moved_;
    std::vector<std::pair<NodeId, std::string>> warnings_;  // for the next frame
    std::vector<physics::Hit> hits_;
    std::uint64_t mask_ = 0, steps_ = 0;
    double time_ = -1e300;
    bool isStale_ = true, isAwake_ = false, hasMoved_ = false, isFull_ = false;
    bool isBroken_ = false;  // for good
};

}  // namespace rtsg
