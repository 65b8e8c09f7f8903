// Texture: a picture from which surfaces take colours, with its coarser copies (mipmap levels), and how it is read.
//
// Invariant: (s, t) = (0, 0) is the lower left corner of the picture, (1, 1) the upper right. Look-ups give colours in
// linear light or as display values, whichever is asked for, and are filtered in that space (pictures with more than 8
// bits always in linear light); coarser copies are made when the first look-up in their space needs them.
// Threading: as if immutable once made; share freely.
// Source: ISO/IEC 19775-1 V4.0 18.2.3 (texture coordinates), 18.4.1 (ImageTexture), 18.4.6 (PixelTexture), 18.4.10
// (TextureTransform); 5.3.6 (SFImage). Williams 1983 for the coarser copies.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/value.h>
#include <rtsg/renderers/color.h>

namespace rtsg {

/// How a texture continues beyond 0 and 1 (TextureProperties.boundaryModeS and so on, or repeatS and repeatT). `border`
/// means one colour.
enum class TextureWrap : std::uint8_t { repeat, mirror, clamp, border };

/// Which coarser copies are used if a pixel covers more than one texel: none, the one nearest in size, or a mix of the
/// two nearest.
enum class TextureLevels : std::uint8_t { finest, nearest, mixed };

/// How a texture is read; the same Texture may be read in several ways.
struct TextureAccess {
    TextureWrap wrapS = TextureWrap::repeat, wrapT = TextureWrap::repeat;
    bool smooth = true;     // if a pixel is smaller than a texel: bilinear; otherwise the nearest texel
    bool smoothFar = true;  // the same if it is larger
    TextureLevels levels = TextureLevels::mixed;
    TextureWrap wrapR = TextureWrap::repeat;  // for textures with three coordinates
    Vec4f border{0};                          // display values, as in the field
};

class LaneSampler;
class Resource;
class TiledPicture;

class Texture {
  public:
    /// Color: display values (sRGB), decoded by look-ups in linear light. Data: numbers such as normals or roughness,
    /// left alone.
    enum class Content : std::uint8_t { color, data };

    /// `channels` 1 (grey), 2 (grey, alpha), 3 or 4 per pixel, row by row from the lower left. Errors: no pixels, more
    /// than 2^15 a side.
    static Result<Texture> fromBytes(std::span<const std::uint8_t> bytes, int width, int height, int channels,
                                     Content content = Content::color);
    /// Linear RGBA, row by row from the lower left.
    static Result<Texture> fromFloats(std::vector<Vec4f> pixels, int width, int height, int channels = 4,
                                      Content content = Content::data);
    static Result<Texture> fromImage(const Image& image, Content content = Content::color);
    /// Reads any format that OpenImageIO supports, and KTX2; half, float and 16-bit pictures keep their range. A
    /// picture with more than `maximumPixels` is refused before memory is allocated for it. Reading takes up to 10
    /// bytes a pixel; pictures with more than 8 bits a channel take, and count as, four times as much.
    static Result<Texture> fromFile(const std::filesystem::path& file, Content content = Content::color,
                                    std::uint64_t maximumPixels = std::uint64_t{1} << 26);
    /// Reads the bytes of a picture file. The extension of `name` gives the format.
    static Result<Texture> fromMemory(std::span<const std::uint8_t> file, const std::string& name,
                                      Content content = Content::color,
                                      std::uint64_t maximumPixels = std::uint64_t{1} << 26);
    /// The same for a file that may hold several layers, from the lowest on.
    static Result<std::vector<Texture>> layersFromMemory(std::span<const std::uint8_t> file, const std::string& name,
                                                         Content content = Content::color,
                                                         std::uint64_t maximumPixels = std::uint64_t{1} << 26);

    /// Opens a picture that is too large to be kept in memory. It must be stored in tiles with its coarser copies
    /// (TIFF, EXR), as maketx writes them. Tiles are read when they are needed, into one cache of 256 MiB for all such
    /// textures. The coarser copies are the file's, whatever space they were averaged in. A picture with an alpha
    /// channel counts as partly transparent. The extension of `name` gives the format. Error: it is not stored in this
    /// way.
    static Result<Texture> fromTiles(std::shared_ptr<const Resource> file, const std::string& name,
                                     Content content = Content::color);
    bool inTiles() const { return tiles_ != nullptr; }
    /// The reason why a part of the file could not be read (that part is black in tiles, otherwise the decoder's
    /// choice); empty if all was read. May be called on any thread.
    std::string damage() const;

