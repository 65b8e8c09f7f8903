// RoomResponses: impulse responses of a room from every source to every listener, and the SOFA file that holds them.
//
// A SOFA file (AES69-2022, SOFA 2.1) has a measurement for each pair, in the order of `pairs`. One pressure, two ears
// and ambisonic channels follow the convention SingleRoomSRIR 1.0; what is panned for two loudspeakers is no receiver
// in a room, and follows GeneralFIR 1.0. Its axes have z up: (x, y, z) of X3D becomes (x, -z, y); receivers lie in the
// listener's frame, which looks along x with y to the left. Data.IR holds the samples as they are in a WAV of the same
// responses, pressure 1 at 1 m; Data.Delay is 0. Ambisonic channels are AmbiX's (ACN, SN3D), as ReceiverDescription
// says. RoomType is "shoebox", with corners, where the walls are six that make a box; else "reverberant". The times in
// a file are those of writing, or of SOURCE_DATE_EPOCH. Threading: a plain value.

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
        glm::dvec3 sourceAim{0};                // where it points; 0 where it radiates alike to all sides
        glm::dmat3 listenerAxes{1.0};           // right, up, back
        ImpulseResponse response;
        double headRadius = kHeadRadius;  // of binaural responses: how far the ears are from the middle
    };
    std::string title, scene;  // the latter: a name or url of what the room is in
    std::string application, applicationVersion;
    ImpulseResponseOptions::Channels channels = ImpulseResponseOptions::Channels::mono;
    int ambisonicOrder = 1;
    int sampleRate = 48000;
    Air air;
    std::optional<RoomBox> box;  // if the room is one
    std::vector<Pair> pairs;
};

/// Errors: no pairs, or such with other channels or sample rates; no netCDF in this build; a file that cannot be
/// written. What was there stays whole until the new one is.
Result<> writeSofa(const std::string& path, const RoomResponses& responses);

}  // namespace rtsg
