// --microphone and --stream: the sounds that the user gives to sources which the scene does not bring along.
//
// [ID=]SOURCE, where SOURCE is a sound file; a named pipe or - (standard input), which has WAV, or raw samples after
// s16@RATExCHANNELS: or f32@RATExCHANNELS:; or device, device:NAME. Only what is named here is opened. --stream-out
// says where a scene's own streams go.
//
// Live, pipes and devices are heard as their sound arrives. Otherwise a pipe is first read as far as needed.
// Threading: none.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <rtsg/audio/acoustic_renderer.h>
#include <rtsg/audio/clip_library.h>
#include <rtsg/session/given_sounds.h>

#include "cli.h"

namespace rtsg::app {

struct GivenSoundArguments {
    std::vector<std::string> microphones, streams;

    void addTo(Command& command);
    /// Checks what can be checked without opening anything. `inputs` are the verb's inputs: standard input can be only
    /// one of them. Throws UsageError.
    void check(const std::vector<std::string>& inputs) const;
    /// Names of files and pipes, which must not be overwritten. Throws UsageError.
    std::vector<std::string> files() const;
    /// What was typed, for openGivenSounds(). Throws UsageError.
    std::vector<GivenSound> sources() const;
    /// As openGivenSounds(). Throws UsageError for a device that is not live, InputError for sources that cannot be
    /// opened and for unknown IDs.
    ClipLibrary::UsersSounds open(const Scene& scene, bool live, double seconds, int sampleRate) const;
};

/// --stream-out: the files for what leads into StreamAudioDestinations, as [ID=]FILE.wav.
struct SentSoundArguments {
    std::vector<std::string> given;

    void addTo(Command& command);
    /// The files, for the checks against overwriting. Throws UsageError.
    std::vector<std::string> files() const;
    /// Writes to each file the sum of the streams with its ID, or of all streams. Error: there are none.
    Result<> write(const std::vector<StreamedSound>& streams) const;
};

}  // namespace rtsg::app
