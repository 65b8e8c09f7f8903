// Finds and loads the modules that read and write image files.
#include "image_files.h"

#include <algorithm>

#include <rtsg/core/module.h>
#include <rtsg/core/sandbox.h>

#include "sandbox_images.h"

namespace rtsg {

namespace {

bool isWebp(std::span<const std::uint8_t> bytes) {
    constexpr std::string_view kFirst = "RIFF", kLater = "WEBP";  // four bytes of a length between
    return bytes.size() > 12 && std::ranges::equal(bytes.first(4), kFirst) &&
           std::ranges::equal(bytes.subspan(8, 4), kLater);
}

}  // namespace

#ifdef RTSG_NO_IMAGES

Result<const ImageFiles*> imageFiles() {
    return fail("image files are neither read nor written: this build leaves them out (RTSG_IMAGES=OFF)");
}
Result<EncodePlain> plainEncoder(std::string_view) {
    return std::unexpected(imageFiles().error());
}
Result<ReadPlain> plainReaderHere(std::span<const std::uint8_t>) {
    return std::unexpected(imageFiles().error());
}
Result<const ImageFiles*> imageFilesHere() {
    return imageFiles();
}
Result<ReadExr> exrReader() {
    return std::unexpected(imageFiles().error());
}

#else

namespace {

#define RTSG_TEXT_OF(name) #name
#define RTSG_TEXT(name) RTSG_TEXT_OF(name)

Result<const ImageFiles*> load() {
    const auto symbol = loadModule("rtsg_oiio", RTSG_TEXT(RTSG_IMAGE_FILES_SYMBOL), "image files need");
    if (!symbol) return std::unexpected(symbol.error());
    return reinterpret_cast<const ImageFiles* (*)()>(*symbol)();
}

Result<EncodePlain> loadEncoder(const char* module, const char* name, std::string_view need) {
    const auto symbol = loadModule(module, name, need);
    if (!symbol) return std::unexpected(symbol.error());
    return reinterpret_cast<EncodePlain>(*symbol);
}

Result<ReadPlain> loadReader(const char* module, const char* name, std::string_view need) {
    const auto symbol = loadModule(module, name, need);
    if (!symbol) return std::unexpected(symbol.error());
    return reinterpret_cast<ReadPlain>(*symbol);
}

}  // namespace

Result<EncodePlain> plainEncoder(std::string_view extension) {
    if (extension == ".png") {
        static const auto png = loadEncoder("rtsg_plain", RTSG_TEXT(RTSG_ENCODE_PNG_SYMBOL), "PNG files need");
        return png;
    }
    if (extension == ".jpg" || extension == ".jpeg") {
        static const auto jpeg = loadEncoder("rtsg_plain", RTSG_TEXT(RTSG_ENCODE_JPEG_SYMBOL), "JPEG files need");
        return jpeg;
    }
#ifdef RTSG_EXR_MODULE
    if (extension == ".exr") {
        static const auto exr = loadEncoder("rtsg_exr", RTSG_TEXT(RTSG_ENCODE_EXR_SYMBOL), ".exr files need");
        return exr;
    }
#endif
#ifdef RTSG_WEBP_MODULE
    if (extension == ".webp") {
        static const auto webp = loadEncoder("rtsg_webp", RTSG_TEXT(RTSG_ENCODE_WEBP_SYMBOL), ".webp files need");
        return webp;
    }
#endif
    return nullptr;
}

Result<ReadPlain> plainReaderHere([[maybe_unused]] std::span<const std::uint8_t> bytes) {
#ifdef RTSG_WEBP_MODULE
    if (isWebp(bytes)) {
        static const auto webp = loadReader("rtsg_webp", RTSG_TEXT(RTSG_READ_WEBP_SYMBOL), ".webp files need");
        return webp;
    }
#endif
    static const auto plain = loadReader("rtsg_plain", RTSG_TEXT(RTSG_READ_PLAIN_SYMBOL), "PNG and JPEG files need");
    return plain;
}

Result<ReadExr> exrReader() {
#ifdef RTSG_EXR_MODULE
    static const auto symbol = loadModule("rtsg_exr", RTSG_TEXT(RTSG_READ_EXR_SYMBOL), ".exr files need");
    if (!symbol) return std::unexpected(symbol.error());
    return reinterpret_cast<ReadExr>(*symbol);
#else
    return fail(".exr files are not read with all their channels: this build has no OpenEXR of its own");
#endif
}

Result<const ImageFiles*> imageFilesHere() {
    static const Result<const ImageFiles*> files = load();
    return files;
}

Result<const ImageFiles*> imageFiles() {
    if (isSandboxed()) return &sandboxedImageFiles();
    return imageFilesHere();
}

#endif

bool isPlainKind(std::span<const std::uint8_t> bytes) {
    constexpr std::uint8_t kPng[] = {0x89, 'P', 'N', 'G'}, kJpeg[] = {0xFF, 0xD8, 0xFF};
    const auto begins = [&](std::span<const std::uint8_t> with) {
        return bytes.size() >= with.size() && std::ranges::equal(bytes.first(with.size()), with);
    };
    return begins(kPng) || begins(kJpeg) || isWebp(bytes);
}

Result<ReadPlain> plainReader(std::span<const std::uint8_t> bytes) {
    if (isSandboxed()) return readPlainSandboxed;
    return plainReaderHere(bytes);
}

}  // namespace rtsg
