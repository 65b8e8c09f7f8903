// Draws one picture through one camera: its input, and the loop over its tiles.
//
// Threading: re-entrant; a picture's tiles are drawn by several threads.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include <rtsg/renderers/picture.h>
#include <rtsg/renderers/surface_tables.h>

#include "lighting/emitters.h"
#include "lighting/lamps.h"
#include "lighting/sky_light.h"
#include "lighting/trace_scene.h"
#include "packet/trail.h"
#include "path/hidden_light.h"
#include "picture_scene.h"
#include "surface/plain_surfaces.h"
#include "tables/light_tables.h"
#include "world/large_rays.h"

namespace rtsg::trace {

/// Draws what GeneratedCubeMapTextures show, along the world's axes.
/// `part`: slots that are not there, as Part::hidden.
void drawCubes(const LightState& state, const RayView& world, const Camera& camera, const RenderSettings& settings,
               const std::vector<bool>& part, TraceScene& scene);

/// The tiles that a picture's region takes part of, in pixels of the picture.
PixelRegion tilesAround(const RenderSettings& settings);
/// The region's part of a picture that covers tilesAround() it.
Picture cutToRegion(Picture picture, const RenderSettings& settings);

/// The sources of light that paths look for, and the surfaces that need no close look.
struct Sources {
    std::shared_ptr<const Emitters> emitters;
    Lamps lamps;
    std::shared_ptr<const SkyLight> sky;
    std::optional<PlainSurfaces> plain;
    std::optional<LargeRays> large;
};
/// Finds the sources and sets them in the scene; they must outlive it.
void lookForLight(TraceScene& scene, Sources& sources);

/// The tiles that a picture takes from the previous one.
struct Kept {
    Trail::Part* last = nullptr;      // where its tiles are, and to be; null: nothing is written down
    std::vector<std::uint8_t> tiles;  // which of them stay; empty: none
};

/// It covers tilesAround() the region. `stats` and `kept` may be null. `hidden`: of paths to an error.
Picture drawPicture(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, RenderStats* stats,
                    const Kept* kept = nullptr, const HiddenLight& hidden = {});

/// All of the above, cut to the region. `trail`: of the picture before, which must have begun; null: there is none.
Picture drawPart(const LightState& state, const RayView& world, const Camera& camera, const RenderSettings& settings,
                 const Part& part, RenderStats& stats, Trail* trail);

/// The layers of a LayerSet one over the other, each from its own viewpoint; that of `camera` is given (35.2).
/// `seen`: of each of them, by a rasteriser; or empty.
Picture drawLayers(const LightState& state, const RayView& world, const Camera& camera, const RenderSettings& settings,
                   RenderStats& stats, Trail* trail, std::span<const PrimarySight> seen);

/// Does what LightTracer::render() does, for a picture that follows others.
Result<Picture> drawNext(const std::shared_ptr<const LightState>& state,
                         const std::shared_ptr<const WorldVersion>& world, const Camera& camera,
                         const RenderSettings& settings, RenderStats& stats, Trail& trail);

/// The boxes around the layers of what rays meet, which must outlive it.
BoxOfLayer boxesOf(const LightState& state, const RayView& world);
/// The camera of a viewpoint; null: of the standard's default viewpoint.
Camera cameraOf(const LightState& state, const BoxOfLayer& boxes, const PlacedEntry* chosen, std::uint16_t layer,
                double aspect);
/// Does what LightTracer::camera() and layers() do, for any renderer that knows how far its layers reach.
Result<Camera> findCamera(const LightState& state, const BoxOfLayer& boxes, double aspect, std::string_view name);
std::vector<LayerView> findLayers(const LightState& state, const BoxOfLayer& boxes, const Camera& camera, int width,
                                  int height);

}  // namespace rtsg::trace
