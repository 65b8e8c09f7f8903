// The frame of rigid bodies: new values of fields, the steps up to the cascade's time, and their events.
#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <mutex>

#include <fmt/format.h>

#include <rtsg/core/module.h>
#include <rtsg/core/x3d.h>

#include "engine.h"

namespace rtsg::delayed {
extern DelayedLibrary ode;
}

namespace rtsg {

using namespace physics;

namespace {

using Bodies = x3d::RigidBodyCollection;

std::string& engineMessage() {
    thread_local std::string message;
    return message;
}

void keepMessage(int, const char* text, va_list parts) {
    char line[256];
    std::vsnprintf(line, sizeof(line), text, parts);
    if (engineMessage().empty()) engineMessage() = line;
}

/// A state that ODE holds to be impossible: it would end the process next. Nothing here should lead to it; if something
/// does, it ends the engine of one scene.
struct EngineFault {
    std::string text;
};
[[noreturn]] void throwFault(int, const char* text, va_list parts) {
    char line[256];
    std::vsnprintf(line, sizeof(line), text, parts);
    throw EngineFault{line};
}

RigidBodyPhysics::Engine& engineOf(const Cascade& cascade, const Node& node) {
    return *static_cast<RigidBodyPhysics::Engine*>(cascade.context(node));
}

double collectionOnTime(Cascade& cascade, const Node& node) {
    engineOf(cascade, node).meet(cascade, node);
    return node.get(Bodies::enabled) ? cascade.now() : kNever;
}

void collectionOnEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    if (field != Bodies::set_contacts.index) return;
    engineOf(cascade, node).giveContacts(node, value.as<Array<NodeId>>());
}

double sensorOnTime(Cascade& cascade, const Node& node) {
    RigidBodyPhysics::Engine& engine = engineOf(cascade, node);
    engine.meet(cascade, node);
    engine.sense(cascade, node);
    return node.get(x3d::CollisionSensor::enabled) ? cascade.now() : kNever;
}

/// The number of the last step that ends by `time`; a rounding of the clock is none of it.
double stepNumber(double time) {
    return std::floor(time / RigidBodyPhysics::kStep + 1e-4);
}

/// ODE has one source of random numbers for all worlds.
std::mutex& stepMutex() {
    static std::mutex mutex;
    return mutex;
}

}  // namespace

void physics::useThread() {
    static std::once_flag once;
    std::call_once(once, [] {
        if (const auto loaded = delayed::ode.load(); !loaded) throw EngineFault{loaded.error().text};
        dSetErrorHandler(throwFault), dSetDebugHandler(throwFault), dSetMessageHandler(keepMessage);
        dInitODE2(0);
    });
    dAllocateODEDataForThread(dAllocateMaskAll);
}

std::string physics::takeMessage() {
    return std::exchange(engineMessage(), {});
}

// ---- the scene's side ------------------------------------------------------------------------------------------

RigidBodyPhysics::RigidBodyPhysics(Scene& scene) : engine_(std::make_unique<Engine>(scene)) {
    scene.registerBehaviour(
        Bodies::type,
        {.onEvent = collectionOnEvent, .onTime = collectionOnTime, .last = true, .context = engine_.get()});
    scene.registerBehaviour(x3d::CollisionSensor::type,
                            {.onTime = sensorOnTime, .last = true, .context = engine_.get()});
}
RigidBodyPhysics::~RigidBodyPhysics() {
    for (const TypeIndex type : {Bodies::type, x3d::CollisionSensor::type})
        engine_->scene().registerBehaviour(type, Behaviour{});
}
bool RigidBodyPhysics::isAvailable() {
    return true;
}
RigidBodyPhysics::Counts RigidBodyPhysics::counts() const {
    return engine_->counts();
}

RigidBodyPhysics::Engine::Engine(Scene& scene) : scene_(scene) {
    // A scene that continues: the first frame starts from the present values of its fields.
    bool has = false;
    scene.forEachNode([&](const Node& node) { has = has || node.is(Bodies::type); });
    if (!has) return;
    try {
        useThread();
        build();
    } catch (const EngineFault& fault) {
        isBroken_ = true;
        warn(scene.root(), "its rigid bodies rest: ODE: " + fault.text);
    }
    attachment_ = scene.bus().attach(*this);
}
RigidBodyPhysics::Engine::~Engine() {
    attachment_.detach();
    if (!isBroken_) clear();  // a world that has failed is left alone
}
void RigidBodyPhysics::Engine::warn(NodeId id, const std::string& text) {
    if (!cascade_) {
        warnings_.emplace_back(id, text);
    } else if (const Node* node = scene_.find(id)) {
        cascade_->warn(*node, text);
    }
}

