// Decodes pictures into textures, makes their coarser copies, and looks colours up.
#include <rtsg/renderers/texture.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>

#include <fmt/format.h>

#include <rtsg/core/machine.h>
#include <rtsg/core/resource.h>
#include <rtsg/renderers/picture.h>

#include "image/image_files.h"
#include "image/picture_head.h"
#include "mesh/simd8.h"
#include "texture_pixels.h"

namespace rtsg {

const std::array<float, 256>& lightOfBytes() {
    static const auto table = [] {
        std::array<float, 256> result{};
        for (int i = 0; i < 256; ++i)
            result[static_cast<std::size_t>(i)] = linearFromSrgb(static_cast<float>(i) / 255.0f);
        return result;
    }();
    return table;
}

namespace {

constexpr int kMaxSide = 1 << 15;
constexpr int kMaxTiledSide = 1 << 17;  // beyond, single floats between 0 and 1 tell pixels apart too badly

std::uint32_t byteOf(float value) {
    return static_cast<std::uint32_t>(std::lround(std::clamp(value, 0.0f, 1.0f) * 255.0f));
}

std::uint32_t encode(const Vec4f& color, bool decoded) {
    std::uint32_t result = byteOf(color.a) << 24;
    for (int c = 0; c < 3; ++c) result |= byteOf(decoded ? srgbFromLinear(color[c]) : color[c]) << (8 * c);
    return result;
}

/// byteOf(srgbFromLinear(x)), by the light that the middles between bytes stand for: no power is taken.
std::uint32_t byteOfLight(float x) {
    constexpr std::size_t kStarts = 4096;
    struct Table {
        std::array<float, 256> middles{};  // from each byte to the next; the last one is never reached
        std::array<std::uint8_t, kStarts + 1> starts{};
    };
    static const auto table = [] {
        Table result;
        for (std::size_t i = 0; i < 255; ++i)
            result.middles[i] = linearFromSrgb((static_cast<float>(i) + .5f) / 255.0f);
        result.middles[255] = HUGE_VALF;
        std::size_t byte = 0;
        for (std::size_t i = 0; i <= kStarts; ++i) {
            while (static_cast<float>(i) / kStarts >= result.middles[byte]) ++byte;
            result.starts[i] = static_cast<std::uint8_t>(byte);
        }
        return result;
    }();
    const float within = std::clamp(x, 0.0f, 1.0f);
    std::uint32_t byte = table.starts[static_cast<std::size_t>(within * kStarts)];
    while (within >= table.middles[byte]) ++byte;
    return byte;
}

/// The mean of four opaque pixels.
std::uint32_t meanOfFour(const std::array<std::uint32_t, 4>& words, bool decode) {
    std::uint32_t result = 255u << 24;
    for (unsigned shift = 0; shift < 24; shift += 8) {
        const auto byte = [&](std::size_t i) { return words[i] >> shift & 255u; };
        if (decode) {
            const auto& table = lightOfBytes();
            result |= byteOfLight((table[byte(0)] + table[byte(1)] + table[byte(2)] + table[byte(3)]) / 4) << shift;
        } else {
            result |= (byte(0) + byte(1) + byte(2) + byte(3) + 2) / 4 << shift;
        }
    }
    return result;
}

/// Pixel number of a coordinate that may lie outside; -1: the border. `size` >= 1.
int wrapIndex(int i, int size, TextureWrap wrap) {
    if (i >= 0 && i < size) return i;  // nearly all; the others cost divisions
    switch (wrap) {
        case TextureWrap::repeat:
            i %= size;
            return i < 0 ? i + size : i;
        case TextureWrap::mirror: {
            i %= 2 * size;
            if (i < 0) i += 2 * size;
            return i < size ? i : 2 * size - 1 - i;
        }
        case TextureWrap::border:
            return i >= 0 && i < size ? i : -1;
        case TextureWrap::clamp:
            break;
    }
    return std::clamp(i, 0, size - 1);
}

using F4 = float __attribute__((vector_size(16)));

/// The values of a pixel's four bytes, each from 0 to 1.
F4 valuesOf(std::uint32_t word) {
    using U4 = std::uint8_t __attribute__((vector_size(4)));
    U4 bytes;
    std::memcpy(&bytes, &word, sizeof bytes);
    return __builtin_convertvector(bytes, F4) * (1 / 255.0f);
}

/// The same in linear light.
F4 lightOf(std::uint32_t word, const float* table) {
    return F4{table[word & 255u], table[word >> 8 & 255u], table[word >> 16 & 255u],
              static_cast<float>(word >> 24) * (1 / 255.0f)};
}

/// Brings a coordinate near 0 so that it fits into int and keeps its precision.
float reduce(float s, TextureWrap wrap) {
    if (!std::isfinite(s)) return 0;
    if (wrap == TextureWrap::clamp) return std::clamp(s, 0.0f, 1.0f);
    if (wrap == TextureWrap::border) return std::clamp(s, -1.0f, 2.0f);
    const float period = wrap == TextureWrap::mirror ? 2.0f : 1.0f;
    return s - period * std::floor(s / period);
}

Result<> checkSize(int width, int height, std::size_t pixels) {
    if (width <= 0 || height <= 0) return fail("the texture has no pixels");
    if (width > kMaxSide || height > kMaxSide) return fail("the texture is larger than 32768 pixels a side");
    if (pixels < static_cast<std::size_t>(width) * static_cast<std::size_t>(height))
        return fail("the texture has fewer pixels than its size says");
    return {};
}

/// Bottom row first: SFImage and texture coordinates both start at the lower left.
ReadRequest request(std::uint64_t maximumPixels, Texture::Content content, bool layers = false) {
    return {
        .asFloats = false,
        .bottomRowFirst = true,
        .layers = layers,
        .straight = true,
        .data = content == Texture::Content::data,
        .check = [maximumPixels](int width, int height, int count, bool bytes) -> std::string {
            if (const auto ok = checkSize(width, height, SIZE_MAX); !ok) return ok.error().text;
            if (count > kMaxSide) return "the texture has more than 32768 layers";
            const auto pixels = static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) *
                                static_cast<std::uint64_t>(count);
            // During reading there are rows in the file's format, and the rows that are kept.
            const std::uint64_t whileRead = pixels * (bytes ? 2 * 4 : 2 * sizeof(Vec4f));
            if (pixels <= maximumPixels / (bytes ? 1 : 4)) {
                const auto ok = mayHold(whileRead);
                return ok ? std::string() : ok.error().text;
            }
            return fmt::format(
                "{} x {}{} pixels{} are more than {}; --limit pixels=N raises this, to a fourth of N, and TIFF and EXR "
                "files of tiles (maketx makes them) may have more",
                width, height, count > 1 ? fmt::format(" x {}", count) : "", bytes ? "" : " of more than 8 bits",
                maximumPixels);
        }};
}

}  // namespace

