// OgreRenderer: pictures of a scene by OGRE's rasteriser, as one of the renderers of a SharedWorld.
//
// Invariant: a picture shows the scene's present state, however it got there, as LightRenderer's by `whitted` without
// shadows and mirrors does; the work of a change follows what it changes. No rays are asked for, but by hybrid
// pictures. What a rasteriser cannot show, such as mirrors, is named in diagnostics(). OGRE is a module that is loaded
// with the first picture; it needs a display, and draws on a thread of its own. Threading: as WorldRenderer; pictures
// of states come in the order of the states. Source: paper section 5.1; ISO/IEC 19775-1 V4.0 17.2.2.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/renderers/light_renderer.h>
#include <rtsg/renderers/world_renderer.h>

namespace rtsg {

/// How much a picture shows: instances, and their triangles, those of shared meshes counted for each.
struct RasterContent {
    std::uint64_t instances = 0, triangles = 0;
};

class OgreRenderer final : public WorldRenderer {
  public:
    /// Attached on return; if that failed, attached() is false and renderFrame() says why.
    explicit OgreRenderer(SharedWorld& world, LightRenderer::Options options = {});
    ~OgreRenderer() override;

    /// Makes the picture of the scene's present state. Errors: as nextPicture().
    Result<> renderFrame() override;
    /// Makes the picture of that state. Errors: as nextPicture(); a picture of a later state has been made already.
    Result<> renderFrame(const WorldState& state) override;
    const Picture& frame() const;
    /// Makes ready what draws; else the first picture does. Errors: there is no module, or no display for it.
    Result<> open();
    /// The one that the last picture was taken with.
    const Camera& camera() const;
    /// renderFrame() with other options; hands the picture out, in the display's space. RenderStats::seconds counts.
    /// Errors: there is no module or no display; an unknown viewpoint; whatever options ask that it cannot do: shadows,
    /// panoramas, lenses, two eyes, layers of data, errors to reach, a shutter, another colour space.
    Result<Picture> nextPicture(const ImageOptions& options, RenderStats* stats = nullptr);
    /// The same of a state, by whoever looks on, as LightRenderer::nextPicture(); on any thread, one call at a time. If
    /// a picture of a later state has been made already there is none: RenderStats::cancelled.
    Result<Picture> nextPicture(const WorldState& state, const ImageOptions& options, const OwnLook& look,
                                RenderStats& stats);

    /// A hybrid picture of the present state, with all that `whitted` shows: the rasteriser finds the surfaces that the
    /// eye sees (PrimarySight), rays go on from there where shadows fall or a material asks for mirrors or glass, and
    /// where nothing is to be added the rasteriser's colour stays. Several samples are averaged as display values.
    /// RenderStats::primaryRays counts what did not stay. diagnostics() names nothing of it that rays have shown.
    /// Errors: as nextPicture() and LightTracer::render(), without those of shadows and colour spaces.
    Result<Picture> hybridPicture(const ImageOptions& options, RenderStats* stats = nullptr);

    /// What draws, as the graphics system calls it; empty before the first picture.
    std::string driver() const;
    /// What has been handed to the graphics system since the start; for tests of the invariant.
    struct Counts {
        std::uint64_t bent = 0;  // meshes of which only what moved was handed over; `meshes`: whole ones
        std::uint64_t meshes = 0, textures = 0, materials = 0, things = 0, moved = 0, tables = 0;
        double handing = 0;  // CPU seconds of the calling thread for all of that
        double tracing = 0;  // CPU seconds of the process while rays of hybrid pictures run
    };
    /// Precondition of both: no picture is being made.
    Counts counts() const;
    RasterContent content() const;
    const Diagnostics& diagnostics() const;
    std::string subscriberName() const override { return "OGRE renderer"; }

  protected:
    Result<> follow(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override;
    std::shared_ptr<const void> freezeTables() override;
    std::optional<PictureSight> looksFrom() override;

  private:
    Result<std::vector<LayerView>> look(const ImageOptions& options);
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
