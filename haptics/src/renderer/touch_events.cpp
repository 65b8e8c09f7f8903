// Sends contact as a pointer's events, and its force to metadata and to the touched rigid body.
#include "touch_events.h"

#include <vector>

#include <glm/geometric.hpp>

#include <rtsg/core/x3d.h>

namespace rtsg::haptics {

namespace {

/// The RigidBody that moves a Shape; none if it is not a body's.
NodeId bodyOf(const Scene& scene, NodeId shape) {
    NodeId found;
    scene.forEachNode([&](const Node& node) {
        if (!node.is(x3d::RigidBody::type)) return;
        for (const NodeId id : node.get(x3d::RigidBody::geometry)) {
            const Node* collidable = scene.find(id);
            if (collidable && collidable->is(x3d::CollidableShape::type) &&
                collidable->get(x3d::CollidableShape::shape) == shape)
                found = node.id();
        }
    });
    return found;
}

/// The MetadataFloat named "force" in the "RTSG" set of a Shape's Appearance; none if there is none.
NodeId forceOf(const Scene& scene, NodeId shape) {
    const Node* node = scene.find(shape);
    const Node* appearance =
        node && node->is(x3d::Shape::type) ? scene.find(node->get(x3d::Shape::appearance)) : nullptr;
    if (!appearance || !appearance->is(x3d::Appearance::type)) return {};
    const Node* set = scene.find(appearance->get(x3d::Appearance::metadata));
    if (!set || !set->is(x3d::MetadataSet::type) || set->get(x3d::MetadataSet::name) != String("RTSG")) return {};
    for (const NodeId id : set->get(x3d::MetadataSet::value)) {
        const Node* entry = scene.find(id);
        if (entry && entry->is(x3d::MetadataFloat::type) && entry->get(x3d::MetadataFloat::name) == String("force"))
            return id;
    }
    return {};
}

}  // namespace

void TouchEvents::send(Scene& scene, const HapticTick& strongest, const HapticTick& last) {
    const double force = glm::length(strongest.force);
    if (strongest.touching) point(scene, strongest, force >= pressAt_);
    if (!last.touching) leave(scene);
    const NodeId shape = last.touching ? last.shape : NodeId();
    if (felt_ && *felt_ != shape) sayForce(scene, *felt_, Vec3d(0));
    const bool isNew = !felt_ || *felt_ != shape || last.force != said_;
    felt_.reset();
    if (last.touching) {
        if (isNew) sayForce(scene, shape, last.force);
        felt_ = shape;
        said_ = last.force;
    }
    if (isNew || !last.touching) pushBody(scene, last);
}

/// The proxy points at the touched shape.
void TouchEvents::point(Scene& scene, const HapticTick& tick, bool presses) {
    PointerInput input;
    input.device = pointer_;
    input.buttons = presses ? PointerInput::kPrimary : 0;
    input.origin = tick.proxy;
    input.direction = -tick.normal;
    if (sent_ && sent_->buttons == input.buttons && sent_->origin == input.origin &&
        sent_->direction == input.direction)
        return;
    if (sendPointer(scene, input)) sent_ = input;
}

/// Releases the button over the shape, as a TouchSensor needs, and then removes the pointer.
void TouchEvents::leave(Scene& scene) {
    if (!sent_) return;
    if (sent_->buttons) {
        sent_->buttons = 0;
        (void)sendPointer(scene, *sent_);
    }
    PointerInput gone;
    gone.kind = PointerInput::Kind::absent;
    gone.device = pointer_;
    (void)sendPointer(scene, gone);
    sent_.reset();
}

void TouchEvents::sayForce(Scene& scene, NodeId shape, const Vec3d& force) {
    const NodeId entry = forceOf(scene, shape);
    if (!entry) return;
    Array<float> value{static_cast<float>(force.x), static_cast<float>(force.y), static_cast<float>(force.z)};
    (void)scene.sendEvent(entry, x3d::MetadataFloat::value.index, Value(std::move(value)));
}

/// Pushes the touched body at the place of contact, with the opposite of the force on the hand.
void TouchEvents::pushBody(Scene& scene, const HapticTick& tick) {
    using Body = x3d::RigidBody;
    const NodeId shape = tick.touching ? tick.shape : NodeId();
    if (pushed_ && pushed_->shape != shape) letGo(scene);
    if (!shape) return;
    if (!pushed_) {
        pushed_ = Pushed{shape, bodyOf(scene, shape), {}, {}};
        if (const Node* body = scene.find(pushed_->body))
            pushed_->forces = body->get(Body::forces), pushed_->torques = body->get(Body::torques);
    }
    const Node* body = scene.find(pushed_->body);
    if (!body) return;
    const Vec3d force = -tick.force;
    const Vec3d arm = tick.position - Vec3d(body->get(Body::position));
    const auto with = [](const Array<Vec3f>& before, const Vec3d& more) {
        std::vector<Vec3f> all(before.begin(), before.end());
        all.emplace_back(more);
        return Value(Array<Vec3f>(std::move(all)));
    };
    (void)scene.sendEvent(pushed_->body, Body::forces.index, with(pushed_->forces, force));
    (void)scene.sendEvent(pushed_->body, Body::torques.index, with(pushed_->torques, glm::cross(arm, force)));
}

void TouchEvents::letGo(Scene& scene) {
    using Body = x3d::RigidBody;
    if (scene.find(pushed_->body)) {
        (void)scene.sendEvent(pushed_->body, Body::forces.index, Value(pushed_->forces));
        (void)scene.sendEvent(pushed_->body, Body::torques.index, Value(pushed_->torques));
    }
    pushed_.reset();
}

}  // namespace rtsg::haptics
