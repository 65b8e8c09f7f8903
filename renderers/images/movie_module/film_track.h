// A film's sound as it is kept in it. Threading: one thread.
#pragma once

#include <vector>

#include "film_file.h"

namespace rtsg {

struct FilmTrack {
    AVStream* stream = nullptr;
    Owned<AVCodecContext> codec;  // whose time base the packets count in
    std::vector<Owned<AVPacket>> packets;
};

/// AAC of 96 kbit/s a channel, of one or two channels; adds its stream to a film whose header is not written yet.
std::string encodeSound(const FileSound& sound, AVFormatContext& format, FilmTrack& out);

/// Appends the packets that an encoder has ready. False, with the reason, if it failed.
bool takePackets(AVCodecContext& codec, std::vector<Owned<AVPacket>>& into, std::string& error);

}  // namespace rtsg