RigidBodyPhysics::Counts RigidBodyPhysics::Engine::counts() const {
    Counts counts{bodies_.size(), 0, geoms_.size(), hits_.size(), steps_};
    for (const Body& body : bodies_) counts.awake += body.body && dBodyIsEnabled(body.body) ? 1 : 0;
    return counts;
}

/// Notes what somebody has changed since the last frame. The engine's own events are among the changes.
Result<> RigidBodyPhysics::Engine::apply(const Scene& scene, const ChangeSet& changes) {
    if (changes.isSnapshot()) return {};
    for (const Change& change : changes.changes) {
        const auto use = uses_.find(change.node.value);
        if (use == uses_.end()) continue;
        const Node* node = scene.find(change.node);
        using S = x3d::CollisionSensor;
        if (node && node->is(S::type) && change.field != S::collider.index && change.field != S::enabled.index)
            continue;
        if (change.kind != ChangeKind::setField) {
            isStale_ = isStale_ || change.kind == ChangeKind::insertChild || change.kind == ChangeKind::removeChild ||
                       change.kind == ChangeKind::destroyNode;
            continue;
        }
        const Aspect aspect = node ? node->type().slot(change.field).aspect : Aspect::none;
        using B = x3d::RigidBody;
        switch (use->second) {
            case Use::body:
                dirty_.emplace_back(change.node, change.field != B::position.index &&
                                                     change.field != B::orientation.index &&
                                                     change.field != B::linearVelocity.index &&
                                                     change.field != B::angularVelocity.index);
                isStale_ = isStale_ || aspect == Aspect::structure || change.field == B::fixed.index ||
                           change.field == B::enabled.index || change.field == B::mass.index ||
                           change.field == B::inertia.index || change.field == B::centerOfMass.index;
                break;
            case Use::leaf:
                isStale_ =
                    isStale_ || aspect == Aspect::structure || change.field == x3d::CollidableShape::enabled.index;
                moved_.push_back(change.node);
                break;
            case Use::world:
            case Use::parameters:
                isStale_ = isStale_ || aspect == Aspect::structure;
                for (const Body& body : bodies_) dirty_.emplace_back(body.id, true);
                break;
            case Use::joint: {
                const FieldDef& field = node ? node->type().fields[change.field] : FieldDef{};
                if (field.sends() && !field.writable()) break;
                isStale_ = isStale_ || aspect == Aspect::structure || field.name == "anchorPoint" ||
                           field.name.find("xis") != std::string::npos;
                for (const Body& body : bodies_) dirty_.emplace_back(body.id, true);
                break;
            }
            case Use::structure:
                isStale_ = true;
                break;
        }
    }
    return {};
}

// ---- a frame ---------------------------------------------------------------------------------------------------

void RigidBodyPhysics::Engine::meet(Cascade& cascade, const Node& node) {
    if (isBroken_) {
        for (const auto& [id, text] : std::exchange(warnings_, {}))
            if (const Node* reported = scene_.find(id)) cascade.warn(*reported, text);
        return;
    }
    isStale_ = isStale_ || !uses_.contains(node.id().value);  // it is new
    try {
        advance(cascade);
    } catch (const EngineFault& fault) {
        isBroken_ = true;
        cascade_ = nullptr;
        cascade.warn(node, "rigid bodies rest from now on: ODE: " + fault.text);
    }
}

