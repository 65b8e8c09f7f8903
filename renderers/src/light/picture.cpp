#include <rtsg/renderers/picture.h>

#include <algorithm>
#include <cmath>

#include <OpenImageIO/imageio.h>

namespace rtsg {

namespace {

bool isLinearFormat(const std::string& extension) {
    return extension == ".exr" || extension == ".hdr" || extension == ".pfm" || extension == ".tif" ||
           extension == ".tiff";
}

std::string lowerExtension(const std::filesystem::path& file) {
    std::string extension = file.extension().string();
    std::ranges::transform(extension, extension.begin(),
                           [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return extension;
}

Result<> checkSize(const Picture& picture, const std::filesystem::path& file) {
    if (picture.width <= 0 || picture.height <= 0) return fail("the picture is empty", {}, file.string());
    return {};
}

std::uint8_t toByte(float value) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0f, 1.0f) * 255.0f));
}

}  // namespace

Vec3f ToneMap::apply(Vec3f linear) const {
    // A NaN in a picture is a bug elsewhere; black shows it without undefined conversions.
    for (int c = 0; c < 3; ++c) linear[c] = std::isfinite(linear[c]) ? std::max(linear[c] * exposure, 0.0f) : 0.0f;
    const float peak = std::max({linear.r, linear.g, linear.b});
    if (peak <= 1) return linear;
    // Keep the hue at the gamut's edge and mix in white with what was lost.
    const float white = 1 - 1 / peak;
    return linear / peak * (1 - white) + Vec3f(white);
}

float srgbFromLinear(float linear) {
    return linear <= 0.0031308f ? linear * 12.92f : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
}

float linearFromSrgb(float encoded) {
    return encoded <= 0.04045f ? encoded / 12.92f : std::pow((encoded + 0.055f) / 1.055f, 2.4f);
}

std::vector<std::uint8_t> toSrgb8(const Picture& picture, const ToneMap& toneMap) {
    std::vector<std::uint8_t> bytes;
    bytes.reserve(picture.pixels.size() * 4);
    for (const Vec4f& pixel : picture.pixels) {
        const float alpha = std::clamp(pixel.a, 0.0f, 1.0f);
        const Vec3f color = toneMap.apply(alpha > 0 ? Vec3f(pixel) / alpha : Vec3f(pixel));
        for (int c = 0; c < 3; ++c) bytes.push_back(toByte(srgbFromLinear(color[c])));
        bytes.push_back(toByte(alpha));
    }
    return bytes;
}

Result<> writePicture(const Picture& picture, const std::filesystem::path& file, const ToneMap& toneMap) {
    if (auto ok = checkSize(picture, file); !ok) return ok;
    const std::string extension = lowerExtension(file);
    if (extension == ".gif") return writeAnimation({&picture, 1}, file, 1, toneMap);
    auto output = OIIO::ImageOutput::create(file.string());
    if (!output) return fail("cannot write this kind of picture: " + OIIO::geterror(), {}, file.string());
    const bool linear = isLinearFormat(extension);
    const bool opaque = std::ranges::all_of(picture.pixels, [](const Vec4f& p) { return p.a >= 1; });
    const int channels = output->supports("alpha") && (linear || !opaque) ? 4 : 3;
    OIIO::ImageSpec spec(picture.width, picture.height, channels,
                         linear ? OIIO::TypeDesc::FLOAT : OIIO::TypeDesc::UINT8);
    spec.attribute("oiio:ColorSpace", linear ? "Linear" : "sRGB");
    if (linear) spec.attribute("compression", "zip");
    if (!linear) spec.attribute("oiio:UnassociatedAlpha", 1);
    if (!output->open(file.string(), spec)) return fail(output->geterror(), {}, file.string());
    bool ok;
    if (linear) {
        ok = output->write_image(OIIO::TypeDesc::FLOAT, picture.pixels.data(), sizeof(Vec4f));
    } else {
        const auto bytes = toSrgb8(picture, toneMap);
        ok = output->write_image(OIIO::TypeDesc::UINT8, bytes.data(), 4);
    }
    if (!ok || !output->close()) return fail(output->geterror(), {}, file.string());
    return {};
}

Result<> writeAnimation(std::span<const Picture> frames, const std::filesystem::path& file, double framesPerSecond,
                        const ToneMap& toneMap) {
    if (frames.empty()) return fail("there are no frames", {}, file.string());
    auto output = OIIO::ImageOutput::create(file.string());
    if (!output || !output->supports("multiimage"))
        return fail("this kind of picture cannot be animated", {}, file.string());
    for (const Picture& frame : frames) {
        if (auto ok = checkSize(frame, file); !ok) return ok;
        if (frame.width != frames[0].width || frame.height != frames[0].height)
            return fail("the frames differ in size", {}, file.string());
        OIIO::ImageSpec spec(frame.width, frame.height, 4, OIIO::TypeDesc::UINT8);
        spec.attribute("FramesPerSecond", OIIO::TypeRational,
                       std::vector<int>{static_cast<int>(std::lround(framesPerSecond * 100)), 100}.data());
        spec.attribute("gif:LoopCount", 0);
        const auto mode = &frame == frames.data() ? OIIO::ImageOutput::Create : OIIO::ImageOutput::AppendSubimage;
        if (!output->open(file.string(), spec, mode)) return fail(output->geterror(), {}, file.string());
        auto bytes = toSrgb8(frame, toneMap);
        if (!output->write_image(OIIO::TypeDesc::UINT8, bytes.data()))
            return fail(output->geterror(), {}, file.string());
    }
    if (!output->close()) return fail(output->geterror(), {}, file.string());
    return {};
}

Result<Picture> readPicture(const std::filesystem::path& file) {
    auto input = OIIO::ImageInput::open(file.string());
    if (!input) return fail(OIIO::geterror(), {}, file.string());
    const OIIO::ImageSpec& spec = input->spec();
    const int channels = spec.nchannels;
    const bool encoded = spec.format != OIIO::TypeDesc::FLOAT && spec.format != OIIO::TypeDesc::HALF;
    Picture picture(spec.width, spec.height, Vec4f(0, 0, 0, 1));
    std::vector<float> values(picture.pixels.size() * static_cast<std::size_t>(channels));
    if (!input->read_image(0, 0, 0, channels, OIIO::TypeDesc::FLOAT, values.data()))
        return fail(input->geterror(), {}, file.string());
    for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
        const float* source = &values[i * static_cast<std::size_t>(channels)];
        Vec4f& pixel = picture.pixels[i];
        for (int c = 0; c < 3; ++c) {
            const float value = source[channels < 3 ? 0 : c];
            pixel[c] = encoded ? linearFromSrgb(value) : value;
        }
        if (channels == 2 || channels == 4) pixel.a = source[channels - 1];
    }
    return picture;
}

Result<PictureDifference> compare(const Picture& a, const Picture& b) {
    if (a.width != b.width || a.height != b.height) return fail("the pictures differ in size");
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
