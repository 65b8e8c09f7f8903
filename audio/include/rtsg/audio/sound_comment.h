// The comment of a sound's file: a text beside the samples, such as what the sound was made of.
//
// Threading: pure functions. Source: IBM and Microsoft, Multimedia Programming Interface and Data Specifications 1.0
// (RIFF, LIST INFO, ICMT).
#pragma once

#include <string>

#include <rtsg/audio/sound_file.h>

namespace rtsg {

/// As writeWav(), with a comment.
Result<> writeWavWithComment(const std::string& path, const SoundBuffer& sound, WavFormat format,
                             const std::string& comment);
/// Empty if the file has none. Error: it cannot be read.
Result<std::string> readSoundComment(const std::string& path);

}  // namespace rtsg
