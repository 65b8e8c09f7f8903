// The module librtsg_oiio.so: image files by OpenImageIO. It does not link this project's libraries, and throws
// nothing.
#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstring>
#include <fstream>
#include <memory>

#include <dlfcn.h>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include "image/image_files.h"
#include "ktx2.h"
#include "png.h"
#include "tiles.h"

namespace rtsg {

namespace {

/// Libraries say several things one below the other.
std::string inOneLine(std::string errors) {
    while (!errors.empty() && errors.back() == '\n') errors.pop_back();
    for (std::size_t at = 0; (at = errors.find('\n', at)) != std::string::npos; ++at) errors.replace(at, 1, "; ");
    return errors;
}

/// OpenImageIO gives an .exr without a date that of its writing, and files of two runs would differ.
constexpr const char* kNoDate = "1970:01:01 00:00:00";

std::string readInput(OIIO::ImageInput& input, const ReadRequest& request, FilePixels& out) {
    const OIIO::ImageSpec spec = input.spec();
    const bool eightBits = spec.format == OIIO::TypeDesc::UINT8;
    if (spec.width <= 0 || spec.height <= 0 || spec.nchannels <= 0) return "the picture has no pixels";
    const int layers = std::max(spec.depth, 1);
    if (layers > 1 && !request.layers)
        return "the picture is a block of layers, which only a texture of three dimensions shows";
    if (request.check)
        if (std::string refusal = request.check(spec.width, spec.height, layers, eightBits); !refusal.empty())
            return refusal;
    out.width = spec.width;
    out.height = spec.height;
    out.layers = layers;
    out.channels = std::min(spec.nchannels, 4);
    out.encoded = spec.format != OIIO::TypeDesc::FLOAT && spec.format != OIIO::TypeDesc::HALF;
    const auto row = static_cast<std::size_t>(spec.width) * static_cast<std::size_t>(out.channels);
    const std::size_t layer = row * static_cast<std::size_t>(spec.height);
    const auto read = [&](auto& pixels, const OIIO::TypeDesc& type) {
        pixels.resize(layer * static_cast<std::size_t>(layers));
        const auto element = static_cast<OIIO::stride_t>(sizeof(pixels[0]));
        const auto stride = static_cast<OIIO::stride_t>(row) * element;
        const auto next = static_cast<OIIO::stride_t>(layer) * element;
        // Bottom row first is a negative stride.
        if (!request.bottomRowFirst)
            return input.read_image(0, 0, 0, out.channels, type, pixels.data(), out.channels * element, stride, next);
        return input.read_image(0, 0, 0, out.channels, type, pixels.data() + (layer - row), out.channels * element,
                                -stride, next);
    };
    const int alpha = spec.alpha_channel;
    const auto divide = [&] {
        // These keep colours multiplied, or multiply them if asked not to; the others do as they are asked.
        const std::string format = input.format_name();
        const bool multiplied = (format == "openexr" || format == "tiff" || format == "webp") &&
                                spec.get_int_attribute("oiio:UnassociatedAlpha") == 0;
        if (!request.straight || !multiplied || alpha < 0 || alpha >= out.channels) return;
        const auto channels = static_cast<std::size_t>(out.channels), at = static_cast<std::size_t>(alpha);
        for (std::size_t i = 0; i < out.values.size(); i += channels)
            for (std::size_t c = 0; c < channels; ++c)
                if (c != at && out.values[i + at] > 0) out.values[i + c] /= out.values[i + at];
        for (std::size_t i = 0; i < out.bytes.size(); i += channels)
            for (std::size_t c = 0; c < channels; ++c)
                if (const int a = out.bytes[i + at]; c != at && a > 0)
                    out.bytes[i + c] = static_cast<std::uint8_t>(std::min((out.bytes[i + c] * 255 + a / 2) / a, 255));
    };
    const bool done = eightBits && !request.asFloats ? read(out.bytes, OIIO::TypeDesc::UINT8)
                                                     : read(out.values, OIIO::TypeDesc::FLOAT);
    if (done) divide();
    return done ? std::string() : inOneLine(input.geterror());
}

/// Some kinds of pictures cannot be opened with settings, and have no alpha to multiply with.
std::unique_ptr<OIIO::ImageInput> openFor(const ReadRequest& request, const std::string& name,
                                          OIIO::Filesystem::IOProxy* memory) {
    const bool bottomUp = name.ends_with(".pfm") || name.ends_with(".PFM");
    if (request.straight || bottomUp) {
        OIIO::ImageSpec settings;
        if (request.straight) settings.attribute("oiio:UnassociatedAlpha", 1);
        // OpenImageIO 2.5 turns them only where it is given settings, though its manual calls that the default.
        if (bottomUp) settings.attribute("pnm:pfmflip", 1);
        // Readers that look at settings look there for the memory, too.
        if (memory)
            settings.attribute("oiio:ioproxy", OIIO::TypeDesc(OIIO::TypeDesc::PTR), static_cast<void*>(&memory));
        if (auto input = OIIO::ImageInput::open(name, &settings, memory)) return input;
        (void)OIIO::geterror();
        if (memory) memory->seek(0);
    }
    return OIIO::ImageInput::open(name, nullptr, memory);
}

/// A picture of blocks, as it is.
std::string readBlocks(std::span<const std::uint8_t> dds, FilePixels& out) {
    OIIO::Filesystem::IOMemReader reader(const_cast<std::uint8_t*>(dds.data()), dds.size());
    const auto input = OIIO::ImageInput::open("blocks.dds", nullptr, &reader);
    return input ? readInput(*input, {.check = {}}, out) : inOneLine(OIIO::geterror());
}

/// The whole of a file that is of KTX 2.0 or PNG by its first bytes; otherwise nothing.
std::vector<std::uint8_t> bytesToLookAt(const std::string& name) {
    std::ifstream file(name, std::ios::binary);
    std::vector<std::uint8_t> bytes(12);
    const auto read = [&](std::size_t at) {
        file.read(reinterpret_cast<char*>(bytes.data() + at), static_cast<std::streamsize>(bytes.size() - at));
        bytes.resize(at + static_cast<std::size_t>(file.gcount()));
    };
    read(0);
    if (!isKtx2(bytes) && !isPng(bytes)) return {};
    constexpr std::size_t step = 1 << 20;
    for (std::size_t at = bytes.size(); file; at = bytes.size()) {
        bytes.resize(at + step);
        read(at);
    }
    return bytes;
}

/// How long each picture of a GIF is shown, in its hundredths of a second, so that none is shown too early or late by
/// more than half of one; two at least, as less is ten to those who show GIFs. OpenImageIO 2.4 rounds all down, 2.5
/// makes all a second.
void setDelays(std::vector<unsigned char>& gif, double framesPerSecond) {
    constexpr std::size_t header = 13;
    constexpr unsigned extension = 0x21, control = 0xF9, picture = 0x2C;
    const auto table = [](unsigned flags) { return (flags & 0x80) != 0 ? std::size_t{6} << (flags & 7) : 0; };
    if (gif.size() < header) return;
    std::size_t at = header + table(gif[10]), shown = 0;
    const auto ends = [&](std::size_t frame) {
        return std::llround(std::min(static_cast<double>(frame) * 100 / framesPerSecond, 1e15));
    };
    while (at + 11 < gif.size() && (gif[at] == extension || gif[at] == picture)) {
        if (gif[at] == extension && gif[at + 1] == control) {
            const auto delay = static_cast<unsigned>(std::clamp(ends(shown + 1) - ends(shown), 2LL, 0xFFFFLL));
            gif[at + 4] = static_cast<unsigned char>(delay & 0xFF),
                     gif[at + 5] = static_cast<unsigned char>(delay >> 8);
            ++shown;
        }
        at += gif[at] == extension ? 2 : 11 + table(gif[at + 9]);
        while (at < gif.size() && gif[at] != 0) at += std::size_t{1} + gif[at];
        ++at;
    }
}

/// Libraries throw where there is no memory, and some where a file is damaged.
template <class Read>
std::string withoutThrowing(const Read& read) {
    try {
        return read();
    } catch (const std::exception& error) {
        return std::string("the picture cannot be read: ") + error.what();
    }
}

class Files final : public ImageFiles {
  public:
    std::string openTiles(ByteSource source, const std::string& name,
                          std::unique_ptr<TiledPicture>& out) const override {
        return withoutThrowing([&] { return openTiledPicture(std::move(source), name, out); });
    }

