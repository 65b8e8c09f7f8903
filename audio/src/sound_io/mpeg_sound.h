// MPEG audio (mp3 and related formats) by libmpg123 directly, since libsndfile lets it write to standard error.
//
// For an undamaged file, samples are the same as libsndfile's. Bytes that are no frame of sound are skipped and
// reported. Threading: pure functions.
#pragma once

#include <cstdint>
#include <string>

#include <rtsg/audio/sound_file.h>

#include "sound_bytes.h"

namespace rtsg {

/// Whether it begins as MPEG audio does, or with the tag (ID3v2) that is put before it.
bool isMpegSound(const SoundBytes& file);
/// The same as readSoundBytes(), for MPEG.
Result<SoundBuffer> readMpegSound(SoundBytes file, std::uint64_t maxSamples, std::string& damage);
/// By its header (Xing, LAME), or from its size and first frames.
Result<double> mpegSoundSeconds(SoundBytes file);

}  // namespace rtsg
