// Opens pictures that are stored in tiles, and reads these through OpenImageIO's cache.
#include "tiles.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <functional>
#include <mutex>
#include <vector>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imagecache.h>
#include <OpenImageIO/imageio.h>

namespace rtsg {

namespace {

/// A file as OpenImageIO wants it. The cache reads one file from one thread at a time.
class SourceProxy final : public OIIO::Filesystem::IOProxy {
  public:
    SourceProxy(ByteSource source, const std::string& name) : IOProxy(name, Read), source_(std::move(source)) {}
    const char* proxytype() const override { return "ioproxy"; }
    std::size_t read(void* to, std::size_t length) override {
        const std::size_t got = pread(to, length, m_pos);
        m_pos += static_cast<std::int64_t>(got);
        return got;
    }
    std::size_t pread(void* to, std::size_t length, std::int64_t offset) override {
        if (offset < 0 || static_cast<std::uint64_t>(offset) >= source_.size) return 0;
        return source_.read(static_cast<std::uint64_t>(offset), to, length);
    }
    bool seek(std::int64_t offset) override {
        m_pos = offset;
        return true;
    }
    std::size_t size() const override { return source_.size; }

  private:
    ByteSource source_;
};

/// The one cache, which lives as long as the process: tiles of pictures that are gone leave it with them.
auto& cache() {
    static const auto created = [] {
        auto one = OIIO::ImageCache::create(false);
        one->attribute("max_memory_MB", static_cast<float>(TiledPicture::kCacheMegabytes));
        one->attribute("accept_untiled", 0);
        one->attribute("accept_unmipped", 0);
        one->attribute("unassociatedalpha", 1);
        return one;
    }();
    return created;
}

class Tiles final : public TiledPicture {
  public:
    ~Tiles() override {
        if (handle_) cache()->invalidate(OIIO::ustring(name_), true);
    }

    std::string open(ByteSource source, const std::string& name) {
        static std::atomic<std::uint64_t> opened = 0;
        // The cache knows pictures by their names; the extension says the format.
        name_ = "rtsg-" + std::to_string(++opened) + "-" + name;
        proxy_ = std::make_unique<SourceProxy>(std::move(source), name_);
        if (std::string why = look(name); !why.empty()) return why;
        OIIO::Filesystem::IOProxy* proxy = proxy_.get();
        OIIO::ImageSpec settings;
        settings.attribute("oiio:ioproxy", OIIO::TypeDesc(OIIO::TypeDesc::PTR), static_cast<void*>(&proxy));
        const OIIO::ustring known(name_);
        if (!cache()->add_file(known, nullptr, &settings)) return cache()->geterror();
        handle_ = cache()->get_image_handle(known);
        return handle_ && cache()->good(handle_) ? std::string() : cache()->geterror();
    }

    bool read(int level, int x, int y, int width, int height, float* pixels) const override {
        const auto count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
        bool done = true;
        const Grid& grid = grids_[static_cast<std::size_t>(level)];
        for (int row = y / grid.height; done && row <= (y + height - 1) / grid.height; ++row)
            for (int column = x / grid.width; done && column <= (x + width - 1) / grid.width; ++column)
                done = isSound(level, column, row);
        if (done && !fetch(level, x, y, width, height, pixels)) {
            noteDamage();
            done = false;
        }
        if (!done)
            std::fill_n(pixels, count * static_cast<std::size_t>(channels), 0.0f);
        else if (multiplied_)
            divide(pixels, count);
        return done;
    }

    std::string damage() const override {
        const std::lock_guard lock(mutex_);
        return damage_;
    }

  private:
    /// The tiles of a level.
    struct Grid {
        int width = 0, height = 0, columns = 0;
        std::size_t first = 0;  // of all
    };
    enum : std::uint8_t { unknown, sound, damaged };
    struct Free {
        void operator()(std::uint8_t* memory) const { std::free(memory); }
    };

    bool fetch(int level, int x, int y, int width, int height, float* pixels) const {
        return cache()->get_pixels(handle_, nullptr, 0, level, x, x + width, y, y + height, 0, 1, 0, channels,
                                   OIIO::TypeDesc::FLOAT, pixels);
    }

    /// The cache says once that a tile cannot be read, and gives what is in its memory from then on: so the first look
    /// at each tile is one thread's, and what it finds is kept.
    bool isSound(int level, int column, int row) const {
        const Grid& grid = grids_[static_cast<std::size_t>(level)];
        const std::size_t index = grid.first + static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.columns) +
                                  static_cast<std::size_t>(column);
        const std::atomic_ref state(states_[index]);
        if (const std::uint8_t known = state.load(std::memory_order_acquire); known != unknown) return known == sound;
        const std::lock_guard lock(looking_[index % looking_.size()]);
        if (const std::uint8_t known = state.load(std::memory_order_relaxed); known != unknown) return known == sound;
        float pixel[4];
        const bool done = fetch(level, column * grid.width, row * grid.height, 1, 1, pixel);
        if (!done) {
            noteDamage();
            // OpenImageIO 2.5 gives a file up with its first tile that cannot be read; the others still can.
            if (!cache()->good(handle_)) cache()->invalidate(OIIO::ustring(name_), true);
        }
        state.store(done ? sound : damaged, std::memory_order_release);
        return done;
    }

