// Finds which bodies touch, joins them by contacts, and reports to CollisionSensors (37.4.3 to 37.4.6).
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "engine.h"

namespace rtsg {

using namespace physics;

namespace {

using C = x3d::CollisionCollection;
using T = x3d::Contact;

Surface surfaceOf(const Node& collection) {
    return {&collection.get(C::appliedParameters),
            collection.get(C::bounce),
            collection.get(C::minBounceSpeed),
            collection.get(C::softnessConstantForceMix),
            collection.get(C::softnessErrorCorrection),
            collection.get(C::frictionCoefficients),
            collection.get(C::slipFactors),
            collection.get(C::surfaceSpeed)};
}

Surface surfaceOfContact(const Node& contact) {
    return {&contact.get(T::appliedParameters),      contact.get(T::bounce),
            contact.get(T::minBounceSpeed),          contact.get(T::softnessConstantForceMix),
            contact.get(T::softnessErrorCorrection), contact.get(T::frictionCoefficients),
            contact.get(T::slipCoefficients),        contact.get(T::surfaceSpeed)};
}

dReal clampTo(double value, double low, double high) {
    return value >= low ? std::min(value, high) : low;  // NaN: low
}

bool has(const Surface& surface, std::string_view name) {
    return std::ranges::any_of(*surface.applied, [&](const String& one) { return one.view() == name; });
}

/// The velocity of the first body relative to the second, where they touch.
glm::dvec3 speedAt(dBodyID a, dBodyID b, const dContactGeom& point) {
    glm::dvec3 speed(0);
    dVector3 v;
    if (a) dBodyGetPointVel(a, point.pos[0], point.pos[1], point.pos[2], v), speed += glm::dvec3(v[0], v[1], v[2]);
    if (b) dBodyGetPointVel(b, point.pos[0], point.pos[1], point.pos[2], v), speed -= glm::dvec3(v[0], v[1], v[2]);
    return speed;
}

/// Sliding is along this: the friction of the engine's pyramid is then that of Coulomb's cone.
bool slideDirection(dBodyID a, dBodyID b, const glm::dvec3& speed, const glm::dvec3& normal, glm::dvec3& along) {
    along = speed - normal * glm::dot(normal, speed);
    if (glm::length(along) < 1e-6 && (a || b)) {
        dVector3 v;
        dWorldGetGravity(dBodyGetWorld(a ? a : b), v);
        along = glm::dvec3(v[0], v[1], v[2]);
        along -= normal * glm::dot(normal, along);
    }
    const double length = glm::length(along);
    if (!(length > 1e-9)) return false;
    along /= length;
    return true;
}

/// The engine drives what overlaps apart, and a step of a fast body is deep: bodies that meet would part faster than
/// their bounce has it. So those that meet are not driven apart, and those that part are not made faster by it.
void sparePush(dContact& contact, dWorldID world, double apart) {
    constexpr double kRests = 0.2;  // m/s: slower ones lie on each other
    if ((contact.surface.mode & dContactSoftERP) || std::abs(apart) < kRests) return;
    contact.surface.mode |= dContactSoftERP;
    const double maximum = contact.geom.depth > 0 ? apart * RigidBodyPhysics::kStep / contact.geom.depth : 1;
    contact.surface.soft_erp = apart < 0 ? 0 : std::min(dWorldGetERP(world), maximum);
}

}  // namespace

dSurfaceParameters physics::Surface::parameters() const {
    dSurfaceParameters out{};
    out.mode = dContactApprox1;
    out.mu = clampTo(friction.x, 0, 1e9);
    const auto use = [&](std::string_view name, int flag, dReal& into, double value) {
        if (!has(*this, name)) return;
        out.mode |= flag;
        into = value;
    };
    use("BOUNCE", dContactBounce, out.bounce, clampTo(bounce, 0, 1));
    out.bounce_vel = clampTo(minBounceSpeed, 0, 1e9);
    use("FRICTION_COEFFICIENT-2", dContactMu2, out.mu2, clampTo(friction.y, 0, 1e9));
    use("ERROR_REDUCTION", dContactSoftERP, out.soft_erp, clampTo(errorCorrection, 0, 1));
    use("CONSTANT_FORCE", dContactSoftCFM, out.soft_cfm, clampTo(constantForce, 0, 1e9));
    use("SPEED-1", dContactMotion1, out.motion1, clampTo(speed.x, -1e9, 1e9));
    use("SPEED-2", dContactMotion2, out.motion2, clampTo(speed.y, -1e9, 1e9));
    use("SLIP-1", dContactSlip1, out.slip1, clampTo(slip.x, 0, 1e9));
    use("SLIP-2", dContactSlip2, out.slip2, clampTo(slip.y, 0, 1e9));
    return out;
}

dBodyID RigidBodyPhysics::Engine::bodyOf(std::size_t body, std::size_t world) const {
    return body != kNone && bodies_[body].world == world && !bodies_[body].isStuck ? bodies_[body].body : nullptr;
}

void RigidBodyPhysics::Engine::near(void* self, dGeomID a, dGeomID b) {
    auto& engine = *static_cast<Engine*>(self);
    if (engine.hits_.size() >= kMaxContacts) {
        engine.isFull_ = true;
        return;
    }
    auto first = reinterpret_cast<std::size_t>(dGeomGetData(a)),
         second = reinterpret_cast<std::size_t>(dGeomGetData(b));
    if (first > second) std::swap(first, second), std::swap(a, b);
    const Geom &one = *engine.geoms_[first], &other = *engine.geoms_[second];
    const std::uint64_t common = one.collections & other.collections & engine.mask_;
    if (common == 0 || (one.body != kNone && one.body == other.body)) return;
    const dBodyID left = dGeomGetBody(a), right = dGeomGetBody(b);
    if (!(common & engine.sensed_) && !(left && dBodyIsEnabled(left)) && !(right && dBodyIsEnabled(right))) return;
    constexpr int kPoints = 16;
    dContactGeom points[kPoints];
    const int count = dCollide(a, b, kPoints, points, sizeof(dContactGeom));
    for (int i = 0; i < count; ++i) {
        const dReal* n = points[i].normal;
        const double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        if (!(std::abs(length - 1) < 1e-3) || !(points[i].depth >= 0)) continue;  // of triangles without area
        engine.hits_.push_back({first, second, common, points[i]});
    }
}

/// In an order that does not depend on the way that the engine looks for pairs.
void RigidBodyPhysics::Engine::collide(std::uint64_t collections) {
    hits_.clear();
    mask_ = 0;
    for (std::size_t bit = 0; bit < collections_.size() && bit < 64; ++bit) {
        const Node* node = scene_.find(collections_[bit]);
        if (node && node->get(C::enabled)) mask_ |= collections & std::uint64_t{1} << bit;
    }
    if (mask_ == 0) return;
    dSpaceCollide(space_, this, &Engine::near);
    std::ranges::stable_sort(
        hits_, [](const Hit& a, const Hit& b) { return a.first != b.first ? a.first < b.first : a.second < b.second; });
    if (std::exchange(isFull_, false))
        warn(worlds_.empty() ? scene_.root() : worlds_.front().id,
             fmt::format("has more than {} contacts in a step: those beyond do nothing", kMaxContacts));
}

void RigidBodyPhysics::Engine::join() {
    for (World& world : worlds_) {
        const Node* self = scene_.find(world.id);
        if (!self || !self->get(x3d::RigidBodyCollection::enabled)) continue;
        joinGiven(world);
        const auto found = std::ranges::find(collections_, world.collider);
        const Node* collection = scene_.find(world.collider);
        if (!collection || found == collections_.end()) continue;
        const std::uint64_t bit = std::uint64_t{1} << (found - collections_.begin());
        for (const Hit& hit : hits_)
            if (hit.collections & bit) join(world, hit, *collection);
    }
}

void RigidBodyPhysics::Engine::join(World& world, const Hit& hit, const Node& collection) {
    const std::size_t index = static_cast<std::size_t>(&world - worlds_.data());
    const dBodyID a = bodyOf(geoms_[hit.first]->body, index), b = bodyOf(geoms_[hit.second]->body, index);
    if (!a && !b) return;
    if (a && b && dAreConnectedExcluding(a, b, dJointTypeContact)) return;  // bodies connected by a joint may overlap
    dContact contact{};
    contact.geom = hit.point;
    contact.surface = surfaceOf(collection).parameters();
    const glm::dvec3 speed = speedAt(a, b, hit.point);
    const glm::dvec3 normal(hit.point.normal[0], hit.point.normal[1], hit.point.normal[2]);
    sparePush(contact, world.world, glm::dot(speed, normal));
    glm::dvec3 along;
    if (contact.surface.mu > 0 && slideDirection(a, b, speed, normal, along)) {
        contact.surface.mode |= dContactFDir1;
        contact.fdir1[0] = along.x, contact.fdir1[1] = along.y, contact.fdir1[2] = along.z;
    }
    dJointAttach(dJointCreateContact(world.world, world.contacts, &contact), a, b);
}

/// Joins bodies by the Contacts that set_contacts brought, as the fields of these say.
void RigidBodyPhysics::Engine::joinGiven(World& world) {
    const std::size_t index = static_cast<std::size_t>(&world - worlds_.data());
    const auto given = given_.find(world.id.value);
    if (given == given_.end()) return;
    for (const NodeId id : given->second) {
        const Node* node = scene_.find(id);
        if (!node) continue;
        const Node *first = scene_.effectiveNode(node->get(T::body1)),
                   *second = scene_.effectiveNode(node->get(T::body2));
        const dBodyID a = first ? bodyOf(findBody(first->id()), index) : nullptr;
        const dBodyID b = second ? bodyOf(findBody(second->id()), index) : nullptr;
        const glm::dvec3 at(node->get(T::position)), normal(node->get(T::contactNormal));
        const double depth = node->get(T::depth), length = glm::length(normal);
        if ((!a && !b) || a == b) continue;
        if (!isFinite({at, {}}) || !(length > 1e-6) || !(length < 1e6) || !(std::abs(depth) < 1e6)) {
            warn(id, "has a place, depth or normal that cannot be: it does nothing");
            continue;
        }
        dContact contact{};
        contact.surface = surfaceOfContact(*node).parameters();
        for (int i = 0; i < 3; ++i) contact.geom.pos[i] = at[i], contact.geom.normal[i] = normal[i] / length;
        contact.geom.depth = depth;
        const glm::dvec3 friction(node->get(T::frictionDirection));
        const glm::dvec3 along = friction - normal * (glm::dot(friction, normal) / (length * length));
        if (has(surfaceOfContact(*node), "USER_FRICTION") && glm::length(along) > 1e-6 && glm::length(along) < 1e6) {
            contact.surface.mode |= dContactFDir1;
            for (int i = 0; i < 3; ++i) contact.fdir1[i] = glm::normalize(along)[i];
        }
        dJointAttach(dJointCreateContact(world.world, world.contacts, &contact), a, b);
    }
}

/// Kept until the frame's steps are done: the bodies may not have been met yet.
void RigidBodyPhysics::Engine::giveContacts(const Node& collection, const Array<NodeId>& contacts) {
    std::vector<NodeId>& given = given_[collection.id().value];
    given.clear();
    for (const NodeId id : contacts)
        if (const Node* node = scene_.effectiveNode(id); node && node->is(T::type)) given.push_back(node->id());
}

void RigidBodyPhysics::Engine::wakeGiven() {
    for (const auto& [collection, contacts] : given_)
        for (const NodeId id : contacts) {
            const Node* node = scene_.find(id);
            if (!node) continue;
            for (const NodeId body : {node->get(T::body1), node->get(T::body2)})
                if (const Node* one = scene_.effectiveNode(body))
                    if (const std::size_t index = findBody(one->id()); index != kNone) wake(bodies_[index]);
        }
}

/// 37.4.5: isActive, the points of contact and the collidables that have some. Its Contact nodes are used again.
void RigidBodyPhysics::Engine::sense(Cascade& cascade, const Node& sensor) {
    if (isBroken_) return;
    using S = x3d::CollisionSensor;
    const Node* collider = scene_.effectiveNode(sensor.get(S::collider));
    const auto found = collider ? std::ranges::find(collections_, collider->id()) : collections_.end();
    const bool listens = sensor.get(S::enabled) && found != collections_.end();
    if (listens && !hasMoved_) return;
    const std::uint64_t bit = listens ? std::uint64_t{1} << (found - collections_.begin()) : 0;
    std::vector<const Hit*> met;
    for (const Hit& hit : hits_)
        if (hit.collections & bit) met.push_back(&hit);
    if (met.size() > kMaxReported) {
        cascade.warn(sensor, fmt::format("has more than {} contacts: it tells of so many", kMaxReported));
        met.resize(kMaxReported);
    }
    auto& pool = reports_[sensor.id().value];
    if (pool.empty()) pool.assign(sensor.get(S::contacts).begin(), sensor.get(S::contacts).end());
    std::erase_if(pool, [&](NodeId id) { return !scene_.find(id); });
    while (pool.size() < met.size()) pool.push_back(scene_.createNode(T::type));
    std::vector<NodeId> shapes;
    for (std::size_t i = 0; i < met.size(); ++i) {
        const Geom &one = *geoms_[met[i]->first], &other = *geoms_[met[i]->second];
        const dContactGeom& at = met[i]->point;
        const Node& node = scene_.node(pool[i]);
        const auto bodyId = [&](const Geom& geom) { return geom.body == kNone ? NodeId{} : bodies_[geom.body].id; };
        cascade.emit(node, T::body1, bodyId(one)), cascade.emit(node, T::body2, bodyId(other));
        cascade.emit(node, T::geometry1, one.listed), cascade.emit(node, T::geometry2, other.listed);
        cascade.emit(node, T::position, Vec3f(at.pos[0], at.pos[1], at.pos[2]));
        cascade.emit(node, T::contactNormal, Vec3f(at.normal[0], at.normal[1], at.normal[2]));
        cascade.emit(node, T::depth, static_cast<float>(at.depth));
        cascade.emit(node, T::appliedParameters, collider->get(C::appliedParameters));
        cascade.emit(node, T::bounce, collider->get(C::bounce));
        cascade.emit(node, T::minBounceSpeed, collider->get(C::minBounceSpeed));
        cascade.emit(node, T::frictionCoefficients, collider->get(C::frictionCoefficients));
        cascade.emit(node, T::slipCoefficients, collider->get(C::slipFactors));
        cascade.emit(node, T::softnessConstantForceMix, collider->get(C::softnessConstantForceMix));
        cascade.emit(node, T::softnessErrorCorrection, collider->get(C::softnessErrorCorrection));
        cascade.emit(node, T::surfaceSpeed, collider->get(C::surfaceSpeed));
        for (const NodeId id : {one.listed, other.listed})
            if (std::ranges::find(shapes, id) == shapes.end()) shapes.push_back(id);
    }
    const bool active = !met.empty();
    if (active || !sensor.get(S::contacts).empty())
        cascade.emit(sensor, S::contacts, Array<NodeId>(std::span<const NodeId>(pool.data(), met.size())));
    const Array<NodeId> intersections{std::span<const NodeId>(shapes)};
    if (!std::ranges::equal(sensor.get(S::intersections), intersections))
        cascade.emit(sensor, S::intersections, intersections);
    if (sensor.get(S::isActive) != active) cascade.emit(sensor, S::isActive, active);
}

}  // namespace rtsg
