// The table of built-in behaviours by node type.
#include "behaviours.h"

#include <rtsg/core/never_destroyed.h>
#include <rtsg/core/x3d.h>

namespace rtsg {

std::span<const BuiltinBehaviour> builtinBehaviours() {
    static const auto& table = neverDestroyed([] {
        using namespace behaviours;
        std::vector<BuiltinBehaviour> t;
        t.push_back({x3d::LOD::type, {.onTime = lodOnTime, .last = true}});
        t.push_back({x3d::RtsgScene::type, {.onEvent = rootOnEvent, .onTime = rootOnTime}});
        appendTimeSensor(t);
        appendInterpolators(t);
        appendFollowers(t);
        appendSplines(t);
        appendNurbs(t);
        appendEnvironmentalSensors(t);
        appendTriggers(t);
        appendBindables(t);
        appendPointing(t);
        appendKeys(t);
        appendLoadSensor(t);
        appendPickSensors(t);
        appendMeasures(t);
        appendMedia(t);
        appendParticles(t);
        appendMotions(t);
        appendPoses(t);
        appendGeoLod(t);
        appendDis(t);
        for (BuiltinBehaviour& one : t) one.behaviour.deterministic = true;
        return t;
    });
    return table;
}

}  // namespace rtsg
