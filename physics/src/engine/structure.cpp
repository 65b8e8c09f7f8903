// Builds the engine's worlds from the scene: collections of bodies, their geometry, and which of them may collide.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/core/rotation.h>
#include <rtsg/core/x3d.h>

#include "engine.h"

namespace rtsg {

using namespace physics;

namespace {

using B = x3d::RigidBody;
constexpr int kDeepest = 32;  // collidables in collidables, spaces in spaces

bool isCollidable(const Node& node) {
    return node.is(x3d::CollidableShape::type) || node.is(x3d::CollidableOffset::type);
}

Pose poseOf(const Node& collidable) {
    const bool isShape = collidable.is(x3d::CollidableShape::type);
    const Vec3f position = isShape ? collidable.get(x3d::CollidableShape::translation)
                                   : collidable.get(x3d::CollidableOffset::translation);
    const Rotation& rotation =
        isShape ? collidable.get(x3d::CollidableShape::rotation) : collidable.get(x3d::CollidableOffset::rotation);
    const Pose pose{glm::dvec3(position), toQuaternion(rotation)};
    return isFinite(pose) ? pose : Pose{};
}

/// All leading minors: what rotates by it has energy, whichever way.
bool isPositiveDefinite(const std::array<float, 9>& m) {
    const double a = m[0], b = m[1], c = m[2], d = m[4], e = m[5], f = m[8];
    return a > 0 && a * d - b * b > 0 && a * (d * f - e * e) - b * (b * f - e * c) + c * (b * e - d * c) > 0;
}

}  // namespace

void RigidBodyPhysics::Engine::clear() {
    for (Body& body : bodies_) {
        kept_.insert_or_assign(body.id.value, body);
        kept_[body.id.value].isStuck = body.isStuck;
    }
    for (World& world : worlds_) {
        dJointGroupDestroy(world.contacts);
        dWorldDestroy(world.world);  // with its bodies and joints
    }
    for (auto& geom : geoms_) {
        dGeomDestroy(geom->geom);
        if (geom->mesh) dGeomTriMeshDataDestroy(geom->mesh);
    }
    if (space_) dSpaceDestroy(space_);
    space_ = nullptr;
    worlds_.clear(), bodies_.clear(), geoms_.clear(), collections_.clear(), hits_.clear();
    bodyOf_.clear(), worldOf_.clear(), geomOf_.clear(), uses_.clear(), dirty_.clear(), moved_.clear();
    colliders_ = sensed_ = 0;
}

void RigidBodyPhysics::Engine::build() {
    clear();
    isStale_ = false;
    space_ = dSweepAndPruneSpaceCreate(nullptr, dSAP_AXES_XZY);
    dSpaceSetCleanup(space_, 0);
    std::vector<const Node*> collections;
    scene_.forEachNode([&](const Node& node) {
        if (node.is(x3d::RigidBodyCollection::type)) collections.push_back(&node);
    });
    for (const Node* node : collections) buildWorld(*node);
    buildCollections();
    for (std::size_t w = 0; w < worlds_.size(); ++w)
        for (const NodeId id : scene_.node(worlds_[w].id).get(x3d::RigidBodyCollection::joints))
            if (const Node* joint = scene_.effectiveNode(id)) buildJoint(*joint, w);
    kept_.clear();
    isAwake_ = hasMoved_ = true;
}

void RigidBodyPhysics::Engine::buildWorld(const Node& collection) {
    using C = x3d::RigidBodyCollection;
    const std::size_t index = worlds_.size();
    World& world = worlds_.emplace_back();
    world.id = collection.id();
    world.world = dWorldCreate();
    world.contacts = dJointGroupCreate(0);
    dWorldSetMaxAngularSpeed(world.world, dInfinity);
    worldOf_[collection.id().value] = index;
    noteUse(collection.id(), Use::world);
    if (const Node* collider = scene_.effectiveNode(collection.get(C::collider))) world.collider = collider->id();
    for (const NodeId id : collection.get(C::bodies)) {
        const Node* body = scene_.effectiveNode(id);
        if (!body || !body->is(B::type)) continue;
        if (bodyOf_.contains(body->id().value)) {
            warn(body->id(), "is a body of two collections, or twice of one: the first one moves it");
            continue;
        }
        buildBody(*body, index);
    }
}

bool RigidBodyPhysics::Engine::setMass(const Node& node, Body& body) {
    const double mass = node.get(B::mass);
    if (!(mass > 0) || !(mass < 1e30)) {
        warn(node.id(), fmt::format("mass {} is none that a body can have: it stands still", mass));
        return false;
    }
    dMass all;
    dMassSetSphereTotal(&all, mass, 0.5);
    const Node* model = scene_.effectiveNode(node.get(B::massDensityModel));
    const auto sound = [](double length) { return length > 0 && length < 1e9; };
    bool modelled = false;
    if (model && model->is(x3d::Box::type)) {
        const Vec3f size = model->get(x3d::Box::size);
        modelled = sound(size.x) && sound(size.y) && sound(size.z);
        if (modelled) dMassSetBoxTotal(&all, mass, size.x, size.y, size.z);
    } else if (model && model->is(x3d::Sphere::type)) {
        const double radius = model->get(x3d::Sphere::radius);
        modelled = sound(radius);
        if (modelled) dMassSetSphereTotal(&all, mass, radius);
    } else if (model && model->is(x3d::Cone::type)) {
        const double r = model->get(x3d::Cone::bottomRadius), h = model->get(x3d::Cone::height);
        // The moments of inertia of a solid cone about its centre of mass, a quarter of the height above the bottom.
        const double across = mass * (3 * r * r / 20 + 3 * h * h / 80), along = mass * 3 * r * r / 10;
        modelled = sound(r) && sound(h);
        if (modelled) dMassSetParameters(&all, mass, 0, 0, 0, across, along, across, 0, 0, 0);
    }
    if (model && !modelled) warn(node.id(), "massDensityModel has no size that can be: inertia counts");
    if (!modelled) {
        const auto& m = node.get(B::inertia).elements;
        const bool finite = std::ranges::all_of(m, [](float one) { return std::abs(one) < 1e30f; });
        const float slack = 1e-5f * (std::abs(m[0]) + std::abs(m[4]) + std::abs(m[8]));
        const bool symmetric =
            std::abs(m[1] - m[3]) <= slack && std::abs(m[2] - m[6]) <= slack && std::abs(m[5] - m[7]) <= slack;
        if (finite && symmetric && isPositiveDefinite(m)) {
            dMassSetParameters(&all, mass, 0, 0, 0, m[0], m[4], m[8], m[1], m[2], m[5]);
        } else {
            warn(node.id(), "inertia is not symmetric and positive definite: that of the unit matrix counts");
            dMassSetParameters(&all, mass, 0, 0, 0, 1, 1, 1, 0, 0, 0);
        }
    }
    dBodySetMass(body.body, &all);
    return true;
}

void RigidBodyPhysics::Engine::buildBody(const Node& node, std::size_t world) {
    const std::size_t index = bodies_.size();
    Body& body = bodies_.emplace_back();
    body.id = node.id();
    body.world = world;
    bodyOf_[node.id().value] = index;
    worlds_[world].bodies.push_back(index);
    noteUse(node.id(), Use::body);
    const glm::dvec3 centre(node.get(B::centerOfMass));
    if (isFinite({centre, {}})) body.centre = centre;
    const auto kept = kept_.find(node.id().value);
    if (kept != kept_.end()) {
        const Body& old = kept->second;
        body.pose = old.pose, body.linear = old.linear, body.angular = old.angular;
        body.written = old.written, body.isStuck = old.isStuck;
        takeFields(body, node);
    } else {
        body.written.position.x = std::nanf("");  // nothing has been: all fields count
        body.written.orientation.x = body.written.linearVelocity.x = body.written.angularVelocity.x =
            body.written.position.x;
        takeFields(body, node);
    }
    if (!node.get(B::fixed) && node.get(B::enabled)) {
        body.body = dBodyCreate(worlds_[world].world);
        if (!setMass(node, body)) {
            dBodyDestroy(body.body);
            body.body = nullptr;
        }
    }
    if (body.body && body.isStuck) dBodyDisable(body.body);
    for (const NodeId id : node.get(B::geometry))
        if (const Node* collidable = scene_.effectiveNode(id)) buildCollidable(*collidable, index, 0);
    moveBody(bodies_[index]);
}

/// Down the CollidableOffsets to the CollidableShape. Known already: only its collections are more.
void RigidBodyPhysics::Engine::buildCollidable(const Node& listed, std::size_t body, std::uint64_t collections) {
    std::vector<const Node*> chain;
    const Node* at = &listed;
    for (int depth = 0; at && depth < kDeepest && isCollidable(*at); ++depth) {
        chain.push_back(at);
        noteUse(at->id(), at->is(x3d::CollidableShape::type) ? Use::leaf : Use::structure);
        if (at->is(x3d::CollidableShape::type)) break;
        at = scene_.effectiveNode(at->get(x3d::CollidableOffset::collidable));
    }
    if (chain.empty() || !chain.back()->is(x3d::CollidableShape::type)) return;
    const auto known = geomOf_.find(chain.back()->id().value);
    if (known != geomOf_.end()) {
        if (collections == 0 && body != kNone)
            warn(chain.back()->id(), "is the geometry of two bodies, or twice of one: the first one moves it");
        geoms_[known->second]->collections |= collections;
        return;
    }
    buildLeaf(chain, body, collections);
}

void RigidBodyPhysics::Engine::buildLeaf(const std::vector<const Node*>& chain, std::size_t body,
                                         std::uint64_t collections) {
    const Node& leaf = *chain.back();
    auto geom = std::make_unique<Geom>();
    geom->listed = chain.front()->id(), geom->leaf = leaf.id();
    geom->body = body, geom->collections = collections;
    for (const Node* one : chain) {
        if (one != &leaf) geom->offset = geom->offset * poseOf(*one);
        geom->isOn = geom->isOn && (one == &leaf ? one->get(x3d::CollidableShape::enabled)
                                                 : one->get(x3d::CollidableOffset::enabled));
    }
    const Node* shape = scene_.effectiveNode(leaf.get(x3d::CollidableShape::shape));
    const Node* geometry =
        shape && shape->is(x3d::Shape::type) ? scene_.effectiveNode(shape->get(x3d::Shape::geometry)) : nullptr;
    if (shape) noteUse(shape->id(), Use::structure);
    if (geometry) useGeometry(*geometry, 0);
    GeomMaker maker{scene_, tessellator_, {}};
    if (!geometry || !maker.make(*geometry, *geom)) {
        warn(leaf.id(), geometry ? maker.problem : "has no geometry: nothing collides with it");
        return;  // not even drawn: there is nothing to move
    }
    dGeomSetData(geom->geom, reinterpret_cast<void*>(geoms_.size()));  // NOLINT(performance-no-int-to-ptr): an index
    dSpaceAdd(space_, geom->geom);
    if (!geom->isOn) dGeomDisable(geom->geom);
    geomOf_[leaf.id().value] = geoms_.size();
    if (body != kNone) {
        Body& owner = bodies_[body];
        owner.geoms.push_back(geoms_.size());
        if (owner.body) {
            dGeomSetBody(geom->geom, owner.body);
            const Pose inner = Pose{-owner.centre, {1, 0, 0, 0}} * geom->offset * geom->shape;
            dGeomSetOffsetPosition(geom->geom, inner.position.x, inner.position.y, inner.position.z);
            const dQuaternion rotation{inner.rotation.w, inner.rotation.x, inner.rotation.y, inner.rotation.z};
            dGeomSetOffsetQuaternion(geom->geom, rotation);
        }
    }
    geoms_.push_back(std::move(geom));
    if (body == kNone) moveGeom(*geoms_.back());
}

void RigidBodyPhysics::Engine::useGeometry(const Node& node, int depth) {
    noteUse(node.id(), Use::structure);
    if (depth > 4) return;
    for (const FieldIndex field : node.type().nodeFields()) {
        if (!node.type().fields[field].readable() || node.type().slot(field).type != FieldType::SFNode) continue;
        if (const Node* below = scene_.effectiveNode(*static_cast<const NodeId*>(node.storage(field))))
            useGeometry(*below, depth + 1);
    }
}

void RigidBodyPhysics::Engine::buildCollections() {
    const auto use = [&](NodeId id, std::uint64_t& mask) {
        const auto found = std::ranges::find(collections_, id);
        const std::size_t bit = static_cast<std::size_t>(found - collections_.begin());
        if (bit >= 64) return warn(id, "is the 65th CollisionCollection in use: its contacts are not looked for");
        if (found == collections_.end()) {
            collections_.push_back(id);
            noteUse(id, Use::parameters);
            gatherMembers(scene_.node(id).get(x3d::CollisionCollection::collidables), std::uint64_t{1} << bit, 0);
        }
        mask |= std::uint64_t{1} << bit;
    };
    for (const World& world : worlds_)
        if (world.collider) use(world.collider, colliders_);
    scene_.forEachNode([&](const Node& node) {
        if (!node.is(x3d::CollisionSensor::type)) return;
        noteUse(node.id(), Use::structure);
        const Node* collider = scene_.effectiveNode(node.get(x3d::CollisionSensor::collider));
        if (collider && node.get(x3d::CollisionSensor::enabled)) use(collider->id(), sensed_);
    });
}

void RigidBodyPhysics::Engine::gatherMembers(const Array<NodeId>& members, std::uint64_t bit, int depth) {
    if (depth > kDeepest) return;
    for (const NodeId id : members) {
        const Node* member = scene_.effectiveNode(id);
        if (!member) continue;
        if (isCollidable(*member)) {
            buildCollidable(*member, kNone, bit);
        } else if (member->is(x3d::CollisionSpace::type)) {
            noteUse(member->id(), Use::structure);
            if (member->get(x3d::CollisionSpace::enabled))
                gatherMembers(member->get(x3d::CollisionSpace::collidables), bit, depth + 1);
        }
    }
}

/// One that no body has, or one whose body stands.
void RigidBodyPhysics::Engine::moveGeom(Geom& geom) {
    Pose pose;
    if (geom.body == kNone) {
        const Node* leaf = scene_.find(geom.leaf);
        if (!leaf) return;
        pose = geom.offset * poseOf(*leaf);
    } else {
        pose = bodies_[geom.body].pose * geom.offset;
    }
    pose = pose * geom.shape;
    dGeomSetPosition(geom.geom, pose.position.x, pose.position.y, pose.position.z);
    const dQuaternion rotation{pose.rotation.w, pose.rotation.x, pose.rotation.y, pose.rotation.z};
    dGeomSetQuaternion(geom.geom, rotation);
    hasMoved_ = true;
}

}  // namespace rtsg