Result<Texture> textureFromPixels(const FilePixels& file, Texture::Content content, int layer) {
    const auto channels = static_cast<std::size_t>(file.channels);
    const auto count = static_cast<std::size_t>(file.width) * static_cast<std::size_t>(file.height);
    const std::size_t first = static_cast<std::size_t>(layer) * count * channels;
    if (file.values.empty())
        return Texture::fromBytes(std::span(file.bytes).subspan(first, count * channels), file.width, file.height,
                                  file.channels, content);
    const bool encoded = content == Texture::Content::color && file.encoded;
    std::vector<Vec4f> pixels(count);
    for (std::size_t i = 0; i < count; ++i) {
        const float* source = &file.values[first + i * channels];
        for (int c = 0; c < 3; ++c) {
            const float value = source[channels < 3 ? 0 : c];
            pixels[i][c] = encoded ? linearFromSrgb(value) : value;
        }
        pixels[i].a = channels == 2 || channels == 4 ? source[channels - 1] : 1;
    }
    return Texture::fromFloats(std::move(pixels), file.width, file.height, file.channels, content);
}

Result<Texture> Texture::fromBytes(std::span<const std::uint8_t> bytes, int width, int height, int channels,
                                   Content content) {
    if (channels < 1 || channels > 4) return fail("a texture has 1 to 4 components");
    if (auto ok = checkSize(width, height, bytes.size() / static_cast<std::size_t>(channels)); !ok)
        return std::unexpected(ok.error());
    Texture texture;
    texture.channels_ = channels;
    texture.content_ = content;
    Level level{width, height, 0, {}, {}};
    level.encoded.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    const std::uint8_t* p = bytes.data();
    for (std::uint32_t& pixel : level.encoded) {
        const std::uint32_t r = p[0], g = channels < 3 ? r : p[1], b = channels < 3 ? r : p[2];
        const std::uint32_t a = channels == 2 ? p[1] : channels == 4 ? p[3] : 255u;
        pixel = r | g << 8 | b << 16 | a << 24;
        p += channels;
    }
    texture.finest_ = std::move(level);
    texture.noteAlpha();
    return texture;
}

