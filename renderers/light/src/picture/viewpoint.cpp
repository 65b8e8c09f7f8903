// The eye of a picture: finds the viewpoint, and makes its camera.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "draw.h"
#include "tables/active.h"

namespace rtsg {

using namespace trace;

namespace {

/// 36.2.1: laid-out content is seen by an OrthoViewpoint of its own, whichever viewpoint is bound.
bool isLaidOut(const LightState& state, std::uint16_t layer) {
    return state.layers && std::ranges::any_of(state.layers->order, [&](const LayerList::Layer& one) {
               return one.number == layer && one.laidOut;
           });
}

}  // namespace

std::vector<LayerSight> LightTracer::sights(const std::vector<LayerView>& views, int width, int height) {
    std::vector<LayerSight> sights;
    for (const LayerView& view : views) {
        const Camera& camera = view.camera;
        LayerSight sight{.layer = camera.layer, .width = view.width, .height = view.height};
        const double w = width, h = height;
        sight.part = {view.left / w, (view.left + view.width) / w, view.top / h, (view.top + view.height) / h};
        sight.eye = camera.position, sight.limit = std::min(camera.visibilityLimit, camera.farDistance);
        sight.right = camera.right, sight.up = camera.up, sight.forward = camera.forward;
        sight.kind = camera.panorama       ? LayerSight::Kind::around
                     : camera.orthographic ? LayerSight::Kind::parallel
                                           : LayerSight::Kind::perspective;
        sight.edges = {camera.left, camera.rightEdge, camera.bottom, camera.top};
        sights.push_back(sight);
    }
    return sights;
}

namespace {

/// The bounds of a layer's content, in ray space. A viewpoint sees its own layer alone (35.4.2).
Bounds boundsOf(const LightState& state, const RayView& world, std::uint16_t layer) {
    if (!state.layers) return world.bounds();
    Bounds bounds;
    for (const RayInstance& instance : world.instances()) {
        if (!instance.info.id || !instance.info.seen || !instance.mesh || instance.info.layer != layer ||
            instance.mesh->bounds.empty())
            continue;
        const Vec3f corners[] = {instance.mesh->bounds.min, instance.mesh->bounds.max};
        for (int k = 0; k < 8; ++k)
            bounds.extend(instance.rayFromLocal * Vec4f(corners[k & 1].x, corners[k >> 1 & 1].y, corners[k >> 2].z, 1));
    }
    return bounds;
}

}  // namespace

BoxOfLayer trace::boxesOf(const LightState& state, const RayView& world) {
    return [&state, &world](std::uint16_t layer) {
        const Bounds bounds = boundsOf(state, world, layer);
        return bounds.empty() ? WorldBox() : WorldBox{world.toWorld(bounds.min), world.toWorld(bounds.max)};
    };
}

Camera trace::cameraOf(const LightState& state, const BoxOfLayer& boxes, const PlacedEntry* chosen, std::uint16_t layer,
                       double aspect) {
    Camera camera;
    if (const std::uint16_t of = chosen ? chosen->placed.layer : layer; isLaidOut(state, of)) {
        camera = Camera::parallel(identityTransform(), {0, 0, 10}, {}, {-1, -1, 1, 1}, aspect);
        camera.layer = of;
        return camera;
    }
    if (!chosen) {
        camera = Camera::perspective(identityTransform(), {0, 0, 10}, {}, 0.7854, aspect);
        if (const WorldBox box = state.layers ? WorldBox() : boxes(layer); !box.empty())
            camera.frame(box.lower, box.upper);
        camera.layer = layer;
        return camera;
    }
    const View& view = std::get<View>(chosen->what);
    camera = view.orthographic
                 ? Camera::parallel(chosen->placed.worldFromLocal, view.position, view.orientation, view.extent, aspect)
                 : Camera::perspective(chosen->placed.worldFromLocal, view.position, view.orientation, view.fieldOfView,
                                       aspect);
    camera.layer = chosen->placed.layer;
    camera.viewpoint = chosen->placed.node;
    if (view.viewAll)
        if (const WorldBox box = boxes(camera.layer); !box.empty())
            camera.viewAll(box.lower, box.upper, chosen->placed.worldFromLocal[1]);
    if (view.nearDistance > 0) camera.nearDistance = view.nearDistance;
    if (view.farDistance > 0)
        camera.farDistance = view.farDistance;
    else if (const Navigation* navigation = activeNavigation(state, camera.layer))
        if (const float limit = navigation->visibilityLimit; limit > 0) camera.visibilityLimit = limit;
    return camera;
}

Result<Camera> LightTracer::camera(const LightState& state, const RayView& world, double aspect,
                                   std::string_view name) {
    return findCamera(state, boxesOf(state, world), aspect, name);
}

Result<Camera> trace::findCamera(const LightState& state, const BoxOfLayer& boxes, double aspect,
                                 std::string_view name) {
    if (!(aspect > 0) || !std::isfinite(aspect)) return fail("a picture's width and height must be positive");
    const PlacedEntry* chosen = nullptr;
    const std::uint16_t layer = state.layers ? state.layers->active : std::uint16_t{0};
    if (name.empty()) {
        chosen = active<View>(state, layer);
    } else {
        std::string known;
        for (std::size_t i = 0; i < state.placed.size(); ++i) {
            const PlacedEntry* entry = state.placed[i].get();
            if (const View* view = entry ? std::get_if<View>(&entry->what) : nullptr) {
                const bool matches = view->name == name || view->description == name;
                if (matches && (!chosen || view->name == name)) chosen = entry;
                known += fmt::format("{}\"{}\"", known.empty() ? "" : ", ",
                                     view->name.empty() ? view->description : view->name);
            }
        }
        if (!chosen)
            return fail(
                fmt::format("no viewpoint is called \"{}\"; there are: {}", name, known.empty() ? "none" : known));
    }
    return cameraOf(state, boxes, chosen, layer, aspect);
}

}  // namespace rtsg
