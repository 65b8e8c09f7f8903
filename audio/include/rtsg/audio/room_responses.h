// RoomResponses: impulse responses of a room from every source to every listener, and the SOFA file that holds them.
//
// A SOFA file (AES69-2022, SOFA 2.1) has a measurement for each pair, in the order of `pairs`. Pressure, binaural and
// ambisonic responses follow the convention SingleRoomSRIR 1.0. Stereo responses, which no receiver in a room would
// record, follow GeneralFIR 1.0. The axes of SOFA have z up: (x, y, z) of X3D becomes (x, -z, y). Receivers lie in the
// listener's frame, which looks along x with y to the left. Data.IR holds the same samples as a WAV of the responses,
// with pressure 1 at 1 m; Data.Delay is 0. Ambisonic channels are AmbiX (ACN, SN3D), as ReceiverDescription says.
// RoomType is "shoebox", with corners, if six walls form a box; otherwise "reverberant". The times in a file are those
// of writing, or SOURCE_DATE_EPOCH. Threading: a plain value.

// Example:
//     #include <cstdio>
//     #include <rtsg/audio/room_responses.h>
//     rtsg::RoomResponses room;  // of SoundRenderer::survey() by SoundRenderer::responses()
//     const auto written = rtsg::writeSofa("room.sofa", room);
//     if (!written) std::puts(written.error().text.c_str());  // there are no responses to write
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/impulse_response.h>
#include <rtsg/core/diagnostic.h>

namespace rtsg {

/// A box along the axes of the world.
struct RoomBox {
    glm::dvec3 low{0}, high{0};
};

struct RoomResponses {
    struct Pair {
        std::string source, listener;
        glm::dvec3 sourceAt{0}, listenerAt{0};  // m, world
        glm::dvec3 sourceAim{0};                // where it points; 0 if it is omnidirectional
        glm::dmat3 listenerAxes{1.0};           // right, up, back
        ImpulseResponse response;
        double headRadius = kHeadRadius;  // of binaural responses: distance of the ears from the middle
    };
    std::string title, scene;  // `scene`: a name or url of the document with the room
    std::string application, applicationVersion;
    ImpulseResponseOptions::Channels channels = ImpulseResponseOptions::Channels::mono;
    int ambisonicOrder = 1;
    int sampleRate = 48000;
    Air air;
    std::optional<RoomBox> box;  // set if the room is a box
    std::vector<Pair> pairs;
};

/// Errors: there are no pairs, or pairs with different channels or sample rates; this build has no netCDF; the file
/// cannot be written. An existing file is replaced only when the new one is complete.
Result<> writeSofa(const std::string& path, const RoomResponses& responses);

}  // namespace rtsg
