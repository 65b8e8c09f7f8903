// Texture: a picture that surfaces look colours up in, with its coarser copies, and where it comes from.
//
// Invariant: (s, t) = (0, 0) is the lower left corner of the picture, (1, 1) the upper right; look-ups are linear
// radiance (sRGB-decoded where the source is a display picture). Threading: immutable once made; share freely.
// Source: ISO/IEC 19775-1 V4.0 18.2.3 (texture coordinates), 18.4.1 (ImageTexture), 18.4.5 (PixelTexture), 18.4.8
// (TextureTransform); 5.3.6 (SFImage). Williams 1983 for the coarser copies.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/value.h>

namespace rtsg {

/// What lies beyond 0 and 1 (TextureProperties.boundaryMode, or repeatS and repeatT).
enum class TextureWrap : std::uint8_t { repeat, mirror, clamp };

/// How a texture is read; the same Texture may be read in several ways.
struct TextureAccess {
    TextureWrap wrapS = TextureWrap::repeat, wrapT = TextureWrap::repeat;
    bool smooth = true;  // bilinear; otherwise the nearest pixel
};

class Texture {
  public:
    /// Encoded: display values (sRGB), decoded on look-up. Data: numbers such as normals or roughness, left alone.
    enum class Content : std::uint8_t { color, data };

    /// `channels` 1 (grey), 2 (grey, alpha), 3 or 4 per pixel, row by row from the lower left. Errors: no pixels, more
    /// than 2^15 a side.
    static Result<Texture> fromBytes(std::span<const std::uint8_t> bytes, int width, int height, int channels,
                                     Content content = Content::color);
    /// Linear RGBA, row by row from the lower left.
    static Result<Texture> fromFloats(std::vector<Vec4f> pixels, int width, int height, int channels = 4);
    static Result<Texture> fromImage(const Image& image, Content content = Content::color);
    /// Anything that OpenImageIO reads; half, float and 16-bit pictures keep their range. Refuses more than
    /// `maximumPixels` before it takes memory for them: up to 10 bytes a pixel while reading; pictures with more than 8
    /// bits a channel take, and count, four times as much.
    static Result<Texture> fromFile(const std::filesystem::path& file, Content content = Content::color,
                                    std::uint64_t maximumPixels = std::uint64_t{1} << 26);
    /// The bytes of a picture file. `name`: its extension says the format.
    static Result<Texture> fromMemory(std::span<const std::uint8_t> file, const std::string& name,
                                      Content content = Content::color,
                                      std::uint64_t maximumPixels = std::uint64_t{1} << 26);

    int width() const { return levels_.empty() ? 0 : levels_[0].width; }
    int height() const { return levels_.empty() ? 0 : levels_[0].height; }
    int channels() const { return channels_; }
    /// Whether any pixel lets something through.
    bool hasAlpha() const { return hasAlpha_; }
    /// Whether any pixel is neither wholly opaque nor wholly clear.
    bool hasPartialAlpha() const { return hasPartialAlpha_; }
    std::size_t bytes() const;
    /// Of the finest level: 4, or 16 for pictures with more than 8 bits a channel.
    unsigned bytesPerPixel() const { return levels_.empty() || levels_[0].linear.empty() ? 4 : 16; }

    /// `footprint`: side of the pixel's image on the texture, as a share of the texture's own side; picks the level.
    /// 0: the finest. Coordinates that are not finite give the colour at 0, 0.
    Vec4f sample(float s, float t, float footprint, const TextureAccess& access) const;

  private:
    struct Level {
        int width = 0, height = 0;
        std::vector<std::uint32_t> encoded;  // R | G << 8 | B << 16 | A << 24
        std::vector<Vec4f> linear;           // instead, for pictures with more than 8 bits
    };
    Vec4f texel(const Level& level, int x, int y) const;
    Vec4f sampleLevel(const Level& level, float s, float t, const TextureAccess& access) const;
    void buildLevels();
    void noteAlpha();

    std::vector<Level> levels_;
    int channels_ = 0;
    Content content_ = Content::color;
    bool hasAlpha_ = false, hasPartialAlpha_ = false;
};

/// 18.4.8: Tc' = -C * S * R * C * T * Tc, as two rows (x, y, constant).
struct TextureMatrix {
    Vec3f s{1, 0, 0}, t{0, 1, 0};
    static TextureMatrix fromTransform(Vec2f center, float rotation, Vec2f scale, Vec2f translation);
    Vec2f apply(Vec2f st) const { return {s.x * st.x + s.y * st.y + s.z, t.x * st.x + t.y * st.y + t.z}; }
    /// Factor by which lengths in texture space grow, the geometric mean of both directions.
    float stretch() const;
    friend bool operator==(const TextureMatrix&, const TextureMatrix&) = default;
};

}  // namespace rtsg