void RigidBodyPhysics::Engine::advance(Cascade& cascade) {
    if (time_ == cascade.now() && !isStale_) return;
    cascade_ = &cascade;
    useThread();
    for (const auto& [id, text] : std::exchange(warnings_, {})) warn(id, text);
    if (!attachment_.attached()) attachment_ = scene_.bus().attach(*this);
    if (isStale_) build();
    const double from = time_ == cascade.now() ? time_ : cascade.previous();
    time_ = cascade.now();
    // A resting body whose fields were set wakes. The fields of moving bodies are read in any case.
    for (const auto& [id, wakes] : dirty_) {
        const std::size_t index = findBody(id);
        const Node* node = scene_.find(id);
        if (index == kNone || !node) continue;
        if (bodies_[index].body && dBodyIsEnabled(bodies_[index].body)) continue;
        if (takeField(bodies_[index], *node))
            bodies_[index].isStuck = false, moveBody(bodies_[index]);
        else if (!wakes)
            continue;
        wake(bodies_[index]);
    }
    dirty_.clear();
    for (const NodeId id : moved_)
        if (const auto found = geomOf_.find(id.value); found != geomOf_.end())
            if (geoms_[found->second]->body == kNone) moveGeom(*geoms_[found->second]);
    moved_.clear();
    wakeGiven();
    double count = stepNumber(time_) - stepNumber(from);
    if (count > kLongestFrame / kStep) {
        warn(worlds_.empty() ? scene_.root() : worlds_.front().id,
             fmt::format("frames are more than {} s apart: what is more is left out", kLongestFrame));
        count = std::floor(kLongestFrame / kStep);
    }
    frame(count);
    if (count > 0) given_.clear();  // frames may be shorter than a step
    cascade_ = nullptr;
}

void RigidBodyPhysics::Engine::frame(double count) {
    if (isAwake_) {
        std::vector<bool> wasAwake(bodies_.size());
        for (std::size_t w = 0; w < worlds_.size(); ++w) {
            const Node* collection = scene_.find(worlds_[w].id);
            if (!collection) continue;
            setWorld(worlds_[w], *collection);
            for (const std::size_t index : worlds_[w].bodies) {
                Body& body = bodies_[index];
                const Node* node = scene_.find(body.id);
                if (!node) continue;
                if (!body.body) continue;
                setBody(body, *node, *collection);
                wasAwake[index] = dBodyIsEnabled(body.body);
            }
            for (const Joint& joint : worlds_[w].joints)
                if (const Node* node = scene_.find(joint.id)) setJoint(joint, *node);
        }
        for (; count > 0; --count) step();
        isAwake_ = false;
        for (World& world : worlds_) {
            for (const std::size_t index : world.bodies) {
                Body& body = bodies_[index];
                const Node* node = scene_.find(body.id);
                // A value that was set in this frame holds at the frame's time.
                if (node && takeField(body, *node)) body.isStuck = false, moveBody(body), wake(body);
                const bool awake = body.body && dBodyIsEnabled(body.body);
                isAwake_ = isAwake_ || awake;
                if (node && (awake || wasAwake[index] || !body.body)) send(body, *node);
            }
            for (const Joint& joint : world.joints)
                if (const Node* node = scene_.find(joint.id)) sendJoint(joint, *node);
        }
        hasMoved_ = true;
    }
    if (hasMoved_ && sensed_) collide(sensed_);
}

void RigidBodyPhysics::Engine::step() {
    if (std::ranges::none_of(bodies_, [](const Body& body) { return body.body && dBodyIsEnabled(body.body); })) return;
    ++steps_;
    push();
    collide(colliders_);
    join();
    const std::lock_guard lock(stepMutex());
    dRandSetSeed(static_cast<unsigned long>(steps_));
    for (World& world : worlds_) solve(world);
}

void RigidBodyPhysics::Engine::solve(World& world) {
    const Node* node = scene_.find(world.id);
    if (!node || !node->get(Bodies::enabled)) return;
    std::size_t rows = 6 * world.joints.size();
    for (const std::size_t index : world.bodies) {
        Body& body = bodies_[index];
        if (!body.body) continue;
        const dReal* v = dBodyGetLinearVel(body.body);
        body.before = {v[0], v[1], v[2]};
        rows += 3 * static_cast<std::size_t>(dBodyGetNumJoints(body.body));
    }
    bool accurate = node->get(Bodies::preferAccuracy);
    if (accurate && rows > kMaxAccurateRows) {
        warn(world.id,
             fmt::format("has more than {} rows to solve: preferAccuracy is left out then", kMaxAccurateRows));
        accurate = false;
    }
    for (const Joint& joint : world.joints) driveToStops(joint);
    const int done = accurate ? dWorldStep(world.world, kStep) : dWorldQuickStep(world.world, kStep);
    if (!done) warn(world.id, "takes more memory for a step than there is: it stands");
    settle(world);
    dJointGroupEmpty(world.contacts);
    if (const std::string message = takeMessage(); !message.empty()) warn(world.id, "ODE: " + message);
}

}  // namespace rtsg
