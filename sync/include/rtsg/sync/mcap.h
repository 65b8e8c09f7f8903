// McapWriter: writes messages on topics into an MCAP file, with chunks, index, summary and checksums. Foxglove and
// other viewers of robots' recordings read that format.
//
// Invariant: after close() the file is complete, with every checksum of the format. A file that was not closed never
// appears. Memory is bounded by one chunk, 16 bytes for each message in it, and 60 bytes for each chunk.
// Threading: one thread an object. Source: the MCAP specification, version 0 (mcap.dev/spec).
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/output_file.h>
#include <rtsg/sync/byte_buffer.h>

namespace rtsg {

struct McapOptions {
    std::uint64_t chunkBytes = std::uint64_t{1} << 20;
    bool compress = true;  // compresses chunks with zstd
    Existing existing = Existing::replace;
};

class McapWriter {
  public:
    static Result<std::unique_ptr<McapWriter>> create(const std::filesystem::path& file, McapOptions options = {});
    ~McapWriter();

    /// Adds a topic of JSON messages and returns its number. `schema` is a JSON Schema; viewers know it by
    /// `schemaName`. Call it before writing messages of the topic.
    Result<std::uint16_t> addTopic(std::string_view topic, std::string_view schemaName, std::string_view schema);
    /// `time` is in seconds, >= 0, and not before that of the last message.
    Result<> write(std::uint16_t topic, double time, std::string_view json);
    /// Writes index, summary and footer. Errors of the last writes are only reported here. Without close() there is no
    /// file.
    Result<> close();

    std::uint64_t messages() const { return messages_; }
    std::uint64_t bytes() const { return size_; }

  private:
    struct Chunk {
        std::uint64_t start = 0, end = 0, offset = 0, length = 0, indexLength = 0, compressed = 0, plain = 0;
        std::map<std::uint16_t, std::uint64_t> indexOffsets;
    };
    McapWriter(std::filesystem::path file, McapOptions options);
    Result<> put(const ByteBuffer& bytes);
    Result<> endChunk();

    std::filesystem::path file_;
    McapOptions options_;
    std::optional<OutputFile> out_;  // until it is closed
    std::uint64_t size_ = 0, messages_ = 0, start_ = 0, end_ = 0;
    std::uint32_t crc_ = 0;          // of all bytes so far
    ByteBuffer schemas_, channels_;  // the records that the summary repeats
    std::uint16_t topics_ = 0;
    std::map<std::uint16_t, std::uint64_t> counts_;
    ByteBuffer chunk_;  // records of the chunk being filled
    std::uint64_t chunkStart_ = 0, chunkEnd_ = 0;
    std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>> chunkIndex_;
    std::vector<Chunk> chunks_;
};

}  // namespace rtsg
