// --microphone and --stream: what the sources of sound that a scene does not bring along hear, as the user says it.
//
// [ID=]SOURCE, where SOURCE is a sound file; a pipe with a name or - (standard input), whose sound is WAV, or raw
// after s16@RATExCHANNELS: or f32@RATExCHANNELS:; or device, device:NAME. Nothing is opened that was not named here.
// And --stream-out: where a scene's own streams go.
// Live, pipes and devices are heard as their sound comes; else as much of a pipe as is needed is read first. Threading:
// none.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <rtsg/audio/acoustic_engine.h>
#include <rtsg/audio/clip_library.h>

#include "cli.h"

namespace rtsg::app {

struct GivenSoundArguments {
    std::vector<std::string> microphones, streams;

    void addTo(Command& command);
    /// Checks what can be checked without opening anything. `inputs` are those of the verb: standard input can be only
    /// one of them. Throws UsageError.
    void check(const std::vector<std::string>& inputs) const;
    /// Names of files and pipes, which nothing is to be written over. Throws UsageError.
    std::vector<std::string> files() const;
    /// `seconds` of pipes are read if it is not live. The IDs are looked for in the scene, unless that is empty as yet.
    /// Throws UsageError for a device that is not live, InputError for what cannot be opened and for unknown IDs.
    ClipLibrary::UsersSounds open(const Scene& scene, bool live, double seconds, int sampleRate) const;
};

/// --stream-out: where what leads into StreamAudioDestinations goes, as the user says it: [ID=]FILE.wav.
struct SentSoundArguments {
    std::vector<std::string> given;

    void addTo(Command& command);
    /// The files, for what looks after them. Throws UsageError.
    std::vector<std::string> files() const;
    /// Writes each file: of the streams with its ID, or of all, the sum. Error: there are none.
    Result<> write(const std::vector<StreamedSound>& streams) const;
};

}  // namespace rtsg::app
