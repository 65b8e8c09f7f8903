// Finding the pictures of textures, and keeping each once.
#include "texture_store.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <unordered_set>

#include <fmt/format.h>

#include <rtsg/core/web_address.h>
#include <rtsg/core/x3d.h>

#include "image/color_profile.h"

namespace rtsg {

namespace {

/// The pixels as the policy counts them: pictures with more than 8 bits a channel take four times the memory.
std::uint64_t pixelsOf(const Texture& texture) {
    if (texture.inTiles()) return 0;
    return static_cast<std::uint64_t>(texture.width()) * static_cast<std::uint64_t>(texture.height()) *
           texture.bytesPerPixel() / 4;
}

/// A name by which the reader of pictures chooses the format, made from the first bytes; empty for formats that are not
/// read. With names of its own choosing, a document could choose among all formats there are.
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
    if (bytes.starts_with("\xABKTX 20\xBB\r\n\x1A\n"sv)) return "picture.ktx2";
    if (bytes.size() > 12 && bytes.starts_with("RIFF"sv) && bytes.substr(8, 4) == "WEBP"sv) return "picture.webp";
    if (bytes.size() > 2 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6') return "picture.pnm";
    if (bytes.size() > 26 && bytes.substr(bytes.size() - 18, 16) == "TRUEVISION-XFILE"sv) return "picture.tga";
    return {};
}

/// A picture that is stored in tiles, if it has more pixels than may be kept.
std::optional<Texture> tiledIfLarger(const std::shared_ptr<Resource>& resource, Texture::Content content,
                                     const ResourcePolicy& policy) {
    const std::string name = nameByContent(resource->readAt(0, 32));
    if (name != "picture.tif" && name != "picture.exr") return std::nullopt;
    auto texture = Texture::fromTiles(resource, name, content);
    if (!texture) return std::nullopt;  // the usual path reports the fault
    const auto pixels = static_cast<std::uint64_t>(texture->width()) * static_cast<std::uint64_t>(texture->height());
    const std::uint64_t counted = pixels * (texture->bytesPerPixel() / 4);
    if (counted <= policy.maximumPixels / 4) return std::nullopt;
    return std::move(*texture);
}

/// A picture's file, and what its content is.
struct PictureBytes {
    std::string bytes, name;
    std::span<const std::uint8_t> view() const {
        return {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()};
    }
};
std::optional<PictureBytes> pictureBytes(Resource& resource, std::string& why) {
    auto bytes = resource.read();
    if (!bytes) {
        why = bytes.error().text;
        return std::nullopt;
    }
    std::string name = nameByContent(*bytes);
    if (name.empty()) {
        why = fmt::format("{} is no picture of a format that is read", resource.name());
        return std::nullopt;
    }
    return PictureBytes{std::move(*bytes), std::move(name)};
}

}  // namespace

std::shared_ptr<const Texture> TextureStore::ofResource(Resource opened, Texture::Content content, std::string& why) {
    const auto shared = std::make_shared<Resource>(std::move(opened));
    Resource& resource = *shared;
    const std::string key = (content == Texture::Content::color ? "c" : "d") + resource.path().string();
    const bool isFile = !resource.path().empty();
    if (isFile) {
        if (const auto found = files_.find(key); found != files_.end()) return found->second;
        if (auto large = tiledIfLarger(shared, content, resources_.policy()))
            return files_[key] = std::make_shared<const Texture>(std::move(*large));
    }
    const std::optional<PictureBytes> file = pictureBytes(resource, why);
    if (!file) return nullptr;
    auto texture = Texture::fromMemory(file->view(), file->name, content, resources_.policy().maximumPixels / 4);
    if (!texture) {
        why = fmt::format("{}: {}", resource.name(), texture.error().text);
        return nullptr;
    }
    if (!countPixels(pixelsOf(*texture), why)) return nullptr;
    if (content == Texture::Content::color)
        if (std::string profile = foreignColorProfile(file->view()); !profile.empty())
            profiles_[resource.name()] = std::move(profile);
    auto created = std::make_shared<const Texture>(std::move(*texture));
    if (isFile) files_[key] = created;
    return created;
}

void TextureStore::reportOfDamage(Diagnostics& diagnostics) {
    for (const auto& [key, texture] : files_) {
        std::string why = texture->inTiles() ? texture->damage() : std::string();
        if (why.empty() || !damaged_.insert(key).second) continue;
        diagnostics.warning({}, fmt::format("{}: parts of the picture are black: {}", key.substr(1), why));
    }
}

bool TextureStore::countPixels(std::uint64_t more, std::string& why) {
    const std::uint64_t limit = resources_.policy().maximumPixels;
    if (more <= limit && pixelsInUse_ <= limit - more) {
        pixelsInUse_ += more;
        return true;
    }
    why = fmt::format("the scene's pictures have more than {} pixels; --limit pixels=N raises this", limit);
    return false;
}

std::shared_ptr<const GeneratedCube> TextureStore::drawn(const GeneratedCube& cube, std::string& why) {
    constexpr std::uint64_t kFloats = 4;  // of four bytes, a pixel
    const auto size = static_cast<std::uint64_t>(cube.size), height = static_cast<std::uint64_t>(cube.height);
    const std::uint64_t pixels = kFloats * size * (cube.isFlat() ? height : 6 * size);
    std::erase_if(drawn_, [&](const auto& entry) {
        const bool ends = entry.second.cube.expired();
        if (ends) pixelsInUse_ -= entry.second.pixels;
        return ends;
    });
    if (const auto found = drawn_.find(cube.node.value); found != drawn_.end()) {
        if (auto same = found->second.cube.lock(); same->size == cube.size && same->height == cube.height) return same;
        pixelsInUse_ -= found->second.pixels;
        drawn_.erase(found);
    }
    if (!countPixels(pixels, why)) return nullptr;
    auto created = std::make_shared<const GeneratedCube>(cube);
    drawn_[cube.node.value] = {created, pixels};
    return created;
}

std::string TextureStore::listName(const Scene& scene, const Node& node, const Array<String>& urls,
                                   Texture::Content content) const {
    std::string all = content == Texture::Content::color ? "c" : "d";
    for (const auto& folder : resources_.foldersOf(scene, node, node.type().findExact("url")))
        all.append("\n").append(folder.string());
    for (const String& url : urls) all.append("\n").append(url.view());
    return all;
}

template <class Take>
std::string TextureStore::tryUrls(const Scene& scene, const Node& node, const Array<String>& urls, const Take& take) {
    const FieldIndex field = node.type().findExact("url");
    std::string all;
    for (const String& url : urls) {
        std::string why;
        auto resource = resources_.open(scene, node, field, url.view());
        if (!resource)
            why = resource.error().text;
        else if (take(std::move(*resource), why))
            return {};
        all += (all.empty() ? "" : "; ") + why;
    }
    return all;
}

namespace {

void reportOfNone(const Scene& scene, const Node& node, const std::string& why, Diagnostics& diagnostics) {
    const std::string name(scene.name(node.id()));
    diagnostics.warningAt(scene.locationOf(node.id()), fmt::format("{}{} shows no picture: {}", node.type().name,
                                                                   name.empty() ? "" : " " + name, why));
}

}  // namespace

/// A file on the network may be available later.
bool TextureStore::mayComeLater(const Scene& scene, const Node& node, const Array<String>& urls) const {
    if (!resources_.policy().fetcher) return false;
    const auto folders = resources_.foldersOf(scene, node, node.type().findExact("url"));
    return std::ranges::any_of(urls, [](const String& url) { return isWebAddress(url.view()); }) ||
           std::ranges::any_of(folders, [](const auto& folder) { return isWebAddress(folder.native()); });
}

std::shared_ptr<const Texture> TextureStore::ofUrls(const Scene& scene, const Node& node, const Array<String>& urls,
                                                    Texture::Content content, Diagnostics& diagnostics) {
    if (urls.empty()) return nullptr;
    const auto [entry, isNew] = lists_.try_emplace(listName(scene, node, urls, content));
    List& list = entry->second;
    if (isNew)
        list.why = tryUrls(scene, node, urls, [&](Resource resource, std::string& why) {
            const std::string name = resource.name();
            list.texture = ofResource(std::move(resource), content, why);
            if (list.texture && !list.texture->inTiles() && !list.texture->damage().empty())
                list.damage = fmt::format("{}: {}", name, list.texture->damage());
            if (const auto found = profiles_.find(name); list.texture && found != profiles_.end())
                list.profile = fmt::format("{}: {}", name, found->second);
            return list.texture != nullptr;
        });
    const auto report = [&](std::string_view of, std::string_view what) {
        if (what.empty()) return;
        const std::string_view name = scene.name(node.id());
        diagnostics.warningAt(scene.locationOf(node.id()),
                              fmt::format("{}{}{} {}: {}", node.type().name, name.empty() ? "" : " ", name, of, what));
    };
    report("shows as much of its picture as can be read, which is damaged", list.damage);
    report("takes the colours of its picture for those of sRGB, though they are of another profile", list.profile);
    if (list.texture) return list.texture;
    reportOfNone(scene, node, list.why, diagnostics);
    if (mayComeLater(scene, node, urls)) lists_.erase(entry);
    return nullptr;
}

std::string TextureStore::nameOf(const Resources& resources) {
    const ResourcePolicy& policy = resources.policy();
    std::string name =
        fmt::format("textures\n{}\n{} {} {} {}", resources.folder().string(), policy.maximumBytes, policy.maximumPixels,
                    policy.roots.size(), static_cast<const void*>(policy.fetcher.get()));
    for (const auto& root : policy.roots) name.append("\n").append(root.string());
    return name;
}

namespace {

std::uint64_t nameOfNode(const Node& node, Texture::Content content) {
    return std::uint64_t{node.id().value} << 1 | (content == Texture::Content::color ? 0u : 1u);
}

}  // namespace

std::shared_ptr<const Texture> TextureStore::ofMovie(const Scene& scene, const Node& node, Texture::Content content,
                                                     Diagnostics& diagnostics) {
    using M = x3d::MovieTexture;
    if (!node.get(M::load) || node.get(M::url).empty()) return nullptr;
    Film& film = films_[nameOfNode(node, content)];
    if (std::string list = listName(scene, node, node.get(M::url), content); list != film.list) {
        film = {std::move(list), std::nullopt, {}, nullptr};
        film.why = tryUrls(scene, node, node.get(M::url), [&](Resource resource, std::string& why) {
            auto movie = Movie::open(std::move(resource), resources_.policy().maximumPixels / 4);
            if (!movie) return why = movie.error().text, false;
            film.movie = std::move(*movie);
            return true;
        });
    }
    if (film.movie) {
        const double reported = node.get(M::_duration).seconds;
        const double length = reported > 0 && std::isfinite(reported) ? reported : film.movie->seconds();
        auto frame = film.movie->frameAt(movieTime(node, length), content);
        // If a picture cannot be decoded, the last one stays.
        if (!frame)
            film.why = frame.error().text;
        else if (*frame && (film.shown || countPixels(pixelsOf(**frame), film.why)))
            film.shown = std::make_shared<const Texture>(std::move(**frame));
    }
    if (!film.why.empty()) reportOfNone(scene, node, film.why, diagnostics);
    return film.shown;
}

namespace {

/// The size of the picture that the stages of a MultiTexture make together: as wide and as high as the largest ones.
struct CombinedSize {
    int width = 0, height = 0;
    bool wide = false;  // more than a byte for each number

