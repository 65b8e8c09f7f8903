// Reads blocks of pictures by workers, and keeps those used last.
#include "sandbox_tiles.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <map>
#include <mutex>
#include <stdexcept>
#include <unordered_map>
#include <vector>

#include <rtsg/core/sandbox.h>

#include "head_bytes.h"
#include "sandbox_images.h"

namespace rtsg {

namespace {

constexpr int kTileBlock = 64;

/// The picture's name follows; level -1: only what the file says of itself.
struct TileJob {
    std::uint64_t picture = 0, size = 0;
    std::int32_t level = -1, x = 0, y = 0;
};
struct TileQuestion {
    std::uint64_t offset = 0, length = 0;
};
/// The levels follow.
struct TilesHead {
    std::uint32_t levels = 0, channels = 0, encoded = 0, eightBits = 0;
};

// ---- in the worker ---------------------------------------------------------------------------------------------

SandboxJob* currentJob = nullptr;

ByteSource sourceOf(std::uint64_t size) {
    return {size, [](std::uint64_t offset, void* to, std::size_t length) {
                std::size_t done = 0;
                while (done < length) {
                    const std::string part = currentJob->ask(
                        sandboxText(TileQuestion{offset + done, std::min(length - done, kMaxSandboxText)}));
                    if (part.empty()) break;
                    const std::size_t count = std::min(part.size(), length - done);
                    std::memcpy(static_cast<char*>(to) + done, part.data(), count);
                    done += count;
                }
                return done;
            }};
}

/// The picture of a job, which stays open for the next one.
const TiledPicture& pictureOf(const TileJob& wanted, std::string_view name) {
    constexpr std::size_t kOpen = 64;
    static std::map<std::uint64_t, std::unique_ptr<TiledPicture>> open;
    if (const auto found = open.find(wanted.picture); found != open.end()) return *found->second;
    const auto files = imageFilesHere();
    if (!files) throw std::runtime_error(files.error().text);
    std::unique_ptr<TiledPicture> picture;
    if (const std::string why = (*files)->openTiles(sourceOf(wanted.size), std::string(name), picture); !why.empty())
        throw std::runtime_error(why);
    if (open.size() >= kOpen) open.erase(open.begin());
    return *(open[wanted.picture] = std::move(picture));
}

void serveTiles(SandboxJob& job) {
    currentJob = &job;
    TileJob wanted;
    std::string_view name = job.head();
    takeSandboxNumbers(name, wanted);
    const TiledPicture& picture = pictureOf(wanted, name);
    if (wanted.level < 0) {
        std::string all = sandboxText(TilesHead{static_cast<std::uint32_t>(picture.levels.size()),
                                                static_cast<std::uint32_t>(picture.channels), picture.encoded ? 1U : 0U,
                                                picture.eightBits ? 1U : 0U});
        for (const TiledPicture::Level& level : picture.levels) all += sandboxText(level);
        std::memcpy(job.room(all.size()).data(), all.data(), all.size());
        return job.answer({});
    }
    const TiledPicture::Level& level = picture.levels.at(static_cast<std::size_t>(wanted.level));
    const int width = std::min(kTileBlock, level.width - wanted.x),
              height = std::min(kTileBlock, level.height - wanted.y);
    std::vector<float> pixels(static_cast<std::size_t>(width * height * picture.channels));
    const bool isRead = picture.read(wanted.level, wanted.x, wanted.y, width, height, pixels.data());
    const std::size_t size = pixels.size() * sizeof(float);
    std::memcpy(job.room(size).data(), pixels.data(), size);
    job.answer(isRead ? std::string() : picture.damage());
}

constexpr SandboxTask kTiles{"pictures in tiles", prepareImageFiles, serveTiles};

// ---- in the process that draws the picture -----------------------------------------------------------------------

struct Block {
    std::vector<float> pixels;  // none: it cannot be read
    int width = 0;
};
struct BlockKey {
    std::uint64_t picture = 0;
    std::int32_t level = 0, x = 0, y = 0;  // x, y: of the block
    bool operator==(const BlockKey&) const = default;
};
struct BlockHash {
    std::size_t operator()(const BlockKey& key) const {
        std::uint64_t hash = key.picture * 0x9E3779B97F4A7C15u;
        for (const std::int32_t part : {key.level, key.x, key.y})
            hash = (hash ^ static_cast<std::uint32_t>(part)) * 0xBF58476D1CE4E5B9u;
        return hash ^ hash >> 31;
    }
};

/// The blocks used last.
class BlockCache {
  public:
    std::shared_ptr<const Block> find(const BlockKey& key) {
        const std::scoped_lock lock(mutex_);
        const auto found = blocks_.find(key);
        if (found == blocks_.end()) return nullptr;
        found->second.used = ++clock_;
        return found->second.block;
    }
    void keep(const BlockKey& key, std::shared_ptr<const Block> block) {
        const std::scoped_lock lock(mutex_);
        bytes_ += block->pixels.size() * sizeof(float);
        blocks_[key] = {std::move(block), ++clock_};
        if (bytes_ <= kMaxBytes) return;
        // The older half goes.
        std::vector<std::uint64_t> times;
        for (const auto& [old, entry] : blocks_) times.push_back(entry.used);
        const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
        std::ranges::nth_element(times, middle);
        std::erase_if(blocks_, [&](const auto& one) { return one.second.used < *middle; });
        bytes_ = 0;
        for (const auto& [old, entry] : blocks_) bytes_ += entry.block->pixels.size() * sizeof(float);
    }
    void forget(std::uint64_t picture) {
        const std::scoped_lock lock(mutex_);
        std::erase_if(blocks_, [&](const auto& one) {
            if (one.first.picture != picture) return false;
            bytes_ -= one.second.block->pixels.size() * sizeof(float);
            return true;
        });
    }
    static BlockCache& instance() {
        static BlockCache& cache = *new BlockCache;  // pictures may go while the process ends
        return cache;
    }