Result<Texture> Texture::fromFloats(std::vector<Vec4f> pixels, int width, int height, int channels, Content content) {
    if (auto ok = checkSize(width, height, pixels.size()); !ok) return std::unexpected(ok.error());
    Texture texture;
    texture.channels_ = channels;
    texture.content_ = content;
    for (Vec4f& pixel : pixels)
        for (int c = 0; c < 4; ++c)
            if (!std::isfinite(pixel[c])) pixel[c] = 0;
    texture.finest_ = {width, height, 0, {}, std::move(pixels)};
    texture.wide_ = true;
    texture.noteAlpha();
    return texture;
}

Result<Texture> Texture::fromImage(const Image& image, Content content) {
    const int width = image.width(), height = image.height(), channels = image.components();
    if (channels < 1 || channels > 4)
        return fail("an SFImage has 1 to 4 components, this one " + std::to_string(channels));
    if (auto ok = checkSize(width, height, image.words.size() - 3); !ok) return std::unexpected(ok.error());
    std::vector<std::uint8_t> bytes;
    const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    bytes.reserve(pixels * static_cast<std::size_t>(channels));
    for (std::size_t i = 0; i < pixels; ++i) {
        const auto word = static_cast<std::uint32_t>(image.words[i + 3]);
        for (int c = channels - 1; c >= 0; --c) bytes.push_back(static_cast<std::uint8_t>(word >> (8 * c)));
    }
    return fromBytes(bytes, width, height, channels, content);
}

