// Reads KTX 2.0 files: finds the largest level, unpacks it, and brings its texels into the order and form of pictures.
#include "ktx2.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <string_view>

#include <fmt/format.h>
#include <zlib.h>
#include <zstd.h>
#include <glm/gtc/packing.hpp>

namespace rtsg {

namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::uint8_t kIdentifier[] = {0xAB, 'K', 'T', 'X', ' ', '2', '0', 0xBB, '\r', '\n', 0x1A, '\n'};
constexpr std::size_t kHeaderSize = 80, kIndexEntry = 24;

/// The form of a texel, or of a block of 4 x 4.
enum class Texel : std::uint8_t { u8, u16, f16, f32, rgb9e5, rg11b10, rgb10a2, dxt, dx10 };

struct Form {
    std::uint32_t number;  // VkFormat
    Texel texel;
    int channels;
    int bytes;              // of a texel or block
    bool srgb = false;      // the name says so
    bool reversed = false;  // BGR in place of RGB
    std::uint32_t dds = 0;  // FourCC or DXGI_FORMAT of blocks
};

constexpr std::uint32_t fourCc(const char* text) {
    return static_cast<std::uint32_t>(text[0]) | static_cast<std::uint32_t>(text[1]) << 8 |
           static_cast<std::uint32_t>(text[2]) << 16 | static_cast<std::uint32_t>(text[3]) << 24;
}

constexpr Form kForms[] = {
    {9, Texel::u8, 1, 1},
    {15, Texel::u8, 1, 1, true},
    {16, Texel::u8, 2, 2},
    {22, Texel::u8, 2, 2, true},
    {23, Texel::u8, 3, 3},
    {29, Texel::u8, 3, 3, true},
    {30, Texel::u8, 3, 3, false, true},
    {36, Texel::u8, 3, 3, true, true},
    {37, Texel::u8, 4, 4},
    {43, Texel::u8, 4, 4, true},
    {44, Texel::u8, 4, 4, false, true},
    {50, Texel::u8, 4, 4, true, true},
    {64, Texel::rgb10a2, 4, 4},
    {70, Texel::u16, 1, 2},
    {76, Texel::f16, 1, 2},
    {77, Texel::u16, 2, 4},
    {83, Texel::f16, 2, 4},
    {84, Texel::u16, 3, 6},
    {90, Texel::f16, 3, 6},
    {91, Texel::u16, 4, 8},
    {97, Texel::f16, 4, 8},
    {100, Texel::f32, 1, 4},
    {103, Texel::f32, 2, 8},
    {106, Texel::f32, 3, 12},
    {109, Texel::f32, 4, 16},
    {122, Texel::rg11b10, 3, 4},
    {123, Texel::rgb9e5, 3, 4},
    // BC1 without alpha is opaque where BC1 with alpha is clear.
    {131, Texel::dxt, 3, 8, false, false, fourCc("DXT1")},
    {132, Texel::dxt, 3, 8, true, false, fourCc("DXT1")},
    {133, Texel::dxt, 4, 8, false, false, fourCc("DXT1")},
    {134, Texel::dxt, 4, 8, true, false, fourCc("DXT1")},
    {135, Texel::dxt, 4, 16, false, false, fourCc("DXT3")},
    {136, Texel::dxt, 4, 16, true, false, fourCc("DXT3")},
    {137, Texel::dxt, 4, 16, false, false, fourCc("DXT5")},
    {138, Texel::dxt, 4, 16, true, false, fourCc("DXT5")},
    {139, Texel::dx10, 1, 8, false, false, 80},
    {141, Texel::dx10, 2, 16, false, false, 83},
    {143, Texel::dx10, 3, 16, false, false, 95},
    {144, Texel::dx10, 3, 16, false, false, 96},
    {145, Texel::dx10, 4, 16, false, false, 98},
    // Readers of DDS files refuse the sRGB variant of the same blocks.
    {146, Texel::dx10, 4, 16, true, false, 98},
};

bool isBlock(const Form& form) {
    return form.texel == Texel::dxt || form.texel == Texel::dx10;
}
/// Two forms of BC6H hold floats.
bool hasFloats(const Form& form) {
    return form.texel == Texel::f16 || form.texel == Texel::f32 || form.texel == Texel::rgb9e5 ||
           form.texel == Texel::rg11b10 || form.number == 143 || form.number == 144;
}
bool ofEightBits(const Form& form) {
    return form.texel == Texel::u8 || (isBlock(form) && !hasFloats(form));
}

/// The statements of the file's head.
struct Ktx2Head {
    const Form* form = nullptr;
    std::uint32_t scheme = 0;  // of supercompression
    int width = 0, height = 0, layers = 1;
    bool cube = false;
    bool display = false;        // numbers are display values (sRGB)
    bool premultiplied = false;  // with alpha
    bool fromRight = false, fromBottom = false, fromBack = false;
    std::string swizzle;  // four of rgba01, or none
    Bytes level;          // the largest, as it is in the file
    std::uint64_t unpacked = 0;