    std::string readFile(const std::string& file, const ReadRequest& request, FilePixels& out) const override {
        return withoutThrowing([&] { return readNamed(file, request, out); });
    }

    std::string readMemory(std::span<const std::uint8_t> bytes, const std::string& name, const ReadRequest& request,
                           FilePixels& out) const override {
        return withoutThrowing([&] { return readBytes(bytes, name, request, out); });
    }

    static std::string readNamed(const std::string& file, const ReadRequest& request, FilePixels& out) {
        if (const std::vector<std::uint8_t> bytes = bytesToLookAt(file); !bytes.empty())
            return readBytes(bytes, file, request, out);
        const auto input = openFor(request, file, nullptr);
        return input ? readInput(*input, request, out) : inOneLine(OIIO::geterror());
    }

    static std::string readBytes(std::span<const std::uint8_t> bytes, const std::string& name,
                                 const ReadRequest& request, FilePixels& out) {
        if (isKtx2(bytes)) return readKtx2(bytes, request, readBlocks, out);
        if (isPng(bytes))
            if (std::string damage = damageOfPng(bytes, request.check); !damage.empty()) return damage;
        OIIO::Filesystem::IOMemReader reader(const_cast<std::uint8_t*>(bytes.data()), bytes.size());
        const auto input = openFor(request, name, &reader);
        return input ? readInput(*input, request, out) : inOneLine(OIIO::geterror());
    }