    int width() const { return finest_.width; }
    int height() const { return finest_.height; }
    int channels() const { return channels_; }
    /// Whether any pixel is not wholly opaque.
    bool hasAlpha() const { return hasAlpha_; }
    /// Whether any pixel is neither wholly opaque nor wholly clear.
    bool hasPartialAlpha() const { return hasPartialAlpha_; }
    /// The bytes that are in memory now, coarser copies included.
    std::size_t bytes() const;
    /// Bytes of a pixel of the finest level: 4, or 16 for pictures with more than 8 bits a channel.
    unsigned bytesPerPixel() const { return wide_ ? 16 : 4; }

    /// The pixels of one level, row by row from the lower left, in one of the two forms; in neither for a picture in
    /// tiles. Valid as long as the texture is.
    struct LevelPixels {
        int width = 0, height = 0;
        /// R | G << 8 | B << 16 | A << 24: display values; for data, the numbers themselves.
        std::span<const std::uint32_t> encoded;
        /// For pictures with more than 8 bits: linear light, or the numbers themselves.
        std::span<const Vec4f> linear;
    };
    /// The number of levels: the picture itself and its coarser copies, down to one pixel.
    int levels() const;
    /// Level 0 is the finest; each further one is half as wide and high. `space` (linear or display) is the one in
    /// which the pixels of coarser levels were averaged. Precondition: 0 <= number < levels().
    LevelPixels level(int number, ColorSpace space) const;

    /// The colour at (s, t). `footprint` is the side of the pixel's image on the texture, as a share of the texture's
    /// own side, and selects the level; 0 means the finest. Coordinates that are not finite give the colour at 0, 0.
    /// `space` (linear or display) is that of the result; for data it has no effect.
    Vec4f sample(float s, float t, float footprint, const TextureAccess& access,
                 ColorSpace space = ColorSpace::linear) const;
    /// Eight colours, channel by channel.
    struct Lanes {
        alignas(32) float r[8], g[8], b[8], a[8];
    };
    /// The same at eight places, bit for bit. Each bit of `lanes` says whether that lane is used; the others are
    /// undefined.
    void sampleLanes(const float* s, const float* t, const float* footprints, std::uint32_t lanes,
                     const TextureAccess& access, ColorSpace space, Lanes& out) const;

    /// A rectangle of the picture as its own texture, in pixels from the lower left; `turned`: rotated by half a turn.
    /// Precondition: the rectangle lies within the picture and is not empty.
    Texture part(int x, int y, int partWidth, int partHeight, bool turned = false) const;

  private:
    struct Level {
        int width = 0, height = 0, number = 0;
        std::vector<std::uint32_t> encoded;  // R | G << 8 | B << 16 | A << 24
        std::vector<Vec4f> linear;           // instead, for pictures with more than 8 bits
    };
    /// The coarser levels, averaged in one space.
    struct Coarse {
        std::mutex building;
        std::atomic<bool> built{false};
        std::vector<Level> levels;
    };
    Vec4f texel(const Level& level, int x, int y, bool decode) const;
    Vec4f sampleLevel(const Level& level, float s, float t, const TextureAccess& access, bool smooth,
                      bool decode) const;
    Vec4f sampleLevels(float s, float t, float footprint, const TextureAccess& access, bool decode) const;
    friend class LaneSampler;
    Vec4f borderColor(const TextureAccess& access, bool decode) const;
    const std::vector<Level>& coarse(bool decode) const;
    Level halved(const Level& fine, bool decode) const;
    void noteAlpha();
    /// Reads at most two by two pixels of a tiled picture into `out`, whose rows go upwards.
    void readTiles(const Level& level, int x, int y, int columns, int rows, bool decode, Vec4f* out) const;

    Level finest_{};
    std::shared_ptr<std::array<Coarse, 2>> coarse_ = std::make_shared<std::array<Coarse, 2>>();  // as stored, decoded
    std::shared_ptr<const TiledPicture> tiles_;  // in place of pixels in the levels
    std::string damage_;                         // for a texture that is kept in memory
    int channels_ = 0;
    bool wide_ = false;  // has more than 8 bits, stored as linear light
    Content content_ = Content::color;
    bool hasAlpha_ = false, hasPartialAlpha_ = false;
};

/// 18.4.10: Tc' = -C * S * R * C * T * Tc, as two rows (x, y, constant).
struct TextureMatrix {
    Vec3f s{1, 0, 0}, t{0, 1, 0};
    static TextureMatrix fromTransform(Vec2f center, float rotation, Vec2f scale, Vec2f translation);
    Vec2f apply(Vec2f st) const { return {s.x * st.x + s.y * st.y + s.z, t.x * st.x + t.y * st.y + t.z}; }
    /// The factor by which lengths in texture space grow: the geometric mean of both directions.
    float stretch() const;
    friend bool operator==(const TextureMatrix&, const TextureMatrix&) = default;
};

}  // namespace rtsg
