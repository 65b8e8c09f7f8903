// TextureStore: the textures of one scene. Each is read once, however many materials and renderers use it and however
// often those change.
//
// A url list is tried in order, each as core/resource.h says. A file that cannot be read, or has more pixels than the
// policy allows, is reported to everybody who asks, and tried again only when the list changes. Threading: one thread,
// the scene's.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <unordered_set>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/renderers/material.h>
#include <rtsg/renderers/space_texture.h>
#include <rtsg/renderers/texture.h>

#include "movie.h"

namespace rtsg {

class TextureStore {
  public:
    explicit TextureStore(Resources resources = {}) : resources_(std::move(resources)) {}

    /// The texture of an ImageTexture, PixelTexture, MovieTexture (its present picture) or MultiTexture (what its
    /// stages make of white); null with a diagnostic if it cannot be had, null without one if it names nothing.
    std::shared_ptr<const Texture> ofNode(const Scene& scene, const Node& node, Texture::Content content,
                                          Diagnostics& diagnostics);
    /// `node` is the one whose url list it is; for the folder and the report.
    std::shared_ptr<const Texture> ofUrls(const Scene& scene, const Node& node, const Array<String>& urls,
                                          Texture::Content content, Diagnostics& diagnostics);
    /// Whether a node is one of those that are looked up by three coordinates, and have pictures of their own.
    static bool isSpace(const Node& node);
    /// The texture of a ComposedCubeMapTexture, ImageCubeMapTexture, ComposedTexture3D, ImageTexture3D or
    /// PixelTexture3D.
    std::shared_ptr<const SpaceTexture> spaceOfNode(const Scene& scene, const Node& node, Texture::Content content,
                                                    Diagnostics& diagnostics);
    /// A picture that is drawn for a node, as it counts among the others; null, with the reason: there are too many.
    std::shared_ptr<const GeneratedCube> drawn(const GeneratedCube& cube, std::string& why);
    /// Reports parts of pictures in files that could not be read, once each.
    void reportOfDamage(Diagnostics& diagnostics);
    /// Drops what no material uses any more, once there is much of it.
    void collect();
    /// A name for these resources: stores with the same name can be shared.
    static std::string nameOf(const Resources& resources);

  private:
    std::shared_ptr<const Texture> ofMovie(const Scene& scene, const Node& node, Texture::Content content,
                                           Diagnostics& diagnostics);
    std::shared_ptr<const Texture> ofMulti(const Scene& scene, const Node& node, Texture::Content content,
                                           Diagnostics& diagnostics);
    std::shared_ptr<const Texture> ofResource(Resource resource, Texture::Content content, std::string& why);
    std::shared_ptr<const SpaceTexture> blockOfResource(Resource resource, Texture::Content content, std::string& why);
    std::shared_ptr<const SpaceTexture> composed(const Scene& scene, const Node& node, Texture::Content content,
                                                 Diagnostics& diagnostics);
    std::shared_ptr<const SpaceTexture> cubeOfUrls(const Scene& scene, const Node& node, Texture::Content content,
                                                   Diagnostics& diagnostics);
    std::shared_ptr<const SpaceTexture> blockOfUrls(const Scene& scene, const Node& node, Texture::Content content,
                                                    Diagnostics& diagnostics);
    std::shared_ptr<const SpaceTexture> blockOfPixels(const Scene& scene, const Node& node, Texture::Content content,
                                                      Diagnostics& diagnostics);
    /// One string for a node's url list and the folders it starts in.
    bool mayComeLater(const Scene& scene, const Node& node, const Array<String>& urls) const;
    std::string listName(const Scene& scene, const Node& node, const Array<String>& urls,
                         Texture::Content content) const;
    /// Opens the urls in order until `take`(resource, why) accepts one; otherwise returns the reason.
    template <class Take>
    std::string tryUrls(const Scene& scene, const Node& node, const Array<String>& urls, const Take& take);
    /// False, with the reason, if the policy does not let the scene have so many more.
    bool countPixels(std::uint64_t more, std::string& why);

    struct Pixels {
        Image image;
        std::shared_ptr<const Texture> texture;  // null: the image is unusable
    };
    Resources resources_;
    std::unordered_map<std::string, std::shared_ptr<const Texture>> files_;  // by content and path
    std::unordered_set<std::string> damaged_;                                // keys of files_ that were told of
    struct List {
        std::shared_ptr<const Texture> texture;
        std::string why;      // there is none
        std::string damage;   // there is one, but not all of it
        std::string profile;  // of its colors, which are taken for those of sRGB
    };
    std::unordered_map<std::string, List> lists_;            // by folders and urls
    std::unordered_map<std::string, std::string> profiles_;  // of pictures that are not sRGB, by the resource's name
    std::size_t kept_ = 0;
    std::uint64_t pixelsInUse_ = 0;                     // of those in the tables around, as the policy counts them
    std::unordered_map<std::uint64_t, Pixels> pixels_;  // by node and content
    struct Film {
        std::string list;  // by folders and urls
        std::optional<Movie> movie;
        std::string why;  // there is none
        std::shared_ptr<const Texture> shown;
    };
    std::unordered_map<std::uint64_t, Film> films_;  // and MultiTextures; by node and content
    struct Cube {
        std::shared_ptr<const Texture> picture;
        std::shared_ptr<const SpaceTexture> cube;
    };
    struct Drawn {
        std::weak_ptr<const GeneratedCube> cube;
        std::uint64_t pixels = 0;
    };
    std::unordered_map<std::uint32_t, Drawn> drawn_;  // by node
    std::unordered_map<const Texture*, Cube> cubes_;  // by the picture that holds the sides
    struct Block {
        std::shared_ptr<const SpaceTexture> texture;
        std::string why;            // there is none
        Array<std::int32_t> words;  // of a PixelTexture3D, by which it is known again
    };
    std::unordered_map<std::string, Block> blocks_;  // by folders and urls, or by node
};

}  // namespace rtsg
