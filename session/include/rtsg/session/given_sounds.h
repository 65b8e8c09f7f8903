// The sounds that a user gives to sources which the scene does not bring along: microphones and streams.
//
// Live, pipes and devices are heard as their sound arrives. Otherwise a pipe is first read as far as needed.
// Threading: none.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <rtsg/audio/clip_library.h>
#include <rtsg/core/scene.h>
#include <rtsg/session/notices.h>

namespace rtsg {

struct GivenSound {
    enum class Kind : std::uint8_t { file, pipe, device };
    Kind kind = Kind::file;
    bool isStream = false;  // for StreamAudioSources; else for MicrophoneSources
    std::string option;     // for messages, such as "--stream"
    std::string id, name;   // name: of the file or the device
    std::optional<RawSound> raw;
};

/// Opens the sources. If not `live`, `seconds` of each pipe are read. IDs are checked in the scene, unless it is still
/// empty. Errors: a device that is not live (kUsageCode), sources that cannot be opened, and unknown IDs.
Result<ClipLibrary::UsersSounds> openGivenSounds(const std::vector<GivenSound>& sources, const Scene& scene, bool live,
                                                 double seconds, int sampleRate, const SessionContext& context);

}  // namespace rtsg
