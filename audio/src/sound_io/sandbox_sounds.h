// Sounds that are read in the sandbox: the same functions as those of sound_file.h.
//
// Threading: any thread.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <rtsg/audio/sound_file.h>

#include "sound_bytes.h"

namespace rtsg {

/// `whole`: all bytes, if they are in memory; else the worker asks for those that it reads.
Result<SoundBuffer> readSoundSandboxed(const SoundBytes& file, std::string_view whole, std::uint64_t maxSamples,
                                       std::string& damage);
Result<> checkSoundSandboxed(const SoundBytes& file);
Result<double> soundSecondsSandboxed(const SoundBytes& file);

/// The readers of this process, whether there is a sandbox or not.
Result<SoundBuffer> readSoundHere(SoundBytes bytes, std::uint64_t maxSamples, std::string& damage);
Result<> checkSoundHere(SoundBytes source);
Result<double> soundSecondsHere(SoundBytes source);

}  // namespace rtsg
