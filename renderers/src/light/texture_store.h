// TextureStore: the textures of one scene, read once each, however many materials use them and however often those
// change, and however many renderers show them.
//
// A url list is tried in order, each as core/resource.h says. What cannot be read, or would be more pixels than the
// policy lets a scene have, is reported to each who asks, and tried again only when the list changes.
// Threading: one thread, the scene's.
#pragma once

#include <memory>
#include <string>
#include <unordered_map>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/renderers/texture.h>

namespace rtsg {

class TextureStore {
  public:
    explicit TextureStore(Resources resources = {}) : resources_(std::move(resources)) {}

    /// Of an ImageTexture, PixelTexture or MultiTexture (its first) node; null with a diagnostic if it cannot be had,
    /// null without one if it names nothing.
    std::shared_ptr<const Texture> ofNode(const Scene& scene, const Node& node, Texture::Content content,
                                          Diagnostics& diagnostics);
    /// `node` is the one whose url list it is; for the folder and the report.
    std::shared_ptr<const Texture> ofUrls(const Scene& scene, const Node& node, const Array<String>& urls,
                                          Texture::Content content, Diagnostics& diagnostics);
    /// Drops what no material uses any more, once there is much of it.
    void collect();
    /// Says what a store for these resources has in common with others: those of one name may be one.
    static std::string nameOf(const Resources& resources);

  private:
    std::shared_ptr<const Texture> ofResource(Resource resource, Texture::Content content, std::string& why);

    struct Pixels {
        Image image;
        std::shared_ptr<const Texture> texture;  // null: the image is unusable
    };
    Resources resources_;
    std::unordered_map<std::string, std::shared_ptr<const Texture>> files_;  // by content and path
    struct List {
        std::shared_ptr<const Texture> texture;
        std::string why;  // there is none
    };
    std::unordered_map<std::string, List> lists_;  // by folders and urls
    std::size_t kept_ = 0;
    std::uint64_t pixelsInUse_ = 0;                     // of those in files_ and lists_, as the policy counts them
    std::unordered_map<std::uint64_t, Pixels> pixels_;  // by node and content
};

}  // namespace rtsg