  private:
    static constexpr std::size_t kMaxBytes = TiledPicture::kCacheMegabytes << 20;
    struct Entry {
        std::shared_ptr<const Block> block;
        std::uint64_t used = 0;
    };
    std::mutex mutex_;
    std::unordered_map<BlockKey, Entry, BlockHash> blocks_;
    std::uint64_t clock_ = 0;
    std::size_t bytes_ = 0;
};

class SandboxedTiles final : public TiledPicture {
  public:
    SandboxedTiles(ByteSource source, std::string name) : source_(std::move(source)), name_(std::move(name)) {
        static std::atomic<std::uint64_t> opened = 0;
        number_ = ++opened;
    }
    ~SandboxedTiles() override { BlockCache::instance().forget(number_); }

    std::string open() {
        const auto result = run(-1, 0, 0);
        if (!result) return result.error().text;
        std::string bytes(result->size(), '\0');
        std::string_view rest = bytes;
        TilesHead head;
        if (!result->read({reinterpret_cast<std::uint8_t*>(bytes.data()), bytes.size()}) ||
            !takeSandboxNumbers(rest, head) || head.channels - 1 >= 4)
            return kBroken;
        channels = static_cast<int>(head.channels), encoded = head.encoded != 0, eightBits = head.eightBits != 0;
        for (Level level; levels.size() < head.levels && takeSandboxNumbers(rest, level);) {
            // Each is half as large as the one before, as the reader of tiles has checked.
            const bool isSane = level.width >= 1 && level.height >= 1 &&
                                static_cast<std::uint64_t>(std::max(level.width, level.height)) <= kLargestSide;
            const bool fits = levels.empty() || (level.width == std::max(levels.back().width / 2, 1) &&
                                                 level.height == std::max(levels.back().height / 2, 1));
            if (!isSane || !fits) return kBroken;
            levels.push_back(level);
        }
        return levels.size() < 2 || levels.back().width * levels.back().height != 1 ? kBroken : "";
    }

