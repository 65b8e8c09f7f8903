#include "texture_store.h"

#include <cctype>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

int hexDigit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

std::string decodePercent(std::string_view text) {
    std::string result;
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] == '%' && i + 2 < text.size() && hexDigit(text[i + 1]) >= 0 && hexDigit(text[i + 2]) >= 0) {
            result.push_back(static_cast<char>(hexDigit(text[i + 1]) * 16 + hexDigit(text[i + 2])));
            i += 2;
        } else {
            result.push_back(text[i]);
        }
    }
    return result;
}

std::optional<std::string> decodeBase64(std::string_view text) {
    std::string result;
    std::uint32_t bits = 0;
    int count = 0;
    for (const char c : text) {
        int value;
        if (c >= 'A' && c <= 'Z')
            value = c - 'A';
        else if (c >= 'a' && c <= 'z')
            value = c - 'a' + 26;
        else if (c >= '0' && c <= '9')
            value = c - '0' + 52;
        else if (c == '+' || c == '-')
            value = 62;
        else if (c == '/' || c == '_')
            value = 63;
        else if (c == '=')
            break;
        else if (std::isspace(static_cast<unsigned char>(c)))
            continue;
        else
            return std::nullopt;
        bits = bits << 6 | static_cast<std::uint32_t>(value);
        count += 6;
        if (count >= 8) {
            count -= 8;
            result.push_back(static_cast<char>(bits >> count & 255u));
        }
    }
    return result;
}

/// "http", "urn", "file" ...; empty for a plain path (and for "c:\...").
std::string_view scheme(std::string_view url) {
    const std::size_t colon = url.find(':');
    if (colon == std::string_view::npos || colon < 2) return {};
    for (const char c : url.substr(0, colon))
        if (!std::isalnum(static_cast<unsigned char>(c)) && c != '+' && c != '-' && c != '.') return {};
    return url.substr(0, colon);
}

}  // namespace

std::optional<std::string> decodeDataUrl(std::string_view url) {
    if (!url.starts_with("data:")) return std::nullopt;
    const std::size_t comma = url.find(',');
    if (comma == std::string_view::npos) return std::nullopt;
    const std::string_view head = url.substr(0, comma), body = url.substr(comma + 1);
    return head.ends_with(";base64") ? decodeBase64(decodePercent(body)) : decodePercent(body);
}

std::filesystem::path TextureStore::folderOf(const Scene& scene, const Node& node) const {
    std::vector<std::string> steps;
    for (const Node* scope = scene.find(node.scope()); scope; scope = scene.find(scope->scope()))
        if (scope->is(x3d::Inline::type))
            for (const String& url : scope->get(x3d::Inline::url)) {
                if (!scheme(url).empty()) continue;
                steps.push_back(decodePercent(url.view()));
                break;
            }
    std::filesystem::path folder = folder_;
    for (auto step = steps.rbegin(); step != steps.rend(); ++step) folder /= std::filesystem::path(*step).parent_path();
    return folder;
}

std::shared_ptr<const Texture> TextureStore::ofFile(const std::filesystem::path& file, Texture::Content content,
                                                    std::string& why) {
    const std::string key = (content == Texture::Content::color ? "c" : "d") + file.string();
    if (const auto found = files_.find(key); found != files_.end()) return found->second;
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) {
        why = "no such file";
        return nullptr;  // not remembered: it may appear
    }
    auto texture = Texture::fromFile(file, content);
    if (!texture) {
        why = texture.error().text;
        return nullptr;
    }
    return files_[key] = std::make_shared<const Texture>(std::move(*texture));
}

std::shared_ptr<const Texture> TextureStore::ofUrls(const Scene& scene, const Node& node, const Array<String>& urls,
                                                    Texture::Content content, Diagnostics& diagnostics) {
    if (urls.empty()) return nullptr;
    std::string all = folderOf(scene, node).string() + (content == Texture::Content::color ? "\nc" : "\nd");
    for (const String& url : urls) all.append("\n").append(url.view());
    if (const auto found = lists_.find(all); found != lists_.end()) return found->second;

    std::string report;
    for (const String& url : urls) {
        std::string why;
        std::shared_ptr<const Texture> texture;
        const std::string_view kind = scheme(url.view());
        if (kind == "data") {
            if (const auto bytes = decodeDataUrl(url.view())) {
                const auto type = url.view().substr(0, url.view().find_first_of(";,"));
                const std::string name = type.ends_with("png")   ? "data.png"
                                         : type.ends_with("gif") ? "data.gif"
                                                                 : "data.jpg";
                auto read = Texture::fromMemory({reinterpret_cast<const std::uint8_t*>(bytes->data()), bytes->size()},
                                                name, content);
                if (read)
                    texture = std::make_shared<const Texture>(std::move(*read));
                else
                    why = read.error().text;
            } else {
                why = "malformed data url";
            }
        } else if (kind == "file" || kind.empty()) {
            std::string path = decodePercent(url.view());
            if (kind == "file") path = path.substr(path.starts_with("file://") ? 7 : 5);
            texture = ofFile(folderOf(scene, node) / path, content, why);
        } else {
            why = "nothing is fetched from the network";
        }
        if (texture) return lists_[all] = texture;
        report += fmt::format("{}\"{}\": {}", report.empty() ? "" : "; ", url.view().substr(0, 200), why);
    }
    std::string name(scene.name(node.id()));
    diagnostics.warning(
        {}, fmt::format("{}{} shows no picture: {}", node.type().name, name.empty() ? "" : " " + name, report));
    return lists_[all] = nullptr;
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
    const std::string key = fmt::format("\nunsupported {}", node.type().name);
    if (lists_.emplace(key, nullptr).second)
        diagnostics.warning(
            {}, fmt::format("{} is not drawn by the light tracer; surfaces show without it", node.type().name));
    return nullptr;
}

void TextureStore::collect() {
    // Not each time, or the work would grow with the scene: only when there is twice as much as was worth keeping.
    if (files_.size() + lists_.size() + pixels_.size() < 2 * kept_ + 16) return;
    // A list's entry shares with the file's. One in use that is dropped costs a look-up later, nothing else.
    std::erase_if(lists_, [](const auto& entry) { return entry.second && entry.second.use_count() <= 2; });
    std::erase_if(files_, [](const auto& entry) { return entry.second.use_count() == 1; });
    std::erase_if(pixels_, [](const auto& entry) { return entry.second.texture.use_count() <= 1; });
    kept_ = files_.size() + lists_.size() + pixels_.size();
}

}  // namespace rtsg