    explicit CombinedSize(const Material& material) {
        for (const TextureStage& stage : material.stages) {
            const Texture* texture = stage.use.texture.get();
            if (!texture) continue;
            width = std::max(width, texture->width()), height = std::max(height, texture->height());
            wide = wide || texture->bytesPerPixel() > 4;
        }
    }
    /// The pixels as the policy counts them: four bytes are one.
    std::uint64_t pixels() const {
        return static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) * (wide ? 4 : 1);
    }
};

/// The picture that the stages make of white; null if they have no picture, or if one of this size cannot be had.
std::optional<Texture> combined(const Material& material, const CombinedSize& size, Texture::Content content) {
    const auto [width, height, wide] = size;
    if (width == 0) return std::nullopt;
    std::vector<std::uint8_t> bytes;
    std::vector<Vec4f> light;
    const auto count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    for (std::size_t i = 0; i < count; ++i) {
        const std::size_t x = i % static_cast<std::size_t>(width), y = i / static_cast<std::size_t>(width);
        const float s = (static_cast<float>(x) + .5f) / static_cast<float>(width),
                    t = (static_cast<float>(y) + .5f) / static_cast<float>(height);
        Vec4f current(1);
        for (const TextureStage& stage : material.stages) {
            if (!stage.use.texture) continue;
            const Vec4f texel = stage.use.texture->sample(s, t, 0, stage.use.access, ColorSpace::display);
            using S = TextureStage::Source;
            const Vec4f with = stage.source == S::previous ? current
                               : stage.source == S::factor ? material.factor
                                                           : Vec4f(1);
            current = combine(stage, texel, with, current, 1, material.factor.a);
        }
        if (!material.stagesHaveAlpha()) current.a = 1;
        if (wide && content == Texture::Content::color)
            light.emplace_back(linearFromSrgb(Vec3f(current)), current.a);
        else if (wide)
            light.push_back(current);
        else
            for (int c = 0; c < 4; ++c)
                bytes.push_back(static_cast<std::uint8_t>(std::lround(255 * std::clamp(current[c], 0.0f, 1.0f))));
    }
    auto created = wide ? Texture::fromFloats(std::move(light), width, height, 4, content)
                        : Texture::fromBytes(bytes, width, height, 4, content);
    if (!created) return std::nullopt;
    return std::move(*created);
}

}  // namespace

