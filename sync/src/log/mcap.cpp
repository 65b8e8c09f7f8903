// Writes MCAP files: chunks, their index, and a summary.
#include <rtsg/sync/mcap.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include <fmt/format.h>
#include <zlib.h>
#include <zstd.h>

#include <rtsg/core/module.h>

namespace rtsg::delayed {
extern DelayedLibrary zstd;
}

namespace rtsg {

namespace {

constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);
constexpr std::size_t kRecordPrefix = 9;  // opcode and length

enum class Op : std::uint8_t {
    header = 1,
    footer = 2,
    schema = 3,
    channel = 4,
    message = 5,
    chunk = 6,
    messageIndex = 7,
    chunkIndex = 8,
    statistics = 11,
    summaryOffset = 14,
    dataEnd = 15,
};

void putText(ByteBuffer& out, std::string_view text) {
    out.put(static_cast<std::uint32_t>(text.size()));
    out.append(text.data(), text.size());
}

/// Appends a record; `fill` appends its content.
template <class Fill>
void putRecord(ByteBuffer& out, Op op, const Fill& fill) {
    const std::size_t start = out.size();
    out.put(op);
    out.put(std::uint64_t{0});
    fill();
    const std::uint64_t length = out.size() - start - kRecordPrefix;
    std::memcpy(out.data() + start + 1, &length, sizeof(length));
}

/// Appends a map, with its length in front.
void putMap(ByteBuffer& out, const std::map<std::uint16_t, std::uint64_t>& map) {
    out.put(static_cast<std::uint32_t>(map.size() * 10));
    for (const auto& [key, value] : map) {
        out.put(key);
        out.put(value);
    }
}

std::uint32_t crc(std::uint32_t before, std::span<const std::byte> bytes) {
    return static_cast<std::uint32_t>(::crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

}  // namespace

McapWriter::McapWriter(std::filesystem::path file, McapOptions options) : file_(std::move(file)), options_(options) {}

McapWriter::~McapWriter() = default;

Result<std::unique_ptr<McapWriter>> McapWriter::create(const std::filesystem::path& file, McapOptions options) {
    std::unique_ptr<McapWriter> writer(new McapWriter(file, options));
    auto out = OutputFile::create(file, writer->options_.existing);
    if (!out) return std::unexpected(out.error());
    writer->out_ = std::move(*out);
    ByteBuffer bytes;
    bytes.append(kMagic.data(), kMagic.size());
    putRecord(bytes, Op::header, [&] {
        putText(bytes, "");
        putText(bytes, "rtsg");  // the library
    });
    if (auto ok = writer->put(bytes); !ok) return std::unexpected(ok.error());
    return writer;
}

Result<> McapWriter::put(const ByteBuffer& bytes) {
    if (!out_) return fail("the file is closed", {}, file_.string());
    if (auto ok = out_->write(bytes.bytes()); !ok) return ok;
    crc_ = crc(crc_, bytes.bytes());
    size_ += bytes.size();
    return {};
}

Result<std::uint16_t> McapWriter::addTopic(std::string_view topic, std::string_view schemaName,
                                           std::string_view schema) {
    const auto number = static_cast<std::uint16_t>(topics_ + 1);
    const std::size_t schemaAt = schemas_.size(), channelAt = channels_.size();
    putRecord(schemas_, Op::schema, [&] {
        schemas_.put(number);
        putText(schemas_, schemaName);
        putText(schemas_, "jsonschema");
        putText(schemas_, schema);
    });
    putRecord(channels_, Op::channel, [&] {
        channels_.put(number);
        channels_.put(number);
        putText(channels_, topic);
        putText(channels_, "json");
        channels_.put(std::uint32_t{0});
    });
    topics_ = number;
    counts_[number] = 0;
    // Schemas and channels must come before the first chunk that refers to them.
    ByteBuffer both;
    both.append(schemas_.bytes().subspan(schemaAt));
    both.append(channels_.bytes().subspan(channelAt));
    if (auto ok = put(both); !ok) return std::unexpected(ok.error());
    return number;
}

Result<> McapWriter::write(std::uint16_t topic, double time, std::string_view json) {
    const auto counted = counts_.find(topic);
    if (counted == counts_.end()) return fail(fmt::format("there is no topic {}", topic), {}, file_.string());
    if (!(time >= 0) || time > 9e9) return fail(fmt::format("a message at t = {} s", time), {}, file_.string());
    const auto nanoseconds = static_cast<std::uint64_t>(std::llround(time * 1e9));
    if (messages_ == 0) start_ = nanoseconds;
    end_ = std::max(end_, nanoseconds);
    if (chunkIndex_.empty()) chunkStart_ = chunkEnd_ = nanoseconds;
    chunkStart_ = std::min(chunkStart_, nanoseconds);
    chunkEnd_ = std::max(chunkEnd_, nanoseconds);
    chunkIndex_[topic].emplace_back(nanoseconds, chunk_.size());
    putRecord(chunk_, Op::message, [&] {
        chunk_.put(topic);
        chunk_.put(static_cast<std::uint32_t>(counted->second));
        chunk_.put(nanoseconds);
        chunk_.put(nanoseconds);
        chunk_.append(json.data(), json.size());
    });
    ++counted->second;
    ++messages_;
    return chunk_.size() < options_.chunkBytes ? Result<>{} : endChunk();
}

Result<> McapWriter::endChunk() {
    if (chunkIndex_.empty()) return {};
    std::span<const std::byte> content = chunk_.bytes();
    ByteBuffer packed;
    if (options_.compress) {
        if (const auto loaded = delayed::zstd.load(); !loaded) return loaded;
        std::byte* room = packed.room(ZSTD_compressBound(content.size()));
        const std::size_t size =
            ZSTD_compress(room, packed.capacity(), content.data(), content.size(), ZSTD_CLEVEL_DEFAULT);
        if (ZSTD_isError(size)) return fail(ZSTD_getErrorName(size), {}, file_.string());
        packed.advance(size);
        content = packed.bytes();
    }
    Chunk chunk;
    chunk.start = chunkStart_;
    chunk.end = chunkEnd_;
    chunk.offset = size_;
    chunk.plain = chunk_.size();
    chunk.compressed = content.size();
    ByteBuffer out;
    putRecord(out, Op::chunk, [&] {
        out.put(chunk.start);
        out.put(chunk.end);
        out.put(chunk.plain);
        out.put(crc(0, chunk_.bytes()));
        putText(out, options_.compress ? "zstd" : "");
        out.put(chunk.compressed);
        out.append(content);
    });
    chunk.length = out.size();
    for (const auto& [topic, entries] : chunkIndex_) {
        chunk.indexOffsets[topic] = size_ + out.size();
        putRecord(out, Op::messageIndex, [&] {
            out.put(topic);
            out.put(static_cast<std::uint32_t>(entries.size() * 16));
            for (const auto& [time, offset] : entries) {
                out.put(time);
                out.put(offset);
            }
        });
    }
    chunk.indexLength = out.size() - chunk.length;
    chunks_.push_back(std::move(chunk));
    chunk_.clear();
    chunkIndex_.clear();
    return put(out);
}

Result<> McapWriter::close() {
    if (!out_) return {};
    if (auto ok = endChunk(); !ok) return ok;
    ByteBuffer out;
    putRecord(out, Op::dataEnd, [&] { out.put(crc_); });
    if (auto ok = put(out); !ok) return ok;

    out.clear();
    const std::uint64_t summary = size_;
    struct Group {
        Op op;
        std::uint64_t start, length;
    };
    std::vector<Group> groups;
    const auto group = [&](Op op, const auto& fill) {
        const std::uint64_t start = out.size();
        fill();
        if (out.size() > start) groups.push_back({op, summary + start, out.size() - start});
    };
    group(Op::schema, [&] { out.append(schemas_.bytes()); });
    group(Op::channel, [&] { out.append(channels_.bytes()); });
    group(Op::statistics, [&] {
        putRecord(out, Op::statistics, [&] {
            out.put(messages_);
            out.put(topics_);
            out.put(std::uint32_t{topics_});
            out.put(std::uint32_t{0});
            out.put(std::uint32_t{0});
            out.put(static_cast<std::uint32_t>(chunks_.size()));
            out.put(start_);
            out.put(end_);
            putMap(out, counts_);
        });
    });
    group(Op::chunkIndex, [&] {
        for (const Chunk& chunk : chunks_)
            putRecord(out, Op::chunkIndex, [&] {
                out.put(chunk.start);
                out.put(chunk.end);
                out.put(chunk.offset);
                out.put(chunk.length);
                putMap(out, chunk.indexOffsets);
                out.put(chunk.indexLength);
                putText(out, options_.compress ? "zstd" : "");
                out.put(chunk.compressed);
                out.put(chunk.plain);
            });
    });
    const std::uint64_t offsets = summary + out.size();
    for (const Group& g : groups)
        putRecord(out, Op::summaryOffset, [&] {
            out.put(g.op);
            out.put(g.start);
            out.put(g.length);
        });
    putRecord(out, Op::footer, [&] {
        out.put(summary);
        out.put(offsets);
        out.put(std::uint32_t{0});
    });
    const std::uint32_t checksum = crc(0, out.bytes().first(out.size() - 4));
    std::memcpy(out.data() + out.size() - 4, &checksum, sizeof(checksum));
    out.append(kMagic.data(), kMagic.size());
    Result<> result = put(out);
    if (result) result = out_->commit();
    out_.reset();
    return result;
}

}  // namespace rtsg