    int slices() const { return cube ? 6 : layers; }
};

template <class T>
T numberAt(Bytes file, std::size_t at) {
    T result;
    std::memcpy(&result, file.data() + at, sizeof(result));
    return result;
}

std::string damagedAt(std::uint64_t byte, std::string_view what) {
    return fmt::format("the KTX2 file is damaged at its byte {}: {}", byte, what);
}

/// Part of a file, if it lies within.
std::optional<Bytes> partOf(Bytes file, std::uint64_t offset, std::uint64_t length) {
    if (offset > file.size() || length > file.size() - offset) return std::nullopt;
    return file.subspan(static_cast<std::size_t>(offset), static_cast<std::size_t>(length));
}

constexpr std::string_view kWhatIsRead =
    "; what is neither packed nor in blocks is read, and BC1 to BC7 (ktx transcode makes them), plain or by Zstandard "
    "or zlib";

/// Why pixels of a form that is not in the table are not read. `model`: the descriptor's colour model.
std::string notRead(std::uint32_t format, unsigned model) {
    const auto noLibrary = [](std::string_view name) {
        return fmt::format("a KTX2 file of {} is not read, as no library that is used decodes it{}", name, kWhatIsRead);
    };
    if (model == 163) return noLibrary("ETC1S (BasisLZ)");
    if (model == 166 || model == 167) return noLibrary("UASTC");
    if (format >= 147 && format <= 156) return noLibrary("ETC2 or EAC");
    if ((format >= 157 && format <= 184) || (format >= 1000066000 && format <= 1000066013)) return noLibrary("ASTC");
    if (format >= 1000054000 && format <= 1000054007) return noLibrary("PVRTC");
    return fmt::format("a KTX2 file of VkFormat {} is not read{}", format, kWhatIsRead);
}

/// The data format descriptor: how numbers mean colours.
std::string readDescriptor(Bytes file, Ktx2Head& head) {
    const auto format = numberAt<std::uint32_t>(file, 12), offset = numberAt<std::uint32_t>(file, 48),
               length = numberAt<std::uint32_t>(file, 52);
    const auto descriptor = partOf(file, offset, length);
    constexpr std::size_t minimum = 4 + 24;  // its size, then a basic block without samples
    if (!descriptor || descriptor->size() < minimum)
        return damagedAt(48, fmt::format("{} bytes at {} hold no data format descriptor", length, offset));
    if (numberAt<std::uint32_t>(*descriptor, 4) != 0)
        return damagedAt(offset + std::uint64_t{4}, "the first block of the descriptor is not a basic one");
    const unsigned model = (*descriptor)[12], transfer = (*descriptor)[14], flags = (*descriptor)[15];
    for (const Form& form : kForms)
        if (form.number == format) head.form = &form;
    if (!head.form) return notRead(format, model);
    constexpr unsigned unspecified = 0, srgb = 2;  // 1: linear
    if (transfer > srgb)
        return fmt::format("a KTX2 file with the transfer function {} is not read; linear (1) and sRGB (2) are",
                           transfer);
    // A file that does not say so is taken as other pictures are.
    head.display = head.form->srgb || transfer == srgb || (transfer == unspecified && !hasFloats(*head.form));
    head.premultiplied = (flags & 1) != 0;
    return {};
}

std::string readOrientation(std::string_view value, bool block, Ktx2Head& head) {
    const bool known = value.size() == (block ? 3u : 2u) && (value[0] == 'r' || value[0] == 'l') &&
                       (value[1] == 'd' || value[1] == 'u') && (!block || value[2] == 'i' || value[2] == 'o');
    if (!known) return fmt::format("the KTX2 file's KTXorientation is \"{}\"", value.substr(0, 8));
    head.fromRight = value[0] == 'l';
    head.fromBottom = value[1] == 'u';
    head.fromBack = block && value[2] == 'o';
    if (head.cube && value != "rd") return "the sides of a cube in a KTX2 file have to have the KTXorientation \"rd\"";
    return {};
}

/// Keys and values: which way rows and channels lie.
std::string readNotes(Bytes file, bool block, Ktx2Head& head) {
    const auto offset = numberAt<std::uint32_t>(file, 56), length = numberAt<std::uint32_t>(file, 60);
    const auto notes = partOf(file, offset, length);
    if (!notes) return damagedAt(56, fmt::format("keys and values reach to {}", offset + std::uint64_t{length}));
    for (std::size_t at = 0; at + 4 <= notes->size();) {
        const auto size = numberAt<std::uint32_t>(*notes, at);
        const auto pair = partOf(*notes, at + 4, size);
        if (!pair) return damagedAt(offset + at, fmt::format("a key and value of {} bytes", size));
        const std::string_view text(reinterpret_cast<const char*>(pair->data()), pair->size());
        const std::size_t end = text.find('\0');
        if (end == std::string_view::npos) return damagedAt(offset + at, "a key that does not end");
        const std::string_view key = text.substr(0, end);
        std::string_view value = text.substr(end + 1);
        value = value.substr(0, value.find('\0'));
        if (key == "KTXorientation")
            if (std::string error = readOrientation(value, block, head); !error.empty()) return error;
        if (key == "KTXswizzle") {
            if (value.size() != 4 || value.find_first_not_of("rgba01") != std::string_view::npos)
                return fmt::format("the KTX2 file's KTXswizzle is \"{}\"", value.substr(0, 8));
            head.swizzle = value;
        }
        at += 4 + (std::size_t{size} + 3) / 4 * 4;
    }
    return {};
}

std::string readSize(Bytes file, Ktx2Head& head) {
    const auto width = numberAt<std::uint32_t>(file, 20), height = numberAt<std::uint32_t>(file, 24),
               depth = numberAt<std::uint32_t>(file, 28), layers = numberAt<std::uint32_t>(file, 32),
               faces = numberAt<std::uint32_t>(file, 36);
    constexpr std::uint32_t maximum = 1u << 20;  // products of three fit into 64 bits; callers ask for less
    if (width == 0) return damagedAt(20, "a width of 0");
    if (width > maximum || height > maximum || depth > maximum)
        return fmt::format("{} x {} x {} pixels are too many", width, height, depth);
    if (height == 0) return "a KTX2 file of one dimension is not read";
    if (layers > 1) return fmt::format("a KTX2 file of an array of {} pictures is not read", layers);
    if (faces != 1 && faces != 6) return damagedAt(36, fmt::format("{} faces", faces));
    if (faces == 6 && (width != height || depth != 0)) return damagedAt(20, "the faces of a cube are not squares");
    head.width = static_cast<int>(width);
    head.height = static_cast<int>(height);
    head.layers = static_cast<int>(std::max(depth, 1u));
    head.cube = faces == 6;
    return {};
}

/// Bytes of the largest level, unpacked.
std::uint64_t levelBytes(const Ktx2Head& head) {
    const auto across = [&](int pixels) {
        return static_cast<std::uint64_t>(isBlock(*head.form) ? (pixels + 3) / 4 : pixels);
    };
    return across(head.width) * across(head.height) * static_cast<std::uint64_t>(head.slices()) *
           static_cast<std::uint64_t>(head.form->bytes);
}

std::string readLevels(Bytes file, Ktx2Head& head) {
    const auto side = static_cast<std::uint32_t>(std::max({head.width, head.height, head.layers}));
    const auto levels = std::max(numberAt<std::uint32_t>(file, 40), 1u);
    if (levels > static_cast<std::uint32_t>(std::bit_width(side)))
        return damagedAt(40, fmt::format("{} levels", levels));
    if (file.size() < kHeaderSize + levels * kIndexEntry) return damagedAt(file.size(), "it ends in its level index");
    for (std::uint32_t i = 0; i < levels; ++i) {
        const std::size_t at = kHeaderSize + i * kIndexEntry;
        const auto offset = numberAt<std::uint64_t>(file, at), length = numberAt<std::uint64_t>(file, at + 8);
        const auto level = partOf(file, offset, length);
        if (!level)
            return damagedAt(at,
                             fmt::format("level {} has {} bytes at {}, the file {}", i, length, offset, file.size()));
        if (i == 0) head.level = *level;
    }
    head.unpacked = numberAt<std::uint64_t>(file, kHeaderSize + 16);
    const std::uint64_t expected = levelBytes(head);
    if (head.unpacked != expected || (head.scheme == 0 && head.level.size() != expected))
        return damagedAt(kHeaderSize, fmt::format("level 0 has {} bytes, {} unpacked; its pixels take {}",
                                                  head.level.size(), head.unpacked, expected));
    return {};
}

std::string readHead(Bytes file, Ktx2Head& head) {
    if (!isKtx2(file)) return "it is no KTX2 file";
    if (file.size() < kHeaderSize) return damagedAt(file.size(), "it ends in its header");
    if (std::string error = readDescriptor(file, head); !error.empty()) return error;
    head.scheme = numberAt<std::uint32_t>(file, 44);
    if (head.scheme == 1) return notRead(0, 163);
    if (head.scheme > 3) return fmt::format("a KTX2 file of the supercompression scheme {} is not read", head.scheme);
    if (std::string error = readSize(file, head); !error.empty()) return error;
    if (std::string error = readNotes(file, numberAt<std::uint32_t>(file, 28) != 0, head); !error.empty()) return error;
    return readLevels(file, head);
}

/// The largest level's bytes: those of the file, or `storage`.
std::string unpack(const Ktx2Head& head, Bytes file, std::vector<std::uint8_t>& storage, Bytes& out) {
    out = head.level;
    if (head.scheme == 0) return {};
    // A block of Zstandard has 128 KiB at most and takes 4 bytes; deflate makes 258 bytes of two bits. No memory is
    // taken for what cannot be in there.
    const std::uint64_t ratio = head.scheme == 2 ? 32768 : 1032;
    const auto where = static_cast<std::uint64_t>(head.level.data() - file.data());
    if (head.unpacked / ratio > head.level.size())
        return damagedAt(where, fmt::format("{} bytes cannot hold {}", head.level.size(), head.unpacked));
    storage.resize(static_cast<std::size_t>(head.unpacked));
    if (head.scheme == 2) {
        const std::size_t done = ZSTD_decompress(storage.data(), storage.size(), head.level.data(), head.level.size());
        if (ZSTD_isError(done)) return damagedAt(where, ZSTD_getErrorName(done));
        if (done != storage.size()) return damagedAt(where, fmt::format("level 0 ends after {} bytes", done));
    } else {
        uLongf done = storage.size();
        const int status = uncompress(storage.data(), &done, head.level.data(), head.level.size());
        if (status != Z_OK) return damagedAt(where, "level 0 is not what zlib packs");
        if (done != storage.size()) return damagedAt(where, fmt::format("level 0 ends after {} bytes", done));
    }
    out = storage;
    return {};
}

/// A DDS file of one picture of blocks.
std::vector<std::uint8_t> ddsOf(const Form& form, int width, int height, Bytes blocks) {
    std::vector<std::uint8_t> file;
    file.reserve(148 + blocks.size());
    const auto put = [&](std::uint32_t word) {
        for (int i = 0; i < 4; ++i) file.push_back(static_cast<std::uint8_t>(word >> (8 * i)));
    };
    const auto zeros = [&](int count) {
        for (int i = 0; i < count; ++i) put(0);
    };
    put(fourCc("DDS "));
    put(124), put(0x81007), put(static_cast<std::uint32_t>(height)), put(static_cast<std::uint32_t>(width));
    put(static_cast<std::uint32_t>(blocks.size())), zeros(13);
    const bool legacy = form.texel == Texel::dxt;
    put(32), put(4), put(legacy ? form.dds : fourCc("DX10")), zeros(5);
    put(0x1000), zeros(4);
    if (!legacy) put(form.dds), put(3), put(0), put(1), put(0);
    file.insert(file.end(), blocks.begin(), blocks.end());
    return file;
}

/// Slice after slice, `channels` of them a pixel, as bytes or floats.
struct Ktx2Source {
    std::vector<FilePixels> decoded;  // of blocks, one a slice
    Bytes texels;
    int channels = 0;
};

std::string decodeBlocks(const Ktx2Head& head, Bytes level, const DdsReader& blocks, Ktx2Source& out) {
    const std::size_t slice = level.size() / static_cast<std::size_t>(head.slices());
    for (int i = 0; i < head.slices(); ++i) {
        FilePixels& pixels = out.decoded.emplace_back();
        const Bytes part = level.subspan(static_cast<std::size_t>(i) * slice, slice);
        if (std::string error = blocks(ddsOf(*head.form, head.width, head.height, part), pixels); !error.empty())
            return "its blocks cannot be decoded: " + error;
        const std::size_t numbers = hasFloats(*head.form) ? pixels.values.size() : pixels.bytes.size();
        const auto needed = static_cast<std::size_t>(head.width) * static_cast<std::size_t>(head.height);
        if (pixels.width != head.width || pixels.height != head.height || pixels.channels < head.form->channels ||
            numbers != needed * static_cast<std::size_t>(pixels.channels))
            return "its blocks are decoded into another form";
    }
    out.channels = out.decoded.front().channels;
    return {};
}

/// The numbers of one texel, RGBA as far as there are channels.
void floatsOf(const Form& form, const std::uint8_t* at, float* out) {
    const auto word = [&]<class T>(T, int i = 0) {
        T value;
        std::memcpy(&value, at + static_cast<std::size_t>(i) * sizeof(T), sizeof(T));
        return value;
    };
    const auto all = [&](const auto& vector) {
        for (int c = 0; c < form.channels; ++c) out[c] = vector[c];
    };
    switch (form.texel) {
        case Texel::rgb9e5:
            return all(glm::unpackF3x9_E1x5(word(std::uint32_t{})));
        case Texel::rg11b10:
            return all(glm::unpackF2x11_1x10(word(std::uint32_t{})));
        case Texel::rgb10a2:
            return all(glm::unpackUnorm3x10_1x2(word(std::uint32_t{})));
        default:
            break;
    }
    for (int c = 0; c < form.channels; ++c) {
        if (form.texel == Texel::u16) out[c] = static_cast<float>(word(std::uint16_t{}, c)) / 65535;
        if (form.texel == Texel::f16) out[c] = glm::unpackHalf1x16(word(std::uint16_t{}, c));
        if (form.texel == Texel::f32) out[c] = word(float{}, c);
        if (form.texel == Texel::u8) out[form.reversed && c < 3 ? 2 - c : c] = static_cast<float>(at[c]) / 255;
    }
}

/// The source of each channel of the picture: a channel of the texel, or 0 (kZero) or 1 (kOne).
constexpr int kZero = -1, kOne = -2;
std::vector<int> channelsOf(const Ktx2Head& head) {
    std::vector<int> result;
    if (head.swizzle.empty()) {
        for (int c = 0; c < head.form->channels; ++c) result.push_back(c);
        return result;
    }
    for (const char letter : head.swizzle) {
        const auto number = static_cast<int>(std::string_view("rgba").find(letter));
        if (letter == '0')
            result.push_back(kZero);
        else if (letter == '1' || (letter == 'a' && number >= head.form->channels))
            result.push_back(kOne);
        else
            result.push_back(number < head.form->channels ? number : kZero);
    }
    // Grey by its channels where it is, and opaque where nothing lets through.
    const bool grey = result[0] == result[1] && result[1] == result[2];
    const bool opaque = result[3] == kOne;
    if (opaque) result.pop_back();
    if (grey) result.erase(result.begin(), result.begin() + 2);
    return result;
}

template <class T>
constexpr T kWhole = T{1};
template <>
constexpr std::uint8_t kWhole<std::uint8_t> = 255;

/// Makes colours straight, or multiplies them with alpha, as is asked for.
template <class T>
void settleAlpha(bool straight, bool premultiplied, int channels, std::vector<T>& pixels) {
    if ((channels != 2 && channels != 4) || straight != premultiplied) return;
    const auto step = static_cast<std::size_t>(channels);
    for (std::size_t i = 0; i < pixels.size(); i += step) {
        const float alpha = static_cast<float>(pixels[i + step - 1]) / static_cast<float>(kWhole<T>);
        if (straight && alpha <= 0) continue;
        for (std::size_t c = 0; c + 1 < step; ++c) {
            const float value = static_cast<float>(pixels[i + c]);
            const float settled = straight ? value / alpha : value * alpha;
            if constexpr (std::is_same_v<T, float>)
                pixels[i + c] = settled;
            else
                pixels[i + c] = static_cast<T>(std::lround(std::min(settled, 255.0f)));
        }
    }
}

/// Puts texels where they belong in the picture, slice by slice and row by row.
template <class T>
void arrange(const Ktx2Head& head, const Ktx2Source& source, bool bottomRowFirst, FilePixels& out, std::vector<T>& to) {
    const std::vector<int> channels = channelsOf(head);
    const auto count = channels.size();
    const auto width = static_cast<std::size_t>(head.width), height = static_cast<std::size_t>(head.height);
    const auto outWidth = static_cast<std::size_t>(out.width), outHeight = static_cast<std::size_t>(out.height);
    to.resize(outWidth * outHeight * static_cast<std::size_t>(out.layers) * count);
    const auto pixel = [&](std::size_t slice, std::size_t at, T* numbers) {
        if (!source.decoded.empty()) {
            const FilePixels& pixels = source.decoded[slice];
            const std::size_t first = at * static_cast<std::size_t>(source.channels);
            for (std::size_t c = 0; c < static_cast<std::size_t>(head.form->channels); ++c) {
                if constexpr (std::is_same_v<T, float>)
                    numbers[c] = pixels.values.empty() ? static_cast<float>(pixels.bytes[first + c]) / 255
                                                       : pixels.values[first + c];
                else
                    numbers[c] = pixels.bytes[first + c];
            }
            return;
        }
        const std::uint8_t* texel =
            source.texels.data() + (slice * width * height + at) * static_cast<std::size_t>(head.form->bytes);
        if constexpr (std::is_same_v<T, float>)
            floatsOf(*head.form, texel, numbers);
        else
            for (std::size_t c = 0; c < static_cast<std::size_t>(head.form->channels); ++c)
                numbers[head.form->reversed && c < 3 ? 2 - c : c] = texel[c];
    };
    for (std::size_t slice = 0; slice < static_cast<std::size_t>(head.slices()); ++slice) {
        const std::size_t column = head.cube ? slice / 2 : 0, row = head.cube ? slice % 2 : 0;
        const std::size_t layer = head.cube       ? 0
                                  : head.fromBack ? static_cast<std::size_t>(head.layers) - 1 - slice
                                                  : slice;
        for (std::size_t y = 0; y < height; ++y)
            for (std::size_t x = 0; x < width; ++x) {
                T numbers[4] = {};
                pixel(slice, y * width + x, numbers);
                const std::size_t toX = column * width + (head.fromRight ? width - 1 - x : x);
                std::size_t toY = row * height + (head.fromBottom ? height - 1 - y : y);
                if (bottomRowFirst) toY = outHeight - 1 - toY;
                T* target = &to[((layer * outHeight + toY) * outWidth + toX) * count];
                for (std::size_t c = 0; c < count; ++c)
                    target[c] = channels[c] == kZero ? T{0} : channels[c] == kOne ? kWhole<T> : numbers[channels[c]];
            }
    }
}

}  // namespace

