// Deflates runs of blocks with zlib. Inflates them into as much memory as they state, within the budget.
#include "deflated_blocks.h"

#include <limits>

#include <zlib.h>

#include "columns/blocks.h"

namespace rtsg::wire {

namespace {

constexpr int kRaw = -MAX_WBITS;    // no header and no checksum, as the record has one
constexpr int kMemory = 8;          // zlib's default
constexpr std::size_t kWorth = 64;  // shorter runs are not deflated
/// The longest input, because zlib counts in 32 bits.
constexpr std::size_t kLongest = std::numeric_limits<uInt>::max();

/// Returns nothing if the result is not shorter.
std::vector<std::byte> deflated(std::span<const std::byte> bytes, std::span<const std::byte> words) {
    std::vector<std::byte> out(bytes.size());
    z_stream stream{};
    if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, kRaw, kMemory, Z_DEFAULT_STRATEGY) != Z_OK) return {};
    if (!words.empty())
        deflateSetDictionary(&stream, reinterpret_cast<const Bytef*>(words.data()), static_cast<uInt>(words.size()));
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(bytes.data()));
    stream.avail_in = static_cast<uInt>(bytes.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = static_cast<uInt>(out.size());
    const bool whole = deflate(&stream, Z_FINISH) == Z_STREAM_END;
    out.resize(whole ? stream.total_out : 0);
    deflateEnd(&stream);
    return out;
}

/// Returns false if the stream is damaged or holds another number of bytes.
bool inflateInto(std::span<const std::byte> bytes, std::span<std::byte> out, std::span<const std::byte> words) {
    z_stream stream{};
    if (inflateInit2(&stream, kRaw) != Z_OK) return false;
    if (!words.empty())
        inflateSetDictionary(&stream, reinterpret_cast<const Bytef*>(words.data()), static_cast<uInt>(words.size()));
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(bytes.data()));
    stream.avail_in = static_cast<uInt>(bytes.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = static_cast<uInt>(out.size());
    const bool whole = inflate(&stream, Z_FINISH) == Z_STREAM_END && stream.avail_out == 0 && stream.avail_in == 0;
    inflateEnd(&stream);
    return whole;
}

}  // namespace

std::size_t putDeflated(std::span<const std::byte> blocks, ByteBuffer& record, std::span<const std::byte> words) {
    const bool tried = blocks.size() >= kWorth && blocks.size() <= kLongest;
    const std::vector<std::byte> less = tried ? deflated(blocks, words) : std::vector<std::byte>();
    if (less.empty()) {
        record.append(blocks);
        return 0;
    }
    record.put(static_cast<std::uint8_t>(kDeflated));
    record.putVarint(0);
    record.putVarint(varintSize(blocks.size()) + less.size());
    record.putVarint(blocks.size());
    record.append(less.data(), less.size());
    return blocks.size();
}

std::optional<std::vector<std::byte>> inflateBlocks(Reader& payload, std::span<const std::byte> words) {
    const auto eachBlock = [&](const auto& take) {
        for (Reader in = payload; in.left() && !payload.problem;) {
            const std::byte* start = in.at;
            const auto kind = in.number<std::uint8_t>();
            (void)in.varint();
            Reader block = in.part(in.count(1));
            if (in.problem) return;  // whoever reads the blocks reports the problem
            take(kind, std::span(start, in.at), block);
        }
    };
    std::uint64_t size = 0;
    bool any = false;
    eachBlock([&](unsigned kind, std::span<const std::byte> whole, Reader& block) {
        any |= kind == kDeflated;
        size += kind == kDeflated ? block.varint() : whole.size();
        if (size > kLongest) payload.refuse("more blocks in a deflated one than can be");
    });
    if (!any || payload.problem || !payload.charge(size)) return std::nullopt;
    std::vector<std::byte> out;
    out.reserve(size);
    eachBlock([&](unsigned kind, std::span<const std::byte> whole, Reader& block) {
        if (kind != kDeflated) {
            out.insert(out.end(), whole.begin(), whole.end());
            return;
        }
        const std::size_t before = out.size();
        const std::uint64_t length = block.varint();
        if (block.problem || length > out.capacity() - before) return payload.refuse("a deflated block is cut short");
        out.resize(before + length);
        if (block.left() > kLongest || !inflateInto({block.at, block.left()}, std::span(out).subspan(before), words))
            payload.refuse("a deflated block is damaged");
    });
    return out;
}

}  // namespace rtsg::wire