std::shared_ptr<const Texture> TextureStore::ofMulti(const Scene& scene, const Node& node, Texture::Content content,
                                                     Diagnostics& diagnostics) {
    const Material stages = readMultiTexture(scene, node, *this, diagnostics);
    for (const TextureStage& stage : stages.stages)
        if (!stage.use.texture)
            diagnostics.warningAt(scene.locationOf(node.id()),
                                  "MultiTexture: what is looked up by three coordinates is left out here");
    const CombinedSize size(stages);
    Film& entry = films_[nameOfNode(node, content)];
    if (entry.shown) pixelsInUse_ -= std::min(pixelsInUse_, pixelsOf(*entry.shown));  // it is made anew
    entry.shown = nullptr;
    if (!countPixels(size.pixels(), entry.why)) {
        reportOfNone(scene, node, entry.why, diagnostics);
        return nullptr;
    }
    auto created = combined(stages, size, content);
    entry.shown = created ? std::make_shared<const Texture>(std::move(*created)) : nullptr;
    return entry.shown;
}

std::shared_ptr<const Texture> TextureStore::ofNode(const Scene& scene, const Node& node, Texture::Content content,
                                                    Diagnostics& diagnostics) {
    if (node.is(x3d::ImageTexture::type)) {
        if (!node.get(x3d::ImageTexture::load)) return nullptr;
        return ofUrls(scene, node, node.get(x3d::ImageTexture::url), content, diagnostics);
    }
    if (node.is(x3d::MovieTexture::type)) return ofMovie(scene, node, content, diagnostics);
    if (node.is(x3d::PixelTexture::type)) {
        const Image& image = node.get(x3d::PixelTexture::image);
        if (image.width() == 0 && image.height() == 0) return nullptr;
        Pixels& entry = pixels_[nameOfNode(node, content)];
        if (!entry.image.words.empty() && entry.image.words.sameStorage(image.words)) return entry.texture;
        entry = {image, nullptr};
        auto texture = Texture::fromImage(image, content);
        if (texture)
            entry.texture = std::make_shared<const Texture>(std::move(*texture));
        else
            reportOfNone(scene, node, texture.error().text, diagnostics);
        return entry.texture;
    }
    if (node.is(x3d::MultiTexture::type)) return ofMulti(scene, node, content, diagnostics);
    diagnostics.warningAt(
        scene.locationOf(node.id()),
        fmt::format("{} is not drawn by the light tracer; surfaces show without it", node.type().name));
    return nullptr;
}