    std::string encode(const std::string& name, const Sheet& sheet, std::vector<unsigned char>& file) const override {
        if (!sheet.channels.empty() || !sheet.notes.empty()) return encodeLayers(name, sheet, file);
        const auto output = OIIO::ImageOutput::create(name);
        if (!output) return "cannot write this kind of picture: " + OIIO::geterror();
        // It would divide the colours by an alpha that they were not multiplied with.
        if (!sheet.opaque && output->format_name() == std::string("webp"))
            return "a WebP file that lets through needs libwebp, which this program was built without";
        const bool linear = sheet.values != nullptr;
        const int channels = output->supports("alpha") && (linear || !sheet.opaque) ? 4 : 3;
        OIIO::ImageSpec spec(sheet.width, sheet.height, channels,
                             linear ? OIIO::TypeDesc::FLOAT : OIIO::TypeDesc::UINT8);
        spec.attribute("oiio:ColorSpace", linear ? "Linear" : "sRGB");
        if (linear) spec.attribute("compression", "zip"), spec.attribute("DateTime", kNoDate);
        if (!linear) spec.attribute("oiio:UnassociatedAlpha", 1);
        OIIO::Filesystem::IOVecOutput memory(file);
        if (!output->set_ioproxy(&memory) || !output->open(name, spec)) return output->geterror();
        const bool done = linear ? output->write_image(OIIO::TypeDesc::FLOAT, sheet.values, 4 * sizeof(float))
                                 : output->write_image(OIIO::TypeDesc::UINT8, sheet.bytes, 4);
        return done && output->close() ? std::string() : output->geterror();
    }

