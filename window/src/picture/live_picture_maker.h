// LivePictureMaker: the renderer that makes the pictures of a LivePicture.
//
// Threading: open() and the constructor on the scene's thread; next() and camera() on any, one call at a time; the rest
// on any.
#pragma once

#include <memory>

#include <rtsg/window/live_picture.h>

namespace rtsg {

class LivePictureMaker {
  public:
    virtual ~LivePictureMaker() = default;
    /// Error: a requirement is missing.
    virtual Result<> open() = 0;
    virtual const WorldRenderer& renderer() const = 0;
    /// Whether node renderers draw into its pictures, on the scene's thread.
    virtual bool ownsNodes() const { return false; }
    /// Whether pictures of two states may differ.
    virtual bool differ(const WorldState& a, const WorldState& b) const {
        return renderer().tables(a) != renderer().tables(b);
    }
    /// Whether a picture by these settings may take over pixels of the one before.
    virtual bool keeps(const RenderSettings& settings) const = 0;
    /// The camera of a picture of this state, before any eye of one's own. Only if it keeps().
    virtual Result<Camera> camera(const WorldState& state, double aspect) const = 0;
    virtual Result<Picture> next(const WorldState& state, const ImageOptions& options, const OwnLook& look,
                                 RenderStats& stats) = 0;
    /// The one that the last picture was taken with.
    virtual const Camera& camera() const = 0;
    virtual std::string name() const = 0;
    /// Since the start. On the scene's thread.
    virtual const Diagnostics& diagnostics() const = 0;
};

std::unique_ptr<LivePictureMaker> makeLivePictureMaker(SharedWorld& world, const LivePictureOptions& options);

}  // namespace rtsg
