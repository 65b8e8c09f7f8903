// Carries out a user's choices about navigation.
#include "viewing/navigation_requests.h"

#include <algorithm>

#include <rtsg/core/navigation.h>

namespace rtsg {

namespace {

using Wish = SceneWindowRequest::Kind;

constexpr double kSlowest = 1e-6, kFastest = 1e9;  // metres a second

Result<> chooseNamed(Scene& scene, const std::string& name) {
    for (const auto type : {NavigationType::examine, NavigationType::walk, NavigationType::fly, NavigationType::lookAt,
                            NavigationType::none})
        if (nameOf(type) == name) return chooseNavigation(scene, type);
    return fail("there is no type of navigation " + name);
}

}  // namespace

bool isAboutMoving(const SceneWindowRequest& request) {
    return request.kind >= Wish::navigation && request.kind <= Wish::straighten;
}

Result<> carryOut(const SceneWindowRequest& request, Scene& scene, SpaceQueries& space, ObstacleRules& rules) {
    switch (request.kind) {
        case Wish::navigation:
            return chooseNamed(scene, request.field);
        case Wish::walls:
            rules.walls = request.on;
            return {};
        case Wish::ground:
            rules.ground = request.on;
            return {};
        case Wish::speed:
            return chooseSpeed(scene, std::clamp(navigationSpeed(scene) * request.number, kSlowest, kFastest));
        case Wish::viewAll:
            return viewAll(scene, space);
        default:
            return straightenViewer(scene);
    }
}

Result<> carryOut(const SceneWindowRequest& request, OwnEye& eye, ObstacleRules& rules) {
    const Result<> done =
        eye.choose([&](Scene& own, SpaceQueries& space) { return carryOut(request, own, space, rules); });
    eye.setObstacles(rules);
    return done;
}

void describeMoving(const Scene& scene, const ObstacleRules& rules, SceneWindowChoices& choices) {
    choices.navigation = nameOf(navigationType(scene));
    choices.speed = navigationSpeed(scene);
    choices.walls = rules.walls, choices.ground = rules.ground;
}

}  // namespace rtsg