// ---- looked up by three coordinates -------------------------------------------------------------------------------

bool TextureStore::isSpace(const Node& node) {
    return node.is(x3d::ComposedCubeMapTexture::type) || node.is(x3d::ImageCubeMapTexture::type) ||
           node.is(x3d::ComposedTexture3D::type) || node.is(x3d::ImageTexture3D::type) ||
           node.is(x3d::PixelTexture3D::type);
}

std::shared_ptr<const SpaceTexture> TextureStore::spaceOfNode(const Scene& scene, const Node& node,
                                                              Texture::Content content, Diagnostics& diagnostics) {
    if (node.is(x3d::ImageCubeMapTexture::type)) return cubeOfUrls(scene, node, content, diagnostics);
    if (node.is(x3d::ImageTexture3D::type)) return blockOfUrls(scene, node, content, diagnostics);
    if (node.is(x3d::PixelTexture3D::type)) return blockOfPixels(scene, node, content, diagnostics);
    return composed(scene, node, content, diagnostics);
}

std::shared_ptr<const SpaceTexture> TextureStore::composed(const Scene& scene, const Node& node,
                                                           Texture::Content content, Diagnostics& diagnostics) {
    if (node.is(x3d::ComposedCubeMapTexture::type)) {
        using C = x3d::ComposedCubeMapTexture;
        const Field<NodeId> fields[] = {C::frontTexture, C::backTexture, C::leftTexture,
                                        C::rightTexture, C::topTexture,  C::bottomTexture};
        std::array<std::shared_ptr<const Texture>, 6> sides;
        bool any = false;
        std::string missing;
        constexpr std::string_view kNames[] = {"front", "back", "left", "right", "top", "bottom"};
        for (std::size_t i = 0; i < 6; ++i)
            if (const Node* side = scene.effectiveNode(node.get(fields[i]))) {
                sides[i] = ofNode(scene, *side, content, diagnostics);
                any = any || sides[i];
            } else {
                missing.append(missing.empty() ? "" : ", ").append(kNames[i]).append("Texture");
            }
        if (any && !missing.empty())
            diagnostics.warningAt(scene.locationOf(node.id()),
                                  "ComposedCubeMapTexture has no " + missing + ": nothing is shown on these sides");
        return any ? std::make_shared<const SpaceTexture>(SpaceTexture::cube(sides)) : nullptr;
    }
    SpaceTexture::Layers layers;
    for (const NodeId id : node.get(x3d::ComposedTexture3D::texture))
        if (const Node* layer = scene.effectiveNode(id)) layers.push_back(ofNode(scene, *layer, content, diagnostics));
    if (layers.empty()) return nullptr;
    auto block = SpaceTexture::block(std::move(layers));
    if (block) return std::make_shared<const SpaceTexture>(std::move(*block));
    reportOfNone(scene, node, block.error().text, diagnostics);
    return nullptr;
}

