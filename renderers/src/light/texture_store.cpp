// Finding the pictures of textures, and keeping each once.
#include "texture_store.h"

#include <unordered_set>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

/// As the policy counts them: pictures with more than 8 bits a channel take four times the memory.
std::uint64_t pixelsOf(const Texture& texture) {
    return static_cast<std::uint64_t>(texture.width()) * static_cast<std::uint64_t>(texture.height()) *
           texture.bytesPerPixel() / 4;
}

/// What the picture is by its first bytes, as a name that the reader of pictures chooses its format from; empty if it
/// is none that is read. Names of the document's choosing would let it choose among all formats there are.
std::string nameByContent(std::string_view bytes) {
    using namespace std::string_view_literals;
    if (bytes.starts_with("\x89PNG\r\n"sv)) return "picture.png";
    if (bytes.starts_with("\xFF\xD8\xFF"sv)) return "picture.jpg";
    if (bytes.starts_with("GIF8"sv)) return "picture.gif";
    if (bytes.starts_with("BM"sv)) return "picture.bmp";
    if (bytes.starts_with("II*\0"sv) || bytes.starts_with("MM\0*"sv)) return "picture.tif";
    if (bytes.starts_with("\x76\x2F\x31\x01"sv)) return "picture.exr";
    if (bytes.starts_with("#?RADIANCE"sv) || bytes.starts_with("#?RGBE"sv)) return "picture.hdr";
    if (bytes.starts_with("DDS "sv)) return "picture.dds";
    if (bytes.size() > 12 && bytes.starts_with("RIFF"sv) && bytes.substr(8, 4) == "WEBP"sv) return "picture.webp";
    if (bytes.size() > 2 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6') return "picture.pnm";
    if (bytes.size() > 26 && bytes.substr(bytes.size() - 18, 16) == "TRUEVISION-XFILE"sv) return "picture.tga";
    return {};
}

}  // namespace

std::shared_ptr<const Texture> TextureStore::ofResource(Resource resource, Texture::Content content, std::string& why) {
    const std::string key = (content == Texture::Content::color ? "c" : "d") + resource.path().string();
    const bool isFile = !resource.path().empty();
    if (isFile)
        if (const auto found = files_.find(key); found != files_.end()) return found->second;
    const auto bytes = resource.read();
    if (!bytes) {
        why = bytes.error().text;
        return nullptr;
    }
    const std::string name = nameByContent(*bytes);
    if (name.empty()) {
        why = fmt::format("{} is no picture of a format that is read", resource.name());
        return nullptr;
    }
    const std::uint64_t limit = resources_.policy().maximumPixels;
    auto texture = Texture::fromMemory({reinterpret_cast<const std::uint8_t*>(bytes->data()), bytes->size()}, name,
                                       content, limit / 4);
    if (!texture) {
        why = fmt::format("{}: {}", resource.name(), texture.error().text);
        return nullptr;
    }
    pixelsInUse_ += pixelsOf(*texture);
    if (pixelsInUse_ > limit) {
        pixelsInUse_ -= pixelsOf(*texture);
        why = fmt::format("the scene's pictures have more than {} pixels; --limit pixels=N raises this", limit);
        return nullptr;
    }
    auto shared = std::make_shared<const Texture>(std::move(*texture));
    if (isFile) files_[key] = shared;
    return shared;
}

std::shared_ptr<const Texture> TextureStore::ofUrls(const Scene& scene, const Node& node, const Array<String>& urls,
                                                    Texture::Content content, Diagnostics& diagnostics) {
    if (urls.empty()) return nullptr;
    const FieldIndex field = node.type().findExact("url");
    std::string all = content == Texture::Content::color ? "c" : "d";
    for (const auto& folder : resources_.foldersOf(scene, node, field)) all.append("\n").append(folder.string());
    for (const String& url : urls) all.append("\n").append(url.view());
    const auto [place, isNew] = lists_.try_emplace(all);
    List& list = place->second;
    for (std::size_t i = 0; isNew && !list.texture && i < urls.size(); ++i) {
        std::string why;
        auto resource = resources_.open(scene, node, field, urls[i].view());
        if (resource)
            list.texture = ofResource(std::move(*resource), content, why);
        else
            why = resource.error().text;
        if (!list.texture) list.why += (list.why.empty() ? "" : "; ") + why;
    }
    if (list.texture) return list.texture;
    std::string name(scene.name(node.id()));
    diagnostics.warning(
        {}, fmt::format("{}{} shows no picture: {}", node.type().name, name.empty() ? "" : " " + name, list.why));
    return nullptr;
}

std::string TextureStore::nameOf(const Resources& resources) {
    const ResourcePolicy& policy = resources.policy();
    std::string name = fmt::format("textures\n{}\n{} {} {}", resources.folder().string(), policy.maximumBytes,
                                   policy.maximumPixels, policy.roots.size());
    for (const auto& root : policy.roots) name.append("\n").append(root.string());
    return name;
}

std::shared_ptr<const Texture> TextureStore::ofNode(const Scene& scene, const Node& node, Texture::Content content,
                                                    Diagnostics& diagnostics) {
    if (node.is(x3d::ImageTexture::type)) {
        if (!node.get(x3d::ImageTexture::load)) return nullptr;
        return ofUrls(scene, node, node.get(x3d::ImageTexture::url), content, diagnostics);
    }
    if (node.is(x3d::PixelTexture::type)) {
        const Image& image = node.get(x3d::PixelTexture::image);
        if (image.width() == 0 && image.height() == 0) return nullptr;
        Pixels& entry = pixels_[std::uint64_t{node.id().value} << 1 | (content == Texture::Content::color ? 0u : 1u)];
        if (!entry.image.words.empty() && entry.image.words.sameStorage(image.words)) return entry.texture;
        entry = {image, nullptr};
        auto texture = Texture::fromImage(image, content);
        if (texture)
            entry.texture = std::make_shared<const Texture>(std::move(*texture));
        else
            diagnostics.warning(
                {}, fmt::format("PixelTexture {} shows no picture: {}", scene.name(node.id()), texture.error().text));
        return entry.texture;
    }
    if (node.is(x3d::MultiTexture::type)) {
        for (const NodeId id : node.get(x3d::MultiTexture::texture))
            if (const Node* first = scene.effectiveNode(id)) return ofNode(scene, *first, content, diagnostics);
        return nullptr;
    }
    diagnostics.warning({},
                        fmt::format("{} is not drawn by the light tracer; surfaces show without it", node.type().name));
    return nullptr;
}

void TextureStore::collect() {
    // Not each time, or the work would grow with the scene: only when there is twice as much as was worth keeping.
    if (files_.size() + lists_.size() + pixels_.size() < 2 * kept_ + 16) return;
    // A list's entry shares with the file's. One in use that is dropped costs a look-up later, nothing else.
    std::erase_if(lists_,
                  [](const auto& entry) { return entry.second.texture && entry.second.texture.use_count() <= 2; });
    std::erase_if(files_, [](const auto& entry) { return entry.second.use_count() == 1; });
    std::erase_if(pixels_, [](const auto& entry) { return entry.second.texture.use_count() <= 1; });
    kept_ = files_.size() + lists_.size() + pixels_.size();
    std::unordered_set<const Texture*> inUse;
    for (const auto& [key, texture] : files_) inUse.insert(texture.get());
    for (const auto& [key, list] : lists_)
        if (list.texture) inUse.insert(list.texture.get());
    pixelsInUse_ = 0;
    for (const Texture* texture : inUse) pixelsInUse_ += pixelsOf(*texture);
}

}  // namespace rtsg
