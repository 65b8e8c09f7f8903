// Recognises gzip and unpacks it, up to a bound.
#include "gzip.h"

#include <algorithm>

#include <zlib.h>

namespace rtsg::detail {

bool isGzip(std::string_view bytes) {
    return bytes.size() >= 2 && bytes[0] == '\x1f' && bytes[1] == '\x8b';
}

bool gunzip(std::string_view packed, std::string& out, Diagnostics& diagnostics, std::size_t limit) {
    z_stream stream{};
    constexpr int gzipOnly = 15 + 16;
    if (inflateInit2(&stream, gzipOnly) != Z_OK) {
        diagnostics.error({}, "zlib cannot start");
        return false;
    }
    constexpr std::size_t step = 1 << 18;
    const std::size_t before = out.size();
    std::size_t size = before;
    std::size_t read = 0;
    std::string failure;
    int status = Z_OK;
    while (failure.empty()) {
        if (stream.avail_in == 0) {
            const std::size_t some = std::min<std::size_t>(packed.size() - read, 1u << 30);
            stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data() + read));
            stream.avail_in = static_cast<uInt>(some);
            read += some;
        }
        if (size == out.size()) out.resize(size + std::max(step, (size - before) / 2));
        const std::size_t room = std::min<std::size_t>(out.size() - size, 1u << 30);
        stream.next_out = reinterpret_cast<Bytef*>(out.data() + size);
        stream.avail_out = static_cast<uInt>(room);
        status = inflate(&stream, Z_NO_FLUSH);
        size += room - stream.avail_out;
        if (size - before > limit) {
            failure = "the unpacked file is larger than the limit of " + std::to_string(limit) + " bytes";
        } else if (status == Z_STREAM_END) {
            const std::size_t rest = packed.size() - read + stream.avail_in;
            if (rest == 0) break;
            const std::string_view tail = packed.substr(packed.size() - rest);
            if (!isGzip(tail)) break;  // padding behind the last member is common
            inflateReset(&stream);
        } else if (status == Z_BUF_ERROR || (status == Z_OK && stream.avail_in == 0 && read == packed.size())) {
            if (stream.avail_out == 0) continue;
            failure = "the gzip file is truncated; what could be unpacked is used";
        } else if (status != Z_OK) {
            failure = std::string("the gzip file is damaged (") + (stream.msg ? stream.msg : "zlib") +
                      "); what could be unpacked is used";
        }
    }
    inflateEnd(&stream);
    out.resize(std::min(size, before + limit));
    if (failure.empty() && out.size() == before) failure = "the gzip file holds nothing";
    if (!failure.empty()) diagnostics.error({}, failure);
    return out.size() > before;
}

}  // namespace rtsg::detail