    bool read(int level, int x, int y, int width, int height, float* pixels) const override {
        bool good = true;
        const auto each = static_cast<std::size_t>(channels);
        for (int by = y / kTileBlock; by <= (y + height - 1) / kTileBlock; ++by)
            for (int bx = x / kTileBlock; bx <= (x + width - 1) / kTileBlock; ++bx) {
                const std::shared_ptr<const Block> block = blockAt({number_, level, bx, by});
                good = good && !block->pixels.empty();
                const int left = std::max(x, bx * kTileBlock), right = std::min(x + width, (bx + 1) * kTileBlock);
                for (int row = std::max(y, by * kTileBlock); row < std::min(y + height, (by + 1) * kTileBlock); ++row) {
                    float* const to = pixels + static_cast<std::size_t>((row - y) * width + left - x) * each;
                    const std::size_t count = static_cast<std::size_t>(right - left) * each;
                    const auto from =
                        static_cast<std::size_t>((row - by * kTileBlock) * block->width + left - bx * kTileBlock);
                    if (block->pixels.empty())
                        std::fill_n(to, count, 0.0f);
                    else
                        std::copy_n(&block->pixels[from * each], count, to);
                }
            }
        return good;
    }

    std::string damage() const override {
        const std::scoped_lock lock(mutex_);
        return damage_;
    }

  private:
    static constexpr const char* kBroken = "the library that reads it is broken";

    Result<SandboxResult> run(int level, int x, int y) const {
        const TileJob wanted{number_, source_.size, level, x, y};
        return runSandboxed(kTiles, sandboxText(wanted, name_), {}, [this](std::string_view text) {
            TileQuestion asked;
            if (!takeSandboxNumbers(text, asked) || asked.offset >= source_.size) return std::string();
            std::string part(static_cast<std::size_t>(
                                 std::min<std::uint64_t>({asked.length, kMaxSandboxText, source_.size - asked.offset})),
                             '\0');
            part.resize(source_.read(asked.offset, part.data(), part.size()));
            return part;
        });
    }

    /// Neighbours look at the same blocks, each thread at its own.
    std::shared_ptr<const Block> blockAt(const BlockKey& key) const {
        struct Seen {
            BlockKey key;
            std::shared_ptr<const Block> block;
        };
        thread_local std::array<Seen, 16> seen;
        Seen& mine = seen[BlockHash()(key) % seen.size()];
        if (mine.block && mine.key == key) return mine.block;
        auto block = BlockCache::instance().find(key);
        if (!block) {
            block = readBlock(key);
            BlockCache::instance().keep(key, block);
        }
        mine = {key, block};
        return block;
    }

    std::shared_ptr<const Block> readBlock(const BlockKey& key) const {
        auto block = std::make_shared<Block>();
        const Level& level = levels[static_cast<std::size_t>(key.level)];
        block->width = std::min(kTileBlock, level.width - key.x * kTileBlock);
        const int height = std::min(kTileBlock, level.height - key.y * kTileBlock);
        const auto result = run(key.level, key.x * kTileBlock, key.y * kTileBlock);
        std::string why = result ? result->head() : result.error().text;
        block->pixels.resize(static_cast<std::size_t>(block->width * height * channels));
        const std::size_t size = block->pixels.size() * sizeof(float);
        if (why.empty() &&
            (result->size() != size || !result->read({reinterpret_cast<std::uint8_t*>(block->pixels.data()), size})))
            why = kBroken;
        if (why.empty()) return block;
        block->pixels.clear();
        const std::scoped_lock lock(mutex_);
        if (damage_.empty()) damage_ = std::move(why);
        return block;
    }

    ByteSource source_;
    std::string name_;
    std::uint64_t number_ = 0;
    mutable std::mutex mutex_;
    mutable std::string damage_;
};

}  // namespace

std::string openTilesSandboxed(ByteSource source, const std::string& name, std::unique_ptr<TiledPicture>& out) {
    auto tiles = std::make_unique<SandboxedTiles>(std::move(source), name);
    if (std::string why = tiles->open(); !why.empty()) return why;
    out = std::move(tiles);
    return {};
}

}  // namespace rtsg