bool isKtx2(std::span<const std::uint8_t> bytes) {
    return bytes.size() >= sizeof(kIdentifier) && std::memcmp(bytes.data(), kIdentifier, sizeof(kIdentifier)) == 0;
}

std::string readKtx2(std::span<const std::uint8_t> file, const ReadRequest& request, const DdsReader& blocks,
                     FilePixels& out) {
    Ktx2Head head;
    if (std::string error = readHead(file, head); !error.empty()) return error;
    if (head.layers > 1 && !request.layers)
        return "the picture is a block of layers, which only a texture of three dimensions shows";
    out.width = head.cube ? 3 * head.width : head.width;
    out.height = head.cube ? 2 * head.height : head.height;
    out.layers = head.layers;
    // Bytes that are light would lose their darkest or brightest tones as sRGB of 8 bits.
    const bool bytes = ofEightBits(*head.form) && (head.display || request.data) && !request.asFloats;
    if (request.check)
        if (std::string refusal = request.check(out.width, out.height, out.layers, bytes); !refusal.empty())
            return refusal;
    std::vector<std::uint8_t> storage;
    Ktx2Source source;
    if (std::string error = unpack(head, file, storage, source.texels); !error.empty()) return error;
    if (isBlock(*head.form))
        if (std::string error = decodeBlocks(head, source.texels, blocks, source); !error.empty()) return error;
    out.channels = static_cast<int>(channelsOf(head).size());
    out.encoded = head.display;
    if (bytes) {
        arrange(head, source, request.bottomRowFirst, out, out.bytes);
        settleAlpha(request.straight, head.premultiplied, out.channels, out.bytes);
    } else {
        arrange(head, source, request.bottomRowFirst, out, out.values);
        settleAlpha(request.straight, head.premultiplied, out.channels, out.values);
    }
    return {};
}

}  // namespace rtsg