    void noteDamage() const {
        const std::lock_guard lock(mutex_);
        std::string why = cache()->geterror();
        if (damage_.empty()) damage_ = why.empty() ? "a tile cannot be read" : std::move(why);
    }

    /// Zeros, of which the system provides those that are written. False: too many.
    bool makeStates() {
        std::size_t count = 0;
        for (std::size_t i = 0; i < levels.size(); ++i) {
            Grid& grid = grids_[i];
            grid.columns = (levels[i].width - 1) / grid.width + 1;
            grid.first = count;
            count += static_cast<std::size_t>(grid.columns) *
                     static_cast<std::size_t>((levels[i].height - 1) / grid.height + 1);
        }
        constexpr std::size_t maximum = std::size_t{1} << 28;
        if (count <= maximum) states_.reset(static_cast<std::uint8_t*>(std::calloc(count, 1)));
        return states_ != nullptr;
    }

    /// Takes what the file says of itself and of its coarser copies.
    std::string look(const std::string& name) {
        const auto input = OIIO::ImageInput::open(name, nullptr, proxy_.get());
        if (!input) return OIIO::geterror();
        const OIIO::ImageSpec finest = input->spec();
        if (finest.tile_width <= 0 || finest.depth > 1) return "the picture is not stored in tiles";
        if (finest.x != 0 || finest.y != 0) return "the picture's pixels do not begin in its corner";
        channels = std::min(finest.nchannels, 4);
        encoded = finest.format != OIIO::TypeDesc::FLOAT && finest.format != OIIO::TypeDesc::HALF;
        eightBits = finest.format == OIIO::TypeDesc::UINT8;
        alpha_ = finest.alpha_channel < channels ? finest.alpha_channel : -1;
        multiplied_ = alpha_ >= 0 && finest.get_int_attribute("oiio:UnassociatedAlpha") == 0;
        for (int mip = 0; input->seek_subimage(0, mip); ++mip) {
            const OIIO::ImageSpec& spec = input->spec();
            const auto bytes = static_cast<std::uint64_t>(std::max(spec.tile_width, 0)) *
                               static_cast<std::uint64_t>(std::max(spec.tile_height, 0)) * spec.pixel_bytes();
            if (bytes == 0 || bytes > kMaxTileBytes) return "the picture's tiles are larger than 16 MiB";
            levels.push_back({spec.width, spec.height});
            grids_.push_back({spec.tile_width, spec.tile_height});
        }
        (void)input->geterror();
        const auto halves = [](const Level& fine, const Level& coarse) {
            return coarse.width == std::max(fine.width / 2, 1) && coarse.height == std::max(fine.height / 2, 1);
        };
        if (levels.size() < 2 || std::ranges::adjacent_find(levels, std::not_fn(halves)) != levels.end() ||
            levels.back().width * levels.back().height != 1)
            return "the picture is stored without its coarser copies down to one pixel";
        return makeStates() ? std::string() : "the picture has too many tiles";
    }

    void divide(float* pixels, std::size_t count) const {
        const auto all = static_cast<std::size_t>(channels), at = static_cast<std::size_t>(alpha_);
        for (std::size_t i = 0; i < count * all; i += all)
            for (std::size_t c = 0; c < all; ++c)
                if (c != at && pixels[i + at] > 0) pixels[i + c] /= pixels[i + at];
    }

    std::string name_;
    std::unique_ptr<SourceProxy> proxy_;
    OIIO::ImageCache::ImageHandle* handle_ = nullptr;
    std::vector<Grid> grids_;                       // of each level
    std::unique_ptr<std::uint8_t[], Free> states_;  // of each tile
    int alpha_ = -1;
    bool multiplied_ = false;
    mutable std::array<std::mutex, 16> looking_;  // of each a part of the tiles, so that threads read several at once
    mutable std::mutex mutex_;
    mutable std::string damage_;
};

}  // namespace

void keepFewTiles() {
    constexpr float kMegabytes = 32;
    cache()->attribute("max_memory_MB", kMegabytes);
}

std::string openTiledPicture(ByteSource source, const std::string& name, std::unique_ptr<TiledPicture>& out) {
    auto tiles = std::make_unique<Tiles>();
    if (std::string why = tiles->open(std::move(source), name); !why.empty()) return why;
    out = std::move(tiles);
    return {};
}

}  // namespace rtsg
