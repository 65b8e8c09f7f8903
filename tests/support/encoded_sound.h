// Sounds in the formats that libsndfile writes, as bytes.
#pragma once

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include <sndfile.h>

namespace rtsg::test {

/// Interleaved samples as a file of one of SF_FORMAT_*; empty if this build of libsndfile does not write such.
inline std::string encodedSound(int format, int sampleRate, int channels, const std::vector<float>& samples) {
    struct Bytes {
        std::string all;
        std::size_t at = 0;
        static Bytes& of(void* data) { return *static_cast<Bytes*>(data); }
    } bytes;
    SF_VIRTUAL_IO io{};
    io.get_filelen = [](void* data) { return static_cast<sf_count_t>(Bytes::of(data).all.size()); };
    io.tell = [](void* data) { return static_cast<sf_count_t>(Bytes::of(data).at); };
    io.seek = [](sf_count_t offset, int whence, void* data) {
        Bytes& b = Bytes::of(data);
        const std::size_t from = whence == SEEK_CUR ? b.at : whence == SEEK_END ? b.all.size() : 0;
        b.at = static_cast<std::size_t>(static_cast<sf_count_t>(from) + offset);
        return static_cast<sf_count_t>(b.at);
    };
    io.read = [](void* to, sf_count_t count, void* data) {
        Bytes& b = Bytes::of(data);
        const std::size_t got = b.at < b.all.size() ? b.all.copy(static_cast<char*>(to), std::size_t(count), b.at) : 0;
        b.at += got;
        return static_cast<sf_count_t>(got);
    };
    io.write = [](const void* from, sf_count_t count, void* data) {
        Bytes& b = Bytes::of(data);
        b.all.resize(std::max(b.all.size(), b.at + std::size_t(count)));
        std::memcpy(b.all.data() + b.at, from, std::size_t(count));
        b.at += std::size_t(count);
        return count;
    };
    SF_INFO info{};
    info.format = format;
    info.samplerate = sampleRate;
    info.channels = channels;
    SNDFILE* file = sf_format_check(&info) != 0 ? sf_open_virtual(&io, SFM_WRITE, &info, &bytes) : nullptr;
    if (!file) return {};
    sf_writef_float(file, samples.data(), static_cast<sf_count_t>(samples.size()) / channels);
    sf_close(file);
    return bytes.all;
}

}  // namespace rtsg::test
