// OgreRenderer: pictures of a scene by OGRE's rasteriser, as one of the renderers of a SharedWorld.
//
// Invariant: a picture shows the scene's present state, like LightRenderer's pictures by `whitted` without shadows and
// mirrors; the cost of an update follows the changes. Only hybrid pictures use rays. Things that a rasteriser cannot
// show, such as mirrors, are named in diagnostics(). OGRE is a module that is loaded with the first picture; it needs a
// display, and draws on a thread of its own. Threading: as for WorldRenderer; pictures must be made in the order of
// their states. Source: paper section 5.1; ISO/IEC 19775-1 V4.0 17.2.2.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/renderers/light_renderer.h>
#include <rtsg/renderers/world_renderer.h>

namespace rtsg {

/// The content of a picture: instances and their triangles, where shared meshes count for each instance.
struct RasterContent {
    std::uint64_t instances = 0, triangles = 0;
};

class OgreRenderer final : public WorldRenderer {
  public:
    /// Attaches to the world; if that failed, attached() is false and renderFrame() says why.
    explicit OgreRenderer(SharedWorld& world, LightRenderer::Options options = {});
    ~OgreRenderer() override;

    /// Makes the picture of the scene's present state. Errors: as for nextPicture().
    Result<> renderFrame() override;
    /// Makes the picture of that state. Errors: as for nextPicture(); a picture of a later state has been made already.
    Result<> renderFrame(const WorldState& state) override;
    const Picture& frame() const;
    /// Opens the graphics system; otherwise the first picture does. Errors: there is no module, or no display.
    Result<> open();
    /// The camera of the last picture.
    const Camera& camera() const;
    /// The same as renderFrame() with other options; returns the picture, in the display space. It sets
    /// RenderStats::seconds. Errors: there is no module or no display; an unknown viewpoint; options that it does not
    /// support: shadows, panoramas, lenses, stereo, data layers, error targets, a shutter, another colour space.
    Result<Picture> nextPicture(const ImageOptions& options, RenderStats* stats = nullptr);
    /// The same for a state, for any viewer, as LightRenderer::nextPicture(); on any thread, one call at a time. If a
    /// picture of a later state has been made already, there is none: RenderStats::cancelled.
    Result<Picture> nextPicture(const WorldState& state, const ImageOptions& options, const OwnLook& look,
                                RenderStats& stats);

    /// A hybrid picture of the present state, with all effects of `whitted`. The rasteriser finds the visible surfaces
    /// (PrimarySight), and rays continue from there where shadows fall or a material has mirrors or glass; elsewhere
    /// the rasteriser's colour stays. Several samples are averaged as display values. RenderStats::primaryRays counts
    /// the pixels that rays changed. diagnostics() does not name effects that rays have shown. Errors: as for
    /// nextPicture() and LightTracer::render(), without those for shadows and colour spaces.
    Result<Picture> hybridPicture(const ImageOptions& options, RenderStats* stats = nullptr);

    /// The graphics driver, as the graphics system calls it; empty before the first picture.
    std::string driver() const;
    /// Counts of uploads to the graphics system since the start; for tests of the invariant.
    struct Counts {
        std::uint64_t bent = 0;  // meshes of which only changed vertices were uploaded; `meshes` counts whole ones
        std::uint64_t meshes = 0, textures = 0, materials = 0, objects = 0, moved = 0, tables = 0;
        double handing = 0;  // CPU seconds of the calling thread for these uploads
        double tracing = 0;  // CPU seconds of the process while rays of hybrid pictures run
    };
    /// Precondition of both functions: no picture is being made.
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