std::shared_ptr<const SpaceTexture> TextureStore::cubeOfUrls(const Scene& scene, const Node& node,
                                                             Texture::Content content, Diagnostics& diagnostics) {
    using I = x3d::ImageCubeMapTexture;
    if (!node.get(I::load)) return nullptr;
    const auto picture = ofUrls(scene, node, node.get(I::url), content, diagnostics);
    if (!picture) return nullptr;
    Cube& entry = cubes_[picture.get()];
    if (!entry.cube) {
        auto cube = SpaceTexture::ofPicture(picture);
        std::string why = cube ? "" : cube.error().text;
        // The sides are copies.
        if (!cube || !countPixels(pixelsOf(*picture), why)) {
            cubes_.erase(picture.get());
            reportOfNone(scene, node, why, diagnostics);
            return nullptr;
        }
        entry = {picture, std::make_shared<const SpaceTexture>(std::move(*cube))};
    }
    return entry.cube;
}

std::shared_ptr<const SpaceTexture> TextureStore::blockOfResource(Resource resource, Texture::Content content,
                                                                  std::string& why) {
    const std::optional<PictureBytes> file = pictureBytes(resource, why);
    if (!file) return nullptr;
    auto layers = Texture::layersFromMemory(file->view(), file->name, content, resources_.policy().maximumPixels / 4);
    if (!layers) {
        why = fmt::format("{}: {}", resource.name(), layers.error().text);
        return nullptr;
    }
    if (!countPixels(pixelsOf(layers->front()) * layers->size(), why)) return nullptr;
    SpaceTexture::Layers shared;
    for (Texture& layer : *layers) shared.push_back(std::make_shared<const Texture>(std::move(layer)));
    auto block = SpaceTexture::block(std::move(shared));
    if (block) return std::make_shared<const SpaceTexture>(std::move(*block));
    why = block.error().text;
    return nullptr;
}

std::shared_ptr<const SpaceTexture> TextureStore::blockOfUrls(const Scene& scene, const Node& node,
                                                              Texture::Content content, Diagnostics& diagnostics) {
    using I = x3d::ImageTexture3D;
    const Array<String>& urls = node.get(I::url);
    if (!node.get(I::load) || urls.empty()) return nullptr;
    const auto [entry, isNew] = blocks_.try_emplace(listName(scene, node, urls, content));
    Block& block = entry->second;
    if (isNew)
        block.why = tryUrls(scene, node, urls, [&](Resource resource, std::string& why) {
            block.texture = blockOfResource(std::move(resource), content, why);
            return block.texture != nullptr;
        });
    if (!block.texture) reportOfNone(scene, node, block.why, diagnostics);
    return block.texture;
}

