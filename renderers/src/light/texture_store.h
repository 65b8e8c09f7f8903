// TextureStore: the textures of one scene, read once each, however many materials use them and however often those
// change.
//
// A url list is tried in order: `data:` urls, then files relative to the document's folder (for nodes of an Inline: to
// the Inline's own url). What cannot be read is reported once, and tried again only when the list changes.
// Threading: one thread, the scene's.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/scene.h>
#include <rtsg/renderers/texture.h>

namespace rtsg {

class TextureStore {
  public:
    explicit TextureStore(std::filesystem::path folder = {}) : folder_(std::move(folder)) {}

    /// Of an ImageTexture, PixelTexture or MultiTexture (its first) node; null with a diagnostic if it cannot be had,
    /// null without one if it names nothing.
    std::shared_ptr<const Texture> ofNode(const Scene& scene, const Node& node, Texture::Content content,
                                          Diagnostics& diagnostics);
    /// `node` is the one whose url list it is; for the folder and the report.
    std::shared_ptr<const Texture> ofUrls(const Scene& scene, const Node& node, const Array<String>& urls,
                                          Texture::Content content, Diagnostics& diagnostics);
    /// Drops what no material uses any more, once there is much of it.
    void collect();

  private:
    std::filesystem::path folderOf(const Scene& scene, const Node& node) const;
    std::shared_ptr<const Texture> ofFile(const std::filesystem::path& file, Texture::Content content,
                                          std::string& why);

    struct Pixels {
        Image image;
        std::shared_ptr<const Texture> texture;  // null: the image is unusable
    };
    std::filesystem::path folder_;
    std::unordered_map<std::string, std::shared_ptr<const Texture>> files_;  // by content and path
    std::unordered_map<std::string, std::shared_ptr<const Texture>> lists_;  // by folder and urls; null: none, reported
    std::size_t kept_ = 0;
    std::unordered_map<std::uint64_t, Pixels> pixels_;  // by node and content
};

/// The bytes behind `data:[type][;base64],...`; nothing if it is no such url or malformed.
std::optional<std::string> decodeDataUrl(std::string_view url);

}  // namespace rtsg
