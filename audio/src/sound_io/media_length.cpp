// Asks sound files, films and packed sounds in turn.
#include <rtsg/audio/sound_file.h>

#include <rtsg/renderers/movie_sound.h>

namespace rtsg {

std::optional<double> mediaSeconds(const Resource& file, std::uint64_t maximumSamples) {
    auto seconds = soundSeconds(file);
    if (!seconds && isMovie(file)) seconds = movieSeconds(file);
    if (seconds) return *seconds;
    // The header of sound without pictures is unreliable, so it is decoded: it is as long as its samples.
    const auto sound = movieSound(file, maximumSamples);
    if (!sound) return std::nullopt;
    return static_cast<double>(sound->samples.size()) / sound->channels / sound->sampleRate;
}

}  // namespace rtsg