std::shared_ptr<const SpaceTexture> TextureStore::blockOfPixels(const Scene& scene, const Node& node,
                                                                Texture::Content content, Diagnostics& diagnostics) {
    const Array<std::int32_t>& words = node.get(x3d::PixelTexture3D::image);
    if (words.size() < 4 || (words[1] == 0 && words[2] == 0 && words[3] == 0)) return nullptr;
    Block& block =
        blocks_[fmt::format("{} {}", node.id().value, content == Texture::Content::color ? "color" : "data")];
    if (block.words.sameStorage(words) && (block.texture || !block.why.empty())) return block.texture;
    block = {nullptr, "", words};
    const std::int64_t components = words[0], width = words[1], height = words[2], depth = words[3];
    const std::int64_t have = static_cast<std::int64_t>(words.size()) - 4;
    SpaceTexture::Layers layers;
    if (components < 1 || components > 4 || width < 1 || height < 1 || depth < 1 || width > have || height > have ||
        depth > have || width * height > have / depth) {
        block.why = fmt::format(
            "image starts with components (1 to 4), width, height and depth, and has as many pixels: {} {} {} {} "
            "and {} pixels",
            components, width, height, depth, have);
    } else {
        const std::int32_t* p = words.data() + 4;
        for (std::int64_t z = 0; z < depth && block.why.empty(); ++z) {
            std::vector<std::uint8_t> bytes;
            bytes.reserve(static_cast<std::size_t>(width * height * components));
            for (std::int64_t i = 0; i < width * height; ++i, ++p)
                for (std::int64_t c = components - 1; c >= 0; --c)
                    bytes.push_back(static_cast<std::uint8_t>(static_cast<std::uint32_t>(*p) >> (8 * c)));
            auto layer = Texture::fromBytes(bytes, static_cast<int>(width), static_cast<int>(height),
                                            static_cast<int>(components), content);
            if (layer)
                layers.push_back(std::make_shared<const Texture>(std::move(*layer)));
            else
                block.why = layer.error().text;
        }
    }
    if (block.why.empty()) {
        auto created = SpaceTexture::block(std::move(layers));
        if (created) block.texture = std::make_shared<const SpaceTexture>(std::move(*created));
    }
    if (!block.texture) reportOfNone(scene, node, block.why, diagnostics);
    return block.texture;
}

void TextureStore::collect() {
    // Not each time, or the work would grow with the scene: only when there is twice as much as was worth keeping.
    const auto kept = [&] {
        return files_.size() + lists_.size() + pixels_.size() + films_.size() + cubes_.size() + blocks_.size();
    };
    if (kept() < 2 * kept_ + 16) return;
    std::erase_if(cubes_, [](const auto& entry) { return entry.second.cube.use_count() <= 1; });
    std::erase_if(blocks_, [](const auto& entry) { return entry.second.texture.use_count() <= 1; });
    // A list's entry shares with the file's. One in use that is dropped costs a look-up later, nothing else.
    std::erase_if(lists_,
                  [](const auto& entry) { return entry.second.texture && entry.second.texture.use_count() <= 2; });
    std::erase_if(files_, [](const auto& entry) { return entry.second.use_count() == 1; });
    std::erase_if(pixels_, [](const auto& entry) { return entry.second.texture.use_count() <= 1; });
    std::erase_if(films_, [](const auto& entry) { return entry.second.shown.use_count() <= 1; });
    kept_ = kept();
    std::unordered_set<const Texture*> inUse;
    for (const auto& [key, texture] : files_) inUse.insert(texture.get());
    for (const auto& [key, list] : lists_)
        if (list.texture) inUse.insert(list.texture.get());
    pixelsInUse_ = 0;
    for (const Texture* texture : inUse) pixelsInUse_ += pixelsOf(*texture);
    for (const auto& [name, film] : films_)
        if (film.shown) pixelsInUse_ += pixelsOf(*film.shown);
    for (const auto& [node, drawn] : drawn_) pixelsInUse_ += drawn.pixels;
    for (const auto& [picture, cube] : cubes_) pixelsInUse_ += pixelsOf(*picture);
    for (const auto& [name, block] : blocks_)
        if (block.texture && block.words.empty())
            pixelsInUse_ += pixelsOf(*block.texture->layers()[0]) * block.texture->layers().size();
}

}  // namespace rtsg
