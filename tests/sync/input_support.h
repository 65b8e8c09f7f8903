// Scenes that are hard to run again elsewhere: random edits, and behaviours that are not deterministic.
#pragma once

#include <random>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/frame_input.h>
#include <rtsg/core/x3d.h>

#include "support/random_edits.h"

namespace rtsg::test {

/// Data that no replica can know: shared by the behaviours below, which are plain functions.
struct Fate {
    std::mt19937_64 random{0};
    Scene* scene = nullptr;  // edited from within the cascade when `meddling`
    std::vector<NodeId> acquaintances;
    bool meddling = false;
    std::uint64_t calls = 0, meddled = 0;

    std::size_t pick(std::size_t n) { return random() % n; }
    float number() { return static_cast<float>(pick(1000)) / 8; }
};
inline Fate& fate() {
    static thread_local Fate one;
    return one;
}

inline bool fickleAccepts(const Node&, FieldIndex, EventValue) {
    ++fate().calls;
    return fate().pick(4) != 0;
}
inline void fickleAct(Cascade& cascade, const Node& node) {
    using L = x3d::PointLight;
    Fate& f = fate();
    ++f.calls;
    if (f.pick(2)) cascade.emit(node, L::intensity, f.number());
    if (f.pick(3) == 0) cascade.store(node, L::radius, f.number());
    if (f.pick(2) && !f.acquaintances.empty()) {
        const NodeId id = f.acquaintances[f.pick(f.acquaintances.size())];
        if (const Node* other = cascade.scene().find(id)) {
            const auto field = static_cast<FieldIndex>(f.pick(other->type().fields.size()));
            const FieldDef& def = other->type().fields[field];
            if (def.type == FieldType::SFTime)
                (void)cascade.deliver(id, field, Value(Time{cascade.now() + f.number() / 100}));
            else if (def.type == FieldType::SFFloat)
                (void)cascade.deliver(id, field, Value(f.number()));
            else if (def.type == FieldType::SFBool)
                (void)cascade.deliver(id, field, Value(f.pick(2) == 0));
            else if (def.type == FieldType::MFNode)
                (void)cascade.deliver(id, field, Value(Array<NodeId>{node.id()}));
        }
    }
    if (f.meddling && f.pick(6) == 0 && f.scene) {
        ++f.meddled;
        const NodeId created = f.scene->createNode(x3d::Group::type);
        (void)f.scene->insertChild(f.scene->root(), x3d::RtsgScene::children.index, created);
    }
}
inline void fickleOnEvent(Cascade& cascade, const Node& node, FieldIndex, EventValue) {
    fickleAct(cascade, node);
}
inline double fickleOnTime(Cascade& cascade, const Node& node) {
    fickleAct(cascade, node);
    switch (fate().pick(3)) {
        case 0:
            return cascade.now();
        case 1:
            return cascade.now() + fate().number() / 100;
        default:
            return kNever;
    }
}
/// A PointLight that does what it likes.
inline Behaviour fickle() {
    return {.accepts = fickleAccepts, .onEvent = fickleOnEvent, .onTime = fickleOnTime};
}

/// A Material that answers every event, always in the same way.
inline void steadyOnEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue) {
    using M = x3d::Material;
    if (field != M::shininess.index) cascade.emit(node, M::shininess, node.get(M::shininess) * .5f + .25f);
}
inline Behaviour steady() {
    return {.onEvent = steadyOnEvent, .deterministic = true};
}

/// A life of random edits, events, seals and frames; `eachSet` sees every set.
template <class EachSet>
void live(Scene& scene, std::uint64_t seed, int frames, bool withFate, bool meddling, EachSet eachSet) {
    RandomEdits edits(scene, seed);
    std::mt19937_64 random(seed ^ 0xF00D);
    fate() = {};
    fate().random.seed(seed ^ 0xFA7E);
    fate().scene = &scene;
    fate().meddling = meddling;
    if (withFate) {
        scene.registerBehaviour(x3d::PointLight::type, fickle());
        scene.registerBehaviour(x3d::Material::type, steady());
        for (int i = 0; i < 3; ++i) edits.adopt(scene.createNode(x3d::PointLight::type));
    }
    double t = 0;
    for (int frame = 0; frame < frames; ++frame) {
        for (std::size_t i = random() % 12; i > 0; --i) edits.step();
        fate().acquaintances = edits.nodes();
        if (random() % 9 == 0) {
            if (const auto sealed = scene.seal()) eachSet(*sealed);
            continue;
        }
        t += static_cast<double>(random() % 4) * .03;
        eachSet(*scene.newFrame(t));
    }
}

}  // namespace rtsg::test