    /// Colour, coverage and more channels, for formats that name them.
    static std::string encodeLayers(const std::string& name, const Sheet& sheet, std::vector<unsigned char>& file) {
        const auto output = OIIO::ImageOutput::create(name);
        if (!output) return "cannot write this kind of picture: " + OIIO::geterror();
        const std::size_t channels = 4 + sheet.channels.size();
        OIIO::ImageSpec spec(sheet.width, sheet.height, static_cast<int>(channels), OIIO::TypeDesc::FLOAT);
        spec.channelnames = {"R", "G", "B", "A"};
        spec.alpha_channel = 3;
        const bool integers = std::ranges::any_of(sheet.channels, &SheetChannel::integers);
        if (integers) spec.channelformats.assign(4, OIIO::TypeDesc::FLOAT);
        for (const SheetChannel& channel : sheet.channels) {
            spec.channelnames.push_back(channel.name);
            if (integers)
                spec.channelformats.emplace_back(channel.integers ? OIIO::TypeDesc::UINT32 : OIIO::TypeDesc::FLOAT);
        }
        spec.attribute("oiio:ColorSpace", "Linear");
        spec.attribute("compression", "zip");
        spec.attribute("DateTime", kNoDate);
        for (const auto& [key, text] : sheet.notes) spec.attribute(key, text);
        const std::size_t pixels = static_cast<std::size_t>(sheet.width) * static_cast<std::size_t>(sheet.height);
        std::vector<float> all(pixels * channels);  // all channels have 32 bits, whatever their meaning
        for (std::size_t i = 0; i < pixels; ++i) {
            std::memcpy(&all[i * channels], sheet.values + i * 4, 4 * sizeof(float));
            for (std::size_t c = 4; c < channels; ++c) {
                const SheetChannel& channel = sheet.channels[c - 4];
                std::memcpy(&all[i * channels + c], channel.first + i * channel.stride, sizeof(float));
            }
        }
        OIIO::Filesystem::IOVecOutput memory(file);
        if (!output->set_ioproxy(&memory) || !output->open(name, spec)) return output->geterror();
        const bool done = output->write_image(integers ? OIIO::TypeDesc::UNKNOWN : OIIO::TypeDesc::FLOAT, all.data());
        return done && output->close() ? std::string() : output->geterror();
    }

    std::string encodeAnimation(const std::string& name, std::span<const Sheet> sheets, double framesPerSecond,
                                std::vector<unsigned char>& file) const override {
        const auto output = OIIO::ImageOutput::create(name);
        if (!output || !output->supports("multiimage")) return "this kind of picture cannot be animated";
        OIIO::Filesystem::IOVecOutput memory(file);
        if (!output->set_ioproxy(&memory)) return output->geterror();
        for (const Sheet& sheet : sheets) {
            OIIO::ImageSpec spec(sheet.width, sheet.height, 4, OIIO::TypeDesc::UINT8);
            spec.attribute("gif:LoopCount", 0);
            const auto mode = &sheet == sheets.data() ? OIIO::ImageOutput::Create : OIIO::ImageOutput::AppendSubimage;
            if (!output->open(name, spec, mode) || !output->write_image(OIIO::TypeDesc::UINT8, sheet.bytes))
                return output->geterror();
        }
        if (!output->close()) return output->geterror();
        setDelays(file, framesPerSecond);
        return {};
    }

    void workAlone() const override {
        OIIO::attribute("threads", 1);
        OIIO::attribute("exr_threads", -1);
        (void)OIIO::get_string_attribute("format_list");  // finds its readers
        keepFewTiles();
    }
};

/// OpenImageIO 2.5 lets libtiff print faults of files that it only tries; callers say what is wrong with a file.
void keepTiffQuiet() {
    void* const tiff = ::dlopen("libtiff.so.6", RTLD_NOW | RTLD_NOLOAD);
    if (!tiff) return;
    using Handler = void (*)(const char*, const char*, std::va_list);
    using Set = Handler (*)(Handler);
    for (const char* name : {"TIFFSetErrorHandler", "TIFFSetWarningHandler"})
        if (void* const set = ::dlsym(tiff, name)) (void)reinterpret_cast<Set>(set)(nullptr);
}

}  // namespace

}  // namespace rtsg

extern "C" __attribute__((visibility("default"))) const rtsg::ImageFiles* RTSG_IMAGE_FILES_SYMBOL() {
    static const rtsg::Files files;
    rtsg::keepTiffQuiet();
    return &files;
}
