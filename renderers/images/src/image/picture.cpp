// Pictures in files: tone mapping, the formats that are written, reading, comparing.
#include <rtsg/renderers/picture.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string_view>

#include <fmt/format.h>
#include <zlib.h>

#include <rtsg/core/output_file.h>
#include <rtsg/renderers/picture_notes.h>
#include <rtsg/renderers/picture_tiles.h>

#include "image_files.h"

namespace rtsg {

namespace {

bool isLinearFormat(const std::string& extension) {
    return extension == ".exr" || extension == ".hdr" || extension == ".pfm" || extension == ".tif" ||
           extension == ".tiff";
}

/// Authors' colours such as .9 and .1 lie half way between two bytes: the last bits of a float must not choose.
std::uint8_t toByte(float value) {
    constexpr float kTie = 0.5f + 1e-3f;
    return static_cast<std::uint8_t>(std::clamp(value, 0.0f, 1.0f) * 255.0f + kTie);
}

/// The whole file in memory.
using Bytes = std::vector<unsigned char>;

Result<> writeBytes(const Bytes& bytes, const std::filesystem::path& file) {
    return writeWholeFile(file, std::as_bytes(std::span(bytes)));
}

/// Formats that are made in memory, so that errors of the disk are reported by us.
constexpr std::string_view kWritten[] = {".png", ".exr",  ".gif", ".jpg", ".jpeg", ".tif", ".tiff",
                                         ".hdr", ".webp", ".bmp", ".tga", ".ppm",  ".pfm"};

/// Portable float map, which OpenImageIO only reads: colour, rows from the bottom up, little-endian.
Bytes pfm(const Picture& picture) {
    static_assert(std::endian::native == std::endian::little);
    const std::string head = fmt::format("PF\n{} {}\n-1.0\n", picture.width, picture.height);
    Bytes bytes(head.begin(), head.end());
    for (int y = picture.height - 1; y >= 0; --y)
        for (int x = 0; x < picture.width; ++x) {
            const auto* pixel = reinterpret_cast<const unsigned char*>(&picture.at(x, y));
            bytes.insert(bytes.end(), pixel, pixel + 3 * sizeof(float));
        }
    return bytes;
}

/// Adds the layers that only .exr can hold.
void addLayers(const Picture& picture, Sheet& sheet) {
    constexpr const char* kInterval[] = {"interval.R", "interval.G", "interval.B"};
    if (!picture.interval.empty())
        for (int c = 0; c < 3; ++c) sheet.channels.push_back({kInterval[c], &picture.interval[0][c], 3, false});
    for (const PictureLayer& layer : picture.layers)
        for (std::size_t c = 0; c < layer.channels.size(); ++c)
            sheet.channels.push_back({layer.channels[c], &layer.values[c], layer.channels.size(), layer.integers});
    sheet.notes = picture.notes;
}

Result<> encodeSheet(const Sheet& sheet, const std::string& extension, const std::filesystem::path& file,
                     Bytes& created) {
    const auto encode = plainEncoder(extension);
    if (!encode) return std::unexpected(encode.error());
    if (*encode) {
        if (const char* error = (*encode)(sheet, created)) return fail(error, {}, file.string());
        return {};
    }
    const auto files = imageFiles();
    if (!files) return std::unexpected(files.error());
    if (const std::string error = (*files)->encode(file.string(), sheet, created); !error.empty())
        return fail(error, {}, file.string());
    return {};
}

// ---- notes ---------------------------------------------------------------------------------------------------------

constexpr std::size_t kPngSignature = 8, kChunkFrame = 12;  // bytes of a chunk beside its data: length, type, checksum
constexpr std::size_t kPngHead = kPngSignature + kChunkFrame + 13;

void append32(std::string& to, std::uint32_t number) {
    for (int shift = 24; shift >= 0; shift -= 8) to.push_back(static_cast<char>(number >> shift & 0xFF));
}

std::string_view textOf(std::span<const std::uint8_t> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// The text up to a zero, which is taken off; all of it where there is none.
std::string_view takeWord(std::string_view& text) {
    const std::string_view word = text.substr(0, text.find('\0'));
    text.remove_prefix(std::min(word.size() + 1, text.size()));
    return word;
}

std::uint32_t number32(std::string_view bytes, bool bigEndian) {
    std::uint32_t number = 0;
    for (unsigned i = 0; i < 4; ++i)
        number |= std::uint32_t{static_cast<std::uint8_t>(bytes[i])} << 8 * (bigEndian ? 3 - i : i);
    return number;
}

/// Puts notes behind the head of a PNG file, as texts in UTF-8.
void addPngNotes(const PictureNotes& notes, std::vector<unsigned char>& png) {
    if (png.size() < kPngHead) return;
    std::string chunks;
    for (const auto& [key, text] : notes) {
        // Neither packed nor translated.
        const std::string chunk = "iTXt" + key + std::string(5, '\0') + text;
        append32(chunks, static_cast<std::uint32_t>(chunk.size() - 4));
        chunks += chunk;
        append32(chunks,
                 static_cast<std::uint32_t>(crc32_z(0, reinterpret_cast<const Bytef*>(chunk.data()), chunk.size())));
    }
    png.insert(png.begin() + kPngHead, chunks.begin(), chunks.end());
}

/// The texts that addPngNotes() writes, and others of their kind, in their order.
PictureNotes pngNotes(std::span<const std::uint8_t> png) {
    PictureNotes notes;
    for (std::string_view rest = textOf(png).substr(std::min(kPngSignature, png.size())); rest.size() >= kChunkFrame;) {
        const std::size_t length = number32(rest, true);
        if (length > rest.size() - kChunkFrame) break;
        std::string_view text = rest.substr(8, length);
        if (rest.substr(4, 4) == "iTXt") {
            const std::string_view key = takeWord(text);
            const bool packed = text.size() < 2 || text[0] != 0;
            text.remove_prefix(std::min<std::size_t>(2, text.size()));
            (void)takeWord(text), (void)takeWord(text);  // the language, and the key in it
            if (!packed) notes.emplace_back(key, text);
        }
        rest.remove_prefix(kChunkFrame + length);
    }
    return notes;
}

/// The attributes of an OpenEXR file that are texts.
PictureNotes exrNotes(std::span<const std::uint8_t> exr) {
    PictureNotes notes;
    for (std::string_view rest = textOf(exr).substr(std::min<std::size_t>(8, exr.size())); !rest.empty();) {
        const std::string_view name = takeWord(rest), type = takeWord(rest);
        if (name.empty() || rest.size() < 4) break;
        const std::size_t length = number32(rest, false);
        if (length > rest.size() - 4) break;
        if (type == "string") notes.emplace_back(name, rest.substr(4, length));
        rest.remove_prefix(4 + length);
    }
    return notes;
}

}  // namespace

std::string lowerExtension(const std::filesystem::path& file) {
    std::string extension = file.extension().string();
    std::ranges::transform(extension, extension.begin(),
                           [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return extension;
}

Vec3f ToneMap::apply(Vec3f linear) const {
    // A NaN in a picture is a bug elsewhere; black shows it without undefined conversions.
    for (int c = 0; c < 3; ++c) linear[c] = std::isfinite(linear[c]) ? std::max(linear[c] * exposure, 0.0f) : 0.0f;
    const float peak = std::max({linear.r, linear.g, linear.b});
    if (peak <= 1) return linear;
    // Keeps the hue at the gamut's edge and mixes in white for the excess.
    const float white = 1 - 1 / peak;
    return linear / peak * (1 - white) + Vec3f(white);
}

double averageLight(const Picture& picture) {
    constexpr int kTile = 16;
    LogAverage all;
    for (int top = 0; top < picture.height; top += kTile)
        for (int left = 0; left < picture.width; left += kTile) {
            const int right = std::min(left + kTile, picture.width), bottom = std::min(top + kTile, picture.height);
            double sum = 0;
            for (int y = top; y < bottom; ++y)
                for (int x = left; x < right; ++x) {
                    const Vec4f& pixel = picture.at(x, y);
                    sum += double{std::max({pixel.r, pixel.g, pixel.b, 0.0f})};
                }
            const double pixels = double{1} * (right - left) * (bottom - top);
            all.add(sum / pixels, pixels);
        }
    return all.value();
}

Picture toLinear(Picture picture) {
    if (picture.space == ColorSpace::linear) return picture;
    picture.space = ColorSpace::linear;
    for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
        Vec4f& pixel = picture.pixels[i];
        const float alpha = pixel.a > 0 ? pixel.a : 1;
        const Vec3f shown = Vec3f(pixel) / alpha, light = linearFromSrgb(shown);
        if (!picture.interval.empty()) {
            // The farther of the decoded ends counts, so that the interval holds both.
            Vec3f& interval = picture.interval[i];
            const Vec3f off = interval / alpha;
            interval = alpha * glm::max(linearFromSrgb(shown + off) - light, light - linearFromSrgb(shown - off));
        }
        pixel = Vec4f(light * alpha, pixel.a);
    }
    return picture;
}

std::vector<std::uint8_t> toSrgb8(const Picture& picture, const ToneMap& toneMap) {
    std::vector<std::uint8_t> bytes;
    bytes.reserve(picture.pixels.size() * 4);
    const bool display = picture.space == ColorSpace::display;
    const auto shown = [&](const Vec3f& color) {
        if (!display) return srgbFromLinear(toneMap.apply(color));
        Vec3f finite(0);
        for (int c = 0; c < 3; ++c) finite[c] = std::isfinite(color[c]) ? color[c] : 0.0f;
        if (toneMap.exposure == 1) return finite;  // toByte cuts
        return srgbFromLinear(linearFromSrgb(finite) * toneMap.exposure);
    };
    for (const Vec4f& pixel : picture.pixels) {
        const float alpha = std::clamp(pixel.a, 0.0f, 1.0f);
        const Vec3f color = shown(alpha > 0 ? Vec3f(pixel) / alpha : Vec3f(pixel));
        for (int c = 0; c < 3; ++c) bytes.push_back(toByte(color[c]));
        bytes.push_back(toByte(alpha));
    }
    return bytes;
}

Result<> checkPictureName(const std::filesystem::path& file) {
    if (std::ranges::find(kWritten, lowerExtension(file)) != std::end(kWritten)) return {};
    std::string known;
    for (const std::string_view extension : kWritten) known += fmt::format(" {}", extension);
    return fail("no kind of picture that can be written has such a name; there are:" + known, {}, file.string());
}

Result<> checkPictureSize(const std::filesystem::path& file, int width, int height) {
    if (width <= 0 || height <= 0) return fail("the picture is empty", {}, file.string());
    // The libraries say it late and in words of their own; libjpeg ends the process, and a GIF would have the rest.
    struct Format {
        std::string_view extensions, name;
        int largest = 0;
    };
    constexpr Format kFormats[] = {{".jpg .jpeg .jpe .jif .jfif .jfi", "JPEG", 65500},
                                   {".gif", "GIF", 65535},
                                   {".tga", "TGA", 65535},
                                   {".webp", "WebP", 16383},
                                   {".mp4", "film", 16384}};
    const std::string extension = lowerExtension(file);
    for (const Format& format : kFormats) {
        if (extension.empty() || !(std::string(format.extensions) + ' ').contains(extension + ' ')) continue;
        if (std::max(width, height) > format.largest)
            return fail(
                fmt::format("{} x {} pixels: a {} has at most {} a side", width, height, format.name, format.largest),
                {}, file.string());
    }
    if (extension == ".mp4" && (width % 2 != 0 || height % 2 != 0))
        return fail(fmt::format("the width and height of a film are even, not {} x {}", width, height), {},
                    file.string());
    return {};
}

Result<> writePicture(const Picture& picture, const std::filesystem::path& file, const ToneMap& toneMap) {
    if (auto ok = checkPictureName(file); !ok) return ok;
    if (auto ok = checkPictureSize(file, picture.width, picture.height); !ok) return ok;
    const std::string extension = lowerExtension(file);
    if (extension == ".gif") return writeAnimation({&picture, 1}, file, 1, toneMap);
    if (isLinearFormat(extension) && picture.space != ColorSpace::linear)
        return writePicture(toLinear(picture), file, toneMap);
    if (extension == ".pfm") return writeBytes(pfm(picture), file);
    Sheet sheet{.width = picture.width, .height = picture.height, .bytes = nullptr, .values = nullptr};
    std::vector<std::uint8_t> encoded;
    if (isLinearFormat(extension)) {
        sheet.values = &picture.pixels[0].x;
        if (extension == ".exr") addLayers(picture, sheet);
    } else {
        encoded = toSrgb8(picture, toneMap);
        sheet.bytes = encoded.data();
        sheet.opaque = true;  // like the file, in spite of roundings
        for (std::size_t alpha = 3; alpha < encoded.size() && sheet.opaque; alpha += 4)
            sheet.opaque = encoded[alpha] == 255;
    }
    Bytes created;
    if (auto ok = encodeSheet(sheet, extension, file, created); !ok) return ok;
    if (extension == ".png") addPngNotes(picture.notes, created);
    return writeBytes(created, file);
}

Result<> writeAnimation(std::span<const Picture> frames, const std::filesystem::path& file, double framesPerSecond,
                        const ToneMap& toneMap) {
    if (frames.empty()) return fail("there are no frames", {}, file.string());
    const auto files = imageFiles();
    if (!files) return std::unexpected(files.error());
    std::vector<std::vector<std::uint8_t>> encoded;
    std::vector<Sheet> sheets;
    for (const Picture& frame : frames) {
        if (auto ok = checkPictureSize(file, frame.width, frame.height); !ok) return ok;
        if (frame.width != frames[0].width || frame.height != frames[0].height)
            return fail("the frames differ in size", {}, file.string());
        encoded.push_back(toSrgb8(frame, toneMap));
        sheets.push_back(
            {.width = frame.width, .height = frame.height, .bytes = encoded.back().data(), .values = nullptr});
    }
    Bytes created;
    if (const std::string error = (*files)->encodeAnimation(file.string(), sheets, framesPerSecond, created);
        !error.empty())
        return fail(error, {}, file.string());
    return writeBytes(created, file);
}

namespace {

Result<Picture> readWrittenPng(const Bytes& bytes, const std::string& name) {
    const ReadRequest request{.straight = true, .check = {}};
    FilePixels read;
    std::string refused;
    const auto plain = plainReader(bytes);
    if (!plain) return std::unexpected(plain.error());
    if (!(*plain)(bytes, request, read, refused) || !read.damage.empty() || read.bytes.empty() || read.channels < 3)
        return fail(!refused.empty() ? refused : "this is no .png as pictures are written, or it is damaged", {}, name);
    const auto pixels = static_cast<std::size_t>(read.width) * static_cast<std::size_t>(read.height);
    const auto channels = static_cast<std::size_t>(read.channels);
    Bytes rgba(4 * pixels, 255);
    for (std::size_t i = 0; i < pixels; ++i) std::copy_n(&read.bytes[i * channels], channels, &rgba[4 * i]);
    Picture picture = pictureOfBytes(rgba, read.width, read.height);
    picture.notes = pngNotes(bytes);
    return picture;
}

Result<Picture> readWrittenExr(const Bytes& bytes, const std::string& name) {
    const auto read = exrReader();
    if (!read) return std::unexpected(read.error());
    ExrContent content;
    if (const char* error = (*read)(bytes, content)) return fail(error, {}, name);
    Picture picture(content.width, content.height);
    picture.notes = std::move(content.notes);
    constexpr std::string_view kColors = "RGBA";
    std::size_t found = 0;
    for (ExrContent::Channel& channel : content.channels) {
        const std::size_t color = channel.name.size() == 1 ? kColors.find(channel.name[0]) : kColors.npos;
        if (color == kColors.npos) {
            picture.layers.push_back({{channel.name}, channel.integers, std::move(channel.values)});
            continue;
        }
        ++found;
        for (std::size_t i = 0; i < picture.pixels.size(); ++i)
            picture.pixels[i][static_cast<int>(color)] = channel.values[i];
    }
    if (found != kColors.size()) return fail("it has not the channels R, G, B and A", {}, name);
    return picture;
}

}  // namespace

Result<Picture> readWrittenPicture(const std::filesystem::path& file) {
    std::ifstream stream(file, std::ios::binary);
    if (!stream) return fail(std::strerror(errno), {}, file.string());
    const Bytes bytes{std::istreambuf_iterator<char>(stream), {}};
    const std::string extension = lowerExtension(file);
    if (extension == ".png") return readWrittenPng(bytes, file.string());
    if (extension == ".exr") return readWrittenExr(bytes, file.string());
    return fail("only .png and .exr are read as they were written", {}, file.string());
}

Result<PictureNotes> readPictureNotes(const std::filesystem::path& file) {
    const std::string extension = lowerExtension(file);
    if (extension != ".png" && extension != ".exr") return PictureNotes();
    std::ifstream stream(file, std::ios::binary);
    if (!stream) return fail(std::strerror(errno), {}, file.string());
    const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(stream), {}};
    return extension == ".png" ? pngNotes(bytes) : exrNotes(bytes);
}

Result<Picture> readPicture(const std::filesystem::path& file) {
    const auto files = imageFiles();
    if (!files) return std::unexpected(files.error());
    FilePixels pixels;
    const auto read = [&](bool straight) {
        pixels = {};
        return (*files)->readFile(file.string(), {.asFloats = true, .straight = straight, .check = {}}, pixels);
    };
    std::string error = read(false);
    const auto hasAlpha = [&] { return pixels.channels == 2 || pixels.channels == 4; };
    // Alpha is multiplied in behind decoding.
    const bool multiplies = error.empty() && pixels.encoded && hasAlpha();
    if (multiplies) error = read(true);
    if (!error.empty()) return fail(error, {}, file.string());
    Picture picture(pixels.width, pixels.height, Vec4f(0, 0, 0, 1));
    const auto channels = static_cast<std::size_t>(pixels.channels);
    for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
        const float* source = &pixels.values[i * channels];
        Vec4f& pixel = picture.pixels[i];
        for (int c = 0; c < 3; ++c) {
            const float value = source[channels < 3 ? 0 : c];
            pixel[c] = pixels.encoded ? linearFromSrgb(value) : value;
        }
        if (!hasAlpha()) continue;
        pixel.a = source[channels - 1];
        if (multiplies) pixel = Vec4f(Vec3f(pixel) * pixel.a, pixel.a);
    }
    return picture;
}

Result<PictureDifference> compare(const Picture& a, const Picture& b) {
    if (a.width != b.width || a.height != b.height) return fail("the pictures differ in size");
    if (a.space != b.space) return fail("one picture is linear, the other holds display values");
    PictureDifference result;
    double squares = 0, sum = 0;
    for (int y = 0; y < a.height; ++y) {
        for (int x = 0; x < a.width; ++x) {
            for (int c = 0; c < 3; ++c) {
                const double difference = std::abs(double(a.at(x, y)[c]) - double(b.at(x, y)[c]));
                squares += difference * difference;
                sum += difference;
                // Written so that a NaN counts as the worst.
                if (!(difference <= result.maximum) && !std::isnan(result.maximum))
                    result.maximum = difference, result.worstX = x, result.worstY = y;
            }
        }
    }
    const double count = std::max<double>(1, 3.0 * double(a.pixels.size()));
    result.rmse = std::sqrt(squares / count);
    result.mean = sum / count;
    return result;
}

}  // namespace rtsg
