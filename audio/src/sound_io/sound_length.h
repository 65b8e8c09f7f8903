// The length of a sound according to its file, and what is missing if the file is damaged or truncated.
//
// libsndfile takes the length that a WAV, AIFF or AU file states as the existing length. Threading: pure functions.
#pragma once

#include <cstdint>
#include <string>

#include <rtsg/audio/sound_file.h>

#include "sound_bytes.h"

namespace rtsg {

/// The length of the sound in a WAV, RF64, W64, AIFF or AU file by its header, divided by the existing length; 1 if it
/// is not longer, if the header does not tell, and for other files.
double promisedFraction(const SoundBytes& file);
/// A text, empty unless more than `tolerated` frames are missing of the `promised` ones (0 or less: not known).
std::string missingSound(double promised, const SoundBuffer& sound, double tolerated = 0);
/// A text: it ends with an error.
std::string unreadableFrom(const SoundBuffer& sound);
/// The error of readSound().
std::unexpected<Diagnostic> tooManySamples(std::uint64_t maxSamples);
/// Makes room for so many more samples. Error: the process may not hold twice as many as there are.
Result<> makeRoom(SoundBuffer& sound, std::size_t more);

}  // namespace rtsg