Result<Texture> Texture::fromFile(const std::filesystem::path& file, Content content, std::uint64_t maximumPixels) {
    std::ifstream stream(file, std::ios::binary);
    if (!stream) return fail(std::strerror(errno), {}, file.string());
    const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
    return fromMemory({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, file.string(), content,
                      maximumPixels);
}

Result<Texture> Texture::fromMemory(std::span<const std::uint8_t> file, const std::string& name, Content content,
                                    std::uint64_t maximumPixels) {
    FilePixels pixels;
    std::string refused = whyNotWithin(file);
    if (!refused.empty()) return fail(refused, {}, name);
    if (const auto plain = plainReader(file);
        plain && (*plain)(file, request(maximumPixels, content), pixels, refused)) {
        auto texture = textureFromPixels(pixels, content);
        if (texture) texture->damage_ = std::move(pixels.damage);
        return texture;
    }
    if (!refused.empty()) return fail(refused, {}, name);
    pixels = {};
    const auto files = imageFiles();
    if (!files) return std::unexpected(files.error());
    if (const std::string error = (*files)->readMemory(file, name, request(maximumPixels, content), pixels);
        !error.empty())
        return fail(error, {}, name);
    return textureFromPixels(pixels, content);
}

Result<std::vector<Texture>> Texture::layersFromMemory(std::span<const std::uint8_t> file, const std::string& name,
                                                       Content content, std::uint64_t maximumPixels) {
    if (std::string refused = whyNotWithin(file); !refused.empty()) return fail(refused, {}, name);
    const auto files = imageFiles();
    if (!files) return std::unexpected(files.error());
    FilePixels pixels;
    if (const std::string error = (*files)->readMemory(file, name, request(maximumPixels, content, true), pixels);
        !error.empty())
        return fail(error, {}, name);
    std::vector<Texture> result;
    for (int layer = 0; layer < pixels.layers; ++layer) {
        auto texture = textureFromPixels(pixels, content, layer);
        if (!texture) return std::unexpected(texture.error());
        result.push_back(std::move(*texture));
    }
    return result;
}

Result<Texture> Texture::fromTiles(std::shared_ptr<const Resource> file, const std::string& name, Content content) {
    ByteSource source;
    source.size = file->size();
    source.read = [file](std::uint64_t offset, void* to, std::size_t length) {
        const std::string part = file->readAt(offset, length);
        std::memcpy(to, part.data(), part.size());
        return part.size();
    };
    if (std::string refused = whyNotWithin(source); !refused.empty()) return fail(refused, {}, file->name());
    const auto files = imageFiles();
    if (!files) return std::unexpected(files.error());
    std::unique_ptr<TiledPicture> picture;
    if (const std::string error = (*files)->openTiles(std::move(source), name, picture); !error.empty())
        return fail(error, {}, file->name());
    Texture texture;
    texture.channels_ = picture->channels;
    texture.content_ = content;
    texture.wide_ = !picture->encoded;
    texture.hasAlpha_ = texture.hasPartialAlpha_ = picture->channels == 2 || picture->channels == 4;
    for (const TiledPicture::Level& level : picture->levels) {
        if (level.width > kMaxTiledSide || level.height > kMaxTiledSide)
            return fail("the texture is larger than 131072 pixels a side", {}, file->name());
        const auto number = static_cast<int>(&level - picture->levels.data());
        const Level created{level.width, level.height, number, {}, {}};
        if (number == 0) {
            texture.finest_ = created;
            continue;
        }
        for (Coarse& coarse : *texture.coarse_) coarse.levels.push_back(created);
    }
    for (Coarse& coarse : *texture.coarse_) coarse.built = true;
    texture.tiles_ = std::move(picture);
    return texture;
}

std::string Texture::damage() const {
    return tiles_ ? tiles_->damage() : damage_;
}

void Texture::readTiles(const Level& level, int x, int y, int columns, int rows, bool decode, Vec4f* out) const {
    float numbers[16];
    const int channels = tiles_->channels;
    (void)tiles_->read(level.number, x, level.height - y - rows, columns, rows, numbers);  // damage() tells
    for (int i = 0; i < columns * rows; ++i) {
        const float* from = numbers + std::ptrdiff_t{i} * channels;
        Vec4f& pixel = out[(rows - 1 - i / columns) * columns + i % columns];
        pixel = {from[0], from[channels < 3 ? 0 : 1], from[channels < 3 ? 0 : 2],
                 channels == 2 || channels == 4 ? from[channels - 1] : 1};
        for (int c = 0; c < 4; ++c)
            if (!std::isfinite(pixel[c])) pixel[c] = 0;
        if (decode) pixel = Vec4f(linearFromSrgb(Vec3f(pixel)), pixel.a);
    }
}

void Texture::noteAlpha() {
    std::uint32_t all = ~0u;
    for (const std::uint32_t pixel : finest_.encoded) all &= pixel;
    if (all >> 24 == 255 && finest_.linear.empty()) return;
    for (const std::uint32_t pixel : finest_.encoded) {
        hasAlpha_ = hasAlpha_ || pixel >> 24 != 255;
        hasPartialAlpha_ = hasPartialAlpha_ || (pixel >> 24 != 255 && pixel >> 24 != 0);
    }
    for (const Vec4f& pixel : finest_.linear) {
        hasAlpha_ = hasAlpha_ || pixel.a < 1;
        hasPartialAlpha_ = hasPartialAlpha_ || (pixel.a < 1 && pixel.a > 0);
    }
}

Texture::Level Texture::halved(const Level& fine, bool decode) const {
    Level coarse{std::max(fine.width / 2, 1), std::max(fine.height / 2, 1), fine.number + 1, {}, {}};
    const auto count = static_cast<std::size_t>(coarse.width) * static_cast<std::size_t>(coarse.height);
    if (fine.linear.empty())
        coarse.encoded.resize(count);
    else
        coarse.linear.resize(count);
    const bool even = fine.linear.empty() && fine.width == 2 * coarse.width && fine.height == 2 * coarse.height;
    const auto fineWidth = static_cast<std::size_t>(fine.width);
    // Odd sizes: each coarse pixel averages the fine pixels whose centres it covers (2 or 3 a side).
    for (int y = 0; y < coarse.height; ++y) {
        const int y0 = y * fine.height / coarse.height, y1 = (y + 1) * fine.height / coarse.height;
        for (int x = 0; x < coarse.width; ++x) {
            const auto at =
                static_cast<std::size_t>(y) * static_cast<std::size_t>(coarse.width) + static_cast<std::size_t>(x);
            if (even) {  // and opaque, as nearly all are
                const std::uint32_t* low =
                    &fine.encoded[static_cast<std::size_t>(2 * y) * fineWidth + 2 * static_cast<std::size_t>(x)];
                const std::array<std::uint32_t, 4> words{low[0], low[1], low[fineWidth], low[fineWidth + 1]};
                if ((words[0] & words[1] & words[2] & words[3]) >> 24 == 255) {
                    coarse.encoded[at] = meanOfFour(words, decode);
                    continue;
                }
            }
            const int x0 = x * fine.width / coarse.width, x1 = (x + 1) * fine.width / coarse.width;
            Vec3f color(0), plain(0);
            float alpha = 0;
            for (int j = y0; j < y1; ++j)
                for (int i = x0; i < x1; ++i) {
                    const Vec4f pixel = texel(fine, i, j, decode);
                    color += Vec3f(pixel) * pixel.a;
                    plain += Vec3f(pixel);
                    alpha += pixel.a;
                }
            const auto n = static_cast<float>((y1 - y0) * (x1 - x0));
            // Weighted by alpha, so that transparent pixels do not bleed into visible ones.
            const Vec4f average(alpha > 0 ? color / alpha : plain / n, alpha / n);
            if (fine.linear.empty())
                coarse.encoded[at] = encode(average, decode);
            else
                coarse.linear[at] = average;
        }
    }
    return coarse;
}

const std::vector<Texture::Level>& Texture::coarse(bool decode) const {
    Coarse& c = (*coarse_)[decode ? 1 : 0];
    if (c.built.load(std::memory_order_acquire)) return c.levels;
    const std::lock_guard lock(c.building);
    if (c.built.load(std::memory_order_relaxed)) return c.levels;
    const auto last = [&]() -> const Level& { return c.levels.empty() ? finest_ : c.levels.back(); };
    while (last().width > 1 || last().height > 1) c.levels.push_back(halved(last(), decode));
    c.built.store(true, std::memory_order_release);
    return c.levels;
}

int Texture::levels() const {
    return static_cast<int>(coarse(false).size()) + 1;
}

Texture::LevelPixels Texture::level(int number, ColorSpace space) const {
    const bool decode = content_ == Content::color && !wide_ && space == ColorSpace::linear;
    const Level& level = number == 0 ? finest_ : coarse(decode)[static_cast<std::size_t>(number) - 1];
    return {level.width, level.height, level.encoded, level.linear};
}

std::size_t Texture::bytes() const {
    const auto of = [](const Level& level) { return level.encoded.size() * 4 + level.linear.size() * sizeof(Vec4f); };
    std::size_t result = of(finest_);
    for (const Coarse& c : *coarse_)
        if (c.built.load(std::memory_order_acquire))
            for (const Level& level : c.levels) result += of(level);
    return result;
}

Vec4f Texture::texel(const Level& level, int x, int y, bool decode) const {
    if (tiles_) {
        Vec4f pixel;
        readTiles(level, x, y, 1, 1, decode, &pixel);
        return pixel;
    }
    const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(level.width) + static_cast<std::size_t>(x);
    if (!level.linear.empty()) return level.linear[at];
    const std::uint32_t word = level.encoded[at];
    const float alpha = static_cast<float>(word >> 24) * (1 / 255.0f);
    if (!decode)
        return Vec4f(static_cast<float>(word & 255u), static_cast<float>(word >> 8 & 255u),
                     static_cast<float>(word >> 16 & 255u), 0) *
                   (1 / 255.0f) +
               Vec4f(0, 0, 0, alpha);
    const auto& table = lightOfBytes();
    return {table[word & 255u], table[word >> 8 & 255u], table[word >> 16 & 255u], alpha};
}

Vec4f Texture::borderColor(const TextureAccess& access, bool decode) const {
    // The numbers that are kept of pictures with more than 8 bits are light.
    const bool asLight = decode || (content_ == Content::color && wide_);
    return asLight ? Vec4f(linearFromSrgb(Vec3f(access.border)), access.border.a) : access.border;
}

/// `s`, `t`: from reduce().
Vec4f Texture::sampleLevel(const Level& level, float s, float t, const TextureAccess& access, bool smooth,
                           bool decode) const {
    const float x = s * static_cast<float>(level.width);
    const float y = t * static_cast<float>(level.height);
    const auto at = [&](int i, int j) {
        return (i | j) < 0 ? borderColor(access, decode) : texel(level, i, j, decode);
    };
    if (!smooth)
        return at(wrapIndex(static_cast<int>(std::floor(x)), level.width, access.wrapS),
                  wrapIndex(static_cast<int>(std::floor(y)), level.height, access.wrapT));
    const float left = std::floor(x - 0.5f), bottom = std::floor(y - 0.5f);
    const float fx = x - 0.5f - left, fy = y - 0.5f - bottom;
    const int x0 = wrapIndex(static_cast<int>(left), level.width, access.wrapS);
    const int x1 = wrapIndex(static_cast<int>(left) + 1, level.width, access.wrapS);
    const int y0 = wrapIndex(static_cast<int>(bottom), level.height, access.wrapT);
    const int y1 = wrapIndex(static_cast<int>(bottom) + 1, level.height, access.wrapT);
    if (tiles_ && x0 >= 0 && y0 >= 0 && x1 == x0 + 1 && y1 == y0 + 1) {
        Vec4f block[4];
        readTiles(level, x0, y0, 2, 2, decode, block);
        return (block[0] * (1 - fx) + block[1] * fx) * (1 - fy) + (block[2] * (1 - fx) + block[3] * fx) * fy;
    }
    if (!tiles_ && (x0 | x1 | y0 | y1) >= 0) {
        const auto width = static_cast<std::size_t>(level.width);
        const std::size_t low = static_cast<std::size_t>(y0) * width, high = static_cast<std::size_t>(y1) * width;
        const auto mixed = [&](const auto& pixels, const auto& of) {
            const auto *const lower = pixels.data() + low, *const upper = pixels.data() + high;
            const F4 bottomRow = of(lower[x0]) * (1 - fx) + of(lower[x1]) * fx;
            const F4 topRow = of(upper[x0]) * (1 - fx) + of(upper[x1]) * fx;
            const F4 found = bottomRow * (1 - fy) + topRow * fy;
            return Vec4f(found[0], found[1], found[2], found[3]);
        };
        if (!level.linear.empty()) return mixed(level.linear, [](const Vec4f& v) { return F4{v.x, v.y, v.z, v.w}; });
        if (!decode) return mixed(level.encoded, valuesOf);
        const float* const table = lightOfBytes().data();
        return mixed(level.encoded, [table](std::uint32_t word) { return lightOf(word, table); });
    }
    return (at(x0, y0) * (1 - fx) + at(x1, y0) * fx) * (1 - fy) + (at(x0, y1) * (1 - fx) + at(x1, y1) * fx) * fy;
}

Vec4f Texture::sampleLevels(float s, float t, float footprint, const TextureAccess& access, bool decode) const {
    s = reduce(s, access.wrapS), t = reduce(t, access.wrapT);
    const float pixels = footprint * std::sqrt(static_cast<float>(width()) * static_cast<float>(height()));
    if (!(pixels > 1)) return sampleLevel(finest_, s, t, access, access.smooth, decode);
    const bool smooth = access.smoothFar;
    if (access.levels == TextureLevels::finest) return sampleLevel(finest_, s, t, access, smooth, decode);
    const std::vector<Level>& levels = coarse(decode);
    const auto level = [&](std::size_t i) -> const Level& { return i == 0 ? finest_ : levels[i - 1]; };
    const auto last = levels.size();
    float depth = simd::log2Of(simd::all(pixels))[0];  // as sampleLanes()
    if (access.levels == TextureLevels::nearest) depth = std::round(depth);
    if (depth >= static_cast<float>(last)) return sampleLevel(level(last), s, t, access, smooth, decode);
    const auto fine = static_cast<std::size_t>(depth);
    const float f = depth - static_cast<float>(fine);
    if (f == 0) return sampleLevel(level(fine), s, t, access, smooth, decode);
    return sampleLevel(level(fine), s, t, access, smooth, decode) * (1 - f) +
           sampleLevel(level(fine + 1), s, t, access, smooth, decode) * f;
}

Vec4f Texture::sample(float s, float t, float footprint, const TextureAccess& access, ColorSpace space) const {
    const bool color = content_ == Content::color;
    const Vec4f found = sampleLevels(s, t, footprint, access, color && !wide_ && space == ColorSpace::linear);
    // Pictures with more than 8 bits are kept as light.
    if (color && wide_ && space == ColorSpace::display) return {srgbFromLinear(Vec3f(found)), found.a};
    return found;
}

Texture Texture::part(int x, int y, int partWidth, int partHeight, bool turned) const {
    Texture result;
    result.channels_ = channels_;
    result.content_ = content_;
    result.wide_ = wide_;
    Level level{partWidth, partHeight, 0, {}, {}};
    const auto copy = [&](const auto& from, auto& to) {
        if (from.empty()) return;
        to.reserve(static_cast<std::size_t>(partWidth) * static_cast<std::size_t>(partHeight));
        for (int j = 0; j < partHeight; ++j) {
            const auto row = from.begin() + std::ptrdiff_t{y + j} * finest_.width + x;
            to.insert(to.end(), row, row + partWidth);
        }
        if (turned) std::reverse(to.begin(), to.end());
    };
    copy(finest_.encoded, level.encoded);
    copy(finest_.linear, level.linear);
    result.finest_ = std::move(level);
    result.noteAlpha();
    return result;
}

TextureMatrix TextureMatrix::fromTransform(Vec2f center, float rotation, Vec2f scale, Vec2f translation) {
    // The matrices act on (s, t) from the right end of the product: translate, then about the centre rotate and scale.
    const float c = std::cos(rotation), n = std::sin(rotation);
    TextureMatrix m;
    m.s = {scale.x * c, -scale.x * n, 0};
    m.t = {scale.y * n, scale.y * c, 0};
    const Vec2f moved = translation + center;
    m.s.z = m.s.x * moved.x + m.s.y * moved.y - center.x;
    m.t.z = m.t.x * moved.x + m.t.y * moved.y - center.y;
    return m;
}

float TextureMatrix::stretch() const {
    return std::sqrt(std::abs(s.x * t.y - s.y * t.x));
}

}  // namespace rtsg
