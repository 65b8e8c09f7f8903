// Pictures of whoever looks on, by rays or by OGRE.
#include "live_picture_maker.h"

#include <utility>

#include <fmt/format.h>

#include <rtsg/ogre/ogre_renderer.h>

namespace rtsg {

namespace {

LightRenderer::Options rendererOptions(const LivePictureOptions& options) {
    ImageOptions image;
    image.settings = options.settings;
    return LightRenderer::Options(options.resources, image);
}

class TracedPictures final : public LivePictureMaker {
  public:
    TracedPictures(SharedWorld& world, const LivePictureOptions& options)
        : renderer_(world, rendererOptions(options)), ownsNodes_(options.prepare && options.prepare(renderer_)) {}
    Result<> open() override { return {}; }
    bool ownsNodes() const override { return ownsNodes_; }
    const WorldRenderer& renderer() const override { return renderer_; }
    bool differ(const WorldState& a, const WorldState& b) const override {
        return a.rays != b.rays || LivePictureMaker::differ(a, b) || (ownsNodes_ && a.sequence != b.sequence);
    }
    bool keeps(const RenderSettings& settings) const override { return settings.integrator == Integrator::whitted; }
    Result<Camera> camera(const WorldState& state, double aspect) const override {
        const auto light = std::static_pointer_cast<const LightState>(renderer_.tables(state));
        if (!light || !state.rays) return fail("this state was made without its renderer");
        return LightTracer::camera(*light, *state.rays, aspect);
    }
    Result<Picture> next(const WorldState& state, const ImageOptions& options, const OwnLook& look,
                         RenderStats& stats) override {
        return renderer_.nextPicture(state, options, look, &stats);
    }
    const Camera& camera() const override { return renderer_.camera(); }
    const Diagnostics& diagnostics() const override { return renderer_.diagnostics(); }
    std::string name() const override { return "rays"; }

  private:
    LightRenderer renderer_;
    const bool ownsNodes_;
};

class RasteredPictures final : public LivePictureMaker {
  public:
    RasteredPictures(SharedWorld& world, const LivePictureOptions& options)
        : renderer_(world, rendererOptions(options)) {}
    Result<> open() override { return renderer_.open(); }
    const WorldRenderer& renderer() const override { return renderer_; }
    bool keeps(const RenderSettings&) const override { return false; }
    Result<Camera> camera(const WorldState&, double) const override { return fail("it keeps no pixels"); }
    Result<Picture> next(const WorldState& state, const ImageOptions& options, const OwnLook& look,
                         RenderStats& stats) override {
        return renderer_.nextPicture(state, options, look, stats);
    }
    const Camera& camera() const override { return renderer_.camera(); }
    const Diagnostics& diagnostics() const override { return renderer_.diagnostics(); }
    std::string name() const override { return fmt::format("OGRE, {}", renderer_.driver()); }

  private:
    OgreRenderer renderer_;
};

}  // namespace

std::unique_ptr<LivePictureMaker> makeLivePictureMaker(SharedWorld& world, const LivePictureOptions& options) {
    if (options.settings.integrator == Integrator::raster) return std::make_unique<RasteredPictures>(world, options);
    return std::make_unique<TracedPictures>(world, options);
}

}  // namespace rtsg
