// UnderSky: a scene of `rtsg bench frames` as matte things in the light of an even white sky, which other programs can
// be given too.
//
// Threading: one at a time.
#pragma once

#include <filesystem>
#include <memory>
#include <string_view>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/renderers/light_renderer.h>
#include <rtsg/renderers/shared_world.h>

namespace rtsg::bench {

/// A square picture by paths on one thread, sampled until `error` or, of each pixel if that is 0, with `most` samples.
ImageOptions pathOptions(int side, double error, int maximum);

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
    Known picture(int side, double error, int maximum) const;
    /// The same by the method that follows no diffuse light; its error is that from `truth`, measured alike.
    Known whitted(int side, const Picture& truth) const;
    std::size_t triangles() const { return triangles_; }

    /// The eye, meshes, and instances with their colours, as the script of cycles.cpp reads them.
    void write(const std::filesystem::path& file) const;
    /// The same for POV-Ray, which is to be told how many `rays` its radiosity sends from a place.
    void writePov(const std::filesystem::path& file) const;
    /// How far a picture is from the truth, measured as Known::error.
    static double errorFrom(const Picture& picture, const Picture& truth);

  private:
    struct Item {
        std::size_t mesh = 0;  // its number
        Color color{1, 1, 1};  // display value
        WorldFromLocal worldFromLocal{1.0};
    };
    struct Content {
        std::unique_ptr<SharedWorld> world;  // keeps the meshes
        Camera eye;
        std::vector<const Mesh*> meshes;
        std::vector<Item> items;
    };
    Content content() const;
    Known take(const ImageOptions& options) const;
    std::unique_ptr<Scene> scene_;
    std::size_t triangles_ = 0;
};

}  // namespace rtsg::bench
