// UnderSky: a scene of `rtsg bench frames` as matte things in the light of an even white sky, which other programs can
// be given too.
//
// Threading: one at a time.
#pragma once

#include <filesystem>
#include <memory>
#include <string_view>

#include <rtsg/core/scene.h>
#include <rtsg/renderers/light_renderer.h>

namespace rtsg::bench {

class UnderSky {
  public:
    /// The scene of that name, with this share of its triangles. Throws std::runtime_error where it cannot be made.
    UnderSky(std::string_view name, double scale);

    struct Known {
        double seconds = 0;  // CPU time of one thread: flattening, BVH and picture
        double error = 0;    // measured as RenderStats::error, but by two pictures of different seeds
        double mean = 0;     // of the picture
        double rays = 0;
        Picture picture;
    };
    /// A square picture by paths, sampled until `error` or, of each pixel if that is 0, with `most` samples.
    Known picture(int side, double error, int most) const;
    /// The same by the method that follows no diffuse light; its error is that from `truth`, measured alike.
    Known whitted(int side, const Picture& truth) const;
    std::size_t triangles() const { return triangles_; }

    /// The eye, meshes, and instances with their colours, as the script of cycles.cpp reads them.
    void write(const std::filesystem::path& file) const;

  private:
    Known take(const ImageOptions& options) const;
    std::unique_ptr<Scene> scene_;
    std::size_t triangles_ = 0;
};

}  // namespace rtsg::bench
